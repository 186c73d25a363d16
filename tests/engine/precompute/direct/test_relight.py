"""Rows over a lighting basis: against a slow twin, closed forms, and the transport of the same light."""

from pathlib import Path

import numpy as np
import pytest

from engine.core.frames import local_frames
from engine.core.generators import run_to_end
from engine.light.environment import Environment, constant_environment
from engine.material import MODELS
from engine.material.layer import Layer, evaluate_by_curves, make_layer
from engine.planner import band_counts
from engine.precompute.direct.bandstore import join_tiles
from engine.precompute.direct.pipeline import FINAL, Placement, SkyState
from engine.precompute.direct.projection import LayerShape, project_layer
from engine.precompute.direct.relight import RowMaker, joined_rows, light_coefficients, turning_effects
from engine.render.picture_difference import errors
from engine.scene.scene_loader import load_scene
from engine.sphere.geodesic import geodesic
from engine.sphere.haar import inverse
from engine.visibility.point_visibility import evaluate_rows
from tests.scene_text import camera, facing_up, placed, scaled

GROUND = placed("ground", "quad", facing_up(20))
BALL = placed("ball", "sphere", scaled(1, (0, 1, 0)))
MATT, GOLD = make_layer(MODELS["lambert"]), make_layer(MODELS["rough_conductor"], {"alpha": 0.3})
COPPER = make_layer(MODELS["rough_conductor"], {"alpha": 0.3, "eta": (0.2, 0.9, 1.1), "k": (3.9, 2.5, 2.4)})
ROTATION = 70.0


def placement_of(folder: Path, text: str) -> Placement:
    path = folder / "scene.toml"
    path.write_text(camera((0.5, 3, 4), 40, (20, 16)) + text)
    placement = Placement(load_scene(path))
    evaluate_rows(placement.hits, placement.caster, placement.sphere, placement.rows(1))
    return placement


@pytest.fixture
def placement(tmp_path: Path) -> Placement:
    return placement_of(tmp_path, GROUND + BALL)


def sky() -> Environment:
    """Bright on one side, with a window a few degrees wide."""
    x = np.cos(np.linspace(0, 2 * np.pi, 64))[None, :, None] * np.sin(np.linspace(0, np.pi, 32))[:, None, None]
    radiance = np.repeat(1.0 + 0.8 * x, 3, axis=2) * (0.6, 0.8, 1.0)
    radiance[8:11, 20:24] += 40.0
    return Environment(radiance.astype(np.float32), "window")


def effects(environment: Environment) -> np.ndarray:
    return run_to_end(turning_effects(environment))


def transport(placement: Placement, layer: Layer, rows: np.ndarray, environment: Environment) -> np.ndarray:
    light = run_to_end(placement.light(SkyState(environment, ROTATION), FINAL))
    counts = (*band_counts(layer).values(), 1)[:2]
    shape = LayerShape(layer.model.name, tuple(layer.quotient_parameters().tolist()), counts)
    curves = [layer.coefficients(name, n) for name, n in band_counts(layer).items()]
    store = join_tiles(counts, project_layer(placement.hits, rows, light, shape))
    return light.lighting.unit * store.radiance(curves[0], (*curves, np.ones((1, 3)))[1])


@pytest.mark.parametrize("layer", [MATT, GOLD, COPPER], ids=["matt", "gold", "copper"])
def test_a_row_is_the_mean_reflection_over_each_triangle_that_is_seen(placement: Placement, layer: Layer) -> None:
    points = placement.rows_of(1)[::31]
    sphere, fine = geodesic(4), geodesic(6)
    (tile,) = RowMaker(placement.hits, placement.sphere, np.ones(sphere.n_triangles, np.float32)).rows(layer, points)
    frames = local_frames(placement.hits.tangent[points], placement.hits.normal[points])
    for i, point in enumerate(points):
        terms = slice(tile.start[i], tile.start[i + 1])
        coefficients = np.zeros((sphere.n_triangles, tile.value.shape[1]))
        coefficients[tile.number[terms]] = tile.scale[i] * tile.value[terms]
        wi, wo = fine.centres @ frames[i].T, frames[i] @ placement.hits.wo[point]
        reflected = evaluate_by_curves(layer, wi, np.tile(wo, (len(wi), 1))) * (wi[:, 2:] > 0.0)
        means = (fine.solid_angles[:, None] * reflected).reshape(sphere.n_triangles, 16, 3).sum(axis=1)
        means *= placement.sphere.unpacked(points[i : i + 1])[0][:, None] / sphere.solid_angles[:, None]
        assert means.max() > 0.1
        np.testing.assert_allclose(inverse(coefficients) * np.ones(3), means, atol=0.02 * means.max())


def test_an_open_plane_reflects_a_constant_sky_whole_however_it_turns(tmp_path: Path) -> None:
    plane = placement_of(tmp_path, GROUND)
    even = constant_environment((1.0, 2.0, 3.0))
    rows = joined_rows(RowMaker(plane.hits, plane.sphere, effects(even)).rows(MATT, plane.rows_of(0)))
    for rotation in (0.0, 123.0):
        found = rows.lit(light_coefficients(even, rotation, 1.5))
        np.testing.assert_allclose(found, np.tile([1.5, 3.0, 4.5], (len(found), 1)), rtol=5e-3)


@pytest.mark.parametrize(("i_object", "layer", "bound"), [(0, MATT, 0.02), (1, MATT, 0.02), (1, GOLD, 0.03)])
def test_a_turned_picture_is_the_transport_of_that_light(placement, i_object: int, layer: Layer, bound: float) -> None:
    environment, points = sky(), placement.rows_of(i_object)
    truth = transport(placement, layer, points, environment)
    whole = RowMaker(placement.hits, placement.sphere, effects(environment))
    light = light_coefficients(environment, ROTATION)
    assert errors(joined_rows(whole.rows(layer, points)).lit(light), truth).rmse < bound
    thinned = whole.rows_within([(layer, points)], 1e9)
    rows = joined_rows(thinned.rows(layer, points))
    assert 20 * rows.n_points < rows.n_terms < 110 * rows.n_points
    assert errors(rows.lit(light), truth).rmse < bound + 0.03


def test_rows_stay_within_their_memory(placement: Placement) -> None:
    whole = RowMaker(placement.hits, placement.sphere, effects(sky()))
    layers = [(MATT, placement.rows_of(0)), (MATT, placement.rows_of(1)), (COPPER, placement.rows_of(1))]
    small = whole.rows_within(layers, 40_000)
    kept = [joined_rows(small.rows(*each)) for each in layers]
    assert {rows.tiles[0].value.shape[1] for rows in kept} == {1, 3}
    terms = sum(tile.number.nbytes + tile.value.nbytes for rows in kept for tile in rows.tiles)
    assert 30_000 < terms < 50_000


def test_nothing_seen_is_nothing_reflected(placement: Placement) -> None:
    dark = RowMaker(placement.hits, placement.sphere, np.zeros(geodesic(4).n_triangles, np.float32))
    assert dark.rows_within([], 1e6) is dark and joined_rows([]).lit(light_coefficients(sky(), 0.0)).shape == (0, 3)
    some = [(MATT, placement.rows_of(0))]
    rows = joined_rows(dark.rows_within(some, 1e6).rows(*some[0]))  # a sky of nothing but a sun
    assert rows.n_terms == 0 and not rows.lit(light_coefficients(sky(), 0.0)).any()
