"""Compiled: packs the bands of a point, sums its picture, and contracts packed transport into planes of half or single
floats. See `bandstore` for the encoding.

The bands of a point are contiguous, whereas a plane holds one coefficient of all points. The bands of a block of points
are therefore transposed while they are contracted. From there on (wavelets, sums, halves) each row of the block is one
loop over its 3·BLOCK lanes that the compiler vectorises.
"""

from typing import NamedTuple

import numba as nb
import numpy as np

from engine.curve.wavelet import LOW_PASS

UNITS = np.float32(2.0) ** (np.arange(32) - 39).astype(np.float32)
BLOCK = 16
LANES = 3 * BLOCK
D4 = np.array(LOW_PASS, np.float32)
_SUMS = {"nnan", "nsz", "reassoc", "contract"}
_INFINITE_HALF, _NO_HALF = np.int32(0x7C00), np.int32(0x7E00)


class PackedTile(NamedTuple):
    """The arrays of a tile, see `bandstore`."""

    scale: np.ndarray
    first: np.ndarray
    length: np.ndarray
    start: np.ndarray
    values: np.ndarray


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


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def half_bits(x):
    """The bits (uint16) of the half float nearest to the float32 x, ties to even (IEEE 754).

    Every step is cast: integers that numba widens to 64 bits would halve the width of the vector loops.
    """
    word = np.float32(x).view(np.int32)
    size = np.int32(word & np.int32(0x7FFFFFFF))
    # Normal halves: exponents differ by 112; the carry of the discarded bits rounds, possibly into the exponent.
    odd = np.int32(np.int32(size >> np.int32(13)) & np.int32(1))
    half = np.int32(np.int32(size + np.int32(odd + np.int32(0xFFF - (112 << 23)))) >> np.int32(13))
    # Below 2^-14 halves have the fixed step 2^-24, which is that of single floats in [0.5, 1): the addition rounds.
    small = np.int32(np.float32(size.view(np.float32) + np.float32(0.5)).view(np.int32) - np.int32(0x3F000000))
    half = small if size < np.int32(113 << 23) else half
    half = min(half, _INFINITE_HALF)
    half = _NO_HALF if size > np.int32(0x7F800000) else half
    return np.uint16(np.int32(np.int32(np.int32(word >> np.int32(16)) & np.int32(0x8000)) | half))


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def daubechies4(block, scratch):
    """Orthonormal periodic Daubechies-4 transform along axis 0, in place: the fast form of `curve.wavelet`."""
    n = block.shape[0]
    while n > 1:
        half = n // 2
        for i in range(half):
            third, fourth = (2 * i + 2) % n, (2 * i + 3) % n
            for lane in range(block.shape[1]):
                a, b = block[2 * i, lane], block[2 * i + 1, lane]
                c, d = block[third, lane], block[fourth, lane]
                scratch[i, lane] = D4[0] * a + D4[1] * b + D4[2] * c + D4[3] * d
                scratch[half + i, lane] = D4[3] * a - D4[2] * b + D4[1] * c - D4[0] * d
        for i in range(n):  # assigning a slice to a slice does the same but takes three seconds to compile
            for lane in range(block.shape[1]):
                block[i, lane] = scratch[i, lane]
        n = half


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _unit(word):
    """The unit of an entry's mantissas, 2^(exponent - 39), assembled from its bits."""
    exponent = np.int32(np.int32(word >> np.int32(27)) & np.int32(31))
    return np.int32(np.int32(exponent + np.int32(127 - 39)) << np.int32(23)).view(np.float32)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _mantissa(word, shift):
    return np.float32(np.int32(np.int32(word >> np.int32(shift)) & np.int32(511)))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _run(tile, i, j, n_b):
    """The bands k that a row holds: (first, count)."""
    if n_b == 1:
        return np.int64(0), np.int64(1)
    return np.int64(tile.first[i, j]), np.int64(tile.length[i, j])


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath=_SUMS)
def _contract_b(tile, i, n_b, dormant, block, lane):
    """Σ_k U_jk c_k of point i into the three lanes from `lane` on [BenArtzi07, eq. 4.16]; dormant (3, K)."""
    at, scale = tile.start[i], tile.scale[i]
    for j in range(block.shape[0]):
        low, count = _run(tile, i, j, n_b)
        values = tile.values[at : at + count]
        of_red, of_green, of_blue = dormant[0, low:], dormant[1, low:], dormant[2, low:]
        red, green, blue = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for k in range(count):
            word = np.int32(values[k])
            unit = _unit(word)
            red += _mantissa(word, 0) * (unit * of_red[k])
            green += _mantissa(word, 9) * (unit * of_green[k])
            blue += _mantissa(word, 18) * (unit * of_blue[k])
        at += count
        block[j, lane], block[j, lane + 1], block[j, lane + 2] = red * scale, green * scale, blue * scale


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath=_SUMS)
def _contract_a(tile, i, n_b, dormant, row, block, lane):
    """Σ_j U_jk c_j of point i into the three lanes from `lane` on; dormant (3, J), row (3, K) is scratch."""
    at, scale = tile.start[i], tile.scale[i]
    for c in range(3):
        for k in range(n_b):
            row[c, k] = np.float32(0.0)
    for j in range(dormant.shape[1]):
        low, count = _run(tile, i, j, n_b)
        values = tile.values[at : at + count]
        red, green, blue = row[0, low:], row[1, low:], row[2, low:]
        of_red, of_green, of_blue = dormant[0, j], dormant[1, j], dormant[2, j]
        for k in range(count):
            word = np.int32(values[k])
            unit = _unit(word)
            red[k] += _mantissa(word, 0) * (unit * of_red)
            green[k] += _mantissa(word, 9) * (unit * of_green)
            blue[k] += _mantissa(word, 18) * (unit * of_blue)
        at += count
    for k in range(n_b):
        for c in range(3):
            block[k, lane + c] = row[c, k] * scale


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _add_radiance(block, curve, sums, radiance):
    """radiance = Σ_j c_j T_j for each lane [BenArtzi07, eq. 4.7], summed in double precision; curve (J, LANES)."""
    for lane in range(block.shape[1]):
        sums[lane] = 0.0
    for j in range(block.shape[0]):
        for lane in range(block.shape[1]):
            sums[lane] += np.float64(block[j, lane]) * curve[j, lane]
    for lane in range(radiance.shape[0]):
        radiance[lane] = sums[lane]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath=_SUMS)
def _measure(row, inverse, n_lanes, squares):
    """The largest |number| of a scaled row; adds its squares lane by lane."""
    largest = np.float32(0.0)
    for lane in range(n_lanes):
        number = row[lane] * inverse
        largest = max(largest, abs(number))
        squares[lane] += number * number
    return largest


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _write(row, inverse, numbers):
    """Writes a scaled row as half floats (numbers: uint16) or as float32."""
    if numbers.itemsize == 2:
        for lane in range(numbers.shape[0]):
            numbers[lane] = half_bits(row[lane] * inverse)
    else:
        for lane in range(numbers.shape[0]):
            numbers[lane] = row[lane] * inverse


@nb.njit(cache=True, nogil=True, error_model="numpy")
def contract_tile(tile, at, n_b, keep_a, wavelet, dormant, curve, inverse, numbers, radiance, maxima, squares):
    """The columns of all planes for one tile: numbers (J, 3P) = inverse (J,) · transport, from point `at` on.

    keep_a: whether the planes are those of factor A, with `dormant` (3, K) the coefficients of B, or the reverse;
    wavelet: Daubechies-4 coefficients instead of bands; radiance (3P,) = Σ_j c_j T_j with curve (J, LANES), the
    coefficients repeated for each lane. maxima (J,) and squares (J, 3), zero on entry: the largest and the summed
    squares of the tile's numbers.
    """
    n_kept, n_points = numbers.shape[0], tile.scale.shape[0]
    block, scratch = np.zeros((n_kept, LANES), np.float32), np.empty((n_kept, LANES), np.float32)
    row, sums = np.empty((3, n_b), np.float32), np.empty(LANES, np.float64)
    lane_squares = np.zeros((n_kept, LANES), np.float32)
    for begin in range(0, n_points, BLOCK):
        n_block = min(BLOCK, n_points - begin)
        # Contract with the other curve's coefficients, one point to three lanes [BenArtzi07, eq. 4.16].
        for i in range(n_block):
            if keep_a:
                _contract_b(tile, begin + i, n_b, dormant, block, 3 * i)
            else:
                _contract_a(tile, begin + i, n_b, dormant, row, block, 3 * i)
        first, last = 3 * (at + begin), 3 * (at + begin + n_block)
        _add_radiance(block, curve, sums, radiance[first:last])
        # Transform all lanes to wavelets [BenArtzi07, eq. 4.18].
        if wavelet:
            daubechies4(block, scratch)
        # Scale, measure and round each plane.
        for j in range(n_kept):
            maxima[j] = max(maxima[j], _measure(block[j], inverse[j], 3 * n_block, lane_squares[j]))
            _write(block[j], inverse[j], numbers[j, first:last])
    for j in range(n_kept):
        for lane in range(LANES):
            squares[j, lane % 3] += lane_squares[j, lane]
