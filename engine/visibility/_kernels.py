"""Compiled bit operations of coherent visibility: everything between two batches of shadow rays.

Bits are packed over the targets of one point, 64 to a word: bit i of word w is target 64·w + i. All kernels process a
block of points; `rows` maps block index to row. They do not validate.
"""

import numba as nb
import numpy as np

_ONE = np.uint64(1)
# Hashes neighbouring numbers far apart [Knuth98, sect. 6.4].
_SCATTER = np.uint32(2654435769)
# Directions that are tested against the horizon together: see `_horizon_of_directions`.
GROUP = 16
# Informers must agree on this share of what any of them sees; otherwise no prediction is made.
SHARED = 0.5


@nb.njit(cache=True, nogil=True, error_model="numpy")
def horizon_bits(rows, position, normal, targets, target_normals, finite, cones, out):
    """Marks the targets that each point could see: above its shading horizon and, for patches, facing it."""
    if finite:
        _horizon_of_points(rows, position, normal, targets, target_normals, out)
    else:
        _horizon_of_directions(rows, normal, targets, cones, out)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _horizon_of_directions(rows, normal, targets, cones, out):
    """Marks the directions above each point's shading horizon, sixteen at once where their cone does not cross the
    horizon.

    cones (G, 4): the axis of each group and slightly more than the sine of its radius, above 1 where it has no cone.
    """
    n_targets = targets.shape[0]
    for b in range(rows.shape[0]):
        r = rows[b]
        nx, ny, nz = normal[r, 0], normal[r, 1], normal[r, 2]
        words = out[b]
        words[:] = np.uint64(0)
        for g in range(cones.shape[0]):
            first = GROUP * g
            count = min(GROUP, n_targets - first)
            # The whole cone is above the horizon, crosses it (test each direction), or is below.
            height = nx * cones[g, 0] + ny * cones[g, 1] + nz * cones[g, 2]
            marked = np.uint64(0)
            if height > cones[g, 3]:
                marked = (_ONE << np.uint64(count)) - _ONE
            elif height >= -cones[g, 3]:
                for i in range(count):
                    t = first + i
                    above = nx * targets[t, 0] + ny * targets[t, 1] + nz * targets[t, 2] > np.float32(0.0)
                    marked |= np.uint64(above) << np.uint64(i)
            words[first >> 6] |= marked << np.uint64(first & 63)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _horizon_of_points(rows, position, normal, targets, target_normals, out):
    """Marks the patches above each point's shading horizon that face it."""
    for b in range(rows.shape[0]):
        r = rows[b]
        nx, ny, nz = normal[r, 0], normal[r, 1], normal[r, 2]
        px, py, pz = position[r, 0], position[r, 1], position[r, 2]
        words = out[b]
        words[:] = np.uint64(0)
        for t in range(targets.shape[0]):
            dx, dy, dz = targets[t, 0] - px, targets[t, 1] - py, targets[t, 2] - pz
            facing = nx * dx + ny * dy + nz * dz
            front = -(target_normals[t, 0] * dx + target_normals[t, 1] * dy + target_normals[t, 2] * dz)
            words[t >> 6] |= np.uint64(min(facing, front) > np.float32(0.0)) << np.uint64(t & 63)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def predict(rows, informers, bits, horizon, believed, always, weak, weakest, boundary_neighbours, todo, doubt):
    """Predicts each point's bits from its evaluated neighbours and marks in `todo` the targets to trace.

    informers (B, 4): rows of neighbours, -1 for none. The majority is the prediction; targets without unanimity are
    traced, and a tie is no prediction (`doubt`). With fewer than four informers the prediction is weaker, so its
    boundary is traced too. For the targets in `believed` (words,) it is enough that three of four points see one. Those
    in a row of `always` (S, words) are traced in any case, in `weak` with three informers, in `weakest` with two. Where
    the informers agree on less than a share `SHARED` of what any of them sees, they do not predict what is visible
    between them, as where light falls through a gap: everything is traced there.
    """
    known = np.empty(4, np.int64)
    # The informers that exist, and their vote.
    for b in range(rows.shape[0]):
        n = 0
        for i in range(4):
            if informers[b, i] >= 0:
                known[n] = informers[b, i]
                n += 1
        guess, above, requested, unsure = bits[rows[b]], horizon[b], todo[b], doubt[b]
        if n == 4:
            first, second, third, fourth = bits[known[0]], bits[known[1]], bits[known[2]], bits[known[3]]
            _majority_of_four(first, second, third, fourth, believed, guess, requested, unsure)
        elif n == 3:
            _majority_of_three(bits[known[0]], bits[known[1]], bits[known[2]], guess, requested, unsure)
        elif n == 2:
            _agreement_of_two(bits[known[0]], bits[known[1]], guess, requested, unsure)
        else:
            guess[:], unsure[:], requested[:] = np.uint64(0), np.uint64(0), ~np.uint64(0)
        # Too little agreement: trace everything above the horizon.
        if n >= 2 and _has_little_agreement(guess, requested, above):
            for w in range(above.shape[0]):
                guess[w], unsure[w], requested[w] = np.uint64(0), np.uint64(0), above[w]
            continue
        # Sentinels, distributed over the points by a hash; then the limits of the horizon.
        turns = always if n == 4 else weak if n == 3 else weakest
        sentinels = turns[(np.uint32(rows[b]) * _SCATTER >> np.uint32(8)) % turns.shape[0]]
        for w in range(above.shape[0]):
            guess[w] &= above[w]
            unsure[w] &= above[w]
            requested[w] = (requested[w] | sentinels[w]) & above[w]
        if n == 2 or n == 3:
            _mark_boundary(guess, above, boundary_neighbours, requested)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _has_little_agreement(guess, requested, above):
    """Whether informers agree (`guess`) on little of what any of them sees above the horizon (`guess` or
    `requested`)."""
    n_guessed, n_any = 0, 0
    for w in range(above.shape[0]):
        n_guessed += _count(guess[w] & above[w])
        n_any += _count((guess[w] | requested[w]) & above[w])
    return n_guessed < SHARED * n_any


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _majority_of_four(a, b, c, d, believed, guess, requested, unsure):
    """Votes of four informers: prediction, targets to trace, and ties."""
    for w in range(guess.shape[0]):
        # At least three of four are a majority; exactly two are a tie.
        either, both = a[w] | b[w], a[w] & b[w]
        other, others = c[w] | d[w], c[w] & d[w]
        guess[w] = (both & other) | (others & either)
        requested[w] = (either | other) & ~(both & others) & ~(guess[w] & believed[w])
        unsure[w] = ~guess[w] & (both | others | (either & other))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _majority_of_three(a, b, c, guess, requested, unsure):
    """Votes of three informers: a majority always exists; targets without unanimity are traced."""
    for w in range(guess.shape[0]):
        guess[w] = (a[w] & b[w]) | (c[w] & (a[w] | b[w]))
        requested[w] = (a[w] | b[w] | c[w]) & ~(a[w] & b[w] & c[w])
        unsure[w] = np.uint64(0)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _agreement_of_two(a, b, guess, requested, unsure):
    """Votes of two informers: only agreement predicts."""
    for w in range(guess.shape[0]):
        guess[w] = a[w] & b[w]
        requested[w] = a[w] ^ b[w]
        unsure[w] = requested[w]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def check_against_sphere(rows, informers, sphere_bits, parents, sphere_neighbours, bits, horizon, todo):
    """Checks predictions for targets finer than the sphere against the triangle that contains each, and its neighbours.

    A prediction that none of them confirms is traced. Without informers the triangle is the prediction, and it is
    traced where its neighbours disagree. parents (D,); ascending runs of equal parents are fastest.
    """
    for b in range(rows.shape[0]):
        r = rows[b]
        alone = 0
        for i in range(4):
            alone += informers[b, i] >= 0
        known, some_see, some_do_not, parent_sees = -1, False, False, False
        for t in range(parents.shape[0]):
            w = t >> 6
            bit = _ONE << np.uint64(t & 63)
            if not (horizon[b, w] & bit):
                continue
            parent = parents[t]
            # A new parent: does it, or any of its neighbours, see; does any not see.
            if parent != known:
                known = parent
                parent_sees = _bit(sphere_bits[r], parent)
                some_see, some_do_not = parent_sees, not parent_sees
                for k in range(sphere_neighbours.shape[1]):
                    m = sphere_neighbours[parent, k]
                    if m >= 0:
                        seen = _bit(sphere_bits[r], m)
                        some_see, some_do_not = some_see or seen, some_do_not or not seen
            # Too few informers: use the parent's bit, and trace where its surroundings disagree.
            if alone < 2:
                todo[b, w] &= ~bit
                if parent_sees:
                    bits[r, w] |= bit
                if some_see and some_do_not:
                    todo[b, w] |= bit
            elif not (some_see if bits[r, w] & bit else some_do_not):
                todo[b, w] |= bit


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _bit(words, i):
    return ((words[i >> 6] >> np.uint64(i & 63)) & _ONE) != np.uint64(0)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _mark_boundary(guess, above, neighbours, requested):
    """Marks both sides of every edge between a target predicted visible and one above the horizon predicted hidden."""
    for w in range(guess.shape[0]):
        ones = guess[w]
        while ones != np.uint64(0):
            i = lowest_bit(ones)
            ones &= ones - _ONE
            for k in range(neighbours.shape[1]):
                m = neighbours[64 * w + i, k]
                if m >= 0 and _bit(above, m) and not _bit(guess, m):
                    requested[m >> 6] |= _ONE << np.uint64(m & 63)
                    requested[w] |= _ONE << np.uint64(i)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def lowest_bit(word):
    """Index of the lowest set bit."""
    isolated = word & (~word + _ONE)
    return _count(isolated - _ONE)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _count(word):
    """Number of set bits."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def count_bits(words):
    """Total number of set bits of a 2D array of words."""
    total = 0
    for b in range(words.shape[0]):
        for w in range(words.shape[1]):
            total += _count(words[b, w])
    return total


@nb.njit(cache=True, nogil=True, error_model="numpy")
def list_bits(words, block, target):
    """Writes the position (row, bit) of each set bit; the arrays hold exactly as many."""
    n = 0
    for b in range(words.shape[0]):
        for w in range(words.shape[1]):
            ones = words[b, w]
            while ones != np.uint64(0):
                block[n], target[n] = b, 64 * w + lowest_bit(ones)
                ones &= ones - _ONE
                n += 1


@nb.njit(cache=True, nogil=True, error_model="numpy")
def write_rays(rows, ray_block, ray_target, position, lifted, targets, finite, ray_origin, ray_direction, ray_distance):
    """Writes a shadow ray for each requested target.

    `lifted` is the point offset from its surface towards the camera. A ray to light that the shading normal faces but
    the surface does not starts from the other side, as in path tracers: a smooth mesh must not shadow itself along its
    facets.
    """
    for n in range(ray_block.shape[0]):
        r, t = rows[ray_block[n]], ray_target[n]
        px, py, pz = position[r, 0], position[r, 1], position[r, 2]
        lx, ly, lz = lifted[r, 0] - px, lifted[r, 1] - py, lifted[r, 2] - pz
        dx, dy, dz = targets[t, 0], targets[t, 1], targets[t, 2]
        if finite:
            dx, dy, dz = dx - px, dy - py, dz - pz
            length = np.sqrt(dx * dx + dy * dy + dz * dz)
            # Stop before the patch itself: it must not shadow its own light.
            ray_distance[n] = length * np.float32(0.9999)
            inverse = np.float32(1.0) / length
            dx, dy, dz = dx * inverse, dy * inverse, dz * inverse
        side = np.float32(1.0) if lx * dx + ly * dy + lz * dz >= 0.0 else np.float32(-1.0)
        ray_origin[n, 0], ray_origin[n, 1], ray_origin[n, 2] = px + side * lx, py + side * ly, pz + side * lz
        ray_direction[n, 0], ray_direction[n, 1], ray_direction[n, 2] = dx, dy, dz


@nb.njit(cache=True, nogil=True, error_model="numpy")
def apply_answers(
    rows, ray_block, ray_target, blocked, doubt, bits, horizon, neighbours, requested, next_block, next_target
):
    """Stores traced results; where one contradicts the prediction, requests its neighbours that now disagree (OPT
    flooding).

    Where there was no prediction (`doubt`) every result counts as a contradiction [BenArtzi07, 8.8.1]. `requested` (B,
    words) marks all requests so far. Lists the next round and returns its number of rays.
    """
    n_next = 0
    for i in range(ray_block.shape[0]):
        b, t = ray_block[i], ray_target[i]
        mine, above, known = bits[rows[b]], horizon[b], requested[b]
        # Store the result, and compare it with the prediction.
        w = t >> 6
        bit = _ONE << np.uint64(t & 63)
        seen = not blocked[i]
        contradicts = (doubt[b, w] & bit) != np.uint64(0) or (seen != ((mine[w] & bit) != np.uint64(0)))
        if seen:
            mine[w] |= bit
        else:
            mine[w] &= ~bit
        if not contradicts:
            continue
        # Flood across edges: neighbours above the horizon, not traced yet, with another value.
        for k in range(neighbours.shape[1]):
            m = neighbours[t, k]
            if m >= 0 and _bit(above, m) and not _bit(known, m) and seen != _bit(mine, m):
                known[m >> 6] |= _ONE << np.uint64(m & 63)
                next_block[n_next], next_target[n_next] = b, m
                n_next += 1
    return n_next
