"""Rotated streaks in pictures: exponents that change places, maps beside angles, and every mode beside traced paths."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.core.generators import run_to_end
from engine.light.environment import Environment
from engine.material import MODELS, make_layer
from engine.material.bumps import Bumps
from engine.material.layer import Layer
from engine.planner import plan_scene
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.indirect.sampling_settings import STILL, BounceSeries
from engine.realtime.stills import render_orbit
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.reference.path_tracer import trace_halves, trace_paths
from engine.render.still import (
    StillLayer,
    indirect_radiance,
    render_reference,
    render_still,
    still_layers,
    still_quality,
)
from engine.scene.scene_loader import load_scene
from engine.settings import RenderSettings
from tests.scene_text import camera, facing_up, placed

FLOOR, WALL = facing_up(4), "0,0,1,-1.5, 0,4,0,2, -4,0,0,0, 0,0,0,1"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("brushed")
    Image.fromarray(np.full((4, 4), 255, np.uint8)).save(folder / "white.png")
    Image.fromarray(np.tile(np.uint8([[0, 255] * 4]), (4, 1)).repeat(16, 1)).save(folder / "stripes.png")
    return folder


def placement_of(folder: Path, tangent: str = "", size: int = 16, wall: str | None = None) -> Placement:
    """A brushed floor; with a wall, a plain floor in front of a brushed wall."""
    lambert = 'layer = [{ model = "lambert" }]\n'
    text = camera((-5, 4, 0) if wall is None else (6, 3, 0), 40, (size, size))
    text += placed("floor", "quad", FLOOR, f"smooth = false\n{tangent}\n{lambert}")
    if wall is not None:
        text += placed("wall", "quad", WALL, f"smooth = false\n{wall}\n{lambert}")
    (folder / "scene.toml").write_text(text)
    return Placement(load_scene(folder / "scene.toml"))


def brushed(n_u: float, n_v: float) -> Layer:
    return make_layer(MODELS["ashikhmin_shirley"], {"n_u": n_u, "n_v": n_v})


@cache
def window() -> SkyState:
    """A bright window over +X, before a dim sky."""
    image = np.full((60, 120, 3), 0.1, np.float32)
    image[15:25, 80:100] = 3.0
    return SkyState(Environment(image, "test"))


def layers_of(placement: Placement, layers: Sequence[Layer]) -> list[StillLayer]:
    names = list(placement.scene.object_names)
    named = {f"{name}.0": layer for name, layer in zip(names, layers, strict=True)}
    plan = plan_scene(placement.scene, named, has_sky=True, still=True, settings=RenderSettings(2000))
    return still_layers(named.items(), names, plan)


def direct(placement: Placement, layer: Layer) -> np.ndarray:
    plan = plan_scene(placement.scene, {"floor.0": layer}, has_sky=True, still=True, settings=RenderSettings(2000))
    drawn = run_to_end(render_still(placement, layers_of(placement, [layer]), window(), still_quality(plan)))
    return drawn.reshape(-1, 3)[placement.hits.pixel]


def paths(placement: Placement, layers: Sequence[Layer], n: int, bounces: int = 1) -> np.ndarray:
    by_object = {i: (layer,) for i, layer in enumerate(layers)}
    return run_to_end(trace_paths(placement, by_object, window(), bounces, n)).radiance


def off(picture: np.ndarray, truth: np.ndarray) -> float:
    return float(np.abs(picture - truth).mean() / truth.mean())


def test_a_quarter_turn_is_exponents_that_change_places(folder: Path) -> None:
    # [BenArtzi07, eq. 3.3] has n_u with cos² φ_h and n_v with sin² φ_h, which 90 degrees exchange.
    plain = placement_of(folder)
    truth = run_to_end(render_reference(plain, {0: (brushed(20, 200),)}, window(), 1, 4))
    expected, other = direct(plain, brushed(20, 200)), direct(plain, brushed(200, 20))
    assert off(other, expected) > 0.1
    for tangent in ("tangent = { angle = 90 }", 'tangent = { file = "white.png", range = 90 }',
                    'tangent = { angle = 45, file = "white.png", range = 225 }'):  # fmt: skip
        placement = placement_of(folder, tangent)
        turned = run_to_end(render_reference(placement, {0: (brushed(200, 20),)}, window(), 1, 4))
        np.testing.assert_allclose(turned, truth, rtol=1e-4)
        np.testing.assert_allclose(direct(placement, brushed(200, 20)), expected, rtol=5e-3)


@pytest.mark.parametrize(
    ("tangent", "most", "most_orbit"),
    [("tangent = { angle = 30 }", 0.02, 0.05), ('tangent = { file = "stripes.png", range = 90 }', 0.02, 0.07)],
    ids=["angle", "map"],
)
def test_placement_and_orbit_show_what_paths_find(folder: Path, tangent: str, most: float, most_orbit: float) -> None:
    placement, layer = placement_of(folder, tangent), brushed(200, 20)
    truth = paths(placement, [layer], 512)
    assert off(paths(placement_of(folder), [layer], 64), truth) > 0.15  # without rotation
    assert off(direct(placement, layer), truth) < most
    drawn = run_to_end(render_orbit(placement, {0: (layer,)}, window(), 64, n_points=300))
    assert off(drawn.reshape(-1, 3)[placement.hits.pixel], truth) < most_orbit


@pytest.mark.parametrize(
    "wall", ["tangent = { angle = 60 }", 'tangent = { file = "stripes.png", angle = 30, range = 90 }']
)
def test_light_that_a_rotated_wall_sends_on_is_what_paths_find(folder: Path, wall: str) -> None:
    lambert, metal = make_layer(MODELS["lambert"], {"albedo": (0.5,) * 3}), brushed(400, 5)
    placement = placement_of(folder, "", 12, wall)
    settings = STILL.with_rays(256)
    own = placement.hits.objects == 0

    def bounced(each: Placement) -> np.ndarray:
        layers = layers_of(each, [lambert, metal])
        return run_to_end(indirect_radiance(each, layers, window(), BounceSeries(2), settings))[own]

    halves = run_to_end(
        trace_halves(placement, {0: (lambert,), 1: (metal,)}, window(), 2, 1024, 1, np.flatnonzero(own))
    )
    truth = (halves[:, :, 1] - halves[:, :, 0]).mean(axis=0)
    assert bounced(placement).mean() == pytest.approx(truth.mean(), rel=0.04)
    assert abs(bounced(placement_of(folder, "", 12, "")).mean() / truth.mean() - 1.0) > 0.1  # without rotation


def test_orbit_lights_anew_what_turns_and_nothing_else(folder: Path) -> None:
    layers = {0: (brushed(200, 20),), 1: (brushed(50, 50),)}

    def orbit_of(placement: Placement) -> Orbit:
        orbit = Orbit(placement.scene, placement.caster, 200, 64)
        orbit.set_light(window())
        orbit.set_layers(layers)
        orbit.set_bounces(1)
        return orbit

    def finished(orbit: Orbit) -> np.ndarray:
        run_to_end(orbit.work())
        return orbit.draw(orbit.scene.description.camera, (12, 12), "rest")

    plain, turned = placement_of(folder, "", 12, ""), placement_of(folder, "tangent = { angle = 50 }", 12, "")
    fresh, orbit = orbit_of(turned), orbit_of(plain)
    expected, before = finished(fresh), finished(orbit)
    geometry = orbit.geometry[-3]
    lit = orbit.lit
    assert lit is not None
    orbit.set_bumps({"floor": Bumps(tangent_angle=50.0)})
    np.testing.assert_array_equal(lit.traced, lit.points.i_object == 1)  # the wall's points keep what they see
    assert orbit.geometry[-3] != geometry and orbit.geometry[-3] == fresh.geometry[-3]
    np.testing.assert_allclose(finished(orbit), expected, rtol=1e-4, atol=1e-6)
    assert off(before, expected) > 0.005
    orbit.set_bumps({"floor": Bumps()})
    assert orbit.geometry[-3] == geometry
    np.testing.assert_allclose(finished(orbit), before, rtol=1e-4, atol=1e-6)
