"""Transport along one curve in the renderer's form: a plane of numbers for each coefficient, with the picture.

    T = c_Bᵀ U or U c_A [BenArtzi07, eq. 4.16], transformed by Daubechies-4;   numbers = T / scale

Curve switching waits for this, so contraction, transform, scaling, rounding, norms and picture take one pass over the
packed bands. Halves hold nine decades and the planes span many more, so each plane has its own scale: a power of two,
estimated from a thousand points with room for 4,000 times as much. Where the estimate fails, the pass is repeated with
the maxima of the first one. Separate passes, through single precision, took five times as long.
"""

from dataclasses import dataclass

import numpy as np

from engine.planner import Precision
from engine.precompute.direct.bandstore import BandStore

SCALE_SAMPLES = 1024
# The largest number of a scaled plane: its estimated position, and its permitted range. Halves end at 65,504.
SCALE_MARGIN, LEAST, MOST = 16.0, 2.0**-4, 65504.0


@dataclass(frozen=True, eq=False)
class CurvePlanes:
    """numbers (J, P, 3) float16 or float32; true values are numbers · scale (J,).

    norms (J, 3): lengths of the true planes, per channel; radiance (P, 3) float32: the layer's picture.
    """

    numbers: np.ndarray
    scale: np.ndarray
    norms: np.ndarray
    radiance: np.ndarray


def curve_planes(
    store: BandStore, factor: int, coefficients: tuple[np.ndarray, np.ndarray], unit: float, precision: Precision
) -> CurvePlanes:
    """The planes of factor 0 (A) or 1 (B) of a layer with these curves, (J, 3) and (K, 3), times `unit`.

    Raises ValueError for coefficients whose shape is not the store's.
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
    """The power of two from each number up to its double, 1 for 0; within the range of single precision."""
    _, exponents = np.frexp(np.where((largest > 0.0) & np.isfinite(largest), largest, 0.5))
    return np.exp2(np.clip(exponents, -100, 100).astype(np.float64))
