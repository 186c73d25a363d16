"""Compiled loops over pairs of directions for the brute-force integrator."""

import numpy as np
from numba import njit

from engine.material._kernels import gamma, quotient_cosine


@njit(cache=True, nogil=True, error_model="numpy")
def curve_angles(kind: int, q: np.ndarray, wi: np.ndarray, wo: np.ndarray, out: np.ndarray) -> None:
    """Write gamma of a curve's kind for local directions wi, wo (N, 3) to out (N,)."""
    for i in range(len(wi)):
        out[i] = gamma(kind, q, wi[i, 0], wi[i, 1], wi[i, 2], wo[i, 0], wo[i, 1], wo[i, 2])


@njit(cache=True, nogil=True, error_model="numpy")
def quotient_cosines(kind: int, q: np.ndarray, wi: np.ndarray, wo: np.ndarray, out: np.ndarray) -> None:
    """Write rho_q cos_i of a model's kind for local directions wi, wo (N, 3) to out (N,)."""
    for i in range(len(wi)):
        out[i] = quotient_cosine(kind, q, wi[i, 0], wi[i, 1], wi[i, 2], wo[i, 0], wo[i, 1], wo[i, 2])
