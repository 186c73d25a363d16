"""Compiled: light between cells, and what gather points reflect of it."""

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from engine.indirect._cell_kernels import NO_CELL
from engine.indirect._ray_kernels import HORIZON, fan_density, fan_direction, local_eye, turn_of
from engine.material._kernels import gamma, quotient_cosine

# In place of an angle: the curve is the same at all of them.
CONSTANT = -2
HALF_PI = np.float32(math.pi / 2)
ZERO, ONE, HALF_BAND = np.float32(0.0), np.float32(1.0), np.float32(0.5)


class Optics(NamedTuple):
    """A layer: model and angle numbers, quotient parameters q (8,), values at the nodes of its two curves (J, 3) and
    (K, 3); kind_b < 0: there is no second one."""

    model: int
    q: np.ndarray
    kind_a: int
    kind_b: int
    curve_a: np.ndarray
    curve_b: np.ndarray


class Second(NamedTuple):
    """What glossy surfaces send back along some of the rays, as radiosity: start (p + 1,) of each point's numbers, ray
    (n,) of the fan, and light (n', D, 3), which begins with number `base`."""

    start: np.ndarray
    ray: np.ndarray
    light: np.ndarray
    base: int


class Fans(NamedTuple):
    """p gather points: rows (p,) of the hits, poles (p,), the cells their rays see (p, R) uint16; which half of the
    rays counts (of each table the first, 0, or the second, 1; −1 for all); tables (64, R_c, 3), (64, R_p, 3); the hits'
    tangent, normal, wo (P, 3)."""

    rows: np.ndarray
    poles: np.ndarray
    seen: np.ndarray
    half: int
    tables_cosine: np.ndarray
    tables_pole: np.ndarray
    tangent: np.ndarray
    normal: np.ndarray
    wo: np.ndarray


@nb.njit(cache=True, nogil=True, error_model="numpy")
def brighten(irradiance, objects, albedos, edited, out):
    """Radiosity (C, D + 1, 3) of cells from irradiance (C, D, 3), polynomials in the albedo of the object `edited`.

    albedos (M, 3); multiplying by that of `edited` moves a number to the next power.
    """
    out[:] = ZERO
    n_powers = min(irradiance.shape[1], out.shape[1])
    for c in range(irradiance.shape[0]):
        own = objects[c] == edited
        for n in range(n_powers):
            for channel in range(3):
                if not own:
                    out[c, n, channel] = irradiance[c, n, channel] * albedos[objects[c], channel]
                elif n + 1 < out.shape[1]:
                    out[c, n + 1, channel] = irradiance[c, n, channel]


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def bounce(begin, end, seen, radiosity, n_powers, out):
    """Irradiance (C, D, 3) of cells [begin, end): the mean radiosity (C, D, 3) of what their rays see (C, R)."""
    share = ONE / np.float32(seen.shape[1])
    for c in range(begin, end):
        out[c] = ZERO
        for m in range(seen.shape[1]):
            cell = seen[c, m]
            if cell != NO_CELL:
                for n in range(n_powers):
                    for channel in range(3):
                        out[c, n, channel] += radiosity[cell, n, channel]
        for n in range(n_powers):
            for channel in range(3):
                out[c, n, channel] *= share


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _node(angle, n):
    """The node below an angle and how far it is to the next, for n hats over [0, π/2]."""
    position = min(max(np.float32(angle) * (np.float32(n) / HALF_PI) - HALF_BAND, ZERO), np.float32(n - 1))
    j = min(np.int64(position), max(n - 2, 0))
    return j, position - np.float32(j)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _counts(fans, m):
    """Whether ray m is in the half that counts; half of a Sobol set, its first or last, is as even as the whole."""
    n = fans.tables_cosine.shape[1]
    k, n = (m, n) if m < n else (m - n, fans.tables_pole.shape[1])
    return fans.half < 0 or (2 * k >= n) == (fans.half == 1)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _ray(fans, i, m, pattern, cosine, sine, ox, oy, oz):
    """Local direction of ray m of point i."""
    n_cosine = fans.tables_cosine.shape[1]
    if m < n_cosine:
        return fan_direction(fans.tables_cosine[pattern], m, True, cosine, sine, fans.poles[i], ox, oy, oz)
    return fan_direction(fans.tables_pole[pattern], m - n_cosine, False, cosine, sine, fans.poles[i], ox, oy, oz)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _add_recorded(second, e, last, m, seen, light):
    """What is recorded for ray m, if anything is, on top of the radiosity (D, 3) of the cell seen, into light (D, 3).

    Returns the next number to look at, and whether there was something.
    """
    while e < last and second.ray[e] < m:
        e += 1
    if e == last or second.ray[e] != m:
        return e, False
    for n in range(seen.shape[0]):
        for c in range(3):
            light[n, c] = seen[n, c] + second.light[e - second.base, n, c]
    return e, True


@nb.njit(cache=True, nogil=True, error_model="numpy")
def reflect(fans, begin, end, optics, radiosity, second, out):
    """What points [begin, end) reflect towards the eye, (p, D, 3), of radiosity (C, D, 3), with the curves as they are.

    Without f_q and f_o.
    """
    n_a, n_b, n_powers = optics.curve_a.shape[0], optics.curve_b.shape[0], radiosity.shape[1]
    n_cosine, n_pole = np.float32(fans.tables_cosine.shape[1]), np.float32(fans.tables_pole.shape[1])
    scale = (ONE if fans.half < 0 else np.float32(2.0)) / np.float32(math.pi)
    light = np.empty((n_powers, 3), np.float32)
    for i in range(begin, end):
        r = fans.rows[i]
        out[i] = ZERO
        e, last = second.start[i], second.start[i + 1]
        ox, oy, oz = local_eye(fans.tangent[r], fans.normal[r], fans.wo[r])
        seed, cosine, sine = turn_of(r)
        pattern = np.int64(seed & np.uint64(fans.tables_cosine.shape[0] - 1))
        for m in range(fans.seen.shape[1]):
            cell = fans.seen[i, m]
            if cell == NO_CELL or not _counts(fans, m):
                continue
            x, y, z = _ray(fans, i, m, pattern, cosine, sine, ox, oy, oz)
            weight = np.float32(quotient_cosine(optics.model, optics.q, x, y, z, ox, oy, oz))
            if z <= HORIZON or weight <= ZERO:
                continue
            weight *= scale / fan_density(n_cosine, n_pole, fans.poles[i], x, y, z, ox, oy, oz)
            j, t = 0, ZERO
            if optics.kind_a != CONSTANT:
                angle = gamma(optics.kind_a, optics.q, x, y, z, ox, oy, oz)
                if angle > HALF_PI:
                    continue
                j, t = _node(angle, n_a)
            e, recorded = _add_recorded(second, e, last, m, radiosity[cell], light)
            lit = light if recorded else radiosity[cell]
            j1 = min(j + 1, n_a - 1)
            k, u, k1 = 0, ZERO, 0
            if optics.kind_b >= 0:
                angle = gamma(optics.kind_b, optics.q, x, y, z, ox, oy, oz)
                if angle > HALF_PI:
                    continue
                k, u = _node(angle, n_b)
                k1 = min(k + 1, n_b - 1)
            for channel in range(3):
                value = weight * ((ONE - t) * optics.curve_a[j, channel] + t * optics.curve_a[j1, channel])
                if optics.kind_b >= 0:
                    value *= (ONE - u) * optics.curve_b[k, channel] + u * optics.curve_b[k1, channel]
                for n in range(n_powers):
                    out[i, n, channel] += value * lit[n, channel]


@nb.njit(cache=True, nogil=True, error_model="numpy")
def reflect_bands(fans, begin, end, optics, of_a, radiosity, second, out):
    """As `reflect`, by band of one of the curves, out (3, J, D, p): of the first where of_a; the other is as it is."""
    n_a, n_b, n_powers = optics.curve_a.shape[0], optics.curve_b.shape[0], radiosity.shape[1]
    n_bands = n_a if of_a else n_b
    n_cosine, n_pole = np.float32(fans.tables_cosine.shape[1]), np.float32(fans.tables_pole.shape[1])
    scale = (ONE if fans.half < 0 else np.float32(2.0)) / np.float32(math.pi)
    bands = np.empty((n_bands + 1, n_powers, 3), np.float32)
    light = np.empty((n_powers, 3), np.float32)
    for i in range(begin, end):
        r = fans.rows[i]
        bands[:] = ZERO
        e, last = second.start[i], second.start[i + 1]
        ox, oy, oz = local_eye(fans.tangent[r], fans.normal[r], fans.wo[r])
        seed, cosine, sine = turn_of(r)
        pattern = np.int64(seed & np.uint64(fans.tables_cosine.shape[0] - 1))
        for m in range(fans.seen.shape[1]):
            cell = fans.seen[i, m]
            if cell == NO_CELL or not _counts(fans, m):
                continue
            x, y, z = _ray(fans, i, m, pattern, cosine, sine, ox, oy, oz)
            weight = np.float32(quotient_cosine(optics.model, optics.q, x, y, z, ox, oy, oz))
            if z <= HORIZON or weight <= ZERO:
                continue
            weight *= scale / fan_density(n_cosine, n_pole, fans.poles[i], x, y, z, ox, oy, oz)
            angle = gamma(optics.kind_a, optics.q, x, y, z, ox, oy, oz)
            if angle > HALF_PI:
                continue
            e, recorded = _add_recorded(second, e, last, m, radiosity[cell], light)
            lit = light if recorded else radiosity[cell]
            j, t = _node(angle, n_a)
            k, u = 0, ZERO
            if optics.kind_b >= 0:
                angle = gamma(optics.kind_b, optics.q, x, y, z, ox, oy, oz)
                if angle > HALF_PI:
                    continue
                k, u = _node(angle, n_b)
            dormant, at, share = optics.curve_b, k, u
            kept, kept_share = j, t
            if not of_a:
                dormant, at, share = optics.curve_a, j, t
                kept, kept_share = k, u
            above = min(at + 1, dormant.shape[0] - 1)
            for channel in range(3):
                value = weight
                if optics.kind_b >= 0:
                    value *= (ONE - share) * dormant[at, channel] + share * dormant[above, channel]
                low, high = (ONE - kept_share) * value, kept_share * value
                for n in range(n_powers):
                    bands[kept, n, channel] += low * lit[n, channel]
                    bands[kept + 1, n, channel] += high * lit[n, channel]
        for channel in range(3):
            for j in range(n_bands):
                for n in range(n_powers):
                    out[channel, j, n, i] = bands[j, n, channel]
