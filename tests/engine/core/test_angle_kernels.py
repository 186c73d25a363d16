"""The arc tangent of kernels against the C library's, in all octants, at their borders, and for any length."""

from __future__ import annotations

import numpy as np
import pytest

from engine.core._angle_kernels import arc_tangent

EIGHTHS = np.arange(-8, 9) * np.pi / 8.0


@pytest.mark.parametrize("length", [1e-30, 1.0, 1e30])
def test_it_is_the_angle(length: float) -> None:
    borders = (EIGHTHS[:, None] + np.array([-1e-9, 0.0, 1e-9])).ravel()
    for angle in [*borders, *np.random.default_rng(1).uniform(-np.pi, np.pi, 2000)]:
        x, y = length * np.cos(angle), length * np.sin(angle)
        assert arc_tangent(y, x) == pytest.approx(np.arctan2(y, x), abs=1e-13)


def test_along_the_axes() -> None:
    axes = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (0.0, 0.0)]
    assert [arc_tangent(y, x) for y, x in axes] == pytest.approx([0.0, np.pi / 2, np.pi, -np.pi / 2, 0.0], abs=1e-13)
