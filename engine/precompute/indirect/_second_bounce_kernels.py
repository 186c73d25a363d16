"""Compiled: samples the glossy second bounce towards gather points.

Where a hemisphere sample of a gather point ends on a glossy surface, two further rays are stored. One goes to a light
that is chosen for that surface (`engine.precompute.indirect._light_choice_kernels`). The other samples the lobe, for
light from other surfaces. If it ends on a glossy surface again, a light is chosen there too. None of this depends on a
curve.
"""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from engine.precompute.indirect._cache_kernels import NO_RECORD, _write_ray
from engine.precompute.indirect._gloss_kernels import GlossyLayers, add_gloss
from engine.precompute.indirect._light_choice_kernels import (
    N_BY_LOBE,
    N_BY_POWER,
    NO_LIGHT,
    TINY,
    SampledLights,
    light_colour,
    ray_seed,
    sample_about_axis,
    sample_candidate,
)
from engine.precompute.indirect._ray_kernels import (
    HORIZON,
    direction_pdf,
    local_wo,
    object_tangent,
    pattern_of,
    pattern_rotation,
    to_local,
    to_world,
)
from engine.precompute.indirect._reflection_kernels import ONE, ZERO, SampleArrays, _ray

PI = np.float32(math.pi)


class GlossyHits(NamedTuple):
    """n rays that end on glossy surfaces, by point and ray. start (p + 1,): range of each point; times (p,): the number
    of rays that each stored one represents; ray (n,): index of the ray; normal (n, 3) and distance (n,) of the hit;
    turn (n,): the code of the map that rotates the tangent there (`engine.scene.tangents`); light (n,): the unoccluded
    light, NO_LIGHT for none, with its candidate number (n,) and resampling weight (n,); beyond (n,): the record that
    the second ray hits, or NO_RECORD. The fields with _3 describe the vertex where that ray ends, if it is glossy: the
    third vertex."""

    start: np.ndarray
    times: np.ndarray
    ray: np.ndarray
    normal: np.ndarray
    turn: np.ndarray
    distance: np.ndarray
    light: np.ndarray
    candidate: np.ndarray
    weight: np.ndarray
    beyond: np.ndarray
    normal_3: np.ndarray
    turn_3: np.ndarray
    distance_3: np.ndarray
    light_3: np.ndarray
    candidate_3: np.ndarray
    weight_3: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy")
def sample_lobe_rays(which, n_rays, rows, nth, hits, turns, origins, directions, normals, mesh, lobe_axes, axes, table,
                    offset, to_lobe, starts, there):  # fmt: skip
    """Samples rays about the lobe axes where the rays `which` (n,) of a chunk of sample sets end, with normals (n, 3)
    and codes of the tangents' maps turns (n,): directions to_lobe and origins starts (n, 3), and which of them exist
    (n,)."""
    for i in range(which.shape[0]):
        w = which[i]
        triangle, o = hits.triangle[w], mesh.objects[hits.triangle[w]]
        dx, dy, dz = directions[w, 0], directions[w, 1], directions[w, 2]
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        tx, ty, tz = object_tangent(axes, o, turns[i], nx, ny, nz)
        ox, oy, oz = to_local(tx, ty, tz, nx, ny, nz, -dx, -dy, -dz)
        sample_set, m = divmod(w, n_rays)
        x, y, z = sample_about_axis(
            table, ray_seed(rows[sample_set], nth[sample_set], n_rays, m, 2), lobe_axes[o], ox, oy, oz
        )
        there[i] = z > HORIZON
        if not there[i]:
            x, y, z = ZERO, ZERO, ONE
        x, y, z = to_world(tx, ty, tz, nx, ny, nz, x, y, z)
        far = hits.distance[w]
        px, py, pz = origins[w, 0] + far * dx, origins[w, 1] + far * dy, origins[w, 2] + far * dz
        face = mesh.face_normals[triangle]
        _write_ray(starts, to_lobe, i, px, py, pz, face[0], face[1], face[2], x, y, z, offset)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def expected_photons(all_lights, m, lobe_axis, per_area, x, y, z, ox, oy, oz):
    """Expected number of photons per stored ray, for the light that a glossy surface reflects from light m at (x, y, z)
    to (ox, oy, oz), both local, up to the geometry of the receiving point; per_area: photons emitted per square metre.
    """
    towards = direction_pdf(ZERO, ONE, lobe_axis, ox, oy, oz, x, y, z)
    # How much likelier a light is among a ray's candidates than as a photon's only one.
    likelier = np.float32(N_BY_POWER)
    if m < all_lights.density.shape[0]:
        back = direction_pdf(ZERO, ONE, lobe_axis, x, y, z, ox, oy, oz)
        likelier += N_BY_LOBE * back / max(all_lights.density[m], TINY)
    return per_area * towards / (oz * likelier)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def photon_share(ahead, cosine, area, sample_set):
    """The share of light at a gather point that photons account for; its rays account for the rest (power heuristic).
    area: that of half the disc in which photons count; sample_set: stored rays per steradian.

    A larger weight of photons, whose noise looks smoother, was rejected, because they blur: with the weight of eight
    samples each the reference tea tray is 2.00 % off, as they are 1.59, without any 1.60.
    """
    ratio = ahead * cosine * area / max(sample_set, TINY)
    return ONE - ONE / (ONE + ratio * ratio)


class GlossyPaths(NamedTuple):
    """What `find_reflections` reads: samples and position (P, 3) of the gather points; records: their stored rays;
    objects (C,) of the records; layers, at the second vertex, and layers_3, at the third; all_lights; table: of
    directions about the lobe axis; area (p,), per_area (M,): of photons that carry the same light, see
    `photon_share`."""

    samples: SampleArrays
    position: np.ndarray
    records: GlossyHits
    objects: np.ndarray
    layers: GlossyLayers
    layers_3: GlossyLayers
    all_lights: SampledLights
    table: np.ndarray
    area: np.ndarray
    per_area: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _vertex(axes, o, normal, turn, e, px, py, pz, dx, dy, dz, far):
    """Frame, position and local direction back along a ray of length `far` that ends on object o with normal[e] and
    turn[e]."""
    nx, ny, nz = normal[e, 0], normal[e, 1], normal[e, 2]
    tx, ty, tz = object_tangent(axes, o, turn[e], nx, ny, nz)
    wo = to_local(tx, ty, tz, nx, ny, nz, -dx, -dy, -dz)
    return (tx, ty, tz, nx, ny, nz), (px + far * dx, py + far * dy, pz + far * dz), wo


@nb.njit(cache=True, nogil=True, error_model="numpy")
def second_vertex(paths, i, e):
    """Object, frame, position and local direction back along stored ray e of point i, which is regenerated from its
    pattern; and the ray's local direction and that to the camera at the point."""
    samples, records = paths.samples, paths.records
    r, m = samples.rows[i], np.int64(records.ray[e])
    tangent, normal = samples.tangent[r], samples.normal[r]
    wo = local_wo(tangent, normal, samples.wo[r])
    turn, cosine, sine = pattern_rotation(r)
    x, y, z = _ray(samples, i, m, pattern_of(turn, samples.nth[i]), cosine, sine, wo[0], wo[1], wo[2])
    dx, dy, dz = to_world(tangent[0], tangent[1], tangent[2], normal[0], normal[1], normal[2], x, y, z)
    o = np.int64(paths.objects[samples.records[i, m]])
    px, py, pz = paths.position[r, 0], paths.position[r, 1], paths.position[r, 2]
    far = records.distance[e]
    vertex = _vertex(paths.layers.axes, o, records.normal, records.turn, e, px, py, pz, dx, dy, dz, far)
    return o, vertex, (x, y, z), wo


@nb.njit(cache=True, nogil=True, error_model="numpy")
def third_vertex(paths, e, frame, place, x, y, z):
    """Object, frame, position and local direction back where the lobe ray (x, y, z) from the second vertex ends."""
    records = paths.records
    o = np.int64(paths.objects[records.beyond[e]])
    dx, dy, dz = to_world(frame[0], frame[1], frame[2], frame[3], frame[4], frame[5], x, y, z)
    px, py, pz = place
    far = records.distance_3[e]
    return o, _vertex(paths.layers.axes, o, records.normal_3, records.turn_3, e, px, py, pz, dx, dy, dz, far)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def find_reflections(paths, i, e, numbers, directions, factors):
    """The glossy reflections along stored ray e of point i: of a light at the second vertex, of what the lobe ray hits
    there, and of a light at the third vertex. Writes numbers (3, 3): object, record and light (−1 for none); directions
    (3, 6): local, of incidence and towards the ray before; factors (3,): on the gloss, 0 where there is no reflection.

    The factor contains π, the resampling weight and the balance weight, less the photons' share.
    """
    samples, records, g, all_lights, table = paths.samples, paths.records, paths.layers, paths.all_lights, paths.table
    factors[0] = factors[1] = factors[2] = ZERO
    n_cosine, n_lobe = np.float32(samples.tables_cosine.shape[1]), np.float32(samples.tables_lobe.shape[1])
    n_rays, times, m = samples.records.shape[1], records.times[i], np.int64(records.ray[e])
    # Second vertex.
    r, record = samples.rows[i], np.int64(samples.records[i, m])
    o, (frame, place, wo), (x, y, z), (wo_x, wo_y, wo_z) = second_vertex(paths, i, e)
    ox, oy, oz = wo
    if oz <= HORIZON:
        return
    # Density of stored rays at the gather point, per steradian.
    sample_set = direction_pdf(n_cosine, n_lobe, samples.lobe_axes[i], x, y, z, wo_x, wo_y, wo_z) / times
    slant = z
    seed, third = ray_seed(r, samples.nth[i], n_rays, m, 2), ray_seed(r, samples.nth[i], n_rays, m, 3)
    # Direct light at the second vertex: π · RIS weight · balance weight · gloss · L, less the photons' share.
    if records.light[e] != NO_LIGHT:
        light = np.int64(records.light[e])
        c = np.int64(records.candidate[e])
        m, x, y, z, _, _, share = sample_candidate(all_lights, table, c, light, seed, g.lobe_axes[o], frame, place, wo)
        if m >= 0:
            ahead = expected_photons(all_lights, m, g.lobe_axes[o], paths.per_area[o], x, y, z, ox, oy, oz)
            share *= ONE - photon_share(ahead, slant, paths.area[i], sample_set)
            factors[0] = np.float32(PI * times * share * records.weight[e])
            _write_reflection(numbers, directions, 0, o, record, m, (x, y, z), wo)
    # Indirect light at the second vertex: a factor on the radiosity of the record that the lobe ray hits.
    beyond = np.int64(records.beyond[e])
    if beyond == NO_RECORD:
        return
    x, y, z = sample_about_axis(table, seed, g.lobe_axes[o], ox, oy, oz)
    if z <= HORIZON:
        return
    factors[1] = times / direction_pdf(ZERO, ONE, g.lobe_axes[o], x, y, z, ox, oy, oz)
    _write_reflection(numbers, directions, 1, o, record, np.int64(-1), (x, y, z), (ox, oy, oz))
    # Third vertex: direct light there, if that record is glossy as well.
    light = np.int64(records.light_3[e])
    if light == NO_LIGHT:
        return
    o, (frame, place, wo) = third_vertex(paths, e, frame, place, x, y, z)
    c = np.int64(records.candidate_3[e])
    m, x, y, z, _, _, share = sample_candidate(all_lights, table, c, light, third, g.lobe_axes[o], frame, place, wo)
    if m >= 0 and wo[2] > HORIZON:
        factors[2] = np.float32(PI * share * records.weight_3[e])
        _write_reflection(numbers, directions, 2, o, beyond, m, (x, y, z), wo)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _write_reflection(numbers, directions, vertex, o, record, light, wi, wo):
    numbers[vertex, 0], numbers[vertex, 1], numbers[vertex, 2] = o, record, light
    directions[vertex, 0], directions[vertex, 1], directions[vertex, 2] = wi
    directions[vertex, 3], directions[vertex, 4], directions[vertex, 5] = wo


@nb.njit(cache=True, nogil=True, error_model="numpy")
def second_bounce_light(paths, begin, end, missing, first, out):
    """Light (n, 3, 3) that returns along the stored rays of points [begin, end) from the glossy layers there, times π:
    from the lights; as a factor on the radiosity beyond; and, as such radiosity, from the lights by glossy layers
    beyond. Ray number `first` is out[0]. Results of objects that are not `missing` (M,) remain unchanged.
    """
    samples, records = paths.samples, paths.records
    numbers, directions = np.empty((3, 3), np.int64), np.empty((3, 6), np.float32)
    factors, gloss = np.empty(3, np.float32), np.empty(3, np.float32)
    for i in range(begin, end):
        for e in range(records.start[i], records.start[i + 1]):
            n, o = e - first, paths.objects[samples.records[i, records.ray[e]]]
            if not missing[o] and (records.light_3[e] == NO_LIGHT or not missing[paths.objects[records.beyond[e]]]):
                continue
            find_reflections(paths, i, e, numbers, directions, factors)
            out[n] = ZERO
            for v in range(3):
                if factors[v] == ZERO:
                    continue
                gloss[:] = ZERO
                d = directions[v]
                layers = paths.layers_3 if v == 2 else paths.layers
                add_gloss(layers, numbers[v, 0], numbers[v, 1], d[0], d[1], d[2], d[3], d[4], d[5], factors[v], gloss)
                for c in range(3):
                    m = numbers[v, 2]
                    light = ONE if m < 0 else light_colour(paths.all_lights, numbers[v, 0], m, c)
                    out[n, v, c] = gloss[c] * light


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def light_second_bounce(
    samples, records, begin, end, objects, sent, first, is_lit, radiosity, edited, inverse, out
):  # fmt: skip
    """Combines the result of `second_bounce_light` with the radiosity beyond: (n, D, 4), ray number start[begin] is
    out[0].

    radiosity (2, C, D, 4): the second is for light that the object `edited` reflects. It is multiplied by `inverse`
    (4,) and moved to the next power, since such light is treated as proportional to that object's albedo. is_lit:
    whether the lights reach glossy surfaces directly.
    """
    for i in range(begin, end):
        for e in range(records.start[i], records.start[i + 1]):
            n, at, beyond = e - first, e - records.start[begin], records.beyond[e]
            own = 1 if objects[samples.records[i, records.ray[e]]] == edited else 0
            own_3 = 1 if records.light_3[e] != NO_LIGHT and objects[beyond] == edited else 0
            a, b, c = sent[n, 1, 0], sent[n, 1, 1], sent[n, 1, 2]
            if beyond == NO_RECORD:
                a, b, c, beyond = ZERO, ZERO, ZERO, 0
            # Factor times radiosity, per power of the edited object's albedo.
            for k in range(out.shape[1]):
                light = radiosity[own, beyond, k]
                red, green, blue = a * light[0], b * light[1], c * light[2]
                out[at, k, 0], out[at, k, 1], out[at, k, 2], out[at, k, 3] = red, green, blue, ZERO
            if not is_lit:
                continue
            # Direct light at the second and third vertex, at the power of its number of reflections off the edited
            # object.
            for channel in range(3):
                once = inverse[channel] if own else ONE
                out[at, own, channel] += sent[n, 0, channel] * once
                twice = once * inverse[channel] if own_3 else once
                out[at, own + own_3, channel] += sent[n, 1, channel] * sent[n, 2, channel] * twice
