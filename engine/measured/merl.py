"""MERL `.binary` files [Matusik03]: three 32-bit sizes, then a plane of float64 for red, green and blue.

Values are 1/sr divided by a scale for each colour. Sizes and length are fixed, and the only sign of the format: both
are checked before a value is read, since a reader that trusts them reads too little without an error. Negative values
mark samples that could not be measured, and those below the horizon.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file
from engine.measured.coordinates import SHAPE

SUFFIX = ".binary"
N_BYTES = 34_992_012
SCALE = np.array([1.0 / 1500.0, 1.15 / 1500.0, 1.66 / 1500.0])
MISSING = -1.0
# Brighter than any mirror that could be measured; well within single precision.
LARGEST = 1e9
_HEADER = 12
_COLOURS = ("red", "green", "blue")


def read_merl(path: Path) -> bytes:
    """The bytes of a file that has the right length and sizes. Raises LoadError."""
    data = read_regular_file(path, N_BYTES)
    if len(data) != N_BYTES:
        raise LoadError(path, "size", f"{len(data)} bytes", f"{N_BYTES} bytes, a MERL file of 90 x 90 x 180")
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
