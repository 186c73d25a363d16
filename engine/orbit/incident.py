"""Light times visibility at the shading points, in wavelets: what changes with the light, but not with camera or curve.

The triple product of light, visibility and BRDF [Ma06, eq. 3] is taken in two steps, as its factors change at different
times: L·V here, exactly, triangle by triangle, when the light turns; the product with the BRDF's slices in every frame.
Of L·V the n largest coefficients stay. Truncating the product loses less than truncating its factors (measured in
docs/orbit.md), and a frame costs n multiplications a channel instead of a walk through three trees.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.light.emitters import EmitterPatches
from engine.orbit import _incident_kernels as kernels
from engine.orbit.shading_points import ShadingPoints
from engine.orbit.sky import Sky
from engine.orbit.visibility import LEVEL, Bits, upper
from engine.sphere.geodesic import descent_tables, geodesic, triangle_first_moments
from engine.sphere.haar import N_ROOTS
from engine.threads import on_threads

Floats = NDArray[np.float32]
# Points a batch, and points between two reports.
_BATCH, _PART = 64, 4096


@dataclass(frozen=True, eq=False)
class Incident:
    """number (S, n) int16 and value (S, n, 3) float32: coefficients of visible power, as `haar` numbers them.

    irradiance (S, 3) float32, W/m² where the light has W/m²/sr: Σ power × cosine, before coefficients were dropped.
    """

    number: NDArray[np.int16]
    value: Floats
    irradiance: Floats


@dataclass(frozen=True, eq=False)
class Lamps:
    """Emitters inside the scene: M patches, which of them each point sees (S, ⌈M / 8⌉), as `visibility.see_patches`."""

    patches: EmitterPatches
    bits: Bits

    @property
    def tables(self) -> Any:
        """Bits, centres, normals and radiance × area, as the kernels take them."""
        return self.bits, self.patches.centre, self.patches.normal, self.patches.radiance * self.patches.area[:, None]


def no_light(points: ShadingPoints, n: int) -> Incident:
    """Room for n coefficients a point, 20 to 5,120, all 0."""
    size = len(points), min(max(n, N_ROOTS), geodesic(LEVEL).n_triangles)
    return Incident(np.zeros(size, np.int16), np.zeros((*size, 3), np.float32), np.zeros((len(points), 3), np.float32))


def light(points: ShadingPoints, bits: Bits, sky: Sky, incident: Incident, lamps: Lamps | None = None) -> Iterator[int]:
    """Fill `incident` point by point: yields how many are done.

    bits: as `visibility.see` gives them. Lamps are not distant: their directions and distances are each point's own.
    """
    n_points, n = len(points), incident.number.shape[1]
    none = np.zeros((0, 3), np.float32)
    tables: Any = _tables(sky)
    near: Any = lamps.tables if lamps else (np.zeros((n_points, 0), np.uint8), none, none, none)
    fill_range: Any = kernels.light_range
    for start in range(0, n_points, _PART):
        stop = min(start + _PART, n_points)

        def fill(first: int, stop: int = stop) -> None:
            fill_range(
                first, min(first + _BATCH, stop), n, points.frames, bits, *tables, LEVEL, points.position, *near,
                cosines(), incident.number, incident.value, incident.irradiance,
            )  # fmt: skip

        on_threads(fill, range(start, stop, _BATCH))
        yield stop


def suns_seen(points: ShadingPoints, bits: Bits, sky: Sky, which: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Whether some of the points (N,) see each of the sky's suns, (N, M)."""
    seen = np.empty((len(which), len(sky.sun_power)), bool)
    tables = descent_tables(LEVEL + 1)
    kernels.suns_seen(which.astype(np.int64), points.frames, bits, _places(), sky.sun_direction, *tables, LEVEL, seen)
    return seen


@lru_cache(maxsize=1)
def _places() -> NDArray[np.int32]:
    """Where each triangle (5120,) stands among the upper ones, −1 if it is none."""
    places = np.full(geodesic(LEVEL).n_triangles, -1, np.int32)
    places[upper()] = np.arange(len(upper()))
    places.flags.writeable = False
    return places


def _tables(sky: Sky) -> Any:
    """What `_incident_kernels.powers_at` takes between bits and level."""
    sphere, above, places = geodesic(LEVEL), upper(), _places()
    directions = sphere.centres[above].astype(np.float32)
    solid_angles = sphere.solid_angles[above].astype(np.float32)
    return (
        above,
        places,
        directions,
        solid_angles,
        sky.map,
        sky.sun_direction,
        sky.sun_power,
        *descent_tables(LEVEL + 1),
    )


@lru_cache(maxsize=1)
def cosines() -> Floats:
    """The mean of max(cos θ, 0) over each triangle (5120,). Read-only."""
    sphere = geodesic(LEVEL)
    heights = triangle_first_moments(sphere.vertices[sphere.triangles])[:, 1] / sphere.solid_angles
    means = np.maximum(heights, 0.0).astype(np.float32)
    means.flags.writeable = False
    return means
