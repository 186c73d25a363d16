"""Compiled: the directions of a gather point's rays, and how densely they lie.

A fan joins two sets: the first by the cosine, the second about the lobe_axis of the point's highlight, dense in the
middle as 1 / (1 - cos t + ε), so that every octave of the angle t gets its share and a band near the lobe_axis is not
starved, whichever curve will be edited. Both count with the density of the whole fan (the balance heuristic [Veach97,
sect. 9.2.2]). Directions come from tables of stratified patterns, each point's turned about the normal by an angle of
its own. Where a point has several fans, each goes on in the pattern where the one before it ended.
"""

import math

import numba as nb
import numpy as np

NORMAL, MIRROR, HALF = 0, 1, 2
# Which of the two sets a direction is of; as literals they would have `sample_direction` compiled for each.
BY_COSINE, ABOUT_AXIS = np.bool_(True), np.bool_(False)
EPSILON = 1.4e-3
_LOBE_DENSITY = np.float32(1.0 / (2.0 * math.pi * math.log1p(1.0 / EPSILON)))
_INVERSE_PI = np.float32(1.0 / math.pi)
_EPSILON = np.float32(EPSILON)
ONE, ZERO, TWO = np.float32(1.0), np.float32(0.0), np.float32(2.0)
HORIZON = np.float32(1e-4)
# How a ray is reflected: evenly, by a gloss, and in the middle of its highlight, where images may be sharp: where more
# than so much of the rays about the lobe_axis lie in a steradian. Head-on that is 12° to all sides of the mirrored eye.
# EVEN: not a gather point's.
DIFFUSE, GLOSSY, SHARP, EVEN = 0, 1, 2, 3
_SHARP_FROM = np.float32(1.0)
N_PATTERNS = 64


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def sample_direction(table, k, is_cosine, cosine, sine, lobe_axis, ox, oy, oz):
    """Local direction of entry k of a table (R, 3), turned by an angle; below the horizon where there is no ray."""
    tx, ty, z = table[k, 0], table[k, 1], table[k, 2]
    x, y = cosine * tx - sine * ty, sine * tx + cosine * ty
    if is_cosine or lobe_axis == NORMAL:
        return x, y, z
    if lobe_axis == HALF:
        along = TWO * (x * ox + y * oy + z * oz)
        if along <= ZERO:
            return ZERO, ZERO, -ONE
        return along * x - ox, along * y - oy, along * z - oz
    # About the mirrored eye m = (-ox, -oy, oz), in any frame: only the angle to m counts [Duff17].
    mx, my, mz = -ox, -oy, oz
    sign = ONE if mz >= ZERO else -ONE
    a = -ONE / (sign + mz)
    b = mx * my * a
    return (
        x * (ONE + sign * mx * mx * a) + y * b + z * mx,
        x * sign * b + y * (sign + my * my * a) + z * my,
        -x * sign * mx - y * my + z * mz,
    )


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def direction_pdf(n_cosine, n_lobe, lobe_axis, x, y, z, ox, oy, oz):
    """Rays a steradian of the whole fan at a local direction above the horizon."""
    density = n_cosine * z * _INVERSE_PI
    if n_lobe == ZERO:
        return density
    jacobian = ONE
    if lobe_axis == NORMAL:
        away = ONE - z
    elif lobe_axis == MIRROR:
        towards = oz * z - ox * x - oy * y
        if towards < ZERO:
            return density
        away = ONE - towards
    else:
        hx, hy, hz = x + ox, y + oy, z + oz
        length = np.sqrt(hx * hx + hy * hy + hz * hz)
        if length < HORIZON:
            return density
        # 1 - cos θ_h without cancelling, and dω_i = 4 cos θ_d dω_h with cos θ_d = |i + o| / 2.
        flat = hx * hx + hy * hy
        away = flat / (length * (length + hz))
        jacobian = ONE / (TWO * length)
    return density + n_lobe * jacobian * _LOBE_DENSITY / (max(away, ZERO) + _EPSILON)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def hash64(seed):
    """A uint64 that depends on every bit of the seed (SplitMix64 [Steele14])."""
    z = seed + np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def uniform(seed):
    """A number in [0, 1) from a seed."""
    return np.float32(hash64(seed) >> np.uint64(40)) * np.float32(1.0 / 16777216.0)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def pattern_rotation(row):
    """Pattern seed and turning angle's cosine and sine of the gather point at a row of the hits."""
    seed = hash64(np.uint64(row))
    angle = np.float32(2.0 * math.pi) * uniform(seed)
    return seed, np.cos(angle), np.sin(angle)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def pattern_of(seed, nth):
    """Where the tables have the pattern of a point, by its seed, for the nth of its fans."""
    return np.int64(seed & np.uint64(N_PATTERNS - 1)) + N_PATTERNS * np.int64(nth)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def local_wo(tangent, normal, wo):
    """(ox, oy, oz) in the frame of tangent, bitangent, normal."""
    bx = normal[1] * tangent[2] - normal[2] * tangent[1]
    by = normal[2] * tangent[0] - normal[0] * tangent[2]
    bz = normal[0] * tangent[1] - normal[1] * tangent[0]
    return (
        tangent[0] * wo[0] + tangent[1] * wo[1] + tangent[2] * wo[2],
        bx * wo[0] + by * wo[1] + bz * wo[2],
        normal[0] * wo[0] + normal[1] * wo[1] + normal[2] * wo[2],
    )


@nb.njit(cache=True, nogil=True, error_model="numpy")
def write_sample_rays(
    rows, nth, lobe_axes, surface, geometric, horizon, offset, tables_cosine, tables_lobe, begin, end, origins,
    directions,
    there,
):  # fmt: skip
    """Rays [begin, end) of the nth (q,) fans of the points `rows` (q,) into origins and directions
    (q · (end - begin), 3).

    lobe_axes (q,); surface: the hits' position, tangent, normal, wo; geometric and horizon (P, 3) normals; offset: how
    far an origin is lifted, to the side the ray leaves on; there (q · (end - begin),) becomes False where a fan has no
    ray.
    """
    n_cosine = tables_cosine.shape[1]
    for i in range(rows.shape[0]):
        r = rows[i]
        tangent, normal, position, g = surface.tangent[r], surface.normal[r], surface.position[r], geometric[r]
        ox, oy, oz = local_wo(tangent, normal, surface.wo[r])
        seed, cosine, sine = pattern_rotation(r)
        pattern = pattern_of(seed, nth[i])
        for m in range(begin, end):
            out = i * (end - begin) + m - begin
            is_cosine = m < n_cosine
            table = tables_cosine[pattern] if is_cosine else tables_lobe[pattern]
            k = m if is_cosine else m - n_cosine
            x, y, z = sample_direction(table, k, is_cosine, cosine, sine, lobe_axes[i], ox, oy, oz)
            there[out] = z > HORIZON
            if z <= HORIZON:
                x, y, z = ZERO, ZERO, ONE
            side, height = ZERO, ZERO
            for axis in range(3):
                a, b = (axis + 1) % 3, (axis + 2) % 3
                bitangent = normal[a] * tangent[b] - normal[b] * tangent[a]
                directions[out, axis] = x * tangent[axis] + y * bitangent + z * normal[axis]
                side += directions[out, axis] * g[axis]
                height += directions[out, axis] * horizon[r, axis]
            there[out] = there[out] and height > ZERO
            lift = offset if side >= ZERO else -offset
            for axis in range(3):
                origins[out, axis] = position[axis] + lift * g[axis]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def mark_glossy_rays(rows, lobe_axes, surface, directions, mirrored):
    """MATT, GLOSSY or SHARP (p · R,) of rays along unit directions (p · R, 3) from points `rows` with lobe_axes
    (p,)."""
    n_rays = directions.shape[0] // max(rows.shape[0], 1)
    for i in range(rows.shape[0]):
        tangent, normal = surface.tangent[rows[i]], surface.normal[rows[i]]
        ox, oy, oz = local_wo(tangent, normal, surface.wo[rows[i]])
        for m in range(i * n_rays, (i + 1) * n_rays):
            mirrored[m] = DIFFUSE
            if lobe_axes[i] != NORMAL:
                x, y, z = local_wo(tangent, normal, directions[m])
                is_sharp = direction_pdf(ZERO, ONE, lobe_axes[i], x, y, z, ox, oy, oz) > _SHARP_FROM
                mirrored[m] = SHARP if is_sharp else GLOSSY
