"""Suns that are summed at once, and those that a ray is sent to, against twins that go one by one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.realtime.triple_product import _pixel_kernels, _slice_kernels, _visibility_kernels
from engine.realtime.triple_product._incident_kernels import child_at
from engine.realtime.triple_product._slice_kernels import PeakLights
from engine.realtime.triple_product.incident import SkyMap, hemisphere
from engine.realtime.triple_product.pixel_reflection import _in_rows
from engine.realtime.triple_product.visibility import upper_triangles

N_POINTS, N_SAMPLES, N_SUNS = 40, 60, 11


class Case(NamedTuple):
    corners: NDArray[np.int32]
    weights: NDArray[np.float32]
    frame: NDArray[np.float32]
    turned: NDArray[np.float32]
    wo: NDArray[np.float32]
    bits: NDArray[np.uint8]
    sky: SkyMap

    def share(self, j: int, sun: int) -> float:
        """How much of a sun sample j sees."""
        seen = self.bits[self.corners[j], sun >> 3] >> (sun & 7) & 1
        return float(self.weights[j] @ seen)


@pytest.fixture(scope="module")
def case() -> Case:
    chance = np.random.default_rng(5)

    def unit(*shape: int) -> NDArray[np.float32]:
        drawn = chance.normal(size=(*shape, 3))
        return (drawn / np.linalg.norm(drawn, axis=-1, keepdims=True)).astype(np.float32)

    def frames(n: int) -> NDArray[np.float32]:
        return np.stack([np.linalg.qr(chance.normal(size=(3, 3)))[0] for _ in range(n)]).astype(np.float32)

    no_map = np.zeros((1, 1, 4), np.float32)
    return Case(
        chance.integers(0, N_POINTS, (N_SAMPLES, 3)).astype(np.int32),
        chance.dirichlet(np.ones(3), N_SAMPLES).astype(np.float32),
        frames(N_POINTS), frames(N_SAMPLES), unit(N_SAMPLES),
        chance.integers(0, 256, (N_POINTS, 12)).astype(np.uint8),
        SkyMap(no_map, no_map, 0.0, unit(N_SUNS), chance.uniform(1, 5, (N_SUNS, 3)).astype(np.float32), unit(8, 16)),
    )  # fmt: skip


def test_suns_on_turned_surfaces_one_by_one(case: Case) -> None:
    out = np.empty((N_SAMPLES, 3), np.float32)
    _pixel_kernels.peak_irradiance(
        0, N_SAMPLES, np.arange(N_SAMPLES), case.corners, case.weights, case.turned, case.frame, case.bits,
        *_in_rows(case.sky), _pixel_kernels.of_bytes(), out,
    )  # fmt: skip
    for j in range(N_SAMPLES):
        before, expected = case.weights[j] @ case.frame[case.corners[j], 1], np.zeros(3)
        for sun, (way, power) in enumerate(zip(case.sky.peak_direction, case.sky.peak_power, strict=True)):
            cosine = max(float(case.turned[j, 1] @ way), 0.0) - float(before @ way)
            expected += case.share(j, sun) * cosine * power
        np.testing.assert_allclose(out[j], expected, rtol=1e-4, atol=1e-5)


def test_slices_of_suns_on_turned_surfaces_one_by_one(case: Case) -> None:
    """Of slices that are the same seen from anywhere, and of another value in each triangle."""
    n, children = len(upper_triangles()), hemisphere().children
    value = np.random.default_rng(6).integers(1, 128, n).astype(np.float32)  # exact in 16 bits
    values = _slice_kernels.packed(np.append(np.tile(np.repeat(value, 3), 4), np.float32(0.0)))
    same = np.tile(np.arange(n, dtype=np.int32), (2, 1))
    tables = _slice_kernels.Tables(np.zeros(1, np.uint16), values, same, same, 2, 2, 1.5, 1)
    out = np.empty((N_SAMPLES, 3), np.float32)
    _pixel_kernels.peak_radiance(
        0, N_SAMPLES, np.arange(N_SAMPLES), case.corners, case.weights, case.wo, case.turned, case.bits,
        *_in_rows(case.sky), children, _pixel_kernels.of_bytes(), tables, out,
    )  # fmt: skip
    for j in range(N_SAMPLES):
        expected = np.zeros(3)
        for sun, (way, power) in enumerate(zip(case.sky.peak_direction, case.sky.peak_power, strict=True)):
            x, y, z = case.turned[j] @ way
            if y > 0.0:
                expected += case.share(j, sun) * power * value[child_at(x, y, z, children) >> 2]
        np.testing.assert_allclose(out[j], expected, rtol=1e-4)


@pytest.mark.parametrize(("strong", "everywhere"), [(0, False), (0b1001, False), (0, True)])
@pytest.mark.parametrize("n_suns", [5, 8])
def test_suns_that_points_do_not_agree_on(case: Case, n_suns: int, strong: int, everywhere: bool) -> None:
    bits = case.bits.copy()
    bits[: N_POINTS // 2] = 255  # some samples' points agree
    suns = PeakLights(case.sky.peak_direction, case.sky.peak_power, bits, hemisphere().children, 0.0)
    row, sun = np.empty((2, N_SAMPLES * n_suns), np.int32)
    share, cosine = np.empty((2, len(row)), np.float32)
    n = _visibility_kernels.uncertain_peaks(
        np.arange(N_SAMPLES), case.corners, case.weights, case.frame, suns, n_suns, strong, everywhere, row, sun, share,
        cosine,
    )  # fmt: skip
    expected = []
    for j in range(N_SAMPLES):
        for s in range(n_suns):
            seen = bits[case.corners[j], 0] >> s & 1
            high = case.frame[case.corners[j], 1] @ case.sky.peak_direction[s]
            if len(set(seen)) == 2 or ((everywhere or strong >> s & 1) and case.weights[j] @ high > 0.0):
                expected.append((j, s, case.weights[j] @ seen, case.weights[j] @ (seen * high)))
    found = np.stack([each[:n] for each in (row, sun, share, cosine)], axis=1)  # the rest is not written
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)
    assert 0 < n < len(row)
