"""Compiled: the cut through the emitter tree for one point, fine for near lamps, coarse for far ones, without hidden
ones.

The visibility of each leaf is known beforehand, one bit each; a node is weighted by the visible share of its leaves.
Solid angles of triangles are exact at any size [VanOosterom83], so a fully visible node errs only by evaluating angles
and cosine at its centre, with the square of its extent. A partly visible node does not know which part is visible and
errs with the extent itself. A node is split while that error, times its light, exceeds a small fraction of the point's
total light. Below the leaves, halves are created on demand with the visibility of the leaf.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from engine.light._cone_kernels import cone_range
from engine.material.kinds import THETA_R
from engine.precompute.direct._angle_kernels import HALF_PI, TINY, is_highlight
from engine.precompute.direct._share_kernels import distance_from_axis

# The error of a node relative to a point's light: of its centre for the whole, and of its visible part.
CUT_TOLERANCE = np.float32(0.003)
PARTIAL_SHARE = np.float32(0.25)
# The unevenness up to which a node counts as shining evenly in a highlight.
EVEN = np.float32(0.02)
# The largest size of a partly visible node in a highlight: relative to a band, and to its distance from the lobe axis.
BAND_SHARE = np.float32(0.5)
DISTANCE_SHARE = np.float32(0.1)
_DEPTH = 48
_ROOM = 4096


class Around(NamedTuple):
    """Sets of leaves of N items, as bits: item i has the bits mask (K,) of the words word (K,), from start[i] to
    start[i + 1] of start (N + 1,)."""

    start: np.ndarray
    word: np.ndarray
    mask: np.ndarray


class Leaves(NamedTuple):
    """M leaves: node and root (M,) of each, part (M,) of its root's area, ball (M, 4): centre and squared longest edge,
    and beside: its neighbours.

    For each group of 64 leaves, whose bits form one word: block (M / 64, 5): centre, largest distance of a leaf's
    centre from it, and squared longest edge; and beside_block: the neighbours of any of them.
    """

    node: np.ndarray
    root: np.ndarray
    part: np.ndarray
    ball: np.ndarray
    beside: Around
    block: np.ndarray
    beside_block: Around


class Emitters(NamedTuple):
    """N nodes, the first n_roots the triangles: corners (N, 3, 3), radiance (N, 3), brightness (N,); uneven (N,): how
    far the centre of a node's light is from its own, 0 where it shines evenly, see `prepare_lighting`; cones (N, 4);
    child, parent (N,), and first (N,), the index of the leaf where a node is one, as in `EmitterTree`."""

    corners: np.ndarray
    radiance: np.ndarray
    brightness: np.ndarray
    uneven: np.ndarray
    cones: np.ndarray
    child: np.ndarray
    parent: np.ndarray
    first: np.ndarray
    n_roots: int
    leaves: Leaves


class Cut(NamedTuple):
    """Working memory for a point's cut: shares (N,) of the nodes; a stack of triangles (D, 3, 3) relative to the point,
    and of nodes (D,); unit directions (3, 3); of the listed nodes the sizes (N,) in radians and the indices (N, 3) of
    the corners, three each."""

    shares: np.ndarray
    stack: np.ndarray
    nodes: np.ndarray
    unit: np.ndarray
    sizes: np.ndarray
    corners: np.ndarray
    rows: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy")
def make_cut(n_nodes, n_roots):
    """Working memory for cuts through a tree of n_nodes nodes; empty without roots."""
    room = n_roots + _ROOM if n_roots > 0 else 0
    # The same type as the sky's: another one would compile everything twice.
    corners = np.arange(3 * room).astype(np.int32)
    return Cut(
        np.empty(n_nodes, np.float32), np.empty((_DEPTH, 3, 3), np.float32), np.empty(_DEPTH, np.int64),
        np.empty((3, 3), np.float32), np.empty(room, np.float32), corners.reshape(room, 3), np.arange(room),
    )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy")
def cut_emitters(words, near, emitters, place, frame, optics, ox, oy, oz, cut, x, y, z, cx, cy, cz, colours, weights):
    """Lists the cut for the point at `place`, whose frame has the rows tangent, bitangent, normal; returns the number
    of nodes.

    words: visibility bits of the leaves; near: nodes and deltas, and the point's range among them, see
    `engine.precompute.direct.near_leaves`; optics: the layer that reflects towards the camera, (ox, oy, oz) in the
    frame. Writes corner directions x, y, z in the frame, three per node; directions of the centres cx, cy, cz; radiance
    times solid angle; weights (the visible share); and the sizes in `cut`.
    """
    stack, nodes, unit, sizes = cut.stack, cut.nodes, cut.unit, cut.sizes
    fill_shares(words, emitters, cut.shares)
    correct_shares(near, emitters.parent, cut.shares)
    bound, n = optics.tolerance * CUT_TOLERANCE * _unoccluded_light(emitters, place, cut), 0
    # Depth-first traversal with a stack, reserving room for the remaining roots.
    for root in range(emitters.n_roots):
        if cut.shares[root] == np.float32(0.0):
            continue
        left = sizes.shape[0] - n - (emitters.n_roots - root)
        nodes[0], top = root, 0
        place_at(emitters.corners[root], place, stack[0])
        while top >= 0:
            node, child = nodes[top], emitters.child[nodes[top]]
            share = cut.shares[node]
            if share == np.float32(0.0):
                top -= 1
                continue
            # Solid angle, extent and cosines of the node; skip it below the horizon, or where its cone sends nothing.
            omega, size, spread2 = project_triangle(stack[top], unit)
            low, high = cosine_range(unit, frame[2])
            sent, least, most = cone_range(emitters.cones, node, unit, size)
            if high <= np.float32(0.0) or most == np.float32(0.0):
                top -= 1
                continue
            # The error is of second order in the size for a fully visible, evenly shining node, else of first order;
            # and of that of what its cone sends.
            light = emitters.brightness[node] * omega * share * most
            partly = (child >= 0 and share < np.float32(1.0)) or low < np.float32(0.0)
            uneven = np.float32(1.0) if partly else emitters.uneven[node]
            spread = size if partly else size + most - least
            error = light * size * max(spread, PARTIAL_SHARE * uneven)
            varies = child >= 0 and (share < np.float32(1.0) or uneven > EVEN)
            blurred = varies and _is_blurred(unit, frame, size, optics, ox, oy, oz)
            # Too large: replace it by its children, or below a leaf by the halves of its triangle.
            if (error > bound or blurred) and left > top + 2 and top + 2 < _DEPTH:
                if child >= 0:
                    place_at(emitters.corners[child], place, stack[top])
                    place_at(emitters.corners[child + 1], place, stack[top + 1])
                    nodes[top], nodes[top + 1] = child, child + 1
                else:
                    _halve(stack[top], stack[top + 1])
                    nodes[top + 1] = node
                top += 1
                continue
            # Accept: corner directions in the local frame, and their normalised mean as the centre.
            sx, sy, sz = np.float32(0.0), np.float32(0.0), np.float32(0.0)
            for k in range(3):
                u, v, w = unit[k, 0], unit[k, 1], unit[k, 2]
                a = frame[0, 0] * u + frame[0, 1] * v + frame[0, 2] * w
                b = frame[1, 0] * u + frame[1, 1] * v + frame[1, 2] * w
                c = frame[2, 0] * u + frame[2, 1] * v + frame[2, 2] * w
                x[3 * n + k], y[3 * n + k], z[3 * n + k] = a, b, c
                sx, sy, sz = sx + a, sy + b, sz + c
            inverse = np.float32(1.0) / np.sqrt(max(sx * sx + sy * sy + sz * sz, TINY))
            cx[n], cy[n], cz[n] = sx * inverse, sy * inverse, sz * inverse
            for channel in range(3):
                colours[n, channel] = emitters.radiance[node, channel] * omega * sent
            # The mean of different unit vectors is shorter than 1: so much is the cosine at the centre too large.
            weights[n], sizes[n] = share * (np.float32(1.0) - np.float32(0.5) * spread2), size
            n, left, top = n + 1, left - 1, top - 1
    return n


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _is_blurred(unit, frame, size, optics, ox, oy, oz):
    """Whether a highlight could reveal which part of a node is visible, or is bright."""
    if not is_highlight(optics.kind_a):
        return False
    # Direction of the node's centre in the local frame.
    u, v, w = (
        unit[0, 0] + unit[1, 0] + unit[2, 0], unit[0, 1] + unit[1, 1] + unit[2, 1], unit[0, 2] + unit[1, 2] + unit[2, 2]
    )  # fmt: skip
    a = frame[0, 0] * u + frame[0, 1] * v + frame[0, 2] * w
    b = frame[1, 0] * u + frame[1, 1] * v + frame[1, 2] * w
    c = frame[2, 0] * u + frame[2, 1] * v + frame[2, 2] * w
    # Its extent in γ, against the width of a band and the distance from the lobe axis.
    rate = np.float32(1.0) if optics.kind_a == THETA_R else np.float32(0.5)
    away = rate * distance_from_axis(optics.kind_a, a, b, c, ox, oy, oz)
    return rate * size > max(BAND_SHARE * HALF_PI / np.float32(optics.n_a), DISTANCE_SHARE * away)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _unoccluded_light(emitters, place, cut):
    """The light of everything visible, without cosines."""
    total = np.float32(0.0)
    for root in range(emitters.n_roots):
        if cut.shares[root] > np.float32(0.0):
            place_at(emitters.corners[root], place, cut.stack[0])
            omega, size, _ = project_triangle(cut.stack[0], cut.unit)
            most = cone_range(emitters.cones, root, cut.unit, size)[2]
            total += emitters.brightness[root] * omega * cut.shares[root] * most
    return total


@nb.njit(cache=True, nogil=True, error_model="numpy")
def fill_shares(words, emitters, shares):
    """The visible share (N,) of each node, whose halves have equal areas, from the bits of the leaves."""
    child, first = emitters.child, emitters.first
    for node in range(child.shape[0] - 1, -1, -1):
        half = child[node]
        if half >= 0:
            shares[node] = np.float32(0.5) * (shares[half] + shares[half + 1])
        else:
            leaf = first[node]
            shares[node] = np.float32((words[leaf >> 6] >> np.uint64(leaf & 63)) & np.uint64(1))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def correct_shares(near, parents, shares):
    """Adds the deltas of leaves with known shares to them and their ancestors; near: nodes, deltas and the point's
    range among them."""
    nodes, deltas, begin, end = near
    for k in range(begin, end):
        node, part = np.int64(nodes[k]), deltas[k]
        while node >= 0:
            shares[node] = max(shares[node] + part, np.float32(0.0))
            part *= np.float32(0.5)
            node = parents[node]


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def place_at(corners, place, out):
    """Writes corners (3, 3) relative to a position."""
    for k in range(3):
        for axis in range(3):
            out[k, axis] = corners[k, axis] - place[axis]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def project_triangle(triangle, unit):
    """Solid angle, longest edge on the unit sphere, and mean squared distance from its centre there, of a triangle
    relative to the origin; writes its unit corners to `unit`."""
    for k in range(3):
        dx, dy, dz = triangle[k, 0], triangle[k, 1], triangle[k, 2]
        inverse = np.float32(1.0) / np.sqrt(max(dx * dx + dy * dy + dz * dz, TINY))
        unit[k, 0], unit[k, 1], unit[k, 2] = dx * inverse, dy * inverse, dz * inverse
    ax, ay, az = unit[0, 0], unit[0, 1], unit[0, 2]
    bx, by, bz = unit[1, 0], unit[1, 1], unit[1, 2]
    cx, cy, cz = unit[2, 0], unit[2, 1], unit[2, 2]
    # The triple product of edge vectors: corners seen from afar are almost parallel and would cancel.
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    triple = ax * (uy * vz - uz * vy) + ay * (uz * vx - ux * vz) + az * (ux * vy - uy * vx)
    cosines = (ax * bx + ay * by + az * bz) + (bx * cx + by * cy + bz * cz) + (cx * ax + cy * ay + cz * az)
    # tan(Ω/2) = |a · (b × c)| / (1 + a·b + b·c + c·a) [VanOosterom83].
    omega = np.float32(2.0) * np.float32(math.atan2(abs(triple), np.float32(1.0) + cosines))
    wx, wy, wz = cx - bx, cy - by, cz - bz
    u2, v2, w2 = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz
    return omega, np.sqrt(max(u2, v2, w2)), (u2 + v2 + w2) * np.float32(1 / 36)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def cosine_range(unit, normal):
    """Least and greatest cosine between the normal and three unit vectors."""
    a = normal[0] * unit[0, 0] + normal[1] * unit[0, 1] + normal[2] * unit[0, 2]
    b = normal[0] * unit[1, 0] + normal[1] * unit[1, 1] + normal[2] * unit[1, 2]
    c = normal[0] * unit[2, 0] + normal[1] * unit[2, 1] + normal[2] * unit[2, 2]
    return min(a, b, c), max(a, b, c)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _halve(triangle, other):
    """Bisects a triangle (3, 3) at its longest edge: one half in place, the other in `other`."""
    longest, start = np.float32(-1.0), 0
    for k in range(3):
        j = (k + 1) % 3
        dx, dy, dz = triangle[j, 0] - triangle[k, 0], triangle[j, 1] - triangle[k, 1], triangle[j, 2] - triangle[k, 2]
        length = dx * dx + dy * dy + dz * dz
        if length > longest:
            longest, start = length, k
    j, last = (start + 1) % 3, (start + 2) % 3
    for axis in range(3):
        middle = np.float32(0.5) * (triangle[start, axis] + triangle[j, axis])
        other[0, axis], other[1, axis], other[2, axis] = middle, triangle[j, axis], triangle[last, axis]
        triangle[j, axis] = middle
