"""Compiled parts of `moves`: which shadow rays may meet a moved object. Bits are packed as in `engine.visibility`."""

import numba as nb
import numpy as np

_ONE = np.uint64(1)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def keep_passing(rows, position, targets, finite, boxes, bits):
    """Leaves of the marked targets (B, words) of points those towards which a ray passes one of the boxes (K, 2, 3):
    along a direction, or up to a point (finite)."""
    for b in range(rows.shape[0]):
        r = rows[b]
        x, y, z = position[r, 0], position[r, 1], position[r, 2]
        for w in range(bits.shape[1]):
            word = bits[b, w]
            if word == np.uint64(0):
                continue
            kept = np.uint64(0)
            for i in range(64):
                if (word >> np.uint64(i)) & _ONE == np.uint64(0):
                    continue
                t = 64 * w + i
                dx, dy, dz = targets[t, 0], targets[t, 1], targets[t, 2]
                if finite:
                    dx, dy, dz = dx - x, dy - y, dz - z
                for k in range(boxes.shape[0]):
                    if _passes(x, y, z, dx, dy, dz, np.float32(1.0) if finite else np.float32(np.inf), boxes[k]):
                        kept |= _ONE << np.uint64(i)
                        break
            bits[b, w] = kept


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _passes(x, y, z, dx, dy, dz, until, box):
    """Whether the ray meets a box before `until`, in lengths of its direction: the slabs' intervals overlap."""
    near, far = np.float32(0.0), until
    for axis in range(3):
        o, d = (x, dx) if axis == 0 else (y, dy) if axis == 1 else (z, dz)
        low, high = box[0, axis], box[1, axis]
        if d == np.float32(0.0):
            if o < low or o > high:
                return False
            continue
        a, b = (low - o) / d, (high - o) / d
        near, far = max(near, min(a, b)), min(far, max(a, b))
        if near > far:
            return False
    return True


@nb.njit(cache=True, nogil=True, error_model="numpy")
def mark_bits(rows, block, target, marked, bits):
    """Sets the bits of targets (R,) of the points rows[block] (R,) that are marked (R,)."""
    for i in range(block.shape[0]):
        if marked[i]:
            t = target[i]
            bits[rows[block[i]], t >> 6] |= _ONE << np.uint64(t & 63)
