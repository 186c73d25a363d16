"""Highlights of lamps at rest: the BRDF itself in closed form, shadows, and path tracing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from engine.core.generators import run_to_end
from engine.material import MODELS
from engine.material.layer import evaluate_layer, make_layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.render.still import render_paths
from engine.scene.scene_loader import load_scene
from tests.engine.realtime.zonal_harmonics.test_neighbours import LAMP
from tests.scene_text import camera, environment, facing_down, facing_up, placed, scaled

SIZE = (48, 36)
METAL = make_layer(MODELS["microfacet"], {"alpha": 0.3, "f0": (0.9, 0.6, 0.3)})
DARK = SkyState(None)
BALL = placed("ball", "sphere", scaled(1.4))
BULB = placed("lamp", "sphere", scaled(0.06, (1.5, 1.8, 2.0)), "emission = [5000, 4000, 3000]\n")


def metallic(folder: Path, text: str, sky: SkyState, bends: tuple[str, ...] = ()) -> Deform:
    """A scene all of whose objects are of the metal."""
    (folder / "scene.toml").write_text(camera((0.0, 0.8, 3.0), 40, SIZE) + environment() + text)
    deform = Deform(load_scene(folder / "scene.toml"), n_rays=50)
    deform.set_light(sky)
    deform.set_layers(dict.fromkeys(np.flatnonzero(deform.scene.reflecting).tolist(), (METAL,)))
    deform.set_bending(bends)
    deform.set_bounces(1)
    return finish_deform(deform)


def off_paths(deform: Deform, sky: SkyState) -> float:
    """relRMSE of the first object at rest, two pixels off its outline, of its picture against paths, whose noise is 1 %
    of the mean."""
    eye = deform.scene.description.camera
    truth = run_to_end(render_paths(Placement(deform.scene), {0: (METAL,)}, sky, 1, 6144))
    found = deform.draw(eye, SIZE, (), "rest")
    assert deform._pictures is not None and deform._points is not None
    shown = deform._pictures._rasterize(deform.scene, deform._points.places, eye, SIZE).found
    inside = binary_erosion((shown >= 0) & (deform._points.surface.i_object[shown] == 0), iterations=2)
    assert inside.sum() > 100
    return float(np.sqrt(((found - truth)[inside] ** 2).mean()) / truth[inside].mean())


@pytest.mark.parametrize("bends", [(), ("ball",)])
@pytest.mark.parametrize(
    "lamp", [BULB, placed("lamp", "quad", facing_down(1.5, (0.3, 2.0, 0.5)), LAMP)], ids=["point", "quad"]
)
def test_a_metal_ball_under_a_lamp_is_what_paths_find(tmp_path: Path, lamp: str, bends: tuple[str, ...]) -> None:
    assert off_paths(metallic(tmp_path, BALL + lamp, DARK, bends), DARK) < 0.05


def test_a_highlight_on_a_floor_is_the_brdf_times_the_light(tmp_path: Path) -> None:
    """f cos L s² cos / d², of a lamp of side s that faces down from the height d over the middle; none of it in the
    shadow of a board."""
    lamp = placed("lamp", "quad", facing_down(0.05, (0.0, 2.0, -1.5)), LAMP)
    floor = placed("floor", "quad", facing_up(6))
    deform = metallic(tmp_path, floor + lamp, DARK)
    eye = deform.scene.description.camera
    found = deform.draw(eye, SIZE, (), "rest")[SIZE[1] // 2, SIZE[0] // 2]
    # The picture's middle is the origin. With the floor's normal as z, the world's y: (x, -z, y).
    wo, wi = (np.array([[0.0, z, y]]) / math.hypot(z, y) for z, y in ((-3.0, 0.8), (1.5, 2.0)))
    power = np.array([5.0, 4.0, 3.0]) * 0.05**2 * (2.0 / 2.5) / 2.5**2
    assert found == pytest.approx(evaluate_layer(METAL, wi, wo)[0] * power, rel=0.04)
    board = placed("board", "quad", facing_up(0.5, (0.0, 1.0, -0.75)))
    shaded = metallic(tmp_path, floor + lamp + board, DARK, ("board",))
    assert shaded.draw(eye, SIZE, (), "rest")[SIZE[1] // 2, SIZE[0] // 2].max() < 1e-6
