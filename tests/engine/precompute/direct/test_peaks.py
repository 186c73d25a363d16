"""Peaks of an environment: the split against its sum, their reflection against a closed form and final transport."""

import math

import numpy as np
import pytest

from engine.core.generators import run_to_end
from engine.light.environment import Environment, constant_environment, texel_solid_angles
from engine.light.suns import Sun, with_suns
from engine.light.triangle_lights import turned
from engine.material.layer import Layer
from engine.precompute.direct.peaks import split_peaks, trace_peaks
from engine.precompute.direct.relight import RowMaker, joined_rows, layer_reflection, light_coefficients
from engine.render.picture_difference import errors
from engine.sphere.geodesic import geodesic
from tests.engine.precompute.direct.test_relight import (
    BALL,
    COPPER,
    GOLD,
    GROUND,
    MATT,
    ROTATION,
    placement_of,
    transport,
)

HEIGHT = 64
SUN = (np.array([12, 13]), np.array([40, 41]))
EVERYTHING = np.ones(geodesic(4).n_triangles, np.float32)


def sunny() -> Environment:
    radiance = np.full((HEIGHT, 2 * HEIGHT, 3), 0.2, np.float32)
    radiance[np.ix_(*SUN)] = 900.0, 700.0, 400.0
    return Environment(radiance, "sunny")


def sun_direction() -> np.ndarray:
    """The middle of the four texels."""
    theta, phi = math.pi * 13 / HEIGHT, 2.0 * math.pi * (41 / (2 * HEIGHT) - 0.5)
    return np.array([math.sin(theta) * math.sin(phi), math.cos(theta), -math.sin(theta) * math.cos(phi)])


def test_peaks_and_the_rest_are_the_environment() -> None:
    whole = sunny()
    peaks, rest = split_peaks(whole)
    assert not rest.radiance[np.ix_(*SUN)].any() and np.count_nonzero(rest.radiance != whole.radiance) == 12
    omega = texel_solid_angles(*whole.radiance.shape[:2])[:, None, None]
    power = np.sum((whole.radiance - rest.radiance) * omega, axis=(0, 1))
    np.testing.assert_allclose(peaks.power.sum(axis=0), power, rtol=1e-3)
    middle = np.average(peaks.directions, axis=0, weights=peaks.power[:, 1])
    np.testing.assert_allclose(middle / np.linalg.norm(middle), sun_direction(), atol=5e-3)


@pytest.mark.parametrize("even", [0.0, 2.0])
def test_an_even_sky_has_no_peaks(even: float) -> None:
    sky = constant_environment(even)
    peaks, rest = split_peaks(sky)
    assert rest is sky and len(peaks.power) == 0


def test_a_sun_alone_is_all_peak() -> None:
    radiance = sunny().radiance - np.float32(0.2)
    peaks, rest = split_peaks(Environment(radiance, "sun"))
    assert not rest.radiance.any() and len(peaks.power) > 3


def test_directions_turn_with_the_environment() -> None:
    rng, whole = np.random.default_rng(3), sunny()
    directions = rng.normal(size=(200, 3)) + 3.0 * sun_direction()
    for degrees in (-400.0, 17.0, 133.0):
        seen = whole.evaluate(turned(directions, degrees), degrees)
        np.testing.assert_allclose(seen, whole.evaluate(directions), rtol=1e-2, atol=1e-2 * seen.max())


def test_an_open_plane_reflects_a_sun_by_the_cosine(tmp_path) -> None:
    plane = placement_of(tmp_path, GROUND)
    peaks, _ = split_peaks(sunny())
    for rotation in (0.0, 215.0):
        light = run_to_end(trace_peaks(plane, peaks, rotation, 2.0))
        found = light.reflected(plane.hits, layer_reflection(MATT), plane.rows_of(0))
        # 2 Φ cosθ / π, whatever the rotation about the vertical axis.
        truth = 2.0 * peaks.power.sum(axis=0) * sun_direction()[1] / math.pi
        np.testing.assert_allclose(found, np.tile(truth, (len(found), 1)), rtol=2e-3)


@pytest.mark.parametrize(("i_object", "layer"), [(0, MATT), (1, MATT), (1, GOLD), (1, COPPER)])
def test_peaks_and_rows_are_the_transport_of_a_turned_sky(tmp_path, i_object: int, layer: Layer) -> None:
    placement, whole = placement_of(tmp_path, GROUND + BALL), sunny()
    points = placement.rows_of(i_object)
    truth = transport(placement, layer, points, whole)
    rows = joined_rows(RowMaker(placement.hits, placement.sphere, EVERYTHING).rows(layer, points))
    peaks, rest = split_peaks(whole)
    light = run_to_end(trace_peaks(placement, peaks, ROTATION))
    together = rows.lit(light_coefficients(rest, ROTATION))
    together += light.reflected(placement.hits, layer_reflection(layer), points)
    by_rows = errors(rows.lit(light_coefficients(whole, ROTATION)), truth).rmse
    assert errors(together, truth).rmse < min(0.03, 0.5 * by_rows)


@pytest.mark.parametrize("diameter", [0.05, 0.53, 12.0])
def test_suns_that_were_added_are_peaks_and_their_map_is_the_rest(diameter: float) -> None:
    base, toward = constant_environment(0.3), np.array([0.48, 0.6, 0.64])
    sun = Sun(tuple(toward.tolist()), (3.0, 2.0, 1.0), diameter)
    whole = with_suns(base, (sun,))
    peaks, rest = split_peaks(whole)
    assert rest is base
    # All directions are within the disc and stand for even parts of it: their mean is its axis, shortened by half a
    # cap; the irradiance of a surface that faces it is as stated.
    cosines, radius = peaks.directions.astype(np.float64) @ toward, math.radians(0.5 * diameter)
    assert cosines.min() >= math.cos(radius) - 1e-6
    assert cosines.mean() == pytest.approx(0.5 * (1.0 + math.cos(radius)), abs=1e-6)
    np.testing.assert_allclose(peaks.power.T @ cosines, sun.irradiance, rtol=1e-5)
    omega = texel_solid_angles(*whole.radiance.shape[:2])[:, None, None]
    np.testing.assert_allclose(peaks.power.sum(axis=0), np.sum((whole.radiance - 0.3) * omega, axis=(0, 1)), rtol=1e-3)


def test_another_place_of_a_sun_leaves_the_rest_as_it_is() -> None:
    base = sunny()
    first, second = (split_peaks(with_suns(base, (Sun((0.0, height, 0.8), (1.0, 1.0, 1.0)),))) for height in (0.6, 0.1))
    own, rest = split_peaks(base)
    assert first[1] is second[1] is rest and len(first[0].power) == len(own.power) + 12


def test_an_image_that_is_made_of_one_with_suns_has_none_of_its_own() -> None:
    lit = with_suns(sunny(), (Sun((0.0, 0.6, 0.8), (1.0, 1.0, 1.0)),))
    assert lit.suns and lit.base is not None
    assert not lit.scale_by(2.0).suns and lit.scale_by(2.0).base is None
