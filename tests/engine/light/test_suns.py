import numpy as np
import pytest

from engine.light.environment import Environment, constant_environment, texel_solid_angles, triangle_integrals
from engine.light.suns import Sun, with_suns
from engine.light.triangle_lights import quick_integrals
from tests.naive.sphere import directions_of_texels

OVERCAST = Environment(np.full((32, 64, 3), 0.25, np.float32), "overcast")


def irradiance(environment: Environment, normal: np.ndarray) -> np.ndarray:
    """Texel by texel."""
    height, width, _ = environment.radiance.shape
    cosine = np.maximum(directions_of_texels(height, width) @ normal, 0.0)
    weights = cosine * texel_solid_angles(height, width)[:, None]
    return np.einsum("hwc,hw->c", environment.radiance.astype(np.float64), weights)


@pytest.mark.parametrize("diameter", [0.1, 0.53, 10.0, 90.0])
@pytest.mark.parametrize("direction", [(0, 1, 0), (0.3, 0.8, -0.5), (-1, 0.02, 0), (0, -1, 0), (0, 0, 1)])
def test_a_sun_has_its_irradiance_and_its_size(direction: tuple[float, float, float], diameter: float) -> None:
    power = np.array([1.0, 2.0, 3.0])
    lit = with_suns(constant_environment(0.0), (Sun(direction, (1.0, 2.0, 3.0), diameter),))
    towards = np.array(direction) / np.linalg.norm(direction)
    # Of a surface that faces it: E. That of one turned away by 60 degrees is half of it.
    np.testing.assert_allclose(irradiance(lit, towards), power, rtol=2e-3)
    aside = np.cross(towards, np.eye(3)[np.argmin(np.abs(towards))])
    turned = 0.5 * towards + np.sqrt(0.75) * aside / np.linalg.norm(aside)
    if diameter <= 10.0:
        np.testing.assert_allclose(irradiance(lit, turned), 0.5 * power, rtol=5e-3)
    # L = E / (pi sin² r), and nothing beyond a texel's diagonal from the disc.
    radius = np.radians(diameter / 2.0)
    if diameter >= 0.53:
        assert lit.radiance[..., 0].max() == pytest.approx(1.0 / (np.pi * np.sin(radius) ** 2), rel=0.02)
    angle = np.arccos(np.clip(directions_of_texels(*lit.radiance.shape[:2]) @ towards, -1.0, 1.0))
    assert not lit.radiance[angle > radius + 0.005].any()


def test_the_sky_stays_and_suns_add_up() -> None:
    sun = Sun((1.0, 1.0, 0.0), (4.0, 4.0, 4.0))
    lit = with_suns(OVERCAST, (sun, sun))
    assert lit.radiance.shape == (128, 256, 3)  # four times as fine, as it is interpolated
    up = np.array([0.0, 1.0, 0.0])
    # The sky gives pi L, each sun E cos 45°.
    np.testing.assert_allclose(irradiance(lit, up), np.pi * 0.25 + 8.0 * np.sqrt(0.5), rtol=2e-3)
    assert with_suns(OVERCAST, ()) is OVERCAST
    assert with_suns(OVERCAST, (sun, sun)) is lit


def test_lights_are_cut_from_it() -> None:
    """The power in the triangles is that of the disc."""
    lit = with_suns(constant_environment(0.0), (Sun((0.2, 0.9, 0.3), (3.0, 3.0, 3.0)),))
    np.testing.assert_allclose(triangle_integrals(lit, 0.0, 5).sum(axis=0), 3.0, rtol=1e-4)


@pytest.mark.parametrize("rotation", [0.0, 70.0])
def test_quick_integrals_are_those_of_the_image(rotation: float) -> None:
    rng = np.random.default_rng(5)
    base = Environment(rng.uniform(0.1, 1.0, (256, 512, 3)).astype(np.float32), "noise")
    suns = (Sun((0.48, 0.6, 0.64), (300.0, 200.0, 100.0)), Sun((-0.6, 0.0, 0.8), (5.0, 9.0, 7.0), 15.0))
    whole = with_suns(base, suns)
    found, truth = quick_integrals(whole, rotation, 3), triangle_integrals(whole, rotation, 3)
    np.testing.assert_allclose(found.sum(axis=0), truth.sum(axis=0), rtol=2e-3)
    # A sun at an edge may lie in either triangle: what neighbours share is compared.
    size = truth.max()
    assert np.abs(found - truth).sum() < 0.1 * size + 0.02 * truth.sum()
    assert quick_integrals(base, rotation, 3) is triangle_integrals(base, rotation, 3)
