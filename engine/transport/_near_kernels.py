"""Compiled loops of `engine.transport.near`: which leaves of the emitters a point sees in part, and by how much."""

import numba as nb
import numpy as np

from engine.light.emitters import R2
from engine.transport._emitter_kernels import heights, look, place_at
from engine.visibility._kernels import lowest_bit

_ZERO, _ONE, _NONE = np.float32(0.0), np.float32(1.0), np.uint64(0)
ROUGHNESS, FINE, MOST_DEPTH = np.float32(0.3), np.float32(0.01), 3
_LESS = np.float32(4.0**-0.75)  # of the error, with four times as many rays
_SHORTEST = np.float32(1e-30)  # of rays that do not count
_CHILDREN = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def list_near(rows, position, normal, bits, emitters, least, near, counts, nodes, depths):
    """For each of the rows the leaves that are worth rays of their own: counts (B,), nodes (B, most), and how often
    they are cut in four for these: depths (B,), 1 to `MOST_DEPTH`.

    A leaf is, if all of it would bring the point more than `least` of the light that it is thought to see, and either
    of those beside it some are seen and some are not, or it is larger than `near` radians.

    Of n spread rays to a leaf that is seen in part, the share that is seen is off by about ROUGHNESS n^(-3/4), and
    leaves are so independently: where hardly more than the edge of a lamp is seen, each gets more rays.
    """
    triangle, unit = np.empty((3, 3), np.float32), np.empty((3, 3), np.float32)
    shares, marked = np.empty(emitters.n_roots, np.float32), np.empty(bits.shape[1], np.uint64)
    most = nodes.shape[1]
    for b in range(rows.shape[0]):
        r, n = rows[b], 0
        place, up, ball = position[r], normal[r], emitters.leaves.ball
        x, y, z = place[0], place[1], place[2]
        _mark_edges(bits[r], emitters.leaves, place, near, shares, marked)
        total, squares = _seen_light(shares, emitters, place, up, triangle, unit), _ZERO
        bound = least * total
        for w in range(marked.shape[0]):
            ones = marked[w]
            while ones != _NONE and n < most:
                leaf = 64 * w + lowest_bit(ones)
                ones &= ones - np.uint64(1)
                node = emitters.leaves.node[leaf]
                # No triangle has more than 0.44 of its longest edge's square; seen from near even that is not all.
                if emitters.brightness[node] * ball[leaf, 3] < bound * _squared(ball, leaf, x, y, z):
                    continue
                place_at(emitters.corners[node], place, triangle)
                if not _faces(triangle):
                    continue
                omega = look(triangle, unit)[0]
                high = heights(unit, up)[1]
                light = emitters.brightness[node] * omega * high
                if high > _ZERO and light > bound:
                    nodes[b, n] = node
                    squares += light * light
                    n += 1
        counts[b], depths[b] = n, 1
        error = ROUGHNESS * np.sqrt(squares) / max(total, np.float32(1e-30)) * _LESS
        while error > FINE and depths[b] < MOST_DEPTH:
            error *= _LESS
            depths[b] += 1


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _mark_edges(words, leaves, place, near, shares, marked):
    """Mark leaves beside which some are seen and some are not, and large ones; fill in the share of each root that is
    seen.

    A leaf's own bit has no say: it would be held against rays more often where it is the rarer one, and what is seen
    through a railing would grow by that, or shrink.
    """
    shares[:], marked[:] = _ZERO, _NONE
    x, y, z = place[0], place[1], place[2]
    for leaf in range(leaves.node.shape[0]):
        if _bit(words, leaf):
            shares[leaves.root[leaf]] += leaves.part[leaf]
        n, n_seen = 0, 0
        for k in range(leaves.beside.shape[1]):
            m = leaves.beside[leaf, k]
            if m >= 0:
                n, n_seen = n + 1, n_seen + _bit(words, m)
        if 0 < n_seen < n or leaves.ball[leaf, 3] > near * near * _squared(leaves.ball, leaf, x, y, z):
            marked[leaf >> 6] |= np.uint64(1) << np.uint64(leaf & 63)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _bit(words, leaf):
    return np.int64((words[leaf >> 6] >> np.uint64(leaf & 63)) & np.uint64(1))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _squared(ball, leaf, x, y, z):
    """Squared distance from a place to the middle of a leaf's ball."""
    dx, dy, dz = ball[leaf, 0] - x, ball[leaf, 1] - y, ball[leaf, 2] - z
    return dx * dx + dy * dy + dz * dz


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _seen_light(shares, emitters, place, up, triangle, unit):
    """The light that the leaves known to be seen bring, with cosines at the roots' middles."""
    total = _ZERO
    for root in range(emitters.n_roots):
        share = shares[root]
        if share > _ZERO:
            place_at(emitters.corners[root], place, triangle)
            omega = look(triangle, unit)[0]
            low, high = heights(unit, up)
            total += emitters.brightness[root] * omega * share * np.float32(0.5) * max(low + high, high)
    return total


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _faces(triangle):
    """Whether a triangle relative to the point shows it its front."""
    ux, uy, uz = triangle[1, 0] - triangle[0, 0], triangle[1, 1] - triangle[0, 1], triangle[1, 2] - triangle[0, 2]
    vx, vy, vz = triangle[2, 0] - triangle[0, 0], triangle[2, 1] - triangle[0, 1], triangle[2, 2] - triangle[0, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return nx * triangle[0, 0] + ny * triangle[0, 1] + nz * triangle[0, 2] < _ZERO


@nb.njit(cache=True, nogil=True, error_model="numpy")
def near_rays(rows, nodes, position, lifted, normal, corners, depth, origins, directions, distances, weights):
    """Rays from points rows (K,) over nodes (K,) of corners (N, 3, 3), 4^depth a pair, each towards a place in one part
    of the node that is even on the sphere; weights: solid angle times cosine, 0 below the horizon.

    Places are spread [Roberts18], not the parts' middles: these stand in rows, and an edge that is parallel to them
    passes a whole row at once, so that penumbrae came in steps."""
    n_parts = 4**depth
    parts, spare = np.empty((n_parts, 3, 3), np.float32), np.empty((n_parts, 3, 3), np.float32)
    triangle, unit = np.empty((3, 3), np.float32), np.empty((3, 3), np.float32)
    for k in range(rows.shape[0]):
        r = rows[k]
        place_at(corners[nodes[k]], position[r], triangle)
        look(triangle, parts[0])
        _quarter(parts, spare, depth)
        ux, uy, uz = triangle[1, 0] - triangle[0, 0], triangle[1, 1] - triangle[0, 1], triangle[1, 2] - triangle[0, 2]
        vx, vy, vz = triangle[2, 0] - triangle[0, 0], triangle[2, 1] - triangle[0, 1], triangle[2, 2] - triangle[0, 2]
        mx, my, mz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        height = mx * triangle[0, 0] + my * triangle[0, 1] + mz * triangle[0, 2]
        for i in range(n_parts):
            omega = look(parts[i], unit)[0]
            number = np.float64(n_parts) * nodes[k] + i + 1.0
            root = np.sqrt((0.5 + number * R2[0]) % 1.0)
            other = (0.5 + number * R2[1]) % 1.0
            wa, wb, wc = np.float32(1.0 - root), np.float32(root * (1.0 - other)), np.float32(root * other)
            dx = wa * unit[0, 0] + wb * unit[1, 0] + wc * unit[2, 0]
            dy = wa * unit[0, 1] + wb * unit[1, 1] + wc * unit[2, 1]
            dz = wa * unit[0, 2] + wb * unit[1, 2] + wc * unit[2, 2]
            inverse = _ONE / np.sqrt(max(dx * dx + dy * dy + dz * dz, np.float32(1e-30)))
            dx, dy, dz = dx * inverse, dy * inverse, dz * inverse
            at = n_parts * k + i
            cosine = dx * normal[r, 0] + dy * normal[r, 1] + dz * normal[r, 2]
            weights[at] = omega * max(cosine, _ZERO)
            lx, ly, lz = (
                lifted[r, 0] - position[r, 0], lifted[r, 1] - position[r, 1], lifted[r, 2] - position[r, 2]
            )  # fmt: skip
            side = _ONE if lx * dx + ly * dy + lz * dz >= _ZERO else -_ONE
            origins[at, 0], origins[at, 1], origins[at, 2] = (
                position[r, 0] + side * lx, position[r, 1] + side * ly, position[r, 2] + side * lz
            )  # fmt: skip
            directions[at, 0], directions[at, 1], directions[at, 2] = dx, dy, dz
            along = mx * dx + my * dy + mz * dz
            distance = np.float32(0.9999) * height / along if along < _ZERO else _ZERO
            if not distance > _ZERO:  # the point lies in the node's plane: a lamp's own, but for rounding
                distance, weights[at] = _SHORTEST, _ZERO
            distances[at] = distance


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _quarter(parts, spare, depth):
    """Cut the spherical triangle parts[0] into 4^depth."""
    n = 1
    six = np.empty((6, 3), np.float32)
    for _ in range(depth):
        for i in range(n):
            for c in range(3):
                j = (c + 1) % 3
                x = parts[i, c, 0] + parts[i, j, 0]
                y = parts[i, c, 1] + parts[i, j, 1]
                z = parts[i, c, 2] + parts[i, j, 2]
                inverse = _ONE / np.sqrt(max(x * x + y * y + z * z, np.float32(1e-30)))
                for axis in range(3):  # not all at once, see `_copy_colours` of the projection
                    six[c, axis] = parts[i, c, axis]
                six[3 + c, 0], six[3 + c, 1], six[3 + c, 2] = x * inverse, y * inverse, z * inverse
            for child in range(4):
                for corner in range(3):
                    for axis in range(3):
                        spare[4 * i + child, corner, axis] = six[_CHILDREN[child, corner], axis]
        n *= 4
        for i in range(n):
            for corner in range(3):
                for axis in range(3):
                    parts[i, corner, axis] = spare[i, corner, axis]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def near_shares(rows, nodes, bits, first, blocked, weights, n_parts, deltas):
    """What the seen share of each node (K,), of its light on the point, is more than its one bit."""
    for k in range(rows.shape[0]):
        total, seen = _ZERO, _ZERO
        for i in range(n_parts * k, n_parts * (k + 1)):
            total += weights[i]
            seen += _ZERO if blocked[i] else weights[i]
        leaf = first[nodes[k]]
        bit = np.float32((bits[rows[k], leaf >> 6] >> np.uint64(leaf & 63)) & np.uint64(1))
        deltas[k] = (seen / total if total > _ZERO else bit) - bit
