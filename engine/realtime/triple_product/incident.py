"""Light times visibility at the shading points, in wavelets: depends on the light, but not on camera or curve.

The triple product of light, visibility and BRDF [Ma06, eq. 3] is computed in two steps, because its factors change at
different times. L·V is computed here, exactly, triangle by triangle, when the light changes; the product with the
BRDF's slices is computed in every frame. The n largest coefficients of L·V are stored. Truncating the product loses
less than truncating its factors (measured in docs/orbit.md), and a frame costs n multiplications a channel instead of a
traversal of three trees.

Diffuse objects need only irradiance and store nothing else. Irradiance includes the peaks; the coefficients do not,
because each peak is reflected in its own direction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import on_threads
from engine.light.emitters import EmitterPatches
from engine.realtime.triple_product import _incident_kernels as kernels
from engine.realtime.triple_product.shading_points import ShadingPoints
from engine.realtime.triple_product.sky_map import MAX_PEAKS, SkyMap
from engine.realtime.triple_product.visibility import LEVEL, Bits, upper_triangles
from engine.scene.raycaster import RayCaster
from engine.sphere.geodesic import geodesic, locate, triangle_first_moments

Float32Array = NDArray[np.float32]
_BATCH = 64
_COARSE_LEVEL = 2
_CHILDREN_SIDE = 384  # a quarter of a degree


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


def light_points(
    points: ShadingPoints, bits: Bits, sky: SkyMap, incident: Incident, lamps: SceneEmitters | None = None,
    which: NDArray[np.integer] | None = None, is_coarse: bool = False, peaks: NDArray[np.int16] | None = None,
) -> None:  # fmt: skip
    """Fill `incident` at all points, or at those in which (N,).

    bits: as from `visibility.trace_hemispheres`; is_coarse: by triangles of level 2, in a sixth of the time. Lamps are
    not distant: each point has its own directions and distances to them. peaks (S,): see `visible_peaks`.
    """
    requested = np.arange(len(points)) if which is None else np.asarray(which, np.int64)
    tables: Any = (
        kernel_places(points, bits, incident.slot, lamps, peaks),
        hemisphere(),
        kernel_lights(sky, lamps),
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
    lamps = None
    if patches is not None:
        alike = EmitterPatches(
            patches.corners, patches.centre, patches.normal, np.ones_like(patches.radiance), patches.area
        )
        lamps = SceneEmitters(alike, patch_bits)
    for i, (sky, emitting) in enumerate(((white, None), (black, lamps))):
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
    points: ShadingPoints, bits: Bits, slot: NDArray[np.int32], lamps: SceneEmitters | None,
    peaks: NDArray[np.int16] | None = None,
) -> kernels.Places:  # fmt: skip
    """Points in the kernels' form."""
    patch_bits = lamps.bits if lamps else np.zeros((len(points), 0), np.uint8)
    requested = np.full(len(points), -1, np.int16) if peaks is None else peaks
    return kernels.Places(points.position, points.frames, bits, patch_bits, slot, requested)


def kernel_lights(sky: SkyMap, lamps: SceneEmitters | None) -> kernels.Light:
    """Light in the kernels' form."""
    none = np.zeros((0, 3), np.float32)
    patches: Any = (none, none, none)
    if lamps is not None:
        own = lamps.patches
        patches = own.centre, own.normal, own.radiance * own.area[:, None]
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
