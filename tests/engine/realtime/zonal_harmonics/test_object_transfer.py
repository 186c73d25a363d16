"""What an object reflects onto itself, where images and strokes say how much."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.material.layer_maps import LayerMaps
from engine.material.strokes import Stroke, Strokes, pack_dabs
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.bending_points import bending_points
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.object_transfer import Reflectance, albedos, reflectance
from engine.realtime.zonal_harmonics.shading import low_gloss
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, load_scene
from tests.scene_text import camera, environment, placed

SIZE = (24, 18)
SKY = SkyState(constant_environment(1.0))
BRIGHT, DARK = 0.8, 0.2


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """A floor and a wall that meet along x, as one object; beside it an image whose left half is brighter."""
    folder = tmp_path_factory.mktemp("corner")
    corners = [(-1, 0, 0), (1, 0, 0), (1, 0, 1), (-1, 0, 1), (-1, 1, 0), (1, 1, 0)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"vt {(x + 1) / 2} {y + z}" for x, y, z in corners]
    quads = [(1, 4, 3, 2), (1, 2, 6, 5)]
    lines += [" ".join(["f", *(f"{i}/{i}" for i in quad)]) for quad in quads]
    (folder / "corner.obj").write_text("\n".join(lines))
    halves = np.full((64, 64), round(255 * DARK / BRIGHT), np.uint8)
    halves[:, :32] = 255
    Image.fromarray(halves).save(folder / "halves.png")
    (folder / "scene.toml").write_text(
        camera((0, 1.6, 2.4), 40, SIZE, (0, 0.3, 0.3))
        + environment()
        + placed("corner", "corner.obj", more="smooth = false\n")
    )
    return load_scene(folder / "scene.toml")


def matt(albedo: float, **maps: object) -> Layer:
    return make_layer(MODELS["lambert"], {"albedo": albedo}).replace(maps=LayerMaps(**maps))  # type: ignore[arg-type]


HALVES = matt(BRIGHT, texture="halves.png", texture_space="linear")


def means(scene: Scene, layer: Layer, n_bounces: int = 3) -> tuple[float, float]:
    """Of the left and the right half of the pixels that lie on the corner."""
    deform = Deform(scene, n_points=250, n_rays=200)
    deform.set_effort(200, 1)  # of an even sky one lobe holds all
    deform.set_light(SKY)
    deform.set_layers({0: (layer,)})
    deform.set_bounces(n_bounces)
    picture = finish_deform(deform).draw(scene.description.camera, SIZE, (), "rest")
    left, right = np.split(picture[4:14, 4:20].mean(axis=(0, 2)), 2)
    return float(left.mean()), float(right.mean())


def test_an_image_sends_from_fold_to_fold_what_it_does_along_paths(scene: Scene) -> None:
    """`render_paths` with 64 paths a pixel: two bounces more make the halves brighter by 24.3 and by 10.4 %."""
    brighter = np.divide(means(scene, HALVES), means(scene, HALVES, 1))
    assert brighter == pytest.approx([1.243, 1.104], abs=0.045)


def test_points_have_the_albedo_of_their_image_and_of_their_strokes(scene: Scene) -> None:
    points = bending_points(scene, RayCaster(scene.vertices, scene.triangles), 500)
    places = points.rest_geometry(0).positions + scene.origin
    x = places[:, 0]
    found = albedos(scene, points, 0, (HALVES, matt(0.1)), 6)
    assert found[(-0.8 < x) & (x < -0.3)] == pytest.approx(BRIGHT + 0.1, abs=0.02)  # at the edges the image repeats
    assert found[(0.3 < x) & (x < 0.8)] == pytest.approx(DARK + 0.1, abs=0.02)
    dab = pack_dabs(np.array([0.5, 0.0, 0.5]) - scene.origin, (0.0, 1.0, 0.0))
    painted = matt(0.5, weight_start=0.0, strokes=Strokes((Stroke(0.3, hardness=1.0, dabs=dab),)))
    found = albedos(scene, points, 0, (painted,), 6)
    off = np.linalg.norm(places - [0.5, 0.0, 0.5], axis=1)
    assert found[(off < 0.2) & (places[:, 1] < 1e-6)] == pytest.approx(0.5, abs=0.02)
    assert not found[off > 0.4].any()


def test_an_image_finer_than_the_points_is_its_mean_over_what_they_stand_for(scene: Scene) -> None:
    fine = matt(BRIGHT, texture="halves.png", texture_space="linear", texture_scale=(200.0, 1.0))
    points = bending_points(scene, RayCaster(scene.vertices, scene.triangles), 100)
    half = matt(0.8, weight_start=0.5)
    assert albedos(scene, points, 0, (half,), 6) == pytest.approx(0.4)
    assert albedos(scene, points, 0, (fine,), 6) == pytest.approx((BRIGHT + DARK) / 2, abs=0.02)


def test_gloss_sends_what_it_reflects_of_an_even_light(scene: Scene) -> None:
    """A matt layer that is taken for gloss has the albedo that it has, and gold the one that it shows to all eyes."""
    assert low_gloss(matt(0.5), 6).albedo == pytest.approx(0.5, abs=2e-3)
    gold = make_layer(MODELS["rough_conductor"], {"alpha": 0.6})
    points = bending_points(scene, RayCaster(scene.vertices, scene.triangles), 100)
    found = albedos(scene, points, 0, (gold,), 6)
    assert found == pytest.approx(np.broadcast_to(low_gloss(gold, 6).albedo, found.shape))


def test_edits_that_change_little_leave_it_as_it_is() -> None:
    steps = np.linspace(0.1, 0.74, 50)
    assert reflectance(steps) == reflectance(steps * 1.02) != reflectance(steps[::-1])
    assert reflectance(np.full(9, 0.49)) == Reflectance(4) and reflectance(np.full(9, 1.3)) == Reflectance(7)
    assert reflectance(np.zeros(9)) == Reflectance() == reflectance(np.zeros(0))
    assert reflectance(steps).albedo == pytest.approx(steps * (0.75 / 0.74), abs=0.03)
