"""The difference between two pictures: one number, and false colours for each pixel.

The number is relRMSE, by which all accuracy here is measured. Colours are on its scale: a pixel's difference is divided
by the mean of the reference, and each factor of 1.4 has a shade of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import InsituError
from engine.light.environment import LUMINANCE
from engine.render.display import LEAST_ERROR, MOST_ERROR, error_to_radiance, false_colour

CLAMP_PERCENTILE = 99.9
DifferenceKind = Literal["signed", "absolute"]
# From where a pixel is as its reference, through where it differs by 1 %, to the end of the scale; sRGB.
_BRIGHTER = np.array([[0.09, 0.09, 0.10], [0.78, 0.24, 0.12], [1.0, 0.88, 0.45]])
_DARKER = np.array([[0.09, 0.09, 0.10], [0.13, 0.38, 0.80], [0.62, 0.92, 1.0]])


@dataclass(frozen=True)
class Errors:
    """relRMSE and the relative difference of means of a picture against the truth."""

    rmse: float
    mean: float


def errors(ours: NDArray[np.floating], truth: NDArray[np.floating]) -> Errors:
    """relRMSE = sqrt(mean((a-b)²)) / mean(b), both clamped at the truth's 99.9 percentile [docs/conventions.md].

    Any equal shapes, linear RGB. A black truth counts differences as they are.
    """
    a, b = np.asarray(ours, np.float64), np.asarray(truth, np.float64)
    top = np.percentile(b, CLAMP_PERCENTILE)
    if top > 0.0:  # else the truth is black but for a few pixels, and what is clamped at 0 would equal it
        a, b = np.minimum(a, top), np.minimum(b, top)
    mean = b.mean() or 1.0
    return Errors(float(np.sqrt(np.mean((a - b) ** 2)) / mean), float((a.mean() - b.mean()) / mean))


class Largest(NamedTuple):
    """Where two pictures differ most, in root mean square of channels, and by which share of the reference's mean."""

    column: int
    row: int
    share: float


def largest_difference(ours: NDArray[np.floating], reference: NDArray[np.floating]) -> Largest:
    """Of linear pictures (H, W, 3)."""
    shares = _shares(np.asarray(ours, np.float64), np.asarray(reference, np.float64))
    row, column = np.unravel_index(int(shares.argmax()), shares.shape)
    return Largest(int(column), int(row), float(shares[row, column]))


def check_same_size(ours: NDArray[np.floating], reference: NDArray[np.floating], name: str) -> None:
    """Raise InsituError, which calls the reference by its name, where two pictures (H, W, n) differ in size."""
    (height, width), (other_height, other_width) = ours.shape[:2], reference.shape[:2]
    if (height, width) != (other_height, other_width):
        raise InsituError(
            f"{name}: {other_width} x {other_height} pixels, expected {width} x {height} as the picture that it is "
            "compared with"
        )


def difference_colours(
    ours: NDArray[np.floating], reference: NDArray[np.floating], kind: DifferenceKind
) -> NDArray[np.uint8]:
    """False colours (H, W, 3), sRGB, of linear pictures (H, W, 3).

    absolute: the root mean square of a pixel's channels, in the shades of the error map; signed: luminance, red to
    yellow where ours is brighter, blue to white where it is darker, nearly black below `LEAST_ERROR`.
    """
    a, b = np.asarray(ours, np.float64), np.asarray(reference, np.float64)
    if kind == "absolute":
        return _bytes(false_colour(np.repeat(error_to_radiance(_shares(a, b))[..., None], 3, axis=2)))
    return _bytes(signed_colours((a - b) @ LUMINANCE / (b.mean() or 1.0)))


def _shares(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Each pixel's root mean square difference as a share of the mean of b; of a black one as it is."""
    return np.asarray(np.sqrt(np.mean((a - b) ** 2, axis=2)) / (b.mean() or 1.0))


def signed_colours(shares: NDArray[np.floating]) -> NDArray[np.float64]:
    """The colours (..., 3) in [0, 1] of signed shares of the mean: their size on a logarithmic scale from
    `LEAST_ERROR` to `MOST_ERROR`."""
    size = np.log(np.maximum(np.abs(shares), 1e-12) / LEAST_ERROR) / np.log(MOST_ERROR / LEAST_ERROR)
    place = 2.0 * np.clip(size, 0.0, 1.0)[..., None]
    ends = np.where((np.asarray(shares) > 0.0)[..., None, None], _BRIGHTER, _DARKER)
    low, middle, high = (ends[..., i, :] for i in range(3))
    lower, upper = np.minimum(place, 1.0), np.maximum(place - 1.0, 0.0)
    return np.asarray(low + (middle - low) * lower + (high - middle) * upper)


def _bytes(colours: NDArray[np.floating]) -> NDArray[np.uint8]:
    return np.round(255.0 * colours).astype(np.uint8)
