"""Compiled: packs the bands of a point and sums its picture: see `bandstore` for the encoding."""

import numba as nb
import numpy as np

UNITS = np.float32(2.0) ** (np.arange(32) - 39).astype(np.float32)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "nsz"})
def _largest(bands, cells, maxima):
    """The largest channel of each entry, cells (J, K), and of each row, maxima (J,), of bands (J, K, 3)."""
    for j in range(bands.shape[0]):
        row, of_row, largest = bands[j], cells[j], np.float32(0.0)
        for k in range(bands.shape[1]):
            entry = max(row[k, 0], max(row[k, 1], row[k, 2]))
            of_row[k] = entry
            largest = max(largest, entry)
        maxima[j] = largest


@nb.njit(cache=True, nogil=True, error_model="numpy")
def encode_bands(bands, trim, cells, maxima, encoded, i, written):
    """Appends point i's bands to `values`; the ends of a row below trim · its maximum are added to the nearest stored
    entry.

    cells (J, K) and maxima (J,) are scratch. Most of a row is empty, so its empty ends are skipped first: moving their
    zeros inwards took longer than encoding the rest.
    """
    n_a, n_b = bands.shape[0], bands.shape[1]
    # Scale: the largest entry of the point.
    values = encoded.values
    _largest(bands, cells, maxima)
    largest = np.float32(0.0)
    for j in range(n_a):
        largest = max(largest, maxima[j])
    encoded.scale[i] = largest
    # One curve: a single value per row, all of them stored.
    inverse = np.float32(1.0) / largest if largest > 0.0 else np.float32(0.0)
    if n_b == 1:
        for j in range(n_a):
            values[written + j] = encode(bands[j, 0, 0] * inverse, bands[j, 0, 1] * inverse, bands[j, 0, 2] * inverse)
        return written + n_a
    for j in range(n_a):
        # The non-empty range of the row.
        low, high = 0, n_b
        if maxima[j] > 0.0:
            floor = trim * maxima[j]
            while cells[j, low] == 0.0:
                low += 1
            while cells[j, high - 1] == 0.0:
                high -= 1
            # Move small entries at both ends inwards, which preserves the sum.
            while max(bands[j, low, 0], bands[j, low, 1], bands[j, low, 2]) <= floor:
                for c in range(3):
                    bands[j, low + 1, c] += bands[j, low, c]
                low += 1
            while high - 1 > low and max(bands[j, high - 1, 0], bands[j, high - 1, 1], bands[j, high - 1, 2]) <= floor:
                for c in range(3):
                    bands[j, high - 2, c] += bands[j, high - 1, c]
                high -= 1
        else:
            high = 0
        encoded.first[i, j] = low
        encoded.length[i, j] = high - low
        # Encode the run.
        for k in range(low, high):
            values[written] = encode(bands[j, k, 0] * inverse, bands[j, k, 1] * inverse, bands[j, k, 2] * inverse)
            written += 1
    return written


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def encode(r, g, b):
    """Encodes three numbers in [0, 1] as nine-bit mantissas with one shared five-bit exponent (2^-30 … 2^1)."""
    largest = max(r, g, b)
    if not largest > np.float32(9.4e-13):
        return np.uint32(0)
    exponent = max(((np.float32(largest).view(np.int32) >> 23) & 255) - 126 + 30, 0)
    unit = np.int32((127 + 39 - exponent) << 23).view(np.float32)
    if largest * unit + np.float32(0.5) >= np.float32(512.0):
        exponent += 1
        unit *= np.float32(0.5)
    red, green, blue = int(r * unit + np.float32(0.5)), int(g * unit + np.float32(0.5)), int(b * unit + np.float32(0.5))
    return np.uint32(red | (green << 9) | (blue << 18) | (exponent << 27))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def radiance_tile(scale, first, count, start, values, n_a, n_b, c_a, c_b, out, at, units):
    """out[at + i] = Σ_jk c_a[j] c_b[k] U_jk [BenArtzi07, eq. 4.13], summed in double precision: J·K terms of one
    sign."""
    for i in range(scale.shape[0]):
        red, green, blue = 0.0, 0.0, 0.0
        at_value = start[i]
        for j in range(n_a):
            low, n = 0, 1
            if n_b > 1:
                low, n = first[i, j], count[i, j]
            for k in range(low, low + n):
                value = values[at_value]
                at_value += 1
                unit = units[value >> np.uint32(27)]
                red += np.float32(value & np.uint32(511)) * unit * c_a[j, 0] * c_b[k, 0]
                green += np.float32((value >> np.uint32(9)) & np.uint32(511)) * unit * c_a[j, 1] * c_b[k, 1]
                blue += np.float32((value >> np.uint32(18)) & np.uint32(511)) * unit * c_a[j, 2] * c_b[k, 2]
        out[at + i, 0], out[at + i, 1], out[at + i, 2] = red * scale[i], green * scale[i], blue * scale[i]
