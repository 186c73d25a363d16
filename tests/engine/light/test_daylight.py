"""The sky of Preetham, Shirley and Smits: its zenith, its symmetry, its brightest place, and its sun."""

from __future__ import annotations

import math

import numpy as np
import pytest

from engine.light.daylight import LUMENS_A_WATT, horizontal_irradiance, sky_radiance, sun_irradiance, zenith_luminance
from engine.light.environment import LUMINANCE, constant_environment
from engine.light.painted_lights import PaintedLight
from engine.light.painting import painted_environment

UP = np.array([[0.0, 1.0, 0.0]])


def sun_at(elevation: float) -> np.ndarray:
    return np.array([0.0, math.sin(math.radians(elevation)), -math.cos(math.radians(elevation))])


def sphere(n: int) -> np.ndarray:
    """Directions above the horizon (N, 3)."""
    found = np.random.default_rng(3).normal(size=(n, 3))
    found[:, 1] = np.abs(found[:, 1])
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@pytest.mark.parametrize("turbidity", [2.0, 3.0, 6.0, 10.0])
def test_the_zenith_has_the_luminance_of_the_paper(turbidity: float):
    # tan chi is that of chi = (4/9 - T/120)(pi - 2 theta_s), worked by hand for T = 2, theta_s = 45°: chi = 0.672 rad,
    # 3.1196 tan chi - 0.431 + 2.4192 = 4.4714 kcd/m²
    assert zenith_luminance(2.0, 45.0) == pytest.approx(3.1196 * math.tan(0.671948) + 1.9882, rel=1e-4)
    radiance = sky_radiance(UP, sun_at(45.0), turbidity)[0]
    assert LUMENS_A_WATT * radiance @ LUMINANCE == pytest.approx(1000.0 * zenith_luminance(turbidity, 45.0), rel=1e-3)


def test_a_clear_sky_is_blue_away_from_the_sun_and_brightest_at_it():
    directions, sun = sphere(20000), sun_at(30.0)
    radiance = sky_radiance(directions, sun, 2.5)
    assert np.isfinite(radiance).all() and (radiance >= 0.0).all()
    luminance = radiance @ LUMINANCE
    assert directions[luminance.argmax()] @ sun > math.cos(math.radians(5.0))
    red, _, blue = radiance[np.abs(directions @ sun) < 0.1].mean(axis=0)
    assert blue > 2.0 * red


def test_the_sky_is_symmetric_about_the_sun_and_turns_with_it():
    directions, sun = sphere(1000), sun_at(40.0)
    radiance = sky_radiance(directions, sun, 3.0)
    assert sky_radiance(directions * [-1.0, 1.0, 1.0], sun, 3.0) == pytest.approx(radiance)
    turn = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    assert sky_radiance(directions @ turn.T, turn @ sun, 3.0) == pytest.approx(radiance)


def test_the_sun_has_the_illuminance_of_clear_days_and_reddens():
    # 90 to 110 klx behind clear air overhead; the solar constant is 133 klx
    assert 90e3 < LUMENS_A_WATT * np.array(sun_irradiance(2.0, 90.0)) @ LUMINANCE < 115e3
    colours = [sun_irradiance(3.0, elevation) for elevation in (60.0, 20.0, 5.0, 1.0)]
    for (red, _, blue), (low_red, _, low_blue) in zip(colours, colours[1:], strict=False):
        assert low_red < red and low_blue / low_red < blue / red
    assert sun_irradiance(3.0, -1.0) == (0.0, 0.0, 0.0)


def test_a_painted_sky_has_its_sun_and_a_ground_lit_by_both():
    ground, turbidity, elevation = (0.3, 0.2, 0.1), 3.0, 30.0
    light = PaintedLight(
        "sky",
        "sky",
        "cover",
        azimuth=0.0,
        elevation=elevation,
        radiance=(1.0, 1.0, 1.0),
        ground=ground,
        turbidity=turbidity,
    )
    sky = painted_environment(constant_environment(7.0), (light,))
    height, width, _ = sky.radiance.shape
    theta = math.pi * np.arange(height + 1) / height
    above = math.pi * np.diff(np.sin(np.minimum(theta, 0.5 * math.pi)) ** 2)
    found = np.einsum("hwc,h->c", sky.radiance, above / width, dtype=np.float64)
    expected = np.array(horizontal_irradiance(turbidity, elevation, 1.0))
    assert found == pytest.approx(expected, rel=0.01)
    assert sky.evaluate([[0.3, -1.0, 0.2]])[0] == pytest.approx(np.array(ground) / math.pi * expected, rel=1e-4)
