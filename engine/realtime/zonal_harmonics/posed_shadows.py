"""Shadows that bending objects cast on all others in their current pose, by rays: for pictures at rest.

While objects move, a few ellipsoids stand for them (`engine.realtime.zonal_harmonics.shading`), whose shadow has the
light's low bands: the shadow of a head before a bright window is lost in it. At rest there is time for rays. The sky is
cut into directional lights [Agarwal03], and emitters into samples of their area. From each point rays go to those that
lie behind a bending object's bounding sphere. What the object blocks of a white Lambertian point's light is

    E = 1/π Σ_m L_m max(n · ω_m, 0) V_rest(ω_m) (1 - V_bent(ω_m))

where V_rest leaves out what objects at rest block already: their shadows are part of the point's transfer.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.light.triangle_lights import cut_lights
from engine.precompute.direct.linking import reaching_skies
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics import _posed_shadow_kernels as kernels
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.scene_lamps import SHORTENED, Lamp, towards_lamp
from engine.scene.raycaster import RayCaster

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

N_LIGHTS = 400
_BLOCK = 4096  # points whose lights are selected together


@dataclass(frozen=True, eq=False)
class Caster:
    """A bending object: what intersects its triangles in the current pose, and its bounding sphere."""

    rays: RayCaster
    centre: Float64Array
    radius: float


def blocked_light(
    points: BendingPoints, sky: SkyState, lamps: Sequence[Lamp], apart: Collection[int], unlit: Collection[int],
    casts: NDArray[np.bool_], objects: Sequence[int], places: Float32Array, normals: Float32Array,
    reach: NDArray[np.bool_] | None = None, shining: Collection[int] = (),
) -> tuple[Float32Array, Float32Array]:  # fmt: skip
    """Radiance (S, 3) of white Lambertian points, at places (V, 3) with normals (S, 3), by the light of a sky that
    objects block in their current pose; and by that of each lamp (S, L, 3).

    casts (M, C): whether each of the C objects casts such a shadow on each of the M. apart: objects whose light from
    lamps is part of light of their own (`engine.realtime.zonal_harmonics.neighbours`), so that they lack none of them.
    unlit: those of them without that part, which lack as much as they get of lamps, with a negative sign. reach (M, L):
    which objects each lamp lights, None for all; of a sky's links each object lacks the light that reaches it.
    shining: the lamps among the objects, which hide the sky, and no light of lamps.
    """
    skies = reaching_skies(sky, len(casts))
    of_sky, of_lamps = np.zeros((len(normals), 3)), np.zeros((len(normals), len(lamps), 3))
    lit_anew = set(unlit) if lamps else set()
    casters = [_caster(points, i, places) for i in objects] if casts.any() or lit_anew else []
    solid = [caster for i, caster in zip(objects, casters, strict=False) if i not in shining]
    resting = tuple(i for i in sorted(points.objects) if i not in objects and i not in shining)
    for i_object in sorted(lit_anew.union(np.flatnonzero(casts.any(axis=1)).tolist())):
        reaching = skies[i_object]
        lit_by = [(k, lamp) for k, lamp in enumerate(lamps) if reach is None or reach[i_object, k]]
        own = [casters[k] for k in np.flatnonzero(casts[i_object])]
        bent = [casters[k] for k in np.flatnonzero(casts[i_object]).tolist() if objects[k] not in shining]
        for block in _blocks(points.points_of(i_object)):
            rays = _Rays(points, resting, own, places[block], normals[block])
            if reaching.environment is not None and own:
                of_sky[block] = rays.blocked_lights(*_lights_of(reaching))
            if i_object in lit_anew:
                rays = replace(rays, casters=solid)
                for k, lamp in lit_by:
                    of_lamps[block, k] = -rays.light_of(lamp, blocked=False)
            elif i_object not in apart and bent:
                rays = replace(rays, casters=bent)
                for k, lamp in lit_by:
                    of_lamps[block, k] = rays.light_of(lamp, blocked=True)
    return of_sky.astype(np.float32), of_lamps.astype(np.float32)


@dataclass(frozen=True, eq=False)
class _Rays:
    """Rays from points at places (B, 3) with normals (B, 3), to light that casters block and objects at rest do not."""

    points: BendingPoints
    resting: tuple[int, ...]
    casters: Sequence[Caster]
    places: Float32Array
    normals: Float32Array

    def blocked_lights(self, towards: Float32Array, power: Float64Array) -> Float64Array:
        """Light (B, 3) that points lack of lights towards (L, 3), of power (L, 3)."""
        is_blocked = np.zeros((len(self.places), len(towards)), bool)
        for caster in self.casters:
            point, light = np.nonzero(self._passing(caster, towards) & ~is_blocked)
            is_blocked[point, light] = self._hits(caster.rays, point, towards[light])
        point, light = np.nonzero(is_blocked)
        is_open = self._open_at_rest(point, towards[light])
        point, light = point[is_open], light[is_open]
        cosine = np.einsum("rc,rc->r", self.normals[point], towards[light], dtype=np.float64) / np.pi
        return np.stack([np.bincount(point, cosine * power[light, c], len(self.places)) for c in range(3)], axis=1)

    def light_of(self, lamp: Lamp, blocked: bool) -> Float64Array:
        """Light (B, 3) of a lamp that casters block, or that they let pass to the points."""
        found = np.zeros((len(self.places), 3))
        for sample in lamp.samples:
            directions, factor = towards_lamp(self.places.astype(np.float64), sample)
            factor *= np.maximum(np.einsum("pc,pc->p", directions, self.normals), 0.0) / np.pi
            to = (sample.target - self.places).astype(np.float32)
            lit = np.flatnonzero(factor > 0.0)
            is_blocked = np.zeros(len(lit), bool)
            for caster in self.casters:
                is_blocked |= self._hits(caster.rays, lit, to[lit], SHORTENED)
            lit = lit[is_blocked == blocked]
            lit = lit[self._open_at_rest(lit, to[lit], SHORTENED)]
            found[lit] += factor[lit, None] * sample.tint
        return found * lamp.emission

    def _passing(self, caster: Caster, towards: Float32Array) -> NDArray[np.bool_]:
        """Lights above the horizons of points (B, L) whose rays pass a caster's bounding sphere."""
        near = np.empty((len(self.places), len(towards)), bool)
        centre, square = caster.centre.astype(np.float32), np.float32(caster.radius**2)
        on_threads(
            lambda start, stop: kernels.mark_near(
                self.places, self.normals, towards, centre, square, start, stop, near
            ),
            *even_parts(len(self.places)),
        )
        return near

    def _hits(
        self, caster: RayCaster, point: NDArray[np.int64], directions: Float32Array, limit: float | None = None
    ) -> NDArray[np.bool_]:
        origins = caster.offset_origins(self.places[point], self.normals[point])
        return caster.occluded(origins, directions, None if limit is None else np.full(len(point), limit, np.float32))

    def _open_at_rest(
        self, point: NDArray[np.int64], directions: Float32Array, limit: float | None = None
    ) -> NDArray[np.bool_]:
        """Which rays meet no object at rest."""
        if not self.resting or not len(point):
            return np.ones(len(point), bool)
        return ~self._hits(self.points.caster(self.resting), point, directions, limit)


def _caster(points: BendingPoints, i_object: int, places: Float32Array) -> Caster:
    own = points.surface.i_object == i_object
    corners = places[points.surface.corners[own]]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    centre = 0.5 * (low + high).astype(np.float64)
    radius = float(np.linalg.norm(corners - centre, axis=2).max())
    return Caster(points.caster_of(own, corners), centre, radius)


@lru_cache(maxsize=8)
def _lights_of(sky: SkyState) -> tuple[Float32Array, Float64Array]:
    """Directions (L, 3) to the lights that stand for a sky, and their power (L, 3)."""
    assert sky.environment is not None
    lights = cut_lights(sky.environment, N_LIGHTS, sky.rotation)
    shining = lights.power.any(axis=1)
    return lights.centre[shining], lights.power[shining].astype(np.float64) * sky.scale


def _blocks(rows: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
    for start in range(0, len(rows), _BLOCK):
        yield rows[start : start + _BLOCK]
