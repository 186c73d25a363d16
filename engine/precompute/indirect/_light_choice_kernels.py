"""Compiled: chooses a light for a glossy surface where a path ends.

One light is chosen among eight candidates, half drawn by power and half about the axis of the surface's lobe, in
proportion to each one's contribution if the highlight had the density of the lobe (resampled importance sampling
[Talbot05]; the two halves are combined by the balance heuristic). None of this depends on a curve.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from engine.light._cone_kernels import cone_share
from engine.precompute.indirect._cache_kernels import _pick, _point_in_triangle, _shading_normal, _write_ray
from engine.precompute.indirect._ray_kernels import (
    ABOUT_AXIS,
    HORIZON,
    direction_pdf,
    hash64,
    object_tangent,
    sample_direction,
    to_local,
    to_world,
    uniform,
)
from engine.precompute.indirect._reflection_kernels import ONE, ZERO

N_BY_POWER, N_BY_LOBE = 4, 4
NO_LIGHT = 0xFFFF
TINY = np.float32(1e-30)


class SampledLights(NamedTuple):
    """All lights to sample: triangles of the sky first, then patches. corners (M, 3, 3); cumulative (M,) shares; power
    (M, 3) divided by the share; normals (M, 3) and cones (M, 4) of patches; for the sky, density (n_sky,) in samples
    per steradian and radiance (n_sky, 3); raster (H, W): the sky triangle of each lat-long direction; shares (G, M, 3)
    of the light that reach each group of objects, 0 to 1, and the groups of the objects."""

    corners: np.ndarray
    cumulative: np.ndarray
    power: np.ndarray
    normals: np.ndarray
    cones: np.ndarray
    density: np.ndarray
    radiance: np.ndarray
    raster: np.ndarray
    shares: np.ndarray
    groups: np.ndarray


# At n path vertices: normal (n, 3), turn, distance, light, candidate and weight (n,), see `GlossyHits`.
LitPlaces = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def ray_seed(row, nth, n_rays, m, vertex):
    """Random seed of a vertex of ray m in the nth sample set of a point."""
    ray = np.uint64(row) * np.uint64(0x10001) + np.uint64(m + n_rays * np.int64(nth))
    return hash64(ray + np.uint64(vertex) * np.uint64(0x55E68000000))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def towards_light(all_lights, m, u, v, px, py, pz):
    """Direction and distance from a position to the point of light m at random numbers u and v in [0, 1), and cosθ' /
    r² there, times the share that its cone sends; 1e30 and 1 for the sky."""
    x, y, z = _point_in_triangle(all_lights.corners, m, u, v)
    is_sky = m < all_lights.density.shape[0]
    if not is_sky:
        x, y, z = x - px, y - py, z - pz
    length = np.sqrt(max(x * x + y * y + z * z, TINY))
    x, y, z = x / length, y / length, z / length
    if is_sky:
        return x, y, z, np.float32(1e30), ONE
    facing = -(all_lights.normals[m, 0] * x + all_lights.normals[m, 1] * y + all_lights.normals[m, 2] * z)
    return x, y, z, length, max(facing, ZERO) / (length * length) * cone_share(all_lights.cones, m, x, y, z)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def sample_about_axis(table, seed, lobe_axis, ox, oy, oz):
    """Local direction of a ray about the lobe axis."""
    turn = np.float32(2.0 * math.pi) * uniform(seed ^ np.uint64(3))
    pattern = np.int64(seed % np.uint64(table.shape[0]))
    k = np.int64((seed >> np.uint64(20)) % np.uint64(table.shape[1]))
    return sample_direction(table[pattern], k, ABOUT_AXIS, np.cos(turn), np.sin(turn), lobe_axis, ox, oy, oz)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def sky_at(raster, x, y, z):
    """The sky triangle in a direction by its raster (H, W), −1 where there is no sky."""
    height, width = raster.shape
    if height == 0:
        return -1
    row = min(np.int64(math.acos(min(max(y, -ONE), ONE)) / math.pi * height), height - 1)
    column = np.int64((math.atan2(x, -z) / (2.0 * math.pi) + 0.5) * width) % width
    return np.int64(raster[row, column])


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _share(all_lights, m, geometry, lobe_density):
    """Weight of a candidate by the balance heuristic: a factor on radiance for the sky, on power for patches."""
    if m < all_lights.density.shape[0]:
        return ONE / (N_BY_POWER * all_lights.density[m] + N_BY_LOBE * lobe_density)
    return geometry / np.float32(N_BY_POWER)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def sample_candidate(all_lights, table, c, m, seed, lobe_axis, frame, place, wo):
    """Candidate c for light m (−1: to be chosen): light, local direction, distance, density about the lobe axis, and
    weight."""
    tx, ty, tz, nx, ny, nz = frame
    px, py, pz = place
    ox, oy, oz = wo
    own = hash64(seed + np.uint64(c) * np.uint64(0x632BE59BD9B4E019))
    far, geometry = np.float32(1e30), ONE
    # The first half draws a light by power, the second half a direction about the lobe axis.
    if c < N_BY_POWER:
        if m < 0:
            m = _pick(all_lights.cumulative, uniform(own ^ np.uint64(4)))
        u, v = uniform(own ^ np.uint64(5)), uniform(own ^ np.uint64(6))
        wx, wy, wz, far, geometry = towards_light(all_lights, m, u, v, px, py, pz)
        x, y, z = to_local(tx, ty, tz, nx, ny, nz, wx, wy, wz)
    else:
        x, y, z = sample_about_axis(table, own, lobe_axis, ox, oy, oz)
        if m < 0 and z > HORIZON:
            wx, wy, wz = to_world(tx, ty, tz, nx, ny, nz, x, y, z)
            m = sky_at(all_lights.raster, wx, wy, wz)
    # Below the horizon, or no light in this direction.
    if z <= HORIZON or m < 0:
        return -1, ZERO, ZERO, ONE, far, ZERO, ZERO
    density = direction_pdf(ZERO, ONE, lobe_axis, x, y, z, ox, oy, oz)
    return m, x, y, z, far, density, _share(all_lights, m, geometry, density)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def light_colour(all_lights, o, m, c):
    """What reaches object o of a light: radiance of one of the sky, power of another."""
    light = all_lights.radiance[m, c] if m < all_lights.density.shape[0] else all_lights.power[m, c]
    return light * all_lights.shares[all_lights.groups[o], m, c]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def choose_lights(which, at, vertex, n_rays, rows, nth, hits, turns, origins, directions, mesh, lobe_axes, axes,
                  all_lights, table, offset, normals, lights, candidates, weights, to_light, limits,
                  starts):  # fmt: skip
    """Chooses a light for each of the vertices where the rays (R,) numbered `at` (n,) end. vertex: 2 or 3; which (n,):
    the rays at the beginning of their paths, numbered by sample set within a chunk: the nth (q,) sets of the points
    `rows` (q,). turns (n,): codes of the tangents' maps.

    Writes normals (n, 3), the chosen light (n,), its candidate number and weight (n,), 0 for none; and of the shadow
    ray its direction to_light, its origin starts (n, 3) and its limit (n,).
    """
    nobody = np.int64(-1)  # a literal would have its own type, and `sample_candidate` would be compiled twice
    for i in range(at.shape[0]):
        r = at[i]
        triangle, o = hits.triangle[r], mesh.objects[hits.triangle[r]]
        dx, dy, dz = directions[r, 0], directions[r, 1], directions[r, 2]
        # Shading normal towards the incoming ray, position, local frame and local direction back along the ray.
        nx, ny, nz = _shading_normal(mesh, triangle, hits.u[r], hits.v[r])
        if nx * dx + ny * dy + nz * dz > ZERO:
            nx, ny, nz = -nx, -ny, -nz
        normals[i, 0], normals[i, 1], normals[i, 2] = nx, ny, nz
        far = hits.distance[r]
        px, py, pz = origins[r, 0] + far * dx, origins[r, 1] + far * dy, origins[r, 2] + far * dz
        sample_set, m = divmod(which[i], n_rays)
        seed = ray_seed(rows[sample_set], nth[sample_set], n_rays, m, vertex)
        tx, ty, tz = object_tangent(axes, o, turns[i], nx, ny, nz)
        ox, oy, oz = to_local(tx, ty, tz, nx, ny, nz, -dx, -dy, -dz)
        frame, place, wo = (tx, ty, tz, nx, ny, nz), (px, py, pz), (ox, oy, oz)
        total, chosen = ZERO, ZERO
        lights[i], candidates[i], weights[i], limits[i] = NO_LIGHT, 0, ZERO, ONE
        lx, ly, lz = ZERO, ZERO, ONE
        # Resampled importance sampling [Talbot05]: keep one candidate in proportion to its expected contribution, in
        # one pass (a reservoir); the weight is the sum over all, divided by the chosen one's.
        if all_lights.cumulative.shape[0] > 0 and oz > HORIZON:
            for c in range(N_BY_POWER + N_BY_LOBE):
                m, x, y, z, limit, density, share = sample_candidate(
                    all_lights, table, c, nobody, seed, lobe_axes[o], frame, place, wo
                )
                if m < 0:
                    continue
                red, green = light_colour(all_lights, o, m, 0), light_colour(all_lights, o, m, 1)
                worth = share * density * max(red, green, light_colour(all_lights, o, m, 2))
                total += worth
                if worth > ZERO and uniform(seed ^ np.uint64(1000 + c)) * total < worth:
                    lights[i], candidates[i], chosen = m, c, worth
                    lx, ly, lz, limits[i] = x, y, z, max(limit * np.float32(0.9999), TINY)
            if chosen > ZERO:
                weights[i] = total / chosen
        # The shadow ray.
        x, y, z = to_world(tx, ty, tz, nx, ny, nz, lx, ly, lz)
        face = mesh.face_normals[triangle]
        _write_ray(starts, to_light, i, px, py, pz, face[0], face[1], face[2], x, y, z, offset)
