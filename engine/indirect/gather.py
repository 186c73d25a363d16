"""Gather points: where in the picture indirect light is found, and which cells each of them sees.

Light that has been reflected is soft, so that a few of the picture's points stand for all. They lie on a lattice of
every eighth pixel, refined in quarters down to single pixels where a block of the lattice shows a silhouette or a
crease, or where what its corners gather differs; the others interpolate between the corners of their block.
"""

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.indirect import _ray_kernels as kernels
from engine.indirect.cells import CHUNK, Cells, room_for_rays
from engine.indirect.rays import cosine_tables, pole_tables
from engine.material import MODELS, kinds
from engine.scene.hits import PrimaryHits
from engine.transport._projection_kernels import Surface


@dataclass(frozen=True)
class FanSize:
    """Rays a gather point: powers of two; a matt surface has none about a pole."""

    n_cosine: int
    n_pole: int

    @property
    def n_rays(self) -> int:
        return self.n_cosine + self.n_pole


def pole_of(model_names: Iterable[str]) -> int:
    """About which direction the rays of an object with layers of these models are dense."""
    gammas = {factor.gamma for name in model_names for factor in MODELS[name].factors}
    if gammas & {kinds.THETA_H, kinds.GAMMA_ALPHA, kinds.GAMMA_BETA, kinds.GAMMA_RATIO}:
        return kernels.HALF
    return kernels.MIRROR if kinds.THETA_R in gammas else kernels.NORMAL


@dataclass(frozen=True, eq=False)
class Gathered:
    """p gather points: rows (p,) int32 of the hits, ascending; seen (p, R) uint16: the cell each ray hits."""

    rows: NDArray[np.int32]
    seen: NDArray[np.uint16]


def gather(
    hits: PrimaryHits, cells: Cells, rows: NDArray[np.int32], poles: NDArray[np.int64], size: FanSize
) -> Iterator[tuple[int, int, NDArray[np.uint16]]]:
    """Trace the fans of the points `rows` (ascending), two chunks at a time: (begin, end, seen) for each chunk.

    poles: of every object. Raises TooManyCells.
    """
    tables = cosine_tables(size.n_cosine), pole_tables(size.n_pole)
    surface = Surface(hits.position, hits.tangent, hits.normal, hits.wo)
    step = max(1, CHUNK // size.n_rays)
    point_poles = poles[object_of_rows(hits, rows)]

    def trace(begin: int) -> tuple[int, int, NDArray[np.uint16]]:
        chunk = rows[begin : begin + step]
        rays = room_for_rays(len(chunk) * size.n_rays)
        kernels.fan_rays(
            chunk, point_poles[begin : begin + step], surface, hits.geometric_normal, np.float32(cells.caster.offset),
            *tables, 0, size.n_rays, rays.origins, rays.directions, rays.there,
        )  # fmt: skip
        return begin, begin + len(chunk), cells.seen_by(rays).reshape(len(chunk), -1)

    begins = range(0, len(rows), step)
    with ThreadPoolExecutor(2) as pool:
        for i in range(0, len(begins), 2):
            yield from pool.map(trace, begins[i : i + 2])


def object_of_rows(hits: PrimaryHits, rows: NDArray[np.integer]) -> NDArray[np.int64]:
    """The object each row belongs to."""
    return np.searchsorted(hits.object_ranges[:, 1], rows, "right")
