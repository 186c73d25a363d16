"""Compiled bit operations of coherent visibility: everything between two batches of shadow rays.

Bits are packed over the targets of one point, 64 to a word: bit i of word w is target 64·w + i.
All kernels work on a block of points (rows); `rows` maps block index to row. No validation here.
"""

import numba as nb
import numpy as np

_ONE = np.uint64(1)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def horizon_bits(rows, position, normal, targets, target_normals, finite, out):
    """Mark the targets each point could see: above its shading horizon and, for patches, on their front side."""
    n_targets = targets.shape[0]
    above = np.empty(64, np.uint64)
    for b in range(rows.shape[0]):
        r = rows[b]
        nx, ny, nz = normal[r, 0], normal[r, 1], normal[r, 2]
        px, py, pz = position[r, 0], position[r, 1], position[r, 2]
        if not finite:
            px = py = pz = np.float32(0.0)
        for w in range(out.shape[1]):
            first = 64 * w
            last = min(64, n_targets - first)
            for i in range(last):
                t = first + i
                dx, dy, dz = targets[t, 0] - px, targets[t, 1] - py, targets[t, 2] - pz
                facing = nx * dx + ny * dy + nz * dz
                if finite:
                    front = -(target_normals[t, 0] * dx + target_normals[t, 1] * dy + target_normals[t, 2] * dz)
                    facing = min(facing, front)
                above[i] = _ONE if facing > 0.0 else np.uint64(0)
            word = np.uint64(0)
            for i in range(last):
                word |= above[i] << np.uint64(i)
            out[b, w] = word


@nb.njit(cache=True, nogil=True, error_model="numpy")
def predict(rows, informers, bits, horizon, always, weak, boundary_neighbours, todo, doubt):
    """Guess each point's bits from its evaluated neighbours and mark in `todo` what must be traced.

    informers (B, 4) rows of neighbours, -1 where there is none. The majority is the guess; what is not unanimous is
    traced, and a tie is no guess at all (`doubt`). With fewer than four informers the guess is weaker, so its boundary
    is traced too. The targets in `always` (words,) are traced whatever the guess, with a weak guess those in `weak`.
    """
    for b in range(rows.shape[0]):
        r = rows[b]
        n_informers = 0
        for i in range(4):
            if informers[b, i] >= 0:
                n_informers += 1
        for w in range(bits.shape[1]):
            ones, twos, fours = np.uint64(0), np.uint64(0), np.uint64(0)
            for i in range(4):
                if informers[b, i] >= 0:
                    word = bits[informers[b, i], w]
                    carry = ones & word
                    ones ^= word
                    fours |= twos & carry
                    twos ^= carry
            above = horizon[b, w]
            if n_informers == 4:
                bits[r, w] = (fours | (twos & ones)) & above
                doubt[b, w] = twos & ~ones & above
                todo[b, w] = ((ones | twos) | always[w]) & above
            elif n_informers == 3:
                bits[r, w] = twos & above
                doubt[b, w] = np.uint64(0)
                todo[b, w] = ((ones ^ twos) | weak[w]) & above
            elif n_informers == 2:
                bits[r, w] = twos & above
                doubt[b, w] = ones & above
                todo[b, w] = (ones | weak[w]) & above
            else:
                bits[r, w] = np.uint64(0)
                doubt[b, w] = np.uint64(0)
                todo[b, w] = above
        if n_informers == 2 or n_informers == 3:
            _mark_boundary(b, r, bits, horizon, boundary_neighbours, todo)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def consult_sphere(rows, informers, sphere_bits, parents, sphere_neighbours, bits, horizon, todo):
    """Check guesses for targets finer than the sphere against the triangle each lies in and those around it.

    A guess that none of them shares is traced. Without informers the triangle is the guess, traced where its
    surroundings do not agree. parents (D,), ascending runs of equal ones being quickest.
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
            if parent != known:
                known = parent
                parent_sees = _bit(sphere_bits[r], parent)
                some_see, some_do_not = parent_sees, not parent_sees
                for k in range(sphere_neighbours.shape[1]):
                    m = sphere_neighbours[parent, k]
                    if m >= 0:
                        seen = _bit(sphere_bits[r], m)
                        some_see, some_do_not = some_see or seen, some_do_not or not seen
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
def _mark_boundary(b, r, bits, horizon, neighbours, todo):
    for w in range(bits.shape[1]):
        ones = bits[r, w]
        while ones != np.uint64(0):
            i = _lowest(ones)
            ones &= ones - _ONE
            t = 64 * w + i
            for k in range(neighbours.shape[1]):
                m = neighbours[t, k]
                if m < 0:
                    continue
                v = m >> 6
                bit = _ONE << np.uint64(m & 63)
                if (horizon[b, v] & bit) and not (bits[r, v] & bit):
                    todo[b, v] |= bit
                    todo[b, w] |= _ONE << np.uint64(i)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _lowest(word):
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
def list_rays(
    rows, todo, position, lifted, targets, finite, ray_block, ray_target, ray_origin, ray_direction, ray_distance
):
    """Write one shadow ray for each set bit of `todo`; the arrays hold exactly as many.

    `lifted` is the point raised off its surface towards the eye. Light that the shading normal faces but the surface
    does not starts from the other side, as path tracers do: a smooth mesh must not shade itself along its facets.
    """
    n = 0
    for b in range(rows.shape[0]):
        r = rows[b]
        px, py, pz = position[r, 0], position[r, 1], position[r, 2]
        lx, ly, lz = lifted[r, 0] - px, lifted[r, 1] - py, lifted[r, 2] - pz
        for w in range(todo.shape[1]):
            ones = todo[b, w]
            while ones != np.uint64(0):
                t = 64 * w + _lowest(ones)
                ones &= ones - _ONE
                ray_block[n] = b
                ray_target[n] = t
                length = np.float32(1.0)
                dx, dy, dz = targets[t, 0], targets[t, 1], targets[t, 2]
                if finite:
                    dx -= px
                    dy -= py
                    dz -= pz
                    length = np.sqrt(dx * dx + dy * dy + dz * dz)
                    # Stop short of the patch itself: it must not shadow its own light.
                    ray_distance[n] = length * np.float32(0.9999)
                inverse = np.float32(1.0) / length
                side = np.float32(1.0) if lx * dx + ly * dy + lz * dz >= 0.0 else np.float32(-1.0)
                ray_origin[n, 0], ray_origin[n, 1], ray_origin[n, 2] = px + side * lx, py + side * ly, pz + side * lz
                ray_direction[n, 0], ray_direction[n, 1], ray_direction[n, 2] = dx * inverse, dy * inverse, dz * inverse
                n += 1


@nb.njit(cache=True, nogil=True, error_model="numpy")
def apply_answers(rows, ray_block, ray_target, blocked, doubt, bits, horizon, neighbours, traced, todo):
    """Store traced answers; where one contradicts the guess, ask its neighbours that now disagree (OPT flooding).

    Where there was no guess (`doubt`) every answer counts as a contradiction [BenArtzi07, 8.8.1]. On return `todo`
    holds the next round.
    """
    todo[:] = np.uint64(0)
    for i in range(ray_block.shape[0]):
        b, t = ray_block[i], ray_target[i]
        traced[b, t >> 6] |= _ONE << np.uint64(t & 63)
    for i in range(ray_block.shape[0]):
        b, t = ray_block[i], ray_target[i]
        r = rows[b]
        w = t >> 6
        bit = _ONE << np.uint64(t & 63)
        seen = not blocked[i]
        contradicts = (doubt[b, w] & bit) != np.uint64(0) or (seen != ((bits[r, w] & bit) != np.uint64(0)))
        if seen:
            bits[r, w] |= bit
        else:
            bits[r, w] &= ~bit
        if not contradicts:
            continue
        for k in range(neighbours.shape[1]):
            m = neighbours[t, k]
            if m < 0:
                continue
            v = m >> 6
            mbit = _ONE << np.uint64(m & 63)
            if not (horizon[b, v] & mbit) or (traced[b, v] & mbit):
                continue
            if seen != ((bits[r, v] & mbit) != np.uint64(0)):
                todo[b, v] |= mbit
