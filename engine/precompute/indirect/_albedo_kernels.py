"""Compiled: quadrature of equivalent albedos."""

import numba as nb
import numpy as np

from engine.material._kernels import gamma, quotient_cosine
from engine.precompute.indirect._ray_kernels import (
    ABOUT_AXIS,
    BY_COSINE,
    HORIZON,
    direction_pdf,
    pattern_rotation,
    sample_direction,
)
from engine.precompute.indirect._reflection_kernels import HALF_PI, ONE, ZERO, _node


@nb.njit(cache=True, nogil=True, error_model="numpy")
def albedo_bands(model, q, kind_a, kind_b, lobe_axis, eyes, tables_cosine, tables_lobe, out):
    """Adds ∫ ρ_q cos θ_i Δ_j Δ_k dω_i for each direction to the camera (S, 3) to out (S, J, K) [BenArtzi07, 5.2.4]."""
    n_a, n_b = out.shape[1], out.shape[2]
    n_cosine, n_lobe = tables_cosine.shape[1], tables_lobe.shape[1]
    for s in range(eyes.shape[0]):
        ox, oy, oz = eyes[s, 0], eyes[s, 1], eyes[s, 2]
        seed, cosine, sine = pattern_rotation(s)
        pattern = s % tables_cosine.shape[0]
        for m in range(n_cosine + n_lobe):
            # A direction from one of the two distributions.
            if m < n_cosine:
                x, y, z = sample_direction(tables_cosine[pattern], m, BY_COSINE, cosine, sine, lobe_axis, ox, oy, oz)
            else:
                x, y, z = sample_direction(
                    tables_lobe[pattern], m - n_cosine, ABOUT_AXIS, cosine, sine, lobe_axis, ox, oy, oz
                )
            if z <= HORIZON:
                continue
            # Positions on the curves.
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
            # The Monte Carlo estimate, distributed between the neighbouring bands of both curves.
            density = direction_pdf(np.float32(n_cosine), np.float32(n_lobe), lobe_axis, x, y, z, ox, oy, oz)
            value = quotient_cosine(model, q, x, y, z, ox, oy, oz) / density
            j1, k1 = min(j + 1, n_a - 1), min(k + 1, n_b - 1)
            out[s, j, k] += (ONE - t) * (ONE - u) * value
            out[s, j1, k] += t * (ONE - u) * value
            out[s, j, k1] += (ONE - t) * u * value
            out[s, j1, k1] += t * u * value
