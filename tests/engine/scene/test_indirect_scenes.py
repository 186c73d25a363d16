"""Scenes for indirect light: which objects can be edited, and how light reaches what is seen."""

from __future__ import annotations

import numpy as np
import pytest

from assets.generate.room import LINTEL, SILL, WINDOWS, X
from engine.scene.builtin import builtin_scenes
from engine.scene.description import load_description
from engine.scene.mesh import Mesh
from engine.scene.mesh_defects import find_defects
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene

COUNTS = {  # objects, editable ones
    "vase": (9, 7), "room": (8, 6), "ring": (3, 2), "stairwell": (14, 7), "ajar": (9, 8), "storeroom": (11, 10),
}  # fmt: skip
SIZE = 1_000_000


@pytest.mark.parametrize("name", COUNTS)
def test_counts_and_sizes(name: str) -> None:
    path = builtin_scenes()[name]
    objects = load_description(path).objects
    assert (len(objects), sum(item.editable for item in objects)) == COUNTS[name]
    assert sum(mesh.stat().st_size for mesh in path.parent.glob("*.ply")) < SIZE


@pytest.mark.parametrize("name", COUNTS)
def test_no_face_is_odd(name: str) -> None:
    scene = load_scene(builtin_scenes()[name])
    for (start, stop), item in zip(scene.triangle_ranges, scene.description.objects, strict=True):
        defects = find_defects(Mesh(scene.vertices, scene.triangles[start:stop], scene.normals))
        assert defects.notes() == [], item.name


def test_room_is_open_at_its_windows_alone() -> None:
    scene = load_scene(builtin_scenes()["room"])
    assert not scene.emitters.any()  # the sky is its only light
    origins, directions = _rays_from_inside(100_000)
    found = RayCaster(scene.vertices, scene.triangles).intersect(
        (origins - scene.origin).astype(np.float32), directions.astype(np.float32)
    )
    away = found.triangle < 0
    assert 0.01 < away.mean() < 0.2  # there is light
    assert (directions[away, 0] < 0).all()
    reach = (-X - origins[away, 0]) / directions[away, 0]
    y, z = (origins[away, k] + reach * directions[away, k] for k in (1, 2))
    through = np.any([(z > low) & (z < high) for low, high in WINDOWS], axis=0)
    assert (through & (y > SILL) & (y < LINTEL)).all()


def _rays_from_inside(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins (n, 3) in the air of the room and unit directions (n, 3) all round."""
    rng = np.random.default_rng(4)
    origins = rng.uniform((-1.9, 0.9, -1.4), (1.9, 2.5, 2.4), (n, 3))
    directions = rng.normal(size=(n, 3))
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("name", ["vase", "ring"])
def test_lamps_shine_on_what_stands_there(name: str) -> None:
    scene = load_scene(builtin_scenes()[name])
    (lamp,) = np.flatnonzero(scene.emitters)
    start, stop = scene.triangle_ranges[lamp]
    middle = scene.vertices[scene.triangles[start:stop]].mean(axis=1, dtype=np.float64)
    towards = _middle(scene, name) - middle
    # Emitters shine from their front.
    assert (np.einsum("ij,ij->i", scene.geometric_normals[start:stop], towards) > 0).all()


def _middle(scene: Scene, name: str) -> np.ndarray:
    index = [item.name for item in scene.description.objects].index(name)
    start, stop = scene.triangle_ranges[index]
    return np.asarray(scene.vertices[scene.triangles[start:stop]].mean(axis=(0, 1), dtype=np.float64))


@pytest.mark.parametrize("name", ["stairwell", "ajar", "storeroom"])
def test_a_closed_room_shows_nothing_of_what_is_outside(name: str) -> None:
    # A gap between two slabs would be a black line in a room whose only light is its own.
    scene = load_scene(builtin_scenes()[name])
    eye = scene.camera_position.astype(np.float32)
    directions = np.random.default_rng(5).normal(size=(100_000, 3)).astype(np.float32)
    found = RayCaster(scene.vertices, scene.triangles).intersect(np.tile(eye, (len(directions), 1)), directions)
    assert (found.triangle >= 0).all()


def test_the_lamps_of_the_stairwell_differ_by_four_orders_in_size() -> None:
    scene = load_scene(builtin_scenes()["stairwell"])
    shining = scene.emitters[scene.object_of_triangle]
    corners = scene.vertices[scene.triangles[shining]].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert len(area) == 2 * 13 and area.max() / area.min() > 1e4
