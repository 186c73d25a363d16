"""Triangulates the polygons of a mesh exactly, and finds those that repeat another.

A polygon that is star-shaped about its first corner becomes a fan about it, as most files intend. Others are cut by ear
clipping [Meisters75] in the plane of their Newell normal: a fan would cover area outside, and turn an L of area 3 into
4. An outline may touch itself, or lead to a hole and back. Rejected: monotone pieces [Garey78], whose cost is n log n
for any outline, but which do not allow one that touches or crosses itself.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Float64Array = npt.NDArray[np.float64]
Int64Array = npt.NDArray[np.int64]
Int32Array = npt.NDArray[np.int32]

STEPS_A_BYTE = 400
_FEWEST_STEPS = 10_000_000
_THIN = 1e-12


def triangulate(
    places: Float64Array, lengths: Int64Array, n_bytes: int, note: Callable[[str], object] | None = None
) -> Int32Array:
    """Triangles (T, 3) of polygons, in their order, as indices of corners.

    places (C, 3): positions of the corners of all polygons one after the other; lengths (N,), each at least 3; n_bytes:
    of the file, which limits the cost: the largest polygons remain fans where all would take longer to cut. note: gets
    a line on these.
    """
    fans, owner = _fans(lengths)
    if (lengths == 3).all():
        return fans
    starts = np.cumsum(lengths) - lengths
    with np.errstate(invalid="ignore", over="ignore"):  # positions that are not finite are reported elsewhere
        local = places - np.repeat(places[starts], lengths, axis=0)  # far from the origin products would be inaccurate
        flat, has_area = _project_to_plane(local, lengths, starts)
        badly = np.bincount(owner, ~_are_solid(flat, fans), len(lengths)) > 0
    chosen = np.flatnonzero(badly & has_area & (lengths > 3))
    chosen = chosen[np.argsort(lengths[chosen], kind="stable")]
    if not len(chosen):
        return fans
    from engine.scene._polygon_kernels import cut_ears  # late: most files do not need the compiler

    most = int((lengths[chosen] - 2).sum())
    ears, owners = np.empty((most, 3), np.int64), np.empty(most, np.int64)
    steps = max(_FEWEST_STEPS, STEPS_A_BYTE * n_bytes)
    found, failed = cut_ears(flat, starts[chosen], lengths[chosen], steps, ears, owners)
    if failed >= 0:
        if note is not None:
            n, fewest = len(chosen) - failed, lengths[chosen[failed]]
            note(f"faces of {fewest} corners and more: {n} not cut exactly, which would take too long")
        chosen = chosen[:failed]
    rest = np.isin(owner, chosen, invert=True)
    triangles = np.concatenate([fans[rest], ears[:found].astype(np.int32)])
    return triangles[np.argsort(np.concatenate([owner[rest], chosen[owners[:found]]]), kind="stable")]


def repeated_polygons(vertices: Int64Array, lengths: Int64Array, either_way: bool) -> npt.NDArray[np.bool_]:
    """Which polygons (N,) have the corners of an earlier one in the same order, or, `either_way`, in any.

    vertices (C,): indices of the corners of all polygons one after the other; lengths (N,). Two cuts of one quad into
    triangles may share none of these, so that repeats are found before. Polygons are distinguished by sums of 64 bits
    over their corners or their directed edges, so that it does not matter where an outline begins.
    """
    if not len(lengths):
        return np.zeros(0, bool)
    starts = np.cumsum(lengths) - lengths
    keys = vertices.astype(np.uint64)
    if not either_way:
        after = np.arange(1, len(vertices) + 1)
        after[starts + lengths - 1] = starts
        keys = keys * np.uint64(1 << 32) + keys[after]
    sums = np.add.reduceat(_scrambled(keys), starts) + lengths.astype(np.uint64)
    repeated = np.ones(len(lengths), bool)
    repeated[np.unique(sums, return_index=True)[1]] = False
    return repeated


def left_out_notes(n_repeated: int, n_short: int) -> tuple[str, ...]:
    """Notes on polygons that are left out, if there are any: that repeat another, and of less than three corners."""
    lines = (n_repeated, "faces that repeat another left out"), (n_short, "faces of less than 3 corners left out")
    return tuple(f"{n} {what}" for n, what in lines if n)


def _scrambled(keys: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Well mixed bits of keys, the same for the same keys [Steele14]."""
    keys = (keys + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    keys = (keys ^ (keys >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    keys = (keys ^ (keys >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return keys ^ (keys >> np.uint64(31))


def _fans(lengths: Int64Array) -> tuple[Int32Array, Int64Array]:
    """Triangles (a, b, c), (a, c, d)… of polygons, as indices of corners, and the polygon of each."""
    starts, n_each = np.cumsum(lengths) - lengths, lengths - 2
    owner = np.repeat(np.arange(len(lengths)), n_each)
    first = starts[owner]
    step = np.arange(len(owner)) - np.repeat(np.cumsum(n_each) - n_each, n_each)
    return np.stack([first, first + step + 1, first + step + 2], axis=1).astype(np.int32), owner


def _project_to_plane(
    local: Float64Array, lengths: Int64Array, starts: Int64Array
) -> tuple[Float64Array, npt.NDArray[np.bool_]]:
    """Project the corners (C, 2) along the coordinate axis nearest to the polygon's normal [Newell75], so that the
    polygon runs counter-clockwise; and return which polygons have an area. Areas shrink by one factor for each polygon,
    and no coordinate is rounded."""
    n = len(local)
    after = np.arange(1, n + 1)
    after[starts + lengths - 1] = starts
    normals = np.add.reduceat(np.cross(local, local[after]), starts, axis=0)
    axis = np.abs(normals).argmax(axis=1)
    size = normals[np.arange(len(axis)), axis]
    u, v = np.array([1, 2, 0])[axis], np.array([2, 0, 1])[axis]
    u, v = np.where(size < 0.0, v, u), np.where(size < 0.0, u, v)
    corners = np.arange(n)
    flat = np.stack([local[corners, np.repeat(u, lengths)], local[corners, np.repeat(v, lengths)]], axis=1)
    return np.ascontiguousarray(flat), (size != 0.0) & np.isfinite(size)


def _are_solid(flat: Float64Array, triangles: Int32Array) -> npt.NDArray[np.bool_]:
    """Which triangles of corners in the plane run counter-clockwise and have an area."""
    corners = flat[triangles]
    edges = corners[:, (1, 2, 0)] - corners
    doubled = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    return doubled > _THIN * (edges**2).sum(axis=2).max(axis=1)
