"""Compiled projection of light onto the bands of one or two curves, point by point.

The loop runs over lights, not over bands: cost O(M) a point [BenArtzi07, code 1]. A light is a triangle; its share of
a band follows from the parameter γ at its three corners alone (eq. 4.10). Near a pole of γ that is not linear, and the
triangle is split in four until it is.

Arguments come in groups (the named tuples below), which cost nothing in compiled code. Directions are stored axis by
axis, (3, N), so that loops over them are vector loops.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from engine.material._kernels import gamma
from engine.transport._angle_kernels import HALF_PI, TINY, fill_gammas, slope, weigh
from engine.transport._band_kernels import encode_bands

_MAX_SPLIT = 3
_CHILDREN = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])


class Sky(NamedTuple):
    """M triangle lights over N corner directions: directions (3, N), corners (M, 3), sizes (M,) longest edge, radians,
    centres (3, M), colours (M, 3) radiance times solid angle; first, n_bits, fine (M,): see `list_visible`."""

    directions: np.ndarray
    corners: np.ndarray
    sizes: np.ndarray
    centres: np.ndarray
    colours: np.ndarray
    first: np.ndarray
    n_bits: np.ndarray
    fine: np.ndarray


class Patches(NamedTuple):
    """M patches over N corner points: points (3, N), corners (M, 3), centres (3, M), radiance (M, 3)."""

    points: np.ndarray
    corners: np.ndarray
    centres: np.ndarray
    radiance: np.ndarray


class Bits(NamedTuple):
    """Packed visibility (P, words) of the sphere, of sky lights with bits of their own, and of patches."""

    sphere: np.ndarray
    fine: np.ndarray
    patches: np.ndarray


class Surface(NamedTuple):
    """Shading points (P, 3): position, tangent, normal and the direction to the eye."""

    position: np.ndarray
    tangent: np.ndarray
    normal: np.ndarray
    wo: np.ndarray


class Optics(NamedTuple):
    """A layer: model and angle numbers, quotient parameters q (8,), bands (J, K), and how many bands γ may bend over a
    light before it is split."""

    model: int
    q: np.ndarray
    kind_a: int
    kind_b: int
    n_a: int
    n_b: int
    tolerance: np.float32


class Encoded(NamedTuple):
    """Where a tile's bands are written: see `bandstore`."""

    scale: np.ndarray
    first: np.ndarray
    length: np.ndarray
    start: np.ndarray
    values: np.ndarray


class _Scratch(NamedTuple):
    """Room for one point."""

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    cx: np.ndarray
    cy: np.ndarray
    cz: np.ndarray
    gammas_a: np.ndarray
    gammas_b: np.ndarray
    centre_a: np.ndarray
    centre_b: np.ndarray
    lights: np.ndarray
    weights: np.ndarray
    shares_b: np.ndarray
    stack: np.ndarray
    depths: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def share_below(t, low, middle, high):
    """Fraction of a triangle's area where γ < t, for low < t ≤ high and low ≤ middle ≤ high [BenArtzi07, eq. 4.10]."""
    if t <= middle:
        return (t - low) * (t - low) / ((middle - low) * (high - low))
    return np.float32(1.0) - (high - t) * (high - t) / max((high - middle) * (high - low), TINY)


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
def _add(bands, j, k, w, r, g, b):
    bands[j, k, 0] += w * r
    bands[j, k, 1] += w * g
    bands[j, k, 2] += w * b


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _deposit_one(bands, r, g, b, a0, a1, a2):
    """bands[j, 0] += (r, g, b) · Δ_j for corner parameters in units of bands [BenArtzi07, eq. 4.11]."""
    low, high = min(a0, a1, a2), max(a0, a1, a2)
    first, last = min(int(low), bands.shape[0] - 1), min(int(high), bands.shape[0] - 1)
    below = np.float32(0.0)
    if first < last:
        middle = max(min(a0, a1), min(max(a0, a1), a2))
        for j in range(first, last):
            upto = share_below(np.float32(j + 1), low, middle, high)
            _add(bands, j, 0, upto - below, r, g, b)
            below = upto
    _add(bands, last, 0, np.float32(1.0) - below, r, g, b)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _deposit_two(bands, r, g, b, a0, a1, a2, b0, b1, b2, shares_b):
    """bands[j, k] += (r, g, b) · Δ_j · Δ_k for corner parameters in units of bands [BenArtzi07, eq. 4.15]."""
    first_b, count_b = band_shares(b0, b1, b2, bands.shape[1], shares_b)
    low, high = min(a0, a1, a2), max(a0, a1, a2)
    first, last = min(int(low), bands.shape[0] - 1), min(int(high), bands.shape[0] - 1)
    middle = max(min(a0, a1), min(max(a0, a1), a2))
    below = np.float32(0.0)
    for j in range(first, last + 1):
        upto = np.float32(1.0)
        if j < last:
            upto = share_below(np.float32(j + 1), low, middle, high)
        share = upto - below
        below = upto
        for k in range(count_b):
            _add(bands, j, first_b + k, share * shares_b[k], r, g, b)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _deposit(bands, weight, r, g, b, a0, a1, a2, b0, b1, b2, shares_b):
    """Spread weight · (r, g, b) over the bands of one curve or two."""
    if bands.shape[1] == 1:
        _deposit_one(bands, r * weight, g * weight, b * weight, a0, a1, a2)
    else:
        _deposit_two(bands, r * weight, g * weight, b * weight, a0, a1, a2, b0, b1, b2, shares_b)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _is_curved(size, gamma0, gamma1, gamma2, scale, tolerance):
    """Whether γ, a cone near its pole, bends over a triangle by more than `tolerance` bands and as much of its size.

    Over a triangle of extent s at distance r from the pole it leaves its chord by s²/8r. A triangle far larger than a
    band need not follow the band: there the bound is 0.3 · tolerance of the triangle.
    """
    bend = size * size * np.float32(0.125)
    nearest = min(gamma0, gamma1, gamma2)
    return bend > nearest * tolerance * max(np.float32(1.0) / scale, np.float32(0.3) * size)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _midpoint(triangle, i, j, out, k):
    x = triangle[3 * i] + triangle[3 * j]
    y = triangle[3 * i + 1] + triangle[3 * j + 1]
    z = triangle[3 * i + 2] + triangle[3 * j + 2]
    inverse = np.float32(1.0) / np.sqrt(x * x + y * y + z * z)
    out[3 * k], out[3 * k + 1], out[3 * k + 2] = x * inverse, y * inverse, z * inverse


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _push_children(stack, depths, top, six):
    """Replace the triangle stack[top] by its four quarters."""
    for i in range(9):
        six[i] = stack[top, i]
    _midpoint(six, 0, 1, six, 3)
    _midpoint(six, 1, 2, six, 4)
    _midpoint(six, 2, 0, six, 5)
    depth = depths[top] + 1
    for child in range(4):
        for corner in range(3):
            v = _CHILDREN[child, corner]
            for i in range(3):
                stack[top + child, 3 * corner + i] = six[3 * v + i]
        depths[top + child] = depth


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _deposit_split(bands, weight, r, g, b, size_a, size_b, scale_a, scale_b, optics, ox, oy, oz, scratch):
    """As `_deposit` for the triangle in stack[0] (nine numbers), split in four wherever γ is not linear over it."""
    stack, depths = scratch.stack, scratch.depths
    six = np.empty(18, np.float32)
    ga, gb = np.zeros(3, np.float32), np.zeros(3, np.float32)
    top = 0
    depths[0] = 0
    while top >= 0:
        for i in range(3):
            x, y, z = stack[top, 3 * i], stack[top, 3 * i + 1], stack[top, 3 * i + 2]
            ga[i] = min(gamma(optics.kind_a, optics.q, x, y, z, ox, oy, oz), HALF_PI)
            if optics.n_b > 1:
                gb[i] = min(gamma(optics.kind_b, optics.q, x, y, z, ox, oy, oz), HALF_PI)
        shrink = np.float32(0.5) ** depths[top]
        curved = _is_curved(size_a * shrink, ga[0], ga[1], ga[2], scale_a, optics.tolerance)
        if optics.n_b > 1:
            curved = curved or _is_curved(size_b * shrink, gb[0], gb[1], gb[2], scale_b, optics.tolerance)
        if curved and depths[top] < _MAX_SPLIT:
            _push_children(stack, depths, top, six)
            top += 3
            continue
        w = weight * shrink * shrink
        a0, a1, a2 = ga[0] * scale_a, ga[1] * scale_a, ga[2] * scale_a
        _deposit(bands, w, r, g, b, a0, a1, a2, gb[0] * scale_b, gb[1] * scale_b, gb[2] * scale_b, scratch.shares_b)
        top -= 1


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _about_centre(gamma0, gamma1, gamma2, centre, scale):
    """Corner parameters in units of bands, moved so that their mean is γ at the light's centre of brightness.

    This takes out the first-order error of both a light that is brighter on one side and a γ that bends: without it
    lobes lose energy, for the chord of a cone lies above it.
    """
    shift = centre - (gamma0 + gamma1 + gamma2) * np.float32(1 / 3)
    zero = np.float32(0.0)
    return max(gamma0 + shift, zero) * scale, max(gamma1 + shift, zero) * scale, max(gamma2 + shift, zero) * scale


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _project_lights(bands, corners, sizes, colours, n_directions, n_lights, optics, ox, oy, oz, scratch):
    """Add the listed lights to bands (J, K, 3): T_jk += V L ρ_q cosθ ΔΩ Δ_mj Δ_mk [BenArtzi07, eq. 4.15].

    scratch holds the local corner directions (x, y, z), the lights listed, their weights (visible share) and centre
    directions (cx, cy, cz); (ox, oy, oz) is the local eye direction.
    """
    x, y, z, weights = scratch.x[:n_directions], scratch.y[:n_directions], scratch.z[:n_directions], scratch.weights
    gammas_a, gammas_b, q, two = scratch.gammas_a, scratch.gammas_b, optics.q, optics.n_b > 1
    scale_a, scale_b = np.float32(optics.n_a) / HALF_PI, np.float32(optics.n_b) / HALF_PI
    fill_gammas(optics.kind_a, q, x, y, z, ox, oy, oz, gammas_a)
    if two:
        fill_gammas(optics.kind_b, q, x, y, z, ox, oy, oz, gammas_b)
    cx, cy, cz = scratch.cx[:n_lights], scratch.cy[:n_lights], scratch.cz[:n_lights]
    weigh(optics.model, q, cx, cy, cz, ox, oy, oz, weights)
    fill_gammas(optics.kind_a, q, cx, cy, cz, ox, oy, oz, scratch.centre_a)
    if two:
        fill_gammas(optics.kind_b, q, cx, cy, cz, ox, oy, oz, scratch.centre_b)
    slope_a, slope_b = slope(optics.kind_a), slope(optics.kind_b)
    b0 = b1 = b2 = np.float32(0.0)
    for i in range(n_lights):
        weight = weights[i]
        if not weight > 0.0:
            continue
        m = scratch.lights[i]
        v0, v1, v2 = corners[m, 0], corners[m, 1], corners[m, 2]
        r, g, b = colours[m, 0], colours[m, 1], colours[m, 2]
        size_a, size_b = sizes[m] * slope_a, sizes[m] * slope_b
        a0, a1, a2 = gammas_a[v0], gammas_a[v1], gammas_a[v2]
        curved = _is_curved(size_a, a0, a1, a2, scale_a, optics.tolerance)
        if two:
            b0, b1, b2 = gammas_b[v0], gammas_b[v1], gammas_b[v2]
            curved = curved or _is_curved(size_b, b0, b1, b2, scale_b, optics.tolerance)
        if curved:
            for corner in range(3):
                v = corners[m, corner]
                at = 3 * corner
                scratch.stack[0, at], scratch.stack[0, at + 1], scratch.stack[0, at + 2] = x[v], y[v], z[v]
            _deposit_split(bands, weight, r, g, b, size_a, size_b, scale_a, scale_b, optics, ox, oy, oz, scratch)
            continue
        a0, a1, a2 = _about_centre(a0, a1, a2, scratch.centre_a[i], scale_a)
        if two:
            b0, b1, b2 = _about_centre(b0, b1, b2, scratch.centre_b[i], scale_b)
        _deposit(bands, weight, r, g, b, a0, a1, a2, b0, b1, b2, scratch.shares_b)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def count_bits(word):
    """Number of set bits of a uint64."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _share(words, first, n):
    if n == 1:
        return np.float32((words[first >> 6] >> np.uint64(first & 63)) & np.uint64(1))
    if n < 64:
        part = (words[first >> 6] >> np.uint64(first & 63)) & ((np.uint64(1) << np.uint64(n)) - np.uint64(1))
        return np.float32(count_bits(part)) / np.float32(n)
    total = 0
    for w in range(first >> 6, (first + n) >> 6):
        total += count_bits(words[w])
    return np.float32(total) / np.float32(n)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def list_visible(words, fine_words, first, n_bits, fine, lights, weights):
    """List the lights a point sees and the share of each; returns their number.

    Light m sees the share of set bits in [first, first + n_bits), a range of 1, 4, 16 or whole words; or, where
    fine[m] ≥ 0, that bit of fine_words.
    """
    n = 0
    for m in range(fine.shape[0]):
        f = fine[m]
        if f >= 0:
            share = np.float32((fine_words[f >> 6] >> np.uint64(f & 63)) & np.uint64(1))
        else:
            share = _share(words, first[m], n_bits[m])
        lights[n] = m
        weights[n] = share
        n += share > np.float32(0.0)
    return n


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def to_local(vectors, frame, x, y, z):
    """Rotate (3, N) world vectors into the frame whose rows are tangent, bitangent, normal."""
    for v in range(vectors.shape[1]):
        x[v] = frame[0, 0] * vectors[0, v] + frame[0, 1] * vectors[1, v] + frame[0, 2] * vectors[2, v]
        y[v] = frame[1, 0] * vectors[0, v] + frame[1, 1] * vectors[1, v] + frame[1, 2] * vectors[2, v]
        z[v] = frame[2, 0] * vectors[0, v] + frame[2, 1] * vectors[1, v] + frame[2, 2] * vectors[2, v]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def gather_local(vectors, listed, n, frame, x, y, z):
    """As `to_local` for the first n listed columns alone."""
    for i in range(n):
        u, v, w = vectors[0, listed[i]], vectors[1, listed[i]], vectors[2, listed[i]]
        x[i] = frame[0, 0] * u + frame[0, 1] * v + frame[0, 2] * w
        y[i] = frame[1, 0] * u + frame[1, 1] * v + frame[1, 2] * w
        z[i] = frame[2, 0] * u + frame[2, 1] * v + frame[2, 2] * w


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _towards(points, place, out):
    """Unit vectors (3, N) from a place (3,) to points (3, N)."""
    for v in range(points.shape[1]):
        dx, dy, dz = points[0, v] - place[0], points[1, v] - place[1], points[2, v] - place[2]
        inverse = np.float32(1.0) / np.sqrt(max(dx * dx + dy * dy + dz * dz, TINY))
        out[0, v], out[1, v], out[2, v] = dx * inverse, dy * inverse, dz * inverse


@nb.njit(cache=True, nogil=True, error_model="numpy")
def patch_colours(directions, corners, radiance, colours, sizes):
    """Radiance times solid angle [VanOosterom83] and angular size of patches with unit corner directions (3, N)."""
    for m in range(corners.shape[0]):
        i, j, k = corners[m, 0], corners[m, 1], corners[m, 2]
        ax, ay, az = directions[0, i], directions[1, i], directions[2, i]
        bx, by, bz = directions[0, j], directions[1, j], directions[2, j]
        cx, cy, cz = directions[0, k], directions[1, k], directions[2, k]
        # The triple product through edge vectors: corners seen from afar are nearly parallel and would cancel.
        ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
        triple = ax * (uy * vz - uz * vy) + ay * (uz * vx - ux * vz) + az * (ux * vy - uy * vx)
        cosines = (ax * bx + ay * by + az * bz) + (bx * cx + by * cy + bz * cz) + (cx * ax + cy * ay + cz * az)
        solid_angle = np.float32(2.0) * math.atan2(abs(triple), np.float32(1.0) + cosines)
        for channel in range(3):
            colours[m, channel] = radiance[m, channel] * solid_angle
        wx, wy, wz = cx - bx, cy - by, cz - bz
        longest2 = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz)
        sizes[m] = np.sqrt(longest2)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _set_frame(tangent, normal, frame):
    for axis in range(3):
        frame[0, axis] = tangent[axis]
        frame[2, axis] = normal[axis]
    frame[1, 0] = normal[1] * tangent[2] - normal[2] * tangent[1]
    frame[1, 1] = normal[2] * tangent[0] - normal[0] * tangent[2]
    frame[1, 2] = normal[0] * tangent[1] - normal[1] * tangent[0]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _make_scratch(n_directions, n_lights, n_b):
    depth = 3 * _MAX_SPLIT + 4
    return _Scratch(
        np.empty(n_directions, np.float32), np.empty(n_directions, np.float32), np.empty(n_directions, np.float32),
        np.empty(n_lights, np.float32), np.empty(n_lights, np.float32), np.empty(n_lights, np.float32),
        np.empty(n_directions, np.float32), np.empty(n_directions, np.float32),
        np.empty(n_lights, np.float32), np.empty(n_lights, np.float32),
        np.empty(n_lights + 1, np.int64), np.empty(n_lights + 1, np.float32),
        np.empty(n_b + 1, np.float32),
        np.empty((depth, 9), np.float32), np.empty(depth, np.int64),
    )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy")
def project_tile(rows, surface, sky, patches, bits, optics, trim, encoded):
    """Project all lights for one layer at the points `rows` and encode them; returns the number of values written."""
    n_sky, n_patches = sky.corners.shape[0], patches.corners.shape[0]
    n_sky_corners, n_patch_corners = sky.directions.shape[1], patches.points.shape[1]
    s = _make_scratch(max(n_sky_corners, n_patch_corners), max(n_sky, n_patches), optics.n_b)
    corners_seen, centres_seen = np.empty((3, n_patch_corners), np.float32), np.empty((3, n_patches), np.float32)
    colours, sizes = np.zeros((n_patches, 3), np.float32), np.empty(n_patches, np.float32)
    own_bit = np.arange(n_patches)
    bands, frame = np.empty((optics.n_a, optics.n_b, 3), np.float32), np.empty((3, 3), np.float32)
    maxima = np.empty(optics.n_a, np.float32)
    written = 0
    for i in range(rows.shape[0]):
        r = rows[i]
        _set_frame(surface.tangent[r], surface.normal[r], frame)
        wo = surface.wo[r]
        ox = frame[0, 0] * wo[0] + frame[0, 1] * wo[1] + frame[0, 2] * wo[2]
        oy = frame[1, 0] * wo[0] + frame[1, 1] * wo[1] + frame[1, 2] * wo[2]
        oz = frame[2, 0] * wo[0] + frame[2, 1] * wo[1] + frame[2, 2] * wo[2]
        bands[:] = np.float32(0.0)
        if n_sky > 0:
            n = list_visible(bits.sphere[r], bits.fine[r], sky.first, sky.n_bits, sky.fine, s.lights, s.weights)
            to_local(sky.directions, frame, s.x, s.y, s.z)
            gather_local(sky.centres, s.lights, n, frame, s.cx, s.cy, s.cz)
            _project_lights(bands, sky.corners, sky.sizes, sky.colours, n_sky_corners, n, optics, ox, oy, oz, s)
        if n_patches > 0:
            n = list_visible(bits.patches[r], bits.patches[r], own_bit, own_bit, own_bit, s.lights, s.weights)
            _towards(patches.points, surface.position[r], corners_seen)
            _towards(patches.centres, surface.position[r], centres_seen)
            patch_colours(corners_seen, patches.corners, patches.radiance, colours, sizes)
            to_local(corners_seen, frame, s.x, s.y, s.z)
            gather_local(centres_seen, s.lights, n, frame, s.cx, s.cy, s.cz)
            _project_lights(bands, patches.corners, sizes, colours, n_patch_corners, n, optics, ox, oy, oz, s)
        encoded.start[i] = written
        written = encode_bands(bands, trim, maxima, encoded, i, written)
    return written
