"""Compiled projection of light onto the bands of one or two curves, point by point.

The loop runs over lights, not over bands: cost O(M) a point [BenArtzi07, code 1]. A light is a triangle; its share of
a band follows from the parameter γ at its three corners alone (eq. 4.10). Near a pole of γ that is not linear, and the
triangle is split in four until it is.
"""

import math

import numba as nb
import numpy as np

from engine.material._kernels import gamma, quotient_cosine
from engine.material.kinds import GGX, GRAZING, LAMBERT, ROUGH_ALPHA, ROUGH_CONDUCTOR, ROUGH_DISTRIBUTION
from engine.material.kinds import THETA_D, THETA_H, THETA_I

_MAX_SPLIT = 3
_HALF_PI = np.float32(math.pi / 2)
_TINY = np.float32(1e-30)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def share_below(t, low, middle, high):
    """Fraction of a triangle's area where γ < t, for low < t ≤ high and low ≤ middle ≤ high [BenArtzi07, eq. 4.10]."""
    if t <= middle:
        return (t - low) * (t - low) / ((middle - low) * (high - low))
    return np.float32(1.0) - (high - t) * (high - t) / max((high - middle) * (high - low), _TINY)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def band_shares(a, b, c, n_bands, shares):
    """Shares of a triangle in each band, corner values in units of bands; returns (first band, number of bands)."""
    low, high = min(a, b, c), max(a, b, c)
    first = min(int(low), n_bands - 1)
    last = min(int(high), n_bands - 1)
    if first == last:
        shares[0] = np.float32(1.0)
        return first, 1
    middle = max(min(a, b), min(max(a, b), c))
    below = np.float32(0.0)
    for j in range(first, last):
        upto = share_below(np.float32(j + 1), low, middle, high)
        shares[j - first] = upto - below
        below = upto
    shares[last - first] = np.float32(1.0) - below
    return first, last - first + 1


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _deposit(bands, weight, r, g, b, n_a, n_b, a0, a1, a2, b0, b1, b2, shares_a, shares_b):
    """bands[j, k] += weight · (r, g, b) · Δ_j · Δ_k for corner parameters in units of bands [BenArtzi07, eq. 4.15]."""
    first_a, count_a = band_shares(a0, a1, a2, n_a, shares_a)
    first_b, count_b = 0, 1
    shares_b[0] = np.float32(1.0)
    if n_b > 1:
        first_b, count_b = band_shares(b0, b1, b2, n_b, shares_b)
    r, g, b = r * weight, g * weight, b * weight
    for j in range(count_a):
        share = shares_a[j]
        at = first_a + j
        for k in range(first_b, first_b + count_b):
            w = share * shares_b[k - first_b]
            bands[at, k, 0] += w * r
            bands[at, k, 1] += w * g
            bands[at, k, 2] += w * b


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _is_curved(size, gamma0, gamma1, gamma2, scale):
    """Whether γ, a cone near its pole, bends over a triangle by more than half a band and a seventh of the triangle.

    Over a triangle of extent s at distance r from the pole it leaves its chord by s²/8r.
    """
    bend = size * size * np.float32(0.125)
    nearest = min(gamma0, gamma1, gamma2)
    return bend > nearest * max(np.float32(0.5) / scale, np.float32(0.15) * size)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _midpoint(triangle, i, j, out, k):
    x = triangle[3 * i] + triangle[3 * j]
    y = triangle[3 * i + 1] + triangle[3 * j + 1]
    z = triangle[3 * i + 2] + triangle[3 * j + 2]
    inverse = np.float32(1.0) / np.sqrt(x * x + y * y + z * z)
    out[3 * k], out[3 * k + 1], out[3 * k + 2] = x * inverse, y * inverse, z * inverse


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _deposit_split(bands, weight, red, green, blue, n_a, n_b, scale_a, scale_b, extent_a, extent_b, kind_a, kind_b, q, ox, oy, oz,
                   stack, depths, shares_a, shares_b):
    """As `_deposit` for the triangle in stack[0] (nine numbers), split in four wherever γ is not linear over it."""
    top = 0
    depths[0] = 0
    six = np.empty(18, np.float32)
    ga, gb = np.zeros(3, np.float32), np.zeros(3, np.float32)
    while top >= 0:
        depth = depths[top]
        for i in range(3):
            x, y, z = stack[top, 3 * i], stack[top, 3 * i + 1], stack[top, 3 * i + 2]
            ga[i] = min(gamma(kind_a, q, x, y, z, ox, oy, oz), _HALF_PI)
            if n_b > 1:
                gb[i] = min(gamma(kind_b, q, x, y, z, ox, oy, oz), _HALF_PI)
        shrink = np.float32(0.5) ** depth
        curved = _is_curved(extent_a * shrink, ga[0], ga[1], ga[2], scale_a)
        if n_b > 1:
            curved = curved or _is_curved(extent_b * shrink, gb[0], gb[1], gb[2], scale_b)
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
        _deposit(bands, w, red, green, blue, n_a, n_b, ga[0] * scale_a, ga[1] * scale_a, ga[2] * scale_a,
                 gb[0] * scale_b, gb[1] * scale_b, gb[2] * scale_b, shares_a, shares_b)
        top -= 1


_CHILDREN = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _arc(root, x):
    """arccos x for x in [0, 1], given root = sqrt(1 - x) [Abramowitz64, 4.4.45], error 7e-5."""
    p = np.float32(-0.0187293) * x + np.float32(0.0742610)
    p = p * x - np.float32(0.2121144)
    return root * (p * x + np.float32(1.5707288))


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def fill_gammas(kind, q, x, y, z, ox, oy, oz, out):
    """γ in [0, π/2] of each direction (x, y, z): `gamma` in single precision, in loops that the compiler vectorises.

    Error 1e-4 rad, a hundredth of the narrowest band of a 128-band curve; the angle of a narrow lobe's tip keeps its
    digits because 1 - cos is formed without cancellation.
    """
    one = np.float32(1.0)
    if kind == THETA_I:
        for v in range(x.shape[0]):
            c = min(max(z[v], np.float32(0.0)), one)
            flat2 = x[v] * x[v] + y[v] * y[v]
            out[v] = _arc(np.sqrt(min(flat2 / (one + c), one)), c)
    elif kind == THETA_H:
        for v in range(x.shape[0]):
            sx, sy, sz = x[v] + ox, y[v] + oy, max(z[v] + oz, np.float32(0.0))
            flat2 = sx * sx + sy * sy
            length = np.sqrt(flat2 + sz * sz + _TINY)
            out[v] = _arc(np.sqrt(min(flat2 / (length * (length + sz)), one)), sz / length)
    elif kind == THETA_D:
        for v in range(x.shape[0]):
            dx, dy, dz = x[v] - ox, y[v] - oy, z[v] - oz
            sin2 = min(np.float32(0.25) * (dx * dx + dy * dy + dz * dz), one)
            c = np.sqrt(one - sin2)
            out[v] = _arc(np.sqrt(sin2 / (one + c)), c)
    else:
        for v in range(x.shape[0]):
            out[v] = min(np.float32(gamma(kind, q, x[v], y[v], z[v], ox, oy, oz)), _HALF_PI)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def weigh(model_kind, q, x, y, z, ox, oy, oz, weights):
    """weights (n,) *= ρ_q cosθ of each direction (x, y, z): `quotient_cosine`, the common models in vector loops."""
    if model_kind == LAMBERT:
        for i in range(x.shape[0]):
            weights[i] *= max(z[i], np.float32(0.0)) * np.float32(1.0 / math.pi)
    elif model_kind == ROUGH_CONDUCTOR and q[ROUGH_DISTRIBUTION] == GGX and oz > GRAZING:
        a2 = np.float32(q[ROUGH_ALPHA] * q[ROUGH_ALPHA])
        rest = np.float32(1.0) - a2
        masked = np.float32(1.0) / (oz + np.sqrt(a2 + rest * oz * oz))
        for i in range(x.shape[0]):
            c = max(z[i], np.float32(0.0))
            weights[i] *= c * masked / (c + np.sqrt(a2 + rest * c * c))
    else:
        for i in range(x.shape[0]):
            weights[i] *= np.float32(quotient_cosine(model_kind, q, x[i], y[i], z[i], ox, oy, oz))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def slope(kind):
    """How much γ can change with the light's direction: a bound of |dγ/dω| away from poles."""
    return np.float32(0.5) if kind == THETA_H or kind == THETA_D else np.float32(1.0)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def project_lights(bands, n_a, n_b, x, y, z, corners, sizes, lights, weights, cx, cy, cz, colours, q, model_kind,
                   kind_a, kind_b, ox, oy, oz, gammas_a, gammas_b, shares_a, shares_b, stack, depths):
    """Add the listed lights to bands (J, K, 3): T_jk += V L ρ_q cosθ ΔΩ Δ_mj Δ_mk [BenArtzi07, eq. 4.15].

    x, y, z (N,) corner directions in the local frame; corners (M, 3) index them; sizes (M,) longest edge in radians.
    lights (n,) are the visible ones, with weights (n,) visible share and cx, cy, cz (n,) centre directions;
    colours (M, 3) radiance times solid angle; (ox, oy, oz) the local eye direction; the rest is scratch.
    """
    scale_a, scale_b = np.float32(n_a) / _HALF_PI, np.float32(n_b) / _HALF_PI
    fill_gammas(kind_a, q, x, y, z, ox, oy, oz, gammas_a)
    if n_b > 1:
        fill_gammas(kind_b, q, x, y, z, ox, oy, oz, gammas_b)
    n = lights.shape[0]
    weigh(model_kind, q, cx[:n], cy[:n], cz[:n], ox, oy, oz, weights)
    slope_a, slope_b = slope(kind_a), slope(kind_b)
    b0 = b1 = b2 = np.float32(0.0)
    for i in range(n):
        m = lights[i]
        weight = weights[i]
        if not weight > 0.0:
            continue
        v0, v1, v2 = corners[m, 0], corners[m, 1], corners[m, 2]
        a0, a1, a2 = gammas_a[v0], gammas_a[v1], gammas_a[v2]
        curved = _is_curved(sizes[m] * slope_a, a0, a1, a2, scale_a)
        if n_b > 1:
            b0, b1, b2 = gammas_b[v0], gammas_b[v1], gammas_b[v2]
            curved = curved or _is_curved(sizes[m] * slope_b, b0, b1, b2, scale_b)
        if not curved:
            _deposit(bands, weight, colours[m, 0], colours[m, 1], colours[m, 2], n_a, n_b, a0 * scale_a, a1 * scale_a, a2 * scale_a,
                     b0 * scale_b, b1 * scale_b, b2 * scale_b, shares_a, shares_b)
            continue
        for corner in range(3):
            v = corners[m, corner]
            stack[0, 3 * corner], stack[0, 3 * corner + 1], stack[0, 3 * corner + 2] = x[v], y[v], z[v]
        _deposit_split(bands, weight, colours[m, 0], colours[m, 1], colours[m, 2], n_a, n_b, scale_a, scale_b, sizes[m] * slope_a, sizes[m] * slope_b,
                       kind_a, kind_b, q, ox, oy, oz, stack, depths, shares_a, shares_b)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _count(word):
    """Number of set bits."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def list_visible(words, fine_words, first_bit, n_bits, fine, lights, weights):
    """List the lights a point sees and the share of each; returns their number.

    Light m sees the share of set bits in [first_bit, first_bit + n_bits), a range of 1, 4, 16 or whole words; or, where
    fine[m] ≥ 0, that bit of fine_words.
    """
    n = 0
    for m in range(first_bit.shape[0]):
        f = fine[m]
        if f >= 0:
            share = np.float32((fine_words[f >> 6] >> np.uint64(f & 63)) & np.uint64(1))
        else:
            share = _share(words, first_bit[m], n_bits[m])
        lights[n] = m
        weights[n] = share
        n += share > np.float32(0.0)
    return n


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _share(words, first, n):
    if n == 1:
        return np.float32((words[first >> 6] >> np.uint64(first & 63)) & np.uint64(1))
    if n < 64:
        part = (words[first >> 6] >> np.uint64(first & 63)) & ((np.uint64(1) << np.uint64(n)) - np.uint64(1))
        return np.float32(_count(part)) / np.float32(n)
    total = 0
    for w in range(first >> 6, (first + n) >> 6):
        total += _count(words[w])
    return np.float32(total) / np.float32(n)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def to_local(vectors, frame, x, y, z):
    """Rotate (3, N) world vectors into the frame whose rows are tangent, bitangent, normal."""
    for v in range(vectors.shape[1]):
        x[v] = frame[0, 0] * vectors[0, v] + frame[0, 1] * vectors[1, v] + frame[0, 2] * vectors[2, v]
        y[v] = frame[1, 0] * vectors[0, v] + frame[1, 1] * vectors[1, v] + frame[1, 2] * vectors[2, v]
        z[v] = frame[2, 0] * vectors[0, v] + frame[2, 1] * vectors[1, v] + frame[2, 2] * vectors[2, v]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def gather_local(vectors, listed, frame, x, y, z):
    """As `to_local` for the listed columns alone."""
    for i in range(listed.shape[0]):
        u, v, w = vectors[0, listed[i]], vectors[1, listed[i]], vectors[2, listed[i]]
        x[i] = frame[0, 0] * u + frame[0, 1] * v + frame[0, 2] * w
        y[i] = frame[1, 0] * u + frame[1, 1] * v + frame[1, 2] * w
        z[i] = frame[2, 0] * u + frame[2, 1] * v + frame[2, 2] * w


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _towards(points, x, y, z, out):
    """Unit vectors (3, N) from (x, y, z) to points (3, N)."""
    for v in range(points.shape[1]):
        dx, dy, dz = points[0, v] - x, points[1, v] - y, points[2, v] - z
        inverse = np.float32(1.0) / np.sqrt(max(dx * dx + dy * dy + dz * dz, _TINY))
        out[0, v], out[1, v], out[2, v] = dx * inverse, dy * inverse, dz * inverse


@nb.njit(cache=True, nogil=True, error_model="numpy")
def patch_power(directions, corners, radiance, colours, sizes):
    """Radiance times solid angle [VanOosterom83] and angular size of patches with unit corner directions (3, N)."""
    for m in range(corners.shape[0]):
        a, b, c = directions[:, corners[m, 0]], directions[:, corners[m, 1]], directions[:, corners[m, 2]]
        ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
        bc = b[0] * c[0] + b[1] * c[1] + b[2] * c[2]
        ca = c[0] * a[0] + c[1] * a[1] + c[2] * a[2]
        # The triple product through edge vectors: corners seen from afar are nearly parallel and would cancel.
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        triple = a[0] * (uy * vz - uz * vy) + a[1] * (uz * vx - ux * vz) + a[2] * (ux * vy - uy * vx)
        solid_angle = np.float32(2.0) * np.arctan2(abs(triple), np.float32(1.0) + ab + bc + ca)
        for i in range(3):
            colours[m, i] = radiance[m, i] * solid_angle
        wx, wy, wz = c[0] - b[0], c[1] - b[1], c[2] - b[2]
        sizes[m] = np.sqrt(max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def project_tile(
    rows, position, tangent, normal, wo,
    sky_directions, sky_corners, sky_sizes, sky_centres, sky_colours, sky_first, sky_count, sky_fine, sky_bits, fine_bits,
    patch_points, patch_corners, patch_centres, patch_radiance, patch_bits,
    q, model_kind, kind_a, kind_b, n_a, n_b, trim,
    scale, first, count, start, values,
):
    """Project all lights for one layer at the points `rows` and encode them; returns the number of values written.

    Directions and points are (3, N), colours (M, 3). sky_first, sky_count, sky_fine as in `list_visible`; patches see
    bit m of patch_bits. See `bandstore` for the encoding in (scale, first, count, start, values).
    """
    n_sky, n_patch = sky_corners.shape[0], patch_corners.shape[0]
    n_lights, n_directions = max(n_sky, n_patch), max(sky_directions.shape[1], patch_points.shape[1])
    x, y, z = np.empty(n_directions, np.float32), np.empty(n_directions, np.float32), np.empty(n_directions, np.float32)
    cx, cy, cz = np.empty(n_lights, np.float32), np.empty(n_lights, np.float32), np.empty(n_lights, np.float32)
    gammas_a, gammas_b = np.empty(n_directions, np.float32), np.empty(n_directions, np.float32)
    lights, weights = np.empty(n_lights + 1, np.int64), np.empty(n_lights + 1, np.float32)
    world, centre_world = np.empty((3, patch_points.shape[1]), np.float32), np.empty((3, n_patch), np.float32)
    colours, sizes = np.zeros((n_patch, 3), np.float32), np.empty(n_patch, np.float32)
    patch_bit, nothing = np.arange(n_patch), np.zeros(n_patch, np.int64)
    shares_a, shares_b = np.empty(n_a + 1, np.float32), np.empty(n_b + 1, np.float32)
    stack, depths = np.empty((3 * _MAX_SPLIT + 4, 9), np.float32), np.empty(3 * _MAX_SPLIT + 4, np.int64)
    bands, frame = np.empty((n_a, n_b, 3), np.float32), np.empty((3, 3), np.float32)
    written = 0
    for i in range(rows.shape[0]):
        r = rows[i]
        _frame(tangent[r], normal[r], frame)
        ox = frame[0, 0] * wo[r, 0] + frame[0, 1] * wo[r, 1] + frame[0, 2] * wo[r, 2]
        oy = frame[1, 0] * wo[r, 0] + frame[1, 1] * wo[r, 1] + frame[1, 2] * wo[r, 2]
        oz = frame[2, 0] * wo[r, 0] + frame[2, 1] * wo[r, 1] + frame[2, 2] * wo[r, 2]
        bands[:] = np.float32(0.0)
        if n_sky > 0:
            n = list_visible(sky_bits[r], fine_bits[r], sky_first, sky_count, sky_fine, lights, weights)
            to_local(sky_directions, frame, x, y, z)
            gather_local(sky_centres, lights[:n], frame, cx, cy, cz)
            k = sky_directions.shape[1]
            project_lights(bands, n_a, n_b, x[:k], y[:k], z[:k], sky_corners, sky_sizes, lights[:n], weights, cx, cy, cz,
                           sky_colours, q, model_kind, kind_a, kind_b, ox, oy, oz, gammas_a, gammas_b, shares_a, shares_b,
                           stack, depths)
        if n_patch > 0:
            n = list_visible(patch_bits[r], patch_bits[r], nothing, nothing, patch_bit, lights, weights)
            _towards(patch_points, position[r, 0], position[r, 1], position[r, 2], world)
            _towards(patch_centres, position[r, 0], position[r, 1], position[r, 2], centre_world)
            patch_power(world, patch_corners, patch_radiance, colours, sizes)
            to_local(world, frame, x, y, z)
            gather_local(centre_world, lights[:n], frame, cx, cy, cz)
            k = patch_points.shape[1]
            project_lights(bands, n_a, n_b, x[:k], y[:k], z[:k], patch_corners, sizes, lights[:n], weights, cx, cy, cz,
                           colours, q, model_kind, kind_a, kind_b, ox, oy, oz, gammas_a, gammas_b, shares_a, shares_b,
                           stack, depths)
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
    exponent = max(((np.float32(largest).view(np.int32) >> 23) & 255) - 126 + 30, 0)
    unit = np.int32((127 + 39 - exponent) << 23).view(np.float32)
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
