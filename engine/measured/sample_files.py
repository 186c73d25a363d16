"""Reads measured reflection: MERL's tables, Cornell's scattered samples; and fills the gaps of tables.

**MERL** `.binary` files [Matusik03]: three 32-bit sizes, then a plane of float64 for red, green and blue. Values are
1/sr divided by a scale for each colour. Sizes and length are fixed, and the only sign of the format: both are checked
before a value is read, since a reader that trusts them reads too little without an error. Negative values mark samples
that could not be measured, and those below the horizon.

**Cornell** `.brdf` files of the Program of Computer Graphics: text, spectral, one sample a line or more. After comments
(#) the number of wavelengths, the wavelengths in nm, then for each sample theta_i, phi_i, theta_o and phi_o in radians
and a value in 1/sr for every wavelength. Spectra become linear Rec. 709: reflectance under D65 for the CIE 1931
observer. A uniform spectrum has equal channels: the error of the white point that a limited range of wavelengths causes
is divided out. Saturated paints may be outside of the gamut; their negative channel becomes 0.

**Gaps** are interpolated linearly in phi_d, in which reflection changes slowest, between the nearest existing samples;
empty rows, and samples below the horizon, take the last sample before them in theta_d, the one just above the horizon.
Samples below are never visible, but interpolation near the horizon reads them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file
from engine.measured.measurement import SHAPE, above_horizon

MERL_SUFFIX = ".binary"
N_MERL_BYTES = 34_992_012
SCALE = np.array([1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0])
MISSING = -1.0
# Brighter than any mirror that could be measured; well within single precision.
LARGEST = 1e9
_HEADER = 12
_COLOURS = ("red", "green", "blue")


def read_merl(path: Path) -> bytes:
    """The bytes of a file that has the right length and sizes. Raises LoadError."""
    data = read_regular_file(path, N_MERL_BYTES)
    if len(data) != N_MERL_BYTES:
        raise LoadError(path, "size", f"{len(data)} bytes", f"{N_MERL_BYTES} bytes, a MERL file of 90 x 90 x 180")
    sizes = np.frombuffer(data, "<i4", 3)
    if tuple(sizes) != SHAPE:
        found = " x ".join(str(size) for size in sizes)
        raise LoadError(path, "dimensions", found, " x ".join(str(size) for size in SHAPE))
    return data


def merl_samples(data: bytes, path: Path) -> NDArray[np.float32]:
    """Reflection (90, 90, 180, 3), 1/sr, of the bytes from `read_merl`; negative where nothing was measured.

    Raises LoadError for values that are not finite, naming the first.
    """
    planes = np.frombuffer(data, "<f8", offset=_HEADER).reshape(3, -1)
    samples = np.empty((planes.shape[1], 3), np.float32)
    for channel, (plane, scale) in enumerate(zip(planes, SCALE, strict=True)):
        good = np.abs(plane) <= LARGEST  # false for NaN
        if not good.all():
            raise _bad_value(path, plane, channel, int(np.argmin(good)))
        samples[:, channel] = plane * scale
    return samples.reshape(*SHAPE, 3)


def merl_bytes(samples: NDArray[np.floating]) -> bytes:
    """The file of a table (90, 90, 180, 3) in 1/sr; negative values are written as missing."""
    planes = np.moveaxis(np.asarray(samples, np.float64), -1, 0).reshape(3, -1) / SCALE[:, None]
    planes = np.where(planes < 0.0, MISSING, planes)
    return np.array(SHAPE, "<i4").tobytes() + planes.astype("<f8").tobytes()


def _bad_value(path: Path, plane: NDArray[np.float64], channel: int, index: int) -> LoadError:
    i, j, k = np.unravel_index(index, SHAPE)
    where = f"{_COLOURS[channel]} at theta_h {i}, theta_d {j}, phi_d {k}"
    return LoadError(path, where, float(plane[index]), f"a finite number of at most {LARGEST:g}")


CORNELL_SUFFIX = ".brdf"
MAX_CORNELL_BYTES = 64 * 2**20
MAX_WAVELENGTHS = 1000
FEWEST_SAMPLES = 50

Float64Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ScatteredSamples:
    """Samples: directions wi, wo (N, 3) in the local frame, reflection (N, 3), 1/sr, linear Rec. 709, at least 0.

    n_below: number of omitted samples, which were below the horizon or negative.
    """

    wi: Float64Array
    wo: Float64Array
    values: Float64Array
    n_below: int


def read_cornell(path: Path) -> bytes:
    """The bytes of a file. Raises LoadError."""
    return read_regular_file(path, MAX_CORNELL_BYTES)


def scattered_samples(data: bytes, path: Path) -> ScatteredSamples:
    """Parse the samples of a file. Raises LoadError."""
    numbers = _numbers(data, path)
    n = int(numbers[0]) if len(numbers) and numbers[0] == int(numbers[0]) else 0
    if not 3 <= n <= MAX_WAVELENGTHS or len(numbers) < 1 + n:
        raise LoadError(path, "number of wavelengths", f"{numbers[0]:g}" if len(numbers) else "nothing",
                        f"3 to {MAX_WAVELENGTHS}, and as many wavelengths")  # fmt: skip
    wavelengths, rest = numbers[1 : 1 + n], numbers[1 + n :]
    require_visible_range(wavelengths, path)
    if len(rest) % (4 + n) or len(rest) < FEWEST_SAMPLES * (4 + n):
        raise LoadError(path, "samples", f"{len(rest) / (4 + n):.2f}", f"{FEWEST_SAMPLES} whole ones at least")
    rows = rest.reshape(-1, 4 + n)
    wi, wo = (_direction(rows[:, k], rows[:, k + 1]) for k in (0, 2))
    good = (wi[:, 2] > 1e-6) & (wo[:, 2] > 1e-6) & (rows[:, 4:] >= 0.0).all(axis=1)
    if good.sum() < FEWEST_SAMPLES:
        raise LoadError(path, "samples above the horizon", int(good.sum()), f"{FEWEST_SAMPLES} at least")
    values = np.maximum(rows[good, 4:] @ rgb_weights(wavelengths), 0.0)
    return ScatteredSamples(wi[good], wo[good], values, int((~good).sum()))


def require_visible_range(wavelengths: Float64Array, path: Path) -> None:
    """Raise LoadError for wavelengths (n,) that do not ascend, or of which no colour follows."""
    if not (np.diff(wavelengths) > 0.0).all() or wavelengths[0] > 500.0 or wavelengths[-1] < 600.0:
        found = f"{wavelengths[0]:g} to {wavelengths[-1]:g} nm"
        raise LoadError(path, "wavelengths", found, "ascending ones that reach from blue to red, in nm")


def _numbers(data: bytes, path: Path) -> Float64Array:
    """All numbers outside comments. Raises LoadError that names the line of anything else."""
    found: list[float] = []
    for number, line in enumerate(data.decode("ascii", "replace").splitlines(), 1):
        words = line.partition("#")[0].split()
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise LoadError(path, f"line {number}", line.strip(), "numbers") from None
        bad = next((value for value in values if not abs(value) <= LARGEST), None)
        if bad is not None:
            raise LoadError(path, f"line {number}", bad, f"finite numbers of at most {LARGEST:g}")
        found += values
    return np.array(found)


def _direction(theta: Float64Array, phi: Float64Array) -> Float64Array:
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)


# Every 10 nm from 400 to 700: the observer's x, y, z, and the illuminant's power [CIE04].
_OBSERVER = np.array([
    [0.0143, 0.0004, 0.0679], [0.0435, 0.0012, 0.2074], [0.1344, 0.0040, 0.6456], [0.2839, 0.0116, 1.3856],
    [0.3483, 0.0230, 1.7471], [0.3362, 0.0380, 1.7721], [0.2908, 0.0600, 1.6692], [0.1954, 0.0910, 1.2876],
    [0.0956, 0.1390, 0.8130], [0.0320, 0.2080, 0.4652], [0.0049, 0.3230, 0.2720], [0.0093, 0.5030, 0.1582],
    [0.0633, 0.7100, 0.0782], [0.1655, 0.8620, 0.0422], [0.2904, 0.9540, 0.0203], [0.4334, 0.9950, 0.0087],
    [0.5945, 0.9950, 0.0039], [0.7621, 0.9520, 0.0021], [0.9163, 0.8700, 0.0017], [1.0263, 0.7570, 0.0011],
    [1.0622, 0.6310, 0.0008], [1.0026, 0.5030, 0.0003], [0.8544, 0.3810, 0.0002], [0.6424, 0.2650, 0.0000],
    [0.4479, 0.1750, 0.0000], [0.2835, 0.1070, 0.0000], [0.1649, 0.0610, 0.0000], [0.0874, 0.0320, 0.0000],
    [0.0468, 0.0170, 0.0000], [0.0227, 0.0082, 0.0000], [0.0114, 0.0041, 0.0000],
])  # fmt: skip
_D65 = np.array([
    82.7549, 91.4860, 93.4318, 86.6823, 104.865, 117.008, 117.812, 114.861, 115.923, 108.811, 109.354, 107.802,
    104.790, 107.689, 104.405, 104.046, 100.000, 96.3342, 95.7880, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886,
    83.6992, 80.0268, 80.2146, 82.2778, 78.2842, 69.7213, 71.6091,
])  # fmt: skip
_TABULATED = np.arange(400.0, 701.0, 10.0)
_REC_709 = np.array([
    [3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]
])  # fmt: skip


def rgb_weights(wavelengths: Float64Array) -> Float64Array:
    """Weights (n, 3) with which reflectances at ascending wavelengths (n,), nm, sum to linear Rec. 709."""
    light = np.interp(wavelengths, _TABULATED, _D65, 0.0, 0.0)
    seen = np.stack([np.interp(wavelengths, _TABULATED, axis, 0.0, 0.0) for axis in _OBSERVER.T], axis=1)
    weights = (seen * (light * np.gradient(wavelengths))[:, None]) @ _REC_709.T
    return np.asarray(weights / weights.sum(axis=0))


@dataclass(frozen=True, eq=False)
class FilledTable:
    """A table (90, 90, 180, 3) float32 without gaps; measured (90, 90, 180): which samples are original; and the number
    of filled samples, above the horizon and below it."""

    table: NDArray[np.float32]
    measured: NDArray[np.bool_]
    n_missing: int
    n_below: int


def fill_samples(samples: NDArray[np.float32]) -> FilledTable | None:
    """Fill all samples that are negative in any channel; None if there is no other."""
    measured: NDArray[np.bool_] = np.asarray((samples >= 0.0).all(axis=-1))
    if not measured.any():
        return None
    above = above_horizon()
    missing = np.asarray(above & ~measured)
    n_missing, n_below = int(missing.sum()), int((~above & ~measured).sum())
    table = np.ascontiguousarray(samples, np.float32).copy()
    known = measured.copy()
    _fill_around(table, known, above)
    for axis in (1, 0, 2):
        if not known.all():
            table, known = _extrapolate(table, known, axis)
    return FilledTable(table, measured & above, n_missing, n_below)


def _extrapolate(
    table: NDArray[np.float32], known: NDArray[np.bool_], axis: int
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Replace unknown samples by the last known one along an axis, or by the first if there is none before."""
    n = table.shape[axis]
    places = np.arange(n).reshape([-1 if a == axis else 1 for a in range(3)])
    before = np.maximum.accumulate(np.where(known, places, -1), axis=axis)
    after = np.flip(np.minimum.accumulate(np.flip(np.where(known, places, n), axis), axis=axis), axis)
    source = np.where(before >= 0, before, np.where(after < n, after, places))
    carried = np.take_along_axis(table, source[..., None], axis=axis)
    return np.ascontiguousarray(carried), np.asarray(np.take_along_axis(known, source, axis=axis))


def _fill_around(table: NDArray[np.float32], known: NDArray[np.bool_], above: NDArray[np.bool_]) -> None:
    """Fill gaps above the horizon in rows over phi_d that have samples."""
    gaps = above & ~known
    n = table.shape[2]
    for i, j in np.argwhere(gaps.any(axis=2) & known.any(axis=2)):
        at, there = np.flatnonzero(gaps[i, j]), np.flatnonzero(known[i, j])
        for channel in range(3):
            table[i, j, at, channel] = np.interp(at, there, table[i, j, there, channel], period=n)
        known[i, j, at] = True
