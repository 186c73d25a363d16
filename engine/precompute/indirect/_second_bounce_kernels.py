"""Compiled: what glossy surfaces send on towards gather points.

Where a ray of a fan ends on a glossy surface, two further rays are remembered. One goes to a light that is chosen among
eight candidates, half drawn by power and half about the lobe_axis of that surface's highlight, in proportion to what
each would bring if the highlight were as the lobe_axis's density is (resampled importance sampling [Talbot05]; the
halves count by the balance heuristic). The other goes about the lobe_axis, for what other surfaces send; where it ends
on a glossy one in turn, a light is chosen there too. All hold for any curve.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from engine.material._kernels import gamma, quotient_cosine
from engine.precompute.indirect._cache_kernels import NO_RECORD, _point_in_triangle, _shading_normal
from engine.precompute.indirect._ray_kernels import (
    ABOUT_AXIS,
    HORIZON,
    direction_pdf,
    hash64,
    local_wo,
    pattern_of,
    pattern_rotation,
    sample_direction,
    uniform,
)
from engine.precompute.indirect._reflection_kernels import HALF_PI, ONE, ZERO, _is_in_half, _node, _ray

N_BY_POWER, N_BY_LOBE = 4, 4
NO_LIGHT = 0xFFFF
# Photons' errors are alike at neighbours, which looks calmer than those of rays, so that they have the say of several.
PHOTON_WEIGHT = np.float32(8.0)
PI = np.float32(math.pi)
TINY = np.float32(1e-30)


class SampledLights(NamedTuple):
    """All lights to sample: the sky's triangles first, then patches. corners (M, 3, 3); cumulative (M,) shares;
    power (M, 3) over share; normals (M, 3) of patches; of the sky density (n_sky,) samples a steradian and radiance
    (n_sky, 3); raster (H, W): which triangle of the sky a lat-long direction falls in."""

    corners: np.ndarray
    cumulative: np.ndarray
    power: np.ndarray
    normals: np.ndarray
    density: np.ndarray
    radiance: np.ndarray
    raster: np.ndarray


class GlossyLayers(NamedTuple):
    """The glossy layers of all objects: those of object o are first[o] to first[o + 1]. models, kinds_a, kinds_b (L,),
    q (L, 8); their curves' values joined (V, 3), the first from begin_a (L,), n_a (L,) long, the second likewise;
    gains (L, 3); views (L, N, 3), f_o at even angles. lobe_axes (M,), axes (M, 2, 3): each object's Y and X. image
    (L,): which of texels (K, C, 3), factors at the cells over those in the gains, a layer has; −1 for none."""

    first: np.ndarray
    models: np.ndarray
    kinds_a: np.ndarray
    kinds_b: np.ndarray
    q: np.ndarray
    values: np.ndarray
    begin_a: np.ndarray
    n_a: np.ndarray
    begin_b: np.ndarray
    n_b: np.ndarray
    gains: np.ndarray
    views: np.ndarray
    lobe_axes: np.ndarray
    axes: np.ndarray
    image: np.ndarray
    texels: np.ndarray


# Of places n (n,) that paths come to: normal (n, 3), distance, light, candidate, weight, see `GlossyHits`.
LitPlaces = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]


class GlossyHits(NamedTuple):
    """n rays that end on glossy surfaces, by point and ray: start (p + 1,) of each point's, and how many rays (p,) each
    of them stands for; ray (n,); normal (n, 3) and
    distance (n,) there; light (n,) that is seen, NO_LIGHT where none is, which candidate it was (n,) and how many times
    it counts (n,); beyond (n,): the cell that the second ray sees, or NO_CELL. The same with _3 of the place that this
    ray comes to, where that is glossy: a third vertex."""

    start: np.ndarray
    times: np.ndarray
    ray: np.ndarray
    normal: np.ndarray
    distance: np.ndarray
    light: np.ndarray
    candidate: np.ndarray
    weight: np.ndarray
    beyond: np.ndarray
    normal_3: np.ndarray
    distance_3: np.ndarray
    light_3: np.ndarray
    candidate_3: np.ndarray
    weight_3: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _seed(row, nth, n_rays, m, vertex):
    """Of a vertex of ray m of the nth fan of a point."""
    ray = np.uint64(row) * np.uint64(0x10001) + np.uint64(m + n_rays * np.int64(nth))
    return hash64(ray + np.uint64(vertex) * np.uint64(0x55E68000000))


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _tangent(axes, o, nx, ny, nz):
    """Unit Y × n with the object's Y, or its X made perpendicular to n where Y is along it."""
    yx, yy, yz = axes[o, 0, 0], axes[o, 0, 1], axes[o, 0, 2]
    tx, ty, tz = yy * nz - yz * ny, yz * nx - yx * nz, yx * ny - yy * nx
    length2 = tx * tx + ty * ty + tz * tz
    if length2 < np.float32(1e-8):
        along = axes[o, 1, 0] * nx + axes[o, 1, 1] * ny + axes[o, 1, 2] * nz
        tx, ty, tz = axes[o, 1, 0] - along * nx, axes[o, 1, 1] - along * ny, axes[o, 1, 2] - along * nz
        length2 = tx * tx + ty * ty + tz * tz
    inverse = ONE / np.sqrt(max(length2, TINY))
    return tx * inverse, ty * inverse, tz * inverse


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _to_local(tx, ty, tz, nx, ny, nz, x, y, z):
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    return tx * x + ty * y + tz * z, bx * x + by * y + bz * z, nx * x + ny * y + nz * z


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _to_world(tx, ty, tz, nx, ny, nz, x, y, z):
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    return x * tx + y * bx + z * nx, x * ty + y * by + z * ny, x * tz + y * bz + z * nz


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _towards_light(lamps, m, seed, px, py, pz):
    """Direction and distance from a place to a point of light m, and cos over distance² there; 1 for the sky."""
    x, y, z = _point_in_triangle(lamps.corners, m, uniform(seed ^ np.uint64(5)), uniform(seed ^ np.uint64(6)))
    is_sky = m < lamps.density.shape[0]
    if not is_sky:
        x, y, z = x - px, y - py, z - pz
    length = np.sqrt(max(x * x + y * y + z * z, TINY))
    x, y, z = x / length, y / length, z / length
    if is_sky:
        return x, y, z, np.float32(1e30), ONE
    facing = -(lamps.normals[m, 0] * x + lamps.normals[m, 1] * y + lamps.normals[m, 2] * z)
    return x, y, z, length, max(facing, ZERO) / (length * length)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _sample_about_axis(table, seed, lobe_axis, ox, oy, oz):
    """Local direction of a ray about the lobe_axis."""
    turn = np.float32(2.0 * math.pi) * uniform(seed ^ np.uint64(3))
    pattern = np.int64(seed % np.uint64(table.shape[0]))
    k = np.int64((seed >> np.uint64(20)) % np.uint64(table.shape[1]))
    return sample_direction(table[pattern], k, ABOUT_AXIS, np.cos(turn), np.sin(turn), lobe_axis, ox, oy, oz)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _pick_light(lamps, u):
    low, high = 0, lamps.cumulative.shape[0] - 1
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if lamps.cumulative[middle] > u else (middle + 1, high)
    return low


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _sky_at(lamps, x, y, z):
    """The triangle of the sky in a direction, −1 where there is no sky."""
    height, width = lamps.raster.shape
    if height == 0:
        return -1
    row = min(np.int64(math.acos(min(max(y, -ONE), ONE)) / math.pi * height), height - 1)
    column = np.int64((math.atan2(x, -z) / (2.0 * math.pi) + 0.5) * width) % width
    return np.int64(lamps.raster[row, column])


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _share(lamps, m, geometry, lobe_density):
    """What a candidate's light counts as one of all: (factor on radiance for the sky, on power for patches)."""
    if m < lamps.density.shape[0]:
        return ONE / (N_BY_POWER * lamps.density[m] + N_BY_LOBE * lobe_density)
    return geometry / np.float32(N_BY_POWER)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _brightest(lamps, m):
    light = lamps.radiance[m] if m < lamps.density.shape[0] else lamps.power[m]
    return max(light[0], light[1], light[2])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _candidate(lamps, table, c, m, seed, lobe_axis, frame, place, eye):
    """Candidate c for the light m (−1: yet to be found): light, local direction, distance and share of it."""
    tx, ty, tz, nx, ny, nz = frame
    px, py, pz = place
    ox, oy, oz = eye
    own = hash64(seed + np.uint64(c) * np.uint64(0x632BE59BD9B4E019))
    far, geometry = np.float32(1e30), ONE
    if c < N_BY_POWER:
        if m < 0:
            m = _pick_light(lamps, uniform(own ^ np.uint64(4)))
        wx, wy, wz, far, geometry = _towards_light(lamps, m, own, px, py, pz)
        x, y, z = _to_local(tx, ty, tz, nx, ny, nz, wx, wy, wz)
    else:
        x, y, z = _sample_about_axis(table, own, lobe_axis, ox, oy, oz)
        if m < 0 and z > HORIZON:
            wx, wy, wz = _to_world(tx, ty, tz, nx, ny, nz, x, y, z)
            m = _sky_at(lamps, wx, wy, wz)
    if z <= HORIZON or m < 0:
        return -1, ZERO, ZERO, ONE, far, ZERO, ZERO
    density = direction_pdf(ZERO, ONE, lobe_axis, x, y, z, ox, oy, oz)
    return m, x, y, z, far, density, _share(lamps, m, geometry, density)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def choose_lights(which, at, vertex, n_rays, rows, nth, hits, origins, directions, mesh, lobe_axes, axes, lamps, table,
                  offset, normals, lights, candidates, weights, to_light, limits, starts):  # fmt: skip
    """A light for each of the places that rays (R,) numbered `at` (n,) end at: the vertex, 2 or 3, that the paths come
    to which begin with the rays `which` (n,) of a chunk of fans, numbered fan by fan: the nth (q,) of the points `rows`
    (q,).

    Writes normals (n, 3), the light chosen (n,), which candidate it was and its weight (n,), 0 for none; of a ray to it
    the direction to_light, its origin starts (n, 3) and its limit (n,).
    """
    nobody = np.int64(-1)  # a literal would be a type of its own, and have `_candidate` compiled twice
    for i in range(at.shape[0]):
        r = at[i]
        triangle, o = hits.triangle[r], mesh.objects[hits.triangle[r]]
        dx, dy, dz = directions[r, 0], directions[r, 1], directions[r, 2]
        nx, ny, nz = _shading_normal(mesh, triangle, hits.u[r], hits.v[r])
        if nx * dx + ny * dy + nz * dz > ZERO:
            nx, ny, nz = -nx, -ny, -nz
        normals[i, 0], normals[i, 1], normals[i, 2] = nx, ny, nz
        far = hits.distance[r]
        px, py, pz = origins[r, 0] + far * dx, origins[r, 1] + far * dy, origins[r, 2] + far * dz
        sample_set, m = divmod(which[i], n_rays)
        seed = _seed(rows[sample_set], nth[sample_set], n_rays, m, vertex)
        tx, ty, tz = _tangent(axes, o, nx, ny, nz)
        ox, oy, oz = _to_local(tx, ty, tz, nx, ny, nz, -dx, -dy, -dz)
        frame, place, eye = (tx, ty, tz, nx, ny, nz), (px, py, pz), (ox, oy, oz)
        total, chosen = ZERO, ZERO
        lights[i], candidates[i], weights[i], limits[i] = NO_LIGHT, 0, ZERO, ONE
        lx, ly, lz = ZERO, ZERO, ONE
        if lamps.cumulative.shape[0] > 0 and oz > HORIZON:
            for c in range(N_BY_POWER + N_BY_LOBE):
                m, x, y, z, limit, density, share = _candidate(
                    lamps, table, c, nobody, seed, lobe_axes[o], frame, place, eye
                )
                if m < 0:
                    continue
                worth = share * density * _brightest(lamps, m)
                total += worth
                if worth > ZERO and uniform(seed ^ np.uint64(1000 + c)) * total < worth:
                    lights[i], candidates[i], chosen = m, c, worth
                    lx, ly, lz, limits[i] = x, y, z, max(limit * np.float32(0.9999), TINY)
            if chosen > ZERO:
                weights[i] = total / chosen
        x, y, z = _to_world(tx, ty, tz, nx, ny, nz, lx, ly, lz)
        to_light[i, 0], to_light[i, 1], to_light[i, 2] = x, y, z
        _lifted(mesh.face_normals[triangle], px, py, pz, x, y, z, offset, starts[i])


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _lifted(face, px, py, pz, x, y, z, offset, start):
    """A place off its surface, to the side that a ray along (x, y, z) leaves to, into start (3,)."""
    lift = offset if face[0] * x + face[1] * y + face[2] * z >= ZERO else -offset
    start[0], start[1], start[2] = px + lift * face[0], py + lift * face[1], pz + lift * face[2]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def sample_lobe_rays(which, n_rays, rows, nth, hits, origins, directions, normals, mesh, lobe_axes, axes, table, offset,
                    to_lobe, starts, there):  # fmt: skip
    """From where the rays `which` (n,) of a chunk of fans end, with these normals (n, 3), rays about the lobe_axes:
    their directions to_lobe and origins starts (n, 3), and which of them are there (n,)."""
    for i in range(which.shape[0]):
        w = which[i]
        triangle, o = hits.triangle[w], mesh.objects[hits.triangle[w]]
        dx, dy, dz = directions[w, 0], directions[w, 1], directions[w, 2]
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        tx, ty, tz = _tangent(axes, o, nx, ny, nz)
        ox, oy, oz = _to_local(tx, ty, tz, nx, ny, nz, -dx, -dy, -dz)
        sample_set, m = divmod(w, n_rays)
        x, y, z = _sample_about_axis(
            table, _seed(rows[sample_set], nth[sample_set], n_rays, m, 2), lobe_axes[o], ox, oy, oz
        )
        there[i] = z > HORIZON
        if not there[i]:
            x, y, z = ZERO, ZERO, ONE
        x, y, z = _to_world(tx, ty, tz, nx, ny, nz, x, y, z)
        to_lobe[i, 0], to_lobe[i, 1], to_lobe[i, 2] = x, y, z
        far = hits.distance[w]
        px, py, pz = origins[w, 0] + far * dx, origins[w, 1] + far * dy, origins[w, 2] + far * dz
        _lifted(mesh.face_normals[triangle], px, py, pz, x, y, z, offset, starts[i])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _add_gloss(g, o, cell, x, y, z, ox, oy, oz, factor, out):
    """Add factor · Σ of object o's glossy layers f_q f_o ρ_q f_A f_B cos θ_i to out (3,), with their images as they are
    at a cell; −1 for their means."""
    for layer in range(g.first[o], g.first[o + 1]):
        q = g.q[layer]
        weight = factor * np.float32(quotient_cosine(g.models[layer], q, x, y, z, ox, oy, oz))
        if weight <= ZERO:
            continue
        angle = gamma(g.kinds_a[layer], q, x, y, z, ox, oy, oz)
        if angle > HALF_PI:
            continue
        j, t = _node(angle, g.n_a[layer])
        low_a = g.begin_a[layer] + j
        high_a = g.begin_a[layer] + min(j + 1, g.n_a[layer] - 1)
        low_b, high_b, u = 0, 0, ZERO
        two = g.kinds_b[layer] >= 0
        if two:
            angle = gamma(g.kinds_b[layer], q, x, y, z, ox, oy, oz)
            if angle > HALF_PI:
                continue
            k, u = _node(angle, g.n_b[layer])
            low_b = g.begin_b[layer] + k
            high_b = g.begin_b[layer] + min(k + 1, g.n_b[layer] - 1)
        position = np.float32(math.acos(min(oz, ONE))) / HALF_PI * np.float32(g.views.shape[1] - 1)
        v = min(np.int64(position), g.views.shape[1] - 2)
        s = position - np.float32(v)
        for c in range(3):
            value = (ONE - t) * g.values[low_a, c] + t * g.values[high_a, c]
            if two:
                value *= (ONE - u) * g.values[low_b, c] + u * g.values[high_b, c]
            value *= (ONE - s) * g.views[layer, v, c] + s * g.views[layer, v + 1, c]
            if cell >= 0 and g.image[layer] >= 0:
                value *= g.texels[g.image[layer], cell, c]
            out[c] += weight * g.gains[layer, c] * value


@nb.njit(cache=True, nogil=True, error_model="numpy")
def expected_photons(lamps, m, lobe_axis, per_area, x, y, z, ox, oy, oz):
    """How many photons are expected for each recorded ray that light m takes from (x, y, z) to (ox, oy, oz), both
    local, by a glossy surface, but for what depends on where it lands: `per_area` of them start on a square metre."""
    towards = direction_pdf(ZERO, ONE, lobe_axis, ox, oy, oz, x, y, z)
    likelier = np.float32(N_BY_POWER)  # among a ray's candidates than as a photon's only one
    if m < lamps.density.shape[0]:
        back = direction_pdf(ZERO, ONE, lobe_axis, x, y, z, ox, oy, oz)
        likelier += N_BY_LOBE * back / max(lamps.density[m], TINY)
    return per_area * towards / (oz * likelier)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def photon_share(ahead, cosine, area, sample_set):
    """Of light that comes to a gather point what is left to photons, the rest to its rays: `area` is that of half the
    disc in which photons count, `sample_set` how many rays a steradian were recorded."""
    ratio = PHOTON_WEIGHT * ahead * cosine * area / max(sample_set, TINY)
    return ONE - ONE / (ONE + ratio * ratio)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def second_bounce_light(samples, position, records, begin, end, objects, g, lamps, table, area, per_area, wanted, first,
                 out):  # fmt: skip
    """π times what comes back along the recorded rays of points [begin, end) from the glossy layers there, (n, 3, 3):
    of the lights, how much of the radiosity beyond, and, as such radiosity, of the lights by glossy layers beyond.
    Number `first` is out[0].

    objects (C,) of the cells; area (p,), per_area (M,): of photons that bring the same light, see `photon_share`; of
    the objects that are not wanted (M,) nothing changes.
    """
    n_cosine, n_lobe = np.float32(samples.tables_cosine.shape[1]), np.float32(samples.tables_lobe.shape[1])
    n_rays, gloss = samples.records.shape[1], np.zeros(3, np.float32)
    for i in range(begin, end):
        r = samples.rows[i]
        tangent, normal = samples.tangent[r], samples.normal[r]
        eye_x, eye_y, eye_z = local_wo(tangent, normal, samples.wo[r])
        turn, cosine, sine = pattern_rotation(r)
        pattern = pattern_of(turn, samples.nth[i])
        times = records.times[i]
        for e in range(records.start[i], records.start[i + 1]):
            n = e - first
            m = np.int64(records.ray[e])
            cell, beyond = np.int64(samples.records[i, m]), records.beyond[e]
            o = objects[cell]
            if not wanted[o] and (records.light_3[e] == NO_LIGHT or not wanted[objects[beyond]]):
                continue
            out[n] = ZERO
            if not _is_in_half(samples, m):
                continue
            x, y, z = _ray(samples, i, m, pattern, cosine, sine, eye_x, eye_y, eye_z)
            dx, dy, dz = _to_world(tangent[0], tangent[1], tangent[2], normal[0], normal[1], normal[2], x, y, z)
            far = records.distance[e]
            px, py, pz = position[r, 0] + far * dx, position[r, 1] + far * dy, position[r, 2] + far * dz
            nx, ny, nz = records.normal[e, 0], records.normal[e, 1], records.normal[e, 2]
            tx, ty, tz = _tangent(g.axes, o, nx, ny, nz)
            ox, oy, oz = _to_local(tx, ty, tz, nx, ny, nz, -dx, -dy, -dz)
            if oz <= HORIZON:
                continue
            sample_set = direction_pdf(n_cosine, n_lobe, samples.lobe_axes[i], x, y, z, eye_x, eye_y, eye_z) / times
            slant = z
            seed, third = _seed(r, samples.nth[i], n_rays, m, 2), _seed(r, samples.nth[i], n_rays, m, 3)
            light = np.int64(records.light[e])
            if light != NO_LIGHT:
                frame, place, eye = (tx, ty, tz, nx, ny, nz), (px, py, pz), (ox, oy, oz)
                c = np.int64(records.candidate[e])
                m, x, y, z, _, _, share = _candidate(lamps, table, c, light, seed, g.lobe_axes[o], frame, place, eye)
                if m >= 0:
                    gloss[:] = ZERO
                    ahead = expected_photons(lamps, m, g.lobe_axes[o], per_area[o], x, y, z, ox, oy, oz)
                    share *= ONE - photon_share(ahead, slant, area[i], sample_set)
                    _add_gloss(
                        g, o, cell, x, y, z, ox, oy, oz, np.float32(PI * times * share * records.weight[e]), gloss
                    )
                    colour = lamps.radiance[m] if m < lamps.density.shape[0] else lamps.power[m]
                    for channel in range(3):
                        out[n, 0, channel] = gloss[channel] * colour[channel]
            if beyond == NO_RECORD:
                continue
            x, y, z = _sample_about_axis(table, seed, g.lobe_axes[o], ox, oy, oz)
            if z <= HORIZON:
                continue
            gloss[:] = ZERO
            density = direction_pdf(ZERO, ONE, g.lobe_axes[o], x, y, z, ox, oy, oz)
            _add_gloss(g, o, cell, x, y, z, ox, oy, oz, times / density, gloss)
            out[n, 1] = gloss
            light = np.int64(records.light_3[e])
            if light == NO_LIGHT:
                continue
            cell, o, far = np.int64(beyond), objects[beyond], records.distance_3[e]
            dx, dy, dz = _to_world(tx, ty, tz, nx, ny, nz, x, y, z)
            px, py, pz = px + far * dx, py + far * dy, pz + far * dz
            nx, ny, nz = records.normal_3[e, 0], records.normal_3[e, 1], records.normal_3[e, 2]
            tx, ty, tz = _tangent(g.axes, o, nx, ny, nz)
            ox, oy, oz = _to_local(tx, ty, tz, nx, ny, nz, -dx, -dy, -dz)
            frame, place, eye = (tx, ty, tz, nx, ny, nz), (px, py, pz), (ox, oy, oz)
            c = np.int64(records.candidate_3[e])
            m, x, y, z, _, _, share = _candidate(lamps, table, c, light, third, g.lobe_axes[o], frame, place, eye)
            if m < 0 or oz <= HORIZON:
                continue
            gloss[:] = ZERO
            _add_gloss(g, o, cell, x, y, z, ox, oy, oz, np.float32(PI * share * records.weight_3[e]), gloss)
            colour = lamps.radiance[m] if m < lamps.density.shape[0] else lamps.power[m]
            for channel in range(3):
                out[n, 2, channel] = gloss[channel] * colour[channel]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def light_second_bounce(samples, records, begin, end, objects, sent, first, radiosity, edited, inverse, out):
    """What `second_bounce_light` found, under radiosity beyond: (n, D, 4), of which number start[begin] is out[0].

    radiosity (2, C, D, 4): for light that the object `edited` sends on, the second, multiplied by `inverse` (4,) and
    moved to the next power, since it counts as proportional to that object's albedo.
    """
    for i in range(begin, end):
        for e in range(records.start[i], records.start[i + 1]):
            n, at, beyond = e - first, e - records.start[begin], records.beyond[e]
            own = 1 if objects[samples.records[i, records.ray[e]]] == edited else 0
            own_3 = 1 if records.light_3[e] != NO_LIGHT and objects[beyond] == edited else 0
            a, b, c = sent[n, 1, 0], sent[n, 1, 1], sent[n, 1, 2]
            if beyond == NO_RECORD:
                a, b, c, beyond = ZERO, ZERO, ZERO, 0
            for k in range(out.shape[1]):
                light = radiosity[own, beyond, k]
                red, green, blue = a * light[0], b * light[1], c * light[2]
                out[at, k, 0], out[at, k, 1], out[at, k, 2], out[at, k, 3] = red, green, blue, ZERO
            for channel in range(3):
                once = inverse[channel] if own else ONE
                out[at, own, channel] += sent[n, 0, channel] * once
                twice = once * inverse[channel] if own_3 else once
                out[at, own + own_3, channel] += sent[n, 1, channel] * sent[n, 2, channel] * twice
