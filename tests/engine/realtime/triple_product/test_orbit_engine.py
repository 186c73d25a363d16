import tomllib
from pathlib import Path

import numpy as np
import pytest

from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.core.stored_arrays import UnsoundArrays
from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.core._sample_kernels import silhouettes
from engine.realtime.triple_product import orbit_engine, point_placement
from engine.realtime.triple_product.lit_points import UNLIT
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.scene.description import parse_description
from engine.scene.scene_loader import Scene, build_scene
from tests.engine.realtime.conftest import BLOCK

GOLD = make_layer(MODELS["rough_conductor"], {"alpha": 0.3})
MATT = make_layer(MODELS["lambert"], {"albedo": [0.5, 0.25, 1.0]})
WHITE = make_layer(MODELS["lambert"], {"albedo": [1.0, 1.0, 1.0]})
SIZE = 32, 24


@pytest.fixture(scope="module")
def block_scene() -> Scene:
    return build_scene(parse_description(tomllib.loads(BLOCK), "block"), Path("block.toml"), (48, 36))


@pytest.fixture
def orbit(block_scene) -> Orbit:
    made = Orbit(block_scene, n_points=300, n_coefficients=64)
    made.set_light(SkyState(constant_environment((2.0, 1.0, 0.5))))
    made.set_layers({0: [MATT], 1: [GOLD]})
    return made


def test_light_and_layers_may_be_set_between_any_two_pieces(block_scene, orbit) -> None:
    camera = block_scene.description.camera
    with pytest.raises(ValueError, match="nothing is ready"):
        orbit.draw(camera, SIZE)
    work = orbit.work()
    for k, progress in enumerate(work):
        assert 0.0 <= progress.fraction <= 1.0
        if orbit.is_ready and k % 8 == 0:
            assert np.isfinite(orbit.draw(camera, SIZE, "moving")).all()
        if k == 3:
            orbit.set_light(SkyState(constant_environment((1.0, 1.0, 1.0)), 20.0))
            orbit.set_layers({0: [WHITE], 1: [GOLD]})
    assert orbit.is_done
    once = orbit.draw(camera, SIZE)
    whole = Orbit(block_scene, n_points=300, n_coefficients=64)
    whole.set_light(SkyState(constant_environment((1.0, 1.0, 1.0)), 20.0))
    whole.set_layers({0: [WHITE], 1: [GOLD]})
    assert [*whole.work()]
    np.testing.assert_allclose(once, whole.draw(camera, SIZE), rtol=1e-5)
    assert not [*orbit.work()]


def test_the_version_rises_with_what_changes_pictures_alone(orbit) -> None:
    assert [*orbit.work()]
    before = orbit.version
    assert not [*orbit.work()] and orbit.version == before
    orbit.set_layers({0: [WHITE], 1: [GOLD]})
    assert orbit.version > before
    assert {step.text for step in orbit.work()} == {"bounces"}  # what is matt asks for nothing else
    orbit.set_layers({0: [WHITE], 1: [WHITE, GOLD.with_parameter("alpha", 0.5)]})
    assert not orbit.is_done


def test_what_was_seen_is_kept_and_restored_with_backs(block_scene, orbit) -> None:
    below = block_scene.description.camera.model_copy(update={"position": (0.0, -3.0, 1.0)})
    assert [*orbit.work()]
    orbit.draw(below, SIZE)
    assert [*orbit.work()] and orbit.has_traced
    arrays = orbit.stored_visibility()
    assert not orbit.has_traced  # there is nothing new
    assert sum(array.nbytes for array in arrays.values()) < 0.15 * orbit.n_bytes
    again = Orbit(block_scene, n_points=300, n_coefficients=64)
    again.restore(arrays)
    again.set_light(SkyState(constant_environment((2.0, 1.0, 0.5))))
    again.set_layers({0: [MATT], 1: [GOLD]})
    assert "visibility" not in [step.text for step in again.work()]
    np.testing.assert_array_equal(again.draw(below, SIZE), orbit.draw(below, SIZE))
    assert not again.has_traced


@pytest.mark.parametrize("name", ["bits_data", "bits_starts", "patch_bits_starts", "n_points", "backs"])
def test_damaged_visibility_is_refused(orbit, name: str) -> None:
    work = orbit.work()
    while not orbit.n_bytes:
        next(work)
    arrays = orbit.stored_visibility()
    arrays[name] = arrays[name][:-1] if arrays[name].size else np.array([7], np.int64)
    with pytest.raises(UnsoundArrays):
        orbit.restore(arrays)


@pytest.mark.parametrize("n_steps", [12, pytest.param(1000, marks=pytest.mark.sweep)])
def test_whatever_is_done_pictures_are_finite_and_nothing_grows(block_scene, orbit, n_steps: int) -> None:
    chance, work = np.random.default_rng(n_steps), orbit.work()
    while not orbit.is_ready:
        next(work)
    for position in ((0.0, -3.0, 1.0), (0.0, 0.5, 0.4)):  # below the floor and within the block: all backs
        orbit.draw(block_scene.description.camera.model_copy(update={"position": position}), SIZE)
    assert [*work]
    before = orbit.n_bytes
    for k in range(n_steps):
        x, y, z = chance.normal(size=3) * 2.0
        camera = block_scene.description.camera.model_copy(update={"position": (x, y, z + 0.5)})
        orbit.set_light(SkyState(constant_environment(chance.random(3) * 5.0), chance.random() * 360.0))
        orbit.set_layers({0: [MATT], 1: [GOLD.with_parameter("alpha", float(chance.uniform(0.05, 0.8)))]})
        for _, _step in zip(range(int(chance.integers(8))), orbit.work(), strict=False):
            pass
        assert np.isfinite(orbit.draw(camera, (16, 12), ("moving", "rest")[k % 2])).all()
    assert orbit.n_bytes == before and orbit._reflections.n_slices <= 1


@pytest.mark.parametrize("change", ["light", "layer", pytest.param("coefficients", marks=pytest.mark.sweep)])
def test_what_points_sent_before_is_forgotten_with_what_it_was_made_of(block_scene, orbit, change: str) -> None:
    camera, n = block_scene.description.camera, 64
    assert [*orbit.work()]
    before = orbit.draw(camera, SIZE, "moving")
    sky, layers = SkyState(constant_environment((2.0, 1.0, 0.5))), {0: [MATT], 1: [GOLD]}
    if change == "light":
        sky = SkyState(constant_environment((0.5, 1.0, 2.0)))
    elif change == "layer":
        layers = {0: [MATT], 1: [GOLD.with_parameter("alpha", 0.5)]}
    else:
        n = 20
    again = Orbit(block_scene, n_points=300, n_coefficients=64)
    again.restore(orbit.stored_visibility())
    for each in (orbit, again):
        each.set_light(sky)
        each.set_layers(layers)
        assert each.is_done or [*each.work()]
    now = orbit.draw(camera, SIZE, "moving", n)
    np.testing.assert_array_equal(now, again.draw(camera, SIZE, "moving", n))
    assert np.abs(now - before).max() > 1e-3
    np.testing.assert_array_equal(now, orbit.draw(camera, SIZE, "moving", n))


def test_what_is_seen_is_shown_before_all_points_have_light(block_scene, orbit, monkeypatch) -> None:
    monkeypatch.setattr(orbit_engine, "_COARSE", 16)
    work, camera = orbit.work(), block_scene.description.camera
    while not orbit.is_ready:
        next(work)
    assert 0.0 < (orbit._lit.state == UNLIT).mean() < 1.0
    first = orbit.draw(camera, SIZE, "moving")
    assert (first.max(axis=2) > 0.05).all()


def test_a_camera_led_away_at_once_sees_no_point_without_light(block_scene, orbit, monkeypatch) -> None:
    monkeypatch.setattr(orbit_engine, "_COARSE", 16)
    work = orbit.work()
    while not orbit.is_ready:
        next(work)
    behind = block_scene.description.camera.model_copy(update={"position": (0.5, 1.6, -4.0)})
    assert (orbit.draw(behind, SIZE, "moving").max(axis=2) > 0.05).all()


def test_backs_have_light_in_the_first_picture_that_sees_them(block_scene, orbit) -> None:
    assert [*orbit.work()]
    below = block_scene.description.camera.model_copy(update={"position": (0.0, -3.0, 1.0)})
    first = orbit.draw(below, SIZE, "moving")
    # Nothing stands below the floor: it reflects all of an even sky, its albedo times the radiance.
    on_floor = first[orbit.lit.mesh.sample_view(below, SIZE).samples.i_object.reshape(first.shape[:2]) == 0]
    np.testing.assert_allclose(on_floor, np.broadcast_to([1.0, 0.25, 0.5], on_floor.shape), rtol=0.02)
    assert not orbit.is_done and [*orbit.work()]
    np.testing.assert_allclose(first, orbit.draw(below, SIZE, "moving"), rtol=0.02, atol=1e-3)


def test_a_look_places_backs_without_a_picture(block_scene, orbit) -> None:
    assert [*orbit.work()]
    version = orbit.version
    orbit.prioritize_view(block_scene.description.camera.model_copy(update={"position": (0.0, -3.0, 1.0)}))
    assert orbit.version > version and not orbit.is_done


def test_edges_are_smooth_on_request_while_something_moves(orbit) -> None:
    for _ in orbit.work():
        pass
    camera = orbit.scene.description.camera
    hard = orbit.draw(camera, SIZE, "moving")
    soft = run_to_end(orbit.draw_steps(camera, SIZE, "moving", has_soft_edges=True))
    ids = orbit.lit.mesh.sample_view(camera, SIZE).samples.i_object.reshape(SIZE[::-1])
    edges = np.zeros(ids.shape, bool)
    silhouettes(ids, edges)
    np.testing.assert_allclose(soft[~edges], hard[~edges], rtol=1e-5)
    # A pixel at an edge shows its objects' colours in quarters: neither one alone nor what no object has.
    assert np.abs(soft[edges] - hard[edges]).max() > 0.1
    assert soft.max() <= hard.max() * 1.05


def test_too_many_vertices_are_refused_before_any_point_is_placed(block_scene, monkeypatch) -> None:
    # The floor and the block have 12 places; 1,800 bytes each are more than so little memory has.
    monkeypatch.setattr(point_placement, "place_points", None)
    orbit = Orbit(block_scene, most_bytes=12 * 1500)
    with pytest.raises(InsituError, match=r"^block.toml: 12 vertices, of which Orbit would store more than 0 MiB; "):
        [*orbit.work()]


@pytest.mark.parametrize("quality", ["moving", "rest"])
def test_no_pixel_is_nan_where_the_camera_is_exactly_on_a_vertex(block_scene, orbit, quality) -> None:
    assert [*orbit.work()]
    points = orbit.lit.points
    for p in (0, np.flatnonzero(points.i_object == 1)[0], len(points) - 1):
        aside = np.array([0.3, 0.1, 0.2])
        for target in (points.position[p] + points.normal[p] + aside, points.position[p] - points.normal[p] + aside):
            update = {"position": tuple(map(float, points.position[p])), "target": tuple(map(float, target))}
            picture = orbit.draw(block_scene.description.camera.model_copy(update=update), SIZE, quality)
            assert np.isfinite(picture).all()
