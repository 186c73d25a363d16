"""The adaptive lattice of gather points over a picture, a quadtree of blocks, and where it requires more samples.

The radiance that each half of the rays gathers is compared: the mean of the halves is the light, their difference the
noise. Both decide where blocks of the lattice are split, and which points get extra sample sets. See
`gather` for the points.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np
from numpy.typing import NDArray

from engine.precompute.indirect import _lattice_kernels as kernels
from engine.precompute.indirect.indirect_layers import IndirectLayer
from engine.precompute.indirect.indirect_light import Footprint, GatherPoints
from engine.precompute.indirect.photons import PhotonFlux
from engine.precompute.indirect.reflection import OutgoingRadiance
from engine.precompute.indirect.smoothing import extra_sample_sets, least_alike
from engine.scene.edges import nearest_centres
from engine.scene.primary_hits import PrimaryHits

COARSEST = 8
# The least number of blocks over the height of a picture, however small.
_N_BLOCKS = 24
# How much the corners of a block may differ: a fraction of their mean, and of the picture's mean.
TOLERANCE, FLOOR = 0.15, 0.03
# The largest size of a block in clearances of its corners: the error at its centre is an eighth of the square of that.
REACH = 0.4


def count_by_shape(lattice: Lattice) -> int:
    """The number of rows that a new lattice requests by silhouettes and creases alone, as in a uniformly lit
    picture."""
    hits = lattice.hits
    even = np.zeros((len(hits.pixel), 1), np.float32)
    n_rows = len(lattice.missing_rows())
    while lattice.refine(even, even, np.full(len(even), np.inf, np.float32)):
        n_rows += len(lattice.missing_rows())
    return n_rows


def coarsest_of(height: int) -> int:
    """The side in pixels of the largest blocks in a picture of this height: a power of two."""
    size = COARSEST
    while size > 1 and size * _N_BLOCKS > height:
        size //= 2
    return size


class Lattice:
    """Blocks that are as coarse as the picture allows, and the rows at their corners.

    Call in turn: `missing_rows()` returns rows without a value; `refine` takes values at all rows requested so far and
    returns whether blocks remain open. least_alike (M,): the least cosine between normals on one surface of an object.
    """

    def __init__(self, hits: PrimaryHits, glossy: NDArray[np.bool_], close: bool = True) -> None:
        """glossy (M,): the objects whose reflection changes with the normal; close: smaller blocks in small pictures,
        single pixels beside edges, and blocks within the clearance of their corners."""
        self.hits, self._close = hits, close
        self.least_alike = least_alike(glossy)
        width, height = hits.resolution
        self._row_image = hits.row_image
        self._beside, self._nearest = nearest_centres(hits, hits.normal, self.least_alike)
        self._objects = hits.object_image.astype(np.int32)
        size = coarsest_of(height) if close else COARSEST
        y, x = np.mgrid[0:height:size, 0:width:size]
        self._open = self._visible_blocks(np.stack([y.ravel(), x.ravel(), np.full(y.size, size)], axis=1))
        self._closed = np.zeros((0, 3), np.int64)
        self._known = np.zeros(len(hits.pixel), bool)
        self._alone = self._beside[self._nearest < 0]
        self._first, self._share = self._open, 1.0

    def thin(self, n_blocks: int, generator: np.random.Generator) -> None:
        """For a trial: uses only a random subset of at most n_blocks blocks, and the same share of the points beside
        pixel centres. Call before the first turn."""
        self._share = min(n_blocks / max(len(self._open), 1), 1.0)
        self._open = self._open[_random_subset(len(self._open), self._share, generator)]
        self._alone = self._alone[_random_subset(len(self._alone), self._share, generator)]
        self._first = self._open

    @property
    def n_expected(self) -> float:
        """The number of rows that the whole lattice would have requested, extrapolated from the blocks in use."""
        height, width = self._objects.shape
        y, x, size = self._first.T
        inside = np.zeros((height + 1, width + 1), np.int64)
        for sign, at in ((1, (y, x)), (-1, (y + size, x)), (-1, (y, x + size)), (1, (y + size, x + size))):
            np.add.at(inside, (np.minimum(at[0], height), np.minimum(at[1], width)), sign)
        inside = np.cumsum(np.cumsum(inside, axis=0), axis=1)[:height, :width]
        rows = self._row_image[(inside > 0) & (self._row_image >= 0)]
        return float(self._known[rows].sum() + len(self._alone)) / self._share

    @property
    def rows(self) -> NDArray[np.int32]:
        """All rows requested so far, ascending."""
        return np.flatnonzero(self._known).astype(np.int32)

    def missing_rows(self) -> NDArray[np.int32]:
        """The rows at corners of open blocks, and of points beside pixel centres without a centre on the same surface,
        that were not requested before, ascending. Marks them as requested."""
        rows = self._row_image[self._corners(self._open)].ravel()
        rows = np.unique(np.concatenate([rows[rows >= 0], self._alone]))
        rows = rows[~self._known[rows]]
        self._known[rows] = True
        return rows

    def refine(
        self, values: NDArray[np.floating], noise: NDArray[np.floating], clearance: NDArray[np.floating]
    ) -> bool:
        """Closes the blocks that values (P, D) at the requested rows, their standard errors noise (P, D), and clearance
        (P,) allow, and splits the others into quarters; returns whether any are open."""
        floor = FLOOR * values[self._known].mean(axis=0) if self._known.any() else np.zeros(values.shape[1])
        split = np.empty(len(self._open), bool)
        kernels.must_split(
            self._open, self._objects, self._row_image, self.hits.position, self.hits.normal,
            self.least_alike, np.ascontiguousarray(values, np.float32), np.ascontiguousarray(noise, np.float32),
            np.ascontiguousarray(clearance, np.float32), REACH, self._close, TOLERANCE,
            np.asarray(floor, np.float32), split,
        )  # fmt: skip
        split &= self._open[:, 2] > 1
        self._closed = np.concatenate([self._closed, self._open[~split]])
        self._open = self._visible_blocks(_quarters(self._open[split]))
        return len(self._open) > 0

    def footprint(self) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """The four gather points that each point interpolates, by number, and their weights: (P, 4) each.

        Valid only once no block is open.
        """
        n_points = len(self.hits.pixel)
        point_of_row = np.where(self._known, np.cumsum(self._known) - 1, -1).astype(np.int32)
        rows, weights = np.zeros((n_points, 4), np.int32), np.zeros((n_points, 4), np.float32)
        kernels.interpolate(
            self._closed, self._objects, self._row_image, self.hits.position, self.hits.normal,
            self.least_alike, point_of_row, rows, weights,
        )  # fmt: skip
        rows[self._beside], weights[self._beside] = rows[self._nearest], weights[self._nearest]
        alone = self._alone
        rows[alone, 0], weights[alone] = point_of_row[alone], (1.0, 0.0, 0.0, 0.0)
        return rows, weights

    def _corners(self, blocks: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Row and column (B, 4) of the corners in the image; a single pixel has itself as its only corner."""
        height, width = self._objects.shape
        step = np.where(blocks[:, 2:] > 1, blocks[:, 2:], 0)
        y = np.minimum(blocks[:, :1] + step * np.array([0, 0, 1, 1]), height - 1)
        x = np.minimum(blocks[:, 1:2] + step * np.array([0, 1, 0, 1]), width - 1)
        return y, x

    def _visible_blocks(self, blocks: NDArray[np.int64]) -> NDArray[np.int64]:
        """The blocks that lie in the picture and show a reflecting surface."""
        height, width = self._objects.shape
        blocks = blocks[(blocks[:, 0] < height) & (blocks[:, 1] < width)]
        filled = np.zeros((height + 1, width + 1), np.int64)
        filled[1:, 1:] = np.cumsum(np.cumsum(self._row_image >= 0, axis=0), axis=1)
        y, x, size = blocks.T
        last_y, last_x = np.minimum(y + size, height), np.minimum(x + size, width)
        return blocks[filled[last_y, last_x] - filled[y, last_x] - filled[last_y, x] + filled[y, x] > 0]


def _random_subset(n: int, share: float, generator: np.random.Generator) -> NDArray[np.integer]:
    """Indices of a random share of n items, ascending."""
    return np.sort(generator.choice(n, round(share * n), replace=False))


def _quarters(blocks: NDArray[np.int64]) -> NDArray[np.int64]:
    """The four quarters of each block (B, 3)."""
    half = blocks[:, 2:] // 2
    offsets = np.array([[0, 0], [0, 1], [1, 0], [1, 1]])
    corners = blocks[:, None, :2] + offsets * half[:, None]
    return np.concatenate([corners, np.broadcast_to(half[:, None], (*corners.shape[:2], 1))], axis=2).reshape(-1, 3)


_PHOTONS_SHARE = np.float32(0.3)


class Refinement:
    """Light, noise (P, 3) and clearance (P,) of a picture under certain layers, known at the gather points so far."""

    def __init__(self, lattice: Lattice, layers: Sequence[IndirectLayer], radiosity: NDArray[np.float32]) -> None:
        """radiosity (C, D, 3): rough radiosity of the first C records."""
        self.lattice = lattice
        self._layers, self._radiosity = layers, radiosity
        self._caustics: PhotonFlux | None = None
        n_points = len(lattice.hits.pixel)
        self._light, self._noise = np.zeros((2, n_points, 3), np.float32)
        self._clearance = np.zeros(n_points, np.float32)

    def measure(self, points: GatherPoints, n_records: int) -> Generator[None, None, None]:
        """Computes light and noise of these gather points, whose rays hit n_records records. A generator of steps.
        What was measured before stays: neither radiosity nor photons change.

        Glossy surfaces reflect by albedo, with a share of the photons, because their directional reflection is noisier.
        """
        n_new = n_records - len(self._radiosity)  # not known yet: dark
        radiosity = np.concatenate([self._radiosity, np.zeros((n_new, *self._radiosity.shape[1:]), np.float32)])
        if self._caustics is None:
            caustics = points.caustic_flux(self._layers)
            self._caustics = caustics._replace(light=_PHOTONS_SHARE * caustics.light)
        yield from self.measure_under(OutgoingRadiance(radiosity, None, self._caustics), points)
        self._clearance[points.samples.rows] = points.samples.clearance

    def measure_under(self, light: OutgoingRadiance, points: GatherPoints) -> Generator[None, None, None]:
        """Computes light and noise of these gather points, each with one sample set, under this light. A generator of
        steps."""
        first, second = yield from points.halves(self._layers, light)
        rows = points.samples.rows
        self._light[rows], self._noise[rows] = 0.5 * (first + second), 0.5 * abs(first - second)

    def split_blocks(self) -> bool:
        """Splits the blocks of the lattice that require it; returns whether gather points are missing now."""
        return self.lattice.refine(self._light, self._noise, self._clearance)

    def extra_sets(
        self, rows: NDArray[np.int32], footprint: Footprint, most: float, scale: float = 1.0
    ) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
        """The extra sample sets (q,) of noisy gather points that the picture shows: the row of each, and its number at
        that row. rows (p,): of all gather points, which were measured; most: on average per point; scale: see
        `extra_sample_sets`."""
        numbers, weights = footprint
        # The squared weight with which each gather point contributes to the picture: its share of the variance.
        shown = np.bincount(numbers.ravel(), weights.ravel() ** 2, len(rows)).astype(np.float64)
        hits, alike = self.lattice.hits, self.lattice.least_alike
        n = extra_sample_sets(hits, rows, alike, self._light[rows], self._noise[rows], shown, most, scale)
        nth = np.arange(1, n.sum() + 1) - np.repeat(np.cumsum(n) - n, n)
        return np.repeat(rows, n), nth.astype(np.uint8)
