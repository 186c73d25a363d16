"""Compiled parts of the thesis' visibility methods: estimates and their correction. They do not validate.

Bits as in `engine.visibility._kernels`. `some` and `every` (B, words) mark the targets that are blocked for any, and
for all, of a point's informers; a point that lacks an informer is traced completely.
"""

import numba as nb
import numpy as np

from engine.visibility._kernels import _bit, lowest_bit

_ONE = np.uint64(1)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def copy_blockers(informers, bits, valid, some, every):
    """Copies every informer's blockers in the directions in which it sees them. valid (words,): the bits in use."""
    for b in range(informers.shape[0]):
        if informers[b].min() < 0:
            continue
        for w in range(valid.shape[0]):
            any_seen, all_seen = np.uint64(0), ~np.uint64(0)
            for i in range(informers.shape[1]):
                word = bits[informers[b, i], w]
                any_seen |= word
                all_seen &= word
            some[b, w], every[b, w] = ~all_seen & valid[w], ~any_seen & valid[w]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def warp_blockers(rows, informers, bits, position, directions, neighbours, distance, some, every):
    """Warps every informer's blockers to their directions as seen from the point [BenArtzi07, fig. 8.5].

    distance (P, D): the distance of each blocker, inf where unknown; the point takes over the nearest. The direction
    nearest to a blocker is found by walks over the neighbours, which reach it if these include all that a Voronoi cell
    touches.
    """
    n_targets = directions.shape[0]
    counts, latest = np.empty(n_targets, np.uint8), np.empty(n_targets, np.int8)
    for b in range(rows.shape[0]):
        if informers[b].min() < 0:
            continue
        counts[:], latest[:] = 0, -1
        r = rows[b]
        for i in range(informers.shape[1]):
            j = informers[b, i]
            # Position of each blocker relative to the point, the nearest target to it, and its distance.
            for t in range(n_targets):
                reach = distance[j, t]
                if not np.isfinite(reach) or _bit(bits[j], t):
                    continue
                x = position[j, 0] + reach * directions[t, 0] - position[r, 0]
                y = position[j, 1] + reach * directions[t, 1] - position[r, 1]
                z = position[j, 2] + reach * directions[t, 2] - position[r, 2]
                m = _nearest(directions, neighbours, t, x, y, z)
                distance[r, m] = min(distance[r, m], np.float32(np.sqrt(x * x + y * y + z * z)))
                if latest[m] != i:
                    latest[m] = i
                    counts[m] += 1
        # Targets with a blocker from any informer, and from all of them.
        for t in range(n_targets):
            bit = _ONE << np.uint64(t & 63)
            if counts[t] > 0:
                some[b, t >> 6] |= bit
            if counts[t] >= informers.shape[1]:
                every[b, t >> 6] |= bit


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _nearest(directions, neighbours, start, x, y, z):
    """The direction nearest to (x, y, z), by hill climbing over the neighbours from `start`."""
    best = start
    most = x * directions[best, 0] + y * directions[best, 1] + z * directions[best, 2]
    moved = True
    while moved:
        moved, around = False, best
        for k in range(neighbours.shape[1]):
            m = neighbours[around, k]
            if m >= 0:
                along = x * directions[m, 0] + y * directions[m, 1] + z * directions[m, 2]
                if along > most:
                    best, most, moved = m, along, True
    return best


@nb.njit(cache=True, nogil=True, error_model="numpy")
def estimate(rows, informers, some, every, boundary, horizon_too, horizon, neighbours, bits, todo):
    """Writes the estimate to the points' bits and marks the targets to trace in `todo`: its boundary, and on request
    that of the horizon, or targets on which informers disagree."""
    for b in range(rows.shape[0]):
        guess, above, requested = bits[rows[b]], horizon[b], todo[b]
        if informers[b].min() < 0:
            guess[:], requested[:] = np.uint64(0), above
            continue
        if boundary:
            requested[:] = np.uint64(0)
            _mark_boundary(some[b], neighbours, requested)
            if horizon_too:
                _mark_boundary(above, neighbours, requested)
        for w in range(above.shape[0]):
            hidden = some[b, w] if boundary else every[b, w]
            guess[w] = ~hidden & above[w]
            requested[w] = (requested[w] if boundary else some[b, w] & ~every[b, w]) & above[w]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _mark_boundary(marked, neighbours, out):
    """Marks both sides of every edge between a marked target and an unmarked one."""
    for w in range(marked.shape[0]):
        ones = marked[w]
        while ones != np.uint64(0):
            t = 64 * w + lowest_bit(ones)
            ones &= ones - _ONE
            for k in range(neighbours.shape[1]):
                m = neighbours[t, k]
                if m >= 0 and not _bit(marked, m):
                    out[m >> 6] |= _ONE << np.uint64(m & 63)
                    out[w] |= _ONE << np.uint64(t & 63)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def flood_around(rows, ray_block, ray_target, blocked, bits, horizon, neighbours, requested, next_block, next_target):
    """Stores traced results; where one contradicts the estimate, requests all its neighbours [BenArtzi07, code 3].

    `asked` (B, words) marks all requests so far. Lists the next round and returns its number of rays.
    """
    n_next = 0
    for i in range(ray_block.shape[0]):
        b, t = ray_block[i], ray_target[i]
        mine, bit = bits[rows[b]], _ONE << np.uint64(t & 63)
        if blocked[i] != ((mine[t >> 6] & bit) != np.uint64(0)):
            continue
        mine[t >> 6] ^= bit
        for k in range(neighbours.shape[1]):
            m = neighbours[t, k]
            if m >= 0 and _bit(horizon[b], m) and not _bit(requested[b], m):
                requested[b, m >> 6] |= _ONE << np.uint64(m & 63)
                next_block[n_next], next_target[n_next] = b, m
                n_next += 1
    return n_next
