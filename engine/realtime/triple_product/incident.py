"""Light times visibility at the shading points, in wavelets: depends on the light, but not on camera or curve.

The triple product of light, visibility and BRDF [Ma06, eq. 3] is computed in two steps, because its factors change at
different times. L·V is computed here, exactly, triangle by triangle, when the light changes; the product with the
BRDF's slices is computed in every frame. The n largest coefficients of L·V are stored. Truncating the product loses
less than truncating its factors (measured in docs/orbit.md), and a frame costs n multiplications a channel instead of a
traversal of three trees.

Diffuse objects need only irradiance and store nothing else. Irradiance includes the peaks; the coefficients do not,
because each peak is reflected in its own direction.

Distant light is looked up by direction, averaged over a disc the size of a triangle. Every shading point has its own
frame, so its triangles do not coincide with those of the environment. Tables of light for some frames with
interpolation between them [Ma06, 3.2] gave an error of 6 % on a teapot under a sunny sky, with as many frames as in the
paper, because each frame shows its own sun. A look-up for each triangle costs about as much as reading such tables, and
a rotating sky only rotates the look-ups. Averages over discs would spread the sun over several triangles, so the
brightest directions, the peaks, are split from the map as directional lights.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from engine.core.threads import on_threads
from engine.core.triangles import quarters
from engine.light.emitters import EmitterPatches
from engine.light.environment import LUMINANCE, Environment, triangle_integrals, upsample_interpolated
from engine.realtime.core.shading_points import ShadingPoints
from engine.realtime.triple_product import _incident_kernels as kernels
from engine.realtime.triple_product._incident_kernels import N_QUERIED
from engine.realtime.triple_product.visibility import LEVEL, Bits, upper_triangles
from engine.scene.raycaster import RayCaster
from engine.sphere.geodesic import geodesic, locate, triangle_first_moments, triangle_solid_angles

Float32Array = NDArray[np.float32]
_BATCH = 64
_COARSE_LEVEL = 2
_CHILDREN_SIDE = 384  # a quarter of a degree

MAP_SIDE = 256
_COARSE_TEXELS = 8  # texels of the map along a side that one texel of the coarse map covers
MAX_PEAKS = 96
_PARTS = 16  # parts of the texels that are averaged one by one
_FINE = 6  # level of the triangles that are averaged
# A triangle is a peak if its power is this many times the mean.
_PEAK = 4.0
# Directions in each of the peaks that are tested with rays.
N_PLACES = 16
_CUTS = 4  # times that a peak is split in four to find them


@dataclass(frozen=True, eq=False)
class Incident:
    """The light that points store, see `_incident_kernels.StoredLight`; slot (S,): the row of glossy points, −1 for
    others."""

    slot: NDArray[np.int32]
    stored: kernels.StoredLight

    @property
    def irradiance(self) -> Float32Array:
        """(S, 3) float32, W/m² if the light is in W/m²/sr: Σ power × cosine, peaks included."""
        return self.stored.irradiance

    @property
    def n_bytes(self) -> int:
        return self.slot.nbytes + sum(array.nbytes for array in self.stored)

    def coefficients(self, p: int) -> tuple[NDArray[np.int16], Float32Array]:
        """Numbers (n,) and values (n, 3) of the coefficients of point p."""
        words = self.stored.value[self.slot[p]].astype(np.uint32) << 16
        return self.stored.number[self.slot[p]], words.view(np.float32)


@dataclass(frozen=True, eq=False)
class SceneEmitters:
    """Emitters in the scene: L patches, and bits (S, ⌈L / 8⌉) of those that each point sees, as in
    `visibility.trace_patches`."""

    patches: EmitterPatches
    bits: Bits


class ReachingLight(NamedTuple):
    """What lights some objects (M,): the sky, and emitters in the scene, None for none."""

    objects: NDArray[np.bool_]
    sky: SkyMap
    emitters: SceneEmitters | None


def empty_incident(is_glossy: NDArray[np.bool_], n: int) -> Incident:
    """Allocate irradiance for S points, and n coefficients, 20 to 5,120, for those that are glossy (S,)."""
    n, n_glossy = min(max(n, kernels.N_ROOTS), geodesic(LEVEL).n_triangles), int(is_glossy.sum())
    slot = np.where(is_glossy, np.cumsum(is_glossy) - 1, -1).astype(np.int32)
    return Incident(slot, kernels.StoredLight(
        np.zeros((len(slot), 3), np.float32), np.zeros((len(slot), MAX_PEAKS // 8), np.uint8),
        np.zeros((n_glossy, n), np.int16), np.zeros((n_glossy, n, 3), np.uint16),
        np.full((n_glossy, kernels.N_PEAK_PLACES), -1, np.int16),
        np.zeros((n_glossy, kernels.N_PEAK_PLACES, 3), np.float32), np.zeros((n_glossy, 2, 3), np.float32),
    ))  # fmt: skip


def with_glossy_points(incident: Incident, new: NDArray[np.bool_], n_more: int = 0) -> Incident:
    """Extend by coefficients for points that become glossy (S,), and by n_more diffuse points."""
    slot, stored = incident.slot.copy(), incident.stored
    slot[new] = len(stored.number) + np.arange(new.sum())

    def grown(array: NDArray, n: int, value: int = 0) -> NDArray:
        return np.concatenate([array, np.full((n, *array.shape[1:]), value, array.dtype)]) if n else array

    n_new = int(new.sum())
    return Incident(grown(slot, n_more, -1), kernels.StoredLight(
        grown(stored.irradiance, n_more), grown(stored.peak_bits, n_more), grown(stored.number, n_new),
        grown(stored.value, n_new), grown(stored.peak_place, n_new, -1), grown(stored.peak_power, n_new),
        grown(stored.irradiance_gradient, n_new),
    ))  # fmt: skip


def copy_light(incident: Incident, which: NDArray[np.integer], other: Incident, theirs: NDArray[np.integer]) -> None:
    """Write to points (N,) the light that others (N,) store; glossy points are so in both, with as many
    coefficients."""
    is_glossy = incident.slot[which] >= 0
    slots, their_slots = incident.slot[which[is_glossy]], other.slot[theirs[is_glossy]]
    arrays: Iterable[tuple[NDArray, NDArray]] = zip(incident.stored, other.stored, strict=True)  # type: ignore[arg-type]
    for name, (mine, its) in zip(kernels.StoredLight._fields, arrays, strict=True):
        if name in ("irradiance", "peak_bits"):
            mine[which] = its[theirs]
        else:
            mine[slots] = its[their_slots]


def light_points(
    points: ShadingPoints, bits: Bits, sky: SkyMap, incident: Incident, emitters: SceneEmitters | None = None,
    which: NDArray[np.integer] | None = None, is_coarse: bool = False, peaks: NDArray[np.int16] | None = None,
) -> None:  # fmt: skip
    """Fill `incident` at all points, or at those in which (N,).

    bits: as from `visibility.trace_hemispheres`; is_coarse: by triangles of level 2, in a sixth of the time. Lamps are
    not distant: each point has its own directions and distances to them. peaks (S,): see `visible_peaks`.
    """
    requested = np.arange(len(points)) if which is None else np.asarray(which, np.int64)
    tables: Any = (
        kernel_places(points, bits, incident.slot, emitters, peaks),
        hemisphere(),
        kernel_lights(sky, emitters),
        incident.stored,
    )
    fill_range: Any = kernels.light_range

    def fill(start: int) -> None:
        fill_range(start, min(start + _BATCH, len(requested)), requested, is_coarse, *tables)

    on_threads(fill, range(0, len(requested), _BATCH))


def evenly_lit(
    points: ShadingPoints, bits: Bits, patches: EmitterPatches | None, patch_bits: Bits
) -> Float32Array:  # fmt: skip
    """Irradiance (S, 3) under three lights that depend on geometry alone: a uniform sky, all patches at equal radiance,
    and none."""
    found, none = np.zeros((len(points), 3), np.float32), np.zeros((0, 3), np.float32)
    white, black = np.ones((8, 8, 4), np.float32), np.zeros((8, 8, 4), np.float32)
    emitters = None
    if patches is not None:
        emitters = SceneEmitters(replace(patches, radiance=np.ones_like(patches.radiance)), patch_bits)
    for i, (sky, emitting) in enumerate(((white, None), (black, emitters))):
        if sky is white or emitting is not None:
            incident = empty_incident(np.zeros(len(points), bool), kernels.N_ROOTS)
            light_points(
                points, bits, SkyMap(sky, sky, 0.0, none, none, none[:, None]), incident, emitting, is_coarse=True
            )
            found[:, i] = incident.irradiance[:, 0]
    return found


def visible_peaks(
    points: ShadingPoints, caster: RayCaster, sky: SkyMap, which: NDArray[np.integer]
) -> NDArray[np.int16]:
    """Find the brightest peaks that points (N,) see, as bits (S,), −1 at all other points; caster: intersects the
    scene's triangles.

    The visibility bits would give this to 1.4 degrees, an error that can move the shadow of a slat beside it.
    """
    found, directions = np.full(len(points), -1, np.int16), sky.peak_direction[: kernels.N_QUERIED]
    found[which] = 0
    for s, direction in enumerate(directions):
        above = which[points.normal[which] @ direction > 0.0]
        free = ~caster.occluded(points.lifted[above], np.tile(direction, (len(above), 1)))
        found[above[free]] |= np.int16(1 << s)
    return found


def kernel_places(
    points: ShadingPoints, bits: Bits, slot: NDArray[np.int32], emitters: SceneEmitters | None,
    peaks: NDArray[np.int16] | None = None,
) -> kernels.Places:  # fmt: skip
    """Points in the kernels' form."""
    patch_bits = emitters.bits if emitters else np.zeros((len(points), 0), np.uint8)
    requested = np.full(len(points), -1, np.int16) if peaks is None else peaks
    return kernels.Places(points.position, points.frames, bits, patch_bits, slot, requested)


def kernel_lights(sky: SkyMap, emitters: SceneEmitters | None) -> kernels.Light:
    """Light in the kernels' form."""
    none = np.zeros((0, 3), np.float32)
    patches: Any = (none, none, none, np.zeros((0, 4), np.float32))
    if emitters is not None:
        own = emitters.patches
        patches = own.centre, own.normal, own.radiance * own.area[:, None], own.cones
    return kernels.Light(
        sky.map, sky.coarse_map, math.cos(sky.turn), math.sin(sky.turn), sky.peak_direction, sky.peak_power, *patches
    )


@lru_cache(maxsize=1)
def hemisphere() -> kernels.Hemisphere:
    """The triangles above the surface in the kernels' form."""
    above, sphere = upper_triangles(), geodesic(LEVEL)
    place = np.full(sphere.n_triangles, -1, np.int32)
    place[above] = np.arange(len(above))
    return kernels.Hemisphere(
        above, place, *_upper_triangles(LEVEL), *_upper_triangles(_COARSE_LEVEL), _children(place),
    )  # fmt: skip


def _upper_triangles(level: int) -> tuple[Float32Array, Float32Array, Float32Array]:
    """Directions (U, 3), solid angles (U,) and mean cosines (U,) of a level's triangles above the surface."""
    sphere = geodesic(level)
    above = sphere.centres[:, 1] > 0.0
    heights = triangle_first_moments(sphere.vertices[sphere.triangles])[:, 1] / sphere.solid_angles
    return tuple(  # type: ignore[return-value]
        np.ascontiguousarray(values[above], np.float32) for values in (sphere.centres, sphere.solid_angles, heights)
    )


def _children(place: NDArray[np.int32]) -> NDArray[np.int16]:
    """Make `Hemisphere.children` over the square in which the hemisphere's octahedron stands on its corners."""
    row, column = np.divmod(np.arange(_CHILDREN_SIDE**2), _CHILDREN_SIDE)
    total, difference = ((i + 0.5) / _CHILDREN_SIDE * 2.0 - 1.0 for i in (column, row))
    x, z = (total + difference) / 2.0, (total - difference) / 2.0
    y = np.maximum(1.0 - np.abs(x) - np.abs(z), 1e-9)
    child = locate(np.stack([x, y, z], axis=1), LEVEL + 1)
    found = 4 * place[child >> 2] + (child & 3)
    return found.reshape(_CHILDREN_SIDE, _CHILDREN_SIDE).astype(np.int16)


@dataclass(frozen=True, eq=False)
class SkyMap:
    """map (256, 256, 4) and coarse_map (32, 32, 4) float32: radiance by octahedral direction, without the peaks (the
    fourth channel is unused), to be rotated by `turn` radians counter-clockwise about +Y as seen from above.

    peak_direction (M, 3) and peak_power (M, 3) float32: the brightest triangles, rotated already; power is radiance
    times solid angle. peak_places (min(M, 8), 16, 3): directions in the brightest peaks, each for an equal share of the
    power, neighbours in order.
    """

    map: Float32Array
    coarse_map: Float32Array
    turn: float
    peak_direction: Float32Array
    peak_power: Float32Array
    peak_places: Float32Array


def make_sky(environment: Environment | None, rotation: float, scale: float = 1.0) -> SkyMap:
    """Make the sky of an environment rotated by `rotation` degrees, times scale; black without an environment."""
    averaged, coarse, directions, power, places = _map_and_peaks(environment)
    turn = math.radians(rotation % 360.0)
    if scale != 1.0:
        averaged, coarse, power = averaged * np.float32(scale), coarse * np.float32(scale), power * np.float32(scale)
    return SkyMap(averaged, coarse, turn, _rotated(directions, turn), power, _rotated(places, turn))


def _rotated(directions: Float32Array, turn: float) -> Float32Array:
    """Rotate directions (..., 3) counter-clockwise about +Y as seen from above."""
    x, y, z = np.moveaxis(directions, -1, 0)
    rotated = np.stack([math.cos(turn) * x + math.sin(turn) * z, y, math.cos(turn) * z - math.sin(turn) * x], axis=-1)
    return rotated.astype(np.float32)


@lru_cache(maxsize=8)  # of a scene whose suns do not reach all objects there are several
def _map_and_peaks(
    environment: Environment | None,
) -> tuple[Float32Array, Float32Array, Float32Array, Float32Array, Float32Array]:
    """Make map and coarse map, and the directions, powers and places of the peaks, of an environment that is not
    rotated."""
    fine = geodesic(_FINE)
    powers = np.zeros((fine.n_triangles, 3))
    if environment is not None:
        environment = upsample_interpolated(environment)
        powers = triangle_integrals(environment, 0.0, _FINE)
    peaks = _find_peaks(powers)
    rest = powers.copy()
    rest.reshape(-1, 4, 3)[peaks] = 0.0
    averaged = np.zeros((MAP_SIDE, MAP_SIDE, 4), np.float32)
    averaged[..., :3] = np.concatenate([_averaging_matrix(part) @ rest for part in range(_PARTS)]).reshape(
        MAP_SIDE, MAP_SIDE, 3
    )
    coarse = averaged.reshape(
        MAP_SIDE // _COARSE_TEXELS, _COARSE_TEXELS, MAP_SIDE // _COARSE_TEXELS, _COARSE_TEXELS, 4
    ).mean(axis=(1, 3))
    of_peak = powers.reshape(-1, 4, 3)[peaks]
    directions = np.einsum("sk,ski->si", of_peak @ LUMINANCE, fine.centres.reshape(-1, 4, 3)[peaks])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    power, places = of_peak.sum(axis=1).astype(np.float32), np.zeros((0, N_PLACES, 3), np.float32)
    if environment is not None:
        places = _places_in_peaks(environment, peaks[:N_QUERIED])
    return averaged, np.ascontiguousarray(coarse), directions.astype(np.float32), power, places


def _find_peaks(powers: NDArray[np.float64]) -> NDArray[np.intp]:
    """Choose the triangles one level coarser that are far brighter than the mean, at most MAX_PEAKS, brightest
    first."""
    luminance = powers.reshape(-1, 4, 3).sum(axis=1) @ LUMINANCE
    candidates = np.argsort(-luminance, kind="stable")[:MAX_PEAKS]
    return np.asarray(candidates[luminance[candidates] > _PEAK * luminance.mean()])


def _places_in_peaks(environment: Environment, peaks: NDArray[np.intp]) -> Float32Array:
    """Choose directions (K, 16, 3) in peaks (K,), which are triangles one level coarser than the finest, each for an
    equal share of the power. The peak is split into parts in a fixed order; a direction is the part at which the
    cumulative power reaches the middle of each sixteenth."""
    sphere = geodesic(_FINE - 1)
    parts = sphere.vertices[sphere.triangles[peaks]].astype(np.float64)
    for _ in range(_CUTS):
        # The middle part third: it has an edge in common with both beside it.
        parts = quarters(parts, on_sphere=True)[:, [0, 1, 3, 2]].reshape(-1, 3, 3)
    middles = parts.sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    power = environment.evaluate(middles, 0.0) @ LUMINANCE * triangle_solid_angles(parts)
    upto = np.maximum(power, 1e-30).reshape(len(peaks), 4**_CUTS).cumsum(axis=1)
    wanted = (np.arange(N_PLACES) + 0.5) / N_PLACES
    found = np.empty((len(peaks), N_PLACES, 3), np.float32)
    for own, each, total in zip(found, middles.reshape(len(peaks), 4**_CUTS, 3), upto, strict=True):
        own[:] = each[np.searchsorted(total, wanted * total[-1])]
    return found


def preparing_sky(environment: Environment | None) -> Generator[None, None, None]:
    """Compute and cache what `make_sky` of an environment needs, in steps, because the first call takes over a
    second."""
    yield
    for part in range(_PARTS):
        _averaging_matrix(part)
        yield
    _map_and_peaks(environment)


@lru_cache(maxsize=_PARTS)
def _averaging_matrix(part: int) -> sparse.csr_matrix:
    """(texels / _PARTS, triangles) for one part of the texels: a matrix from power of the fine triangles to mean
    radiance around each texel. The kernel falls to 0 at twice the radius of a disc the size of a triangle. This width
    is needed: a small light must reach about one triangle's centre, wherever it lies between centres."""
    fine = geodesic(_FINE)
    radius = 2.0 * np.sqrt(4.0 / (20 * 4**4))
    texels = np.array_split(texel_directions(MAP_SIDE), _PARTS)[part]
    near = cKDTree(texels).sparse_distance_matrix(cKDTree(fine.centres), radius, output_type="ndarray")
    rows, columns, distances = near["i"], near["j"], near["v"]
    weights = (1.0 - (distances / radius) ** 2) ** 2
    total = np.bincount(rows, fine.solid_angles[columns] * weights, len(texels))
    return sparse.csr_matrix((weights / total[rows], (rows, columns)), shape=(len(texels), fine.n_triangles))


def texel_directions(side: int) -> NDArray[np.float64]:
    """Unit directions (side², 3) of an octahedral map's texels: |x| + |y| + |z| = 1 unfolded to a square, +Y at its
    centre."""
    v, u = np.divmod(np.arange(side * side), side)
    x, z = (u + 0.5) / side * 2.0 - 1.0, (v + 0.5) / side * 2.0 - 1.0
    y = 1.0 - np.abs(x) - np.abs(z)
    fold = np.maximum(-y, 0.0)
    x, z = x - np.copysign(fold, x), z - np.copysign(fold, z)
    directions = np.stack([x, y, z], axis=1)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)
