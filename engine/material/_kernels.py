"""Compiled angles and quotients of all models, called once for each pixel, light and vertex: about 10^8 times.

Scalar functions of one pair of unit directions in the local frame (z = normal): i towards the light, o towards the
camera. Quotients that a model defines in its own file are called by address. Kernels validate nothing. Results are
finite for every input: cosines are divisors only where the expression as a whole stays finite, so G / (cos_i cos_o)
cos_i is one expression and not a quotient of small numbers.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from threading import Lock
from typing import Any

import numpy as np
from llvmlite import ir
from numba import cfunc, config, njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from engine.material import kinds

THETA_I, THETA_R, THETA_H, THETA_D, THETA_O = kinds.THETA_I, kinds.THETA_R, kinds.THETA_H, kinds.THETA_D, kinds.THETA_O
GAMMA_ALPHA, GAMMA_BETA, GAMMA_RATIO = kinds.GAMMA_ALPHA, kinds.GAMMA_BETA, kinds.GAMMA_RATIO
GAMMA_WIDTH, STREAK = kinds.GAMMA_WIDTH, kinds.STREAK
ALPHA_ALONG, ALPHA_ACROSS = kinds.ALPHA_ALONG, kinds.ALPHA_ACROSS
LAMBERT, PHONG, BLINN_PHONG, COOK_TORRANCE = kinds.LAMBERT, kinds.PHONG, kinds.BLINN_PHONG, kinds.COOK_TORRANCE
SLOPE_U, SLOPE_V, PHI_H, PHI_D = kinds.SLOPE_U, kinds.SLOPE_V, kinds.PHI_H, kinds.PHI_D
ROUGH_CONDUCTOR, ASHIKHMIN_SHIRLEY = kinds.ROUGH_CONDUCTOR, kinds.ASHIKHMIN_SHIRLEY
ASHIKHMIN_SHIRLEY_RATIO = kinds.ASHIKHMIN_SHIRLEY_RATIO
ROUGH_DISTRIBUTION, ROUGH_ALPHA, BECKMANN = kinds.ROUGH_DISTRIBUTION, kinds.ROUGH_ALPHA, kinds.BECKMANN
FACING_REFLECTANCE, RATIO_EXPONENT, GRAZING = kinds.FACING_REFLECTANCE, kinds.RATIO_EXPONENT, kinds.GRAZING
RISES = kinds.FRESNEL_TERM

Float64Array = NDArray[np.float64]

HALF_PI = math.pi / 2
# Directions whose sum is shorter than 1e-12 count as opposite: their half vector is the normal.
OPPOSITE = 1e-24
INVERSE_PI = 1.0 / math.pi
INVERSE_8PI = 0.125 / math.pi

_compile: dict[str, Any] = {
    "cache": True,
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz", "arcp"},
}


@njit(inline="always", **_compile)
def _arc(root: float, x: float) -> float:
    """arccos(x) = sqrt(1 - x) P(x) for x in [0, 1], given root = sqrt(1 - x): error 2e-11, relative where it is small.

    The form of Abramowitz and Stegun's 4.4.46 with degree 11, interpolated at Chebyshev nodes; even and odd powers are
    separate, which halves the chain of dependent operations. With an accurate `root`, small angles keep all their
    digits.
    """
    x2 = x * x
    even = ((((0.001000347753385237 * x2 + 0.007475125487796199) * x2 + 0.01777265605470764) * x2
             + 0.03364374293377222) * x2 + 0.08904842825668113) * x2 + 1.570796326780991  # fmt: skip
    odd = ((((-0.0001386627554893494 * x2 - 0.003404063689231407) * x2 - 0.01244266221722986) * x2
            - 0.02414675789595814) * x2 - 0.05078908575738279) * x2 - 0.2146018325864669  # fmt: skip
    return root * (even + x * odd)


@njit(inline="always", **_compile)
def _angle(cosine: float, sin2: float) -> float:
    """The angle in [0, pi] from its cosine and squared sine; 1 - |cos| = sin^2 / (1 + |cos|)."""
    x = min(abs(cosine), 1.0)
    arc = _arc(math.sqrt(sin2 / (1.0 + x)), x)
    return arc if cosine >= 0.0 else math.pi - arc


@njit(inline="always", **_compile)
def _log_cosine_half(sx: float, sy: float, sz: float) -> float:
    """ln cos(theta_h) of the unnormalized half vector, at least -69 (cos = 1e-30)."""
    flat2 = sx * sx + sy * sy
    length2 = flat2 + sz * sz
    if length2 < OPPOSITE:
        return 0.0
    if sz <= 0.0:
        return -69.0
    sin2 = flat2 / length2
    if sin2 < 0.5:
        return 0.5 * math.log1p(-sin2)
    return max(math.log(sz / math.sqrt(length2)), -69.0)


@njit(inline="always", **_compile)
def _share_of_u(sx: float, sy: float) -> float:
    """cos(phi_h)^2; 1/2 if the half vector is the normal."""
    flat2 = sx * sx + sy * sy
    return sx * sx / flat2 if flat2 > 1e-300 else 0.5


@njit(inline="always", **_compile)
def _arc_of_power(exponent: float, log_cosine: float) -> float:
    """arccos(exp(exponent log_cosine)), with 1 - y from expm1."""
    logarithm = exponent * log_cosine
    if logarithm < -40.0:
        return HALF_PI
    rest = -math.expm1(logarithm)
    return _arc(math.sqrt(max(rest, 0.0)), 1.0 - rest)


@njit(**_compile)
def theta_r(ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
    """Angle between the mirror direction of wi and wo, by dot and cross product."""
    cx = -iy * oz - iz * oy
    cy = iz * ox + ix * oz
    cz = iy * ox - ix * oy
    return _angle(iz * oz - ix * ox - iy * oy, cx * cx + cy * cy + cz * cz)


@njit(inline="always", **_compile)
def theta_h(ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
    """Angle between half vector and normal; 0 for opposite directions."""
    sx, sy, sz = ix + ox, iy + oy, iz + oz
    flat2 = sx * sx + sy * sy
    length2 = flat2 + sz * sz
    if length2 < OPPOSITE:
        return 0.0
    inverse = 1.0 / math.sqrt(length2)
    return _angle(sz * inverse, flat2 * inverse * inverse)


@njit(inline="always", **_compile)
def theta_d(ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
    """Angle between wi and half vector: half of that between wi and wo."""
    sx, sy, sz = ix + ox, iy + oy, iz + oz
    dx, dy, dz = ix - ox, iy - oy, iz - oz
    return _angle(0.5 * math.sqrt(sx * sx + sy * sy + sz * sz), 0.25 * (dx * dx + dy * dy + dz * dz))


@njit(inline="always", **_compile)
def phi_d(ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
    """Azimuth of wi about the half vector, from the plane through half vector and normal, in [0, pi]; its period is pi.
    From the tangent where the half vector is the normal. By an arc cosine, which takes a quarter of the time of an arc
    tangent."""
    sx, sy, sz = ix + ox, iy + oy, iz + oz
    dx, dy, dz = ix - ox, iy - oy, iz - oz
    flat = math.sqrt(sx * sx + sy * sy)
    length = math.sqrt(flat * flat + sz * sz)
    # Rotate the difference i - o into the frame of the half vector; x is in the plane of half vector and normal.
    x, y = dx, dy
    if flat > 1e-9 * length and length > 1e-12:
        cosine, sine = sx / flat, sy / flat
        x = (sz * (cosine * dx + sine * dy) - flat * dz) / length
        y = cosine * dy - sine * dx
    square = x * x + y * y
    if square <= 0.0:
        return 0.0
    angle = _angle(x / math.sqrt(square), y * y / square)
    return math.pi - angle if y < 0.0 else angle


@njit(**_compile)
def gamma(kind: int, q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
    """The angle over which a curve of this kind runs (engine.material.kinds), radians in [0, pi], error 2e-11.

    Beyond pi/2 a curve has no bands: f is 0 there. The half vector of opposite directions is the normal. q (8,) are the
    layer's quotient parameters; GAMMA_RATIO, GAMMA_WIDTH and STREAK take numbers from them. Twice as fast in loops
    where the compiler knows `kind`, because they vectorize.
    """
    if kind == THETA_I:
        return _angle(iz, ix * ix + iy * iy)
    if kind == THETA_O:
        return _angle(oz, ox * ox + oy * oy)
    if kind == THETA_R:
        return theta_r(ix, iy, iz, ox, oy, oz)
    if kind == THETA_H:
        return theta_h(ix, iy, iz, ox, oy, oz)
    if kind == THETA_D:
        return theta_d(ix, iy, iz, ox, oy, oz)
    if kind == PHI_D:
        azimuth = phi_d(ix, iy, iz, ox, oy, oz)
        return min(azimuth, math.pi - azimuth)
    sx, sy, sz = ix + ox, iy + oy, iz + oz
    # Slopes of the half vector along tangent and bitangent: tan gamma = |h_x| / h_z or |h_y| / h_z.
    if kind == SLOPE_U or kind == SLOPE_V:
        return math.atan2(abs(sx if kind == SLOPE_U else sy), sz)
    # Of a streak that is alpha_t long and alpha_b wide: tan gamma^2 = ((alpha_b / alpha_t)^2 h_x^2 + h_y^2) / h_z^2.
    if kind == STREAK:
        lean = sx * q[ALPHA_ACROSS] / q[ALPHA_ALONG]
        return math.atan2(math.sqrt(lean * lean + sy * sy), sz)
    # cos(phi_h)^2, the share of the exponent along the tangent.
    share = _share_of_u(sx, sy)
    if kind == PHI_H:
        return _angle(math.sqrt(share), 1.0 - share)
    # gamma_alpha [BenArtzi07, eq. 3.7], gamma_beta [BenArtzi07, eq. 3.8] and gamma_r [BenArtzi07, eq. 3.15]:
    # arccos(cos(theta_h)^exponent) with the exponents cos^2 phi_h, sin^2 phi_h and n sin^2 phi_h; of the width
    # cos^2 phi_h + r sin^2 phi_h. Where n or r is negative the highlight is turned by 90 degrees.
    if kind == GAMMA_BETA:
        share = 1.0 - share
    elif kind == GAMMA_RATIO or kind == GAMMA_WIDTH:
        turned = share if q[RATIO_EXPONENT] < 0.0 else 1.0 - share
        share = abs(q[RATIO_EXPONENT]) * turned + (1.0 - turned if kind == GAMMA_WIDTH else 0.0)
    return _arc_of_power(share, _log_cosine_half(sx, sy, sz))


@njit(inline="always", **_compile)
def _cosine_difference(ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
    """cos(theta_d), at most 1: half the length of i + o."""
    sx, sy, sz = ix + ox, iy + oy, iz + oz
    return min(0.5 * math.sqrt(sx * sx + sy * sy + sz * sz), 1.0)


@njit(inline="always", **_compile)
def _rise(cosine: float) -> float:
    """(1 - cosine)^5."""
    x = 1.0 - cosine
    x2 = x * x
    return x2 * x2 * x


@njit(inline="always", **_compile)
def _schlick(facing: float, cosine: float) -> float:
    """Schlick's Fresnel factor [BenArtzi07, eq. 3.10]."""
    return facing + (1.0 - facing) * _rise(cosine)


@njit(inline="always", **_compile)
def _v_groove(ix: float, iy: float, iz: float, ox: float, oy: float, oz: float) -> float:
    """V-groove G / cos_o. With s = i + o: G = min(1, 4 (cos_i + cos_o) min(cos_i, cos_o) / s.s)."""
    sx, sy, sz = ix + ox, iy + oy, iz + oz
    length2 = sx * sx + sy * sy + sz * sz
    lean = 4.0 * sz * min(iz, oz)
    if lean >= length2:
        return 1.0 / oz
    if oz <= iz:
        return 4.0 * sz / length2
    return 4.0 * sz * (iz / oz) / length2


@njit(inline="always", **_compile)
def _smith_ggx(cosine: float, a2: float) -> float:
    """G1(cos) / (2 cos): 1 / (cos + sqrt(alpha^2 + (1 - alpha^2) cos^2)) [Walter07, eq. 34]."""
    return 1.0 / (cosine + math.sqrt(a2 + (1.0 - a2) * cosine * cosine))


@njit(inline="always", **_compile)
def _smith_beckmann(cosine: float, alpha: float) -> float:
    """G1(cos) / cos in the rational approximation [Walter07, eq. 27], with a = cos / slope multiplied out."""
    slope = alpha * math.sqrt(max(1.0 - cosine * cosine, 0.0))
    masked = cosine < 1.6 * slope
    numerator = 3.535 * slope + 2.181 * cosine if masked else 1.0
    denominator = slope * slope + 2.276 * slope * cosine + 2.577 * cosine * cosine if masked else cosine
    return numerator / denominator


@njit(inline="always", **_compile)
def _smith(q: Float64Array, iz: float, oz: float) -> float:
    """Smith's G cos_i / (4 cos_i cos_o)."""
    alpha = q[ROUGH_ALPHA]
    if q[ROUGH_DISTRIBUTION] == BECKMANN:
        return 0.25 * iz * _smith_beckmann(iz, alpha) * _smith_beckmann(oz, alpha)
    a2 = alpha * alpha
    return iz * _smith_ggx(iz, a2) * _smith_ggx(oz, a2)


@intrinsic
def _call_compiled(typingctx, address, q, ix, iy, iz, ox, oy, oz):  # type: ignore[no-untyped-def]
    """Call a compiled quotient by its address."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        array = context.make_array(signature.args[1])(context, builder, arguments[1])
        double = ir.DoubleType()
        function = ir.FunctionType(double, [array.data.type, *[double] * 6])
        pointer = builder.inttoptr(arguments[0], function.as_pointer())
        return builder.call(pointer, [array.data, *arguments[2:]])

    return types.float64(types.int64, q, *[types.float64] * 6), generate


_numbered: dict[int, Callable[..., float]] = {}
_compiled: dict[Callable[..., float | None], Any] = {}
_compiling = Lock()


def _call_plain(number: int, q: Float64Array, *directions: float) -> float:
    """For interpreted kernels (NUMBA_DISABLE_JIT)."""
    return _numbered[number](q, *directions)


_is_interpreted = bool(vars(config)["DISABLE_JIT"])
_call = _call_plain if _is_interpreted else _call_compiled


def quotient_number(quotient: Callable[..., float]) -> int:
    """The number that identifies a model's own quotient in kernels, plain Python with `math`: the address of its
    compiled form.

    It is called by address and not from a chain of all models, so that unused models are never compiled, and a further
    model does not recompile every kernel that reflects. The call takes 2 ns. Compiled quotients are never freed:
    kernels do not own what they call.
    """
    if _is_interpreted:
        _numbered[id(quotient)] = quotient
        return id(quotient)
    signature = types.float64(types.CPointer(types.float64), *[types.float64] * 6)
    with _compiling:
        if quotient not in _compiled:
            compiler = cfunc(signature, cache=True, error_model="numpy", fastmath=_compile["fastmath"])
            _compiled[quotient] = compiler(quotient)
        return int(_compiled[quotient].address)


def colours_number(quotients: Callable[..., None]) -> int:
    """As `quotient_number`, for a function that fills in the quotients of each colour for many directions (see
    `call_colours`); 0 if kernels are interpreted."""
    if _is_interpreted:
        return 0
    doubles, singles = types.CPointer(types.float64), types.CPointer(types.float32)
    signature = types.void(doubles, types.int64, *[singles] * 3, *[types.float64] * 3, singles)
    with _compiling:
        if quotients not in _compiled:
            compiler = cfunc(signature, cache=True, error_model="numpy", fastmath=_compile["fastmath"])
            _compiled[quotients] = compiler(quotients)
        return int(_compiled[quotients].address)


@intrinsic
def call_colours(typingctx, address, q, n, x, y, z, ox, oy, oz, out):  # type: ignore[no-untyped-def]
    """Fill out (n, 3) with rho_q cos_i of each colour for the first n of x, y, z, by the function at this address."""

    def generate(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
        def data(place):  # type: ignore[no-untyped-def]
            return context.make_array(signature.args[place])(context, builder, arguments[place]).data

        q_, x_, y_, z_, out_ = (data(place) for place in (1, 3, 4, 5, 9))
        double, long = ir.DoubleType(), ir.IntType(64)
        kinds_ = [q_.type, long, x_.type, y_.type, z_.type, double, double, double, out_.type]
        pointer = builder.inttoptr(arguments[0], ir.FunctionType(ir.VoidType(), kinds_).as_pointer())
        builder.call(pointer, [q_, arguments[2], x_, y_, z_, *arguments[6:9], out_])
        return context.get_dummy_value()

    doubles = [types.float64] * 3
    return types.void(types.int64, q, types.int64, x, y, z, *doubles, out), generate


@njit(**_compile)
def quotient_cosine(
    model_kind: int, q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float
) -> float:
    """rho_q(wi, wo) cos_i of a layer, finite everywhere: its model's, for a second Fresnel term (q[RISES]) times (1 -
    cos theta_d)^5 [BenArtzi07, eq. 3.12].

    q (8,) are the layer's quotient parameters; model_kind is its model's number, see `model_quotient_cosine`.
    """
    quotient = model_quotient_cosine(model_kind, q, ix, iy, iz, ox, oy, oz)
    if q[RISES] > 0.0:
        quotient *= _rise(_cosine_difference(ix, iy, iz, ox, oy, oz))
    return quotient


@njit(**_compile)
def model_quotient_cosine(
    model_kind: int, q: Float64Array, ix: float, iy: float, iz: float, ox: float, oy: float, oz: float
) -> float:
    """rho_q(wi, wo) cos_i of a model (engine.material.kinds) with its quotient parameters q (8,), finite everywhere.

    model_kind: the model's number (`quotient_number` gives it for models with their own quotient). 0 if either
    direction is below the horizon or within 1e-12 of it.
    """
    if iz <= GRAZING or oz <= GRAZING:
        return 0.0
    # Lambert: cos_i / pi. Phong: the quotient is 1.
    if model_kind == LAMBERT:
        return iz * INVERSE_PI
    if model_kind == ROUGH_CONDUCTOR:
        return _smith(q, iz, oz)
    if model_kind == PHONG:
        return iz * 1.0
    # Models that define their own quotient, by address.
    if model_kind > ASHIKHMIN_SHIRLEY_RATIO:
        return _call(model_kind, q, ix, iy, iz, ox, oy, oz)  # type: ignore[call-arg,no-any-return]
    # Cook-Torrance: G / (cos_i cos_o) [BenArtzi07, eq. 3.2], times cos_i.
    if model_kind == COOK_TORRANCE:
        return _v_groove(ix, iy, iz, ox, oy, oz)
    # Schlick's Fresnel term with a fixed facing reflectance [BenArtzi07, eq. 3.10].
    cos_d = _cosine_difference(ix, iy, iz, ox, oy, oz)
    fresnel = _schlick(q[FACING_REFLECTANCE], cos_d)
    # Blinn-Phong: F G / (4 cos_i cos_o), times cos_i.
    if model_kind == BLINN_PHONG:
        return 0.25 * fresnel * _v_groove(ix, iy, iz, ox, oy, oz)
    # Ashikhmin-Shirley: F / (8 pi (h.k) max(cos_i, cos_o)) [BenArtzi07, eq. 3.3], times cos_i.
    quotient = INVERSE_8PI * fresnel * iz / (max(cos_d, GRAZING) * max(iz, oz))
    if model_kind == ASHIKHMIN_SHIRLEY:
        return quotient
    # Ratio of exponents: also cos(theta_h)^(n cos^2 phi_h), which the edited curve does not contain.
    sx, sy, sz = ix + ox, iy + oy, iz + oz
    wide = _share_of_u(sx, sy)
    exponent = abs(q[RATIO_EXPONENT]) * (1.0 - wide if q[RATIO_EXPONENT] < 0.0 else wide)
    return quotient * math.exp(max(exponent * _log_cosine_half(sx, sy, sz), -80.0))


@njit(cache=True, nogil=True, error_model="numpy")
def curve_angles(kind: int, q: Float64Array, wi: Float64Array, wo: Float64Array, out: Float64Array) -> None:
    """Write gamma of a curve's kind for local directions wi, wo (N, 3) to out (N,)."""
    for i in range(len(wi)):
        out[i] = gamma(kind, q, wi[i, 0], wi[i, 1], wi[i, 2], wo[i, 0], wo[i, 1], wo[i, 2])


@njit(cache=True, nogil=True, error_model="numpy")
def quotient_cosines(kind: int, q: Float64Array, wi: Float64Array, wo: Float64Array, out: Float64Array) -> None:
    """Write rho_q cos_i of a model's kind for local directions wi, wo (N, 3) to out (N,)."""
    for i in range(len(wi)):
        out[i] = quotient_cosine(kind, q, wi[i, 0], wi[i, 1], wi[i, 2], wo[i, 0], wo[i, 1], wo[i, 2])
