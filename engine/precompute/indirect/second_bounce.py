"""The glossy second bounce: stores rays for it and evaluates them for any curves.

An equivalent albedo distributes over all directions what a glossy surface reflects into a lobe. Seen in another
surface, this is where its light is most wrong. Therefore two more rays are traced for each hemisphere sample that ends
on a glossy surface, stored in 28 bytes, and the glossy layers there are evaluated with their curves at each freezing. A
third glossy reflection of the lights is stored in as many bytes again: between copper and copper a fifth of that light
was missing when it used the albedo. Light with more reflections uses the albedo.

While the user drags a curve, the light reflected by its own object keeps its shape and scales with the albedo; it is
evaluated anew when idle.
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.material import kinds
from engine.precompute.indirect import _light_choice_kernels as light_choice
from engine.precompute.indirect import _second_bounce_kernels as kernels
from engine.precompute.indirect._cache_kernels import NO_RECORD, Hits
from engine.precompute.indirect._gloss_kernels import GlossyLayers
from engine.precompute.indirect.direction_patterns import lobe_tables
from engine.precompute.indirect.indirect_layers import IndirectLayer, is_glossy
from engine.precompute.indirect.irradiance_cache import NO_ORDER, IrradianceCache, Rays
from engine.precompute.indirect.record_maps import RecordReflectance
from engine.scene.raycaster import Intersections
from engine.scene.tangents import TangentRotations

N_LOBE_RAYS = 1024
_LEAST_ALBEDO = 1e-6


def no_glossy_hits(n_points: int) -> kernels.GlossyHits:
    """Glossy hits of points none of whose rays ends on a glossy surface."""
    none, floats = np.zeros(0, np.uint16), np.zeros(0, np.float32)
    start, normal = np.zeros(n_points + 1, np.int64), np.zeros((0, 3), np.float32)
    times = np.ones(n_points, np.float32)
    codes = np.zeros(0, np.uint8)
    lit = normal, codes, floats, none, codes, floats
    return kernels.GlossyHits(start, times, none, *lit, none, *lit)


def join_glossy_hits(parts: Sequence[kernels.GlossyHits], order: NDArray[np.integer]) -> kernels.GlossyHits:
    """The glossy hits of several sets of points, concatenated, with the points in this order."""
    ends = np.cumsum([0, *(part.start[-1] for part in parts)])
    firsts = np.concatenate([part.start[:-1] + end for part, end in zip(parts, ends, strict=False)])[order]
    counts = np.concatenate([np.diff(part.start) for part in parts])[order]
    start = np.concatenate([[0], np.cumsum(counts)])
    taken = np.repeat(firsts - start[:-1], counts) + np.arange(start[-1])
    times = np.concatenate([part.times for part in parts])[order]
    fields = zip(*(part[2:] for part in parts), strict=True)
    return kernels.GlossyHits(start, times, *(np.concatenate(arrays)[taken] for arrays in fields))


def _thin(
    which: NDArray[np.intp], n_rays: int, n_points: int, most: int
) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """At most `most` of each point's rays, evenly spaced, and how many rays each represents (p,)."""
    start = np.searchsorted(which, np.arange(n_points + 1) * n_rays)
    counts = np.diff(start)
    n_chosen = np.minimum(counts, most)
    ends = np.cumsum(n_chosen)
    place = np.arange(ends[-1] if n_points else 0) - np.repeat(ends - n_chosen, n_chosen)
    step = counts / np.maximum(n_chosen, 1)
    chosen = np.repeat(start[:-1], n_chosen) + ((place + 0.5) * np.repeat(step, n_chosen)).astype(np.int64)
    return which[chosen], np.maximum(step, 1.0).astype(np.float32)


@dataclass(frozen=True, eq=False)
class SecondBounceTracer:
    """Traces the rays of the second bounce. glossy (M,): which objects are glossy; lobe_axes (M,) and axes (M, 3, 3) of
    the objects; rotations of their tangents; all_lights: sky and emitters; most: the number of rays stored per gather
    point, of which each represents several if there are more; thrice: whether three glossy reflections of a light
    count."""

    glossy: NDArray[np.bool_]
    lobe_axes: NDArray[np.int64]
    axes: NDArray[np.float32]
    rotations: TangentRotations
    all_lights: light_choice.SampledLights
    most: int
    thrice: bool

    def trace(
        self, cache: IrradianceCache, rows: NDArray[np.int32], nth: NDArray[np.uint8], rays: Rays,
        seen: NDArray[np.uint16],
        found: Intersections, first_open: int = 0, turn: AbstractContextManager[None] = NO_ORDER,
    ) -> kernels.GlossyHits:  # fmt: skip
        """The glossy hits of a chunk of sample sets, the nth of the points `rows`: rays and their hits, (q · R).
        first_open, turn: see `IrradianceCache.records_hit`."""
        n_rays = len(seen) // max(len(rows), 1)
        which, times = _thin(self._on_glossy(cache, seen, found), n_rays, len(rows), self.most)
        vertex = _LightChooser(self, cache, rows, nth, n_rays)
        lit = vertex.choose(which, which, 2, rays, found)
        starts, to_lobe = np.empty((2, len(which), 3), np.float32)
        there = np.empty(len(which), bool)
        kernels.sample_lobe_rays(
            which, n_rays, rows, nth, _hits(found), lit[1], rays.origins, rays.directions, lit[0], cache.mesh,
            self.lobe_axes, self.axes, lobe_tables(N_LOBE_RAYS), np.float32(cache.caster.offset), to_lobe, starts,
            there,
        )  # fmt: skip
        onward = Rays(starts, to_lobe, there)
        beyond, found_3 = cache.records_and_hits(onward, first_open, turn=turn)
        at = self._on_glossy(cache, beyond, found_3) if self.thrice else np.zeros(0, np.int64)
        lit_3 = _scatter(vertex.choose(which[at], at, 3, onward, found_3), at, len(which))
        start = np.searchsorted(which, np.arange(len(rows) + 1) * n_rays)
        return kernels.GlossyHits(start, times, (which % n_rays).astype(np.uint16), *lit, beyond, *lit_3)

    def _on_glossy(self, cache: IrradianceCache, seen: NDArray[np.uint16], found: Intersections) -> NDArray[np.intp]:
        """The indices of rays that end on glossy surfaces."""
        ends = np.where(seen == NO_RECORD, -1, cache.mesh.objects[found.triangle])
        return np.flatnonzero((ends >= 0) & self.glossy[ends])


def _hits(found: Intersections) -> Hits:
    return Hits(found.triangle, found.u, found.v, found.distance)


def _scatter(places: light_choice.LitPlaces, at: NDArray[np.intp], n: int) -> light_choice.LitPlaces:
    """Spreads the given vertices to the indices `at` among n; no light at the others."""
    normal, turn, distance, light, candidate, weight = (np.zeros((n, *each.shape[1:]), each.dtype) for each in places)
    light[:] = light_choice.NO_LIGHT
    for all_of_them, each in zip((normal, turn, distance, light, candidate, weight), places, strict=True):
        all_of_them[at] = each
    return normal, turn, distance, light, candidate, weight


@dataclass(frozen=True, eq=False)
class _LightChooser:
    """Chooses lights at vertices of a chunk of sample sets: the nth sets of the points `rows`, n_rays each."""

    second: SecondBounceTracer
    cache: IrradianceCache
    rows: NDArray[np.int32]
    nth: NDArray[np.uint8]
    n_rays: int

    def choose(
        self, which: NDArray[np.intp], at: NDArray[np.intp], vertex: int, rays: Rays, found: Intersections
    ) -> light_choice.LitPlaces:
        """For rays `at` (n,), which continue the samples `which` (n,): normals (n, 3), codes of the tangents' maps and
        distances (n,) of their hits, the unoccluded lights (n,), their candidate numbers and weights (n,)."""
        n, caster = len(which), self.cache.caster
        normals, to_light, starts = np.empty((3, n, 3), np.float32)
        lights, candidates = np.empty(n, np.uint16), np.empty(n, np.uint8)
        weights, limits = np.empty((2, n), np.float32)
        turns = self.second.rotations.codes(found.of(at))
        light_choice.choose_lights(
            which, at, vertex, self.n_rays, self.rows, self.nth, _hits(found), turns, rays.origins, rays.directions,
            self.cache.mesh, self.second.lobe_axes, self.second.axes, self.second.all_lights, lobe_tables(N_LOBE_RAYS),
            np.float32(caster.offset), normals, lights, candidates, weights, to_light, limits, starts,
        )  # fmt: skip
        requested = np.flatnonzero(weights > 0.0)
        blocked = np.ones(n, bool)
        blocked[requested] = caster.occluded(starts[requested], to_light[requested], limits[requested])
        lights[blocked] = light_choice.NO_LIGHT
        return normals, turns, found.distance[at].astype(np.float32), lights, candidates, weights


@dataclass(frozen=True, eq=False)
class SecondBounceLight:
    """The light that glossy surfaces reflect under certain curves. objects (C,) of the records; radiosity (2, C, D, 4):
    as it lights others, and as the edited object reflects it on; per_area (M,): photons emitted per square metre;
    digests (M): differ if an object's surface reflects differently; layers, layers_3, all_lights: tables of them, at
    the second and third bounce; edited: the edited object; inverse (3,): the reciprocal of its albedo; is_lit: whether
    the lights reach glossy surfaces directly; is_part: whether all_lights are a part of those that were found, and
    nothing of them is cached."""

    objects: NDArray[np.int32]
    radiosity: NDArray[np.float32]
    per_area: NDArray[np.float32]
    digests: tuple[bytes, ...]
    layers: GlossyLayers
    layers_3: GlossyLayers
    all_lights: light_choice.SampledLights
    edited: int
    inverse: NDArray[np.float32]
    is_lit: bool = True
    is_part: bool = False


def glossy_order(layers: Sequence[IndirectLayer]) -> list[int]:
    """The glossy layers, by their numbers among all, in the order of their tables: by object."""
    return sorted((i for i, each in enumerate(layers) if is_glossy(each)), key=lambda i: layers[i].i_object)


def glossy_tables(
    layers: Sequence[IndirectLayer], lobe_axes: NDArray[np.int64], axes: NDArray[np.float32],
    reflectance: RecordReflectance | None = None, at_third: bool = False,
) -> GlossyLayers:  # fmt: skip
    """Tables of the glossy layers at the second bounce, or at the third, ordered by object. reflectance: of the records
    under these layers, None to use the means of texture maps."""
    glossy = glossy_order(layers)
    chosen = [layers[i] for i in glossy]
    image = np.array([-1 if reflectance is None else reflectance.image[i] for i in glossy], np.int64)
    texels = np.zeros((0, 0, 3), np.float32) if reflectance is None else reflectance.texels
    first = np.searchsorted([each.i_object for each in chosen], np.arange(len(lobe_axes) + 1))
    reflecting = [at_third and each.third_curves or each.second_curves for each in chosen]
    curves = [[np.asarray(curve, np.float32) for curve in each.curves] for each in reflecting]
    none = np.zeros((0, 3), np.float32)
    lengths = np.array([[len(curve) for curve in (*pair, none)[:2]] for pair in curves], np.int64).reshape(-1, 2)
    begins = np.cumsum([0, *lengths.ravel()])[:-1].reshape(-1, 2)
    factors = [each.model.factors for each in reflecting]
    return GlossyLayers(
        first.astype(np.int64),
        np.array([each.model.number for each in reflecting], np.int64),
        np.array([pair[0].gamma for pair in factors], np.int64),
        np.array([pair[1].gamma if len(pair) > 1 else -1 for pair in factors], np.int64),
        np.array([each.bound_parameters for each in reflecting], float).reshape(-1,
        kinds.N_QUOTIENT_PARAMETERS),
        np.concatenate([none, *(curve for pair in curves for curve in pair)]),
        begins[:, 0].copy(), lengths[:, 0].copy(), begins[:, 1].copy(), lengths[:, 1].copy(),
        np.array([each.gain * each.second_curves.tint for each in chosen], np.float32).reshape(-1, 3),
        np.array([each.view_curve for each in chosen], np.float32).reshape(len(chosen), -1, 3) if chosen
        else np.ones((0, 2, 3), np.float32),
        lobe_axes, axes, image, texels,
    )  # fmt: skip


def layer_digests(layers: Sequence[IndirectLayer], n_objects: int, reflectance: RecordReflectance) -> tuple[bytes, ...]:
    """Bytes that identify what the reflection of each object's glossy layers depends on."""
    digests = [b""] * n_objects
    for each in filter(is_glossy, layers):
        arrays = (
            each.second_curves.quotient_parameters,
            *each.second_curves.curves,
            *(each.third_curves.curves if each.third_curves else ()),
            each.gain * each.second_curves.tint,
            each.view_curve,
        )
        digests[each.i_object] += b"".join(
            [each.second_curves.model.name.encode(), *(array.tobytes() for array in arrays)]
        )
        if not each.maps.is_plain:
            digests[each.i_object] += reflectance.digest
    return tuple(digests)


def diffuse_share(layers: Sequence[IndirectLayer], n_objects: int) -> NDArray[np.float32]:
    """The share (M, 3) of each object's albedo that its diffuse layers have; 1 where the albedo is 0."""
    diffuse, total = np.zeros((n_objects, 3)), np.zeros((n_objects, 3))
    for layer in layers:
        total[layer.i_object] += layer.albedo
        if not is_glossy(layer):
            diffuse[layer.i_object] += layer.albedo
    return np.where(total > _LEAST_ALBEDO, diffuse / np.maximum(total, _LEAST_ALBEDO), 1.0).astype(np.float32)


def outgoing_radiosity(radiosity: NDArray[np.float32], inverse: NDArray[np.float32]) -> NDArray[np.float32]:
    """Radiosity (C, D, 3), a polynomial in the edited object's albedo, as others reflect it and as that object reflects
    it: multiplied by its inverse albedo (3,) and moved to the next power; (2, C, D, 4)."""
    both = np.zeros((2, *radiosity.shape[:2], 4), np.float32)
    both[0, ..., :3] = radiosity
    both[1, :, 1:, :3] = radiosity[:, :-1] * inverse
    return both


def inverse_albedo(albedo: NDArray[np.floating]) -> NDArray[np.float32]:
    """1/d (3,), 0 where the object is black: its reflection then scales with the albedo alone."""
    return np.where(albedo > _LEAST_ALBEDO, 1.0 / np.maximum(albedo, _LEAST_ALBEDO), 0.0).astype(np.float32)
