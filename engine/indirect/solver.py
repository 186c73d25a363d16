"""Indirect light of one scene from one camera: all that does not depend on a material, and pictures from it.

What is traced (fans of the gather points, rays between the cells) depends on the scene and the camera alone, what falls
on the cells on the light as well; curves, albedos and which object is edited come in at the end. So a light that turns
asks for the cells' irradiance anew, a material for nothing but sums.
"""

from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.indirect._cell_kernels import NO_CELL, Lights
from engine.indirect._ray_kernels import HALF, NORMAL
from engine.indirect.cells import Cells, TooManyCells, patch_lights, sky_lights
from engine.indirect.curves import pole_of
from engine.indirect.gather import FanSize, Gathered, gather, joined, object_of_rows
from engine.indirect.irradiance import CellLight, connect, direct_irradiance, radiosity
from engine.indirect.lattice import COARSEST, Lattice
from engine.indirect.layers import IndirectLayer, albedos_of
from engine.indirect.light import Footprint, GatherPoints, IndirectLight
from engine.indirect.parts import Keeper, Parts
from engine.indirect.photons import PhotonMap, PhotonSource, no_photons, nothing_landed
from engine.indirect.reflection import SentLight
from engine.indirect.second_bounce import SecondRays, axes_of, lamps_of, no_records
from engine.indirect.stored import (
    arrays_of_gathered,
    arrays_of_table,
    cell_light_of,
    footprint_of,
    gathered_of,
    smoothing_of,
    table_of,
)
from engine.light.emitters import EmitterPatches
from engine.light.lights import TriangleLights, cut_lights
from engine.scene.hits import PrimaryHits
from engine.transport.footprint import footprint, lattice_rows
from engine.transport.pipeline import Placement, SkyState


@dataclass(frozen=True)
class Fineness:
    """How finely indirect light is found.

    n_rays a gather point, of which n_records at most are followed where they end on glossy surfaces; n_photons that
    glossy surfaces throw; n_cells to aim at; n_cell_rays between cells, a cell; n_samples of each kind of light, a
    cell; adaptive: refine the lattice of gather points, else every eighth pixel.
    """

    name: str
    n_rays: int
    n_records: int
    n_photons: int
    n_cells: int
    n_cell_rays: int
    n_samples: int
    adaptive: bool


ROUGH = Fineness("rough", 128, 32, 1 << 15, 4000, 64, 64, False)
FINE = Fineness("fine", 512, 96, 1 << 19, 24000, 128, 256, True)
STILL = Fineness("still", 1024, 1024, 1 << 20, 48000, 128, 256, True)
N_LIGHTS, N_PATCHES = 4000, 256
# What a first look at the scene takes.
_PILOT_POINTS, _PILOT_RAYS = 1024, 64
_GROWTH = 1.26
# Gather points a part that is kept: a second or two of work, so that keeping it costs little.
PART_POINTS = 4096
_PHOTONS_SHARE = np.float32(0.3)

Progress = tuple[float, str]


class Solver:
    """Finds the indirect light of a scene; its steps are generators that yield (fraction, text)."""

    def __init__(
        self, placement: Placement, models: Mapping[int, Sequence[str]], sky: SkyState, n_bounces: int,
        fineness: Fineness = FINE, glossy: bool = True,
    ) -> None:  # fmt: skip
        """models: names of the models of every object's layers, by the object's index; n_bounces ≥ 2.

        glossy: whether the second bounce off glossy surfaces has a direction, else it goes by albedo as all others do.
        """
        self._placement, self._fineness, self._n_bounces = placement, fineness, n_bounces
        n_objects = len(placement.hits.object_ranges)
        self._poles = np.array([pole_of(models.get(i, ())) for i in range(n_objects)], np.int64)
        self._sizes = tuple(_fan_size(fineness.n_rays, int(pole)) for pole in self._poles)
        cut, patches = _cut(sky), placement.patches(N_PATCHES)
        self._lights, self._lamps = _lights(cut, patches), lamps_of(cut, patches)
        is_glossy = np.array([bool(set(models.get(i, ())) - {"lambert"}) for i in range(n_objects)])
        self._axes = axes_of(placement.scene)
        second = SecondRays(is_glossy, self._poles, self._axes, self._lamps, fineness.n_records)
        self._second = second if glossy else None

    def solve(
        self, layers: Sequence[IndirectLayer], keeper: Keeper | None = None
    ) -> Generator[Progress, None, IndirectLight]:
        """The indirect light; the layers only say where the picture of it is not smooth.

        keeper: where parts are kept that this run has finished, and found that another has.
        """
        size, parts = self._cell_size(), Parts(keeper)
        while True:
            cells = Cells(self._placement.scene, self._placement.caster, size)
            try:
                return (yield from self._solve(cells, layers, parts))
            except TooManyCells:
                parts.too_fine()
                size *= _GROWTH

    def restored(self, arrays: Mapping[str, NDArray[np.generic]]) -> IndirectLight:
        """What `solve` gave and `stored.arrays_of` made arrays of."""
        cells = Cells(self._placement.scene, self._placement.caster, float(arrays["cell_size"][0]))
        cells.restore(table_of(arrays))
        points = self._points(gathered_of(arrays), self._photons(cells))
        points = replace(points, smoothing=smoothing_of(arrays))
        light = cell_light_of(arrays, cells.objects.copy())
        return IndirectLight(points, footprint_of(arrays), cells, light, self._lamps, self._n_bounces)

    def _cell_size(self) -> float:
        """Metres, so that what a first look hits falls into about as many cells as wanted."""
        hits, scene = self._placement.hits, self._placement.scene
        rows = lattice_rows(hits, COARSEST)
        rows = rows[:: max(1, len(rows) // _PILOT_POINTS)]
        extent = float(np.linalg.norm(np.ptp(scene.vertices[np.unique(scene.triangles)], axis=0)))
        low, high = extent / 4096.0, extent
        while high / low > 1.1:
            size = (low * high) ** 0.5
            cells = Cells(scene, self._placement.caster, size)
            try:
                pilot = gather(hits, cells, rows, self._poles, _fan_size(_PILOT_RAYS, HALF), focused=False)
                n_hits = sum(int((part.seen != NO_CELL).sum()) for part in pilot)
                too_fine = len(cells) > min(self._fineness.n_cells / 2, max(n_hits / 4, 1.0))
            except TooManyCells:
                too_fine = True
            low, high = (size, high) if too_fine else (low, size)
        return high

    def _solve(
        self, cells: Cells, layers: Sequence[IndirectLayer], parts: Parts
    ) -> Generator[Progress, None, IndirectLight]:
        none = np.zeros((0, self._fineness.n_rays), np.uint16)
        nothing = Gathered(np.zeros(0, np.int32), none, no_records(0))
        yield 0.0, "looking around"
        photons = self._photons(cells)
        if self._fineness.adaptive:
            points, found = yield from self._refined(cells, nothing, layers, photons, parts)
        else:
            points, found = yield from self._even(cells, nothing, photons, parts)
        light = yield from self._light(cells, self._fineness, parts)
        return IndirectLight(points, found, cells, light, self._lamps, self._n_bounces).smoothed(layers)

    def _photons(self, cells: Cells) -> PhotonMap:
        """What glossy surfaces throw."""
        if self._second is None:
            return PhotonMap(no_photons(len(self._poles)))
        source = PhotonSource(
            self._placement.scene, cells, self._second.glossy, self._poles, self._axes, self._lamps
        )
        return PhotonMap(source.send(self._placement.hits, self._fineness.n_photons))

    def _even(
        self, cells: Cells, nothing: Gathered, photons: PhotonMap, parts: Parts
    ) -> Generator[Progress, None, tuple[GatherPoints, Footprint]]:
        """Every eighth pixel."""
        hits = self._placement.hits
        rows = lattice_rows(hits, COARSEST)
        points = self._points((yield from self._gather(cells, nothing, rows, parts)), photons)
        numbers, weights = footprint(hits, rows, COARSEST)
        return points, (_among_all(hits, rows, numbers), weights)

    def _refined(
        self, cells: Cells, gathered: Gathered, layers: Sequence[IndirectLayer], photons: PhotonMap, parts: Parts
    ) -> Generator[Progress, None, tuple[GatherPoints, Footprint]]:
        """As many points as the picture of these layers needs, by a quarter of the light between cells."""
        n_rays, n_samples = self._fineness.n_cell_rays // 4, self._fineness.n_samples // 4
        lattice = Lattice(self._placement.hits, self._poles != NORMAL)
        values, noise = np.zeros((2, len(self._placement.hits.pixel), 3), np.float32)
        bright = None
        while True:
            gathered = yield from self._gather(cells, gathered, lattice.wanted(), parts)
            if bright is None:
                coarser = replace(self._fineness, n_cell_rays=n_rays, n_samples=n_samples)
                light = yield from self._light(cells, coarser, parts)
                bright, _ = radiosity(light, albedos_of(layers, len(self._poles)), self._n_bounces)
            new_cells = np.zeros((len(cells) - len(bright), *bright.shape[1:]), np.float32)  # not known yet: dark
            points = self._points(gathered, photons)
            # By albedo and a share of the photons: what glossy surfaces send is noisier.
            thrown = points.thrown(layers)
            thrown = thrown._replace(light=_PHOTONS_SHARE * thrown.light)
            sent = SentLight(np.concatenate([bright, new_cells]), None, thrown)
            first, second = (points.reflected(layers, sent, half) for half in (0, 1))
            values[gathered.rows], noise[gathered.rows] = 0.5 * (first + second), 0.5 * abs(first - second)
            if not lattice.refine(values, noise):
                return points, lattice.footprint()

    def _points(self, gathered: Gathered, photons: PhotonMap) -> GatherPoints:
        points = GatherPoints(
            self._placement.hits, gathered, self._poles, self._sizes, self._axes, self._second is not None,
            photons.photons, nothing_landed(len(gathered.rows)),
        )  # fmt: skip
        return points.reached_by(photons, self._placement.scene)

    def _gather(
        self, cells: Cells, before: Gathered, rows: NDArray[np.int32], parts: Parts
    ) -> Generator[Progress, None, Gathered]:
        """The gather points with those of some more rows."""
        found = [before]
        n_pole = np.array([size.n_pole for size in self._sizes])[object_of_rows(self._placement.hits, rows)]
        done = 0
        for n in np.unique(n_pole):
            own, size = rows[n_pole == n], FanSize(self._fineness.n_rays - int(n), int(n))
            for begin in range(0, len(own), PART_POINTS):
                part = own[begin : begin + PART_POINTS]
                for gathered in self._gathered(cells, part, size, parts):
                    found.append(gathered)
                    done += len(gathered.rows)
                    yield done / len(rows), "looking around"
        return joined(found)

    def _gathered(
        self, cells: Cells, rows: NDArray[np.int32], size: FanSize, parts: Parts
    ) -> Iterator[Gathered]:
        """One part of the gather points: what was kept of it, or what is traced."""
        kept = parts.begin(b"fans", rows.tobytes(), repr((size, cells.size)).encode())
        if kept is not None:
            cells.restore(table_of(kept))
            yield gathered_of(kept)
            return
        found = []
        for each in gather(self._placement.hits, cells, rows, self._poles, size, self._second):
            found.append(each)
            yield each
        parts.keep({**arrays_of_gathered(joined(found)), **arrays_of_table(cells.table())})

    def _light(self, cells: Cells, fineness: Fineness, parts: Parts) -> Generator[Progress, None, CellLight]:
        kept = parts.begin(b"light", repr(fineness).encode())
        if kept is not None:
            cells.restore(table_of(kept))
            return cell_light_of(kept, cells.objects.copy())
        found = [np.zeros((0, fineness.n_cell_rays), np.uint16)]
        for fraction, seen in connect(cells, self._n_bounces, fineness.n_cell_rays):
            found.append(seen)
            yield fraction, "light between surfaces"
        direct = direct_irradiance(cells, self._lights, fineness.n_samples)
        light = CellLight(cells.objects.copy(), np.concatenate(found), direct)
        parts.keep({"cell_seen": light.seen, "direct": direct, **arrays_of_table(cells.table())})
        return light


def relit(
    found: IndirectLight, placement: Placement, sky: SkyState, fineness: Fineness, n_bounces: int
) -> IndirectLight:
    """The same rays under another light; n_bounces: at most as many as they were found for.

    What was recorded of glossy surfaces belongs to the old light: they go by albedo, until the rays are traced anew.
    """
    cut, patches = _cut(sky), placement.patches(N_PATCHES)
    direct = direct_irradiance(found.cells, _lights(cut, patches), fineness.n_samples)
    return replace(found.by_albedo(), light=replace(found.light, direct=direct), n_bounces=n_bounces)


def _fan_size(n_rays: int, pole: int) -> FanSize:
    """A matt surface is seen by the cosine alone, half of the others' rays go towards the highlight."""
    n_pole = 0 if pole == NORMAL else n_rays // 2
    return FanSize(n_rays - n_pole, n_pole)


def _cut(sky: SkyState) -> TriangleLights | None:
    if sky.environment is None:
        return None
    cut = cut_lights(sky.environment, N_LIGHTS, sky.rotation)
    return replace(cut, power=(cut.power * np.float32(sky.scale)).astype(np.float32))


def _lights(cut: TriangleLights | None, patches: EmitterPatches | None) -> tuple[Lights, ...]:
    """The sky and the emitters, each to be sampled by power."""
    lights = [] if cut is None else [sky_lights(cut)]
    lights += [] if patches is None else [patch_lights(patches)]
    return tuple(each for each in lights if len(each.cumulative))


def _among_all(hits: PrimaryHits, rows: NDArray[np.int32], within: NDArray[np.int32]) -> NDArray[np.int32]:
    """Numbers (P, 4) among all gather points `rows` of numbers that count within each point's own object."""
    firsts = np.searchsorted(rows, hits.object_ranges[:, 0])
    counts = hits.object_ranges[:, 1] - hits.object_ranges[:, 0]
    return np.asarray(within + np.repeat(firsts, counts)[:, None], np.int32)
