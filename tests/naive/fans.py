"""What a gather point reflects, ray by ray and in double precision where it can be."""

import numpy as np

from engine.material._kernels import gamma, quotient_cosine
from engine.precompute.indirect import _ray_kernels as rays
from engine.precompute.indirect._cache_kernels import NO_RECORD
from engine.precompute.indirect._reflection_kernels import SampleArrays
from engine.precompute.indirect.indirect_layers import LayerCurves


def reflected(fans: SampleArrays, i: int, layer: LayerCurves, radiosity: np.ndarray) -> np.ndarray:
    """Radiance (D, 3) of point i under radiosity (C, D, 3), without f_q and f_o: Σ ρ_q f_A f_B cos θ L / density."""
    row, q = fans.rows[i], np.asarray(layer.quotient_parameters, float)
    eye = rays.local_wo(fans.tangent[row], fans.normal[row], fans.wo[row])
    seed, cosine, sine = rays.pattern_rotation(row)
    tables = fans.tables_cosine, fans.tables_lobe
    pattern, sizes = rays.pattern_of(np.uint64(seed), fans.nth[i]), [np.float32(table.shape[1]) for table in tables]
    total, m = np.zeros(radiosity.shape[1:]), 0
    for table, is_cosine in zip(tables, (True, False), strict=True):
        for k in range(table.shape[1]):
            x, y, z = rays.sample_direction(table[pattern], k, is_cosine, cosine, sine, fans.lobe_axes[i], *eye)
            if fans.records[i, m] != NO_RECORD and z > rays.HORIZON:
                density = rays.direction_pdf(*sizes, fans.lobe_axes[i], x, y, z, *eye)
                value = quotient_cosine(layer.model.number, q, x, y, z, *eye) / density / np.pi
                for factor, curve in zip(layer.model.factors, layer.curves, strict=False):
                    value = value * _curve_at(gamma(factor.gamma, q, x, y, z, *eye), curve)
                total += value * radiosity[fans.records[i, m]]
            m += 1
    return total


def _curve_at(angle: float, curve: np.ndarray) -> np.ndarray:
    """A curve (J, 3) of hats over [0, π/2] at an angle; 0 beyond."""
    if angle > np.pi / 2:
        return np.zeros(3)
    nodes = (np.arange(len(curve)) + 0.5) * np.pi / 2 / len(curve)
    return np.array([np.interp(angle, nodes, curve[:, channel]) for channel in range(3)])
