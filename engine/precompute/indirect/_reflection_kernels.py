"""Compiled: light between irradiance cache records, its reflection at gather points, the filter on what they
reflect, and the quadrature of equivalent albedos."""

import math
from typing import NamedTuple

import numba as nb
import numpy as np
from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic

from engine.material._kernels import gamma, quotient_cosine
from engine.precompute.indirect._cache_kernels import NO_RECORD
from engine.precompute.indirect._ray_kernels import (
    ABOUT_AXIS,
    BY_COSINE,
    HORIZON,
    direction_pdf,
    local_wo,
    pattern_of,
    pattern_rotation,
    sample_direction,
    to_local,
    to_world,
)

# Marks a curve that is constant over its angle.
CONSTANT = -2
HALF_PI = np.float32(math.pi / 2)
ZERO, ONE, HALF_BAND = np.float32(0.0), np.float32(1.0), np.float32(0.5)
CODES = np.float32(65535.0)


class ReflectingLayer(NamedTuple):
    """A layer: model and angle numbers, quotient parameters q (8,), values at the nodes of its two curves (J, 3) and
    (K, 3); kind_b < 0 if there is no second curve."""

    model: int
    q: np.ndarray
    kind_a: int
    kind_b: int
    curve_a: np.ndarray
    curve_b: np.ndarray


class WeightArrays(NamedTuple):
    """Ray weights of one layer, without its curves, of the points from number `base` on. The weight is scales (p',)
    times the squared roots (p', R) uint16, 0 for rays without a contribution. angles (A, p', R) uint16 are the
    arguments of its A = 0, 1 or 2 curves, in units of π/2 / 65535.

    Square roots are stored because weights are least where rays are dense, and there curves are highest.
    """

    roots: np.ndarray
    scales: np.ndarray
    angles: np.ndarray
    base: int


class SecondBounce(NamedTuple):
    """Radiosity that glossy surfaces reflect along some of the rays: start (p + 1,) of each point's numbers, ray (n,)
    index within the sample set, and light (n', D, 4), which begins with number `base`."""

    start: np.ndarray
    ray: np.ndarray
    light: np.ndarray
    base: int


class SampleArrays(NamedTuple):
    """q sample sets: rows (q,) of the hits, number nth (q,) at its point, lobe_axes (q,), records (q, R) uint16 that
    the rays hit. Tables (64 n, R_c, 3), (64 n, R_p, 3), see `pattern_of`. tangent, normal, wo (P, 3) of the hits."""

    rows: np.ndarray
    nth: np.ndarray
    lobe_axes: np.ndarray
    records: np.ndarray
    tables_cosine: np.ndarray
    tables_lobe: np.ndarray
    tangent: np.ndarray
    normal: np.ndarray
    wo: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy")
def brighten(irradiance, objects, albedos, relative, edited, out):
    """Radiosity (C, D + 1, 3 or 4) of records from irradiance (C, D, 3), polynomials in the albedo of object `edited`.

    albedos (M, 3), times relative (C, 3) at each record. Multiplication by the edited object's albedo moves a
    coefficient to the next power [BenArtzi07, eq. 6.8].
    """
    out[:] = ZERO
    n_powers = min(irradiance.shape[1], out.shape[1])
    for c in range(irradiance.shape[0]):
        own = objects[c] == edited
        for n in range(n_powers):
            for channel in range(3):
                light = irradiance[c, n, channel] * relative[c, channel]
                if not own:
                    out[c, n, channel] = light * albedos[objects[c], channel]
                elif n + 1 < out.shape[1]:
                    out[c, n + 1, channel] = light


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _node(angle, n):
    """The node below an angle and the fraction of the way to the next, for n hat functions over [0, π/2]."""
    position = min(max(np.float32(angle) * (np.float32(n) / HALF_PI) - HALF_BAND, ZERO), np.float32(n - 1))
    j = min(np.int64(position), max(n - 2, 0))
    return j, position - np.float32(j)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _coded(angle):
    """An angle up to π/2 as stored: fine enough to distinguish 128 positions in each of 512 bands."""
    return np.uint16(max(np.float32(angle), ZERO) * (CODES / HALF_PI) + HALF_BAND)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _coded_node(code, n):
    """As `_node`, for a stored angle."""
    position = min(max(np.float32(code) * (np.float32(n) / CODES) - HALF_BAND, ZERO), np.float32(n - 1))
    j = min(np.int64(position), max(n - 2, 0))
    return j, position - np.float32(j)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _half_of(samples, m):
    """The half of its table, 0 or 1, that ray m belongs to. Either half of a Sobol set, first or last, is as well
    distributed as the whole."""
    n = samples.tables_cosine.shape[1]
    k, n = (m, n) if m < n else (m - n, samples.tables_lobe.shape[1])
    return np.int64(2 * k >= n)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _ray(samples, i, m, pattern, cosine, sine, ox, oy, oz):
    """Local direction of ray m of point i."""
    n_cosine = samples.tables_cosine.shape[1]
    if m < n_cosine:
        return sample_direction(
            samples.tables_cosine[pattern], m, BY_COSINE, cosine, sine, samples.lobe_axes[i], ox, oy, oz
        )
    return sample_direction(
        samples.tables_lobe[pattern], m - n_cosine, ABOUT_AXIS, cosine, sine, samples.lobe_axes[i], ox, oy, oz
    )


@nb.njit(cache=True, nogil=True, error_model="numpy")
def weigh_rays(samples, begin, end, optics, surface, stored_weights):
    """Writes the weights of the rays of points [begin, end) without the curves to `stored_weights`; surface: the points
    in the layer's frame, which need not be the one that the rays are distributed in."""
    n_angles = stored_weights.angles.shape[0]
    n_cosine, n_lobe = np.float32(samples.tables_cosine.shape[1]), np.float32(samples.tables_lobe.shape[1])
    scale = ONE / np.float32(math.pi)
    weights = np.empty(samples.records.shape[1], np.float32)
    for i in range(begin, end):
        r, at = samples.rows[i], i - stored_weights.base
        # Direction to the camera, and the point's rotated pattern.
        ox, oy, oz = local_wo(samples.tangent[r], samples.normal[r], samples.wo[r])
        seed, cosine, sine = pattern_rotation(r)
        pattern = pattern_of(seed, samples.nth[i])
        weights[:] = ZERO
        most = ZERO
        # The rays' own frame, and the layer's if that is another.
        tangent, normal = samples.tangent[r], samples.normal[r]
        to_tangent, to_normal = surface.tangent[r], surface.normal[r]
        is_turned = False
        for axis in range(3):
            is_turned |= tangent[axis] != to_tangent[axis] or normal[axis] != to_normal[axis]
        vx, vy, vz = local_wo(to_tangent, to_normal, surface.wo[r]) if is_turned else (ox, oy, oz)
        for m in range(samples.records.shape[1]):
            if samples.records[i, m] == NO_RECORD:
                continue
            # The quotient ρ_q cosθ_i of each ray that hits a record.
            x, y, z = _ray(samples, i, m, pattern, cosine, sine, ox, oy, oz)
            if z <= HORIZON:
                continue
            density = direction_pdf(n_cosine, n_lobe, samples.lobe_axes[i], x, y, z, ox, oy, oz)
            if is_turned:
                dx, dy, dz = to_world(tangent[0], tangent[1], tangent[2], normal[0], normal[1], normal[2], x, y, z)
                x, y, z = to_local(
                    to_tangent[0], to_tangent[1], to_tangent[2], to_normal[0], to_normal[1], to_normal[2], dx, dy, dz
                )
            weight = np.float32(quotient_cosine(optics.model, optics.q, x, y, z, vx, vy, vz))
            if z <= HORIZON or weight <= ZERO:
                continue
            # Angles of the curves.
            if n_angles > 0:
                angle = gamma(optics.kind_a, optics.q, x, y, z, vx, vy, vz)
                if angle > HALF_PI:
                    continue
                stored_weights.angles[0, at, m] = _coded(angle)
            if n_angles > 1:
                angle = gamma(optics.kind_b, optics.q, x, y, z, vx, vy, vz)
                if angle > HALF_PI:
                    continue
                stored_weights.angles[1, at, m] = _coded(angle)
            # Divide by the density: the Monte Carlo estimator f(X) / p(X) [BenArtzi07, eq. 6.1].
            weights[m] = weight * scale / density
            most = max(most, weights[m])
        # Quantise square roots relative to the point's largest weight.
        stored_weights.scales[at] = most / (CODES * CODES)
        inverse = ONE / most if most > ZERO else ZERO
        for m in range(weights.shape[0]):
            stored_weights.roots[at, m] = np.uint16(np.sqrt(weights[m] * inverse) * CODES + HALF_BAND)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _curve_at(code, curve):
    """A curve (J, 3) at a stored angle: three scalars, which unlike an array need no allocation."""
    j, t = _coded_node(code, curve.shape[0])
    above = min(j + 1, curve.shape[0] - 1)
    return (
        curve[j, 0] + t * (curve[above, 0] - curve[j, 0]),
        curve[j, 1] + t * (curve[above, 1] - curve[j, 1]),
        curve[j, 2] + t * (curve[above, 2] - curve[j, 2]),
    )


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def angles_read(optics, stored_weights):
    """How many angles of each ray a layer's curves are read at: none if the only curve is constant."""
    return 0 if optics.kind_a == CONSTANT else stored_weights.angles.shape[0]


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def ray_value(stored_weights, at, m, optics, n_angles):
    """The weight of ray m of the stored point `at` times the layer's curves, three channels."""
    root = np.float32(stored_weights.roots[at, m])
    a = b = c = root * root * stored_weights.scales[at]
    if n_angles == 0:
        return a * optics.curve_a[0, 0], b * optics.curve_a[0, 1], c * optics.curve_a[0, 2]
    red, green, blue = _curve_at(stored_weights.angles[0, at, m], optics.curve_a)
    a, b, c = a * red, b * green, c * blue
    if n_angles > 1:
        red, green, blue = _curve_at(stored_weights.angles[1, at, m], optics.curve_b)
        a, b, c = a * red, b * green, c * blue
    return a, b, c


@intrinsic
def _add_four(typing_context, total, n, a, b, c, light):
    """total[n] (D, 4) += (a, b, c, 0) · light[n] (D, 4), by vectors: Numba leaves the four numbers apart, which takes
    up to three times as long."""
    if not (total.layout == light.layout == "C"):
        raise TypingError(f"layouts {total.layout} and {light.layout}, expected contiguous arrays")
    signature = types.void(total, types.intp, types.float32, types.float32, types.float32, light)

    def generate(context, builder, signature, arguments):
        total, n, *factors, light = arguments
        vector, index = ir.VectorType(ir.FloatType(), 4), ir.IntType(32)
        weights = vector([0.0] * 4)
        for i, factor in enumerate(factors):
            weights = builder.insert_element(weights, factor, index(i))

        def row(of, array):
            data = context.make_array(of)(context, builder, array).data
            return builder.bitcast(builder.gep(data, [builder.mul(n, n.type(4))]), vector.as_pointer())

        place = row(signature.args[0], total)
        product = builder.fmul(weights, builder.load(row(signature.args[5], light), align=4), flags=("contract",))
        builder.store(builder.fadd(builder.load(place, align=4), product, flags=("contract",)), place, align=4)
        return context.get_dummy_value()

    return signature, generate


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def add_product(a, b, c, light, total):
    """total (D, 4) += (a, b, c, 0) · light (D, 4)."""
    for n in range(total.shape[0]):
        _add_four(total, n, a, b, c, light)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _add_shared(a, b, c, share, light, below, above):
    """Adds share · (a, b, c, 0) · light (D, 4) to above (D, 4) and the rest to below."""
    rest = ONE - share
    for n in range(light.shape[0]):
        _add_four(below, n, rest * a, rest * b, rest * c, light)
        _add_four(above, n, share * a, share * b, share * c, light)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _take_colours(total, out):
    """Copies three of the four columns of total (D, 4) to out, element by element: for whole arrays the compiler
    generates error messages, which takes as long to compile as all the rest."""
    for n in range(total.shape[0]):
        for channel in range(3):
            out[n, channel] = total[n, channel]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def bounce(begin, end, seen, radiosity, n_powers, out):
    """Irradiance (C, D, 3) of records [begin, end): the mean radiosity (C, D, 4) of the records that their rays hit,
    seen (C, R)."""
    share, total = ONE / np.float32(seen.shape[1]), np.empty((n_powers, 4), np.float32)
    for c in range(begin, end):
        total[:] = ZERO
        for m in range(seen.shape[1]):
            if seen[c, m] != NO_RECORD:
                add_product(share, share, share, radiosity[seen[c, m]], total)
        _take_colours(total, out[c])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def reflect(samples, begin, end, optics, stored_weights, radiosity, second, out):
    """Radiance that points [begin, end) reflect towards the camera, from radiosity (C, D, 4), with the curves applied:
    out (p, 1, D, 3) by all rays, or (p, 2, D, 3) by each half of them.

    Without f_q and f_o. stored_weights: of the same points and layer, with as many angles as there are curves; none are
    read if the only curve is constant.
    """
    n_angles, n_halves = angles_read(optics, stored_weights), out.shape[1]
    values = np.zeros((samples.records.shape[1], 3), np.float32)
    total = np.empty((n_halves, radiosity.shape[1], 4), np.float32)
    for i in range(begin, end):
        at = i - stored_weights.base
        scale = np.float32(n_halves) * stored_weights.scales[at]
        total[:] = ZERO
        # Each ray: stored weight times the curves at its angles, times the radiosity of the record it hits. Written
        # out: with `ray_value`, rays without a weight cost as much as others, and the sum takes five times as long.
        for m in range(samples.records.shape[1]):
            root = np.float32(stored_weights.roots[at, m])
            a = b = c = root * root * scale
            if a > ZERO:
                if n_angles == 0:
                    a, b, c = a * optics.curve_a[0, 0], b * optics.curve_a[0, 1], c * optics.curve_a[0, 2]
                else:
                    red, green, blue = _curve_at(stored_weights.angles[0, at, m], optics.curve_a)
                    a, b, c = a * red, b * green, c * blue
                if n_angles > 1:
                    red, green, blue = _curve_at(stored_weights.angles[1, at, m], optics.curve_b)
                    a, b, c = a * red, b * green, c * blue
                half = _half_of(samples, m) if n_halves > 1 else 0
                add_product(a, b, c, radiosity[samples.records[i, m]], total[half])
            values[m, 0], values[m, 1], values[m, 2] = a, b, c
        # Glossy hits add directional radiosity along some of the rays.
        for e in range(second.start[i], second.start[i + 1]):
            m = second.ray[e]
            half = _half_of(samples, m) if n_halves > 1 else 0
            add_product(values[m, 0], values[m, 1], values[m, 2], second.light[e - second.base], total[half])
        for half in range(n_halves):
            _take_colours(total[half], out[i, half])


@nb.njit(cache=True, nogil=True, error_model="numpy")
def reflect_bands(samples, begin, end, optics, of_a, stored_weights, radiosity, second, out):
    """As `reflect`, by band of one of the curves, out (3, J, D, p): of the first if of_a; the other curve is applied.

    This is the basis function of the edited curve in place of the curve [BenArtzi07, eq. 6.2].
    """
    n_powers, n_bands = radiosity.shape[1], out.shape[1]
    bands = np.empty((n_bands + 1, n_powers, 4), np.float32)
    edited, other = (0, 1) if of_a else (1, 0)
    curve = optics.curve_b if of_a else optics.curve_a
    for i in range(begin, end):
        at = i - stored_weights.base
        bands[:] = ZERO
        e, last = second.start[i], second.start[i + 1]
        # Each ray: weight times the other curve, distributed between the two bands next to its angle.
        for m in range(samples.records.shape[1]):
            root = np.float32(stored_weights.roots[at, m])
            a = b = c = root * root * stored_weights.scales[at]
            if a <= ZERO:
                continue
            if stored_weights.angles.shape[0] > 1:
                red, green, blue = _curve_at(stored_weights.angles[other, at, m], curve)
                a, b, c = a * red, b * green, c * blue
            j, t = _coded_node(stored_weights.angles[edited, at, m], n_bands)
            _add_shared(a, b, c, t, radiosity[samples.records[i, m]], bands[j], bands[j + 1])
            # Glossy hits of this ray; both lists are sorted by ray.
            while e < last and second.ray[e] < m:
                e += 1
            if e < last and second.ray[e] == m:
                _add_shared(a, b, c, t, second.light[e - second.base], bands[j], bands[j + 1])
        for channel in range(3):
            for j in range(n_bands):
                for n in range(n_powers):
                    out[channel, j, n, i] = bands[j, n, channel]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def smooth_rows(start, neighbour, weight, values, out):
    """Applies a filter (`smoothing.Smoothing`) to values (q, m): out (p, m)."""
    for i in range(out.shape[0]):
        for c in range(out.shape[1]):
            out[i, c] = np.float32(0.0)
        for at in range(start[i], start[i + 1]):
            row, w = neighbour[at], weight[at]
            for c in range(out.shape[1]):
                out[i, c] += w * values[row, c]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def smooth_planes(start, neighbour, weight, values, begin, end, out):
    """Filters the planes [begin, end) of values (m, q) along q into out (m, p)."""
    for plane in range(begin, end):
        for i in range(out.shape[1]):
            total = np.float32(0.0)
            for at in range(start[i], start[i + 1]):
                total += weight[at] * values[plane, neighbour[at]]
            out[plane, i] = total


@nb.njit(cache=True, nogil=True, error_model="numpy")
def albedo_bands(model, q, kind_a, kind_b, lobe_axis, wo, tables_cosine, tables_lobe, out):
    """Adds ∫ ρ_q cos θ_i Δ_j Δ_k dω_i for each direction to the camera (S, 3) to out (S, J, K) [BenArtzi07, 5.2.4]."""
    n_a, n_b = out.shape[1], out.shape[2]
    n_cosine, n_lobe = tables_cosine.shape[1], tables_lobe.shape[1]
    for s in range(wo.shape[0]):
        ox, oy, oz = wo[s, 0], wo[s, 1], wo[s, 2]
        seed, cosine, sine = pattern_rotation(s)
        pattern = s % tables_cosine.shape[0]
        for m in range(n_cosine + n_lobe):
            # A direction from one of the two distributions.
            if m < n_cosine:
                x, y, z = sample_direction(tables_cosine[pattern], m, BY_COSINE, cosine, sine, lobe_axis, ox, oy, oz)
            else:
                x, y, z = sample_direction(
                    tables_lobe[pattern], m - n_cosine, ABOUT_AXIS, cosine, sine, lobe_axis, ox, oy, oz
                )
            if z <= HORIZON:
                continue
            # Positions on the curves.
            angle = gamma(kind_a, q, x, y, z, ox, oy, oz)
            if angle > HALF_PI:
                continue
            j, t = _node(angle, n_a)
            k, u = 0, ZERO
            if kind_b >= 0:
                angle = gamma(kind_b, q, x, y, z, ox, oy, oz)
                if angle > HALF_PI:
                    continue
                k, u = _node(angle, n_b)
            # The Monte Carlo estimate, distributed between the neighbouring bands of both curves.
            density = direction_pdf(np.float32(n_cosine), np.float32(n_lobe), lobe_axis, x, y, z, ox, oy, oz)
            value = quotient_cosine(model, q, x, y, z, ox, oy, oz) / density
            j1, k1 = min(j + 1, n_a - 1), min(k + 1, n_b - 1)
            out[s, j, k] += (ONE - t) * (ONE - u) * value
            out[s, j1, k] += t * (ONE - u) * value
            out[s, j, k1] += (ONE - t) * u * value
            out[s, j1, k1] += t * u * value
