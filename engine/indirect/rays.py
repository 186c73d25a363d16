"""Stratified patterns of directions for fans and for cells, made once; see `_ray_kernels` for what they are for."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.indirect._ray_kernels import EPSILON

N_PATTERNS = 64
_SEED = 20260711


@lru_cache(maxsize=8)
def cosine_tables(n_rays: int) -> NDArray[np.float32]:
    """(64, R, 3) unit vectors about +z with density cos θ / π."""
    u, v = _patterns(n_rays, 0)
    radius, angle = np.sqrt(u), 2 * np.pi * v
    return _vectors(np.sqrt(1.0 - u), radius, angle)


@lru_cache(maxsize=8)
def pole_tables(n_rays: int) -> NDArray[np.float32]:
    """(64, R, 3) unit vectors within 90° of +z with density 1 / (2π ln(1 + 1/ε) (1 - cos θ + ε))."""
    u, v = _patterns(n_rays, 1)
    away = EPSILON * np.expm1(u * np.log1p(1.0 / EPSILON))
    return _vectors(1.0 - away, np.sqrt(away * (2.0 - away)), 2 * np.pi * v)


def _vectors(z: NDArray[np.float64], radius: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float32]:
    vectors = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=2)
    vectors = np.ascontiguousarray(vectors, np.float32)
    vectors.setflags(write=False)
    return vectors


def _patterns(n_rays: int, kind: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two coordinates in (0, 1) of 64 scrambled Sobol sets of R points, (64, R) each."""
    from scipy.stats import qmc

    sets = np.zeros((N_PATTERNS, n_rays, 2))
    for i in range(N_PATTERNS if n_rays else 0):
        sampler = qmc.Sobol(2, scramble=True, seed=np.random.default_rng((_SEED, kind, i)))
        sets[i] = sampler.random_base2(int(np.ceil(np.log2(n_rays))))[:n_rays]
    sets = np.clip(sets, 1e-9, 1.0 - 1e-9)
    return sets[..., 0], sets[..., 1]
