"""The visible hemisphere of each shading point: four bits for each triangle of the sphere, in the point's own frame.

Visibility depends on geometry alone, neither on light nor on camera. Rays are traced adaptively: through the middle of
each of the 640 triangles of level 3 above the surface; where a triangle differs from one around it, through all four of
its children; where a child differs from an adjacent one, through its four children in turn. This finds a shadow's edge
to 1.4 degrees with half the rays of tracing all 2,560 triangles first. (One ray a triangle moves a sun's shadow by up
to half a triangle: an error of 9 % on the bunny's floor.)

On disk, bits are deflated. They are better than wavelets here: 1,280 bytes a point hold every edge to 1.4 degrees, and
deflated they are smaller than 80 coefficients of one byte with their indices (docs/orbit.md), without any error.
"""

from __future__ import annotations

import zlib
from collections.abc import Generator
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.core.stored_arrays import ArrayReader, UnsoundArrays
from engine.core.threads import n_threads, on_threads
from engine.light.emitters import EmitterPatches
from engine.precompute.indirect.direction_patterns import cosine_tables
from engine.realtime.core.shading_points import ShadingPoints
from engine.realtime.triple_product import _visibility_kernels as kernels
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene
from engine.sphere.geodesic import geodesic

LEVEL = 4
N_UPPER = 10 * 4**LEVEL

Bits = NDArray[np.uint8]

_CHUNK = 32  # points at a time and thread
_MOST_RAYS = 1 << 20
# Rays to an emitter end this share of their length before it.
SHORT = 1e-4
_DEFLATED_POINTS = 2048  # of a part
_DEFLATE_LEVEL = 1
# Rays by which a point finds out that it is enclosed, and the largest share of them that may see dark sides.
_N_RAYS, _MOST_DARK = 8, 0.5
_POINTS_AT_ONCE = 4096


@lru_cache(maxsize=1)
def upper_triangles() -> NDArray[np.int32]:
    """The triangles above the surface (2560,), ascending: the four children of a parent are consecutive. Read-only."""
    above = np.flatnonzero(geodesic(LEVEL).centres[:, 1] > 0.0).astype(np.int32)
    above.flags.writeable = False
    return above


def upper_directions() -> NDArray[np.float32]:
    """Unit directions (2560, 3) to the middles of the upper triangles."""
    return _tables()[0]


def finest_directions() -> NDArray[np.float32]:
    """Unit directions (10240, 3) to the middles of their children, four consecutive ones for each."""
    return _tables()[1]


def trace_hemispheres(points: ShadingPoints, caster: RayCaster, which: NDArray[np.integer], bits: Bits) -> None:
    """Fill the bits (S, 1280) of points (N,); caster: intersects the scene's triangles.

    Each triangle of `upper_triangles` has half a byte, the first in the low half; bit c belongs to child c, and 1 is
    visible.
    """
    requested = np.asarray(which, np.int64)

    def part(start: int) -> None:
        _trace_batch(points, caster, requested[start : start + _CHUNK], bits)

    on_threads(part, range(0, len(requested), _CHUNK))


def trace_coarsely(points: ShadingPoints, caster: RayCaster, which: NDArray[np.integer], bits: Bits) -> None:
    """As `trace_hemispheres`, by the first 640 rays alone: each stands for its triangle of level 3."""
    requested, way4 = np.asarray(which, np.int64), _tables()[0]

    def part(start: int) -> None:
        some = requested[start : start + _CHUNK]
        origins, directions = np.empty((2, len(some) * N_UPPER // 4, 3), np.float32)
        kernels.first_rays(some, points.lifted, points.frames, way4, origins, directions)
        middle, none = ~caster.occluded(origins, directions).reshape(len(some), -1), np.zeros(0, bool)
        free = np.repeat(middle, 4, axis=1)
        kernels.pack(free, np.zeros_like(free), none, some, bits)

    on_threads(part, range(0, len(requested), _CHUNK))


def trace_patches(
    points: ShadingPoints, caster: RayCaster, patches: EmitterPatches, which: NDArray[np.integer], bits: Bits
) -> None:
    """Fill the bits (S, ⌈L / 8⌉) of points (N,), the emitters' patches that each sees: one ray to a place on each."""
    step = max(_MOST_RAYS // n_threads() // max(len(patches), 1), 1)

    def part(start: int) -> None:
        some = which[start : start + step]
        origins = np.repeat(points.lifted[some], len(patches), axis=0)
        directions = np.tile(patches.samples, (len(some), 1)) - origins
        free = ~caster.occluded(origins, directions, np.full(len(directions), 1.0 - SHORT, np.float32))
        bits[some] = np.packbits(free.reshape(len(some), -1), axis=1, bitorder="little")

    on_threads(part, range(0, len(which), step))


def _trace_batch(points: ShadingPoints, caster: RayCaster, which: NDArray[np.int64], bits: Bits) -> None:
    way4, way5, around3, beside4 = _tables()
    n = len(which)
    lifted, frames = points.lifted, points.frames
    origins, directions = np.empty((2, n * N_UPPER // 4, 3), np.float32)
    kernels.first_rays(which, lifted, frames, way4, origins, directions)
    middle = ~caster.occluded(origins, directions).reshape(n, -1)
    requested, n_requested = _doubtful(middle, around3, caster.blends)
    origins, directions = np.empty((2, 3 * n_requested, 3), np.float32)
    kernels.more_rays(which, requested, lifted, frames, way4, 3, origins, directions)
    free = np.empty((n, N_UPPER), bool)
    kernels.spread(middle, requested, caster.occluded(origins, directions), free)
    requested, n_requested = _doubtful(free, beside4, caster.blends)
    origins, directions = np.empty((2, 4 * n_requested, 3), np.float32)
    kernels.more_rays(which, requested, lifted, frames, way5, 4, origins, directions)
    kernels.pack(free, requested, caster.occluded(origins, directions), which, bits)


def _doubtful(free: NDArray[np.bool_], neighbours: NDArray[np.int32], blends: bool) -> tuple[NDArray[np.bool_], int]:
    """Which flags (N, T) differ from one of their neighbours' (T, k), and their number; all where rays pass at random,
    because then neighbours that agree would make the more frequent answer the only one."""
    requested = np.ones_like(free)
    return requested, free.size if blends else kernels.differing(free, neighbours, requested)


@lru_cache(maxsize=1)
def _tables() -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32], NDArray[np.int32]]:
    """Directions of the upper triangles (2560, 3) and of their children (10240, 3); the triangles that share a corner
    with each parent (640, 13), and those adjacent to each triangle (2560, 3), −1 for none and for those below."""
    above = upper_triangles()
    way4 = geodesic(LEVEL).centres[above].astype(np.float32)
    way5 = geodesic(LEVEL + 1).centres.reshape(-1, 4, 3)[above].reshape(-1, 3).astype(np.float32)
    place = np.full(geodesic(LEVEL).n_triangles, -1, np.int32)
    place[above] = np.arange(N_UPPER)
    parents = place[::4] // 4  # −1 // 4 is −1
    corners = geodesic(LEVEL - 1).triangles
    sharing: list[list[int]] = [[] for _ in range(int(corners.max()) + 1)]
    for t, three in enumerate(corners):
        for corner in three:
            sharing[corner].append(t)
    around = np.full((N_UPPER // 4, 13), -1, np.int32)
    for j, t in enumerate(above[::4] // 4):
        others = parents[sorted({s for corner in corners[t] for s in sharing[corner]} - {t})]
        around[j, : len(others)] = others
    return way4, way5, around, place[geodesic(LEVEL).neighbours[above]]


def deflate_bits(name: str, bits: Bits) -> dict[str, NDArray[np.generic]]:
    """Deflate bits (S, B) into arrays to be stored under names that begin with `name`."""
    # Transposed, so that the bits of neighbouring points, which see about the same, are adjacent.
    parts = on_threads(
        lambda at: zlib.compress(bits[at : at + _DEFLATED_POINTS].T.tobytes(), _DEFLATE_LEVEL),
        range(0, len(bits), _DEFLATED_POINTS),
    )
    ends = np.cumsum([0, *map(len, parts)], dtype=np.int64)
    return {f"{name}_data": np.frombuffer(b"".join(parts), np.uint8), f"{name}_starts": ends}


def inflate_bits(name: str, reader: ArrayReader, n_points: int, n_bytes: int) -> Bits:
    """Inflate what `deflate_bits` made of bits (S, B). Raises UnsoundArrays."""
    begins = range(0, n_points, _DEFLATED_POINTS)
    reader.sizes[f"{name} parts"] = len(begins)
    starts = reader.runs(f"{name}_starts", f"{name} parts", f"{name} bytes")
    data = reader.take(f"{name}_data", np.uint8, f"{name} bytes").tobytes()
    bits = np.empty((n_points, n_bytes), np.uint8)

    def part(i: int) -> None:
        stop = min(begins[i] + _DEFLATED_POINTS, n_points)
        size = (stop - begins[i]) * n_bytes
        found = zlib.decompressobj().decompress(data[starts[i] : starts[i + 1]], size + 1)
        if len(found) != size:
            raise UnsoundArrays(f"{name!r} has {len(found)} bytes in part {i}, expected {size}")
        bits[begins[i] : stop] = np.frombuffer(found, np.uint8).reshape(n_bytes, stop - begins[i]).T

    try:
        on_threads(part, range(len(begins)))
    except zlib.error as error:
        raise UnsoundArrays(f"{name!r}: {error}") from error
    return bits


def find_enclosed(
    scene: Scene, caster: RayCaster, points: ShadingPoints, first: int = 0
) -> Generator[None, None, NDArray[np.bool_]]:
    """Find which of the points from `first` on (S - first,) see sides that light cannot reach with more than
    `_MOST_DARK` of their rays, in pieces.

    caster: intersects the scene's triangles. `ShadingPoints.sides` tells which sides are dark: a point that sees the
    inside of a solid, which no light reaches, is inside it.
    """
    found, tables = np.zeros(len(points) - first, bool), cosine_tables(_N_RAYS)
    frames = points.frames[:, [0, 2, 1]]  # the tables' third axis is the normal
    for start in range(first, len(points), _POINTS_AT_ONCE):
        some = np.arange(start, min(start + _POINTS_AT_ONCE, len(points)))
        directions = np.einsum("nrk,nki->nri", tables[some % len(tables)], frames[some]).reshape(-1, 3)
        met = caster.intersect(
            np.repeat(points.lifted[some], _N_RAYS, axis=0), np.ascontiguousarray(directions)
        ).triangle
        side = (np.einsum("rk,rk->r", scene.geometric_normals[met], directions) > 0.0).astype(np.intp)
        is_dark = (met >= 0) & ~points.sides[scene.object_of_triangle[met], side]
        found[some - first] = is_dark.reshape(-1, _N_RAYS).mean(axis=1) > _MOST_DARK
        yield
    return found
