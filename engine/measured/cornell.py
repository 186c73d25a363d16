"""Scattered measurements of Cornell's Program of Computer Graphics, `.brdf`: text, spectral, one sample a line or more.

After comments (#) the number of wavelengths, the wavelengths in nm, then for each sample theta_i, phi_i, theta_o and
phi_o in radians and a value in 1/sr for every wavelength.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file
from engine.measured.spectrum import rgb_weights

SUFFIX = ".brdf"
MAX_BYTES = 64 * 2**20
MAX_WAVELENGTHS = 1000
FEWEST_SAMPLES = 50
LARGEST = 1e9

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
    return read_regular_file(path, MAX_BYTES)


def scattered_samples(data: bytes, path: Path) -> ScatteredSamples:
    """Parse the samples of a file. Raises LoadError."""
    numbers = _numbers(data, path)
    n = int(numbers[0]) if len(numbers) and numbers[0] == int(numbers[0]) else 0
    if not 3 <= n <= MAX_WAVELENGTHS or len(numbers) < 1 + n:
        raise LoadError(path, "number of wavelengths", f"{numbers[0]:g}" if len(numbers) else "nothing",
                        f"3 to {MAX_WAVELENGTHS}, and as many wavelengths")  # fmt: skip
    wavelengths, rest = numbers[1 : 1 + n], numbers[1 + n :]
    if not (np.diff(wavelengths) > 0.0).all() or wavelengths[0] > 500.0 or wavelengths[-1] < 600.0:
        found = f"{wavelengths[0]:g} to {wavelengths[-1]:g} nm"
        raise LoadError(path, "wavelengths", found, "ascending ones that reach from blue to red, in nm")
    if len(rest) % (4 + n) or len(rest) < FEWEST_SAMPLES * (4 + n):
        raise LoadError(path, "samples", f"{len(rest) / (4 + n):.2f}", f"{FEWEST_SAMPLES} whole ones at least")
    rows = rest.reshape(-1, 4 + n)
    wi, wo = (_direction(rows[:, k], rows[:, k + 1]) for k in (0, 2))
    good = (wi[:, 2] > 1e-6) & (wo[:, 2] > 1e-6) & (rows[:, 4:] >= 0.0).all(axis=1)
    if good.sum() < FEWEST_SAMPLES:
        raise LoadError(path, "samples above the horizon", int(good.sum()), f"{FEWEST_SAMPLES} at least")
    values = np.maximum(rows[good, 4:] @ rgb_weights(wavelengths), 0.0)
    return ScatteredSamples(wi[good], wo[good], values, int((~good).sum()))


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
