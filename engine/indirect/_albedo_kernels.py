"""Compiled: the quadrature of equivalent albedos."""

import numba as nb
import numpy as np

from engine.indirect._ray_kernels import ABOUT_POLE, BY_COSINE, HORIZON, fan_density, fan_direction, turn_of
from engine.indirect._reflection_kernels import HALF_PI, ONE, ZERO, _node
from engine.material._kernels import gamma, quotient_cosine


@nb.njit(cache=True, nogil=True, error_model="numpy")
def albedo_bands(model, q, kind_a, kind_b, pole, eyes, tables_cosine, tables_pole, out):
    """Add ∫ ρ_q cos θ_i Δ_j Δ_k dω_i of each eye direction (S, 3) to out (S, J, K)."""
    n_a, n_b = out.shape[1], out.shape[2]
    n_cosine, n_pole = tables_cosine.shape[1], tables_pole.shape[1]
    for s in range(eyes.shape[0]):
        ox, oy, oz = eyes[s, 0], eyes[s, 1], eyes[s, 2]
        seed, cosine, sine = turn_of(s)
        pattern = s % tables_cosine.shape[0]
        for m in range(n_cosine + n_pole):
            if m < n_cosine:
                x, y, z = fan_direction(tables_cosine[pattern], m, BY_COSINE, cosine, sine, pole, ox, oy, oz)
            else:
                x, y, z = fan_direction(tables_pole[pattern], m - n_cosine, ABOUT_POLE, cosine, sine, pole, ox, oy, oz)
            if z <= HORIZON:
                continue
            angle = gamma(kind_a, q, x, y, z, ox, oy, oz)
            if angle > HALF_PI:
                continue
            j, t = _node(angle, n_a)
            k, u = 0, ZERO
            if kind_b >= 0:
                angle = gamma(kind_b, q, x, y, z, ox, oy, oz)
                if angle > HALF_PI:
                    continue
                k, u = _node(angle, n_b)
            density = fan_density(np.float32(n_cosine), np.float32(n_pole), pole, x, y, z, ox, oy, oz)
            value = quotient_cosine(model, q, x, y, z, ox, oy, oz) / density
            j1, k1 = min(j + 1, n_a - 1), min(k + 1, n_b - 1)
            out[s, j, k] += (ONE - t) * (ONE - u) * value
            out[s, j1, k] += t * (ONE - u) * value
            out[s, j, k1] += (ONE - t) * u * value
            out[s, j1, k1] += t * u * value
