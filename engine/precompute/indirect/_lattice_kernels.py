"""Compiled: decides which blocks of the lattice to split, and interpolates between gather points."""

import math

import numba as nb
import numpy as np

# Between corners whose normals differ by more than their object allows, or that lie off each other's plane by more than
# 15°, there is a crease or an edge.
_SAME_PLANE = np.float32(0.259)
# Least weight: a pixel that coincides with a corner beyond an edge uses the other corners, however far.
_LEAST_SAY = np.float32(1e-6)
# In standard errors of the mean of four values: the range of four equal values rarely exceeds it (the average is two).
_CHANCE = 3.0


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _corner(block, k, height, width):
    """Row and column of corner k of a block, within the picture."""
    y = min(block[0] + (k >> 1) * block[2], height - 1)
    x = min(block[1] + (k & 1) * block[2], width - 1)
    return y, x


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _is_one_object(block, objects):
    """Whether all pixels of a block show one object."""
    height, width = objects.shape
    y1, x1 = _corner(block, 3, height, width)
    first = objects[block[0], block[1]]
    for y in range(block[0], y1 + 1):
        for x in range(block[1], x1 + 1):
            if objects[y, x] != first:
                return False
    return True


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _are_one_surface(r, s, position, normal, least_alike):
    """Whether no edge lies between the points of two rows of one object."""
    alike, length2, off = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    for axis in range(3):
        step = position[s, axis] - position[r, axis]
        alike += normal[r, axis] * normal[s, axis]
        length2 += step * step
        off += step * normal[r, axis]
    return alike >= least_alike and off * off <= _SAME_PLANE * _SAME_PLANE * length2


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _is_smooth(block, row_image, position, normal, least_alike):
    """Whether no edge lies between any two corners of a block."""
    height, width = row_image.shape
    for k in range(4):
        y, x = _corner(block, k, height, width)
        r = row_image[y, x]
        for other in range(k):
            y, x = _corner(block, other, height, width)
            if not _are_one_surface(r, row_image[y, x], position, normal, least_alike):
                return False
    return True


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _is_close(block, row_image, position, clearance, reach):
    """Whether adjacent corners are farther apart than `reach` times the clearance of one of them."""
    height, width = row_image.shape
    for k in range(4):
        y, x = _corner(block, k, height, width)
        r = row_image[y, x]
        for other in (k ^ 1, k ^ 2):
            y, x = _corner(block, other, height, width)
            s, length2 = row_image[y, x], np.float32(0.0)
            for axis in range(3):
                length2 += (position[s, axis] - position[r, axis]) ** 2
            if length2 > (reach * clearance[r]) ** 2:
                return True
    return False


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _can_stand_for(cy, cx, y, x, objects, row_image, position, normal, least_alike):
    """Whether the corner's value may be used for the pixel."""
    r, s = row_image[y, x], row_image[cy, cx]
    o = objects[y, x]
    return s >= 0 and o == objects[cy, cx] and _are_one_surface(r, s, position, normal, least_alike[o])


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _all_are_stood_for(block, objects, row_image, position, normal, least_alike):
    """Whether each pixel of a block that shows a surface can use at least one corner's value."""
    height, width = row_image.shape
    y1, x1 = _corner(block, 3, height, width)
    for y in range(block[0], y1 + 1):
        for x in range(block[1], x1 + 1):
            if row_image[y, x] < 0:
                continue
            found = False
            for k in range(4):
                cy, cx = _corner(block, k, height, width)
                found = found or _can_stand_for(cy, cx, y, x, objects, row_image, position, normal, least_alike)
            if not found:
                return False
    return True


@nb.njit(cache=True, nogil=True, error_model="numpy")
def must_split(
    blocks,
    objects,
    row_image,
    position,
    normal,
    least_alike,
    values,
    noise,
    clearance,
    reach,
    close,
    tolerance,
    floor,
    out,
):
    """Decides whether each block (B, 3: y, x, size) must be split, into out (B,).

    objects (H, W); row_image (H, W): the hits' row of each pixel, −1 for none; least_alike (M,): the least cosine
    between normals within an object; values (P, D) at the rows of the corners, with standard errors noise (P, D).
    Values may differ by `tolerance` of their mean, plus `floor` (D,), plus what noise explains. close: corners may be
    at most `reach` times the clearance (P,) apart; otherwise a block of two pixels beside an edge is not split.
    """
    height, width = objects.shape
    for b in range(blocks.shape[0]):
        block = blocks[b]
        y, x = _corner(block, 0, height, width)
        out[b] = block[2] > 1
        if block[2] == 1:
            continue
        # Split blocks with a silhouette or crease, but without `close` not below two pixels.
        is_even = _is_one_object(block, objects)
        is_even = is_even and _is_smooth(block, row_image, position, normal, least_alike[objects[block[0], block[1]]])
        if not is_even and (close or block[2] > 2):
            continue
        if not _all_are_stood_for(block, objects, row_image, position, normal, least_alike):
            continue  # for example a groove between corners that are alike
        if not is_even:
            out[b] = False
            continue
        # Split where something is near: irradiance varies over the clearance.
        if close and _is_close(block, row_image, position, clearance, reach):
            continue
        # Split where the range of the corners' values exceeds tolerance and noise.
        differs = False
        for d in range(values.shape[1]):
            low, high, total, variance = np.inf, 0.0, 0.0, 0.0
            for k in range(4):
                y, x = _corner(block, k, height, width)
                value, chance = values[row_image[y, x], d], noise[row_image[y, x], d]
                low, high, total = min(low, value), max(high, value), total + value
                variance += chance * chance
            by_chance = _CHANCE * math.sqrt(0.25 * variance)
            differs = differs or high - low > tolerance * 0.25 * total + floor[d] + by_chance
        out[b] = differs


@nb.njit(cache=True, nogil=True, error_model="numpy")
def interpolate(blocks, objects, row_image, position, normal, least_alike, point_of_row, rows, weights):
    """Writes for each point in these blocks the gather points at the corners (P, 4) and their weights (P, 4).

    Weights are bilinear; corners beyond an edge get none.
    """
    height, width = row_image.shape
    for b in range(blocks.shape[0]):
        block = blocks[b]
        y1, x1 = _corner(block, 3, height, width)
        # The last row and column of a block belong to the next one, unless the picture ends there.
        for y in range(block[0], min(block[0] + block[2], height)):
            v = np.float32(y - block[0]) / np.float32(max(y1 - block[0], 1))
            for x in range(block[1], min(block[1] + block[2], width)):
                r = row_image[y, x]
                if r < 0:
                    continue
                u = np.float32(x - block[1]) / np.float32(max(x1 - block[1], 1))
                total = np.float32(0.0)
                # Bilinear weights of the corners that may be used; a single pixel uses itself.
                for k in range(4):
                    cy, cx = _corner(block, k, height, width)
                    if block[2] == 1:
                        cy, cx = y, x
                    weight = (v if k >> 1 else np.float32(1.0) - v) * (u if k & 1 else np.float32(1.0) - u)
                    allowed = _can_stand_for(cy, cx, y, x, objects, row_image, position, normal, least_alike)
                    rows[r, k] = point_of_row[row_image[cy, cx]] if allowed else 0
                    weights[r, k] = max(weight, _LEAST_SAY) if allowed else np.float32(0.0)
                    total += weights[r, k]
                # Normalise.
                for k in range(4):
                    weights[r, k] /= total
