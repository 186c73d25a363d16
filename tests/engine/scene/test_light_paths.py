"""What keeps a placed light from its point: a floor, a wall and a post, whose answers are seen from their numbers."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt

import numpy as np
import pytest

from engine.scene.cutouts import scene_caster
from engine.scene.light_paths import LightPath, Point, describe_light_path
from engine.scene.scene_loader import Scene, load_scene
from tests.scene_text import LAMBERT, ground, placed, scaled

# The wall goes from x = 1 to 1.2 and up to 2 m, the post stands at (0, 0, -1) and is 0.6 m high.
WALL, POST = scaled((0.2, 2.0, 4.0), (1.1, 1.0, 0.0)), scaled((0.1, 0.6, 0.1), (0.0, 0.3, -1.0))
TOP = (0.0, 0.6, -1.0)
ROOM = (
    ground((8, 8), size=20)
    + placed("wall", "cube", WALL, LAMBERT)
    + placed("post", "cube", POST, LAMBERT)
    + placed("key", "sphere", scaled(0.1, (0.5, 0.5, 0.0)), "emission = 5\n")
)
# Seen from (-1, 1, 0), the floor at the origin mirrors what is at x = y, z = 0.
HIGHLIGHT = LightPath("key", (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, 1.0, 0.0))
SHADOW = replace(HIGHLIGHT, caster=TOP, caster_object="post")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = tmp_path_factory.mktemp("room") / "room.toml"
    path.write_text(ROOM)
    return load_scene(path)


def said(scene: Scene, path: LightPath, **changes: object) -> str:
    return describe_light_path(replace(path, **changes), scene, scene_caster(scene))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "x, says",
    [
        (0.9, ""),  # past the lamp where it stands in the scene
        (1.1, "key is placed, but inside wall, which hides it from that point"),
        (1.3, "key is placed, but wall hides it from that point"),
        (np.inf, "key is placed, but wall hides it from that point"),  # a sun
    ],
)
def test_a_highlight_is_seen_up_to_the_wall(scene: Scene, x: float, says: str) -> None:
    assert said(scene, HIGHLIGHT, reach=x * sqrt(2.0)) == says


def test_a_sun_passes_over_the_wall(scene: Scene) -> None:
    """From (-1, 3, 0) the way rises three metres a metre: it is 3 m high at the wall."""
    assert said(scene, HIGHLIGHT, eye=(-1.0, 3.0, 0.0)) == ""


def test_a_surface_that_is_seen_edge_on_mirrors_nothing(scene: Scene) -> None:
    assert said(scene, HIGHLIGHT, eye=(-1.0, 0.0, 0.0)).startswith(
        "key stays where it is: that surface is seen edge-on"
    )


@pytest.mark.parametrize(
    "point, normal, reach, says",
    [
        ((-0.6, 0.0, -1.0), (0.0, 1.0, 0.0), 0.9 * sqrt(2.0), ""),
        ((-0.6, 0.0, -1.0), (0.0, 1.0, 0.0), 3.0,
         "key is placed, but wall hides it from what is to throw the shadow"),
        ((0.6, 0.0, -1.0), (0.0, 1.0, 0.0), 3.0, ""),  # from the other side nothing is there
        ((3.0, 0.0, -1.0), (0.0, 1.0, 0.0), 1.0, "key is placed, but wall catches the shadow before that point"),
        ((1.2, 0.3, -1.0), (1.0, 0.0, 0.0), 1.0,
         "key is placed, but the surface faces away from it there: no shadow falls on that point"),
        (TOP, (0.0, 1.0, 0.0), 1.0,
         "key stays where it is: drag from what is to throw the shadow to where this is to fall"),
    ],
)  # fmt: skip
def test_a_shadow_falls_where_nothing_is_between(
    scene: Scene, point: Point, normal: Point, reach: float, says: str
) -> None:
    assert said(scene, SHADOW, point=point, normal=normal, reach=reach) == says
