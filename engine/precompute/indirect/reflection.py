"""Reflects the light of the records at the gather points, layer by layer: with the curves applied, or by band of one.

Both are sums over the same rays. The bands are never stored: summing them from the stored ray weights (`RayWeights`) is
faster than reading them would be. Final stills, which sum once, store nothing at all.

What does not depend on the edited curve is cached between freezings. The weights of a layer's rays and the arguments of
its curves depend only on the model and its quotient: at most six bytes a ray, two if the only curve is constant. A
contraction is then one pass over the rays that reads a record's polynomial, a weight and a value of the curve. Storing
the contracted operator of points and records instead was rejected: it takes as much memory (a point's 400 hits lie on
270 records), saves a quarter of the time, and every edit of a curve invalidates it. The light that glossy surfaces
reflect along the stored rays depends on their curves. It is cached per object until the object's curves change.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce

import numpy as np
from numpy.typing import NDArray

from engine.core.clamping import clamp_radiance
from engine.core.threads import even_parts, n_threads, on_threads
from engine.material.layer import frame_of
from engine.precompute.direct._projection_kernels import ViewedPoints
from engine.precompute.indirect import _edited_gloss_kernels as edited_kernels
from engine.precompute.indirect import _reflection_kernels as kernels
from engine.precompute.indirect import _second_bounce_kernels as second_kernels
from engine.precompute.indirect._edited_gloss_kernels import EditedLight
from engine.precompute.indirect._light_choice_kernels import NO_LIGHT, SampledLights
from engine.precompute.indirect._photon_kernels import reflect_photon_bands, reflect_photons
from engine.precompute.indirect.direction_patterns import lobe_tables
from engine.precompute.indirect.edited_gloss import EditedGloss, KnotReceiver, Receiver, all_knots, knot_table
from engine.precompute.indirect.gather import GatherSamples, SampleCounts, direction_tables, object_of_rows
from engine.precompute.indirect.indirect_layers import LayerCurves
from engine.precompute.indirect.photons import (
    NearbyPhotons,
    PhotonFlux,
    PhotonMap,
    find_nearby_photons,
    no_nearby_photons,
    slice_nearby,
)
from engine.precompute.indirect.ray_weights import PhotonWeights, RayWeights, n_angles_of, weights_key
from engine.precompute.indirect.second_bounce import N_LOBE_RAYS, SecondBounceLight
from engine.precompute.indirect.smoothing import Smoothing, mean_of_sample_sets
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster

_PART = 128
_PARTS = 2  # parts per step and thread: about 50 ms
_PILOT, _EVERY = 32, 16  # points of a part of the pilot, and which of all parts are in it


class SecondBounceWeights:
    """The light along the stored rays of one object; the reflection of glossy surfaces may be cached."""

    def __init__(
        self, samples: kernels.SampleArrays, position: NDArray[np.float32], records: second_kernels.GlossyHits,
        area: NDArray[np.float32], keeps: bool,
    ) -> None:  # fmt: skip
        """area (p,): see `photons.NearbyPhotons`."""
        self._samples, self._position, self._records, self._area = samples, position, records, area
        self._first = int(records.start[0])
        self._cached = np.empty((int(records.start[-1]) - self._first, 3, 3), np.float32) if keeps else None
        self._cached_of: dict[int, tuple[tuple[bytes, ...], SampledLights]] = {}

    def missing_objects(self, light: SecondBounceLight, step: int) -> NDArray[np.bool_]:
        """The objects (M,) whose reflection is not cached for the parts of a step, by its number: the light may change
        between two steps."""
        digests, all_lights = self._cached_of.get(step, ((), None))
        if light.is_part or all_lights is not light.all_lights:
            return np.ones(len(light.digests), bool)
        return np.array([now != then for now, then in zip(light.digests, digests, strict=True)])

    def paths(self, light: SecondBounceLight) -> second_kernels.GlossyPaths:
        """The stored rays, for the kernels."""
        return second_kernels.GlossyPaths(
            self._samples, self._position, self._records, light.objects, light.layers, light.layers_3,
            light.all_lights, lobe_tables(N_LOBE_RAYS), self._area, light.per_area,
        )  # fmt: skip

    def part(self, begin: int, end: int, light: SecondBounceLight, missing: NDArray[np.bool_]) -> kernels.SecondBounce:
        """The second-bounce light of points [begin, end)."""
        records, base = self._records, int(self._records.start[begin])
        sent, first = self._sent(begin, end, light, missing)
        lit = np.empty((int(records.start[end]) - base, *light.radiosity.shape[2:]), np.float32)
        second_kernels.light_second_bounce(
            self._samples, records, begin, end, light.objects, sent, first, light.is_lit, light.radiosity,
            light.edited, light.inverse, lit,
        )  # fmt: skip
        return kernels.SecondBounce(records.start, records.ray, lit, base)

    def _sent(
        self, begin: int, end: int, light: SecondBounceLight, missing: NDArray[np.bool_]
    ) -> tuple[NDArray[np.float32], int]:
        """See `second_bounce_light`: the light of points [begin, end), and the number of its first ray."""
        first, last = int(self._records.start[begin]), int(self._records.start[end])
        if self._cached is None or light.is_part:
            sent = np.empty((last - first, 3, 3), np.float32)
        else:
            sent, first = self._cached, self._first
        if missing.any():
            second_kernels.second_bounce_light(self.paths(light), begin, end, missing, first, sent)
        return sent, first

    def vertices_on(self, i_object: int, light: SecondBounceLight) -> tuple[bool, bool]:
        """Whether any stored path is reflected by an object at its second or third vertex; and any at both."""
        records = self._records
        rays = np.arange(self._first, int(records.start[-1]))
        sets = np.repeat(np.arange(len(records.start) - 1), np.diff(records.start))
        second = light.objects[self._samples.records[sets, records.ray[rays]]] == i_object
        at_third = records.light_3[rays] != NO_LIGHT
        third = np.zeros(len(rays), bool)
        third[at_third] = light.objects[records.beyond[rays[at_third]]] == i_object
        return bool((second | third).any()), bool((second & third).any())

    def edited(
        self, begin: int, end: int, light: SecondBounceLight, gloss: EditedGloss, missing: NDArray[np.bool_]
    ) -> EditedLight:
        """The light of an edited curve along the stored rays of points [begin, end)."""
        records, base = self._records, int(self._records.start[begin])
        sent, first = self._sent(begin, end, light, missing)
        n = int(records.start[end]) - base
        shapes = (3,), (3, 3), (3,), (3,)
        positions, lit, pairs, factor = (np.empty((n, *shape), np.float32) for shape in shapes)
        edited_kernels.edited_light(
            self.paths(light), begin, end, gloss.i_object, gloss.i_glossy, gloss.curve.factor == 0, sent, first,
            gloss.bright, positions, lit, pairs, factor,
        )  # fmt: skip
        return EditedLight(records.start, records.ray, positions, lit, pairs, factor, records.beyond, base)

    def complete(self, light: SecondBounceLight, step: int) -> None:
        """Marks the parts of a step as computed under this light."""
        if self._cached is not None and not light.is_part:
            self._cached_of[step] = light.digests, light.all_lights

    @property
    def is_uncached(self) -> bool:
        """Whether each request computes the light anew."""
        return self._cached is None

    @property
    def n_bytes(self) -> int:
        return 0 if self._cached is None else self._cached.nbytes


@dataclass(frozen=True, eq=False)
class OutgoingRadiance:
    """Radiance that surfaces send towards gather points. diffuse (C, D, 3): radiosity of the records, equal in all
    directions; glossy: directional reflection, None where it counts as diffuse; caustics: light carried by photons."""

    diffuse: NDArray[np.float32]
    glossy: SecondBounceLight | None
    caustics: PhotonFlux | None = None

    @property
    def n_powers(self) -> int:
        return self.diffuse.shape[1]

    def beside(self, other: OutgoingRadiance) -> OutgoingRadiance:
        """This light without its gloss as the first powers, and the other without caustics as the next, to be reflected
        in one pass."""
        glossy = other.glossy
        if glossy is not None:
            none = np.zeros((*glossy.radiosity.shape[:2], self.n_powers, 4), np.float32)
            glossy = replace(glossy, radiosity=np.concatenate([none, glossy.radiosity], axis=2))
        return OutgoingRadiance(np.concatenate([self.diffuse, other.diffuse], axis=1), glossy)

    @cached_property
    def padded(self) -> NDArray[np.float32]:
        """`diffuse` (C, D, 4) with a fourth value of 0, so that four values are read and summed at once."""
        return np.pad(self.diffuse, ((0, 0), (0, 0), (0, 1)))


class HemisphereSamples:
    """The hemisphere samples of one object's gather points; a point's result is the mean of its sample sets."""

    def __init__(
        self, hits: PrimaryHits, gathered: GatherSamples, i_object: int, lobe_axis: int, size: SampleCounts,
        keeps: bool = False, landed: NearbyPhotons | None = None,
        smoothing: Smoothing | None = None,
    ) -> None:  # fmt: skip
        """keeps: store what does not depend on curves, for later sums over the same rays; landed: photons near all
        gather points, if they were searched for; smoothing: filter over all gather points, None for the unfiltered
        sums."""
        begin, end = np.searchsorted(object_of_rows(hits, gathered.rows), (i_object, i_object + 1))
        rows, nth = gathered.rows[begin:end], gathered.nth[begin:end]
        records = gathered.glossy_hits
        records = records._replace(start=records.start[begin : end + 1], times=records.times[begin:end])
        self._samples = kernels.SampleArrays(
            rows, nth, np.full(len(rows), lobe_axis, np.int64), gathered.records[begin:end],
            *direction_tables(size, nth), *hits.ray_frames, hits.wo,
        )  # fmt: skip
        self._caches = keeps
        self._weights: dict[tuple[int, bytes], RayWeights] = {}
        self._photon_weights: dict[tuple[int, bytes], PhotonWeights] = {}
        self._photons = no_nearby_photons(len(rows)) if landed is None else slice_nearby(landed, int(begin), int(end))
        self._second = SecondBounceWeights(self._samples, hits.position, records, self._photons.area, keeps)
        self._means = [mean_of_sample_sets(nth)] if nth.any() else []
        if smoothing is not None:
            first, last = np.searchsorted(object_of_rows(hits, gathered.points), (i_object, i_object + 1))
            self._means.append(smoothing.part(int(first), int(last)))
        self._hits, self._times, self._clearance = hits, records.times, gathered.clearance[begin:end]

    def __len__(self) -> int:
        return len(self._samples.rows)

    @property
    def n_steps(self) -> int:
        """The steps of one pass over all rays."""
        return -(-len(self) // (_PARTS * _PART * n_threads()))

    @property
    def n_bytes(self) -> int:
        """Memory of the stored weights."""
        of_photons = sum(weights.n_bytes for weights in self._photon_weights.values())
        return self._second.n_bytes + of_photons + sum(weights.n_bytes for weights in self._weights.values())

    def forget_all_but(self, layers: Sequence[LayerCurves]) -> None:
        """Drops stored weights of other layers than these: otherwise each roughness that a slider passes through would
        take as much memory as all rays."""
        present = {weights_key(layer.optics()) for layer in layers}
        self._weights = {key: weights for key, weights in self._weights.items() if key in present}
        self._photon_weights = {key: weights for key, weights in self._photon_weights.items() if key in present}

    def nearby_photons(
        self, photon_map: PhotonMap, i_object: int, farthest: NDArray[np.float32], caster: RayCaster
    ) -> Generator[None, None, NearbyPhotons]:
        """The photons near the points of the sample sets, no farther than (q,). A generator of steps."""
        return find_nearby_photons(
            photon_map, i_object, self._hits, self._samples, self._times, farthest, self._clearance, caster
        )

    def reflect(
        self, layers: Sequence[LayerCurves], light: OutgoingRadiance
    ) -> Generator[None, None, list[NDArray[np.float32]]]:
        """Radiance (p, D, 3) of each layer at the p points towards the camera, without f_q and f_o. A generator of
        steps."""
        return [each[:, 0] for each in (yield from self.reflect_halves(layers, light, 1))]

    def reflect_halves(
        self, layers: Sequence[LayerCurves], light: OutgoingRadiance, n_halves: int
    ) -> Generator[None, None, list[NDArray[np.float32]]]:
        """The same (p, n_halves, D, 3) by each half of the rays and photons, or by all of them for n_halves = 1."""
        out = [np.empty((len(self), n_halves, light.n_powers, 3), np.float32) for _ in layers]
        optics = [layer.optics(folded=True) for layer in layers]
        weights_of_layers = [self.weights_of(each) for each in optics]
        of_photons = [self._photon_weights_of(each) for each in optics]

        def work(begin: int, end: int, second: kernels.SecondBounce) -> None:
            for each, weights, photons, result in zip(optics, weights_of_layers, of_photons, out, strict=True):
                kernels.reflect(self._samples, begin, end, each, weights.part(begin, end), light.padded, second, result)
                if light.caustics is not None:
                    near = photons.part(begin, end, light.caustics.directions)
                    reflect_photons(begin, end, each, self._photons, near, light.caustics, result)

        yield from self._in_parts(light, work, weights_of_layers, of_photons)
        for layer, result in zip(layers, out, strict=True):
            if layer.is_tinted:
                result *= layer.tint.astype(np.float32)
        return [reduce(mean_rows, self._means, clamp_radiance(each)) for each in out]

    def by_band(
        self, layer: LayerCurves, factor: int, light: OutgoingRadiance
    ) -> Generator[None, None, NDArray[np.float32]]:
        """Radiance of one layer by band of its first or second curve: (3, J, D, p). Multiplied by the curve and summed
        over J it equals `reflect`. A generator of steps."""
        out = np.empty((3, len(layer.curves[factor]), light.n_powers, len(self)), np.float32)
        optics = layer.optics()
        weights, photons = self.weights_of(optics), self._photon_weights_of(optics)

        def work(begin: int, end: int, second: kernels.SecondBounce) -> None:
            stored_weights = weights.part(begin, end)
            kernels.reflect_bands(
                self._samples, begin, end, optics, factor == 0, stored_weights, light.padded, second, out
            )
            if light.caustics is not None:
                near = photons.part(begin, end, light.caustics.directions)
                reflect_photon_bands(begin, end, optics, factor == 0, self._photons, near, light.caustics, out)

        yield from self._in_parts(light, work, [weights], [photons])
        if layer.is_tinted:
            out *= layer.tint.astype(np.float32)[:, None, None, None]
        out = clamp_radiance(out)
        for means in self._means:
            yield
            out = _mean_planes(out, means)
        return out

    def receives(self, gloss: EditedGloss, light: OutgoingRadiance) -> tuple[bool, bool]:
        """Whether light of an edited curve reaches any of the points, and any that met it twice."""
        once, twice = False, False
        if light.glossy is not None:
            once, twice = self._second.vertices_on(gloss.i_object, light.glossy)
        return once or bool(gloss.light[self._photons.photon].any()), twice

    def of_edited(
        self, receivers: Sequence[Receiver], light: OutgoingRadiance, gloss: EditedGloss
    ) -> Generator[None, None, list[NDArray[np.float32]]]:
        """Radiance (3, ..., p) of each receiving layer of the light of an edited curve, see `Receiver`. Follows a
        `reflect` of the same light. A generator of steps."""
        out = [np.zeros((3, *each.shape, len(self)), np.float32) for each in receivers]
        weights = [self.weights_of(each.optics) for each in receivers]
        step = _PARTS * _PART * n_threads()

        def add(begin: int) -> None:
            end = min(begin + _PART, len(self))
            self._add_edited(begin, end, receivers, weights, light, gloss, [each[..., begin:end] for each in out])

        for begin in range(0, len(self), step):
            on_threads(add, range(begin, min(begin + step, len(self)), _PART))
            yield
        for i, each in enumerate(receivers):
            if each.layer.is_tinted:
                out[i] = (out[i].T * each.layer.tint.astype(np.float32)).T
            out[i] = clamp_radiance(out[i])
            for means in self._means:
                yield
                out[i] = _mean_planes(out[i], means)
        return out

    def effect_by_band(
        self, layers: Sequence[LayerCurves], gains: Sequence[NDArray[np.floating]], light: OutgoingRadiance,
        gloss: EditedGloss,
    ) -> NDArray[np.float64]:  # fmt: skip
        """The same times f_q of each layer, gains (3,), summed over all points and layers, by band, (J, 3): estimated
        from every sixteenth of the points."""
        receivers = [KnotReceiver(layer, knot_table(all_knots(gloss.n_bands), gloss.n_bands)) for layer in layers]
        weights = [self.weights_of(each.optics) for each in receivers]
        n = min(_PILOT, len(self))
        starts = range(0, max(len(self) - n, 0) + 1, _EVERY * n)
        total = np.zeros((len(starts), gloss.n_bands, 3))

        def add(i: int) -> None:
            out = [np.zeros((3, *each.shape, n), np.float32) for each in receivers]
            self._add_edited(starts[i], starts[i] + n, receivers, weights, light, gloss, out)
            for each, receiver, gain in zip(out, receivers, gains, strict=True):
                total[i] += np.abs(clamp_radiance(each)).sum(axis=2, dtype=np.float64).T * receiver.layer.tint * gain

        on_threads(add, range(len(starts)))
        return total.sum(axis=0) * (len(self) / max(n * len(starts), 1))

    def _add_edited(
        self, begin: int, end: int, receivers: Sequence[Receiver], weights: Sequence[RayWeights],
        light: OutgoingRadiance, gloss: EditedGloss, out: Sequence[NDArray[np.float32]],
    ) -> None:  # fmt: skip
        """Adds the points [begin, end) to out (3, ..., end - begin)."""
        if light.glossy is not None:
            missing = np.full(len(light.glossy.digests), self._second.is_uncached)
            edited = self._second.edited(begin, end, light.glossy, gloss, missing)
            for each, stored_weights, part in zip(receivers, weights, out, strict=True):
                each.reflect(self._samples, begin, end, stored_weights.part(begin, end), edited, part)
        if light.caustics is not None:
            for each, part in zip(receivers, out, strict=True):
                near = self._photon_weights_of(each.optics).part(begin, end, light.caustics.directions)
                each.reflect_photons(begin, end, self._photons, near, gloss, part)

    def stored_paths(self, light: SecondBounceLight) -> second_kernels.GlossyPaths:
        """The stored rays that end on glossy surfaces."""
        return self._second.paths(light)

    def weights_of(self, optics: kernels.ReflectingLayer) -> RayWeights:
        """The stored weights of a layer, or new ones."""
        key = weights_key(optics)
        cached = self._weights.get(key)
        if cached is not None and cached.n_angles >= n_angles_of(optics):
            return cached
        made = RayWeights(self._samples, self._surface_of(optics), optics, self._caches)
        if self._caches:
            self._weights[key] = made
        return made

    def _surface_of(self, optics: kernels.ReflectingLayer) -> ViewedPoints:
        """The points in the frame of a layer, which need not be that of the rays."""
        hits = self._hits.in_frame(frame_of(optics.q))
        return ViewedPoints(hits.position, hits.tangent, hits.normal, hits.wo)

    def _photon_weights_of(self, optics: kernels.ReflectingLayer) -> PhotonWeights:
        """The same of photons."""
        key = weights_key(optics)
        cached = self._photon_weights.get(key)
        if cached is not None and cached.n_angles >= n_angles_of(optics):
            return cached
        made = PhotonWeights(self._samples, self._photons, self._surface_of(optics), optics, self._caches)
        if self._caches:
            self._photon_weights[key] = made
        return made

    def _in_parts(
        self, light: OutgoingRadiance, work: Callable[[int, int, kernels.SecondBounce], None],
        weights_of_layers: Sequence[RayWeights], of_photons: Sequence[PhotonWeights],
    ) -> Generator[None, None, None]:  # fmt: skip
        """Calls `work` on parts of the points with their second-bounce light, some parts per step; then marks the
        weights as complete."""
        glossy, step = light.glossy, _PARTS * _PART * n_threads()
        none = np.zeros((0, light.n_powers, 4), np.float32)
        no_second = kernels.SecondBounce(np.zeros(len(self) + 1, np.int64), np.zeros(0, np.uint16), none, 0)

        def do(missing: NDArray[np.bool_] | None, begin: int) -> None:
            end = min(begin + _PART, len(self))
            second = no_second
            if glossy is not None and missing is not None:
                second = self._second.part(begin, end, glossy, missing)
            work(begin, end, second)

        for begin in range(0, len(self), step):
            missing = None if glossy is None else self._second.missing_objects(glossy, begin)
            on_threads(partial(do, missing), range(begin, min(begin + step, len(self)), _PART))
            if glossy is not None:
                self._second.complete(glossy, begin)
            yield
        for weights in weights_of_layers:
            weights.complete()
        for photons in of_photons if light.caustics is not None else ():
            photons.complete()


def mean_rows(light: NDArray[np.float32], means: Smoothing) -> NDArray[np.float32]:
    """Means (p, D, 3) of light (q, D, 3); q may be 0."""
    values = light.reshape(len(light), math.prod(light.shape[1:]))
    out = np.empty((means.n_rows, values.shape[1]), np.float32)
    kernels.smooth_rows(*means, values, out)
    return out.reshape(len(out), *light.shape[1:])


def _mean_planes(light: NDArray[np.float32], means: Smoothing) -> NDArray[np.float32]:
    """Means (..., p) of light (..., q); q may be 0."""
    planes = light.reshape(math.prod(light.shape[:-1]), light.shape[-1])
    out = np.empty((len(planes), means.n_rows), np.float32)
    on_threads(lambda begin, end: kernels.smooth_planes(*means, planes, begin, end, out), *even_parts(len(planes)))
    return out.reshape(*light.shape[:-1], means.n_rows)
