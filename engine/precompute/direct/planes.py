"""Transport along one curve as the renderer takes it: a plane of numbers for each coefficient, with the picture.

    T = c_Bᵀ U or U c_A [BenArtzi07, eq. 4.16], transformed by Daubechies-4;   numbers = T / scale

Curve switching waits for this, so contraction, transform, scaling, rounding, norms and picture are one pass over the
packed bands. Halves hold nine decades and the planes span many more, so each plane has a scale of its own: a power of
two, guessed from a thousand points with room for 4,000 times as much. Where the guess fails, the pass is made once
more with what the first has found. A pass for each, through single precision, took five times as long.
"""

from dataclasses import dataclass

import numpy as np

from engine.planner import Precision
from engine.precompute.direct.bandstore import BandStore

SCALE_SAMPLES = 1024
# The scaled plane's largest number: where a guess puts it and where it must lie. Halves end at 65,504.
SCALE_MARGIN, LEAST, MOST = 16.0, 2.0**-4, 65504.0


@dataclass(frozen=True, eq=False)
class CurvePlanes:
    """numbers (J, P, 3) float16 or float32; true values are numbers · scale (J,).

    norms (J, 3): lengths of the true planes, channel by channel; radiance (P, 3) float32: the layer's picture.
    """

    numbers: np.ndarray
    scale: np.ndarray
    norms: np.ndarray
    radiance: np.ndarray


def curve_planes(
    store: BandStore, factor: int, coefficients: tuple[np.ndarray, np.ndarray], unit: float, precision: Precision
) -> CurvePlanes:
    """The planes of factor 0 (A) or 1 (B) of a layer with these curves, (J, 3) and (K, 3), times `unit`.

    Raises ValueError for coefficients that are not the store's.
    """
    dtype = np.float16 if precision == "half" else np.float32
    guessed = store.thin(SCALE_SAMPLES).fill(factor, coefficients, np.ones(store.bands[factor]), dtype)
    scale = _power_of_two(guessed.maxima) / SCALE_MARGIN
    found = store.fill(factor, coefficients, 1.0 / scale, dtype)
    if ((found.maxima > MOST) | ((found.maxima < LEAST) & (found.maxima > 0.0))).any():
        scale *= _power_of_two(found.maxima)
        found = store.fill(factor, coefficients, 1.0 / scale, dtype)
    scale *= unit
    norms = np.sqrt(found.squares) * scale[:, None]
    return CurvePlanes(found.numbers, scale, norms, found.radiance * np.float32(unit))


def _power_of_two(largest: np.ndarray) -> np.ndarray:
    """The power of two from each number up to its double, 1 for 0; within single precision's reach."""
    _, exponents = np.frexp(np.where((largest > 0.0) & np.isfinite(largest), largest, 0.5))
    return np.exp2(np.clip(exponents, -100, 100).astype(np.float64))
