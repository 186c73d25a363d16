"""Compiled: finds and looks up irradiance cache records, and samples the light that falls on them."""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from engine.light._cone_kernels import cone_share
from engine.precompute.indirect._ray_kernels import hash64, uniform

NO_RECORD = 0xFFFF
MAX_RECORDS = 0xFFFE
NO_KEY = np.uint64(0)
CLOSED = -1
N_PLACES = 32
_GRID_BITS, _LEVEL_BITS, _SHEET_BITS, _PROBE_BITS = 16, 3, 3, 3
_PLACE_BITS = 20
# Per kind of ray (`_ray_kernels`: DIFFUSE, GLOSSY, SHARP, EVEN): a cell is smaller than the ray's length divided by
# this. A glossy surface shows what it reflects in focus; and where surfaces nearly touch, light varies within their
# distance.
_FOCUS = (np.float32(2.0), np.float32(8.0), np.float32(8.0), np.float32(0.0))
# Levels of cell size, from four times the grid's size on, each half of the one before.
_GRID = 2
_COARSEST, _FINEST = (_GRID, 0, 0, _GRID), (5, 3, 5, _GRID)
ZERO, ONE, HALF = np.float32(0.0), np.float32(1.0), np.float32(0.5)
# Visibility probes of a cube above a surface in it: above its centre, and offset towards its corners.
_VISIBILITY_PROBES = ((0, 0), (1, 1), (-1, 1), (1, -1), (-1, -1))
N_VISIBILITY_PROBES = len(_VISIBILITY_PROBES)
# As fractions of a cube's size: the probes' lateral offset; their least height, so that light passing under a door does
# not make the room behind it visible, and their greatest, since concave surfaces see one another from higher up; and
# the offset of a hit along its normal.
_ASIDE, _LOW, _HIGH, _LIFT = np.float32(0.3), np.float32(1 / 8), np.float32(1 / 4), np.float32(1 / 16)
# Parallel planes this far apart (as a fraction of the size) are distinct: the boards of a shelf are lit separately.
_SHEET = np.float32(1 / 4)


class MeshArrays(NamedTuple):
    """vertices, normals (V, 3); triangles, face_normals (T, 3); objects (T,) int32; smooth, reflects (M,) bool."""

    vertices: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    face_normals: np.ndarray
    objects: np.ndarray
    smooth: np.ndarray
    reflects: np.ndarray


class Hits(NamedTuple):
    """First hits of R rays: triangle (R,) int32, −1 for none, barycentric u, v (R,), distance (R,)."""

    triangle: np.ndarray
    u: np.ndarray
    v: np.ndarray
    distance: np.ndarray


class CacheTable(NamedTuple):
    """Records by key, with open addressing: keys (S,) uint64, 0 where free; cells (S,) int32, the record of each key.
    n_cells (1,): the number of records.

    Per record: objects (C,) int32, seeds (C,) uint64, n_places (C,) int64, and up to 32 sample positions: triangle (C,
    32) int32, u, v (C, 32), side (C, 32) bits: 1 the face normal is flipped, 2 the shading normal is flipped. The
    positions are the hits with the least hashes (C, 32), sorted by hash, so that a record depends neither on threads
    nor on the order of the rays.
    """

    keys: np.ndarray
    cells: np.ndarray
    n_cells: np.ndarray
    objects: np.ndarray
    seeds: np.ndarray
    n_places: np.ndarray
    hashes: np.ndarray
    triangle: np.ndarray
    u: np.ndarray
    v: np.ndarray
    side: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _position(mesh, triangle, u, v):
    """Position of a hit from its barycentric coordinates."""
    i, j, k = mesh.triangles[triangle, 0], mesh.triangles[triangle, 1], mesh.triangles[triangle, 2]
    w = ONE - u - v
    return (
        w * mesh.vertices[i, 0] + u * mesh.vertices[j, 0] + v * mesh.vertices[k, 0],
        w * mesh.vertices[i, 1] + u * mesh.vertices[j, 1] + v * mesh.vertices[k, 1],
        w * mesh.vertices[i, 2] + u * mesh.vertices[j, 2] + v * mesh.vertices[k, 2],
    )


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _shading_normal(mesh, triangle, u, v):
    """Interpolated where the object is smooth, else the face normal; not flipped towards the ray."""
    face = mesh.face_normals[triangle]
    if not mesh.smooth[mesh.objects[triangle]]:
        return face[0], face[1], face[2]
    i, j, k = mesh.triangles[triangle, 0], mesh.triangles[triangle, 1], mesh.triangles[triangle, 2]
    w = ONE - u - v
    x = w * mesh.normals[i, 0] + u * mesh.normals[j, 0] + v * mesh.normals[k, 0]
    y = w * mesh.normals[i, 1] + u * mesh.normals[j, 1] + v * mesh.normals[k, 1]
    z = w * mesh.normals[i, 2] + u * mesh.normals[j, 2] + v * mesh.normals[k, 2]
    length = np.sqrt(x * x + y * y + z * z)
    if length <= np.float32(1e-4):
        return face[0], face[1], face[2]
    return x / length, y / length, z / length


@nb.njit(cache=True, nogil=True, error_model="numpy")
def find_keys(mesh, low, inverse_size, hits, there, directions, mirrored, keys, sides, levels):
    """Writes the key (R,) of each ray's hit, 0 for none; which of its normals face away; and the level of its cube
    (R,).

    A key identifies one object in one cube of the grid (low (3,), 1 / size), in about one plane, facing one of six
    directions. Its lowest bits are reserved for the visible probe. Cubes depend on the ray's length and its kind,
    `mirrored` (R,): from four times the grid's size to half of it (GLOSSY) or an eighth (SHARP), from the same size to
    an eighth (DIFFUSE), or all alike (EVEN).
    """
    for r in range(keys.shape[0]):
        triangle = hits.triangle[r]
        keys[r] = NO_KEY
        if triangle < 0 or not there[r] or not mesh.reflects[mesh.objects[triangle]]:
            continue
        dx, dy, dz = directions[r, 0], directions[r, 1], directions[r, 2]
        face = mesh.face_normals[triangle]
        side = np.uint8(face[0] * dx + face[1] * dy + face[2] * dz > ZERO)
        nx, ny, nz = _shading_normal(mesh, triangle, hits.u[r], hits.v[r])
        # Flip the normal towards the visible side of the face.
        if (nx * face[0] + ny * face[1] + nz * face[2] > ZERO) == (side == 1):
            side |= np.uint8(2)
            nx, ny, nz = -nx, -ny, -nz
        # Which of the six axis directions the shading normal is closest to.
        axis = _main_axis(nx, ny, nz)
        facing = 2 * axis + (0 if (nx, ny, nz)[axis] > ZERO else 1)
        x, y, z = _position(mesh, triangle, hits.u[r], hits.v[r])
        # Halve the cube until it is small relative to the length of the ray.
        kind = mirrored[r]
        level = _COARSEST[kind]
        scale = _scale_of(inverse_size, level)
        while level < _FINEST[kind] and hits.distance[r] * scale < _FOCUS[kind]:
            level, scale = level + 1, np.float32(2.0) * scale
        # Index of the plane: the signed height of the cube's centre over the surface.
        i, j, k, mx, my, mz = _cube(low, scale, x, y, z)
        height = (face[0] * mx + face[1] * my + face[2] * mz) * scale
        sheet = np.int64(math.floor((-height if side & 1 else height) / _SHEET)) + (1 << _SHEET_BITS - 1)
        # Hash object, direction, level, plane and cube into one key.
        surface = (np.int64(mesh.objects[triangle]) * 6 + facing << _LEVEL_BITS | level) << _SHEET_BITS | sheet
        cube = (i << _GRID_BITS | j) << _GRID_BITS | k
        key = hash64(np.uint64(cube) ^ hash64(np.uint64(surface))) | np.uint64(1)
        keys[r] = key << np.uint64(_PROBE_BITS)
        sides[r], levels[r] = side, level


@nb.njit(cache=True, nogil=True, error_model="numpy")
def probe_rays(mesh, low, inverse_size, hits, which, sides, levels, probe, origins, directions):
    """Writes rays from the hits `which` (n,) to one of the probes of their cubes; a direction (n, 3) has the length of
    its ray.

    Two hits that see the same probe are not separated by a wall, however thin.
    """
    aside_a, aside_b = _VISIBILITY_PROBES[probe]
    for n in range(which.shape[0]):
        r = which[n]
        triangle, face, sign = hits.triangle[r], mesh.face_normals[hits.triangle[r]], -ONE if sides[r] & 1 else ONE
        gx, gy, gz = sign * face[0], sign * face[1], sign * face[2]
        # Centre of the cube relative to the hit, offset laterally in the two axes other than the main one.
        x, y, z = _position(mesh, triangle, hits.u[r], hits.v[r])
        scale = _scale_of(inverse_size, levels[r])
        size = ONE / scale
        _, _, _, mx, my, mz = _cube(low, scale, x, y, z)
        height = gx * mx + gy * my + gz * mz
        axis, a, b = _main_axis(gx, gy, gz), aside_a * _ASIDE * size, aside_b * _ASIDE * size
        mx, my, mz = (
            mx + (a if axis != 0 else ZERO), my + (b if axis == 2 else a if axis == 0 else ZERO),
            mz + (b if axis != 2 else ZERO),
        )  # fmt: skip
        # Move the probe along the normal, to a height within its limits.
        probe_height = min(max(height, _LOW * size), _HIGH * size)
        rise, lift = probe_height - (gx * mx + gy * my + gz * mz), _LIFT * size
        origins[n, 0], origins[n, 1], origins[n, 2] = x + lift * gx, y + lift * gy, z + lift * gz
        rise -= lift
        directions[n, 0], directions[n, 1], directions[n, 2] = mx + rise * gx, my + rise * gy, mz + rise * gz


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _main_axis(x, y, z):
    ax, ay, az = abs(x), abs(y), abs(z)
    return 0 if ax >= ay and ax >= az else 1 if ay >= az else 2


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _scale_of(inverse_size, level):
    """One over the size of the cubes of a level."""
    return inverse_size * (np.float32(1 << level) / np.float32(1 << _GRID))


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _cube(low, scale, x, y, z):
    """Indices of the cube that contains a position, and the vector from the position to its centre."""
    most = np.int64((1 << _GRID_BITS) - 1)
    i = min(max(np.int64((x - low[0]) * scale), 0), most)
    j = min(max(np.int64((y - low[1]) * scale), 0), most)
    k = min(max(np.int64((z - low[2]) * scale), 0), most)
    size = ONE / scale
    mx = low[0] + (np.float32(i) + HALF) * size - x
    my = low[1] + (np.float32(j) + HALF) * size - y
    mz = low[2] + (np.float32(k) + HALF) * size - z
    return i, j, k, mx, my, mz


@nb.njit(cache=True, nogil=True, error_model="numpy")
def insert_hits(table, mesh, hits, keys, sides, first_open, found):
    """Looks up keys (R,), adding records for new ones; writes their indices to found (R,) uint16. Returns False when
    the table is full.

    Records from `first_open` on may take a hit as a sample position. CLOSED: none does, and no record is added.
    """
    mask = np.uint64(table.keys.shape[0] - 1)
    most = table.objects.shape[0]
    for r in range(keys.shape[0]):
        key = keys[r]
        found[r] = NO_RECORD
        if key == NO_KEY:
            continue
        # Linear probing.
        hashed = hash64(key)
        slot = hashed & mask
        while table.keys[slot] != key and table.keys[slot] != NO_KEY:
            slot = (slot + np.uint64(1)) & mask
        # A new record; its seed is the hash of its key, whatever the order of insertion.
        if table.keys[slot] == NO_KEY:
            if first_open == CLOSED:
                continue
            if table.n_cells[0] == most:
                return False
            record = np.int32(table.n_cells[0])
            table.n_cells[0] += 1
            table.keys[slot], table.cells[slot] = key, record
            table.objects[record], table.seeds[record] = mesh.objects[hits.triangle[r]], hashed
        record = table.cells[slot]
        found[r] = record
        if first_open != CLOSED and record >= first_open:
            _insert_place(table, record, hits.triangle[r], hits.u[r], hits.v[r], sides[r])
    return True


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _insert_place(table, record, triangle, u, v, side):
    """Inserts a hit into a record's sample positions if its hash is among the least."""
    grid = np.float32(1 << _PLACE_BITS)
    number = np.uint64(max(u, ZERO) * grid) << np.uint64(_PLACE_BITS) | np.uint64(max(v, ZERO) * grid)
    hashed = np.uint32(hash64(number ^ np.uint64(triangle) << np.uint64(2 * _PLACE_BITS)) >> np.uint64(32))
    n = table.n_places[record]
    if n == N_PLACES and hashed >= table.hashes[record, N_PLACES - 1]:
        return
    # Insertion sort by hash; the largest drops out.
    place = min(n, N_PLACES - 1)
    while place > 0 and table.hashes[record, place - 1] > hashed:
        table.hashes[record, place] = table.hashes[record, place - 1]
        table.triangle[record, place] = table.triangle[record, place - 1]
        table.u[record, place], table.v[record, place] = table.u[record, place - 1], table.v[record, place - 1]
        table.side[record, place] = table.side[record, place - 1]
        place -= 1
    table.hashes[record, place], table.triangle[record, place] = hashed, triangle
    table.u[record, place], table.v[record, place], table.side[record, place] = u, v, side
    table.n_places[record] = min(n + 1, N_PLACES)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _place(table, mesh, record, k):
    """Position, face normal and shading normal of the k-th sample position of a record, flipped to the visible side."""
    p = k % table.n_places[record]
    triangle, u, v, side = table.triangle[record, p], table.u[record, p], table.v[record, p], table.side[record, p]
    x, y, z = _position(mesh, triangle, u, v)
    gx, gy, gz = mesh.face_normals[triangle, 0], mesh.face_normals[triangle, 1], mesh.face_normals[triangle, 2]
    nx, ny, nz = _shading_normal(mesh, triangle, u, v)
    if side & 1:
        gx, gy, gz = -gx, -gy, -gz
    if side & 2:
        nx, ny, nz = -nx, -ny, -nz
    return x, y, z, gx, gy, gz, nx, ny, nz


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _write_ray(origins, directions, out, x, y, z, gx, gy, gz, dx, dy, dz, offset):
    """Writes a ray from a position offset along the face normal, to the side it leaves on."""
    lift = offset if gx * dx + gy * dy + gz * dz >= ZERO else -offset
    origins[out, 0], origins[out, 1], origins[out, 2] = x + lift * gx, y + lift * gy, z + lift * gz
    directions[out, 0], directions[out, 1], directions[out, 2] = dx, dy, dz


@nb.njit(cache=True, nogil=True, error_model="numpy")
def record_rays(table, mesh, begin, end, offset, cosine_table, origins, directions, there):
    """Writes cosine-distributed rays from the sample positions of records [begin, end): (n · R, 3), from tables (64, R,
    3)."""
    n_rays = cosine_table.shape[1]
    for record in range(begin, end):
        # A random rotation about the normal and one of 64 patterns, per record.
        seed = hash64(table.seeds[record] + np.uint64(0x51ED2701))
        angle = np.float32(2.0 * math.pi) * uniform(seed)
        cosine, sine = np.cos(angle), np.sin(angle)
        pattern = np.int64(seed & np.uint64(cosine_table.shape[0] - 1))
        for m in range(n_rays):
            x, y, z, gx, gy, gz, nx, ny, nz = _place(table, mesh, record, m)
            tx, ty, tz = cosine_table[pattern, m, 0], cosine_table[pattern, m, 1], cosine_table[pattern, m, 2]
            lx, ly = cosine * tx - sine * ty, sine * tx + cosine * ty
            # An orthonormal frame about the normal [Duff17].
            sign = ONE if nz >= ZERO else -ONE
            a = -ONE / (sign + nz)
            b = nx * ny * a
            dx = lx * (ONE + sign * nx * nx * a) + ly * b + tz * nx
            dy = lx * sign * b + ly * (sign + ny * ny * a) + tz * ny
            dz = -lx * sign * nx - ly * ny + tz * nz
            out = (record - begin) * n_rays + m
            there[out] = True
            _write_ray(origins, directions, out, x, y, z, gx, gy, gz, dx, dy, dz, offset)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _pick(cumulative, u):
    """The first index whose cumulative share exceeds u."""
    low, high = 0, cumulative.shape[0] - 1
    while low < high:
        middle = (low + high) // 2
        if cumulative[middle] > u:
            high = middle
        else:
            low = middle + 1
    return low


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _point_in_triangle(corners, m, u, v):
    """A uniformly distributed point of triangle m of corners (M, 3, 3)."""
    if u + v > ONE:
        u, v = ONE - u, ONE - v
    w = ONE - u - v
    return (
        w * corners[m, 0, 0] + u * corners[m, 1, 0] + v * corners[m, 2, 0],
        w * corners[m, 0, 1] + u * corners[m, 1, 1] + v * corners[m, 2, 1],
        w * corners[m, 0, 2] + u * corners[m, 1, 2] + v * corners[m, 2, 2],
    )


class Lights(NamedTuple):
    """Triangle lights to sample by power: corners (M, 3, 3), directions or points; cumulative (M,) shares up to 1;
    power (M, 3), divided by the light's share, so that a sample is weighted already; normals (M, 3) and cones (M, 4)
    of emitters; is_sky."""

    corners: np.ndarray
    cumulative: np.ndarray
    power: np.ndarray
    normals: np.ndarray
    cones: np.ndarray
    is_sky: bool


@nb.njit(cache=True, nogil=True, error_model="numpy")
def light_rays(
    table, mesh, begin, end, offset, lights, n_samples, seed, origins, directions, distances, cosines, powers
):
    """Writes `n_samples` shadow rays from the sample positions of each record in [begin, end) to the lights, (n · S,
    3).

    distances (n · S,) to the light, large for the sky; cosines (n · S,) of the angles of incidence; powers (n · S, 3):
    the contribution to the record's irradiance if the ray is unoccluded, 0 where it need not be traced.
    """
    for record in range(begin, end):
        for s in range(n_samples):
            x, y, z, gx, gy, gz, nx, ny, nz = _place(table, mesh, record, s)
            # Stratified choice of a light by power, then a uniform point on it.
            number = hash64(table.seeds[record] + np.uint64(s) + np.uint64(seed) * np.uint64(0x9E3779B9))
            m = _pick(lights.cumulative, (np.float32(s) + uniform(number)) / np.float32(n_samples))
            u, v = uniform(number ^ np.uint64(1)), uniform(number ^ np.uint64(2))
            lx, ly, lz = _point_in_triangle(lights.corners, m, u, v)
            if not lights.is_sky:
                lx, ly, lz = lx - x, ly - y, lz - z
            length = np.sqrt(max(lx * lx + ly * ly + lz * lz, np.float32(1e-30)))
            dx, dy, dz = lx / length, ly / length, lz / length
            out = (record - begin) * n_samples + s
            cosines[out] = max(nx * dx + ny * dy + nz * dz, ZERO)
            # E = L cosθ / S for the sky; an emitter adds cosθ' / r² for its area.
            weight = cosines[out] / np.float32(n_samples)
            distances[out] = np.float32(1e30)
            if not lights.is_sky:
                facing = -(lights.normals[m, 0] * dx + lights.normals[m, 1] * dy + lights.normals[m, 2] * dz)
                weight *= max(facing, ZERO) / (length * length) * cone_share(lights.cones, m, dx, dy, dz)
                distances[out] = max(length * np.float32(0.9999), np.float32(1e-30))
            for channel in range(3):
                powers[out, channel] = weight * lights.power[m, channel]
            _write_ray(origins, directions, out, x, y, z, gx, gy, gz, dx, dy, dz, offset)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def add_unoccluded(blocked, cosines, powers, n_samples, irradiance):
    """irradiance (n, B, 3) += the powers (n · S, 3) of unoccluded samples, distributed by hat functions over the square
    root of their cosines (n · S,)."""
    last = irradiance.shape[1] - 1
    for i in range(irradiance.shape[0]):
        for s in range(n_samples):
            r = i * n_samples + s
            if not blocked[r]:
                position = np.sqrt(min(cosines[r], ONE)) * np.float32(last)
                node = min(np.int64(position), last - 1)
                share = position - np.float32(node)
                for channel in range(3):
                    irradiance[i, node, channel] += (ONE - share) * powers[r, channel]
                    irradiance[i, node + 1, channel] += share * powers[r, channel]
