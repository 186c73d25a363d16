"""Converts linear RGB with given primaries and white point to Rec. 709.

As in OpenColorIO's built-in configurations and most viewers of OpenEXR: to CIE XYZ by the chromaticities [SMPTE RP
177], from one white to the other by Bradford's matrix [Lam85], and back by Rec. 709's. No adaptation was rejected: the
grey of an ACES file, whose white is yellower, would be tinted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""x, y of red, green, blue and white (D65) [ITU-R BT.709]."""
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
_ALIKE = 1e-4  # single precision, and the usual four digits


def to_rec709(chromaticities: Sequence[float]) -> Float64Array | None:
    """The matrix (3, 3) from linear RGB with these primaries, x and y of red, green, blue and white; None for those of
    Rec. 709. Raises ValueError for invalid primaries."""
    if np.abs(np.subtract(chromaticities, REC709)).max() <= _ALIKE:
        return None
    white = _xyz(chromaticities[6:])
    matrix = np.linalg.inv(_to_xyz(REC709)) @ adaptation(white, _xyz(REC709[6:])) @ _to_xyz(chromaticities)
    if not np.isfinite(matrix).all() or np.abs(matrix).max() > 100.0:
        raise ValueError("chromaticities of no colours")
    return matrix


def xyz_to_rec709() -> Float64Array:
    """The matrix (3, 3) from CIE XYZ with Rec. 709's white."""
    return np.asarray(np.linalg.inv(_to_xyz(REC709)))


def adaptation(white: Float64Array, to: Float64Array) -> Float64Array:
    """The matrix (3, 3) that adapts colours in XYZ from one white to another [Lam85]."""
    return np.linalg.inv(_BRADFORD) @ np.diag((_BRADFORD @ to) / (_BRADFORD @ white)) @ _BRADFORD


def _to_xyz(chromaticities: Sequence[float]) -> Float64Array:
    """The matrix (3, 3) from linear RGB to XYZ, white at Y = 1 [SMPTE RP 177]."""
    primaries = np.stack([_xyz(chromaticities[i : i + 2]) for i in (0, 2, 4)], axis=1)
    try:
        return primaries * np.linalg.solve(primaries, _xyz(chromaticities[6:]))
    except np.linalg.LinAlgError:
        raise ValueError("chromaticities on a line") from None


def _xyz(chromaticity: Sequence[float]) -> Float64Array:
    """XYZ with Y = 1 of a chromaticity x, y."""
    x, y = chromaticity
    if not y > 1e-6 and not y < -1e-6:
        raise ValueError("a chromaticity without luminance")
    return np.array([x / y, 1.0, (1.0 - x - y) / y])
