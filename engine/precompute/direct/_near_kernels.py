"""Compiled loops of `engine.precompute.direct.near_leaves`: find emitter leaves that a point sees partly, and trace
their visible shares."""

import math

import numba as nb
import numpy as np

from engine.light._cone_kernels import cone_range
from engine.light.emitters import R2
from engine.precompute.direct._emitter_kernels import cosine_range, place_at, project_triangle
from engine.visibility._kernels import lowest_bit

_ZERO, _ONE, _TWO, _NONE = np.float32(0.0), np.float32(1.0), np.float32(2.0), np.uint64(0)
_THIRD, _SMALL = np.float32(1.0 / 3.0), np.float32(0.07)
ROUGHNESS, FINE, MOST_DEPTH = np.float32(0.3), np.float32(0.01), 3
_DISTANCE_SHARE = np.float32(4.0**-0.75)  # of the error, with four times as many rays
_SHORTEST = np.float32(1e-30)  # length of rays without weight
_CHILDREN = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def list_near(rows, position, normal, bits, emitters, least, near, counts, nodes, depths):
    """Lists for each of the rows the leaves that deserve rays of their own: counts (B,), nodes (B, most), and depths
    (B,), 1 to `MOST_DEPTH`: how often these leaves are split in four.

    A leaf is listed if it could contribute more than `least` of the light that the point is assumed to see, and either
    its neighbours are partly visible and partly hidden, or it is larger than `near` radians.

    With n well-distributed rays to a partly visible leaf, the error of its share is about ROUGHNESS n^(-3/4),
    independent between leaves: where little more than the edge of a lamp is visible, each leaf gets more rays.
    """
    triangle, unit = np.empty((3, 3), np.float32), np.empty((3, 3), np.float32)
    shares, marked = np.empty(emitters.n_roots, np.float32), np.empty(bits.shape[1], np.uint64)
    most = nodes.shape[1]
    for b in range(rows.shape[0]):
        r, n = rows[b], 0
        place, up, ball = position[r], normal[r], emitters.leaves.ball
        x, y, z = place[0], place[1], place[2]
        # Candidates, and the light that the point is assumed to see.
        _mark_edges(bits[r], emitters.leaves, place, near, shares, marked)
        total, squares = _visible_light(shares, emitters, place, up, triangle, unit), _ZERO
        bound = least * total
        for w in range(marked.shape[0]):
            ones = marked[w]
            while ones != _NONE and n < most:
                leaf = 64 * w + lowest_bit(ones)
                ones &= ones - np.uint64(1)
                node = emitters.leaves.node[leaf]
                # A triangle's area is at most 0.44 of its squared longest edge; from near, less of it counts.
                if emitters.brightness[node] * ball[leaf, 3] < bound * _squared(ball, leaf, x, y, z):
                    continue
                # The leaf's possible contribution: brightness times solid angle times the largest cosine.
                place_at(emitters.corners[node], place, triangle)
                if not _is_front_facing(triangle):
                    continue
                omega, size, _ = project_triangle(triangle, unit)
                high = cosine_range(unit, up)[1]
                light = emitters.brightness[node] * omega * high * cone_range(emitters.cones, node, unit, size)[2]
                if high > _ZERO and light > bound:
                    nodes[b, n] = node
                    squares += light * light
                    n += 1
        counts[b], depths[b] = n, 1
        # Increase the depth until the error of the listed leaves is small relative to the point's light.
        error = ROUGHNESS * np.sqrt(squares) / max(total, np.float32(1e-30)) * _DISTANCE_SHARE
        while error > FINE and depths[b] < MOST_DEPTH:
            error *= _DISTANCE_SHARE
            depths[b] += 1


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _mark_edges(words, leaves, place, near, shares, marked):
    """Marks leaves with both visible and hidden neighbours, and large ones; writes the visible share of each root.

    A leaf's own bit is ignored: it would be compared with rays more often where it is the rarer value, and the visible
    part behind a railing would grow by that, or shrink. Most points see all or none of the surroundings of 64 leaves
    and are far from them: such groups are skipped at once.
    """
    shares[:], marked[:] = _ZERO, _NONE
    x, y, z = place[0], place[1], place[2]
    n_leaves, square = leaves.node.shape[0], near * near
    for w in range(words.shape[0]):
        # Visible share of each root, by the areas of its leaves with set bits.
        ones = words[w]
        while ones != _NONE:
            leaf = 64 * w + lowest_bit(ones)
            ones &= ones - np.uint64(1)
            shares[leaves.root[leaf]] += leaves.part[leaf]
        # Test the group of 64 leaves first, by the bits around it and its distance; then each of its leaves.
        at_edge = _is_parted(words, leaves.beside_block, w)
        away = max(np.sqrt(_squared(leaves.block, w, x, y, z)) - leaves.block[w, 3], _ZERO)
        is_large = leaves.block[w, 4] > square * away * away
        if not (at_edge or is_large):
            continue
        for leaf in range(64 * w, min(64 * w + 64, n_leaves)):
            if (at_edge and _is_parted(words, leaves.beside, leaf)) or (
                is_large and leaves.ball[leaf, 3] > square * _squared(leaves.ball, leaf, x, y, z)
            ):
                marked[w] |= np.uint64(1) << np.uint64(leaf - 64 * w)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _is_parted(words, around, i):
    """Whether the neighbours of item i are partly visible and partly hidden."""
    seen, unseen = _NONE, _NONE
    for k in range(around.start[i], around.start[i + 1]):
        word, mask = words[around.word[k]], around.mask[k]
        seen |= word & mask
        unseen |= ~word & mask
    return seen != _NONE and unseen != _NONE


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _squared(ball, leaf, x, y, z):
    """Squared distance from a position to the centre of a ball."""
    dx, dy, dz = ball[leaf, 0] - x, ball[leaf, 1] - y, ball[leaf, 2] - z
    return dx * dx + dy * dy + dz * dz


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _visible_light(shares, emitters, place, up, triangle, unit):
    """The light of the leaves with visible bits, with cosines at the roots' centres."""
    total = _ZERO
    for root in range(emitters.n_roots):
        share = shares[root]
        if share > _ZERO:
            place_at(emitters.corners[root], place, triangle)
            omega, size, _ = project_triangle(triangle, unit)
            low, high = cosine_range(unit, up)
            sent = cone_range(emitters.cones, root, unit, size)[0]
            total += emitters.brightness[root] * omega * sent * share * np.float32(0.5) * max(low + high, high)
    return total


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _is_front_facing(triangle):
    """Whether a triangle relative to the point faces it."""
    ux, uy, uz = triangle[1, 0] - triangle[0, 0], triangle[1, 1] - triangle[0, 1], triangle[1, 2] - triangle[0, 2]
    vx, vy, vz = triangle[2, 0] - triangle[0, 0], triangle[2, 1] - triangle[0, 1], triangle[2, 2] - triangle[0, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return nx * triangle[0, 0] + ny * triangle[0, 1] + nz * triangle[0, 2] < _ZERO


@nb.njit(cache=True, nogil=True, error_model="numpy")
def near_rays(rows, nodes, position, lifted, normal, corners, depth, origins, directions, distances, weights):
    """Writes rays from points rows (K,) to nodes (K,) of corners (N, 3, 3), 4^depth per pair, each towards a position
    in one of the equal parts of the node on the sphere; weights: solid angle times cosine, 0 below the horizon.

    Positions are low-discrepancy points [Roberts18], not the parts' centres. The centres form rows, and an edge
    parallel to them passes a whole row at once, which showed as steps in penumbrae.
    """
    n_parts = 4**depth
    parts, spare = np.empty((n_parts, 3, 3), np.float32), np.empty((n_parts, 3, 3), np.float32)
    triangle = np.empty((3, 3), np.float32)
    for k in range(rows.shape[0]):
        r = rows[k]
        place_at(corners[nodes[k]], position[r], triangle)
        # Project the node to the unit sphere and divide it into 4^depth spherical triangles.
        project_triangle(triangle, parts[0])
        _quarter(parts, spare, depth)
        ux, uy, uz = triangle[1, 0] - triangle[0, 0], triangle[1, 1] - triangle[0, 1], triangle[1, 2] - triangle[0, 2]
        vx, vy, vz = triangle[2, 0] - triangle[0, 0], triangle[2, 1] - triangle[0, 1], triangle[2, 2] - triangle[0, 2]
        mx, my, mz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        height = mx * triangle[0, 0] + my * triangle[0, 1] + mz * triangle[0, 2]
        for i in range(n_parts):
            omega = _solid_angle(parts, i)
            # A point of the part from two low-discrepancy numbers, uniform in barycentric coordinates.
            number = np.float64(n_parts) * nodes[k] + i + 1.0
            u, other = 0.5 + number * R2[0], 0.5 + number * R2[1]
            root, other = np.sqrt(u - math.floor(u)), other - math.floor(other)
            wa, wb, wc = np.float32(1.0 - root), np.float32(root * (1.0 - other)), np.float32(root * other)
            dx = wa * parts[i, 0, 0] + wb * parts[i, 1, 0] + wc * parts[i, 2, 0]
            dy = wa * parts[i, 0, 1] + wb * parts[i, 1, 1] + wc * parts[i, 2, 1]
            dz = wa * parts[i, 0, 2] + wb * parts[i, 1, 2] + wc * parts[i, 2, 2]
            inverse = _ONE / np.sqrt(max(dx * dx + dy * dy + dz * dz, np.float32(1e-30)))
            dx, dy, dz = dx * inverse, dy * inverse, dz * inverse
            at = n_parts * k + i
            cosine = dx * normal[r, 0] + dy * normal[r, 1] + dz * normal[r, 2]
            # Weight: solid angle of the part times cosine.
            weights[at] = omega * max(cosine, _ZERO)
            lx, ly, lz = (
                lifted[r, 0] - position[r, 0], lifted[r, 1] - position[r, 1], lifted[r, 2] - position[r, 2]
            )  # fmt: skip
            side = _ONE if lx * dx + ly * dy + lz * dz >= _ZERO else -_ONE
            origins[at, 0], origins[at, 1], origins[at, 2] = (
                position[r, 0] + side * lx, position[r, 1] + side * ly, position[r, 2] + side * lz
            )  # fmt: skip
            directions[at, 0], directions[at, 1], directions[at, 2] = dx, dy, dz
            # Distance to the plane of the node.
            along = mx * dx + my * dy + mz * dz
            distance = np.float32(0.9999) * height / along if along < _ZERO else _ZERO
            # Up to rounding the point lies in the node's plane, for example on the emitter itself.
            if not distance > _ZERO:
                distance, weights[at] = _SHORTEST, _ZERO
            distances[at] = distance


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _solid_angle(parts, i):
    """Solid angle of a spherical triangle i with unit corners: 2 atan(q) [VanOosterom83]; for a small one 2 (q - q^3 /
    3), within 5e-6 of it."""
    ax, ay, az = parts[i, 0, 0], parts[i, 0, 1], parts[i, 0, 2]
    bx, by, bz = parts[i, 1, 0], parts[i, 1, 1], parts[i, 1, 2]
    cx, cy, cz = parts[i, 2, 0], parts[i, 2, 1], parts[i, 2, 2]
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    triple = abs(ax * (uy * vz - uz * vy) + ay * (uz * vx - ux * vz) + az * (ux * vy - uy * vx))
    cosines = (ax * bx + ay * by + az * bz) + (bx * cx + by * cy + bz * cz) + (cx * ax + cy * ay + cz * az)
    if triple < _SMALL * (_ONE + cosines):
        q = triple / (_ONE + cosines)
        return _TWO * q * (_ONE - q * q * _THIRD)
    return _TWO * np.float32(math.atan2(triple, _ONE + cosines))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _quarter(parts, spare, depth):
    """Divides the spherical triangle parts[0] into 4^depth."""
    n = 1
    six = np.empty((6, 3), np.float32)
    for _ in range(depth):
        for i in range(n):
            # The corners and the normalised midpoints of the edges.
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
    """The visible share of each node (K,), weighted by its light on the point, minus its visibility bit."""
    for k in range(rows.shape[0]):
        total, seen = _ZERO, _ZERO
        for i in range(n_parts * k, n_parts * (k + 1)):
            total += weights[i]
            seen += _ZERO if blocked[i] else weights[i]
        leaf = first[nodes[k]]
        bit = np.float32((bits[rows[k], leaf >> 6] >> np.uint64(leaf & 63)) & np.uint64(1))
        deltas[k] = (seen / total if total > _ZERO else bit) - bit
