"""Nodes that are no forest: each is shown once, and what is cut is listed."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from engine.scene.loaders.gltf import read_gltf
from engine.scene.loaders.gltf_nodes import MAX_DEPTH
from engine.scene.loaders.model import ImportedModel

Nodes = list[dict[str, Any]]


@pytest.fixture
def read(triangle_glb: tuple[dict, bytes], glb_file: Callable[..., Path]) -> Callable[..., ImportedModel]:
    """read(nodes, roots) reads a file of these nodes, whose mesh 0 is a triangle; roots None: without a scene."""

    def read(nodes: Nodes, roots: list[int] | None = None) -> ImportedModel:
        tree, binary = triangle_glb
        tree["nodes"] = nodes
        tree.pop("scene", None)
        tree["scenes"] = [{"nodes": roots}]
        if roots is None:
            del tree["scenes"]
        return read_gltf(glb_file(tree, binary))

    return read


def moved(x: float, *children: int, mesh: bool = True) -> dict[str, Any]:
    node: dict[str, Any] = {"translation": [x, 0, 0]}
    return node | ({"mesh": 0} if mesh else {}) | ({"children": list(children)} if children else {})


def places(model: ImportedModel) -> list[float]:
    """The least x of each triangle, in ascending order."""
    mesh = model.parts[0].mesh
    return sorted(mesh.vertices[mesh.triangles][:, :, 0].min(axis=1).tolist())


def cut(model: ImportedModel) -> int:
    return sum(each.count for each in model.unshown if each.name == "nodes.children")


def test_a_node_that_hangs_from_itself_is_shown_once(read: Callable[..., ImportedModel]) -> None:
    model = read([moved(1.0, 0)], [0])
    assert places(model) == [1.0] and cut(model) == 1
    assert "nodes 0: children = 0, left out: a node hangs from one other, and not from itself" in model.notes


def test_a_loop_is_cut_where_it_closes(read: Callable[..., ImportedModel]) -> None:
    assert places(read([moved(1.0, 1), moved(2.0, 2), moved(4.0, 0)], [0])) == [1.0, 3.0, 7.0]
    # Without a scene no node is a root: the first one stands for it.
    assert places(read([moved(1.0, 1), moved(2.0, 0)])) == [1.0, 3.0]


def test_a_node_with_two_parents_hangs_from_the_first(read: Callable[..., ImportedModel]) -> None:
    model = read([moved(1.0, 2), moved(10.0, 2), moved(0.5)], [0, 1])
    assert places(model) == [1.0, 1.5, 10.0] and cut(model) == 1


def test_a_root_that_hangs_from_another_is_shown_there(read: Callable[..., ImportedModel]) -> None:
    assert places(read([moved(0.5), moved(2.0, 0)], [0, 1])) == [2.0, 2.5]


def test_a_scene_that_names_no_node_shows_all(read: Callable[..., ImportedModel]) -> None:
    for roots in ([], [9]):
        model = read([moved(1.0, 1), moved(2.0)], roots)
        assert places(model) == [1.0, 3.0]
        assert "scenes 0: nodes = none, all nodes of the file are shown" in "\n".join(model.notes)


def test_nodes_that_are_too_deep_are_listed(read: Callable[..., ImportedModel]) -> None:
    n = MAX_DEPTH + 5
    model = read([moved(1.0, *([k + 1] if k < n - 1 else []), mesh=k == 0) for k in range(n)], [0])
    assert places(model) == [1.0]
    assert cut(model) == 1


def test_any_graph_shows_each_node_once(read: Callable[..., ImportedModel]) -> None:
    """The least x of a node's triangle tells which nodes are above it: each adds a power of two."""
    chance = random.Random(31)
    for _ in range(40):
        n = chance.randint(1, 8)
        named = {k: [chance.randrange(n) for _ in range(chance.randint(0, 3))] for k in range(n)}
        roots = [chance.randrange(n) for _ in range(chance.randint(0, 3))]
        found = places(read([moved(float(2**k), *named[k]) for k in range(n)], roots))
        reached, below = set(), list(roots or [k for k in range(n) if not any(k in named[j] for j in named if j != k)])
        below = below or [0]
        while below:
            k = below.pop()
            if k not in reached:
                reached.add(k)
                below += named[k]
        assert len(found) == len(reached)
        above = [{k for k in range(n) if int(x) >> k & 1} for x in found]
        assert set().union(*above) == reached
        assert len({frozenset(each) for each in above}) == len(above)
