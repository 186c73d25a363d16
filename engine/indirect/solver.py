"""Indirect light of one scene from one camera: all that does not depend on a material, and pictures from it.

What is traced (fans of the gather points, rays between the cells) depends on the scene and the camera alone, what falls
on the cells on the light as well; curves, albedos and which object is edited come in at the end. So a light that turns
asks for the cells' irradiance anew, a material for nothing but sums.
"""

import itertools
import math
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.indirect._cell_kernels import NO_CELL, CellTable
from engine.indirect._ray_kernels import HALF, NORMAL
from engine.indirect.cells import MOST_CELLS, Cells, TooManyCells
from engine.indirect.curves import any_glossy, pole_of
from engine.indirect.fineness import (
    FINE,
    LEFT_OF_GLOSSY,
    LEFT_OF_MATT,
    LEVELS,
    Fineness,
    RayNeed,
    needed_rays,
    noise_of,
)  # fmt: skip
from engine.indirect.further import further_fans
from engine.indirect.gather import FanSize, Gathered, gather, joined, object_of_rows
from engine.indirect.irradiance import CellLight, connect, direct_irradiance, radiosity
from engine.indirect.lattice import COARSEST, Lattice, count_by_shape, least_alike
from engine.indirect.layers import IndirectLayer, albedos_of
from engine.indirect.light import Footprint, GatherPoints, IndirectLight
from engine.indirect.parts import Keeper, Parts
from engine.indirect.photons import PhotonMap, PhotonSource, no_photons, nothing_landed
from engine.indirect.reflection import SentLight
from engine.indirect.second_bounce import SecondRays, matt_share, no_records
from engine.indirect.shining import shining_on
from engine.indirect.stored import (
    arrays_of_gathered,
    arrays_of_table,
    read_cell_light,
    read_cell_size,
    read_footprint,
    read_gathered,
    read_need,
    read_smoothing,
    read_table,
)
from engine.scene.local_frames import object_axes
from engine.scene.primary_hits import PrimaryHits
from engine.generators import Result, run_to_end, map_steps
from engine.stored_arrays import ArrayReader, Arrays
from engine.transport.footprint import footprint, lattice_rows
from engine.transport.pipeline import Placement, SkyState

# What a first look at the scene takes.
_PILOT_POINTS, _PILOT_RAYS = 1024, 64
# How much larger cells are where there were too many, at least; with what power of the fans there are more of them.
_GROWTH, CELLS_BY_FANS = 1.26, 0.4
_MOST_GROWTH, _LEAST_POWER, _MOST_POWER = 4.0, 0.5, 2.0
# Of the cells that there may be, those that are aimed at then.
FULL = 0.85
# Gather points, by those that silhouettes and creases alone call for.
_BY_LIGHT = 1.25
# Gather points a part that is kept: a second or two of work, so that keeping it costs little.
PART_POINTS = 4096
_PHOTONS_SHARE = np.float32(0.3)

Progress = tuple[float, str]
# Where in the whole its phases end, by processor time: a first look, light between what it saw (only where more looks
# follow), these looks, light between all, and light on it; what is left is the filter's. Further fans, where they are
# asked for, share with the latter; as many as there were first ones take as long as all looks did.
_LOOKED, _ROUGHLY_LIT, _LOOKED_CLOSER, _LIT, _SHONE_ON = 0.1, 0.35, (0.45, 0.6, 0.75), 0.93, 0.96
_ALL_LOOKS = _LOOKED + _LOOKED_CLOSER[-1] - _ROUGHLY_LIT


class Try(NamedTuple):
    """Cells of so many metres were too many after so many fans."""

    size: float
    n_fans: int


def growth(tries: Sequence[Try], expected: float) -> float:
    """By how much cells are to be larger than in the last try, so that there are not too many after as many fans as are
    expected: to begin anew once costs less than to do so at every step.

    There are C n^0.4 s^-p cells of size s after n fans. On a plain surface p = 2; beside polished metal, which shows
    small ones of all the scene, they hardly become fewer: two tries tell p.
    """
    last, power = tries[-1], _MOST_POWER
    if len(tries) > 1:
        first = tries[-2]
        told = CELLS_BY_FANS * math.log(last.n_fans / first.n_fans) / math.log(last.size / first.size)
        power = min(max(told, _LEAST_POWER), _MOST_POWER)
    too_many = max((expected / last.n_fans) ** CELLS_BY_FANS, 1.0) / FULL
    return min(max(too_many ** (1.0 / power), _GROWTH), _MOST_GROWTH)


class Solver:
    """Finds the indirect light of a scene; its steps are generators that yield (fraction of the whole, text)."""

    def __init__(
        self, placement: Placement, models: Mapping[int, Sequence[str]], sky: SkyState, n_bounces: int,
        fineness: Fineness = FINE, glossy: bool = True, other_light: float | None = None,
    ) -> None:  # fmt: skip
        """models: names of the models of every object's layers, by the object's index; n_bounces ≥ 2.

        glossy: whether the second bounce off glossy surfaces has a direction, else it goes by albedo as all others do;
        other_light: the mean radiance of what else the picture shows, by which noise is seen or not: with it no more
        rays are taken than are needed, None for all.
        """
        self._placement, self._most, self._n_bounces = placement, fineness, n_bounces
        self._fineness, self._need, self._other_light = fineness, RayNeed(fineness.n_rays, fineness.n_rays), other_light
        n_objects = len(placement.hits.object_ranges)
        self._poles = np.array([pole_of(models.get(i, ())) for i in range(n_objects)], np.int64)
        self._shining = shining_on(placement, sky)
        glossy_objects = np.array([any_glossy(models.get(i, ())) for i in range(n_objects)], bool)
        self._axes = np.ascontiguousarray(object_axes(placement.scene)[:, [1, 0]], np.float32)
        second = SecondRays(
            glossy_objects, self._poles, self._axes, self._shining.lamps, fineness.n_records, n_bounces > 2
        )
        self._second = second if glossy else None
        self._n_traced = 0

    def solve(
        self, layers: Sequence[IndirectLayer], keeper: Keeper | None = None
    ) -> Generator[Progress, None, IndirectLight]:
        """The indirect light; the layers only say where the picture of it is not smooth.

        keeper: where parts are kept that this run has finished, and found that another has.
        """
        size, parts, tries = self._cell_size(), Parts(keeper), list[Try]()
        while True:
            self._n_traced = PART_POINTS // 2  # of the part that is given up
            cells = Cells(self._placement.scene, self._placement.caster, size)
            if self._asks_need:
                self._fineness = self._most.with_rays(self._most.n_rays // LEVELS[0])
            try:
                return (yield from self._solve(cells, layers, parts))
            except TooManyCells:
                parts.too_fine()
                tries.append(Try(size, self._n_traced))
                size *= growth(tries, self._expected)

    def restored(self, arrays: Arrays) -> IndirectLight:
        """What `solve` gave and `stored.arrays_of` made arrays of. Raises UnsoundArrays for anything else."""
        self._fineness, self._need = self._restored_need(arrays)
        reader = self._reader(arrays)
        cells = Cells(self._placement.scene, self._placement.caster, read_cell_size(reader))
        cells.restore(read_table(reader))
        gathered, found, smoothing = read_gathered(reader), read_footprint(reader), read_smoothing(reader)
        light = read_cell_light(reader, self._fineness.n_cell_rays, cells.objects.copy())
        points = replace(self._points(gathered, self._photons(cells)), smoothing=smoothing)
        return self._found(points, found, cells, light)

    def _restored_need(self, arrays: Arrays) -> tuple[Fineness, RayNeed]:
        need = read_need(ArrayReader(arrays), self._most.n_rays)
        return self._most.with_rays(need.n_rays), need

    def _reader(self, arrays: Arrays) -> ArrayReader:
        """Of arrays that belong to this scene, light and fineness."""
        scene, n_lights = self._placement.scene, len(self._shining.lamps.cumulative)
        sizes = {"P": len(self._placement.hits.pixel), "M": len(self._poles), "T": len(scene.triangles)}
        return ArrayReader(arrays, **sizes, R=self._fineness.n_rays, L=n_lights)

    def _cell_size(self) -> float:
        """Metres, so that what a first look hits falls into about as many cells as wanted."""
        hits, scene = self._placement.hits, self._placement.scene
        rows = np.arange(0, len(hits.pixel), max(1, -(-len(hits.pixel) // _PILOT_POINTS)), dtype=np.int32)
        extent = float(np.linalg.norm(np.ptp(scene.vertices[np.unique(scene.triangles)], axis=0)))
        low, high = extent / 4096.0, extent
        while high / low > 1.1:
            size = (low * high) ** 0.5
            cells = Cells(scene, self._placement.caster, size)
            try:
                pilot = gather(
                    hits, cells, rows, _first(rows), self._poles, _fan_size(_PILOT_RAYS, HALF), focused=False
                )
                n_hits = sum(int((part.seen != NO_CELL).sum()) for part in pilot)
                too_fine = len(cells) > min(self._fineness.n_cells / 2, max(n_hits / 2, 1.0))
            except TooManyCells:
                too_fine = True
            low, high = (size, high) if too_fine else (low, size)
        return high

    def _solve(
        self, cells: Cells, layers: Sequence[IndirectLayer], parts: Parts
    ) -> Generator[Progress, None, IndirectLight]:
        yield 0.0, "looking around"
        photons = self._photons(cells)
        if self._fineness.adaptive:
            points, found, begin = yield from self._refined(cells, layers, photons, parts)
        else:
            points, found, begin = yield from self._even(cells, photons, parts)
        light = yield from self._light(cells, self._fineness, parts, (begin, _LIT))
        yield _SHONE_ON, "taking out noise"
        smoothing = self._found(points, found, cells, light).smoothed(layers)
        return (yield from _said(smoothing, _SHONE_ON, "taking out noise"))

    def _found(self, points: GatherPoints, found: Footprint, cells: Cells, light: CellLight) -> IndirectLight:
        lamps, unit = self._shining.lamps, self._shining.unit
        return IndirectLight(points, found, cells, light, lamps, self._n_bounces, unit, self._need)

    def _photons(self, cells: Cells) -> PhotonMap:
        """What glossy surfaces throw."""
        if self._second is None:
            return PhotonMap(no_photons(len(self._poles)))
        source = PhotonSource(
            self._placement.scene, cells, self._second.glossy, self._poles, self._axes, self._shining.lamps
        )
        return PhotonMap(source.send(self._placement.hits, self._fineness.n_photons))

    def _even(
        self, cells: Cells, photons: PhotonMap, parts: Parts
    ) -> Generator[Progress, None, tuple[GatherPoints, Footprint, float]]:
        """Every eighth pixel; and how much of the whole is done."""
        hits = self._placement.hits
        rows = lattice_rows(hits, COARSEST)
        gathered = yield from self._gather(cells, self._nothing(), rows, _first(rows), parts, (0.0, _LOOKED))
        points = self._points(gathered, photons)
        numbers, weights = footprint(hits, rows, COARSEST)
        return points, (_among_all(hits, rows, numbers), weights), _LOOKED

    def _nothing(self) -> Gathered:
        """No fans yet."""
        rows, seen = np.zeros(0, np.int32), np.zeros((0, self._fineness.n_rays), np.uint16)
        return Gathered(rows, _first(rows), seen, no_records(0), np.zeros(0, np.float32))

    def _refined(
        self, cells: Cells, layers: Sequence[IndirectLayer], photons: PhotonMap, parts: Parts
    ) -> Generator[Progress, None, tuple[GatherPoints, Footprint, float]]:
        """As many points as the picture of these layers needs, by a quarter of the light between cells; and how much of
        the whole is done."""
        lattice, gathered = self._lattice(), self._nothing()
        values, noise = np.zeros((2, len(self._placement.hits.pixel), 3), np.float32)
        clearance = np.zeros(len(self._placement.hits.pixel), np.float32)
        bright = None
        looks = iter(itertools.pairwise((_ROUGHLY_LIT, *_LOOKED_CLOSER)))
        span = 0.0, _LOOKED
        while True:
            rows = lattice.wanted()
            gathered = yield from self._gather(cells, gathered, rows, _first(rows), parts, span)
            span = next(looks, (_LOOKED_CLOSER[-1],) * 2)
            if bright is None:
                light = yield from self._light(cells, self._roughly(), parts, (_LOOKED, _ROUGHLY_LIT))
                albedos, mapped = albedos_of(layers, len(self._poles)), cells.maps.reflectance(layers, len(self._poles))
                bright, _ = radiosity(light, albedos, self._n_bounces, mapped)
                if self._asks_need:
                    halves = self._halves_of_fans(self._points(gathered, photons), layers, cells, light)
                    if self._is_noisy(layers, gathered.rows, (yield from _said(halves, span[0], "looking around"))):
                        none, at = self._nothing(), span[:1] * 2
                        gathered = yield from self._gather(cells, none, rows, _first(rows), parts, at)
                self._forecast(cells, len(rows))
            points = self._points(gathered, photons)
            halves = self._halves(points, layers, bright, len(cells))
            first, second = yield from _said(halves, span[0], "looking around")
            values[gathered.rows], noise[gathered.rows] = 0.5 * (first + second), 0.5 * abs(first - second)
            clearance[gathered.rows] = gathered.clearance
            if not lattice.refine(values, noise, clearance):
                found = lattice.footprint()
                rows, nth = self._further(gathered.rows, values, noise, found)
                if not len(rows):
                    return points, found, _LOOKED_CLOSER[-1]
                done = _further_done(len(rows) / len(gathered.rows))
                # Cells keep their places: these rays come from where it is noisy, and so find the bright ones.
                gathered = yield from self._gather(
                    cells, gathered, rows, nth, parts, (_LOOKED_CLOSER[-1], done), len(cells)
                )
                return self._points(gathered, photons), found, done

    def _forecast(self, cells: Cells, n_fans: int) -> None:
        """Raises TooManyCells where so many fans have found so many cells that all of them will find too many: that
        would be known when nearly all are traced."""
        wanted = len(cells) * (max(self._expected, n_fans) / max(n_fans, 1)) ** CELLS_BY_FANS
        if wanted > MOST_CELLS:
            self._n_traced = round(n_fans * (MOST_CELLS / len(cells)) ** (1.0 / CELLS_BY_FANS))
            raise TooManyCells(f"{wanted:.0f} to come")

    def _roughly(self) -> Fineness:
        """How finely light between cells is found to tell where to look closer."""
        return replace(self._most, n_cell_rays=self._most.n_cell_rays // 4, n_samples=self._most.n_samples // 4)

    def _halves(
        self, points: GatherPoints, layers: Sequence[IndirectLayer], bright: NDArray[np.float32], n_cells: int
    ) -> Generator[None, None, NDArray[np.float32]]:
        """What each half of the rays brings, (2, p, 3), of radiosities `bright` (C, D, 3) of the first C cells: by
        albedo and a share of the photons, as what glossy surfaces send is noisier."""
        new_cells = np.zeros((n_cells - len(bright), *bright.shape[1:]), np.float32)  # not known yet: dark
        thrown = points.thrown(layers)
        thrown = thrown._replace(light=_PHOTONS_SHARE * thrown.light)
        sent = SentLight(np.concatenate([bright, new_cells]), None, thrown)
        return (yield from points.halves(layers, sent))

    def _halves_of_fans(
        self, points: GatherPoints, layers: Sequence[IndirectLayer], cells: Cells, light: CellLight
    ) -> Generator[None, None, NDArray[np.float32]]:
        """The same of all that hangs on how many rays there are: what glossy surfaces send included, photons not."""
        nowhere = np.zeros((0, 4), np.int32), np.zeros((0, 4), np.float32)
        sent = self._found(points, nowhere, cells, light).sent(layers)
        return (yield from points.halves(layers, replace(sent, thrown=None)))

    @property
    def _asks_need(self) -> bool:
        """Whether it is not known yet how many rays are needed."""
        return self._other_light is not None and self._most.adaptive and self._need.noise is None

    def _is_noisy(self, layers: Sequence[IndirectLayer], rows: NDArray[np.int32], halves: NDArray[np.float32]) -> bool:
        """Whether a first look with the fewest rays, by what its halves bring (2, p, 3), calls for more of them."""
        other = (self._other_light or 0.0) / self._shining.unit
        matt = matt_share(layers, len(self._poles)).mean(axis=1) > 0.5
        left = np.where(matt, LEFT_OF_MATT, LEFT_OF_GLOSSY)[object_of_rows(self._placement.hits, rows)]
        noise = noise_of(halves, left, self._placement.hits.share[rows], other)
        self._need = needed_rays(self._most.n_rays, noise)
        before, self._fineness = self._fineness, self._most.with_rays(self._need.n_rays)
        return self._fineness.n_rays > before.n_rays

    @property
    def _expected(self) -> float:
        """How many fans there will be."""
        return _BY_LIGHT * count_by_shape(self._whole_lattice()) if self._fineness.adaptive else 0.0

    def _lattice(self) -> Lattice:
        """What is refined."""
        return self._whole_lattice()

    def _whole_lattice(self) -> Lattice:
        return Lattice(self._placement.hits, self._poles != NORMAL, self._fineness.close)

    def _further(
        self, rows: NDArray[np.int32], values: NDArray[np.float32], noise: NDArray[np.float32], found: Footprint
    ) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
        """The further fans (q,) that gather points at `rows` (p,) ask for by values and noise (P, 3): of which row each
        is, and nth."""
        numbers, weights = found
        shown = np.bincount(numbers.ravel(), weights.ravel() ** 2, len(rows)).astype(np.float64)
        alike = least_alike(self._poles != NORMAL)
        n = further_fans(
            self._placement.hits, rows, alike, values[rows], noise[rows], shown, self._fineness.most_further
        )
        nth = np.arange(1, n.sum() + 1) - np.repeat(np.cumsum(n) - n, n)
        return np.repeat(rows, n), nth.astype(np.uint8)

    def _points(self, gathered: Gathered, photons: PhotonMap) -> GatherPoints:
        points = GatherPoints(
            self._placement.hits, gathered, self._poles, self._sizes(), self._axes, self._second is not None,
            photons.photons, nothing_landed(len(gathered.rows)),
        )  # fmt: skip
        return points.reached_by(photons, self._placement.scene, self._placement.caster)

    def _sizes(self) -> tuple[FanSize, ...]:
        """What each object's fans are."""
        return tuple(_fan_size(self._fineness.n_rays, int(pole)) for pole in self._poles)

    def _gather(
        self, cells: Cells, before: Gathered, rows: NDArray[np.int32], nth: NDArray[np.uint8], parts: Parts,
        span: tuple[float, float], first_open: int = 0,
    ) -> Generator[Progress, None, Gathered]:  # fmt: skip
        """The fans with some more, the nth (q,) of rows (q,); span: from where to where in the whole this is;
        first_open: see `gather`."""
        found = [before]
        n_pole = np.array([size.n_pole for size in self._sizes()])[object_of_rows(self._placement.hits, rows)]
        done = 0
        for n in np.unique(n_pole):
            own, size = np.flatnonzero(n_pole == n), FanSize(self._fineness.n_rays - int(n), int(n))
            for begin in range(0, len(own), PART_POINTS):
                part = own[begin : begin + PART_POINTS]
                for gathered in self._gathered(cells, rows[part], nth[part], size, parts, first_open):
                    found.append(gathered)
                    done += len(gathered.rows)
                    yield span[0] + (span[1] - span[0]) * done / len(rows), "looking around"
        return joined(found)

    def _gathered(
        self, cells: Cells, rows: NDArray[np.int32], nth: NDArray[np.uint8], size: FanSize, parts: Parts,
        first_open: int,
    ) -> Iterator[Gathered]:  # fmt: skip
        """One part of the fans: what was kept of it, or what is traced."""
        kept = parts.begin(self._kept_fans, b"fans", rows.tobytes(), nth.tobytes(), repr((size, cells.size)).encode())
        if kept is not None:
            cells.restore(kept[0])
            yield kept[1]
            self._n_traced += len(rows)
            return
        found = []
        for each in gather(self._placement.hits, cells, rows, nth, self._poles, size, self._second, True, first_open):
            found.append(each)
            yield each
        parts.keep({**arrays_of_gathered(joined(found)), **arrays_of_table(cells.table())})
        self._n_traced += len(rows)

    def _light(
        self, cells: Cells, fineness: Fineness, parts: Parts, span: tuple[float, float]
    ) -> Generator[Progress, None, CellLight]:
        kept = parts.begin(partial(self._kept_light, fineness), b"light", repr(fineness).encode())
        if kept is not None:
            cells.restore(kept[0])
            return kept[1]
        found = [np.zeros((0, fineness.n_cell_rays), np.uint16)]
        for fraction, seen in connect(cells, self._n_bounces, fineness.n_cell_rays):
            found.append(seen)
            yield span[0] + (span[1] - span[0]) * fraction, "light between surfaces"
        shining = direct_irradiance(cells, self._shining.lights, fineness.n_samples)
        direct = yield from _said(shining, span[1], "light between surfaces")
        light = CellLight(cells.objects.copy(), np.concatenate(found), direct)
        parts.keep({"cell_seen": light.seen, "direct": direct, **arrays_of_table(cells.table())})
        return light

    def _kept_fans(self, arrays: Arrays) -> tuple[CellTable, Gathered]:
        reader = self._reader(arrays)
        return read_table(reader), read_gathered(reader)

    def _kept_light(self, fineness: Fineness, arrays: Arrays) -> tuple[CellTable, CellLight]:
        reader = self._reader(arrays)
        table = read_table(reader)
        return table, read_cell_light(reader, fineness.n_cell_rays, table.objects.copy())


def relit(
    found: IndirectLight, placement: Placement, sky: SkyState, fineness: Fineness, n_bounces: int
) -> IndirectLight:
    """The same rays under another light; n_bounces: at most as many as they were found for.

    What was recorded of glossy surfaces belongs to the old light: they go by albedo, until the rays are traced anew.
    """
    shining = shining_on(placement, sky)
    light = replace(found.light, direct=run_to_end(direct_irradiance(found.cells, shining.lights, fineness.n_samples)))
    return replace(found.by_albedo(), light=light, n_bounces=n_bounces, unit=shining.unit)


def _said(steps: Generator[object, None, Result], fraction: float, text: str) -> Generator[Progress, None, Result]:
    """The same steps, of which each says how far the whole is."""
    return map_steps(steps, lambda step: (fraction, text))


def _first(rows: NDArray[np.int32]) -> NDArray[np.uint8]:
    """That a fan is the first of its point."""
    return np.zeros(len(rows), np.uint8)


def _further_done(times: float) -> float:
    """How much of the whole is done after further fans, so many times as many as there were first ones."""
    work, left = times * _ALL_LOOKS, _LIT - _LOOKED_CLOSER[-1]
    return _LOOKED_CLOSER[-1] + left * work / (work + left)


def _fan_size(n_rays: int, pole: int) -> FanSize:
    """A matt surface is seen by the cosine alone, half of the others' rays go towards the highlight."""
    n_pole = 0 if pole == NORMAL else n_rays // 2
    return FanSize(n_rays - n_pole, n_pole)


def _among_all(hits: PrimaryHits, rows: NDArray[np.int32], within: NDArray[np.int32]) -> NDArray[np.int32]:
    """Numbers (P, 4) among all gather points `rows` of numbers that count within each point's own object."""
    firsts = np.searchsorted(rows, hits.object_ranges[:, 0])
    counts = hits.object_ranges[:, 1] - hits.object_ranges[:, 0]
    return np.asarray(within + np.repeat(firsts, counts)[:, None], np.int32)
