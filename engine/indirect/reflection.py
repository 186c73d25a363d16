"""What the gather points reflect of the cells' light, layer by layer: with the curves as they are, or by band of one.

Both are sums over the same rays. The bands are never stored: from what is known of the rays (`aim`) they are summed
faster than they could be read. Stills, which sum once, keep nothing at all.
"""

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial, reduce

import numpy as np
from numpy.typing import NDArray

from engine.indirect import _reflection_kernels as kernels
from engine.indirect._photon_kernels import reflect_photon_bands, reflect_photons
from engine.indirect._smoothing_kernels import smooth_planes, smooth_rows
from engine.indirect.aim import Aim, SecondAim, n_angles_of
from engine.indirect.beyond import held
from engine.indirect.curves import LayerCurves
from engine.indirect.gather import FanSize, Gathered, fan_tables, object_of_rows
from engine.indirect.photons import Landed, PhotonMap, Sent, land, landed_of, nothing_landed
from engine.indirect.second_bounce import SecondLight
from engine.indirect.smoothing import Smoothing, mean_of_fans
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.threads import even_parts, n_threads, on_threads

_PART = 128
_PARTS = 2  # a step and thread: some 50 ms


@dataclass(frozen=True, eq=False)
class SentLight:
    """What surfaces send towards gather points: matt (C, D, 3), radiosity of the cells that goes to all sides alike,
    and what glossy ones send to one side, None where that counts as matt; and what photons carry from there."""

    matt: NDArray[np.float32]
    glossy: SecondLight | None
    thrown: Sent | None = None

    @property
    def n_powers(self) -> int:
        return self.matt.shape[1]

    @cached_property
    def padded(self) -> NDArray[np.float32]:
        """`matt` (C, D, 4) with a fourth number, 0: four are read and summed at once."""
        return np.pad(self.matt, ((0, 0), (0, 0), (0, 1)))


class Fans:
    """The fans of the gather points of one object, all their rays or one half of them; a point has the mean of its
    fans."""

    def __init__(
        self, hits: PrimaryHits, gathered: Gathered, i_object: int, pole: int, size: FanSize,
        half: int | None = None, keeps: bool = False, landed: Landed | None = None, smoothing: Smoothing | None = None,
    ) -> None:  # fmt: skip
        """keeps: what does not depend on curves, for the next sums over the same rays; landed: photons about all of the
        gather points, if any were looked for; smoothing: of all of them, None for the sums as they are."""
        begin, end = np.searchsorted(object_of_rows(hits, gathered.rows), (i_object, i_object + 1))
        rows, nth = gathered.rows[begin:end], gathered.nth[begin:end]
        records = gathered.records
        records = records._replace(start=records.start[begin : end + 1], times=records.times[begin:end])
        self._fans = kernels.FanArrays(
            rows, nth, np.full(len(rows), pole, np.int64), gathered.seen[begin:end], -1 if half is None else half,
            *fan_tables(size), hits.tangent, hits.normal, hits.wo,
        )  # fmt: skip
        self._keeps = keeps
        self._aims: dict[tuple[int, bytes], Aim] = {}
        self._landed = nothing_landed(len(rows)) if landed is None else landed_of(landed, int(begin), int(end))
        self._second = SecondAim(self._fans, hits.position, records, self._landed.area, keeps)
        self._means = [mean_of_fans(nth)] if nth.any() else []
        if smoothing is not None:
            first, last = np.searchsorted(object_of_rows(hits, gathered.points), (i_object, i_object + 1))
            self._means.append(smoothing.part(int(first), int(last)))
        self._hits, self._times, self._clearance = hits, records.times, gathered.clearance[begin:end]

    def __len__(self) -> int:
        return len(self._fans.rows)

    @property
    def n_bytes(self) -> int:
        """Memory of what is kept."""
        return self._second.n_bytes + sum(aim.n_bytes for aim in self._aims.values())

    def forget_all_but(self, layers: Sequence[LayerCurves]) -> None:
        """Keep nothing of other layers than these: of each roughness that a slider goes through there would be as much
        as of all rays."""
        wanted = {_aim_key(layer.optics()) for layer in layers}
        self._aims = {key: aim for key, aim in self._aims.items() if key in wanted}

    def landing(self, photon_map: PhotonMap, i_object: int, farthest: NDArray[np.float32], caster: RayCaster) -> Landed:
        """The photons about the points of the fans, no farther than (q,)."""
        return land(photon_map, i_object, self._hits, self._fans, self._times, farthest, self._clearance, caster)

    def reflected(
        self, layers: Sequence[LayerCurves], light: SentLight
    ) -> Generator[None, None, list[NDArray[np.float32]]]:
        """Radiance (p, D, 3) of each layer at the p points towards the eye, without f_q and f_o, in steps."""
        out = [np.empty((len(self), light.n_powers, 3), np.float32) for _ in layers]
        optics = [layer.optics(folded=True) for layer in layers]
        aims = [self._aim(each) for each in optics]

        def work(begin: int, end: int, second: kernels.Second) -> None:
            for each, aim, result in zip(optics, aims, out, strict=True):
                kernels.reflect(self._fans, begin, end, each, aim.part(begin, end), light.padded, second, result)
                if light.thrown is not None:
                    reflect_photons(self._fans, begin, end, each, self._landed, light.thrown, result)

        yield from self._in_parts(light, work, aims)
        for layer, result in zip(layers, out, strict=True):
            if layer.is_tinted:
                result *= layer.tint.astype(np.float32)
        return [reduce(_mean_rows, self._means, held(each)) for each in out]

    def by_band(self, layer: LayerCurves, factor: int, light: SentLight) -> Generator[None, None, NDArray[np.float32]]:
        """Of one layer by band of its first or second curve: (3, J, D, p); times the curve and summed over J it is
        `reflected`. In steps."""
        out = np.empty((3, len(layer.curves[factor]), light.n_powers, len(self)), np.float32)
        optics = layer.optics()
        aim = self._aim(optics)

        def work(begin: int, end: int, second: kernels.Second) -> None:
            aimed = aim.part(begin, end)
            kernels.reflect_bands(self._fans, begin, end, optics, factor == 0, aimed, light.padded, second, out)
            if light.thrown is not None:
                reflect_photon_bands(self._fans, begin, end, optics, factor == 0, self._landed, light.thrown, out)

        yield from self._in_parts(light, work, [aim])
        if layer.is_tinted:
            out *= layer.tint.astype(np.float32)[:, None, None, None]
        out = held(out)
        for means in self._means:
            yield
            out = _mean_planes(out, means)
        return out

    def _aim(self, optics: kernels.ReflectingLayer) -> Aim:
        """What is kept for such a layer, or new."""
        key = _aim_key(optics)
        kept = self._aims.get(key)
        if kept is not None and kept.n_angles >= n_angles_of(optics):
            return kept
        made = Aim(self._fans, optics, self._keeps)
        if self._keeps:
            self._aims[key] = made
        return made

    def _in_parts(
        self, light: SentLight, work: Callable[[int, int, kernels.Second], None], aims: Sequence[Aim]
    ) -> Generator[None, None, None]:
        glossy, step = light.glossy, _PARTS * _PART * n_threads()
        none = np.zeros((0, light.n_powers, 4), np.float32)
        no_second = kernels.Second(np.zeros(len(self) + 1, np.int64), np.zeros(0, np.uint16), none, 0)

        def do(wanted: NDArray[np.bool_] | None, begin: int) -> None:
            end = min(begin + _PART, len(self))
            second = no_second
            if glossy is not None and wanted is not None:
                second = self._second.part(begin, end, glossy, wanted)
            work(begin, end, second)

        for begin in range(0, len(self), step):
            wanted = None if glossy is None else self._second.wanted(glossy, begin)
            on_threads(partial(do, wanted), range(begin, min(begin + step, len(self)), _PART))
            if glossy is not None:
                self._second.complete(glossy, begin)
            yield
        for aim in aims:
            aim.complete()


def _aim_key(optics: kernels.ReflectingLayer) -> tuple[int, bytes]:
    """What an aim hangs on."""
    return optics.model, optics.q.tobytes()


def _mean_rows(light: NDArray[np.float32], means: Smoothing) -> NDArray[np.float32]:
    """Means (p, D, 3) of light (q, D, 3); q may be 0."""
    values = light.reshape(len(light), math.prod(light.shape[1:]))
    out = np.empty((means.n_rows, values.shape[1]), np.float32)
    smooth_rows(*means, values, out)
    return out.reshape(len(out), *light.shape[1:])


def _mean_planes(light: NDArray[np.float32], means: Smoothing) -> NDArray[np.float32]:
    """Means (..., p) of light (..., q); q may be 0."""
    planes = light.reshape(math.prod(light.shape[:-1]), light.shape[-1])
    out = np.empty((len(planes), means.n_rows), np.float32)
    on_threads(lambda begin, end: smooth_planes(*means, planes, begin, end, out), *even_parts(len(planes)))
    return out.reshape(*light.shape[:-1], means.n_rows)
