"""Precomputed indirect light of one view, evaluated for any materials. `gather_polynomial` freezes it for edits."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.core.clamping import SQUARED, clamp_radiance, unscaled
from engine.core.generators import run_to_end
from engine.precompute.indirect._light_choice_kernels import SampledLights
from engine.precompute.indirect._ray_kernels import NORMAL
from engine.precompute.indirect.frozen_light import SelectedCurve
from engine.precompute.indirect.gather import GatherSamples, SampleCounts, object_of_rows
from engine.precompute.indirect.indirect_layers import IndirectLayer, albedos_of, is_glossy, view_factors
from engine.precompute.indirect.irradiance_cache import NO_OBJECT, CacheLight, IrradianceCache, radiosity
from engine.precompute.indirect.photons import (
    NearbyPhotons,
    PhotonFlux,
    PhotonMap,
    Photons,
    farthest_of,
    join_nearby,
    photon_flux,
)
from engine.precompute.indirect.ray_budget import RayBudget
from engine.precompute.indirect.record_maps import RecordReflectance
from engine.precompute.indirect.reflection import HemisphereSamples, OutgoingRadiance
from engine.precompute.indirect.second_bounce import (
    SecondBounceLight,
    glossy_tables,
    inverse_albedo,
    layer_digests,
    outgoing_radiosity,
)
from engine.precompute.indirect.smoothing import Smoothing, least_alike, smoothing_for
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene

Footprint = tuple[NDArray[np.int32], NDArray[np.float32]]
SamplesOf = Callable[[int], HemisphereSamples]


@dataclass(frozen=True, eq=False)
class GatherPoints:
    """The gather points of a picture. samples: their hemisphere samples; lobe_axes (M,) and sizes: how each object is
    sampled; axes (M, 3, 3) of the objects; glossy: whether rays were stored for the glossy second bounce; photons from
    glossy surfaces, and `landed`, those near the points; smoothing: the filter that removes noise from the reflected
    light, None for none; lights_gloss: whether the lights reach glossy surfaces directly, and photons count;
    thrice: whether light was stored where a third glossy surface reflects it; is_part: see `IndirectLight.part`."""

    hits: PrimaryHits
    samples: GatherSamples
    lobe_axes: NDArray[np.int64]
    sizes: tuple[SampleCounts, ...]
    axes: NDArray[np.float32]
    glossy: bool
    photons: Photons
    landed: NearbyPhotons
    smoothing: Smoothing | None = None
    lights_gloss: bool = True
    thrice: bool = True
    is_part: bool = False

    @property
    def n_bytes(self) -> int:
        """Memory of rays, photons and filter."""
        arrays = (*self.photons, *self.landed, *(self.smoothing or ()))
        return self.samples.n_bytes + sum(array.nbytes for array in arrays)

    def hemisphere_samples(self, i_object: int, keeps: bool = False) -> HemisphereSamples:
        """The hemisphere samples of one object; keeps: see `HemisphereSamples`."""
        lobe_axis, size = int(self.lobe_axes[i_object]), self.sizes[i_object]
        return HemisphereSamples(self.hits, self.samples, i_object, lobe_axis, size, keeps, self.landed, self.smoothing)

    def with_photons(self, photon_map: PhotonMap, scene: Scene, caster: RayCaster) -> GatherPoints:
        """The same with the photons near its points."""
        return replace(self, landed=run_to_end(self.nearby_photons(photon_map, scene, caster)))

    def nearby_photons(
        self, photon_map: PhotonMap, scene: Scene, caster: RayCaster
    ) -> Generator[None, None, NearbyPhotons]:
        """The photons near its points. A generator of steps."""
        farthest = farthest_of(scene, self.hits, self.samples.rows)
        objects, parts = object_of_rows(self.hits, self.samples.rows), list[NearbyPhotons]()
        for i in range(len(self.lobe_axes)):
            samples = self.hemisphere_samples(i)
            parts.append((yield from samples.nearby_photons(photon_map, i, farthest[objects == i], caster)))
        return join_nearby(parts)

    def caustic_flux(self, layers: Sequence[IndirectLayer], edited: int = NO_OBJECT) -> PhotonFlux:
        """The flux of the photons under these layers."""
        tables = glossy_tables(layers, self.lobe_axes, self.axes)
        return photon_flux(self.photons, tables, edited, self._inverse(layers, edited))

    def outgoing_radiance(
        self, radiosities: tuple[NDArray[np.float32], NDArray[np.float32]], objects: NDArray[np.int32],
        layers: Sequence[IndirectLayer], reflectance: RecordReflectance, all_lights: SampledLights,
        edited: int = NO_OBJECT,
    ) -> OutgoingRadiance:  # fmt: skip
        """Radiance that records of the given objects (C,) send on under these layers. radiosities (C, D, 3): by diffuse
        layers, and beyond glossy ones. edited: the object whose gloss keeps its shape, and changes with its albedo."""
        diffuse, beyond = radiosities
        if not self.glossy:
            return OutgoingRadiance(diffuse, None, None)
        n_objects = len(self.lobe_axes)
        second = glossy_tables(layers, self.lobe_axes, self.axes, reflectance)
        has_third = any(each.third_curves is not None for each in layers)
        third = glossy_tables(layers, self.lobe_axes, self.axes, reflectance, True) if has_third else second
        inverse = self._inverse(layers, edited)
        digests, per_area = layer_digests(layers, n_objects, reflectance), self.photons.per_area
        glossy = SecondBounceLight(
            objects, outgoing_radiosity(beyond, inverse), per_area, digests, second, third, all_lights, edited,
            inverse, self.lights_gloss, self.is_part,
        )  # fmt: skip
        return OutgoingRadiance(diffuse, glossy, self.caustic_flux(layers, edited) if self.lights_gloss else None)

    def _inverse(self, layers: Sequence[IndirectLayer], edited: int) -> NDArray[np.float32]:
        """The reciprocal albedo (3,) of the edited object, 1 where none is edited."""
        if edited == NO_OBJECT:
            return np.ones(3, np.float32)
        return inverse_albedo(albedos_of(layers, len(self.lobe_axes))[edited])

    def reflect(
        self, layers: Sequence[IndirectLayer], light: OutgoingRadiance
    ) -> Generator[None, None, NDArray[np.float32]]:
        """Radiance (p, 3) towards the camera for light without an edited object. A generator of steps."""
        return clamp_radiance((yield from self._seen(layers, light, 1, self.hemisphere_samples))[0])

    def halves(
        self, layers: Sequence[IndirectLayer], light: OutgoingRadiance, samples_of: SamplesOf | None = None
    ) -> Generator[None, None, NDArray[np.float32]]:
        """Radiance (2, p, 3) by each half of the rays, clamped so that its square is finite. A generator of steps.
        samples_of: the hemisphere samples of an object, where they are kept."""
        return clamp_radiance((yield from self._seen(layers, light, 2, samples_of or self.hemisphere_samples)), SQUARED)

    def _seen(
        self, layers: Sequence[IndirectLayer], light: OutgoingRadiance, n_halves: int, samples_of: SamplesOf
    ) -> Generator[None, None, NDArray[np.float32]]:
        """Radiance (n_halves, p, 3) towards the camera, see `HemisphereSamples.reflect_halves`."""
        rows = self.samples.points
        out, objects = np.zeros((n_halves, len(rows), 3), np.float32), object_of_rows(self.hits, rows)
        for i_object in sorted({layer.i_object for layer in layers}):
            mine = np.flatnonzero(objects == i_object)
            own = [layer for layer in layers if layer.i_object == i_object]
            found = yield from samples_of(i_object).reflect_halves([layer.curves for layer in own], light, n_halves)
            for layer, reflected in zip(own, found, strict=True):
                with np.errstate(over="ignore"):
                    out[:, mine] += reflected[:, :, 0].swapaxes(0, 1) * view_factors(self.hits, rows[mine], layer)
            yield None
        return out


@dataclass(frozen=True, eq=False)
class IndirectLight:
    """Indirect light of a picture. footprint: four gather points of each point of the picture, by number, and their
    weights, (P, 4) each; ranges (M, 2): those of the objects among these P, where the picture is not that of the gather
    points, None where it is; light: between the records, for up to n_bounces reflections; all_lights: sky and emitters.
    Everything is in units of `unit`, except pictures. ray_budget: rays per sample set, with the reason."""

    points: GatherPoints
    footprint: Footprint
    cache: IrradianceCache
    light: CacheLight
    all_lights: SampledLights
    n_bounces: int
    unit: float
    ray_budget: RayBudget
    ranges: NDArray[np.int32] | None = None

    @property
    def n_bytes(self) -> int:
        found = self.points.n_bytes + sum(a.nbytes for a in self.footprint)
        return found + self.cache.n_bytes + self.light.n_bytes

    def without_glossy_hits(self) -> IndirectLight:
        """The same without glossy hits: from the second bounce on, all surfaces reflect by albedo."""
        return replace(self, points=replace(self.points, glossy=False))

    def part(self, shares: NDArray[np.float32], direct: NDArray[np.float32]) -> IndirectLight:
        """What a part of the lights makes of it, along the same rays. shares (G, L, 3): of the lights, see
        `SampledLights`; direct: irradiance of the records by that part, see `CacheLight`."""
        photons, whole = self.points.photons, self.all_lights
        at = whole.groups[photons.sources], photons.lights
        power = np.zeros_like(photons.power)
        np.divide(photons.power * shares[at], whole.shares[at], out=power, where=whole.shares[at] > 0.0)
        points = replace(self.points, photons=photons._replace(power=power), is_part=True)
        light, lights = replace(self.light, direct=direct), whole._replace(shares=shares)
        return replace(self, points=points, light=light, all_lights=lights)

    def footprint_by_object(self) -> Footprint:
        """The footprint with gather points numbered within each object."""
        rows, weights = self.footprint
        own_ranges = self.points.hits.object_ranges
        ranges = own_ranges if self.ranges is None else self.ranges
        firsts = np.searchsorted(self.points.samples.points, own_ranges[:, 0])
        own = np.repeat(firsts, ranges[:, 1] - ranges[:, 0])[:, None]
        return np.asarray(np.where(weights > 0.0, rows - own, 0), np.int32), weights

    def curve_rows(
        self, bands: NDArray[np.floating], albedo: NDArray[np.float64], rows: NDArray[np.integer]
    ) -> NDArray[np.float64]:
        """The radiance (J, n, 3), without f_q and f_o and in this light's unit, that rows (n,) of the picture's points
        reflect for a 1 in each band of a curve. bands: F (3, J, D, p) at the gather points of its object, whose
        equivalent albedo is albedo (3,), see `frozen_light`."""
        # Which gather points stand for these points of the picture.
        numbers, weights = (part[rows] for part in self.footprint_by_object())
        points, at = np.unique(numbers, return_inverse=True)
        # Powers of the albedo are summed there, and these sums are interpolated.
        powers = albedo ** np.arange(bands.shape[2])[:, None]
        at_points = np.einsum("nc,cjnp->cjp", powers, bands[..., points].astype(np.float64))
        seen = at_points[:, :, at.reshape(numbers.shape)]
        return np.asarray(np.einsum("pk,cjpk->jpc", weights.astype(np.float64), seen))

    def with_smoothing(self, smoothing: Smoothing | None) -> IndirectLight:
        """The same with this filter, None for none."""
        return replace(self, points=replace(self.points, smoothing=smoothing))

    def smoothed(self, layers: Sequence[IndirectLayer]) -> Generator[None, None, IndirectLight]:
        """The same with the filter that the noise under these layers requires. A generator of steps."""
        return self.filtered((yield from self.unfiltered_halves(layers)))

    def unfiltered_halves(self, layers: Sequence[IndirectLayer]) -> Generator[None, None, NDArray[np.float32]]:
        """Radiance (2, p, 3) by each half of the rays without the filter. A generator of steps."""
        points, light = self.with_smoothing(None).points, self.outgoing_radiance(layers)
        return (yield from points.halves(layers, light))

    def filtered(self, halves: NDArray[np.float32]) -> IndirectLight:
        """The same with the filter that the noise in these halves requires."""
        turns = least_alike(self.points.lobe_axes != NORMAL)
        smoothing = smoothing_for(self.points.hits, self.points.samples.points, turns, *halves)
        return self.with_smoothing(smoothing)

    def radiosity(self, layers: Sequence[IndirectLayer], edited: int = NO_OBJECT) -> NDArray[np.float32]:
        """Radiosity (C, D, 3) of the records under these layers, see `irradiance_cache.radiosity`."""
        return self._radiosities(layers, self._reflectance(layers), edited)[0]

    def _reflectance(self, layers: Sequence[IndirectLayer]) -> RecordReflectance:
        return self.cache.maps.reflectance(layers, len(self.points.lobe_axes))

    def _radiosities(
        self, layers: Sequence[IndirectLayer], reflectance: RecordReflectance, edited: int
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        albedos = albedos_of(layers, len(self.points.lobe_axes))
        # Glossy hits account for the direct light that glossy surfaces reflect.
        apart = self.points.glossy, self.points.thrice
        return radiosity(self.light, albedos, self.n_bounces, reflectance, edited, *apart)

    def outgoing_radiance(
        self, layers: Sequence[IndirectLayer], edited: int = NO_OBJECT, curves: Sequence[SelectedCurve] = ()
    ) -> OutgoingRadiance:
        """Radiance that surfaces send towards the gather points under these layers. curves: of the object `edited`,
        whose light at the second bounce is computed apart, see `edited_gloss`; without any, its shape stays."""
        reflectance = self._reflectance(layers)
        radiosities = self._radiosities(layers, reflectance, edited)
        objects, all_lights = self.light.objects, self.all_lights
        if not self.points.glossy:
            return self.points.outgoing_radiance(radiosities, objects, layers, reflectance, all_lights)
        if not curves:
            bright, beyond = radiosities
            apart = bright * reflectance.diffuse[:, None], beyond
            return self.points.outgoing_radiance(apart, objects, layers, reflectance, all_lights, edited)
        apart = self._diffuse_radiosities(radiosities, layers, reflectance, edited, curves)
        return self.points.outgoing_radiance(apart, objects, layers, reflectance, all_lights)

    def _diffuse_radiosities(
        self, radiosities: tuple[NDArray[np.float32], NDArray[np.float32]], layers: Sequence[IndirectLayer],
        reflectance: RecordReflectance, edited: int, curves: Sequence[SelectedCurve],
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:  # fmt: skip
        """Radiosities (C, D, 3) of the diffuse layers, and beyond glossy ones, where the albedo d of the object
        `edited` varies by these curves alone: its diffuse layers reflect α d + β, with what is not edited in β."""
        bright, beyond = radiosities
        diffuse, beyond = bright * reflectance.diffuse[:, None], beyond.copy()
        are_glossy = {is_glossy(layers[each.layer]) for each in curves}
        own = np.flatnonzero(self.light.objects == edited)
        if len(are_glossy) > 1 or not len(own):
            return diffuse, beyond
        albedo = albedos_of(layers, len(self.points.lobe_axes))[edited].astype(np.float32)
        share = reflectance.diffuse[own]
        factor, rest = (0.0, share * albedo) if True in are_glossy else (1.0, (share - 1.0) * albedo)
        diffuse[own] = np.float32(factor) * bright[own]
        diffuse[own, :-1] += rest[:, None] * bright[own, 1:]
        if self.n_bounces > 2:  # light from the lights, of which `beyond` has the diffuse share
            direct = self.light.irradiance[own] * reflectance.relative[own]
            beyond[own, 0] += rest * direct
            beyond[own, 1] += (factor - share) * direct
        return clamp_radiance(diffuse), clamp_radiance(beyond)

    def at_points(self, layers: Sequence[IndirectLayer]) -> NDArray[np.float32]:
        """Indirect radiance (p, 3) of all gather points."""
        return unscaled(run_to_end(self.points.reflect(layers, self.outgoing_radiance(layers))), self.unit)

    def noise(
        self, layers: Sequence[IndirectLayer], samples_of: SamplesOf | None = None
    ) -> Generator[None, None, tuple[float, float]]:
        """RMS noise of the picture relative to its mean, and that mean. The two halves differ by twice the noise. A
        generator of steps. samples_of: see `GatherPoints.halves`.

        The bias of the filter is not included.
        """
        light, (rows, weights) = self.outgoing_radiance(layers), self.footprint
        if not len(rows):  # nothing in the picture reflects
            return 0.0, 0.0
        halves = yield from self.points.halves(layers, light, samples_of)
        first, second = (np.einsum("pk,pkc->pc", weights, found[rows]) for found in halves)
        mean = 0.5 * float(np.mean(first + second, dtype=np.float64))
        rms = 0.5 * float(np.sqrt(np.mean((first - second) ** 2, dtype=np.float64)))
        return (rms / mean if mean > 0.0 else 0.0), mean * self.unit

    def picture(self, layers: Sequence[IndirectLayer]) -> NDArray[np.float32]:
        """Indirect radiance (P, 3) of all points of the picture."""
        found = run_to_end(self.points.reflect(layers, self.outgoing_radiance(layers)))
        rows, weights = self.footprint
        return unscaled(np.einsum("pk,pkc->pc", weights, found[rows]), self.unit)
