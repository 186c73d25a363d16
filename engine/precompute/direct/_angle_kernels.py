"""Compiled: angles and quotients of many directions at once, in single precision, in loops that the compiler
vectorises.

`engine.material._kernels` states every formula once, for one pair of directions, in double precision; it takes 10 to 70
nanoseconds a call, these loops one to three. A model or an angle without a loop here uses the scalar form. A parity
test compares the two.
"""

import math

import numba as nb
import numpy as np

from engine.material._kernels import call_colours, gamma, model_quotient_cosine
from engine.material.kinds import (
    ASHIKHMIN_SHIRLEY,
    FACING_REFLECTANCE,
    FRESNEL_TERM,
    GAMMA_ALPHA,
    GAMMA_BETA,
    GGX,
    GRAZING,
    LAMBERT,
    PHI_D,
    ROUGH_ALPHA,
    ROUGH_CONDUCTOR,
    ROUGH_DISTRIBUTION,
    THETA_D,
    THETA_H,
    THETA_I,
    THETA_O,
    THETA_R,
)

HALF_PI = np.float32(math.pi / 2)
TINY = np.float32(1e-30)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _arc(root, x):
    """arccos x for x in [0, 1], given root = sqrt(1 - x) [Abramowitz64, 4.4.45], error 7e-5."""
    p = np.float32(-0.0187293) * x + np.float32(0.0742610)
    p = p * x - np.float32(0.2121144)
    return root * (p * x + np.float32(1.5707288))


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _log1p(t):
    """ln(1 + t) for t ≥ 0, relative error 1e-5: exponent and mantissa of 1 + t, artanh series of the mantissa."""
    u = np.float32(1.0) + t
    bits = np.float32(u).view(np.int32)
    exponent = np.float32((bits >> 23) - 127)
    mantissa = np.int32((bits & 0x007FFFFF) | 0x3F800000).view(np.float32)
    large = mantissa > np.float32(1.41421356)
    mantissa = mantissa * np.float32(0.5) if large else mantissa
    exponent = exponent + np.float32(1.0) if large else exponent
    # Below 1/8 use the argument itself, so that small t retain their digits.
    small = t < np.float32(0.125)
    w = t / (t + np.float32(2.0)) if small else (mantissa - np.float32(1.0)) / (mantissa + np.float32(1.0))
    w2 = w * w
    series = (
        np.float32(2.0)
        * w
        * (np.float32(1.0) + w2 * (np.float32(1 / 3) + w2 * (np.float32(0.2) + w2 * np.float32(1 / 7))))
    )
    return series if small else series + exponent * np.float32(0.69314718)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _exp(x):
    """e^x for x ≤ 0, relative error 3e-6, 0 below -80."""
    t = max(x, np.float32(-80.0)) * np.float32(1.44269504)
    whole = np.float32(np.int32(t - np.float32(0.5)))
    f = (t - whole) * np.float32(0.69314718)
    p = np.float32(1 / 120) * f + np.float32(1 / 24)
    p = ((p * f + np.float32(1 / 6)) * f + np.float32(0.5)) * f * f + f + np.float32(1.0)
    return p * np.int32((np.int32(whole) + 127) << 23).view(np.float32)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def fill_gammas(kind, q, x, y, z, ox, oy, oz, out):
    """γ in [0, π/2] of each direction (x, y, z): `gamma` in single precision, in loops that the compiler vectorises.

    Error 1e-4 rad, a hundredth of the narrowest band of a 128-band curve. Near the axis of a narrow lobe the angle
    retains its digits, because 1 - cos is computed without cancellation.
    """
    one = np.float32(1.0)
    if kind == THETA_I:
        # 1 - cos θ_i = sin² θ_i / (1 + cos θ_i).
        for v in range(x.shape[0]):
            c = min(max(z[v], np.float32(0.0)), one)
            flat2 = x[v] * x[v] + y[v] * y[v]
            part = flat2 / (one + c) if z[v] > np.float32(0.0) else one
            out[v] = _arc(np.sqrt(min(part, one)), c)
    elif kind == THETA_H:
        # θ_h of the half vector ω_i + ω_o.
        for v in range(x.shape[0]):
            sx, sy, sz = x[v] + ox, y[v] + oy, max(z[v] + oz, np.float32(0.0))
            flat2 = sx * sx + sy * sy
            length = np.sqrt(flat2 + sz * sz + TINY)
            out[v] = _arc(np.sqrt(min(flat2 / (length * (length + sz)), one)), sz / length)
    elif kind == THETA_D:
        # sin² θ_d = |ω_i - ω_o|² / 4.
        for v in range(x.shape[0]):
            dx, dy, dz = x[v] - ox, y[v] - oy, z[v] - oz
            sin2 = min(np.float32(0.25) * (dx * dx + dy * dy + dz * dz), one)
            c = np.sqrt(one - sin2)
            out[v] = _arc(np.sqrt(sin2 / (one + c)), c)
    elif kind == GAMMA_ALPHA or kind == GAMMA_BETA:
        # γ_α and γ_β: cos γ = (cos θ_h) to the power cos² φ_h or sin² φ_h [BenArtzi07, eq. 3.7, 3.8].
        for v in range(x.shape[0]):
            sx, sy, sz = x[v] + ox, y[v] + oy, max(z[v] + oz, np.float32(1e-6))
            x2, y2, z2 = sx * sx, sy * sy, sz * sz
            flat2 = x2 + y2
            share = (x2 if kind == GAMMA_ALPHA else y2) / (flat2 + TINY)
            # ln cos² = -ln(1 + tan²) avoids cancellation for narrow lobes.
            logarithm = np.float32(-0.5) * share * _log1p(flat2 / z2)
            power = _exp(logarithm)
            near = -logarithm * (one + np.float32(0.5) * logarithm)  # 1 - e^x for small x
            rest = near if logarithm > np.float32(-1e-2) else one - power
            out[v] = _arc(np.sqrt(min(max(rest, np.float32(0.0)), one)), power)
    else:
        for v in range(x.shape[0]):
            out[v] = min(np.float32(gamma(kind, q, x[v], y[v], z[v], ox, oy, oz)), HALF_PI)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _beckmann_g1(cosine, alpha):
    """Smith's G1 for Beckmann by the rational approximation [Walter07, eq. 27]."""
    slope2 = alpha * alpha * max(np.float32(1.0) - cosine * cosine, np.float32(1e-12))
    a = min(cosine / np.sqrt(slope2), np.float32(1.6))
    fit = (np.float32(3.535) * a + np.float32(2.181) * a * a) / (
        np.float32(1.0) + np.float32(2.276) * a + np.float32(2.577) * a * a
    )
    return fit if a < np.float32(1.6) else np.float32(1.0)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def weigh(model_kind, q, x, y, z, ox, oy, oz, weights):
    """weights (n,) *= ρ_q cosθ of each direction (x, y, z): `quotient_cosine`, with vectorised loops for the common
    models."""
    # Diffuse: cosθ / π.
    if model_kind == LAMBERT:
        for i in range(x.shape[0]):
            weights[i] *= max(z[i], np.float32(0.0)) * np.float32(1.0 / math.pi)
    elif model_kind == ROUGH_CONDUCTOR and q[ROUGH_DISTRIBUTION] == GGX and oz > GRAZING:
        # GGX: G cosθ / (4 cosθ_i cosθ_o) with Smith's G1 [Walter07, eq. 34]; D and F are curves.
        a2 = np.float32(q[ROUGH_ALPHA] * q[ROUGH_ALPHA])
        rest = np.float32(1.0) - a2
        masked = np.float32(1.0) / (oz + np.sqrt(a2 + rest * oz * oz))
        for i in range(x.shape[0]):
            c = max(z[i], np.float32(0.0))
            weights[i] *= c * masked / (c + np.sqrt(a2 + rest * c * c))
    elif model_kind == ROUGH_CONDUCTOR and oz > GRAZING:
        # The same with Smith's G1 for Beckmann [Walter07, eq. 27].
        alpha = np.float32(q[ROUGH_ALPHA])
        masked = np.float32(0.25) * _beckmann_g1(oz, alpha) / oz
        for i in range(x.shape[0]):
            weights[i] *= masked * _beckmann_g1(max(z[i], np.float32(0.0)), alpha)
    elif model_kind == ASHIKHMIN_SHIRLEY and oz > GRAZING:
        # Schlick's Fresnel term / (8π cosθ_d max(cosθ_i, cosθ_o)), without the lobe [BenArtzi07, eq. 3.3].
        facing = np.float32(q[FACING_REFLECTANCE])
        for i in range(x.shape[0]):
            c = max(z[i], np.float32(0.0))
            sx, sy, sz = x[i] + ox, y[i] + oy, z[i] + oz
            cos_d = min(np.float32(0.5) * np.sqrt(sx * sx + sy * sy + sz * sz), np.float32(1.0))
            away = np.float32(1.0) - cos_d
            away2 = away * away
            fresnel = facing + (np.float32(1.0) - facing) * away2 * away2 * away
            weights[i] *= np.float32(0.125 / math.pi) * fresnel * c / (max(cos_d, np.float32(1e-6)) * max(c, oz))
    else:
        for i in range(x.shape[0]):
            weights[i] *= np.float32(model_quotient_cosine(model_kind, q, x[i], y[i], z[i], ox, oy, oz))
    _rise(q, x, y, z, ox, oy, oz, weights)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def tint(colours_number, q, lights, x, y, z, ox, oy, oz, weights, colours, quotients, tinted):
    """tinted[m] = ρ_q cosθ · colours[m] of each light m, for a model whose quotient differs by colour channel.

    colours_number: the look-up (`engine.material._kernels.colours_number`), which writes quotients (n, 3); weights (n,)
    take the factors common to all channels.
    """
    n = x.shape[0]
    call_colours(colours_number, q, n, x, y, z, ox, oy, oz, quotients)
    for i in range(n):
        for channel in range(3):
            tinted[lights[i], channel] = colours[lights[i], channel] * quotients[i, channel]
    _rise(q, x, y, z, ox, oy, oz, weights)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def _rise(q, x, y, z, ox, oy, oz, weights):
    """weights (n,) *= (1 - cos θ_d)^5 where the layer is the second Fresnel term."""
    if q[FRESNEL_TERM] > 0.0:
        for i in range(x.shape[0]):
            sx, sy, sz = x[i] + ox, y[i] + oy, z[i] + oz
            away = max(np.float32(1.0) - np.float32(0.5) * np.sqrt(sx * sx + sy * sy + sz * sz), np.float32(0.0))
            away2 = away * away
            weights[i] *= away2 * away2 * away


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def slope(kind):
    """The rate of change of γ with the light's direction, where γ is a cone about an axis; 0 for other angles.

    γ_α and γ_β vanish along lines, not at points: there the triangle's corners describe everything but the crease
    itself.
    """
    if kind == THETA_H or kind == THETA_D:
        return np.float32(0.5)
    return np.float32(1.0) if kind == THETA_I or kind == THETA_R else np.float32(0.0)


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def is_highlight(kind):
    """Whether a curve over γ reflects the surroundings like a mirror: its lobe may be as narrow as its bands."""
    return kind != THETA_I and kind != THETA_D and kind != THETA_O and kind != PHI_D


@nb.njit(cache=True, nogil=True, error_model="numpy", inline="always")
def is_cone(kind):
    """Whether γ is, up to a factor, the angle from one direction, so that it changes at the same rate everywhere."""
    return kind == THETA_I or kind == THETA_R or kind == THETA_D
