"""From spectra to linear Rec. 709: reflectance under D65 for the CIE 1931 observer.

A uniform spectrum has equal channels: the error of the white point that a limited range of wavelengths causes is
divided out. Saturated paints may be outside of the gamut; their negative channel becomes 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

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
