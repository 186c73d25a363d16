"""Compiled rows of reflection over a lighting basis, computed once per material and multiplied by the light in every
frame.

A row holds the reflection at a point of each spherical Haar wavelet of the light [Ma06, 3.1], for the terms that
matter.
"""

from typing import NamedTuple

import numba as nb
import numpy as np

from engine.precompute.direct._angle_kernels import HALF_PI, fill_gammas, tint, weigh
from engine.precompute.direct._projection_kernels import gather_local, set_frame
from engine.sphere.haar import N_ROOTS

# Values of a row are stored as fractions of its largest, in so many steps.
STEPS = np.float32(32767.0)


class TriangleParts(NamedTuple):
    """The T triangles of the sphere, followed by their n children each: centres (3, T (1 + n)); shares of the parent's
    solid angle and index of the parent, (T (1 + n),)."""

    centres: np.ndarray
    shares: np.ndarray
    owner: np.ndarray


class DirectedLights(NamedTuple):
    """M lights too small to have an extent: unit directions (3, M) towards them, power (M, 3), the integral of L dω."""

    directions: np.ndarray
    power: np.ndarray


class Reflection(NamedTuple):
    """A layer's reflection with its curves: model and angle numbers, quotient parameters q (8,); tints: number of the
    look-up of quotients per colour channel, or 0; both curves at even steps from 0 to π/2, (S + 1, C), C = 1 where all
    channels are equal, the second of one step where there is none; bends_a, bends_b (S + 1,): the steps at which a
    curve varies within a triangle."""

    model: int
    q: np.ndarray
    kind_a: int
    kind_b: int
    tints: int
    curve_a: np.ndarray
    curve_b: np.ndarray
    bends_a: np.ndarray
    bends_b: np.ndarray


class _Scratch(NamedTuple):
    """Working memory for the triangle parts that one point sees, and for its row."""

    listed: np.ndarray
    order: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    gamma: np.ndarray
    weights: np.ndarray
    ones: np.ndarray
    quotients: np.ndarray
    tinted: np.ndarray
    reflected: np.ndarray
    frame: np.ndarray
    values: np.ndarray
    coefficients: np.ndarray


class LightRowArrays(NamedTuple):
    """Rows of P points with N terms in all: start (P + 1,) of each row, scale (P,); the wavelet number of each term
    (N,) and its coefficients (N, C) as scale · value / 32767."""

    start: np.ndarray
    scale: np.ndarray
    number: np.ndarray
    value: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _times_curve(curve, gamma, reflected):
    """Multiplies reflected (n, C) by the curve at γ (n,), linearly interpolated."""
    n_steps = curve.shape[0] - 1
    scale = np.float32(n_steps) / HALF_PI
    for i in range(gamma.shape[0]):
        at = min(gamma[i] * scale, np.float32(n_steps))
        k = min(np.int64(at), n_steps - 1)
        part = at - np.float32(k)
        for c in range(reflected.shape[1]):
            reflected[i, c] *= curve[k, c] + part * (curve[k + 1, c] - curve[k, c])


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _to_wavelets(values, coefficients):
    """`haar.forward` of values (T, C) of one level; overwrites the values."""
    n = values.shape[0]
    while n > N_ROOTS:
        n //= 4
        # One level: three wavelet coefficients of each four siblings, and their mean as the parent's value.
        for t in range(n):
            for c in range(values.shape[1]):
                p, q, r, s = values[4 * t, c], values[4 * t + 1, c], values[4 * t + 2, c], values[4 * t + 3, c]
                coefficients[n + 3 * t, c] = np.float32(0.25) * (p - q - r + s)
                coefficients[n + 3 * t + 1, c] = np.float32(0.25) * (q - p - r + s)
                coefficients[n + 3 * t + 2, c] = np.float32(0.25) * (r - p - q + s)
                values[t, c] = np.float32(0.25) * (p + q + r + s)
    for t in range(N_ROOTS):  # not all at once, see `_copy_colours` of the projection
        for c in range(values.shape[1]):
            coefficients[t, c] = values[t, c]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _make_scratch(n_triangles, n_all, n_channels):
    """Working memory for one point: n_triangles of the sphere, n_all with their parts."""
    return _Scratch(
        np.empty(n_all, np.int64), np.arange(n_all), np.empty(n_all, np.float32), np.empty(n_all, np.float32),
        np.empty(n_all, np.float32), np.empty(n_all, np.float32), np.empty(n_all, np.float32),
        np.ones((n_all, 3), np.float32), np.empty((n_all, 3), np.float32), np.empty((n_all, 3), np.float32),
        np.empty((n_all, n_channels), np.float32), np.empty((3, 3), np.float32),
        np.empty((n_triangles, n_channels), np.float32), np.empty((n_triangles, n_channels), np.float32),
    )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _list_visible(words, n_triangles, listed):
    """Lists the triangles that a point sees; returns their number."""
    n = 0
    for t in range(n_triangles):
        listed[n] = t
        n += np.int64((words[t >> 6] >> np.uint64(t & 63)) & np.uint64(1))
    return n


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _part_bending(kind, bends, q, ox, oy, oz, n_triangles, n_seen, n, s):
    """Replaces those of the n_seen triangles over which the curve bends by their parts, appended behind the n listed;
    returns the new number."""
    n_parts = s.listed.shape[0] // n_triangles - 1
    fill_gammas(kind, q, s.x[:n_seen], s.y[:n_seen], s.z[:n_seen], ox, oy, oz, s.gamma)
    scale = np.float32(bends.shape[0] - 1) / HALF_PI
    for k in range(n_seen):
        t = s.listed[k]
        if t >= 0 and bends[np.int64(s.gamma[k] * scale)]:
            for i in range(n_parts):
                s.listed[n] = n_triangles + n_parts * t + i
                n += 1
            s.listed[k] = -1
    return n


@nb.njit(cache=True, nogil=True, error_model="numpy")
def _compact_listed(n, listed):
    """Removes the gaps; returns the remaining number."""
    n_listed = 0
    for k in range(n):
        listed[n_listed] = listed[k]
        n_listed += listed[k] >= 0
    return n_listed


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _to_frame(frame, wo):
    """The direction to the camera in the local frame."""
    return (
        frame[0, 0] * wo[0] + frame[0, 1] * wo[1] + frame[0, 2] * wo[2],
        frame[1, 0] * wo[0] + frame[1, 1] * wo[1] + frame[1, 2] * wo[2],
        frame[2, 0] * wo[0] + frame[2, 1] * wo[1] + frame[2, 2] * wo[2],
    )


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _fill_reflected(reflection, ox, oy, oz, n, s):
    """Fills s.reflected (n, C) with s.weights (n,) times ρ cosθ for the first n local directions of the scratch."""
    q, n_channels = reflection.q, s.reflected.shape[1]
    x, y, z, weights, gamma, reflected = s.x[:n], s.y[:n], s.z[:n], s.weights[:n], s.gamma[:n], s.reflected[:n]
    # ρ_q cosθ.
    if reflection.tints != 0:
        tint(reflection.tints, q, s.order[:n], x, y, z, ox, oy, oz, weights, s.ones, s.quotients, s.tinted)
    else:
        weigh(reflection.model, q, x, y, z, ox, oy, oz, weights)
    for k in range(n):
        for c in range(n_channels):
            reflected[k, c] = weights[k] * s.tinted[k, c] if reflection.tints != 0 else weights[k]
    # Times the curves f_A(γ_A) and f_B(γ_B) [BenArtzi07, eq. 3.1].
    fill_gammas(reflection.kind_a, q, x, y, z, ox, oy, oz, gamma)
    _times_curve(reflection.curve_a, gamma, reflected)
    if reflection.curve_b.shape[0] > 1:
        fill_gammas(reflection.kind_b, q, x, y, z, ox, oy, oz, gamma)
        _times_curve(reflection.curve_b, gamma, reflected)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _reflect(words, wo, parts, reflection, s):
    """Fills s.values (T, C) with ρ V cosθ, averaged over each triangle of the sphere.

    Triangles over which a curve bends are averaged over their parts.
    """
    q, frame, n_triangles, n_channels = reflection.q, s.frame, s.values.shape[0], s.values.shape[1]
    ox, oy, oz = _to_frame(frame, wo)
    two = reflection.curve_b.shape[0] > 1
    # List visible triangles; replace those over which a curve bends by their parts.
    n_seen = _list_visible(words, n_triangles, s.listed)
    gather_local(parts.centres, s.listed, n_seen, frame, s.x, s.y, s.z)
    n = _part_bending(reflection.kind_a, reflection.bends_a, q, ox, oy, oz, n_triangles, n_seen, n_seen, s)
    if two:
        n = _part_bending(reflection.kind_b, reflection.bends_b, q, ox, oy, oz, n_triangles, n_seen, n, s)
    if n > n_seen:
        n = _compact_listed(n, s.listed)
        gather_local(parts.centres, s.listed, n, frame, s.x, s.y, s.z)
    # Reflection times each part's share of its triangle.
    for k in range(n):
        s.weights[k] = parts.shares[s.listed[k]]
    _fill_reflected(reflection, ox, oy, oz, n, s)
    z, reflected = s.z[:n], s.reflected[:n]
    # Sum the parts of each triangle.
    s.values[:] = np.float32(0.0)
    for k in range(n):
        if z[k] > np.float32(0.0):
            for c in range(n_channels):
                s.values[parts.owner[s.listed[k]], c] += reflected[k, c]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _append_terms(coefficients, effects, least, number, value, written):
    """Appends the terms of a row whose effect exceeds `least`; returns the total number of terms and the scale of the
    row."""
    first, largest = written, np.float32(0.0)
    for t in range(effects.shape[0]):
        size = np.float32(0.0)
        for c in range(value.shape[1]):
            size = max(size, abs(coefficients[t, c]))
        if size * effects[t] > least:
            number[written] = t
            largest = max(largest, size)
            written += 1
    # Quantise relative to the largest coefficient.
    per = STEPS / largest if largest > np.float32(0.0) else np.float32(0.0)
    for k in range(first, written):
        for c in range(value.shape[1]):
            value[k, c] = np.int16(np.rint(coefficients[number[k], c] * per))
    return written, largest / STEPS


@nb.njit(cache=True, nogil=True, error_model="numpy")
def fill_rows(points, surface, bits, parts, reflection, effects, least, rows):
    """Writes the rows of `points` into `rows`, which has room for all terms; returns the number of terms.

    bits (P, words): the triangles that each point sees. effects (T,): the effect on the picture of a coefficient of 1
    in each wavelet; terms with less effect than `least` are dropped.
    """
    s = _make_scratch(effects.shape[0], parts.shares.shape[0], rows.value.shape[1])
    written = np.int64(0)
    for i in range(points.shape[0]):
        p = points[i]
        set_frame(surface.tangent[p], surface.normal[p], s.frame)
        _reflect(bits[p], surface.wo[p], parts, reflection, s)
        _to_wavelets(s.values, s.coefficients)
        rows.start[i] = written
        written, rows.scale[i] = _append_terms(s.coefficients, effects, least, rows.number, rows.value, written)
    rows.start[points.shape[0]] = written
    return written


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def light_rows(rows, light, out):
    """out (P, 3) = rows · light (T, 3)."""
    start, scale, number, value = rows
    zero = np.float32(0.0)
    for p in range(out.shape[0]):
        r, g, b = zero, zero, zero
        if value.shape[1] == 1:
            for k in range(start[p], start[p + 1]):
                t, u = number[k], np.float32(value[k, 0])
                r += u * light[t, 0]
                g += u * light[t, 1]
                b += u * light[t, 2]
        else:
            for k in range(start[p], start[p + 1]):
                t = number[k]
                r += np.float32(value[k, 0]) * light[t, 0]
                g += np.float32(value[k, 1]) * light[t, 1]
                b += np.float32(value[k, 2]) * light[t, 2]
        out[p, 0], out[p, 1], out[p, 2] = scale[p] * r, scale[p] * g, scale[p] * b


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def reflect_lights(points, surface, bits, lights, reflection, out):
    """out (p, 3): what `points` (p,) reflect of the lights that they see by bits (P, words)."""
    n_lights, n_channels = lights.power.shape[0], reflection.curve_a.shape[1]
    s = _make_scratch(0, n_lights, n_channels)
    for i in range(points.shape[0]):
        p = points[i]
        for c in range(3):
            out[i, c] = np.float32(0.0)
        n = _list_visible(bits[p], n_lights, s.listed)
        if n == 0:
            continue
        set_frame(surface.tangent[p], surface.normal[p], s.frame)
        ox, oy, oz = _to_frame(s.frame, surface.wo[p])
        gather_local(lights.directions, s.listed, n, s.frame, s.x, s.y, s.z)
        for k in range(n):
            s.weights[k] = np.float32(1.0)
        _fill_reflected(reflection, ox, oy, oz, n, s)
        for k in range(n):
            if s.z[k] > np.float32(0.0):
                for c in range(3):
                    out[i, c] += s.reflected[k, min(c, n_channels - 1)] * lights.power[s.listed[k], c]
