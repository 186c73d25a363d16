"""Reads large images a band of rows at a time: in bounded memory, and averaged to a half or a quarter if too large."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import XYZ_PRIMARIES, to_rec709, xyz_to_rec709
from engine.core.errors import LoadError
from engine.light.resampling import block_means, reduction

Float32Array = NDArray[np.float32]

MAX_SIDE = 16_384
MAX_PIXELS = 1 << 25
BAND_PIXELS = 1 << 21

# Reads rows from the first to before the last: (rows, W, 3). Bands come in their order, each once.
ReadBand = Callable[[int, int], Float32Array]


def check_size(file: Path, width: int, height: int) -> None:
    """Raises LoadError for images without pixels and for sides of more than `MAX_SIDE`."""
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise LoadError(file, "image size", f"{width} x {height}", f"sides of 1 to {MAX_SIDE}")


def divisor_of(file: Path, width: int, height: int, most_pixels: int | None, notes: list[str]) -> int:
    """The divisor of the sides: 1 up to `MAX_PIXELS`, otherwise what leaves `most_pixels`, with a note. None: the image
    must be read whole; raises LoadError."""
    if width * height <= MAX_PIXELS:
        return 1
    if most_pixels is None:
        refuse_size(file, width, height, MAX_PIXELS)
    k = reduction(width, height, most_pixels)
    notes.append(f"{width} x {height} pixels, shown at {-(-width // k)} x {-(-height // k)}")
    return k


def refuse_size(file: Path, width: int, height: int, most: int) -> NoReturn:
    """Raises LoadError for an image that must be read whole, and has more pixels than that."""
    raise LoadError(file, "image size", f"{width} x {height}", f"at most {most:,} pixels")


def empty_image(height: int, width: int, k: int) -> Float32Array:
    """An image for the means of each k x k pixels: (ceil(H / k), ceil(W / k), 3)."""
    return np.empty((-(-height // k), -(-width // k), 3), np.float32)


def fill_in_bands(image: Float32Array, height: int, k: int, row_pixels: int, read: ReadBand) -> None:
    """Reads an image of so many rows into one for its means, which may be a view of any strides.

    row_pixels: how many pixels are in memory for each row that is read. A value that is not finite affects its own
    block only.
    """
    n_rows = max(BAND_PIXELS // (row_pixels * k), 1) * k
    for start in range(0, height, n_rows):
        band = read(start, min(start + n_rows, height))
        with np.errstate(invalid="ignore", over="ignore"):
            means = block_means(band, k, lambda values: np.asarray(values, np.float32))
        image[start // k : start // k + len(means)] = means


def to_rec709_with_note(chromaticities: list[float], notes: list[str]) -> NDArray[np.float64] | None:
    """The matrix to Rec. 709 from primaries and white; None where nothing is to be converted.

    Primaries at (1, 0), (0, 1), (0, 0) are CIE XYZ itself, the usual way to mark it in OpenEXR. The white beside them
    is not that of the picture, and is not adapted.
    """
    if np.allclose(chromaticities[:6], XYZ_PRIMARIES, rtol=0.0, atol=1e-4):
        notes.append("CIE XYZ, converted to Rec. 709")
        return xyz_to_rec709()
    listed = " ".join(f"{each:.4g}" for each in chromaticities)
    try:
        matrix = to_rec709(chromaticities)
    except ValueError:
        notes.append(f"primaries {listed} are those of no colours, taken for Rec. 709's")
        return None
    if matrix is not None:
        notes.append(f"primaries {listed}, converted to Rec. 709 (Bradford)")
    return matrix


def transform_colours(band: Float32Array, matrix: NDArray[np.float64]) -> Float32Array:
    """Transforms colours (N, M, 3) by a matrix. A pixel with a value that is not finite stays what it is: otherwise an
    infinite sun would be the difference of infinities."""
    with np.errstate(invalid="ignore", over="ignore"):
        converted = (band.reshape(-1, 3) @ matrix.T.astype(np.float32)).reshape(band.shape)
    finite = np.isfinite(band).all(axis=2, keepdims=True)
    return converted if finite.all() else np.where(finite, converted, band)
