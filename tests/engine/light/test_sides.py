"""The six sides of an environment."""

from __future__ import annotations

import numpy as np

from engine.light.environment import Environment, constant_environment, texel_solid_angles
from engine.light.sides import SIDES, side_weights, with_side_gains

WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)


def alone(name: str, gain: tuple[float, float, float] = WHITE) -> tuple[tuple[float, float, float], ...]:
    return tuple(gain if each == name else BLACK for each in SIDES)


def test_weights_sum_to_one_and_are_halves_at_edges() -> None:
    directions = np.random.default_rng(3).normal(size=(1000, 3))
    weights = side_weights(directions)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-12)
    assert (weights >= 0.0).all()
    np.testing.assert_array_equal(side_weights(np.array(list(SIDES.values()))), np.eye(6))
    edge, corner = side_weights(np.array([[1.0, 1.0, 0.0], [-2.0, 2.0, 2.0]]))
    np.testing.assert_allclose(edge, [0.0, 0.5, 0.0, 0.0, 0.5, 0.0])
    np.testing.assert_allclose(corner, [0.0, 0.0, 1 / 3, 1 / 3, 1 / 3, 0.0])
    # tan(8 / 7 ...): 0.9 where (1 / tan a)^8 = 9, which is 37.2 degrees from the normal.
    angle = np.arctan(9.0 ** (-1 / 8))
    np.testing.assert_allclose(side_weights(np.array([[np.cos(angle), np.sin(angle), 0.0]]))[0, 1], 0.9)


def test_sides_alone_sum_to_the_whole() -> None:
    whole = Environment(np.random.default_rng(4).random((96, 200, 3), np.float32), "noise")
    total = sum(with_side_gains(whole, alone(name)).radiance.astype(np.float64) for name in SIDES)
    np.testing.assert_allclose(total, whole.radiance, rtol=1e-5)
    mixed = with_side_gains(whole, tuple((0.5 * k, 1.0, 2.0) for k in range(6)))
    parts = sum(0.5 * k * with_side_gains(whole, alone(name)).radiance[..., 0] for k, name in enumerate(SIDES))
    np.testing.assert_allclose(mixed.radiance[..., 0], parts, rtol=1e-4, atol=1e-6)
    assert with_side_gains(whole, (WHITE,) * 6) is whole


def test_each_side_of_an_even_sky_is_a_sixth_of_its_light() -> None:
    for name, normal in SIDES.items():
        side = with_side_gains(constant_environment((1.0, 2.0, 3.0)), alone(name))
        height, width, _ = side.radiance.shape
        power = np.einsum("hwc,h->c", side.radiance.astype(np.float64), texel_solid_angles(height, width))
        np.testing.assert_allclose(power, 4.0 * np.pi / 6.0 * np.array([1.0, 2.0, 3.0]), rtol=2e-3)
        np.testing.assert_allclose(side.evaluate([normal])[0], (1.0, 2.0, 3.0), rtol=1e-3)
