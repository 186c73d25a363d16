"""A layer's radiance under one curve after another, against the whole sum over its transport."""

from __future__ import annotations

import numpy as np
import pytest

from engine.render._layer_kernels import add_points
from engine.render.layer_transport import LayerTransport
from tests.engine.precompute.direct.test_bandstore import sparse_bands, store_of


@pytest.mark.parametrize("bands", [(16, 8), (32, 1)])
def test_any_sequence_of_curves_is_the_whole_sum(bands: tuple[int, int]) -> None:
    random = np.random.default_rng(sum(bands))
    store = store_of(sparse_bands(300, *bands), chunk=64)
    transport = LayerTransport(store)
    curves = [random.random((bands[0], 3)), random.random((bands[1], 3)) if bands[1] > 1 else np.ones((1, 3))]
    for _ in range(40):
        which = 0 if bands[1] == 1 else int(random.integers(0, 2))
        changed, n = curves[which].copy(), int(random.integers(1, len(curves[which]) + 1))
        changed[random.choice(len(changed), n, replace=False)] *= random.choice([0.0, 0.5, 1.0, 30.0])
        curves[which] = changed + 1e-3
        if random.random() < 0.2:  # both at once
            curves = [curves[0] * 1.1, curves[1] * 0.9 if bands[1] > 1 else curves[1]]
        expected = store.radiance(curves[0], curves[1])
        found = transport.radiance(curves[:1] if bands[1] == 1 else curves)
        np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-5 * expected.max())


def test_a_dark_curve_is_no_difference_of_bright_ones() -> None:
    """A curve that was a million times as bright leaves nothing of its rounding."""
    store = store_of(sparse_bands(50, 16, 1), chunk=16)
    transport, dark = LayerTransport(store), np.full((16, 3), 0.5)
    bright = dark.copy()
    bright[3] = 1e6
    transport.radiance([bright])
    bright[4] = 1e6
    transport.radiance([bright])  # planes are made along it
    np.testing.assert_allclose(transport.radiance([dark]), store.radiance(dark, np.ones((1, 3))), rtol=1e-5)


def test_points_are_added_by_their_shares() -> None:
    picture = np.ones((3, 3), np.float32)
    radiance = np.array([[1, 2, 3], [4, 4, 4], [np.inf, 0, 0]], np.float32)
    add_points(np.array([2, 2, 0], np.int32), np.array([0.25, 0.5, 0.0], np.float32), radiance, picture)
    # 1 + 1/4 of the first + 1/2 of the second; what has no share does not count, however bright.
    np.testing.assert_array_equal(picture, [[1, 1, 1], [1, 1, 1], [3.25, 3.5, 3.75]])
