"""The cut through the tree of emitters that one point needs: near lamps finely, far ones whole, hidden ones not at all.

Which leaves of the tree a point sees is known beforehand, one bit each; a node counts by the share of its leaves that
are seen. Solid angles of triangles are exact at any size [VanOosterom83], so a node that is seen whole errs only by
taking angles and cosine at its middle, with the square of its extent; one seen in part does not know which part, and
errs with the extent itself. A node is halved while that error, times its light, is more than a small part of all light
that the point sees. Below the leaves halves are made as they are needed: they are seen where the leaf is.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from engine.material.kinds import THETA_R
from engine.precompute.direct._angle_kernels import HALF_PI, TINY, is_highlight
from engine.precompute.direct._split_kernels import distance_from_axis

# How much of a point's light a node's error may be: of its middle for its whole, of the part that is seen.
CUT_TOLERANCE = np.float32(0.003)
PARTIAL_SHARE = np.float32(0.25)
# How large a node that is seen in part may be in a highlight: of a band there, and of how far it is from the middle.
BAND_SHARE = np.float32(0.5)
DISTANCE_SHARE = np.float32(0.1)
_DEPTH = 48
_ROOM = 4096


class Around(NamedTuple):
    """Of N things some leaves each, as bits: those of thing i are the bits mask (K,) of the words word (K,), from
    start[i] to start[i + 1] of start (N + 1,)."""

    start: np.ndarray
    word: np.ndarray
    mask: np.ndarray


class Leaves(NamedTuple):
    """M leaves: node and root (M,) of each, part (M,) of its root's area, ball (M, 4): middle and squared longest edge,
    and beside: which stand around it.

    What holds for each 64 of them, whose bits are one word: block (M / 64, 5): middle, how far from it theirs are at
    most, and their longest edge, squared; and beside_block: which stand around any of them."""

    node: np.ndarray
    root: np.ndarray
    part: np.ndarray
    ball: np.ndarray
    beside: Around
    block: np.ndarray
    beside_block: Around


class Emitters(NamedTuple):
    """N nodes, the first n_roots the triangles: corners (N, 3, 3), radiance (N, 3), brightness (N,); child, parent
    (N,), and first (N,), the leaf of a node that is one, as in `EmitterTree`."""

    corners: np.ndarray
    radiance: np.ndarray
    brightness: np.ndarray
    child: np.ndarray
    parent: np.ndarray
    first: np.ndarray
    n_roots: int
    leaves: Leaves


class Cut(NamedTuple):
    """Room for a point's cut beside what it is written to: shares (N,) of the nodes, a stack of triangles
    (D, 3, 3) relative to the point, of nodes (D,), and unit directions (3, 3); sizes (N,) in radians and the
    places (N, 3) of the corners of what is listed, three a piece."""

    shares: np.ndarray
    stack: np.ndarray
    nodes: np.ndarray
    unit: np.ndarray
    sizes: np.ndarray
    corners: np.ndarray
    rows: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy")
def make_cut(n_nodes, n_roots):
    room = n_roots + _ROOM if n_roots > 0 else 0
    corners = np.arange(3 * room).astype(np.int32)  # as the sky's are: of another type, all would be compiled twice
    return Cut(
        np.empty(n_nodes, np.float32), np.empty((_DEPTH, 3, 3), np.float32), np.empty(_DEPTH, np.int64),
        np.empty((3, 3), np.float32), np.empty(room, np.float32), corners.reshape(room, 3), np.arange(room),
    )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy")
def cut_emitters(words, near, emitters, place, frame, optics, ox, oy, oz, cut, x, y, z, cx, cy, cz, colours, weights):
    """List the cut for the point at `place` whose frame has tangent, bitangent, normal as rows; returns its number.

    words: which leaves are seen; near: nodes and deltas, and where the point's begin and end among them, see
    `engine.precompute.direct.near_leaves`; optics: the layer that reflects towards the eye, (ox, oy, oz) in the frame.
    Written are corner directions x, y, z in the frame, three a node, directions of the middles cx, cy, cz, radiance
    times solid angle, weights (the share seen), and into the cut sizes.
    """
    stack, nodes, unit, sizes = cut.stack, cut.nodes, cut.unit, cut.sizes
    fill_shares(words, emitters, cut.shares)
    correct_shares(near, emitters.parent, cut.shares)
    bound, n = optics.tolerance * CUT_TOLERANCE * _unoccluded_light(emitters, place, cut), 0
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
            omega, size, spread2 = project_triangle(stack[top], unit)
            light = emitters.brightness[node] * omega * share
            low, high = cosine_range(unit, frame[2])
            if high <= np.float32(0.0):
                top -= 1
                continue
            partly = (child >= 0 and share < np.float32(1.0)) or low < np.float32(0.0)
            error = light * size * (max(size, PARTIAL_SHARE) if partly else size)
            blurred = child >= 0 and share < np.float32(1.0) and _is_blurred(unit, frame, size, optics, ox, oy, oz)
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
                colours[n, channel] = emitters.radiance[node, channel] * omega
            # Directions that differ add up to less than their number: so much of the cosine at the middle is too much.
            weights[n], sizes[n] = share * (np.float32(1.0) - np.float32(0.5) * spread2), size
            n, left, top = n + 1, left - 1, top - 1
    return n


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _is_blurred(unit, frame, size, optics, ox, oy, oz):
    """Whether a highlight could show which part of a node is seen."""
    if not is_highlight(optics.kind_a):
        return False
    u, v, w = (
        unit[0, 0] + unit[1, 0] + unit[2, 0], unit[0, 1] + unit[1, 1] + unit[2, 1], unit[0, 2] + unit[1, 2] + unit[2, 2]
    )  # fmt: skip
    a = frame[0, 0] * u + frame[0, 1] * v + frame[0, 2] * w
    b = frame[1, 0] * u + frame[1, 1] * v + frame[1, 2] * w
    c = frame[2, 0] * u + frame[2, 1] * v + frame[2, 2] * w
    rate = np.float32(1.0) if optics.kind_a == THETA_R else np.float32(0.5)
    away = rate * distance_from_axis(optics.kind_a, a, b, c, ox, oy, oz)
    return rate * size > max(BAND_SHARE * HALF_PI / np.float32(optics.n_a), DISTANCE_SHARE * away)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _unoccluded_light(emitters, place, cut):
    """The light of all that is seen, without cosines."""
    total = np.float32(0.0)
    for root in range(emitters.n_roots):
        if cut.shares[root] > np.float32(0.0):
            place_at(emitters.corners[root], place, cut.stack[0])
            total += emitters.brightness[root] * project_triangle(cut.stack[0], cut.unit)[0] * cut.shares[root]
    return total


@nb.njit(cache=True, nogil=True, error_model="numpy")
def fill_shares(words, emitters, shares):
    """The share (N,) of each node that is seen, its halves being equal in area, by the leaves' bits."""
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
    """Put in what is known better of some leaves: nodes, deltas, and where the point's begin and end among them."""
    nodes, deltas, begin, end = near
    for k in range(begin, end):
        node, part = np.int64(nodes[k]), deltas[k]
        while node >= 0:
            shares[node] = max(shares[node] + part, np.float32(0.0))
            part *= np.float32(0.5)
            node = parents[node]


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def place_at(corners, place, out):
    for k in range(3):
        for axis in range(3):
            out[k, axis] = corners[k, axis] - place[axis]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def project_triangle(triangle, unit):
    """Solid angle, longest edge on the unit sphere, and mean square distance from its middle there, of a triangle about
    the origin; its unit corners go to `unit`."""
    for k in range(3):
        dx, dy, dz = triangle[k, 0], triangle[k, 1], triangle[k, 2]
        inverse = np.float32(1.0) / np.sqrt(max(dx * dx + dy * dy + dz * dz, TINY))
        unit[k, 0], unit[k, 1], unit[k, 2] = dx * inverse, dy * inverse, dz * inverse
    ax, ay, az = unit[0, 0], unit[0, 1], unit[0, 2]
    bx, by, bz = unit[1, 0], unit[1, 1], unit[1, 2]
    cx, cy, cz = unit[2, 0], unit[2, 1], unit[2, 2]
    # The triple product through edge vectors: corners seen from afar are nearly parallel and would cancel.
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    triple = ax * (uy * vz - uz * vy) + ay * (uz * vx - ux * vz) + az * (ux * vy - uy * vx)
    cosines = (ax * bx + ay * by + az * bz) + (bx * cx + by * cy + bz * cz) + (cx * ax + cy * ay + cz * az)
    omega = np.float32(2.0) * np.float32(math.atan2(abs(triple), np.float32(1.0) + cosines))
    wx, wy, wz = cx - bx, cy - by, cz - bz
    u2, v2, w2 = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz
    return omega, np.sqrt(max(u2, v2, w2)), (u2 + v2 + w2) * np.float32(1 / 36)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def cosine_range(unit, normal):
    """Least and greatest cosine to the normal of three unit vectors."""
    a = normal[0] * unit[0, 0] + normal[1] * unit[0, 1] + normal[2] * unit[0, 2]
    b = normal[0] * unit[1, 0] + normal[1] * unit[1, 1] + normal[2] * unit[1, 2]
    c = normal[0] * unit[2, 0] + normal[1] * unit[2, 1] + normal[2] * unit[2, 2]
    return min(a, b, c), max(a, b, c)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _halve(triangle, other):
    """Cut a triangle (3, 3) at the middle of its longest edge: one half in its place, the other in `other`."""
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
