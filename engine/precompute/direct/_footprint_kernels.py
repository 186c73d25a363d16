"""Compiled: searches the samples that a point interpolates: see `pipeline.footprint`."""

import math

import numba as nb
import numpy as np


@nb.njit(cache=True, nogil=True, error_model="numpy")
def nearest_samples(begin, end, pixel, normal, width, stride, normal_weight, samples, first, count, nodes, chosen, out):
    """The nearest samples of rows begin to end, all of one object: chosen (P, 4), counted from `first`; distances out
    (P, 4).

    The distance is measured in (column, row) / stride and normal · normal_weight; it is infinite where the object has
    fewer than four samples. samples[first : first + count] are the object's rows; nodes (H / stride, W / stride) holds
    the index in `samples` of each lattice node, -1 for none. Nodes are visited ring by ring around the point: those
    beyond ring r are more than r + 1/2 away, whatever their normal, so the search ends with the true nearest ones.
    """
    scale = 1.0 / stride
    for p in range(begin, end):
        x, y = pixel[p] % width * scale, pixel[p] // width * scale
        best, which = out[p], chosen[p]
        best[:] = np.inf
        which[:] = 0
        # An object with few samples: compare with all of them.
        if count <= which.shape[0]:
            for s in range(first, first + count):
                far = _squared(x, y, p, samples[s], pixel, normal, width, scale, normal_weight)
                _insert(s - first, far, best, which)
        else:
            column, row = int(math.floor(x + 0.5)), int(math.floor(y + 0.5))
            for ring in range(nodes.shape[0] + nodes.shape[1]):
                for i in range(max(row - ring, 0), min(row + ring + 1, nodes.shape[0])):
                    # Whole rows above and below, and both ends of the rows in between.
                    whole = i == row - ring or i == row + ring
                    step = 1 if whole else 2 * ring
                    for j in range(column - ring, column + ring + 1, step):
                        if j < 0 or j >= nodes.shape[1]:
                            continue
                        s = nodes[i, j]
                        if first <= s < first + count:
                            far = _squared(x, y, p, samples[s], pixel, normal, width, scale, normal_weight)
                            _insert(s - first, far, best, which)
                # No later ring can hold a nearer sample.
                if best[-1] <= (ring + 0.5) * (ring + 0.5):
                    break
        for k in range(best.shape[0]):
            best[k] = math.sqrt(best[k])


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _squared(x, y, p, q, pixel, normal, width, scale, normal_weight):
    """Squared distance from point p, at (x, y) of the lattice, to the sample at row q."""
    dx, dy = pixel[q] % width * scale - x, pixel[q] // width * scale - y
    a, b, c = normal[q, 0] - normal[p, 0], normal[q, 1] - normal[p, 1], normal[q, 2] - normal[p, 2]
    return dx * dx + dy * dy + normal_weight * normal_weight * (a * a + b * b + c * c)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _insert(index, squared, best, which):
    """Inserts into the four smallest, ascending."""
    k = best.shape[0]
    while k > 0 and squared < best[k - 1]:
        k -= 1
        if k + 1 < best.shape[0]:
            best[k + 1], which[k + 1] = best[k], which[k]
        best[k], which[k] = squared, index
