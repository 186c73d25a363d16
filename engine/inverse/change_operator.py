"""A change of band values that was solved for, as one operator on its curve."""

from __future__ import annotations

import numpy as np

from engine.curve.bands import band_nodes
from engine.curve.tables import HALF_PI, VALUE_LIMIT, Float64Array, TabulatedCurve
from engine.inverse.curve_fit import curve_size

# A change that is less than this share of the largest, each relative to the curve's size, is none.
LEAST_CHANGE = 1e-3


def change_operator(change: Float64Array, curve: Float64Array) -> TabulatedCurve | None:
    """The operator that adds a change (J, 3) to a curve with these band values (J, 3); None where nothing changes.

    Its region ends where the change does. Band values are those of a piecewise linear curve, so that the bands of the
    changed curve are the sum, but for a hundredth of the change where those are clamped to the range of the curve
    (`engine.curve.bands`).
    """
    relative = np.abs(change / curve_size(curve)).max(axis=1)
    changed = np.flatnonzero(relative > LEAST_CHANGE * relative.max(initial=0.0))
    if not changed.size:
        return None
    n_bands = len(change)
    nodes, width = band_nodes(n_bands).tolist(), HALF_PI / n_bands
    # At full strength as far as the values on either side, from where the curve goes over into them.
    first, last = max(int(changed[0]) - 1, 0), min(int(changed[-1]) + 1, n_bands - 1)
    a, b = (0.0, 0.0) if first == 0 else (nodes[first] - width, nodes[first])
    c, d = (HALF_PI, HALF_PI) if last == n_bands - 1 else (nodes[last], nodes[last] + width)
    # Beyond what a table may have a change is that: it was asked for by light as there is none.
    values = [(float(r), float(g), float(b)) for r, g, b in np.clip(change, -VALUE_LIMIT, VALUE_LIMIT)]
    return TabulatedCurve(tuple(nodes), tuple(values), kind="change", regions=(a, b, c, d))
