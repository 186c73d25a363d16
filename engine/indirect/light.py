"""Indirect light that was found: where, by which rays, and what follows from it for any materials."""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.indirect._ray_kernels import NORMAL
from engine.indirect._second_kernels import SampledLights
from engine.indirect.beyond import SQUARED, held, in_full
from engine.indirect.cell_maps import CellReflectance
from engine.indirect.cells import Cells
from engine.indirect.fineness import RayNeed
from engine.indirect.gather import FanSize, Gathered, object_of_rows
from engine.indirect.irradiance import NOBODY, CellLight, radiosity
from engine.indirect.lattice import least_alike
from engine.indirect.layers import IndirectLayer, albedos_of, seen_from
from engine.indirect.photons import Landed, PhotonMap, Photons, Sent, farthest_of, joined_landed, sent_by
from engine.indirect.reflection import Fans, SentLight
from engine.indirect.second_bounce import SecondLight, glossy_tables, inverse_albedo, looks_of, sent_on
from engine.indirect.smoothing import Smoothing, smoothing_for
from engine.scene.primary_hits import PrimaryHits
from engine.scene.scene_loader import Scene
from engine.scene.raycaster import RayCaster
from engine.generators import run_to_end

Footprint = tuple[NDArray[np.int32], NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class GatherPoints:
    """The gather points of a picture: gathered, their fans' rays; poles (M,) and sizes: what each object's fans are;
    axes (M, 2, 3) of the objects; glossy: whether rays were recorded for the second bounce off glossy surfaces;
    photons that such surfaces threw, and which of them landed about the points; smoothing: the filter that takes noise
    out of what the points reflect, None for none."""

    hits: PrimaryHits
    gathered: Gathered
    poles: NDArray[np.int64]
    sizes: tuple[FanSize, ...]
    axes: NDArray[np.float32]
    glossy: bool
    photons: Photons
    landed: Landed
    smoothing: Smoothing | None = None

    @property
    def n_bytes(self) -> int:
        """Memory of rays and photons, and of the filter."""
        arrays = (*self.photons, *self.landed, *(self.smoothing or ()))
        return self.gathered.n_bytes + sum(array.nbytes for array in arrays)

    def fans(self, i_object: int, half: int | None = None, keeps: bool = False) -> Fans:
        """The gather points of one object; with half, 0 or 1, by that half of their rays; keeps: see `Fans`."""
        pole, size = int(self.poles[i_object]), self.sizes[i_object]
        return Fans(self.hits, self.gathered, i_object, pole, size, half, keeps, self.landed, self.smoothing)

    def reached_by(self, photon_map: PhotonMap, scene: Scene, caster: RayCaster) -> "GatherPoints":
        """The same with photons about them."""
        farthest = farthest_of(scene, self.hits, self.gathered.rows)
        objects = object_of_rows(self.hits, self.gathered.rows)
        parts = [self.fans(i).landing(photon_map, i, farthest[objects == i], caster) for i in range(len(self.poles))]
        return replace(self, landed=joined_landed(parts))

    def thrown(self, layers: Sequence[IndirectLayer], edited: int = NOBODY) -> Sent:
        """What the photons carry under these layers."""
        tables = glossy_tables(layers, self.poles, self.axes)
        return sent_by(self.photons, tables, edited, self._inverse(layers, edited))

    def sent(
        self, radiosities: tuple[NDArray[np.float32], NDArray[np.float32]], objects: NDArray[np.int32],
        layers: Sequence[IndirectLayer], cells: CellReflectance, lamps: SampledLights, edited: int = NOBODY,
    ) -> SentLight:  # fmt: skip
        """What cells with radiosities (C, D, 3) as `irradiance.radiosity` gives them, of these objects (C,), send on
        under these layers."""
        bright, beyond = radiosities
        if not self.glossy:
            return SentLight(bright, None, None)
        n_objects = len(self.poles)
        tables, inverse = glossy_tables(layers, self.poles, self.axes, cells), self._inverse(layers, edited)
        looks, per_area = looks_of(layers, n_objects, cells), self.photons.per_area
        second = SecondLight(objects, sent_on(beyond, inverse), per_area, looks, tables, lamps, edited, inverse)
        return SentLight(bright * cells.matt[:, None], second, self.thrown(layers, edited))

    def _inverse(self, layers: Sequence[IndirectLayer], edited: int) -> NDArray[np.float32]:
        """One over the albedo (3,) of the object that is edited, 1 where none is."""
        if edited == NOBODY:
            return np.ones(3, np.float32)
        return inverse_albedo(albedos_of(layers, len(self.poles))[edited])

    def reflected(
        self, layers: Sequence[IndirectLayer], light: SentLight, half: int | None = None
    ) -> Generator[None, None, NDArray[np.float32]]:
        """Radiance (p, 3) towards the eye of light that no object is edited in, in steps."""
        out, rows = np.zeros((len(self.gathered.points), 3), np.float32), self.gathered.points
        objects = object_of_rows(self.hits, rows)
        for i_object in sorted({layer.i_object for layer in layers}):
            mine = np.flatnonzero(objects == i_object)
            own = [layer for layer in layers if layer.i_object == i_object]
            found = yield from self.fans(i_object, half).reflected([layer.curves for layer in own], light)
            for layer, reflected in zip(own, found, strict=True):
                with np.errstate(over="ignore"):
                    out[mine] += reflected[:, 0] * seen_from(self.hits, rows[mine], layer)
            yield None
        return held(out)

    def halves(self, layers: Sequence[IndirectLayer], light: SentLight) -> Generator[None, None, NDArray[np.float32]]:
        """What each half of the rays brings, (2, p, 3), in steps; held so that its square is one."""
        found = np.zeros((2, len(self.gathered.points), 3), np.float32)
        for half in (0, 1):
            found[half] = held((yield from self.reflected(layers, light, half)), SQUARED)
        return found


@dataclass(frozen=True, eq=False)
class IndirectLight:
    """footprint: for each point of the picture four gather points, by number, and their weights, (P, 4) each; light:
    what the cells send on, in up to n_bounces reflections; lamps: all that shines. All of it is in units of `unit`,
    pictures excepted. need: how many rays its fans have, and why."""

    points: GatherPoints
    footprint: Footprint
    cells: Cells
    light: CellLight
    lamps: SampledLights
    n_bounces: int
    unit: float
    need: RayNeed

    @property
    def n_bytes(self) -> int:
        found = self.points.n_bytes + sum(a.nbytes for a in self.footprint)
        return found + self.cells.n_bytes + self.light.n_bytes

    def by_albedo(self) -> "IndirectLight":
        """The same without what was recorded of glossy surfaces: from the second bounce on, all go by albedo."""
        return replace(self, points=replace(self.points, glossy=False))

    def footprint_by_object(self) -> Footprint:
        """The footprint with gather points numbered within each object."""
        rows, weights = self.footprint
        ranges = self.points.hits.object_ranges
        firsts = np.searchsorted(self.points.gathered.points, ranges[:, 0])
        own = np.repeat(firsts, ranges[:, 1] - ranges[:, 0])[:, None]
        return np.asarray(np.where(weights > 0.0, rows - own, 0), np.int32), weights

    def unfiltered(self) -> "IndirectLight":
        """The same with the noise that the rays have."""
        return replace(self, points=replace(self.points, smoothing=None))

    def smoothed(self, layers: Sequence[IndirectLayer]) -> Generator[None, None, "IndirectLight"]:
        """The same with the filter that the noise under these layers calls for, in steps."""
        points, light = self.unfiltered().points, self.sent(layers)
        first, second = yield from points.halves(layers, light)
        turns = least_alike(self.points.poles != NORMAL)
        smoothing = smoothing_for(self.points.hits, self.points.gathered.points, turns, first, second)
        return replace(self, points=replace(self.points, smoothing=smoothing))

    def radiosity(self, layers: Sequence[IndirectLayer], edited: int = NOBODY) -> NDArray[np.float32]:
        """Radiosity (C, D, 3) of the cells under these layers, see `irradiance.radiosity`."""
        return self._radiosities(layers, self._reflectance(layers), edited)[0]

    def _reflectance(self, layers: Sequence[IndirectLayer]) -> CellReflectance:
        return self.cells.maps.reflectance(layers, len(self.points.poles))

    def _radiosities(
        self, layers: Sequence[IndirectLayer], cells: CellReflectance, edited: int
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        albedos = albedos_of(layers, len(self.points.poles))
        # What glossy surfaces reflect of the lights themselves is recorded.
        return radiosity(self.light, albedos, self.n_bounces, cells, edited, self.points.glossy)

    def sent(self, layers: Sequence[IndirectLayer], edited: int = NOBODY) -> SentLight:
        """What surfaces send towards the gather points under these layers."""
        cells = self._reflectance(layers)
        bright = self._radiosities(layers, cells, edited)
        return self.points.sent(bright, self.light.objects, layers, cells, self.lamps, edited)

    def at_points(self, layers: Sequence[IndirectLayer], half: int | None = None) -> NDArray[np.float32]:
        """Indirect radiance (p, 3) of all gather points; of one half of the rays where one is named."""
        return in_full(run_to_end(self.points.reflected(layers, self.sent(layers), half)), self.unit)

    def noise(self, layers: Sequence[IndirectLayer]) -> Generator[None, None, tuple[float, float]]:
        """What chance is left in the picture, RMS relative to its mean, and that mean, in steps: its halves differ by
        twice the chance.

        What the filter blurs besides is not in it."""
        light, (rows, weights) = self.sent(layers), self.footprint
        if not len(rows):  # nothing in the picture reflects
            return 0.0, 0.0
        halves = yield from self.points.halves(layers, light)
        first, second = (np.einsum("pk,pkc->pc", weights, found[rows]) for found in halves)
        mean = 0.5 * float(np.mean(first + second, dtype=np.float64))
        rms = 0.5 * float(np.sqrt(np.mean((first - second) ** 2, dtype=np.float64)))
        return (rms / mean if mean > 0.0 else 0.0), mean * self.unit

    def picture(self, layers: Sequence[IndirectLayer], half: int | None = None) -> NDArray[np.float32]:
        """Indirect radiance (P, 3) of all points of the picture."""
        found, (rows, weights) = run_to_end(self.points.reflected(layers, self.sent(layers), half)), self.footprint
        return in_full(np.einsum("pk,pkc->pc", weights, found[rows]), self.unit)
