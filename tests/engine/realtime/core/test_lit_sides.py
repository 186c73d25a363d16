"""Which sides of objects light reaches, and which backs pass it on."""

from __future__ import annotations

from pathlib import Path

import pytest

from engine.realtime.core.lit_sides import lit_sides
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import load_scene
from tests.rooms import inside_out, solid


@pytest.mark.parametrize("inward", [False, True])
def test_walls_that_are_wound_outwards_send_light_on_from_behind(inward: bool, tmp_path: Path) -> None:
    scene = load_scene(inside_out(tmp_path / "room", inward=inward))
    found = lit_sides(scene, RayCaster(scene.vertices, scene.triangles))
    shell = scene.object_index("shell")
    assert found.reached[shell].all() and not found.reached[scene.object_index("block"), 1]
    assert found.relays.tolist() == [i == shell and not inward for i in range(len(found.relays))]


def test_what_stands_under_the_sky_sends_nothing_on_from_behind(tmp_path: Path) -> None:
    scene = load_scene(solid(tmp_path / "block"))
    assert not lit_sides(scene, RayCaster(scene.vertices, scene.triangles)).relays.any()
    inward = load_scene(solid(tmp_path / "inward", inward=True))
    found = lit_sides(inward, RayCaster(inward.vertices, inward.triangles))
    assert found.relays.tolist() == [True, False]  # the block's faces, all wound inwards, light the floor
