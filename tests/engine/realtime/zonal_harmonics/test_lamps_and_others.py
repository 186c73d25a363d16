"""What is no lamp beside lamps: objects that are unlit, surfaces that transmit light, and light without shadows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.object_transfer import UNSHADOWED
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.surface_kinds import DeformSurface, Subsurface
from engine.scene.transform import Transform
from tests.engine.realtime.zonal_harmonics.test_lamp_light import DARK, FLOOR, SIZE, board, moving
from tests.scene_text import facing_up, placed, scaled

WHITE_SKY = SkyState(constant_environment((1.0, 1.0, 1.0)))
MOVED: Poses = (("card", (Transform((1.6, 0.0, 0.0)),)),)


def card(x: float = -0.8, height: float = 0.15, unlit: bool = True) -> str:
    more = "emission = [1, 1, 1]\nunlit = true\n" if unlit else ""
    return placed("card", "quad", facing_up(1.0, (x, height, 0.0)), more)


def white_at(made: Deform, x: float, poses: Poses = ()) -> float:
    """The mean radiance of white points of the floor about a place."""
    made.draw(made.scene.description.camera, SIZE, poses, "rest")
    points = made._points
    assert points is not None
    white = made._pictures._white[1].white[points.points_of(0), 0]  # type: ignore[union-attr, index]
    at = points.rest_places[points.points_of(0)] + made.scene.origin
    near = (points.frames[points.points_of(0), 2, 1] > 0.5) & (np.abs(at - (x, 0.0, 0.0)) < 0.3).all(axis=1)
    assert near.any()
    return float(white[near].mean())


@pytest.mark.parametrize("unlit", [True, False])
def test_an_unlit_object_hides_the_sky_as_any_other_does(tmp_path: Path, unlit: bool) -> None:
    made = moving(tmp_path, FLOOR + card(unlit=unlit), WHITE_SKY, n_points=2000)
    assert white_at(made, -0.8) < 0.3 and white_at(made, 0.8) > 0.9


def test_an_unlit_object_that_was_moved_hides_the_sky_where_it_is(tmp_path: Path) -> None:
    made = moving(tmp_path, FLOOR + card(), WHITE_SKY, n_points=2000)
    made.set_bending(["card"])
    made.set_moved(("card",), ())
    finish_deform(made)
    assert white_at(made, -0.8, MOVED) > 0.9 and white_at(made, 0.8, MOVED) < 0.35


def test_an_unlit_object_that_was_moved_keeps_no_lamp_from_where_it_was(tmp_path: Path) -> None:
    made = moving(tmp_path, FLOOR + card(height=0.6) + board(0.4), n_points=2000)
    shaded = white_at(made, -0.8)
    made.set_bending(["card"])
    made.set_moved(("card",), ())
    finish_deform(made)
    assert white_at(made, -0.8, MOVED) > 5.0 * max(shaded, 1e-3)


def test_what_transmits_light_mirrors_a_lamp_once(tmp_path: Path) -> None:
    """In a layer that is gloss alone it is as bright as an opaque ball."""
    gloss = make_layer(MODELS["rough_conductor"], {"alpha": 0.5})
    made = moving(tmp_path, placed("ball", "sphere", scaled(1.2, (0.0, 0.6, 0.0))) + board(0.4))
    made.set_layers({0: (gloss,)})
    made.set_bending(["ball"])
    means = {}
    for name, surface in (
        ("opaque", DeformSurface()),
        ("subsurface", DeformSurface(subsurface=Subsurface(scattering=20.0))),
    ):
        made.set_surfaces((("ball", surface),))
        finish_deform(made)
        means[name] = float(made.draw(made.scene.description.camera, SIZE).mean())
    assert means["subsurface"] == pytest.approx(means["opaque"], rel=0.25)


def test_without_shadows_a_lamp_that_moves_lights_as_one_at_rest(tmp_path: Path) -> None:
    plate = placed("plate", "quad", facing_up(0.8, (-0.8, 0.4, 0.0)))
    made = moving(tmp_path, FLOOR + plate + board(0.3), DARK, n_points=2000)
    assert white_at(made, -0.8) < 1e-6
    made.set_effort(200, UNSHADOWED, 0)
    finish_deform(made)
    rest, moved = white_at(made, -0.8), white_at(made, -0.8, (("lamp", (Transform((0.01, 0.0, 0.0)),)),))
    assert rest > 0.01 and moved == pytest.approx(rest, rel=0.02)
