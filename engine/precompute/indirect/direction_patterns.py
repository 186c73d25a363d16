"""The directions that gather points and records sample: lobe axes, ray counts, and stratified patterns, computed once.
See `_ray_kernels` for their densities."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.material import MODELS, kinds
from engine.precompute.indirect._ray_kernels import EPSILON, HALF, MIRROR, N_PATTERNS, NORMAL

MAX_SAMPLE_SETS = 4  # per gather point, when light is found
MAX_EDITED_SETS = 16  # when materials have been edited since
_SEED = 20260711


def lobe_axis_of(model_names: Iterable[str]) -> int:
    """The axis about which hemisphere samples of an object with layers of these models are dense."""
    gammas = {factor.gamma for name in model_names for factor in MODELS[name].factors}
    if gammas.intersection(kinds.HALF_ANGLES):
        return HALF
    return MIRROR if kinds.THETA_R in gammas else NORMAL


@dataclass(frozen=True)
class SampleCounts:
    """Rays per gather point: powers of two; a diffuse surface has none about a lobe axis."""

    n_cosine: int
    n_lobe: int

    @property
    def n_rays(self) -> int:
        return self.n_cosine + self.n_lobe


def sample_counts(n_rays: int, lobe_axis: int) -> SampleCounts:
    """A diffuse surface samples by the cosine alone; any other sends half of its rays about the lobe axis."""
    n_lobe = 0 if lobe_axis == NORMAL else n_rays // 2
    return SampleCounts(n_rays - n_lobe, n_lobe)


def direction_tables(size: SampleCounts, nth: NDArray[np.uint8]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The direction patterns of sample sets of this size, by the cosine and about lobe axes; nth (q,): the numbers of
    the sets. Tables of more sets begin with those of fewer."""
    n_sets = MAX_SAMPLE_SETS if nth.max(initial=0) < MAX_SAMPLE_SETS else MAX_EDITED_SETS
    return cosine_tables(size.n_cosine, n_sets), lobe_tables(size.n_lobe, n_sets)


@lru_cache(maxsize=8)
def cosine_tables(n_rays: int, n_sets: int = 1) -> NDArray[np.float32]:
    """(64 n_sets, R, 3) unit vectors about +z with density cos θ / π; set n (from 0) of each pattern lies 64 n rows
    further on."""
    u, v = _patterns(n_rays, n_sets, 0)
    radius, angle = np.sqrt(u), 2 * np.pi * v
    return _vectors(np.sqrt(1.0 - u), radius, angle)


@lru_cache(maxsize=8)
def lobe_tables(n_rays: int, n_sets: int = 1) -> NDArray[np.float32]:
    """The same within 90° of +z with density 1 / (2π ln(1 + 1/ε) (1 - cos θ + ε))."""
    return lobe_vectors(*_patterns(n_rays, n_sets, 1))


def lobe_vectors(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float32]:
    """Vectors (..., 3) of that density from numbers u and v (...) in [0, 1)."""
    away = EPSILON * np.expm1(u * np.log1p(1.0 / EPSILON))
    return _vectors(1.0 - away, np.sqrt(away * (2.0 - away)), 2 * np.pi * v)


def _vectors(z: NDArray[np.float64], radius: NDArray[np.float64], angle: NDArray[np.float64]) -> NDArray[np.float32]:
    """Read-only unit vectors (..., 3) from height, radius and azimuth."""
    vectors = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)
    vectors = np.ascontiguousarray(vectors, np.float32)
    vectors.setflags(write=False)
    return vectors


def _sobol(n_rays: int) -> NDArray[np.uint32]:
    """The first R points of Sobol's sequence in two dimensions, (2, R), in units of 1/2³²: every 2^k of them form a
    net."""
    index = np.arange(n_rays, dtype=np.uint32)
    first, second = np.zeros(n_rays, np.uint32), np.zeros(n_rays, np.uint32)
    matrix = np.uint32(1 << 31)
    for bit in range(32):
        is_set = (index >> np.uint32(bit)) & np.uint32(1)
        first ^= is_set << np.uint32(31 - bit)
        second ^= is_set * matrix
        matrix ^= matrix >> np.uint32(1)
    return np.stack([first, second])


def _patterns(n_rays: int, n_sets: int, kind: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two coordinates in (0, 1) of 64 digitally shifted Sobol sequences [Kollig02]: the first R points, the next R, and
    so on, (64 n_sets, R) each."""
    shifts = np.random.default_rng((_SEED, kind)).integers(0, 1 << 32, (2, N_PATTERNS, 1), np.uint32)
    points = _sobol(n_rays * n_sets).reshape(2, n_sets, 1, n_rays)
    u, v = ((points ^ shifts[:, None]).reshape(2, N_PATTERNS * n_sets, n_rays) + 0.5) / 2.0**32
    return u, v
