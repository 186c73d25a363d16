"""The geodesic sphere: an icosahedron whose spherical triangles are recursively split in four.

One hierarchy serves visibility bits, triangle lights, spherical Haar wavelets and quadrature. Level l has 20*4^l
triangles. The children of triangle t are 4t, 4t+1, 4t+2 (at its corners 0, 1, 2) and 4t+3 (the centre), so the
descendants of a triangle are one contiguous range at every finer level. Vertices retain their number on finer levels:
the first 10*4^l + 2 vertices of a finer level are those of level l.

The icosahedron has vertices at +Y and -Y. Its belt edges then cross the horizon at their midpoints, so from level 1 on
no triangle straddles the plane y = 0: a floor sees whole triangles only. The usual orientation, with an edge on top,
was rejected because it lacks this property.

Splitting at edge midpoints does not preserve area: at level 4 the largest triangle has 1.30 times the solid angle of
the smallest. Use `solid_angles`, never 4*pi / (20*4^l).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.sphere import _kernels

MAX_LEVEL = 7
_THREADING_PAYS = 20_000

Float64Array = NDArray[np.float64]
Int32Array = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Geodesic:
    """One level of the hierarchy. Arrays are read-only and shared: copy before writing.

    vertices: (V, 3) float64, unit. triangles: (T, 3) int32, counter-clockwise seen from outside. centres: (T, 3)
    float64, unit, the direction of each triangle's true centroid (its integral of omega d omega). solid_angles: (T,)
    float64 steradians, summing to 4 pi.
    """

    level: int
    vertices: Float64Array
    triangles: Int32Array
    centres: Float64Array
    solid_angles: Float64Array

    @property
    def n_triangles(self) -> int:
        return len(self.triangles)

    @cached_property
    def edges(self) -> Int32Array:
        """(E, 2) int32: the two vertices of every edge once, the smaller number first; E = 30 * 4^level."""
        return self._edges_and_owners[0]

    @cached_property
    def triangle_edges(self) -> Int32Array:
        """(T, 3) int32 into `edges`: entry k is the edge between corner k and corner k+1 (mod 3)."""
        return self._edges_and_owners[1]

    @cached_property
    def _edges_and_owners(self) -> tuple[Int32Array, Int32Array]:
        edges, which = _unique_edges(self.triangles, len(self.vertices))
        return _readonly(edges), _readonly(which)

    @cached_property
    def neighbours(self) -> Int32Array:
        """(T, 3) int32: entry k is the triangle across the edge from corner k to corner k+1 (mod 3)."""
        return _readonly(_edge_neighbours(self.triangles, len(self.vertices)))


@lru_cache(maxsize=MAX_LEVEL + 1)
def geodesic(level: int) -> Geodesic:
    """The sphere at `level` (0 to 7), built once and cached.

    Raises ValueError for a level outside the range.
    """
    _check_level(level)
    if level == 0:
        vertices, triangles = _icosahedron()
    else:
        coarser = geodesic(level - 1)
        vertices, triangles = _split_in_four(coarser.vertices, coarser.triangles)
    corners = vertices[triangles]
    centroids = triangle_first_moments(corners)
    centres = centroids / np.linalg.norm(centroids, axis=1, keepdims=True)
    return Geodesic(
        level,
        _readonly(vertices),
        _readonly(triangles),
        _readonly(centres),
        _readonly(triangle_solid_angles(corners)),
    )


def locate(directions: NDArray[np.floating], level: int) -> Int32Array:
    """The triangle of `level` that contains each direction; a direction on an edge or a vertex gets one of its
    triangles.

    directions: (N, 3), any positive length. Returns (N,) int32. The result is exact for the spherical triangles: a
    descent through the hierarchy by the planes of the great circles. Raises ValueError for a wrong shape, an invalid
    level, or a direction that is zero or not finite.
    """
    _check_level(level)
    flat = np.ascontiguousarray(directions, dtype=np.float64)
    if flat.ndim != 2 or flat.shape[1] != 3:
        raise ValueError(f"directions have shape {np.shape(directions)}, expected (N, 3)")
    found = np.empty(len(flat), np.int32)
    roots, planes = descent_tables(level)
    parts = even_parts(len(flat)) if len(flat) >= _THREADING_PAYS else ([0], [len(flat)])
    bad = on_threads(lambda i, j: _kernels.locate_range(flat, level, roots, planes, i, j, found), *parts)
    first_bad = min((i for i in bad if i >= 0), default=-1)
    if first_bad >= 0:
        raise ValueError(f"direction {first_bad} is {flat[first_bad].tolist()}, expected finite and not zero")
    return found


@lru_cache(maxsize=MAX_LEVEL + 1)
def descent_tables(level: int) -> tuple[Float64Array, Float64Array]:
    """The tables for the descent of `_kernels.locate_one`: 20 root centres and, for every triangle above `level`, three
    planes.

    Returns roots (20, 3) and planes (20 * (4^level - 1) / 3, 3, 3): plane k of a triangle has a positive dot product
    with directions on the side of corner k, beyond the edge of the centre child. Triangle t of level l is row 20 * (4^l
    - 1) / 3 + t.
    """
    planes = [_middle_planes(geodesic(coarser)) for coarser in range(level)]
    stacked = np.concatenate(planes) if planes else np.empty((0, 3, 3))
    return geodesic(0).centres, _readonly(np.ascontiguousarray(stacked))


def triangle_solid_angles(corners: Float64Array) -> Float64Array:
    """Solid angle of spherical triangles with unit corners (..., 3, 3), in steradians, signed by orientation.

    tan(Omega / 2) = a . (b x c) / (1 + a.b + b.c + c.a)    [VanOosterom83]
    """
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    numerator = np.einsum("...i,...i", a, np.cross(b, c))
    dots = [np.einsum("...i,...i", p, q) for p, q in ((a, b), (b, c), (c, a))]
    return 2.0 * np.arctan2(numerator, 1.0 + dots[0] + dots[1] + dots[2])


def triangle_first_moments(corners: Float64Array) -> Float64Array:
    """The integral of omega d omega over spherical triangles with unit corners (..., 3, 3).

    Half the sum over the edges of the edge's angle times the unit normal of its great circle: Lambert's formula for the
    vector irradiance of a polygon, read as geometry [Arvo95].
    """
    following = np.roll(corners, -1, axis=-2)
    normals = np.cross(corners, following)
    sines = np.linalg.norm(normals, axis=-1, keepdims=True)
    cosines = np.einsum("...i,...i", corners, following)[..., None]
    angles = np.arctan2(sines, cosines)
    return 0.5 * (normals * (angles / sines)).sum(axis=-2)


def _check_level(level: int) -> None:
    if not 0 <= level <= MAX_LEVEL:
        raise ValueError(f"level = {level}, expected 0 to {MAX_LEVEL}")


def _readonly(array: NDArray) -> NDArray:
    array.flags.writeable = False
    return array


def _icosahedron() -> tuple[Float64Array, Int32Array]:
    """Unit icosahedron: a vertex at +Y, a ring of five at y = 1/sqrt(5), its mirror image rotated by 36 degrees, one at
    -Y."""
    height, radius = 1.0 / np.sqrt(5.0), 2.0 / np.sqrt(5.0)
    ring = 2.0 * np.pi * np.arange(5) / 5.0
    upper = np.stack([radius * np.sin(ring), np.full(5, height), -radius * np.cos(ring)], axis=1)
    lower = -upper
    vertices = np.concatenate([[[0.0, 1.0, 0.0]], upper, lower, [[0.0, -1.0, 0.0]]])
    faces = [
        (a, b, c)
        for a in range(12)
        for b in range(a + 1, 12)
        for c in range(b + 1, 12)
        if min(vertices[a] @ vertices[b], vertices[b] @ vertices[c], vertices[c] @ vertices[a]) > 0.4
    ]
    triangles = np.array(faces, np.int32)
    inward = np.linalg.det(vertices[triangles]) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    return vertices, triangles


def _split_in_four(vertices: Float64Array, triangles: Int32Array) -> tuple[Float64Array, Int32Array]:
    """Splits each triangle at its normalised edge midpoints; new vertices are appended to the old ones."""
    edges, which = _unique_edges(triangles, len(vertices))
    middles = vertices[edges].sum(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    v, m = triangles, np.int32(len(vertices)) + which
    children = np.stack(
        [
            np.stack([v[:, 0], m[:, 0], m[:, 2]], axis=1),
            np.stack([m[:, 0], v[:, 1], m[:, 1]], axis=1),
            np.stack([m[:, 2], m[:, 1], v[:, 2]], axis=1),
            np.stack([m[:, 0], m[:, 1], m[:, 2]], axis=1),
        ],
        axis=1,
    )
    return np.concatenate([vertices, middles]), np.ascontiguousarray(children.reshape(-1, 3))


def _unique_edges(triangles: Int32Array, n_vertices: int) -> tuple[Int32Array, Int32Array]:
    """Every undirected edge once (E, 2), and the indices of each triangle's three edges (T, 3)."""
    starts, ends = triangles.astype(np.int64), np.roll(triangles, -1, axis=1).astype(np.int64)
    codes, which = np.unique(np.minimum(starts, ends) * n_vertices + np.maximum(starts, ends), return_inverse=True)
    edges = np.stack([codes // n_vertices, codes % n_vertices], axis=1)
    return edges.astype(np.int32), which.reshape(triangles.shape).astype(np.int32)


def _middle_planes(sphere: Geodesic) -> Float64Array:
    """(T, 3, 3): for each triangle the normals of the planes that separate its three corner children from its centre
    child."""
    corners = sphere.vertices[sphere.triangles]
    middles = corners + np.roll(corners, -1, axis=1)  # the midpoints of edges 01, 12, 20; only their direction matters
    middles /= np.linalg.norm(middles, axis=2, keepdims=True)
    planes = np.cross(middles, np.roll(middles, 1, axis=1))  # corner 0 lies beyond m01 x m20, and so on
    outward = np.einsum("tki,tki->tk", planes, corners) < 0.0
    planes[outward] *= -1.0
    return planes


def _edge_neighbours(triangles: Int32Array, n_vertices: int) -> Int32Array:
    """Pairs the two directed copies of every edge: triangle t owns a->b where its neighbour owns b->a."""
    starts = triangles.astype(np.int64).ravel()
    ends = np.roll(triangles, -1, axis=1).astype(np.int64).ravel()
    forward, backward = starts * n_vertices + ends, ends * n_vertices + starts
    order = np.argsort(forward)
    partner = order[np.searchsorted(forward[order], backward)]
    return (partner // 3).astype(np.int32).reshape(-1, 3)
