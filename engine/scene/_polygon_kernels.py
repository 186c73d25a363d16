"""Compiled loop of `engine.scene.polygons`: ear clipping of one polygon after the other, in the plane."""

from __future__ import annotations

import numba as nb
import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Int64Array = NDArray[np.int64]
Flags = NDArray[np.bool_]

# A turn counts as none if the parallelogram of its edges is this small relative to their squares.
_FLAT = 1e-13
_CLOSE = 10


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _turn(points: Float64Array, a: int, b: int, c: int) -> float:
    """Twice the signed area of a triangle: positive if a, b, c run counter-clockwise, exactly 0 if they are collinear
    within rounding."""
    ux, uy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    vx, vy = points[c, 0] - points[b, 0], points[c, 1] - points[b, 1]
    doubled = ux * vy - uy * vx
    return doubled if abs(doubled) > _FLAT * (ux * ux + uy * uy + vx * vx + vy * vy) else 0.0


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _same(points: Float64Array, a: int, b: int) -> bool:
    """Whether two corners coincide."""
    return points[a, 0] == points[b, 0] and points[a, 1] == points[b, 1]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _enters(points: Float64Array, corner: int, right: int, left: int, before: int, after: int) -> bool:
    """Whether an edge to one of two points leaves a corner strictly inside its angle from `right` to `left`, < 180°."""
    for end in (before, after):
        if _turn(points, right, corner, end) < 0.0 and _turn(points, left, corner, end) > 0.0:
            return True
    return False


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _blocks(points: Float64Array, previous: Int64Array, following: Int64Array, a: int, b: int, c: int, j: int) -> bool:
    """Whether corner j, which does not turn left, prevents clipping the triangle a, b, c: it lies in it or on its
    outline. If it coincides with a corner, as where an outline touches itself or leads to a hole and back, it does so
    if one of its edges enters the triangle."""
    if j == a or j == b or j == c:
        return False
    before, after = previous[j], following[j]
    if _same(points, j, a):
        return _enters(points, j, b, c, before, after)
    if _same(points, j, b):
        return _enters(points, j, c, a, before, after)
    if _same(points, j, c):
        return _enters(points, j, a, b, before, after)
    return _turn(points, a, b, j) >= 0.0 and _turn(points, b, c, j) >= 0.0 and _turn(points, c, a, j) >= 0.0


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _blocker(
    points: Float64Array, previous: Int64Array, following: Int64Array, order: Int64Array, across: Float64Array,
    upward: Float64Array,
    is_blunt: Flags, b: int,
) -> tuple[int, int]:  # fmt: skip
    """The first corner from the left that prevents clipping b, -1 if none does; and the number of steps this took: one
    for a corner that is skipped, `_CLOSE` for one that is tested.

    order: corners from left to right; across and upward (n,), their coordinates; is_blunt (n,), which of them are still
    present and do not turn left.
    """
    a, c = previous[b], following[b]
    # Bounding box of the triangle: only corners inside it can block.
    low_x, high_x = min(points[a, 0], points[b, 0], points[c, 0]), max(points[a, 0], points[b, 0], points[c, 0])
    low_y, high_y = min(points[a, 1], points[b, 1], points[c, 1]), max(points[a, 1], points[b, 1], points[c, 1])
    rounding = _FLAT * (high_x - low_x + high_y - low_y)
    low_x, high_x, low_y, high_y = low_x - rounding, high_x + rounding, low_y - rounding, high_y + rounding
    # Sweep over the corners within the box's range of x.
    k, steps = np.searchsorted(across, low_x), _CLOSE
    while k < len(order) and across[k] <= high_x:
        steps += 1
        if is_blunt[k] and low_y <= upward[k] <= high_y:
            steps += _CLOSE
            if _blocks(points, previous, following, a, b, c, order[k]):
                return order[k], steps
        k += 1
    return -1, steps


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _is_needless(points: Float64Array, a: int, b: int, c: int) -> bool:
    """Whether b adds nothing to an outline: it coincides with a neighbour, or is the tip of a spike of zero width."""
    if _same(points, a, b) or _same(points, b, c):
        return True
    along = (points[b, 0] - points[a, 0]) * (points[c, 0] - points[b, 0]) + (points[b, 1] - points[a, 1]) * (
        points[c, 1] - points[b, 1]
    )
    return _turn(points, a, b, c) == 0.0 and along < 0.0


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _least_bad(points: Float64Array, previous: Int64Array, following: Int64Array, start: int, n_left: int) -> int:
    """Choose a corner to clip when no ear is left, which happens for outlines that cross themselves: a corner that
    turns left, else any."""
    b = start
    for _ in range(n_left):
        if _turn(points, previous[b], b, following[b]) > 0.0:
            return b
        b = following[b]
    return start


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _cut(points: Float64Array, most_steps: int, triangles: Int64Array) -> tuple[int, int]:
    """Triangulate one polygon (n, 2): fill triangles with corner indices; return their number, and the steps it took,
    more than `most_steps` if it was abandoned.

    A corner is tested again after a neighbour was clipped; when no such corner is left, all are.
    """
    n = len(points)
    # The outline as a doubly linked list.
    previous, following = np.arange(-1, n - 1), np.arange(1, n + 1)
    previous[0], following[n - 1] = n - 1, 0
    # Corners sorted by x, for `_blocker`.
    order = np.argsort(points[:, 0], kind="mergesort")
    rank = np.empty(n, np.int64)
    rank[order] = np.arange(n)
    across, upward = points[order, 0], points[order, 1]
    is_blunt = np.empty(n, np.bool_)
    # Corners that do not turn left: only these can lie in an ear's triangle.
    for j in range(n):
        is_blunt[rank[j]] = not _turn(points, previous[j], j, following[j]) > 0.0
    # blocker: what prevented clipping a corner last time; it usually still does.
    blocker = np.full(n, -1)
    gone, is_queued = np.zeros(n, np.bool_), np.ones(n, np.bool_)
    # A circular queue of corners to test.
    queue, head, n_queued = np.arange(n), 0, n
    steps, n_triangles, n_left, cut_since = 0, 0, n, True
    while n_left > 2 and steps <= most_steps:
        if n_queued:
            b = queue[head]
            head, n_queued, is_queued[b] = (head + 1) % n, n_queued - 1, False
            if gone[b]:
                continue
            steps += _CLOSE
            needless = -1
            for j in (previous[b], b, following[b]):  # first: beside a spike a corner looks like an ear
                if _is_needless(points, previous[j], j, following[j]):
                    needless = j
            if needless >= 0:
                b = needless
            else:
                if is_blunt[rank[b]]:
                    continue
                # Test the last blocker before searching for another.
                j = blocker[b]
                if (
                    j >= 0
                    and is_blunt[rank[j]]
                    and _blocks(points, previous, following, previous[b], b, following[b], j)
                ):
                    continue
                blocker[b], taken = _blocker(points, previous, following, order, across, upward, is_blunt, b)
                steps += taken
                if blocker[b] >= 0:
                    continue
        # Queue empty, but something was clipped: test all corners once more.
        elif cut_since:
            for j in range(n):
                if not gone[j]:
                    queue[(head + n_queued) % n], is_queued[j] = j, True
                    n_queued += 1
            steps, cut_since = steps + n, False
            continue
        # No ear is left.
        else:
            b = _least_bad(points, previous, following, previous[b], n_left)
            steps += _CLOSE * n_left
        # Clip b: output its triangle unless it has no area, and unlink it.
        a, c = previous[b], following[b]
        if _turn(points, a, b, c) > 0.0:
            triangles[n_triangles, 0], triangles[n_triangles, 1], triangles[n_triangles, 2] = a, b, c
            n_triangles += 1
        gone[b], is_blunt[rank[b]], cut_since = True, False, True
        following[a], previous[c] = c, a
        n_left -= 1
        # The neighbours' angles changed: test them again.
        for j in (a, c):
            is_blunt[rank[j]] = not _turn(points, previous[j], j, following[j]) > 0.0
            if not is_queued[j]:
                queue[(head + n_queued) % n], is_queued[j] = j, True
                n_queued += 1
    return n_triangles, steps


@nb.njit(cache=True, nogil=True, error_model="numpy")
def cut_ears(
    points: Float64Array,
    starts: Int64Array,
    lengths: Int64Array,
    most_steps: int,
    triangles: Int64Array,
    owners: Int64Array,
) -> tuple[int, int]:
    """Triangulate polygons whose corners follow one another in points (C, 2); the triangles are counter-clockwise.

    Fills triangles (T, 3) and owners (T,), T = sum of lengths - 2, with indices of corners and of polygons; triangles
    without area are not written. Returns their number, and the first polygon that was not cut because all would have
    taken more than `most_steps`, or -1.
    """
    n_triangles = 0
    for polygon in range(len(starts)):
        start, n = starts[polygon], lengths[polygon]
        own = triangles[n_triangles:]
        found, steps = _cut(points[start : start + n], most_steps, own)
        most_steps -= steps
        if most_steps < 0:
            return n_triangles, polygon
        own[:found] += start
        owners[n_triangles : n_triangles + found] = polygon
        n_triangles += found
    return n_triangles, -1
