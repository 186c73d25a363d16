"""The forest of a glTF file's nodes: which one hangs from which [glTF20, 3.5.2].

Files may give a node several parents, or let it hang from itself. The walk from the roots of the shown scene meets each
node once: where it comes to a node again, it cuts the edge.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from typing import NamedTuple

from engine.core.errors import printable_name
from engine.scene.loaders.gltf_file import GltfFile
from engine.scene.loaders.gltf_json import JsonObject

LONGEST_NAME = 64  # of nodes, cameras, lights, scenes, variants


class Forest(NamedTuple):
    """roots: of the scene that is shown; children: of each node; parents: of the nodes that have one; cut: nodes that a
    node names as children and that are shown elsewhere."""

    roots: list[int]
    children: dict[int, list[int]]
    parents: dict[int, int]
    cut: dict[int, list[int]]


def read_forest(file: GltfFile, root: JsonObject) -> Forest:
    """The forest of all nodes; a file without any has no roots."""
    n_nodes = len(file.nodes)
    named = {k: node.aside().indices("children", n_nodes) for k, node in enumerate(file.nodes) if node.has("children")}
    below = {child for k, children in named.items() for child in children if child != k}
    top = [k for k in range(n_nodes) if k not in below] or list(range(n_nodes))[:1]
    # A root that hangs from another node of the scene is met there first, under that one's transform.
    wanted = sorted(_named_roots(file, root, top), key=lambda k: k in below)
    forest = Forest([], {}, {}, {})
    met: set[int] = set()
    for k in wanted:
        if k not in met:
            forest.roots.append(k)
            _walk(k, named, met, forest)
    for k in chain(top, range(n_nodes)):
        if k in named and k not in met:
            _walk(k, named, met, forest)
    return forest


def _walk(start: int, named: dict[int, list[int]], met: set[int], forest: Forest) -> None:
    """Add the tree of a node that was not met yet."""
    met.add(start)
    stack = [start] if start in named else []
    while stack:
        k = stack.pop()
        for child in named[k]:
            if child in met:
                forest.cut.setdefault(k, []).append(child)
                continue
            met.add(child)
            forest.parents[child] = k
            forest.children.setdefault(k, []).append(child)
        stack += [child for child in reversed(forest.children.get(k, [])) if child in named]


def _named_roots(file: GltfFile, root: JsonObject, top: list[int]) -> Iterable[int]:
    """The nodes that the shown scene names; top: those that hang from none, which are shown where it names none."""
    scenes = root.children("scenes")
    if not scenes:
        return top
    shown = root.attempt("scene", "the first scene is shown", lambda: root.integer("scene", 0, len(scenes) - 1, 0))
    shown = shown or 0
    for k, scene in enumerate(scenes):
        if k != shown:
            name = printable_name(scene.text("name") or f"scene {k}", LONGEST_NAME)
            scene.leave_out("nodes", f"the scene {name!r} is not shown: the file opens with another")
    roots = scenes[shown].indices("nodes", len(file.nodes))
    if not roots and file.nodes:
        scenes[shown].note("nodes", "none", "all nodes of the file are shown")
    return roots or top
