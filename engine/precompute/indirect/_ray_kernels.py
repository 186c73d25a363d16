"""Compiled: directions of hemisphere samples, their density, and local frames.

A sample set combines two distributions: one by the cosine, the other about the axis of the point's lobe with density 1
/ (1 - cos t + ε). Each octave of the angle t from the axis then gets the same share, so that no band near the axis is
undersampled, whichever curve will be edited. Both are weighted by the density of the whole set (the balance heuristic
[Veach97, sect. 9.2.2]). Directions come from tables of stratified patterns, which each point rotates about its normal
by its own angle. Further sample sets of a point continue the pattern where the previous one ended.
"""

import math

import numba as nb
import numpy as np

NORMAL, MIRROR, HALF = 0, 1, 2
# Which of the two distributions a direction belongs to; as literals they would compile `sample_direction` once for
# each.
BY_COSINE, ABOUT_AXIS = np.bool_(True), np.bool_(False)
EPSILON = 1.4e-3
_LOBE_DENSITY = np.float32(1.0 / (2.0 * math.pi * math.log1p(1.0 / EPSILON)))
_INVERSE_PI = np.float32(1.0 / math.pi)
_EPSILON = np.float32(EPSILON)
ONE, ZERO, TWO = np.float32(1.0), np.float32(0.0), np.float32(2.0)
HORIZON = np.float32(1e-4)
_TINY = np.float32(1e-30)
_HALF_TURN_OF_CODE = np.float32(math.pi / 256)  # `engine.scene.tangents.N_CODES`
# How a ray is reflected: diffusely, by a lobe, or near the lobe's axis, where reflected images may be sharp: more than
# `_SHARP_FROM` of the rays about the axis lie in a steradian there. At normal incidence that is within 12° of the
# mirror direction. EVEN: not a ray of a gather point.
DIFFUSE, GLOSSY, SHARP, EVEN = 0, 1, 2, 3
_SHARP_FROM = np.float32(1.0)
N_PATTERNS = 64


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def sample_direction(table, k, is_cosine, cosine, sine, lobe_axis, ox, oy, oz):
    """Local direction of entry k of a table (R, 3), rotated about the normal; below the horizon where no ray exists."""
    tx, ty, z = table[k, 0], table[k, 1], table[k, 2]
    x, y = cosine * tx - sine * ty, sine * tx + cosine * ty
    if is_cosine or lobe_axis == NORMAL:
        return x, y, z
    # A half vector from the table: reflect the direction to the camera about it.
    if lobe_axis == HALF:
        along = TWO * (x * ox + y * oy + z * oz)
        if along <= ZERO:
            return ZERO, ZERO, -ONE
        return along * x - ox, along * y - oy, along * z - oz
    # About the mirror direction m = (-ox, -oy, oz), in any frame: only the angle to m matters [Duff17].
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
    """The density of the whole sample set, in rays per steradian, at a local direction above the horizon."""
    density = n_cosine * z * _INVERSE_PI
    if n_lobe == ZERO:
        return density
    # The lobe's density is 1 / (2π ln(1 + 1/ε) (1 - cos t + ε)) with t the angle to its axis.
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
        # 1 - cos θ_h without cancellation, and dω_i = 4 cos θ_d dω_h with cos θ_d = |i + o| / 2.
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
    """A uniform number in [0, 1) from a seed."""
    return np.float32(hash64(seed) >> np.uint64(40)) * np.float32(1.0 / 16777216.0)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def pattern_rotation(row):
    """The pattern's seed, and the cosine and sine of its rotation, for the gather point at a row of the hits."""
    seed = hash64(np.uint64(row))
    angle = np.float32(2.0 * math.pi) * uniform(seed)
    return seed, np.cos(angle), np.sin(angle)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def pattern_of(seed, nth):
    """The index in the tables of a point's pattern, by its seed, for its nth sample set."""
    return np.int64(seed & np.uint64(N_PATTERNS - 1)) + N_PATTERNS * np.int64(nth)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def object_tangent(axes, o, code, nx, ny, nz):
    """Unit vector Y × n with the object's Y, or its X made perpendicular to n where Y is parallel to n; rotated about n
    by the object's angle and by the code of its map, see `engine.scene.tangents`."""
    yx, yy, yz = axes[o, 0, 0], axes[o, 0, 1], axes[o, 0, 2]
    tx, ty, tz = yy * nz - yz * ny, yz * nx - yx * nz, yx * ny - yy * nx
    length2 = tx * tx + ty * ty + tz * tz
    if length2 < np.float32(1e-8):
        along = axes[o, 1, 0] * nx + axes[o, 1, 1] * ny + axes[o, 1, 2] * nz
        tx, ty, tz = axes[o, 1, 0] - along * nx, axes[o, 1, 1] - along * ny, axes[o, 1, 2] - along * nz
        length2 = tx * tx + ty * ty + tz * tz
    inverse = ONE / np.sqrt(max(length2, _TINY))
    tx, ty, tz = tx * inverse, ty * inverse, tz * inverse
    cosine, sine = axes[o, 2, 0], axes[o, 2, 1]
    if code != 0:
        angle = np.float32(code) * _HALF_TURN_OF_CODE
        along, across = np.cos(angle), np.sin(angle)
        cosine, sine = cosine * along - sine * across, sine * along + cosine * across
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    return cosine * tx + sine * bx, cosine * ty + sine * by, cosine * tz + sine * bz


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def to_local(tx, ty, tz, nx, ny, nz, x, y, z):
    """World to local coordinates, in the frame of tangent, bitangent n × t, and normal."""
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    return tx * x + ty * y + tz * z, bx * x + by * y + bz * z, nx * x + ny * y + nz * z


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def to_world(tx, ty, tz, nx, ny, nz, x, y, z):
    """Local to world coordinates."""
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    return x * tx + y * bx + z * nx, x * ty + y * by + z * ny, x * tz + y * bz + z * nz


@nb.njit(cache=True, nogil=True, error_model="numpy")
def local_wo(tangent, normal, wo):
    """(ox, oy, oz) in the frame of tangent, bitangent, normal."""
    return to_local(tangent[0], tangent[1], tangent[2], normal[0], normal[1], normal[2], wo[0], wo[1], wo[2])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def write_sample_rays(
    rows, nth, lobe_axes, surface, geometric, horizon, offset, tables_cosine, tables_lobe, begin, end, origins,
    directions,
    there,
):  # fmt: skip
    """Writes rays [begin, end) of the nth (q,) sample sets of the points `rows` (q,) to origins and directions (q ·
    (end - begin), 3).

    lobe_axes (q,); surface: position, tangent, normal, wo of the hits; geometric and horizon (P, 3) normals; offset:
    the distance by which an origin is moved along the normal, to the side the ray leaves on; there (q · (end - begin),)
    is False where a sample set has no ray.
    """
    n_cosine = tables_cosine.shape[1]
    for i in range(rows.shape[0]):
        r = rows[i]
        tangent, normal, position, g = surface.tangent[r], surface.normal[r], surface.position[r], geometric[r]
        # Direction to the camera in the local frame; the point's own pattern and rotation.
        ox, oy, oz = local_wo(tangent, normal, surface.wo[r])
        seed, cosine, sine = pattern_rotation(r)
        pattern = pattern_of(seed, nth[i])
        for m in range(begin, end):
            # Direction m of the set, from the table of its distribution.
            out = i * (end - begin) + m - begin
            is_cosine = m < n_cosine
            table = tables_cosine[pattern] if is_cosine else tables_lobe[pattern]
            k = m if is_cosine else m - n_cosine
            x, y, z = sample_direction(table, k, is_cosine, cosine, sine, lobe_axes[i], ox, oy, oz)
            there[out] = z > HORIZON
            if z <= HORIZON:
                x, y, z = ZERO, ZERO, ONE
            # To world space; the ray must also leave above the horizon of the true surface.
            side, height = ZERO, ZERO
            for axis in range(3):
                a, b = (axis + 1) % 3, (axis + 2) % 3
                bitangent = normal[a] * tangent[b] - normal[b] * tangent[a]
                directions[out, axis] = x * tangent[axis] + y * bitangent + z * normal[axis]
                side += directions[out, axis] * g[axis]
                height += directions[out, axis] * horizon[r, axis]
            there[out] = there[out] and height > ZERO
            # Offset the origin to the side on which the ray leaves.
            lift = offset if side >= ZERO else -offset
            for axis in range(3):
                origins[out, axis] = position[axis] + lift * g[axis]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def mark_glossy_rays(rows, lobe_axes, surface, directions, mirrored):
    """Writes DIFFUSE, GLOSSY or SHARP (p · R,) for rays along unit directions (p · R, 3) from points `rows` with
    lobe_axes (p,)."""
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
