"""Slow, obvious twin of the thesis' visibility methods [BenArtzi07, ch. 8]: one pixel after the other, whole rows of
answers at a time. What the names mean stands in `benchmarks.thesis_visibility`."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from benchmarks.thesis_visibility import Variant
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.visibility.coherent_grid import grid_steps
from engine.visibility.point_visibility import Targets

Bits = NDArray[np.bool_]
Rows = NDArray[np.int32]


def trace_variant(hits: PrimaryHits, caster: RayCaster, targets: Targets, variant: Variant) -> tuple[Bits, int]:
    """What each of P points sees of D directions by one method: bits (P, D) bool, and how many rays were traced.

    Slow: one pixel after the other.
    """
    picture = _Picture(hits, caster, targets)
    opt, few_floods = variant == "OPT", variant in ("FLO", "OPT")
    order, warp, boundary = ("G", False, False) if few_floods else (variant[0], variant[1] == "W", variant[2] == "B")
    n_informers = 4 if order == "G" else 3
    steps = _everything(hits) if variant == "TRUE" else _grid(hits) if order == "G" else _scanline(hits)
    for row, informers, last in steps:
        if len(informers) < n_informers:
            picture.trace(row, picture.horizon(row))
            continue
        counts = picture.warped_counts(row, informers) if warp else (~picture.bits[informers]).sum(axis=0)
        blocked = counts > 0 if boundary else counts >= n_informers
        doubt = _boundary(blocked, targets.neighbours) if boundary else (counts > 0) & ~blocked
        if boundary and order == "S":
            doubt |= picture.near_horizon(row)
        picture.correct(row, blocked, doubt, only_disagreeing=opt, flood=not (few_floods and last))
    return picture.bits, picture.n_rays


class _Picture:
    """Answers so far: bits (P, D), and for each blocked direction how far its blocker stands (inf where unknown)."""

    def __init__(self, hits: PrimaryHits, caster: RayCaster, targets: Targets) -> None:
        self._hits, self._caster, self._targets = hits, caster, targets
        n_points, n_targets = len(hits.pixel), len(targets.positions)
        self.bits = np.zeros((n_points, n_targets), bool)
        self._distance = np.full((n_points, n_targets), np.inf, np.float32)
        self.n_rays = 0

    def horizon(self, row: int) -> Bits:
        """Directions (D,) that the point faces."""
        facing: Bits = self._targets.positions @ self._hits.normal[row] > 0
        return facing

    def near_horizon(self, row: int) -> Bits:
        """Directions (D,) beside the horizon: what rises over it is in no informer's view."""
        return _boundary(self.horizon(row), self._targets.neighbours)

    def trace(self, row: int, asked: Bits) -> Bits:
        """Trace the asked directions above the horizon; returns which of all (D,) were traced."""
        asked = asked & self.horizon(row)
        directions = np.ascontiguousarray(self._targets.positions[asked])
        position, lift = self._hits.position[row], self._hits.offset_position[row] - self._hits.position[row]
        side = np.where(directions @ lift >= 0, 1, -1).astype(np.float32)
        found = self._caster.intersect(position + side[:, None] * lift, directions)
        self.bits[row, asked] = found.triangle < 0
        self._distance[row, asked] = found.distance
        self.n_rays += len(directions)
        return asked

    def warped_counts(self, row: int, informers: Rows) -> NDArray[np.intp]:
        """In how many informers' view something stands in each direction (D,) as seen from the point.

        The point takes the nearest of these blockers over, so that it can hand them on untraced.
        """
        counts = np.zeros(len(self._targets.positions), np.intp)
        for informer in informers:
            known = ~self.bits[informer] & np.isfinite(self._distance[informer])
            along = self._targets.positions[known] * self._distance[informer][known][:, None]
            towards = self._hits.position[informer] + along - self._hits.position[row]
            distance = np.maximum(np.linalg.norm(towards, axis=1), 1e-12)
            hit = (towards @ self._targets.positions.T).argmax(axis=1)
            counts[np.unique(hit)] += 1
            np.minimum.at(self._distance[row], hit, distance)
        return counts

    def correct(self, row: int, blocked: Bits, doubt: Bits, only_disagreeing: bool, flood: bool) -> None:
        """Take the estimate, trace what is in doubt, and go on to the neighbours of every contradiction."""
        horizon = self.horizon(row)
        self.bits[row] = ~blocked & horizon
        traced, uncertain = np.zeros_like(blocked), doubt
        while (asked := doubt & horizon & ~traced).any():
            estimate = self.bits[row].copy()
            traced |= self.trace(row, asked)
            if not flood:
                return
            contradicts = asked & ((estimate != self.bits[row]) | (uncertain & only_disagreeing))
            doubt = self._around(row, contradicts, only_disagreeing)
            uncertain = np.zeros_like(uncertain)

    def _around(self, row: int, contradicts: Bits, only_disagreeing: bool) -> Bits:
        """Neighbours of contradicted directions; those alone that disagree with what was found there, if so asked."""
        around = np.zeros_like(contradicts)
        for target in np.flatnonzero(contradicts):
            neighbours = self._targets.neighbours[target]
            neighbours = neighbours[neighbours >= 0]
            if only_disagreeing:
                neighbours = neighbours[self.bits[row, neighbours] != self.bits[row, target]]
            around[neighbours] = True
        return around


def _boundary(marked: Bits, neighbours: NDArray[np.int32]) -> Bits:
    """Directions (D,) of which a neighbour is marked otherwise."""
    there = neighbours >= 0
    other: Bits = (there & (marked[neighbours] != marked[:, None])).any(axis=1)
    return other


def _everything(hits: PrimaryHits) -> Iterator[tuple[int, Rows, bool]]:
    """Every point (row), informed by nobody."""
    for row in range(len(hits.pixel)):
        yield row, np.zeros(0, np.int32), False


def _grid(hits: PrimaryHits) -> Iterator[tuple[int, Rows, bool]]:
    """Points coarse to fine, the informers of each, and whether the step is the last.

    The last step of the thesis is the last diamond: half of the picture.
    """
    steps = list(grid_steps(hits, alike=-2.0))
    for step in steps:
        for row, informers in zip(step.rows, step.informers, strict=True):
            yield int(row), informers[informers >= 0], step is steps[-1]


def _scanline(hits: PrimaryHits) -> Iterator[tuple[int, Rows, bool]]:
    """Points row by row, informed by those to the left, above left and above on the same object."""
    width, height = hits.resolution
    row_of_pixel = np.full(width * height, -1, np.int32)
    row_of_pixel[hits.pixel] = np.arange(len(hits.pixel), dtype=np.int32)
    objects = hits.object_image.ravel()
    for pixel in np.sort(hits.pixel):
        left, above = pixel % width > 0, pixel >= width
        around = ((left, pixel - 1), (left and above, pixel - width - 1), (above, pixel - width))
        same = [other for there, other in around if there and objects[other] == objects[pixel]]
        yield int(row_of_pixel[pixel]), row_of_pixel[same], False
