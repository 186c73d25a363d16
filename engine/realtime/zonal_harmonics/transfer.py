"""Transfer vectors of points of a mesh under distant light: by ray tracing [Sloan05, 3.2], and through a scattering
medium.

A transfer vector t (n^2,) describes a white Lambertian surface: under light e its radiance is e . t, times its albedo.
It is expressed in the axes of the point itself, so that it follows them when the mesh bends. Reflections of the mesh
onto itself are added bounce by bounce. Shadows of distant objects are not local, and become wrong as soon as these
move; the caller chooses what casts shadows.

Subsurface scattering is the dipole of [Jensen01]. A point emits what enters at all others, weighted by the distance
through the medium, so thin parts are translucent. This is linear in the light: a point's transfer is a sum of other
points' transfer, and zonal lobes are fitted to it as to any other. Light enters and leaves diffusely: Fresnel's law is
ignored except for internal reflection. The dipole assumes a flat, half-infinite medium; it is too dark around sharp
edges and too bright in thin sheets.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.core.generators import map_steps
from engine.core.threads import even_parts, on_threads
from engine.realtime.zonal_harmonics import _transfer_kernels as kernels
from engine.scene.raycaster import RayCaster, SurfacePoints
from engine.sphere.harmonics import basis, quadrature

Float64Array = NDArray[np.float64]

N_RAYS = 5000
N_BOUNCE_RAYS = 1000
_BLOCK_RAYS = 1 << 19  # rays of a piece of work; pictures can be drawn between pieces
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))

LEFT_OUT = 1e-3  # of the reflectance, beyond the reach
_N_TABLE = 4096  # distances at which the reflectance is tabulated
_BLOCK_POINTS = 1024
_N_SLAB = 48  # depths and directions in a slab


@dataclass(frozen=True, eq=False)
class TransferPoints:
    """P points to be simulated: positions (`SurfacePoints`); frames (P, 3, 3), rows tangent, bitangent, normal; and the
    caster's triangles as corners (T, 3), indices of these points, -1 for triangles of other objects. normals (T, 3):
    their orientation, of any length; None: by the order of their corners."""

    points: SurfacePoints
    frames: Float64Array
    corners: NDArray[np.int32]
    normals: Float64Array | None = None


def simulate(
    mesh: TransferPoints, caster: RayCaster, n: int, albedo: ArrayLike = 0.0, n_bounces: int = 0, n_rays: int = N_RAYS
) -> Generator[float, None, Float64Array]:
    """Vectors (P, n^2) of order n with the mesh's own shadows and, for albedo (P,) or one for all in [0, 1), its
    reflections onto itself in n_bounces bounces. Yields the share that is done."""
    end = 0.7 if n_bounces else 1.0
    total = yield from map_steps(simulate_shadows(mesh, caster, n, n_rays), lambda share: end * share)
    if n_bounces:
        total = yield from map_steps(
            add_bounces(mesh, caster, total, albedo, n_bounces), lambda share: end + 0.2 * share
        )
    yield 1.0
    return total


def simulate_shadows(
    mesh: TransferPoints, caster: RayCaster, n: int, n_rays: int = N_RAYS
) -> Generator[float, None, Float64Array]:
    """Vectors (P, n^2) of order n with the shadows of what the rays can meet. Yields the share that is done."""
    total = np.empty((len(mesh.frames), n * n))
    for start, stop, rays in ray_blocks(mesh, cosine_directions(n_rays, n)[0]):
        blocked = caster.occluded(*rays).reshape(stop - start, n_rays)
        total[start:stop] = (~blocked) @ (cosine_directions(n_rays, n)[1] / n_rays)
        yield stop / len(total)
    return total


def add_bounces(
    mesh: TransferPoints, caster: RayCaster, vectors: Float64Array, albedo: ArrayLike, n_bounces: int
) -> Generator[float, None, Float64Array]:
    """Add to vectors (P, n^2) the reflections of the mesh, of albedo (P,) or one for all in [0, 1), onto itself in
    n_bounces bounces of the light that they describe. Yields the share that is done."""
    hits = yield from _hits(mesh, caster)
    total = vectors.copy()
    sent = rotate_transfer(total, mesh.frames.transpose(0, 2, 1))  # in world axes, which all points share
    reflectance = np.broadcast_to(np.asarray(albedo, np.float64), len(total))[:, None]
    for _ in range(n_bounces):
        sent = hits.gather(reflectance * sent, mesh.corners)
        total += rotate_transfer(sent, mesh.frames)
    return total


def rotate_transfer(vectors: Float64Array, frames: Float64Array) -> Float64Array:
    """Rotate functions (P, n^2) into the axes that are the rows of `frames` (P, 3, 3): exact, by quadrature."""
    n = round(vectors.shape[1] ** 0.5)
    places, weights = quadrature(n)
    weighed = basis(places, n) * weights[:, None]
    result = np.empty_like(vectors)
    back = np.ascontiguousarray(frames.transpose(0, 2, 1))
    on_threads(
        lambda start, stop: kernels.rotate_range(vectors, back, places, weighed, start, stop, result),
        *even_parts(len(vectors)),
    )
    return result


@cache
def cosine_directions(count: int, n: int) -> tuple[Float64Array, Float64Array]:
    """Directions (D, 3) about +z with cosine density, each for the same share of a Lambertian surface's irradiance; and
    the harmonics there (D, n^2). A golden-angle spiral over the disc below them."""
    i = np.arange(count) + 0.5
    radius, angle = np.sqrt(i / count), i * _GOLDEN_ANGLE
    directions = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.sqrt(1.0 - radius**2)], axis=1)
    return directions, basis(directions, n)


@dataclass(frozen=True, eq=False)
class _Hits:
    """Front-facing hits of the points' rays on the mesh: those of point p are firsts[p] to firsts[p + 1]."""

    firsts: NDArray[np.int64]
    triangle: NDArray[np.int32]
    u: NDArray[np.float32]
    v: NDArray[np.float32]

    def gather(self, sent: Float64Array, corners: NDArray[np.int32]) -> Float64Array:
        """Sum what each point's hits send."""
        result = np.empty_like(sent)
        on_threads(
            lambda start, stop: kernels.gather_bounces(
                self.firsts, self.triangle, self.u, self.v, corners, 1.0 / N_BOUNCE_RAYS, sent, start, stop, result
            ),
            *even_parts(len(sent)),
        )
        return result


def _hits(mesh: TransferPoints, caster: RayCaster) -> Generator[float, None, _Hits]:
    n_points = len(mesh.frames)
    counts = np.zeros(n_points + 1, np.int64)
    parts: list[tuple[NDArray, NDArray, NDArray]] = []
    normals = _face_normals(mesh) if mesh.normals is None else mesh.normals
    for start, stop, (origins, directions) in ray_blocks(mesh, cosine_directions(N_BOUNCE_RAYS, 1)[0]):
        found = caster.intersect(origins, directions)
        is_front = np.einsum("rc,rc->r", directions, normals[found.triangle]) < 0.0
        of_mesh = (found.triangle >= 0) & is_front & (mesh.corners[found.triangle, 0] >= 0)
        parts.append((found.triangle[of_mesh], found.u[of_mesh], found.v[of_mesh]))
        counts[start + 1 : stop + 1] = of_mesh.reshape(stop - start, N_BOUNCE_RAYS).sum(axis=1)
        yield stop / n_points
    triangle, u, v = (np.concatenate(each) for each in zip(*parts, strict=True))
    return _Hits(np.cumsum(counts), triangle, u, v)


def _face_normals(mesh: TransferPoints) -> Float64Array:
    """Face normals, not normalized (T, 3)."""
    a, b, c = (mesh.points.position[mesh.corners[:, k]].astype(np.float64) for k in range(3))
    return np.cross(b - a, c - a)


def ray_blocks(
    mesh: TransferPoints, local: Float64Array
) -> Generator[tuple[int, int, tuple[NDArray[np.float32], NDArray[np.float32]]], None, None]:
    """Yield blocks of points, by their indices, with origins and directions of all their rays; `local` (D, 3) is in
    their own axes."""
    n_rays = len(local)
    size = max(1, _BLOCK_RAYS // n_rays)
    for start in range(0, len(mesh.frames), size):
        stop = min(start + size, len(mesh.frames))
        directions = (local @ mesh.frames[start:stop]).astype(np.float32).reshape(-1, 3)
        origins = np.repeat(mesh.points.offset_position[start:stop], n_rays, axis=0)
        yield start, stop, (origins, directions)


@dataclass(frozen=True)
class Medium:
    """A scattering medium: reduced scattering and absorption, per metre, and index of refraction.

    Raises ValueError unless they are finite, scattering is above 0, absorption at least 0, and the index at least 1.
    """

    scattering: float
    absorption: float
    ior: float = 1.3

    def __post_init__(self) -> None:
        if not (0.0 < self.scattering <= 1e9 and 0.0 <= self.absorption <= 1e9 and 1.0 <= self.ior <= 3.0):
            found = f"scattering {self.scattering:g}, absorption {self.absorption:g}, index {self.ior:g}"
            raise ValueError(f"{found}, expected above 0, at least 0 (both to 1e9), and 1 to 3")

    @property
    def albedo(self) -> float:
        """Reduced albedo of a single scattering."""
        return self.scattering / (self.scattering + self.absorption)

    @property
    def depths(self) -> tuple[float, float]:
        """Depth of the real source below the surface and height of the virtual one above it, metres [Jensen01, 2.3]."""
        inside = -1.440 / self.ior**2 + 0.710 / self.ior + 0.668 + 0.0636 * self.ior
        real = 1.0 / (self.scattering + self.absorption)
        return real, real * (1.0 + 4.0 / 3.0 * (1.0 + inside) / (1.0 - inside))

    @property
    def decay(self) -> float:
        """Effective transport coefficient, per metre."""
        return math.sqrt(3.0 * self.absorption * (self.scattering + self.absorption))

    def reflectance(self, distance: ArrayLike) -> Float64Array:
        """R_d, radiant exitance by power, per square metre [Jensen01, eq. 4]."""
        radius = np.asarray(distance, np.float64)
        total = np.zeros(radius.shape)
        for depth in self.depths:
            away = np.hypot(radius, depth)
            total += depth * (1.0 + self.decay * away) * np.exp(-self.decay * away) / away**3
        return np.asarray(self.albedo / (4.0 * np.pi) * total)

    def integral_beyond(self, distance: ArrayLike) -> Float64Array:
        """Integral of the reflectance over the plane beyond a distance; at 0 the whole diffuse reflectance."""
        radius = np.asarray(distance, np.float64)
        total = np.zeros(radius.shape)
        for depth in self.depths:
            away = np.hypot(radius, depth)
            total += depth * np.exp(-self.decay * away) / away
        return np.asarray(self.albedo / 2.0 * total)

    def slab_shares(self, thickness: float) -> tuple[float, float]:
        """Shares of diffuse light that a slab, so many metres thick, reflects and transmits: diffusion between two
        planes where the fluence is 0, outside either side [Donner05, 3], from where light is first scattered; and what
        is not scattered at all. As above, light enters without loss.

        Raises ValueError unless the thickness is above 0.
        """
        if not 0.0 < thickness < math.inf:
            raise ValueError(f"a slab {thickness:g} thick, expected above 0")
        nodes, weights = np.polynomial.legendre.leggauss(_N_SLAB)
        nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
        extinction, (real, virtual) = self.scattering + self.absorption, self.depths
        outside = 0.5 * (virtual - real)
        # Light from all directions, by their cosine, refracted: its share by the depth at which it is first scattered.
        cosine = np.sqrt(1.0 - (1.0 - nodes**2) / self.ior**2)
        share = 2.0 * nodes * weights
        unscattered = float(share @ np.exp(-extinction * thickness / cosine))
        # Depths in even steps of the light that is left along the normal, where a thick slab has most of it.
        most = -math.expm1(-extinction * thickness)
        depth = -np.log1p(-most * nodes) / extinction
        density = np.exp(-np.outer(depth, extinction / cosine - extinction)) @ (share / cosine) * most * weights
        # Flux through either side from a source at each depth: sinh(k a) cosh(k b) / sinh(k (d + 2 b)).
        up, down = (
            _sinh_ratio(self.decay, to_plane + outside, outside, thickness + 2.0 * outside)
            for to_plane in (thickness - depth, depth)
        )
        return self.albedo * float(density @ up), self.albedo * float(density @ down) + unscattered

    @property
    def reach(self) -> float:
        """Distance in metres beyond which less than `LEFT_OUT` of the reflectance lies."""
        low, high = 0.0, self.depths[1]
        while self.integral_beyond(high) > LEFT_OUT * self.integral_beyond(0.0):
            low, high = high, 2.0 * high
        for _ in range(40):
            middle = (low + high) / 2.0
            low, high = (
                (middle, high) if self.integral_beyond(middle) > LEFT_OUT * self.integral_beyond(0.0) else (low, middle)
            )
        return high


def _sinh_ratio(rate: float, a: Float64Array, b: float, total: float) -> Float64Array:
    """sinh(rate a) cosh(rate b) / sinh(rate total), where a + b <= total; without overflow, and a / total at rate 0."""
    if rate * total < 1e-6:
        return np.asarray(a / total)
    grown = np.exp(rate * (a + b - total)) * (1.0 + math.exp(-2.0 * rate * b)) / 2.0
    return np.asarray(grown * np.expm1(-2.0 * rate * a) / math.expm1(-2.0 * rate * total))


@dataclass(frozen=True, eq=False)
class Sources:
    """Where light enters: places (S, 3), areas (S,), and numbers (S,), the index of the entering vector; copies may
    share one."""

    places: Float64Array
    areas: Float64Array
    numbers: NDArray[np.int32]


def subsurface(
    entering: ArrayLike, points: ArrayLike, sources: Sources, medium: Medium
) -> Generator[float, None, Float64Array]:
    """Vectors that leave at points (P, 3), given vectors (Q, n^2) that enter, both in the same axes. Yields the share
    that is done."""
    entering, points = np.ascontiguousarray(entering, np.float64), np.ascontiguousarray(points, np.float64)
    places, areas = (np.ascontiguousarray(each, np.float64) for each in (sources.places, sources.areas))
    numbers = np.ascontiguousarray(sources.numbers, np.int32)
    reach = medium.reach
    table = medium.reflectance(np.linspace(0.0, reach, _N_TABLE))
    own = np.subtract(
        medium.integral_beyond(0.0), medium.integral_beyond(np.sqrt(areas / np.pi))
    )  # over a disc with the place's area
    leaving = np.empty((len(points), entering.shape[1]))
    for first in range(0, len(points), _BLOCK_POINTS):
        count = min(_BLOCK_POINTS, len(points) - first)

        def part(start: int, stop: int, first: int = first) -> None:
            kernels.gather_subsurface(
                entering, places, areas, numbers, points, own, table, reach, first + start, first + stop, leaving
            )

        on_threads(part, *even_parts(count))
        yield (first + count) / len(points)
    return leaving


def simulate_subsurface(
    mesh: TransferPoints, caster: RayCaster, triangles: NDArray[np.int32], n: int, medium: Medium, n_rays: int = N_RAYS
) -> Generator[float, None, Float64Array]:
    """Vectors (P, n^2) of the points of a mesh, with its own shadows, in their own axes; triangles (T, 3): indices of
    these points. Yields the share that is done."""
    entering = yield from map_steps(simulate(mesh, caster, n, n_rays=n_rays), lambda share: 0.6 * share)
    places = mesh.points.position.astype(np.float64)
    sources = Sources(places, vertex_areas(places, triangles), np.arange(len(places), dtype=np.int32))
    in_world = rotate_transfer(entering, mesh.frames.transpose(0, 2, 1))
    leaving = yield from map_steps(subsurface(in_world, places, sources, medium), lambda share: 0.6 + 0.4 * share)
    return rotate_transfer(leaving, mesh.frames)


def vertex_areas(places: Float64Array, triangles: NDArray[np.int32]) -> Float64Array:
    """Area of the surface around each vertex (V,): a third of its triangles'."""
    a, b, c = (places[triangles[:, k]] for k in range(3))
    thirds = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0
    return np.asarray(np.bincount(triangles.ravel(), np.repeat(thirds, 3), len(places)), np.float64)
