"""Compiled projection of light onto the bands of one or two curves, point by point.

The loop runs over lights, not over bands: cost O(M) a point [BenArtzi07, code 1]. A light is a triangle; its share of
a band follows from the parameter γ at its three corners alone (eq. 4.10). Near a pole of γ that is not linear, and the
triangle is split in four until it is.
"""

import math

import numba as nb
import numpy as np

from engine.material._kernels import gamma, quotient_cosine

_MAX_SPLIT = 3
_HALF_PI = np.float32(math.pi / 2)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def share_below(t, low, middle, high):
    """Fraction of a triangle's area where γ < t, for corner values low ≤ middle ≤ high [BenArtzi07, eq. 4.10]."""
    if t <= low:
        return np.float32(0.0)
    if t >= high:
        return np.float32(1.0)
    if t <= middle:
        return (t - low) * (t - low) / ((middle - low) * (high - low))
    return np.float32(1.0) - (high - t) * (high - t) / ((high - middle) * (high - low))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def band_shares(a, b, c, n_bands, shares):
    """Shares of a triangle in each band, corner values in units of bands; returns (first band, number of bands)."""
    low, high = min(a, b, c), max(a, b, c)
    middle = a + b + c - low - high
    middle = min(max(middle, low), high)
    first = min(int(low), n_bands - 1)
    last = min(int(high), n_bands - 1)
    if first == last:
        shares[0] = np.float32(1.0)
        return first, 1
    below = np.float32(0.0)
    for j in range(first, last):
        upto = share_below(np.float32(j + 1), low, middle, high)
        shares[j - first] = upto - below
        below = upto
    shares[last - first] = np.float32(1.0) - below
    return first, last - first + 1


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _add(bands, weight, r, g, b, n_a, n_b, scale_a, scale_b, ga, gb, shares_a, shares_b):
    """bands[j, k] += weight · (r, g, b) · Δ_j · Δ_k for one triangle with corner parameters ga, gb [eq. 4.15]."""
    first_a, count_a = band_shares(ga[0] * scale_a, ga[1] * scale_a, ga[2] * scale_a, n_a, shares_a)
    first_b, count_b = 0, 1
    shares_b[0] = np.float32(1.0)
    if n_b > 1:
        first_b, count_b = band_shares(gb[0] * scale_b, gb[1] * scale_b, gb[2] * scale_b, n_b, shares_b)
    for j in range(count_a):
        wj = weight * shares_a[j]
        for k in range(count_b):
            w = wj * shares_b[k]
            bands[first_a + j, first_b + k, 0] += w * r
            bands[first_a + j, first_b + k, 1] += w * g
            bands[first_a + j, first_b + k, 2] += w * b


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _midpoint(triangle, i, j, out, k):
    x = triangle[3 * i] + triangle[3 * j]
    y = triangle[3 * i + 1] + triangle[3 * j + 1]
    z = triangle[3 * i + 2] + triangle[3 * j + 2]
    inverse = np.float32(1.0) / np.sqrt(x * x + y * y + z * z)
    out[3 * k], out[3 * k + 1], out[3 * k + 2] = x * inverse, y * inverse, z * inverse


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _add_split(bands, weight, r, g, b, n_a, n_b, scale_a, scale_b, size, kind_a, kind_b, q, ox, oy, oz, stack, depths,
               ga, gb, shares_a, shares_b):
    """As `_add` for the triangle in stack[0] (nine numbers), split in four wherever γ is not linear over it."""
    top = 0
    depths[0] = 0
    six = np.empty(18, np.float32)
    while top >= 0:
        depth = depths[top]
        for i in range(3):
            x, y, z = stack[top, 3 * i], stack[top, 3 * i + 1], stack[top, 3 * i + 2]
            ga[i] = gamma(kind_a, q, x, y, z, ox, oy, oz)
            if n_b > 1:
                gb[i] = gamma(kind_b, q, x, y, z, ox, oy, oz)
        part = size * np.float32(0.5) ** depth
        curved = part > np.float32(0.5) * min(ga[0], ga[1], ga[2]) and part * scale_a > np.float32(0.5)
        if n_b > 1:
            curved = curved or (part > np.float32(0.5) * min(gb[0], gb[1], gb[2]) and part * scale_b > np.float32(0.5))
        if curved and depth < _MAX_SPLIT:
            for i in range(9):
                six[i] = stack[top, i]
            _midpoint(six, 0, 1, six, 3)
            _midpoint(six, 1, 2, six, 4)
            _midpoint(six, 2, 0, six, 5)
            for child in range(4):
                for corner in range(3):
                    v = _CHILDREN[child, corner]
                    for i in range(3):
                        stack[top + child, 3 * corner + i] = six[3 * v + i]
                depths[top + child] = depth + 1
            top += 3
            continue
        w = weight * np.float32(0.25) ** depth
        _add(bands, w, r, g, b, n_a, n_b, scale_a, scale_b, ga, gb, shares_a, shares_b)
        top -= 1


_CHILDREN = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def project_lights(bands, directions, corners, sizes, centres, weights, power, q, model_kind, kind_a, kind_b, ox, oy, oz,
                   gammas_a, gammas_b, shares_a, shares_b, stack, depths):
    """Add every light to bands (J, K, 3): T_jk += V L ρ_q cosθ ΔΩ Δ_mj Δ_mk [BenArtzi07, eq. 4.15].

    directions (N, 3) corner directions and centres (M, 3) in the local frame; corners (M, 3) index directions;
    sizes (M,) longest edge in radians; weights (M,) visible share; power (M, 3) radiance times solid angle;
    (ox, oy, oz) the local eye direction; the rest is scratch.
    """
    n_a, n_b = bands.shape[0], bands.shape[1]
    scale_a, scale_b = np.float32(n_a) / _HALF_PI, np.float32(n_b) / _HALF_PI
    for v in range(directions.shape[0]):
        gammas_a[v] = gamma(kind_a, q, directions[v, 0], directions[v, 1], directions[v, 2], ox, oy, oz)
    if n_b > 1:
        for v in range(directions.shape[0]):
            gammas_b[v] = gamma(kind_b, q, directions[v, 0], directions[v, 1], directions[v, 2], ox, oy, oz)
    ga, gb = np.zeros(3, np.float32), np.zeros(3, np.float32)
    for m in range(corners.shape[0]):
        if weights[m] == 0.0:
            continue
        weight = weights[m] * np.float32(
            quotient_cosine(model_kind, q, centres[m, 0], centres[m, 1], centres[m, 2], ox, oy, oz)
        )
        if not weight > 0.0:
            continue
        for i in range(3):
            ga[i] = gammas_a[corners[m, i]]
            if n_b > 1:
                gb[i] = gammas_b[corners[m, i]]
        size = sizes[m]
        curved = size > np.float32(0.5) * min(ga[0], ga[1], ga[2]) and size * scale_a > np.float32(0.5)
        if n_b > 1:
            curved = curved or (size > np.float32(0.5) * min(gb[0], gb[1], gb[2]) and size * scale_b > np.float32(0.5))
        if not curved:
            _add(bands, weight, power[m, 0], power[m, 1], power[m, 2], n_a, n_b, scale_a, scale_b, ga, gb, shares_a, shares_b)
            continue
        for i in range(3):
            for axis in range(3):
                stack[0, 3 * i + axis] = directions[corners[m, i], axis]
        _add_split(bands, weight, power[m, 0], power[m, 1], power[m, 2], n_a, n_b, scale_a, scale_b, size, kind_a, kind_b,
                   q, ox, oy, oz, stack, depths, ga, gb, shares_a, shares_b)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _count(word):
    """Number of set bits."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def visible_shares(words, first_bit, n_bits, out):
    """Share of set bits in each range [first_bit, first_bit + n_bits): ranges of 1, 4 or 16 never cross a word."""
    for m in range(first_bit.shape[0]):
        first, n = first_bit[m], n_bits[m]
        if n == 1:
            out[m] = np.float32((words[first >> 6] >> np.uint64(first & 63)) & np.uint64(1))
        elif n < 64:
            part = (words[first >> 6] >> np.uint64(first & 63)) & ((np.uint64(1) << np.uint64(n)) - np.uint64(1))
            out[m] = np.float32(_count(part)) / np.float32(n)
        else:
            total = 0
            for w in range(first >> 6, (first + n) >> 6):
                total += _count(words[w])
            out[m] = np.float32(total) / np.float32(n)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def to_local(vectors, frame, out):
    """Rotate (N, 3) world vectors into the frame whose rows are tangent, bitangent, normal."""
    for v in range(vectors.shape[0]):
        x, y, z = vectors[v, 0], vectors[v, 1], vectors[v, 2]
        out[v, 0] = frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z
        out[v, 1] = frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z
        out[v, 2] = frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _towards(points, x, y, z, out):
    """Unit vectors from (x, y, z) to (N, 3) points."""
    for v in range(points.shape[0]):
        dx, dy, dz = points[v, 0] - x, points[v, 1] - y, points[v, 2] - z
        inverse = np.float32(1.0) / np.sqrt(max(dx * dx + dy * dy + dz * dz, np.float32(1e-30)))
        out[v, 0], out[v, 1], out[v, 2] = dx * inverse, dy * inverse, dz * inverse


@nb.njit(cache=True, nogil=True, error_model="numpy")
def patch_power(directions, corners, radiance, power, sizes):
    """Radiance times solid angle [Van Oosterom & Strackee 1983] and angular size of patches seen along unit corners."""
    for m in range(corners.shape[0]):
        a, b, c = directions[corners[m, 0]], directions[corners[m, 1]], directions[corners[m, 2]]
        ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        bc = b[0] * c[0] + b[1] * c[1] + b[2] * c[2]
        ca = c[0] * a[0] + c[1] * a[1] + c[2] * a[2]
        # The triple product through edge vectors: corners seen from afar are nearly parallel and would cancel.
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        triple = a[0] * (uy * vz - uz * vy) + a[1] * (uz * vx - ux * vz) + a[2] * (ux * vy - uy * vx)
        solid_angle = np.float32(2.0) * np.arctan2(abs(triple), np.float32(1.0) + ab + bc + ca)
        for i in range(3):
            power[m, i] = radiance[m, i] * solid_angle
        wx, wy, wz = c[0] - b[0], c[1] - b[1], c[2] - b[2]
        sizes[m] = np.sqrt(max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def project_tile(
    rows, position, tangent, normal, wo,
    sky_directions, sky_corners, sky_sizes, sky_centres, sky_power, sky_first, sky_count, sky_fine, sky_bits, fine_bits,
    patch_points, patch_corners, patch_centres, patch_radiance, patch_bits,
    q, model_kind, kind_a, kind_b, n_a, n_b, trim,
    scale, first, count, start, values,
):
    """Project all lights for one layer at the points `rows` and encode them; returns the number of values written.

    sky_fine (M,) is the bit of a light finer than the sphere's level in fine_bits, or -1: then its share is counted
    over sky_count bits from sky_first. See `bandstore` for the encoding in (scale, first, count, start, values).
    """
    n_sky, n_patch = sky_corners.shape[0], patch_corners.shape[0]
    n_directions = max(sky_directions.shape[0], patch_points.shape[0])
    directions, world = np.empty((n_directions, 3), np.float32), np.empty((n_directions, 3), np.float32)
    centres, centre_world = np.empty((max(n_sky, n_patch), 3), np.float32), np.empty((max(n_patch, 1), 3), np.float32)
    weights = np.empty(max(n_sky, n_patch), np.float32)
    power, sizes = np.empty((n_patch, 3), np.float32), np.empty(n_patch, np.float32)
    gammas_a, gammas_b = np.empty(n_directions, np.float32), np.empty(n_directions, np.float32)
    shares_a, shares_b = np.empty(n_a + 1, np.float32), np.empty(n_b + 1, np.float32)
    stack, depths = np.empty((3 * _MAX_SPLIT + 4, 9), np.float32), np.empty(3 * _MAX_SPLIT + 4, np.int64)
    bands = np.empty((n_a, n_b, 3), np.float32)
    frame = np.empty((3, 3), np.float32)
    written = 0
    for i in range(rows.shape[0]):
        r = rows[i]
        _frame(tangent[r], normal[r], frame)
        ox = frame[0, 0] * wo[r, 0] + frame[0, 1] * wo[r, 1] + frame[0, 2] * wo[r, 2]
        oy = frame[1, 0] * wo[r, 0] + frame[1, 1] * wo[r, 1] + frame[1, 2] * wo[r, 2]
        oz = frame[2, 0] * wo[r, 0] + frame[2, 1] * wo[r, 1] + frame[2, 2] * wo[r, 2]
        bands[:] = np.float32(0.0)
        if n_sky > 0:
            visible_shares(sky_bits[r], sky_first, sky_count, weights)
            for m in range(n_sky):
                if sky_fine[m] >= 0:
                    f = sky_fine[m]
                    weights[m] = np.float32((fine_bits[r, f >> 6] >> np.uint64(f & 63)) & np.uint64(1))
            to_local(sky_directions, frame, directions)
            to_local(sky_centres, frame, centres)
            project_lights(bands, directions[: sky_directions.shape[0]], sky_corners, sky_sizes, centres, weights, sky_power,
                           q, model_kind, kind_a, kind_b, ox, oy, oz, gammas_a, gammas_b, shares_a, shares_b, stack, depths)
        if n_patch > 0:
            x, y, z = position[r, 0], position[r, 1], position[r, 2]
            for m in range(n_patch):
                weights[m] = np.float32((patch_bits[r, m >> 6] >> np.uint64(m & 63)) & np.uint64(1))
            _towards(patch_points, x, y, z, world)
            patch_power(world, patch_corners, patch_radiance, power, sizes)
            to_local(world[: patch_points.shape[0]], frame, directions)
            _towards(patch_centres, x, y, z, centre_world)
            to_local(centre_world, frame, centres)
            project_lights(bands, directions[: patch_points.shape[0]], patch_corners, sizes, centres, weights, power,
                           q, model_kind, kind_a, kind_b, ox, oy, oz, gammas_a, gammas_b, shares_a, shares_b, stack, depths)
        start[i] = written
        written = encode_bands(bands, trim, scale, first, count, i, values, written)
    return written


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _frame(tangent, normal, frame):
    for axis in range(3):
        frame[0, axis] = tangent[axis]
        frame[2, axis] = normal[axis]
    frame[1, 0] = normal[1] * tangent[2] - normal[2] * tangent[1]
    frame[1, 1] = normal[2] * tangent[0] - normal[0] * tangent[2]
    frame[1, 2] = normal[0] * tangent[1] - normal[1] * tangent[0]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def encode_bands(bands, trim, scale, first, count, i, values, written):
    """Append point i's bands to `values`; the ends of a row below trim · its maximum join the nearest kept entry."""
    n_a, n_b = bands.shape[0], bands.shape[1]
    largest = np.float32(0.0)
    for j in range(n_a):
        for k in range(n_b):
            largest = max(largest, bands[j, k, 0], bands[j, k, 1], bands[j, k, 2])
    scale[i] = largest
    inverse = np.float32(1.0) / largest if largest > 0.0 else np.float32(0.0)
    if n_b == 1:
        for j in range(n_a):
            values[written + j] = encode(bands[j, 0, 0] * inverse, bands[j, 0, 1] * inverse, bands[j, 0, 2] * inverse)
        return written + n_a
    for j in range(n_a):
        row_largest = np.float32(0.0)
        for k in range(n_b):
            row_largest = max(row_largest, bands[j, k, 0], bands[j, k, 1], bands[j, k, 2])
        low, high = 0, n_b
        if row_largest > 0.0:
            floor = trim * row_largest
            while max(bands[j, low, 0], bands[j, low, 1], bands[j, low, 2]) <= floor:
                for c in range(3):
                    bands[j, low + 1, c] += bands[j, low, c]
                low += 1
            while max(bands[j, high - 1, 0], bands[j, high - 1, 1], bands[j, high - 1, 2]) <= floor and high - 1 > low:
                for c in range(3):
                    bands[j, high - 2, c] += bands[j, high - 1, c]
                high -= 1
        else:
            high = 0
        first[i, j] = low
        count[i, j] = high - low
        for k in range(low, high):
            values[written] = encode(bands[j, k, 0] * inverse, bands[j, k, 1] * inverse, bands[j, k, 2] * inverse)
            written += 1
    return written


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def encode(r, g, b):
    """Three numbers in [0, 1] as nine-bit mantissas with one shared five-bit exponent (2^-30 … 2^1)."""
    largest = max(r, g, b)
    if not largest > np.float32(9.4e-13):
        return np.uint32(0)
    exponent = max(math.frexp(largest)[1] + 30, 0)
    unit = np.float32(2.0) ** (39 - exponent)
    if largest * unit + np.float32(0.5) >= np.float32(512.0):
        exponent += 1
        unit *= np.float32(0.5)
    red, green, blue = int(r * unit + np.float32(0.5)), int(g * unit + np.float32(0.5)), int(b * unit + np.float32(0.5))
    return np.uint32(red | (green << 9) | (blue << 18) | (exponent << 27))


UNITS = np.float32(2.0) ** (np.arange(32) - 39).astype(np.float32)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def contract_tile(scale, first, count, start, values, n_a, n_b, coefficients, keep_a, wavelet, out, at, units):
    """Contract the dormant factor; write the transport of the other, coefficient first, into out (J, P, 3) at column `at`.

    keep_a: coefficients (K, 3) belong to factor B and out gets J rows, else coefficients (J, 3) and out gets K rows.
    wavelet: store Daubechies-4 coefficients of the kept bands rather than the bands.
    """
    n_kept = n_a if keep_a else n_b
    row, turned = np.empty((n_kept, 3), np.float32), np.empty((n_kept, 3), np.float32)
    for i in range(scale.shape[0]):
        row[:] = np.float32(0.0)
        at_value = start[i]
        for j in range(n_a):
            low, n = 0, 1
            if n_b > 1:
                low, n = first[i, j], count[i, j]
            for k in range(low, low + n):
                value = values[at_value]
                at_value += 1
                unit = units[value >> np.uint32(27)]
                r = np.float32(value & np.uint32(511)) * unit
                g = np.float32((value >> np.uint32(9)) & np.uint32(511)) * unit
                b = np.float32((value >> np.uint32(18)) & np.uint32(511)) * unit
                kept, gone = (j, k) if keep_a else (k, j)
                row[kept, 0] += r * coefficients[gone, 0]
                row[kept, 1] += g * coefficients[gone, 1]
                row[kept, 2] += b * coefficients[gone, 2]
        if wavelet:
            daubechies4(row, turned)
        for j in range(n_kept):
            for c in range(3):
                out[j, at + i, c] = row[j, c] * scale[i]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def radiance_tile(scale, first, count, start, values, n_a, n_b, c_a, c_b, out, at, units):
    """out[at + i] = Σ_jk c_a[j] c_b[k] U_jk, summed in double precision: J·K terms of one sign."""
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


D4 = np.array([0.4829629131445341, 0.8365163037378077, 0.2241438680420134, -0.1294095225512603]).astype(np.float32)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def daubechies4(row, scratch):
    """Orthonormal periodic Daubechies-4 transform along axis 0, in place: the fast form of `curve.wavelet`."""
    n = row.shape[0]
    while n > 1:
        half = n // 2
        for i in range(half):
            for c in range(3):
                low = np.float32(0.0)
                high = np.float32(0.0)
                for t in range(4):
                    x = row[(2 * i + t) % n, c]
                    low += D4[t] * x
                    high += (D4[3 - t] if t % 2 == 0 else -D4[3 - t]) * x
                scratch[i, c], scratch[half + i, c] = low, high
        for i in range(n):
            for c in range(3):
                row[i, c] = scratch[i, c]
        n = half
