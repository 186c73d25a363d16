"""Faces that lie on others in one plane are lifted off them: rays and depth buffers would find either, pixel by pixel.

Two faces overlap where both lie in one plane and share an area. The later one, in the order of objects and faces, is
the upper one, as the later of two decals is: it is moved along the normal by a ten-thousandth of its object's size, far
less than a pixel, once for each face below it. Left alone are faces that look alike, flat and of one plain material,
as where walls meet; faces of opposite directions, unless both objects have open edges, because the bottom of a box on a
floor is not seen; and what animations move.

Faces are sorted into planes, and in each plane into the cells of a grid, so that the time grows with their number.
Rejected: a rule in the ray caster (each ray would go on behind its hit, and pictures by depth buffers kept their
flecks).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from engine.scene.mesh import Mesh, face_normals, position_ids

Float64Array = npt.NDArray[np.float64]
Int64Array = npt.NDArray[np.int64]

LIFT = 1e-4  # of an object's longest side
# Faces are compared where normals and offsets of their planes are equal to these steps; of the scene's size.
_NORMAL_STEP, _OFFSET_STEP = 1e-3, 2e-5
_EVEN = 1e-3  # of a unit normal's components: corners of a flat face
_SAME_PLACE = 1e-6  # of the scene's size: planes are equal
# Of the lower of two faces' heights: a smaller overlap is the rounding of a common edge.
_LEAST_OVERLAP = 1e-2
_FEW = 16  # faces of a plane that are all compared
_MOST_CELLS = 64  # that a face may cover; larger ones are compared with all of their plane
_MOST_PAIRS = 8_000_000  # candidates; what lies in planes beyond is left alone
_AT_ONCE = 1 << 18


@dataclass(frozen=True)
class _Faces:
    """Faces of all objects in the world: corners (T, 3, 3), unit normals (T, 3), outward where the object is closed;
    object (T,); whether all normals of its corners are its own (T,)."""

    corners: Float64Array
    normals: Float64Array
    owner: Int64Array
    flat: npt.NDArray[np.bool_]


def lift_overlapping_faces(meshes: Sequence[Mesh], can_move: Sequence[bool], looks: Sequence[int]) -> list[Mesh]:
    """The placed meshes of a scene's objects, those of their faces that overlap an earlier one lifted, each with
    vertices of its own. can_move: which objects may be changed; looks: equal numbers for objects of equal, plain
    materials, below 0 for others."""
    found = list(meshes)
    if not found:
        return found
    faces = _faces_of(meshes)
    lower, upper = _overlapping_pairs(faces)
    look, flat = np.asarray(looks, np.int64)[faces.owner], faces.flat
    unlike = (look[lower] != look[upper]) | (look[lower] < 0) | ~flat[lower] | ~flat[upper]
    lower, upper = lower[unlike], upper[unlike]
    same = np.einsum("pk,pk->p", faces.normals[lower], faces.normals[upper]) > 0.0
    if not same.all():
        is_open = np.array([_is_open(mesh) for mesh in meshes])
        seen = same | (is_open[faces.owner[lower]] & is_open[faces.owner[upper]])
        lower, upper, same = lower[seen], upper[seen], same[seen]
    moves = np.asarray(can_move, bool)[faces.owner[upper]]
    lower, upper, same = lower[moves], upper[moves], same[moves]
    if not len(upper):
        return found
    level, towards = _levels(lower, upper, same, len(faces.owner))
    starts = np.cumsum([0] + [len(mesh.triangles) for mesh in meshes])
    for i in np.unique(faces.owner[upper]).tolist():
        own = slice(starts[i], starts[i + 1])
        found[i] = _lifted(meshes[i], level[own] * towards[own], faces.normals[own])
    return found


def _faces_of(meshes: Sequence[Mesh]) -> _Faces:
    corners = np.concatenate([mesh.vertices[mesh.triangles] for mesh in meshes])
    normals = np.concatenate([_outward_normals(mesh) for mesh in meshes])
    owner = np.repeat(np.arange(len(meshes)), [len(mesh.triangles) for mesh in meshes])
    flat = [
        np.ones(len(mesh.triangles), bool) if mesh.normals is None else _are_flat(mesh.normals[mesh.triangles])
        for mesh in meshes
    ]
    return _Faces(corners, normals, owner, np.concatenate(flat))


def _outward_normals(mesh: Mesh) -> Float64Array:
    """Unit normals (T, 3) of its faces; turned where it is closed and wound inwards, as some exporters leave it."""
    normals = face_normals(mesh.vertices, mesh.triangles)[0]
    one, two, three = np.moveaxis(mesh.vertices[mesh.triangles] - mesh.vertices.mean(axis=0), 1, 0)
    volume = float(np.einsum("tk,tk->", one, np.cross(two, three)))
    return -normals if volume < 0.0 and not _is_open(mesh) else normals


def _are_flat(normals: Float64Array) -> npt.NDArray[np.bool_]:
    """Which faces have one normal (T,) at all corners (T, 3, 3)."""
    return np.asarray((np.abs(normals[:, 1:] - normals[:, :1]) <= _EVEN).all(axis=(1, 2)))


def _overlapping_pairs(faces: _Faces) -> tuple[Int64Array, Int64Array]:
    """The earlier and the later (P,) of each two faces that share an area in one plane."""
    middle = 0.5 * (faces.corners.min(axis=(0, 1)) + faces.corners.max(axis=(0, 1)))
    size = float(np.abs(faces.corners - middle).max()) or 1.0
    # A plane has one normal of two: that whose largest component is positive.
    axis = np.abs(faces.normals).argmax(axis=1)
    planes = np.sign(np.take_along_axis(faces.normals, axis[:, None], axis=1)) * faces.normals
    offsets = np.einsum("tk,tk->t", planes, faces.corners.mean(axis=1) - middle) / size
    steps = np.rint(np.column_stack([planes / _NORMAL_STEP, offsets / _OFFSET_STEP])).astype(np.int64)
    keys = (steps * np.array([1, 1_000_003, 998_244_353, 2_147_483_647])).sum(axis=1)  # wraps: a hash
    order = np.argsort(keys, kind="stable")
    begins = np.flatnonzero(np.append(True, np.diff(keys[order]) != 0))
    counts = np.diff(np.append(begins, len(order)))
    few = np.repeat(counts <= _FEW, counts)
    found, n_left = [_pairs_in_runs(keys[order[few]], _MOST_PAIRS)], _MOST_PAIRS
    found[0] = order[few][found[0][0]], order[few][found[0][1]]
    for begin, count in zip(begins[counts > _FEW].tolist(), counts[counts > _FEW].tolist(), strict=True):
        own = order[begin : begin + count]
        across = [k for k in range(3) if k != axis[own[0]]]
        one, two = _candidates(faces.corners[own][:, :, across], n_left)
        n_left -= len(one)
        found.append((own[one], own[two]))
    one, two = (np.concatenate(each) for each in zip(*found, strict=True))
    overlaps = [
        _overlap(faces, one[k : k + _AT_ONCE], two[k : k + _AT_ONCE], axis, 2.0 * _SAME_PLACE * size)
        for k in range(0, len(one), _AT_ONCE)
    ]
    chosen = np.concatenate([np.zeros(0, bool), *overlaps])
    return np.minimum(one, two)[chosen], np.maximum(one, two)[chosen]


def _overlap(faces: _Faces, one: Int64Array, two: Int64Array, axis: Int64Array, least: float) -> npt.NDArray[np.bool_]:
    """Which of these pairs (P,) of faces share an area in one plane. axis (T,): along which a face is seen."""
    away = np.einsum("pck,pk->pc", faces.corners[two] - faces.corners[one][:, :1], faces.normals[one])
    found = (np.abs(away) <= least).all(axis=1)
    rows = np.flatnonzero(found)
    across = np.array([[1, 2], [0, 2], [0, 1]])[axis[one[rows]]][:, None]
    flat = (np.take_along_axis(faces.corners[each[rows]], across, axis=2) for each in (one, two))
    found[rows] = _share_area(*flat)
    return found


def _candidates(flat: Float64Array, most: int) -> tuple[Int64Array, Int64Array]:
    """Pairs of triangles (T, 3, 2) whose boxes overlap; none where they would be more than `most`."""
    low, high = flat.min(axis=1), flat.max(axis=1)
    step = np.maximum(np.median(high - low, axis=0), 1e-300)
    first, last = (np.floor((each - low.min(axis=0)) / step).astype(np.int64) for each in (low, high))
    widths = last - first + 1
    n_cells = widths.prod(axis=1)
    is_large = n_cells > _MOST_CELLS
    large, small = np.flatnonzero(is_large), np.flatnonzero(~is_large)
    # Each small triangle is in all cells of its box.
    face = np.repeat(small, n_cells[small])
    place = np.arange(len(face)) - np.repeat(np.cumsum(n_cells[small]) - n_cells[small], n_cells[small])
    column, row = place % widths[face, 0], place // widths[face, 0]
    cell = (first[face, 0] + column) * (int(last[:, 1].max()) + 1) + first[face, 1] + row
    order = np.argsort(cell, kind="stable")
    one, two = _pairs_in_runs(cell[order], most - len(large) * len(flat))
    one = np.concatenate([face[order[one]], np.repeat(large, len(flat))])
    two = np.concatenate([face[order[two]], np.tile(np.arange(len(flat)), len(large))])
    meets = (one != two) & (low[one] < high[two]).all(axis=1) & (low[two] < high[one]).all(axis=1)
    pairs = np.unique(np.minimum(one, two)[meets] * len(flat) + np.maximum(one, two)[meets])
    return pairs // len(flat), pairs % len(flat)


def _pairs_in_runs(sorted_values: Int64Array, most: int) -> tuple[Int64Array, Int64Array]:
    """Indices of all pairs of equal values; none where they would be more than `most`."""
    if not len(sorted_values):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    begins = np.flatnonzero(np.append(True, np.diff(sorted_values) != 0))
    counts = np.diff(np.append(begins, len(sorted_values)))
    ends = np.repeat(begins + counts, counts)
    index = np.arange(len(sorted_values))
    behind = ends - index - 1  # how many of its run come after each
    if behind.sum() > most:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    one = np.repeat(index, behind)
    two = one + 1 + np.arange(len(one)) - np.repeat(np.cumsum(behind) - behind, behind)
    return one, two


def _share_area(one: Float64Array, two: Float64Array) -> npt.NDArray[np.bool_]:
    """Whether triangles (P, 3, 2) share an area with others: no edge of either has the other on its outer side."""
    separate = np.zeros(len(one), bool)
    for own, other in ((one, two), (two, one)):
        edges = own[:, (1, 2, 0)] - own
        area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
        least = _LEAST_OVERLAP * np.minimum(np.abs(area), _doubled_area(other))
        for k in range(3):
            to = other - own[:, k : k + 1]
            # Twice the area of edge and corner, positive on the triangle's own side.
            inward = np.sign(area)[:, None] * (edges[:, k, None, 0] * to[:, :, 1] - edges[:, k, None, 1] * to[:, :, 0])
            separate |= (inward <= least[:, None]).all(axis=1)
    return ~separate


def _doubled_area(flat: Float64Array) -> Float64Array:
    edges = flat[:, 1:] - flat[:, :1]
    return np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])


def _levels(
    lower: Int64Array, upper: Int64Array, same: npt.NDArray[np.bool_], n_faces: int
) -> tuple[Int64Array, Int64Array]:
    """How many faces lie below each (T,), one on the other, and the direction in which it is lifted, 1 for that of its
    own normal, else −1."""
    level, towards = np.zeros(n_faces, np.int64), np.ones(n_faces, np.int64)
    order = np.argsort(lower, kind="stable")[::-1]
    towards[upper[order]] = np.where(same[order], 1, -1)  # by the first face below
    while True:
        raised = level.copy()
        np.maximum.at(raised, upper, level[lower] + 1)
        if (raised == level).all():
            return level, towards
        level = raised


def _lifted(mesh: Mesh, steps: Int64Array, normals: Float64Array) -> Mesh:
    """The mesh with some faces (T,) lifted by so many steps along their normals (T, 3)."""
    moved = np.flatnonzero(steps)
    size = float(np.ptp(mesh.vertices[np.unique(mesh.triangles)], axis=0).max())
    corners = mesh.triangles[moved].ravel()
    places = mesh.vertices[corners] + np.repeat(LIFT * size * steps[moved, None] * normals[moved], 3, axis=0)
    triangles = mesh.triangles.copy()
    triangles[moved] = len(mesh.vertices) + np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    own = None if mesh.normals is None else np.concatenate([mesh.normals, mesh.normals[corners]])
    return replace(mesh, vertices=np.concatenate([mesh.vertices, places]), triangles=triangles, normals=own)


def _is_open(mesh: Mesh) -> bool:
    """Whether some edge has one face only."""
    corners = position_ids(mesh.vertices)[mesh.triangles]
    edges = np.sort(np.stack([corners, corners[:, (1, 2, 0)]], axis=2).reshape(-1, 2), axis=1)
    _, uses = np.unique(edges @ np.array([int(corners.max()) + 1, 1]), return_counts=True)
    return bool((uses == 1).any())
