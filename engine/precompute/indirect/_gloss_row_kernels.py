"""Compiled: the directions in which glossy surfaces along the stored rays of gather points see the sky, and rows of
what the points reflect of it by triangles.

Each glossy vertex takes a few random directions about the axis of its lobe. With its curves and shadow rays they say
how much of the light of each triangle of the sky it sends back along the ray.
"""

import numba as nb
import numpy as np

from engine.precompute.direct._relight_kernels import _append_terms, _to_wavelets
from engine.precompute.indirect._cache_kernels import NO_RECORD
from engine.precompute.indirect._gloss_kernels import add_gloss
from engine.precompute.indirect._light_choice_kernels import ray_seed, sample_about_axis, sky_at
from engine.precompute.indirect._ray_kernels import HORIZON, direction_pdf, hash64, to_world
from engine.precompute.indirect._reflection_kernels import ONE, ZERO, angles_read, ray_value
from engine.precompute.indirect._second_bounce_kernels import PI, second_vertex, third_vertex


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _sample_lobe(paths, o, record, vertex, seed, share, n, offset, factors, directions, starts):
    """Writes the directions about the lobe axis of a vertex on object o as row n of the arrays of `sample_lobes`.
    share (3,): a factor on the light of each."""
    frame, place, wo = vertex
    axis, gloss = paths.layers.lobe_axes[o], np.empty(3, np.float32)
    tx, ty, tz, nx, ny, nz = frame
    for k in range(factors.shape[1]):
        factors[n, k, 0] = factors[n, k, 1] = factors[n, k, 2] = ZERO
        own = hash64(seed + np.uint64(k + 1) * np.uint64(0x632BE59BD9B4E019))
        x, y, z = sample_about_axis(paths.table, own, axis, wo[0], wo[1], wo[2])
        if z <= HORIZON or wo[2] <= HORIZON:
            continue
        gloss[:] = ZERO
        density = direction_pdf(ZERO, ONE, axis, x, y, z, wo[0], wo[1], wo[2])
        add_gloss(paths.layers, o, record, x, y, z, wo[0], wo[1], wo[2], PI / density, gloss)
        dx, dy, dz = to_world(tx, ty, tz, nx, ny, nz, x, y, z)
        directions[n, k, 0], directions[n, k, 1], directions[n, k, 2] = dx, dy, dz
        starts[n, k, 0] = place[0] + offset * nx
        starts[n, k, 1] = place[1] + offset * ny
        starts[n, k, 2] = place[2] + offset * nz
        for c in range(3):
            factors[n, k, c] = share[c] * gloss[c]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def sample_lobes(paths, begin, end, offset, raster, factors, directions, starts, triangles):
    """Directions in which the glossy second and third vertices along the stored rays of points [begin, end) see the
    sky, K each: the second vertex of the n-th ray in row 2 n, the third in row 2 n + 1.

    Writes directions and origins of shadow rays (2 n, K, 3), the triangles (2 n, K) of the sky there, and factors
    (2 n, K, 3): the light that returns along the ray, times π, from a radiance of 1 there; 0 where there is none.
    """
    samples, records, table = paths.samples, paths.records, paths.table
    share, first = np.empty(3, np.float32), records.start[begin]
    for i in range(begin, end):
        r, n_rays = samples.rows[i], samples.records.shape[1]
        for e in range(records.start[i], records.start[i + 1]):
            n, m = 2 * (e - first), np.int64(records.ray[e])
            factors[n + 1] = ZERO
            # Second vertex.
            share[:] = records.times[i] / np.float32(factors.shape[1])
            o, vertex, _, _ = second_vertex(paths, i, e)
            frame, place, wo = vertex
            seed, record = ray_seed(r, samples.nth[i], n_rays, m, 2), np.int64(samples.records[i, m])
            _sample_lobe(paths, o, record, vertex, seed, share, n, offset, factors, directions, starts)
            # Third vertex, where the lobe ray ends on a glossy surface: times the second's reflection of that ray.
            has_third = (
                records.normal_3[e, 0] != ZERO or records.normal_3[e, 1] != ZERO or records.normal_3[e, 2] != ZERO
            )
            if records.beyond[e] == NO_RECORD or not has_third or wo[2] <= HORIZON:
                continue
            x, y, z = sample_about_axis(table, seed, paths.layers.lobe_axes[o], wo[0], wo[1], wo[2])
            if z <= HORIZON:
                continue
            density = direction_pdf(ZERO, ONE, paths.layers.lobe_axes[o], x, y, z, wo[0], wo[1], wo[2])
            factor = records.times[i] / (density * np.float32(factors.shape[1]))
            share[:] = ZERO
            add_gloss(paths.layers, o, record, x, y, z, wo[0], wo[1], wo[2], factor, share)
            o, vertex = third_vertex(paths, e, frame, place, x, y, z)
            seed, record = ray_seed(r, samples.nth[i], n_rays, m, 3), np.int64(records.beyond[e])
            _sample_lobe(paths, o, record, vertex, seed, share, n + 1, offset, factors, directions, starts)
        for n in range(2 * (records.start[i] - first), 2 * (records.start[i + 1] - first)):
            for k in range(factors.shape[1]):
                if factors[n, k, 0] > ZERO or factors[n, k, 1] > ZERO or factors[n, k, 2] > ZERO:
                    triangles[n, k] = sky_at(raster, directions[n, k, 0], directions[n, k, 1], directions[n, k, 2])
                else:
                    triangles[n, k] = -1


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def gloss_coefficients(
    samples, records, begin, end, optics, stored_weights, triangles, factors, per_power, tint, out
):  # fmt: skip
    """Wavelet coefficients (p, T, 3) of what the points with sample sets [begin, end) reflect of each triangle of the
    sky, averaged over the sets of a point. triangles and factors: from `sample_lobes`, −1 where something is in the
    way; per_power (T,): radiance of a triangle with a power of 1; tint (3,): of the layer."""
    n_angles, values = angles_read(optics, stored_weights), np.zeros((out.shape[1], 3), np.float32)
    first, point, i = records.start[begin], 0, begin
    while i < end:
        last = i + 1
        while last < end and samples.nth[last] != 0:
            last += 1
        values[:] = ZERO
        for each in range(i, last):
            at = each - stored_weights.base
            share = ONE / np.float32(last - i)
            for e in range(records.start[each], records.start[each + 1]):
                a, b, c = ray_value(stored_weights, at, np.int64(records.ray[e]), optics, n_angles)
                a, b, c = share * a * tint[0], share * b * tint[1], share * c * tint[2]
                for n in range(2 * (e - first), 2 * (e - first) + 2):
                    for k in range(triangles.shape[1]):
                        t = triangles[n, k]
                        if t >= 0:
                            values[t, 0] += a * factors[n, k, 0] * per_power[t]
                            values[t, 1] += b * factors[n, k, 1] * per_power[t]
                            values[t, 2] += c * factors[n, k, 2] * per_power[t]
        _to_wavelets(values, out[point])
        point += 1
        i = last


@nb.njit(cache=True, nogil=True, error_model="numpy")
def append_rows(coefficients, effects, least, rows):
    """Writes the terms of coefficients (p, T, C) whose effect exceeds `least` into rows, which have room for them;
    returns their number."""
    written = np.int64(0)
    for p in range(coefficients.shape[0]):
        rows.start[p] = written
        written, rows.scale[p] = _append_terms(coefficients[p], effects, least, rows.number, rows.value, written)
    rows.start[coefficients.shape[0]] = written
    return written
