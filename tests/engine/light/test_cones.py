"""Cones of emitters: the extension's formula, and the compiled shares against it."""

import math

import numba as nb
import numpy as np
import pytest

from engine.light._cone_kernels import cone_range, cone_share
from engine.light.cones import all_round, cone_row, cone_shares


def unit(random: np.random.Generator, n: int) -> np.ndarray:
    directions = random.normal(size=(n, 3))
    return (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)


@pytest.mark.parametrize(("inner", "outer"), [(0.0, 1.0), (0.3, 0.8), (0.0, math.pi / 2.0), (0.5, 0.5)])
def test_shares_are_those_of_the_extension(inner: float, outer: float) -> None:
    axis, towards = np.array([0.0, -2.0, 0.0]), unit(np.random.default_rng(1), 500)
    # Light leaves against `towards`, so that its cosine with the axis (0, -1, 0) is y.
    scale = 1.0 / max(0.001, math.cos(inner) - math.cos(outer))
    expected = np.clip(towards[:, 1] * scale - math.cos(outer) * scale, 0.0, 1.0) ** 2
    np.testing.assert_allclose(
        cone_shares(cone_row(axis, inner, outer), towards), expected, atol=1e-3 if inner == outer else 1e-5
    )


def test_an_emitter_without_a_cone_sends_all_to_everywhere() -> None:
    towards = unit(np.random.default_rng(2), 9)
    assert (cone_shares(all_round(9), towards) == 1.0).all()


@nb.njit
def compiled(rows: np.ndarray, triangles: np.ndarray, sizes: np.ndarray, out: np.ndarray) -> None:
    for i in range(len(rows)):
        d = triangles[i, 0]
        out[i, 0] = cone_share(rows, i, d[0], d[1], d[2])
        out[i, 1], out[i, 2], out[i, 3] = cone_range(rows, i, triangles[i], sizes[i])


def test_compiled_shares_agree_and_are_bounded_over_triangles() -> None:
    random = np.random.default_rng(3)
    n = 400
    rows = np.array([cone_row(axis, *np.sort(random.uniform(0.0, 1.5, 2))) for axis in unit(random, n)])
    rows[::7] = all_round(len(rows[::7]))
    middles = unit(random, n)
    triangles = middles[:, None] + 0.2 * unit(random, 3 * n).reshape(n, 3, 3) * random.random((n, 1, 1), np.float32)
    triangles = (triangles / np.linalg.norm(triangles, axis=2, keepdims=True)).astype(np.float32)
    sizes = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2).max(axis=1)
    out = np.empty((n, 4), np.float32)
    compiled(rows, triangles, sizes, out)
    np.testing.assert_allclose(out[:, 0], cone_shares(rows, triangles[:, 0]), atol=1e-4)
    centres = triangles.sum(axis=1)
    centres /= np.linalg.norm(centres, axis=1, keepdims=True)
    np.testing.assert_allclose(out[:, 1], cone_shares(rows, centres), atol=1e-4)
    # Places on each triangle: barycentric, on the sphere.
    weights = random.dirichlet((1.0, 1.0, 1.0), 30)
    inside = np.einsum("wk,nki->nwi", weights, triangles)
    inside /= np.linalg.norm(inside, axis=2, keepdims=True)
    shares = cone_shares(rows[:, None], inside)
    assert (shares <= out[:, None, 3] + 1e-4).all() and (shares >= out[:, None, 2] - 1e-4).all()
