"""Compiled: the light that an edited curve reflects at the second bounce, by knots of its change.

A path that meets the edited curve at one of its glossy reflections carries light in proportion to the curve at one
position. `edited_light` finds position and light of the stored rays, `photon_light` of the photons. Both are reflected
at the gather points, and distributed between the knots on either side of the position; where the receiving curve is
edited as well, the products are summed by modes of both changes.
"""

from typing import NamedTuple

import numba as nb
import numpy as np

from engine.precompute.indirect._gloss_kernels import gloss_without_curve
from engine.precompute.indirect._light_choice_kernels import NO_LIGHT, light_colour
from engine.precompute.indirect._photon_kernels import reflected_photon
from engine.precompute.indirect._ray_kernels import object_tangent, to_local
from engine.precompute.indirect._reflection_kernels import CODES, HALF_BAND, ONE, ZERO, angles_read, ray_value
from engine.precompute.indirect._second_bounce_kernels import find_reflections

# In place of a curve of the receiving layer, see `reflect_by_mode`.
NO_CURVE = -1


class Knots(NamedTuple):
    """K of a curve's J bands, between which its change is interpolated linearly: at (K + 1,) float32, ascending, the
    last beyond all bands; below (J,): the last knot at or below each band."""

    at: np.ndarray
    below: np.ndarray


class EditedLight(NamedTuple):
    """Light of an edited curve along n stored rays: start (p + 1,) of each point's range, ray (n,) within the sample
    set; for up to three reflections, positions (n', 3) on the curve in bands and light (n', 3, 3) divided by the curve;
    pairs (n', 3): light that meets the curve at the second and at the third vertex, divided by both; factor (n', 3) on
    the radiosity of the record `beyond` (n,), divided by the curve. Those of n' begin with number `base`."""

    start: np.ndarray
    ray: np.ndarray
    positions: np.ndarray
    light: np.ndarray
    pairs: np.ndarray
    factor: np.ndarray
    beyond: np.ndarray
    base: int


@nb.njit(cache=True, nogil=True, error_model="numpy")
def edited_light(paths, begin, end, o, layer, of_a, sent, first, bright, positions, light, pairs, factor):
    """Writes positions (n, 3), light (n, 3, 3), pairs and factor (n, 3), see `EditedLight`, of the stored rays of
    points [begin, end).

    o, layer, of_a: the object, its glossy layer and which of its curves; sent: of `second_bounce_light` from ray number
    `first` on, under the curves as they are; bright (C, 3): radiosity of the records that reaches o. Where a path meets
    the curve twice, the curve is applied at the other position.
    """
    samples, records = paths.samples, paths.records
    numbers, directions, factors = np.empty((3, 3), np.int64), np.empty((3, 6), np.float32), np.empty(3, np.float32)
    base = records.start[begin]
    for i in range(begin, end):
        for e in range(records.start[i], records.start[i + 1]):
            n, at, beyond = e - first, e - base, records.beyond[e]
            light[at], positions[at], pairs[at], factor[at] = ZERO, ZERO, ZERO, ZERO
            own = paths.objects[samples.records[i, records.ray[e]]] == o
            own_3 = records.light_3[e] != NO_LIGHT and paths.objects[beyond] == o
            if not own and not own_3:
                continue
            find_reflections(paths, i, e, numbers, directions, factors)
            for v in range(3):
                if factors[v] == ZERO or not (own_3 if v == 2 else own):
                    continue
                d = directions[v]
                positions[at, v] = gloss_without_curve(
                    paths.layers, layer, of_a, numbers[v, 1], d[0], d[1], d[2], d[3], d[4], d[5], factors[v],
                    light[at, v],
                )  # fmt: skip
                for c in range(3):
                    if v == 1:
                        factor[at, c] = light[at, 1, c]
                        light[at, 1, c] *= bright[beyond, c] + sent[n, 2, c]
                    else:
                        light[at, v, c] *= light_colour(paths.all_lights, numbers[v, 0], numbers[v, 2], c)
            for c in range(3):
                pairs[at, c] = factor[at, c] * light[at, 2, c]
                light[at, 2, c] *= sent[n, 1, c]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def photon_light(photons, g, o, layer, of_a, positions, light):
    """Writes the positions (n,) on an edited curve and the flux (n, 3) divided by that curve of the photons from object
    o; 0 for other photons."""
    nowhere = np.int64(-1)
    for i in range(light.shape[0]):
        positions[i], light[i] = ZERO, ZERO
        if photons.sources[i] != o:
            continue
        nx, ny, nz = photons.normals[i, 0], photons.normals[i, 1], photons.normals[i, 2]
        tx, ty, tz = object_tangent(g.axes, o, photons.turns[i], nx, ny, nz)
        to_light, onward = photons.to_light[i], photons.directions[i]
        x, y, z = to_local(tx, ty, tz, nx, ny, nz, to_light[0], to_light[1], to_light[2])
        ox, oy, oz = to_local(tx, ty, tz, nx, ny, nz, onward[0], onward[1], onward[2])
        positions[i] = gloss_without_curve(g, layer, of_a, nowhere, x, y, z, ox, oy, oz, ONE, light[i])
        for c in range(3):
            light[i, c] *= photons.power[i, c]


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _is_lit(light):
    return light[0] != ZERO or light[1] != ZERO or light[2] != ZERO


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _add_to_knots(knots, position, a, b, c, total):
    """Distributes a colour between the knots on either side of a position in bands, total (K + 1, 3)."""
    k = knots.below[np.int64(position)]
    t = (position - knots.at[k]) / (knots.at[k + 1] - knots.at[k])
    total[k, 0] += (ONE - t) * a
    total[k, 1] += (ONE - t) * b
    total[k, 2] += (ONE - t) * c
    total[k + 1, 0] += t * a
    total[k + 1, 1] += t * b
    total[k + 1, 2] += t * c


@nb.njit(cache=True, nogil=True, error_model="numpy")
def reflect_by_knot(samples, begin, end, optics, stored_weights, edited, knots, out):
    """Adds the radiance that points [begin, end) reflect of the light of an edited curve, by knot of its change, to out
    (3, K, end - begin)."""
    n_angles = angles_read(optics, stored_weights)
    total = np.empty((out.shape[1] + 1, 3), np.float32)
    for i in range(begin, end):
        total[:] = ZERO
        for e in range(edited.start[i], edited.start[i + 1]):
            n, m, at = e - edited.base, edited.ray[e], i - stored_weights.base
            if stored_weights.roots[at, m] == 0:
                continue
            a, b, c = ray_value(stored_weights, at, m, optics, n_angles)
            for v in range(3):
                light = edited.light[n, v]
                if _is_lit(light):
                    _add_to_knots(knots, edited.positions[n, v], a * light[0], b * light[1], c * light[2], total)
        _add_knots(total, out, i - begin)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def reflect_photons_by_knot(begin, end, optics, nearby, reflected, positions, light, knots, out):
    """Adds the reflection of photons near points [begin, end) to out, see `reflect_by_knot`; positions (n,) and light
    (n, 3): see `photon_light`."""
    total = np.empty((out.shape[1] + 1, 3), np.float32)
    for i in range(begin, end):
        if nearby.start[i] == nearby.start[i + 1]:
            continue
        total[:] = ZERO
        for e in range(nearby.start[i], nearby.start[i + 1]):
            n, at = nearby.photon[e], e - reflected.base
            flux = light[n]
            if _is_lit(flux) and reflected.weights[at] != ZERO:
                a, b, c = reflected_photon(reflected, at, optics)
                _add_to_knots(knots, positions[n], a * flux[0], b * flux[1], c * flux[2], total)
        _add_knots(total, out, i - begin)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _add_knots(total, out, i):
    for c in range(3):
        for k in range(out.shape[1]):
            out[c, k, i] += total[k, c]


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _modes_at(modes, position, out):
    """Modes (J, K) at a position in bands, interpolated linearly, to out (K,)."""
    j = min(np.int64(position), max(modes.shape[0] - 2, 0))
    j1, t = min(j + 1, modes.shape[0] - 1), position - np.float32(j)
    for k in range(out.shape[0]):
        out[k] = (ONE - t) * modes[j, k] + t * modes[j1, k]


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _add_to_modes(receiver, own, a, b, c, total):
    """Adds a colour times the product of two sets of modes (R,) and (K,) to total (R, K, 3)."""
    for r in range(receiver.shape[0]):
        red, green, blue = receiver[r] * a, receiver[r] * b, receiver[r] * c
        for k in range(own.shape[0]):
            total[r, k, 0] += own[k] * red
            total[r, k, 1] += own[k] * green
            total[r, k, 2] += own[k] * blue


@nb.njit(cache=True, nogil=True, error_model="numpy")
def reflect_by_mode(samples, begin, end, optics, which, stored_weights, edited, receiver, modes, out):
    """Adds the radiance that points [begin, end) reflect of light that meets two edited curves, by modes of both,
    receiver (J', R) and modes (J, K), to out (3, R, K, end - begin).

    which: the first is the curve 0 or 1 of the receiving layer, which `optics` has as ones; NO_CURVE: both are the
    edited curve, at the second and at the third vertex.
    """
    n_bands = np.float32(receiver.shape[0])
    n_angles = angles_read(optics, stored_weights)
    total = np.empty((receiver.shape[1], modes.shape[1], 3), np.float32)
    at_first, own = np.empty(receiver.shape[1], np.float32), np.empty(modes.shape[1], np.float32)
    for i in range(begin, end):
        total[:] = ZERO
        for e in range(edited.start[i], edited.start[i + 1]):
            n, m, at = e - edited.base, edited.ray[e], i - stored_weights.base
            if stored_weights.roots[at, m] == 0 or (which < 0 and not _is_lit(edited.pairs[n])):
                continue
            a, b, c = ray_value(stored_weights, at, m, optics, n_angles)
            if which < 0:
                pair = edited.pairs[n]
                _modes_at(receiver, edited.positions[n, 1], at_first)
                _modes_at(modes, edited.positions[n, 2], own)
                _add_to_modes(at_first, own, a * pair[0], b * pair[1], c * pair[2], total)
                continue
            position = np.float32(stored_weights.angles[which, at, m]) * (n_bands / CODES) - HALF_BAND
            _modes_at(receiver, min(max(position, ZERO), n_bands - ONE), at_first)
            for v in range(3):
                light = edited.light[n, v]
                if _is_lit(light):
                    _modes_at(modes, edited.positions[n, v], own)
                    _add_to_modes(at_first, own, a * light[0], b * light[1], c * light[2], total)
        _add_modes(total, out, i - begin)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def reflect_by_power(samples, begin, end, optics, stored_weights, edited, radiosity, modes, out):
    """Adds the radiance that points [begin, end) reflect of radiosity (C, N, 3) that an edited curve sends on, by power
    of the edited object's albedo and by modes (J, K) of the curve's change, to out (3, N, K, end - begin)."""
    n_angles = angles_read(optics, stored_weights)
    total, own = np.empty((radiosity.shape[1], modes.shape[1], 3), np.float32), np.empty(modes.shape[1], np.float32)
    for i in range(begin, end):
        total[:] = ZERO
        for e in range(edited.start[i], edited.start[i + 1]):
            n, m, at = e - edited.base, edited.ray[e], i - stored_weights.base
            factor = edited.factor[n]
            if stored_weights.roots[at, m] == 0 or not _is_lit(factor):
                continue
            a, b, c = ray_value(stored_weights, at, m, optics, n_angles)
            a, b, c = a * factor[0], b * factor[1], c * factor[2]
            _modes_at(modes, edited.positions[n, 1], own)
            for power in range(radiosity.shape[1]):
                light = radiosity[edited.beyond[e], power]
                for k in range(modes.shape[1]):
                    total[power, k, 0] += own[k] * a * light[0]
                    total[power, k, 1] += own[k] * b * light[1]
                    total[power, k, 2] += own[k] * c * light[2]
        _add_modes(total, out, i - begin)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def reflect_photons_by_mode(begin, end, optics, which, nearby, reflected, positions, light, receiver, modes, out):
    """Adds the reflection of photons near points [begin, end) to out, see `reflect_by_mode`."""
    n_bands = np.float32(receiver.shape[0])
    total = np.empty((receiver.shape[1], modes.shape[1], 3), np.float32)
    at_receiver, own = np.empty(receiver.shape[1], np.float32), np.empty(modes.shape[1], np.float32)
    for i in range(begin, end):
        if nearby.start[i] == nearby.start[i + 1]:
            continue
        total[:] = ZERO
        for e in range(nearby.start[i], nearby.start[i + 1]):
            n, at = nearby.photon[e], e - reflected.base
            flux = light[n]
            if _is_lit(flux) and reflected.weights[at] != ZERO:
                a, b, c = reflected_photon(reflected, at, optics)
                position = np.float32(reflected.angles[which, at]) * (n_bands / CODES) - HALF_BAND
                _modes_at(receiver, min(max(position, ZERO), n_bands - ONE), at_receiver)
                _modes_at(modes, positions[n], own)
                _add_to_modes(at_receiver, own, a * flux[0], b * flux[1], c * flux[2], total)
        _add_modes(total, out, i - begin)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _add_modes(total, out, i):
    for c in range(3):
        for r in range(out.shape[1]):
            for k in range(out.shape[2]):
                out[c, r, k, i] += total[r, k, c]
