"""Compiled: the light that arrives at a shading point, triangle by triangle of its own hemisphere."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.core._frame_kernels import to_local, to_world
from engine.core.fast_math import FAST
from engine.light._cone_kernels import cone_share

Float32Array = NDArray[np.float32]
Bytes = NDArray[np.uint8]

N_ROOTS = 20
# Directions of peaks that a point stores separately for moving pictures.
N_PEAK_PLACES = 40
# The brightest peaks, whose visibility each point finds with rays of their own.
N_QUERIED = 8


class Hemisphere(NamedTuple):
    """The triangles above the surface: number (U,) of each on the sphere, and the inverse, place (5120,), −1 below;
    direction (U, 3), solid angle (U,) and mean cosine (U,); the same of level 2 (U / 16,) as coarse_...; children
    (side, side): 4 × place + child of the next finer triangle that contains a direction."""

    number: NDArray[np.int32]
    place: NDArray[np.int32]
    direction: Float32Array
    solid_angle: Float32Array
    cosine: Float32Array
    coarse_direction: Float32Array
    coarse_solid_angle: Float32Array
    coarse_cosine: Float32Array
    children: NDArray[np.int16]


class Light(NamedTuple):
    """The light: sky (side, side, 4) and coarse_sky, as `sky_map.SkyMap`, rotated by the angle with this cosine and
    sine; the peaks' direction and power (M, 3), brightest first; the patches' centre, normal and flux (L, 3), which is
    radiance × area, and their cones (L, 4)."""

    sky: Float32Array
    coarse_sky: Float32Array
    cosine: float
    sine: float
    peak_direction: Float32Array
    peak_power: Float32Array
    centre: Float32Array
    normal: Float32Array
    flux: Float32Array
    cones: Float32Array


class Places(NamedTuple):
    """The shading points: position (S, 3), frame (S, 3, 3), visibility bits (S, 1280) and patch_bits (S, ⌈L / 8⌉); slot
    (S,), the row of a glossy point in `StoredLight`, −1 for points that store irradiance alone; peaks (S,): bits of the
    brightest peaks, each tested with a ray of its own, −1 if none was."""

    position: Float32Array
    frame: Float32Array
    bits: Bytes
    patch_bits: Bytes
    slot: NDArray[np.int32]
    peaks: NDArray[np.int16]


class StoredLight(NamedTuple):
    """The light that points store: irradiance (S, 3); peak_bits (S, ⌈M / 8⌉), the visible peaks. By slot: number (G, n)
    and value (G, n, 3) of the coefficients, bfloat16, largest first; peak_place (G, 40), the upper triangles that
    contain peaks, −1 for none, and peak_power (G, 40, 3); irradiance_gradient (G, 2, 3): Σ power × x and Σ power × z
    over all light, in the point's frame."""

    irradiance: Float32Array
    peak_bits: Bytes
    number: NDArray[np.int16]
    value: NDArray[np.uint16]
    peak_place: NDArray[np.int16]
    peak_power: Float32Array
    irradiance_gradient: Float32Array


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def child_at(x: float, y: float, z: float, children: NDArray[np.int16]) -> int:
    """Look up `Hemisphere.children` for a direction above the surface."""
    # Octahedral projection of the upper hemisphere, rotated by 45° so that it fills the square.
    side = children.shape[0]
    scale = 0.5 * side / (abs(x) + y + abs(z))
    column = min(int((x + z) * scale + 0.5 * side), side - 1)
    row = min(int((x - z) * scale + 0.5 * side), side - 1)
    return int(children[max(row, 0), max(column, 0)])


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _look_up(
    sky: Float32Array, direction: Float32Array, frame: Float32Array, cosine: float, sine: float
) -> tuple[np.float32, np.float32, np.float32]:
    """Look up the radiance from a direction (3,) of a point's frame under the rotated sky."""
    # To world space, then into the environment's own frame: the rotation about +Y.
    tx, y, tz = to_world(frame, direction[0], direction[1], direction[2])
    x, z = np.float32(cosine * tx - sine * tz), np.float32(sine * tx + cosine * tz)
    # Octahedral map: project onto |x| + |y| + |z| = 1 and fold the lower half outwards.
    side = sky.shape[0]
    half = np.float32(0.5 * side)
    scale = half / (abs(x) + abs(y) + abs(z))
    fold = max(-y, np.float32(0.0)) * scale
    u, v = x * scale, z * scale
    u = u - fold if u < 0.0 else u + fold
    v = v - fold if v < 0.0 else v + fold
    column = min(max(int(u + half), 0), side - 1)
    row = min(max(int(v + half), 0), side - 1)
    return sky[row, column, 0], sky[row, column, 1], sky[row, column, 2]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def add_sky(p: int, at: Places, half: Hemisphere, light: Light, powers: Float32Array, moments: Float32Array) -> None:
    """Fill powers (5120, 3), radiance × visible solid angle of each triangle at point p, and add to moments (3, 3) the
    sums of power times x, y (which gives irradiance) and z."""
    powers[:] = 0.0
    for k in range(len(half.number)):
        # Four bits, one for each child; their mean is the triangle's visibility.
        seen = at.bits[p, k >> 1] >> (4 * (k & 1)) & 15
        if seen:
            # L · V of [Ma06, eq. 7], integrated over the triangle.
            red, green, blue = _look_up(light.sky, half.direction[k], at.frame[p], light.cosine, light.sine)
            part = np.float32(0.25 * ((seen & 1) + (seen >> 1 & 1) + (seen >> 2 & 1) + (seen >> 3)))
            share = half.solid_angle[k] * part
            m = half.number[k]
            powers[m, 0], powers[m, 1], powers[m, 2] = red * share, green * share, blue * share
            _add_moments(moments, red * share, green * share, blue * share, half.direction[k], half.cosine[k])


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def _add_moments(
    moments: Float32Array,
    red: np.float32,
    green: np.float32,
    blue: np.float32,
    direction: Float32Array,
    cosine: np.float32,
) -> None:
    """Add power times x, cosine and z to the rows of moments (3, 3)."""
    x, z = direction[0], direction[2]
    moments[0, 0] += red * x
    moments[0, 1] += green * x
    moments[0, 2] += blue * x
    moments[1, 0] += red * cosine
    moments[1, 1] += green * cosine
    moments[1, 2] += blue * cosine
    moments[2, 0] += red * z
    moments[2, 1] += green * z
    moments[2, 2] += blue * z


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _add_coarse_sky(
    p: int, coarse_bits: NDArray[np.uint64], at: Places, half: Hemisphere, light: Light, powers: Float32Array,
    moments: Float32Array,
) -> None:  # fmt: skip
    """As `add_sky`, by triangles of level 2: the first 320 powers become a sixteenth of each triangle's."""
    powers[:320] = 0.0
    for k in range(len(half.coarse_cosine)):
        seen = _count(coarse_bits[p, k])
        if seen:
            red, green, blue = _look_up(
                light.coarse_sky, half.coarse_direction[k], at.frame[p], light.cosine, light.sine
            )
            share = half.coarse_solid_angle[k] * np.float32(seen / 64.0)
            m, part = half.number[16 * k] >> 4, share / np.float32(16.0)
            powers[m, 0], powers[m, 1], powers[m, 2] = red * part, green * part, blue * part
            red, green, blue = red * share, green * share, blue * share
            _add_moments(moments, red, green, blue, half.coarse_direction[k], half.coarse_cosine[k])


@njit(cache=True, nogil=True, error_model="numpy")
def _count(word: np.uint64) -> int:
    """Number of bits that are set."""
    word = word - ((word >> np.uint64(1)) & np.uint64(0x5555555555555555))
    word = (word & np.uint64(0x3333333333333333)) + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
    word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int((word * np.uint64(0x0101010101010101)) >> np.uint64(56))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _nearest(places: NDArray[np.int16], directions: Float32Array, x: float, y: float, z: float) -> int:
    """Index of the place whose direction is closest to (x, y, z)."""
    best, found = -math.inf, 0
    for j in range(len(places)):
        d = directions[places[j]]
        along = x * d[0] + y * d[1] + z * d[2]
        if along > best:
            best, found = along, j
    return found


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def _add_peaks(p: int, at: Places, half: Hemisphere, light: Light, stored: StoredLight) -> None:
    """Find the peaks that point p sees: set their bits, add their irradiance and, for glossy points, store the
    triangles that contain them."""
    frame, slot, n_found = at.frame[p], at.slot[p], 0
    stored.peak_bits[p] = 0
    if slot >= 0:
        stored.peak_place[slot] = -1
    for s in range(len(light.peak_power)):
        # The peak in the point's frame: x, y (the cosine to the normal) and z.
        d = light.peak_direction[s]
        y = frame[1, 0] * d[0] + frame[1, 1] * d[1] + frame[1, 2] * d[2]
        if y <= 0.0:
            continue
        x = frame[0, 0] * d[0] + frame[0, 1] * d[1] + frame[0, 2] * d[2]
        z = frame[2, 0] * d[0] + frame[2, 1] * d[1] + frame[2, 2] * d[2]
        # Visibility: the bright peaks have rays of their own, the others use the bit of the triangle's child.
        child = child_at(x, y, z, half.children)
        k = child >> 2
        if at.peaks[p] >= 0 and s < N_QUERIED:
            if not at.peaks[p] >> s & 1:
                continue
        elif not at.bits[p, k >> 1] >> (4 * (k & 1) + (child & 3)) & 1:
            continue
        # Irradiance: power × cosine.
        stored.peak_bits[p, s >> 3] |= np.uint8(1 << (s & 7))
        for i in range(3):
            stored.irradiance[p, i] += light.peak_power[s, i] * y
        # Glossy points: first moments along x and z, and the power, merged into the triangle's entry; when all entries
        # are taken, into the one with the closest direction.
        if slot >= 0:
            for i in range(3):
                stored.irradiance_gradient[slot, 0, i] += light.peak_power[s, i] * x
                stored.irradiance_gradient[slot, 1, i] += light.peak_power[s, i] * z
            j = 0
            while j < n_found and stored.peak_place[slot, j] != k:
                j += 1
            if j == N_PEAK_PLACES:
                j = _nearest(stored.peak_place[slot], half.direction, x, y, z)
            elif j == n_found:
                stored.peak_place[slot, j], n_found = k, n_found + 1
                stored.peak_power[slot, j] = 0.0
            for i in range(3):
                stored.peak_power[slot, j, i] += light.peak_power[s, i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, inline="always")
def towards_patch(
    j: int, a: float, b: float, c: float, normal: Float32Array, cones: Float32Array
) -> tuple[float, float, float, np.float32]:
    """The unit direction of (a, b, c), from a place to one on patch j, of those with normal (L, 3) and cones (L, 4);
    and the solid angle per area times the share of the light that its cone sends here, 0 from behind."""
    facing = -(a * normal[j, 0] + b * normal[j, 1] + c * normal[j, 2])
    squared = a * a + b * b + c * c
    if not (facing > 0.0 and squared > 0.0):
        return 0.0, 0.0, 0.0, np.float32(0.0)
    # cos θ / r².
    distance = math.sqrt(squared)
    a, b, c = a / distance, b / distance, c / distance
    return a, b, c, np.float32(cone_share(cones, j, a, b, c) * facing / (squared * distance))


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def add_patches(
    p: int, at: Places, half: Hemisphere, light: Light, is_coarse: bool, powers: Float32Array, moments: Float32Array
) -> None:
    """Add the patches that point p sees. Each patch counts as a whole in the triangle that contains its centre's
    direction."""
    position, frame = at.position[p], at.frame[p]
    for j in range(len(light.centre)):
        if not at.patch_bits[p, j >> 3] >> (j & 7) & 1:
            continue
        a, b = light.centre[j, 0] - position[0], light.centre[j, 1] - position[1]
        c = light.centre[j, 2] - position[2]
        a, b, c, solid = towards_patch(j, a, b, c, light.normal, light.cones)
        x, y, z = to_local(frame, a, b, c)
        if solid > 0.0 and y > 0.0:
            m, part = half.number[child_at(x, y, z, half.children) >> 2], solid
            if is_coarse:
                m, part = m >> 4, solid * np.float32(1.0 / 16.0)
            for i in range(3):
                power = light.flux[j, i] * solid
                powers[m, i] += light.flux[j, i] * part
                moments[0, i] += power * np.float32(x)
                moments[1, i] += power * np.float32(y)
                moments[2, i] += power * np.float32(z)


@njit(cache=True, nogil=True, error_model="numpy")
def compress(
    powers: Float32Array, place: NDArray[np.int32], wavelets: Float32Array, sizes: Float32Array,
    number: NDArray[np.int16],
    value: NDArray[np.uint16],
) -> None:  # fmt: skip
    """Wavelet-transform powers (20·4^L, 3) and store the n largest coefficients by size, after the 20 means: number
    (n,), value (n, 3).

    The order is descending up to an eighth of an octave, so that the first few are always the best few. Entries after
    the last nonzero one are 0. place (5120,): negative for triangles without power. Overwrites powers, wavelets and
    sizes.
    """
    _transform(powers, place, wavelets, sizes)
    # Counting sort by the leading bits of the float: exponent and three bits of mantissa, so 8 bins an octave.
    n, bins = len(number), sizes.view(np.int32)
    starts = np.zeros(1 << 11, np.int32)
    for k in range(len(powers)):
        if sizes[k] > 0.0:
            starts[bins[k] >> 20] += 1
    # Turn counts into start positions, from the largest bin to the smallest.
    total = 0
    for i in range(len(starts) - 1, -1, -1):
        count = starts[i]
        starts[i] = total
        total += count
    filled = min(total, n)
    number[filled:], value[filled:] = 0, 0
    # Scatter the coefficients to their positions; round the values to bfloat16.
    for k in range(len(powers)):
        if sizes[k] > 0.0:
            at = starts[bins[k] >> 20]
            starts[bins[k] >> 20] = at + 1
            if at < n:
                number[at] = k
                words = wavelets[k].view(np.uint32)
                for i in range(3):
                    value[at, i] = (words[i] + np.uint32(0x8000)) >> np.uint32(16)


@njit(cache=True, nogil=True, error_model="numpy")
def _transform(means: Float32Array, place: NDArray[np.int32], wavelets: Float32Array, sizes: Float32Array) -> None:
    """Apply `engine.sphere.haar.forward` [Ma06, 3.1], and set each coefficient's size to its magnitude times its
    triangle's area.

    In place: parent t of a level reads its four children and leaves their mean in row t. Triangles below the surface
    are skipped; only those of the root level cross the horizon.
    """
    # Area of a parent triangle relative to the roots, where it is 1: 4^(−level) [Ma06, 3.1].
    parents, measure, below = len(means) // 4, np.float32(1.0), len(place) // (len(means) // 4)
    coarse = parents
    while coarse > N_ROOTS:
        coarse //= 4
        measure *= np.float32(0.25)
    while parents >= N_ROOTS:
        for t in range(parents):
            at = parents + 3 * t
            sizes[at] = sizes[at + 1] = sizes[at + 2] = 0.0
            # Parents below the surface hold no power.
            if parents > N_ROOTS and place[t * below] < 0:
                means[t] = 0.0
                continue
            # Scaling coefficient: the mean of four children. The three wavelets: sums with two signs + and two −.
            for i in range(3):
                a, b = np.float32(0.25) * means[4 * t, i], np.float32(0.25) * means[4 * t + 1, i]
                c, d = np.float32(0.25) * means[4 * t + 2, i], np.float32(0.25) * means[4 * t + 3, i]
                means[t, i] = a + b + c + d
                for w, difference in enumerate((a - b - c + d, b - a - c + d, c - a - b + d)):
                    wavelets[at + w, i] = difference
                    sizes[at + w] = max(sizes[at + w], measure * abs(difference))
        parents //= 4
        below *= 4
        measure *= np.float32(4.0)
    # The 20 means of the roots come first, whatever their size.
    for t in range(N_ROOTS):
        sizes[t] = 0.0
        for i in range(3):
            wavelets[t, i] = means[t, i]
            if means[t, i] > 0.0:
                sizes[t] = np.inf


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def light_range(
    start: int, stop: int, points: NDArray[np.int64], is_coarse: bool, at: Places, half: Hemisphere, light: Light,
    stored: StoredLight,
) -> None:  # fmt: skip
    """Light the points[start:stop], by triangles of level 4, or coarsely by those of level 2."""
    n = len(half.place)
    powers, wavelets, sizes = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32), np.empty(n, np.float32)
    coarse_bits = at.bits.view(np.uint64)
    moments = np.empty((3, 3), np.float32)
    for j in range(start, stop):
        p = points[j]
        # Sky and patches by triangle, with their first moments.
        moments[:] = 0.0
        if is_coarse:
            _add_coarse_sky(p, coarse_bits, at, half, light, powers, moments)
        else:
            add_sky(p, at, half, light, powers, moments)
        add_patches(p, at, half, light, is_coarse, powers, moments)
        for i in range(3):  # by channel: for whole rows the compiler generates error messages
            stored.irradiance[p, i] = moments[1, i]
            if at.slot[p] >= 0:
                stored.irradiance_gradient[at.slot[p], 0, i], stored.irradiance_gradient[at.slot[p], 1, i] = (
                    moments[0, i],
                    moments[2, i],
                )
        # Peaks add to irradiance but not to the coefficients; each is reflected in its own direction.
        _add_peaks(p, at, half, light, stored)
        if at.slot[p] >= 0:
            slot, size = at.slot[p], 320 if is_coarse else n
            compress(powers[:size], half.place, wavelets[:size], sizes[:size], stored.number[slot], stored.value[slot])


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def gather_bounces(ends: NDArray[np.int32], sent: Float32Array, found: Float32Array) -> None:
    """Fill found (G, 3) with the mean over each row of ends (G, R) of what the points there send (S, 3); −1 sends
    nothing."""
    for g in range(ends.shape[0]):
        red = green = blue = np.float32(0.0)
        for r in range(ends.shape[1]):
            p = ends[g, r]
            if p >= 0:
                red += sent[p, 0]
                green += sent[p, 1]
                blue += sent[p, 2]
        found[g, 0], found[g, 1], found[g, 2] = red / ends.shape[1], green / ends.shape[1], blue / ends.shape[1]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST)
def spread_bounces(beside: NDArray[np.int32], share: Float32Array, gathered: Float32Array, found: Float32Array) -> None:
    """Fill found (S, 3): interpolate gathered (G, 3) at beside (S, K) with weights share (S, K)."""
    found[:] = 0.0
    for p in range(beside.shape[0]):
        for k in range(beside.shape[1]):
            for i in range(3):
                found[p, i] += share[p, k] * gathered[beside[p, k], i]
