"""Radiance of points under distant light: by zonal lobes in the axes of a deformed mesh [Sloan05, 5], gloss, and the
shadows of other objects.

The light is tabulated once for all points, band by band over the directions of lobe axes; each lobe then costs one
look-up. The lobes rotate, not the light, so the table serves every point of every pose.

**Gloss** is a lobe about the mean direction of the light that a layer reflects. For each polar angle of wo, the
reflection is taken to be symmetric about that direction, and n of its bands are stored, changed as little as necessary
for the lobe to have no rings (`engine.sphere.harmonics.without_rings`): with n = 6 it is at least about 33 degrees
wide. The error for sharper lobes is known, and reported. The share of light that is blocked is taken to be that of a
Lambertian surface.

**Soft shadows** of bending objects on all others while they move: a few flat ellipsoids approximate a surface. A
cluster of triangles blocks the light of a cone about the direction of its centre, as wide as its outline seen from the
point [Bunnell05]. The light from the cone is known in low bands (`BandLight`), so that a shadow is soft, has the colour
of the light that it lacks, and is darkest at contacts. Clusters of a closed mesh that face away from a point do not
count, because other clusters occlude them. These shadows exclude the object itself: its transfer contains its own
shadows. Spheres instead of ellipsoids were rejected: they turn a wing into a ball.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.cluster.vq import kmeans2
from scipy.special import eval_legendre

from engine.core.threads import even_parts, on_threads
from engine.light.environment import LUMINANCE
from engine.material.layer import Layer, evaluate_layer
from engine.realtime.zonal_harmonics import _shading_kernels as kernels
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.zonal import Zonal, unshadowed_lobes
from engine.sphere.geodesic import geodesic
from engine.sphere.harmonics import basis, clamped_cosine, order_of, without_rings

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

ROWS, COLUMNS = 32, 64  # of a table of light

N_ANGLES = 16  # of wo, for which gloss is tabulated
STEEPEST = np.radians(85.0)
EVEN = 0.125  # share of the mean light that is added to both sides of the visibility ratio
_GLOSS_LEVEL = 5

N_CLUSTERS, MOST_CLUSTERS = 12, 48  # of an object, and of all
CLUSTER_ROW = 14  # numbers of a cluster: centre, area, adjugate (xx yy zz xy xz yz), mean normal, object
_MOST_TRIANGLES = 2000  # of an object, from which its clusters are computed
_CLUSTER_SEED = 4


@dataclass(frozen=True, eq=False)
class BandLight:
    """Distant light: its harmonics (n^2, 3), and table (rows, columns, n, 3) with each band along each direction, by
    latitude from +z and longitude from -x [Sloan05, eq. 24], with one number behind it (`engine.core.lanes`)."""

    harmonics: Float32Array
    table: Float32Array


def band_light(light: ArrayLike) -> BandLight:
    """Tabulate light (n^2, 3), see `engine.sphere.harmonics.project`."""
    harmonics = np.asarray(light, np.float64)
    n = order_of(harmonics.T)
    products = _basis_of_table(n)[:, :, None] * harmonics
    table = np.zeros(ROWS * COLUMNS * n * 3 + 1, np.float32)
    table[:-1] = np.add.reduceat(products, np.arange(n) ** 2, axis=1).ravel()
    return BandLight(harmonics.astype(np.float32), table[:-1].reshape(ROWS, COLUMNS, n, 3))


@dataclass(frozen=True, eq=False)
class Lobes:
    """Zonal lobes in single precision for shading: see `Zonal`."""

    low: Float32Array
    axes: Float32Array
    coefficients: Float32Array


def lobes(zonal: Zonal) -> Lobes:
    return Lobes(*(np.ascontiguousarray(each, np.float32) for each in (zonal.low, zonal.axes, zonal.coefficients)))


def unshadowed_points(n_points: int, n_lobes: int, n: int) -> Lobes:
    """Lobes of points that see everything above their horizon: one, and the others 0."""
    one = unshadowed_lobes([0.0, 0.0, 1.0], n)
    axes, coefficients = np.zeros((n_points, n_lobes, 3)), np.zeros((n_points, n_lobes, n))
    axes[:, :, 2], coefficients[:, 0] = 1.0, one.coefficients[0, 0]
    return Lobes(*(each.astype(np.float32) for each in (np.repeat(one.low, n_points, axis=0), axes, coefficients)))


def shade(lobes: Lobes, frames: ArrayLike, light: BandLight) -> Float32Array:
    """Radiance (P, 3) of white points whose current axes are the rows of frames (P, 3, 3)."""
    frames = np.ascontiguousarray(frames, np.float32)
    radiance = np.empty((len(frames), 3), np.float32)
    shade_some(np.arange(len(frames)), lobes, frames, light, radiance)
    return radiance


def shade_some(
    which: NDArray[np.int64], lobes: Lobes, frames: Float32Array, light: BandLight, radiance: Float32Array,
    n_each: int = 1,
) -> None:  # fmt: skip
    """Fill the rows of radiance (P, 3) of some points (N,), see `shade`; n_each: points that in turn share one of
    frames (P / n_each, 3, 3)."""
    what = lobes.low, lobes.axes, lobes.coefficients, frames, n_each, light.harmonics, light.table
    on_threads(lambda start, stop: kernels.shade_range(start, stop, which, *what, radiance), *even_parts(len(which)))


@cache
def _basis_of_table(n: int) -> NDArray[np.float64]:
    """The harmonics (rows * columns, n^2) at the table's directions."""
    polar = (np.arange(ROWS) + 0.5)[:, None] * (np.pi / ROWS)
    azimuth = (np.arange(COLUMNS) + 0.5) * (2.0 * np.pi / COLUMNS) - np.pi
    sine = np.sin(polar)
    directions = np.broadcast_arrays(sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(polar))
    return basis(np.stack(directions, axis=-1).reshape(-1, 3), n)


@dataclass(frozen=True, eq=False)
class LowGloss:
    """A layer's reflection for `N_ANGLES` polar angles of wo, 0 to `STEEPEST`: bands (A, n, 3), the factors of each
    band of the light along the lobe's axis; lean (A,): angle in radians from the normal to the axis, towards the mirror
    direction of wo.

    lost_share: error of n bands as a share of the reflection's energy, 0 to 1, for wo at 45 degrees.
    """

    bands: Float32Array
    lean: Float32Array
    lost_share: float

    @property
    def albedo(self) -> Float64Array:
        """Share of uniform light that it reflects (3,), averaged over all directions of wo."""
        angles = np.linspace(0.0, STEEPEST, N_ANGLES)
        weights = np.sin(2.0 * angles)
        return np.asarray(weights @ self.bands[:, 0] / weights.sum())


@lru_cache(maxsize=64)
def low_gloss(layer: Layer, n: int) -> LowGloss:
    """Compute the approximation of order n; an anisotropic layer is represented by its reflection along the tangent."""
    sphere = geodesic(_GLOSS_LEVEL)
    above = sphere.centres[:, 2] > 0.0
    wi, weights = sphere.centres[above], sphere.solid_angles[above, None]
    bands, lean, lost = np.empty((N_ANGLES, n, 3), np.float32), np.empty(N_ANGLES, np.float32), np.zeros(N_ANGLES)
    for i, angle in enumerate(np.linspace(0.0, STEEPEST, N_ANGLES)):
        wo = np.tile([np.sin(angle), 0.0, np.cos(angle)], (len(wi), 1))
        sent = evaluate_layer(layer, wi, wo)
        mean = (weights * sent @ LUMINANCE[:, None] * wi).sum(axis=0)
        lean[i] = np.arctan2(-mean[0], mean[2])
        axis = np.array([-np.sin(lean[i]), 0.0, np.cos(lean[i])])
        legendre = eval_legendre(np.arange(n)[:, None], np.clip(wi @ axis, -1.0, 1.0))
        exact = legendre @ (weights * sent)
        bands[i] = np.stack([without_rings(exact[:, c]) for c in range(3)], axis=1)
        # Share of the squared integral of the reflection that is lost: |f|^2 - |f - h|^2, where f has the exact bands
        # and h the stored ones.
        grey, stored = exact @ LUMINANCE, bands[i] @ LUMINANCE
        held = ((2 * np.arange(n) + 1) / (4.0 * np.pi) * (2.0 * grey * stored - stored**2)).sum()
        lost[i] = 1.0 - held / max(float((weights[:, 0] * (sent @ LUMINANCE) ** 2).sum()), 1e-30)
    at_45 = np.interp(np.radians(45.0), np.linspace(0.0, STEEPEST, N_ANGLES), lost)
    return LowGloss(bands, lean, float(np.clip(at_45, 0.0, 1.0)))


def add_gloss(
    gloss: LowGloss, factor: NDArray[np.floating], which: NDArray[np.int64], places: Float32Array,
    normals: Float32Array,
    camera_position: Float64Array, light: BandLight, white: Float32Array, sent: Float32Array,
) -> None:  # fmt: skip
    """Add to sent (S, 3) what points (P,), out of all, send to the camera (3,), times factor (3,).

    places (S, 3), normals (S, 3); white (S, 3): radiance of white Lambertian points, which tells how much light is
    blocked.
    """
    cosine = (clamped_cosine(light.table.shape[2]) / np.pi).astype(np.float32)
    bands = np.ascontiguousarray(gloss.bands * np.asarray(factor, np.float32))

    def part(start: int, stop: int) -> None:
        kernels.gloss_range(
            which[start:stop], places, normals, camera_position, light.table, bands, gloss.lean, float(STEEPEST),
            cosine,
            even_light(light), white, sent,
        )  # fmt: skip

    on_threads(part, *even_parts(len(which)))


def even_light(light: BandLight) -> float:
    """`EVEN` times what a white surface reflects of the mean light, summed over the channels."""
    return EVEN * float(light.harmonics[0].sum()) / float(np.sqrt(4.0 * np.pi))


class Blockers:
    """Clusters of a scene's objects, at the current positions of its points."""

    def __init__(self, points: BendingPoints) -> None:
        self._points = points
        self._clusters: dict[tuple[int, int], _Clusters] = {}

    def rows(self, objects: list[int], places: Float32Array | None = None) -> Float32Array:
        """The clusters (K, `CLUSTER_ROW`) of some objects at places (V, 3), None for the current ones; the last number
        is the object's index in `objects`."""
        count = max(1, min(N_CLUSTERS, MOST_CLUSTERS // max(len(objects), 1)))
        found = []
        for place, i in enumerate(objects[:MOST_CLUSTERS]):
            if (i, count) not in self._clusters:
                self._clusters[i, count] = _Clusters(self._points, i, count)
            found.append(self._clusters[i, count].rows(self._points.places if places is None else places))
            found[-1][:, 13] = place
        return np.concatenate(found) if found else np.zeros((0, CLUSTER_ROW), np.float32)


class _Clusters:
    """The triangles of an object, sorted by cluster."""

    def __init__(self, points: BendingPoints, i_object: int, count: int) -> None:
        surface = points.surface
        mine = np.flatnonzero(surface.i_object == i_object)
        chosen = mine[:: -(-len(mine) // _MOST_TRIANGLES) or 1]
        self._share = len(mine) / max(len(chosen), 1)
        opacity = points.mean_opacity(chosen)
        self._is_closed = bool((surface.sides[mine, 1, 0] < 0).all())
        middles = points.corners_at_rest(chosen).astype(np.float64).mean(axis=1)
        labels = np.zeros(len(chosen), np.int64)
        if len(chosen) > count > 1:
            labels = kmeans2(middles, count, minit="++", rng=_CLUSTER_SEED)[1]
        order = np.argsort(labels, kind="stable")
        self._corners, self._opacity = surface.corners[chosen[order]], opacity[order]
        self._firsts = np.flatnonzero(np.diff(labels[order], prepend=-1))

    def rows(self, places: Float32Array) -> Float32Array:
        """See `Blockers.rows`: areas and second moments of triangles at the corners' current positions.

        Of the outline of a cluster with holes the share that is there blocks light. The outline is by the adjugate's
        root.
        """
        if not len(self._firsts):
            return np.zeros((0, CLUSTER_ROW), np.float32)
        corners = places[self._corners].astype(np.float64)
        cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas, summed = 0.5 * np.linalg.norm(cross, axis=1), corners.sum(axis=1)
        # The integral of x x^T over a triangle is A / 12 (sum of v v^T over its corners + (sum of v)(sum of v)^T).
        squares = np.einsum("tki,tkj->tij", corners, corners) + summed[:, :, None] * summed[:, None, :]
        area = np.maximum(np.add.reduceat(areas, self._firsts), 1e-30)
        middle = np.add.reduceat(areas[:, None] * summed, self._firsts) / (3.0 * area[:, None])
        moment = np.add.reduceat((areas / 12.0)[:, None, None] * squares, self._firsts) / area[:, None, None]
        spread = 4.0 * (moment - middle[:, :, None] * middle[:, None, :])  # of a disc: its radius squared
        rows = np.zeros((len(area), CLUSTER_ROW), np.float32)
        there = np.add.reduceat(areas * self._opacity, self._firsts) / area
        rows[:, :3], rows[:, 3] = middle, area * self._share * there
        a, b, c = spread[:, 0], spread[:, 1], spread[:, 2]
        adjugate = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1) * (there**2)[:, None, None]
        rows[:, 4:7] = np.maximum(adjugate[:, (0, 1, 2), (0, 1, 2)], 0.0)
        rows[:, 7:10] = adjugate[:, (0, 0, 1), (1, 2, 2)]
        if self._is_closed:
            rows[:, 10:13] = 0.5 * np.add.reduceat(cross, self._firsts) / area[:, None]
        return rows


def add_shadows(
    rows: Float32Array, casts: NDArray[np.bool_], points: BendingPoints, places: Float32Array, normals: Float32Array,
    light: BandLight, white: Float32Array,
) -> None:  # fmt: skip
    """Darken white (S, 3), the radiance of white Lambertian points at places (S, 3) with normals (S, 3), by clusters
    (K, `CLUSTER_ROW`).

    casts (M, C): whether each of the C objects with clusters casts shadows on each object. Without clusters the kernel
    runs all the same, so that it is compiled before anything bends.
    """
    window = spread_of(light.table.shape[2])
    on_threads(
        lambda start, stop: kernels.shadow_range(
            start, stop, rows, casts, points.owners, places, normals, light.table, window, white
        ),
        *even_parts(len(white)),
    )


@cache
def spread_of(n: int) -> Float32Array:
    """Window for light in n bands, which turns a small bright light into a spot: Hann's, which leaves rings of 3 % of
    the peak. A shadow without any rings would be wider (`engine.sphere.harmonics.without_rings`), and half as dark."""
    return np.asarray(0.5 * (1.0 + np.cos(np.pi * np.arange(n) / n)), np.float32)
