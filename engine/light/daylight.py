"""The clear sky of Preetham, Shirley and Smits, its sun, and the ground below [Preetham99].

Luminance and chromaticity of the sky are Perez' function of the angles from the zenith, theta, and from the sun, gamma:

    F = (1 + A exp(B / cos theta)) (1 + C exp(D gamma) + E cos² gamma),    Y = Y_z F(theta, gamma) / F(0, theta_s),

with coefficients that are linear in turbidity, the haze of the air: 2 is clear, 10 is hazy. The model holds for a sun
above the horizon; below, the sky is that of sunset. Near the horizon, and under a low sun in haze, chromaticities can
leave Rec. 709: negative channels are 0.

The sun is a black body of 5,778 K behind the air, whose transmittance is that of the paper's appendix: molecules,
haze and ozone. Gases and water vapour, which absorb at the red end, are left out. Of two exponents there that are
printed as λ^(-4.08 m), the sense is λ^(-4.08) m.

Radiance is luminance / 683 lm/W, so that its luminance in Rec. 709 is that of the sky in W/(m² sr).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
RGB = tuple[float, float, float]

LEAST_TURBIDITY, MOST_TURBIDITY = 2.0, 10.0
LUMENS_A_WATT = 683.0
_LOWEST_COSINE = 1e-3
# Perez' A to E for Y, x and y: the slope over turbidity, and the constant.
_PEREZ = np.array([
    [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
    [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
    [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
])  # fmt: skip
# Chromaticities of the zenith: rows for turbidity squared, turbidity and 1, columns for theta_s cubed to 1.
_ZENITH = np.array([
    [[0.00166, -0.00375, 0.00209, 0.0], [-0.02903, 0.06377, -0.03202, 0.00394], [0.11693, -0.21196, 0.06052, 0.25886]],
    [[0.00275, -0.00610, 0.00317, 0.0], [-0.04214, 0.08970, -0.04153, 0.00516], [0.15346, -0.26756, 0.06670, 0.26688]],
])  # fmt: skip
_RGB_OF_XYZ = np.array([
    [3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]
])  # fmt: skip
# Absorption of ozone in 1/cm every 10 nm from 380 to 750 nm, and its amount in cm.
_OZONE = np.array([
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.003, 0.006, 0.009, 0.014, 0.021, 0.030, 0.040, 0.048, 0.063, 0.075, 0.085,
    0.103, 0.120, 0.120, 0.115, 0.125, 0.120, 0.105, 0.090, 0.079, 0.067, 0.057, 0.048, 0.036, 0.028, 0.023, 0.018,
    0.014, 0.011, 0.010, 0.009,
])  # fmt: skip
_OZONE_CM = 0.35
_NANOMETRES = np.arange(380.0, 751.0, 10.0)
_SUN_KELVIN, _SUN_RADIUS, _SUN_DISTANCE = 5778.0, 6.957e8, 1.495978707e11


def zenith_luminance(turbidity: float, sun_elevation: float) -> float:
    """Luminance of the zenith, kcd/m², under a sun of this elevation in degrees; never negative."""
    theta = _sun_angle(sun_elevation)
    chi = (4.0 / 9.0 - turbidity / 120.0) * (math.pi - 2.0 * theta)
    return max((4.0453 * turbidity - 4.9710) * math.tan(chi) - 0.2155 * turbidity + 2.4192, 0.0)


def sky_radiance(directions: Float64Array, sun: Float64Array, turbidity: float) -> Float64Array:
    """Radiance (N, 3) of the sky in unit directions (N, 3) above the horizon, +Y up; sun (3,): towards it."""
    elevation = math.degrees(math.asin(min(max(float(sun[1]), -1.0), 1.0)))
    theta_s = _sun_angle(elevation)
    cosine = np.maximum(directions[:, 1], _LOWEST_COSINE)
    cos_gamma = np.clip(directions @ sun, -1.0, 1.0)
    gamma = np.arccos(cos_gamma)
    powers = np.array([turbidity**2, turbidity, 1.0]), np.array([theta_s**3, theta_s**2, theta_s, 1.0])
    zenith = [zenith_luminance(turbidity, elevation), *(powers[0] @ each @ powers[1] for each in _ZENITH)]
    luminance, x, y = (
        value * _perez(coefficients, cosine, gamma, cos_gamma)
        / _perez(coefficients, np.ones(1), np.array([theta_s]), np.array([math.cos(theta_s)]))
        for value, coefficients in zip(zenith, _PEREZ @ np.array([turbidity, 1.0]), strict=True)
    )  # fmt: skip
    y = np.maximum(y, 1e-6)
    xyz = np.stack([x / y, np.ones(len(y)), (1.0 - x - y) / y], axis=1) * (1000.0 / LUMENS_A_WATT * luminance)[:, None]
    return np.maximum(xyz @ _RGB_OF_XYZ.T, 0.0)


def _perez(
    coefficients: Float64Array, cosine: Float64Array, gamma: Float64Array, cos_gamma: Float64Array
) -> Float64Array:
    a, b, c, d, e = coefficients
    return np.asarray((1.0 + a * np.exp(b / cosine)) * (1.0 + c * np.exp(d * gamma) + e * cos_gamma**2))


def _sun_angle(elevation: float) -> float:
    """The sun's angle from the zenith, radians, at most 90°."""
    return math.radians(90.0 - min(max(elevation, 0.0), 90.0))


@lru_cache(maxsize=64)
def sun_irradiance(turbidity: float, elevation: float) -> RGB:
    """Irradiance of a surface that faces the sun, in Rec. 709 as above; 0 for a sun below the horizon."""
    if elevation <= 0.0:
        return 0.0, 0.0, 0.0
    micrometres = _NANOMETRES * 1e-3
    # A black body at the sun's distance, W/m² per nanometre.
    metres = _NANOMETRES * 1e-9
    planck = 2.0 * 6.62607015e-34 * 2.99792458e8**2 / metres**5
    planck /= np.expm1(6.62607015e-34 * 2.99792458e8 / (metres * 1.380649e-23 * _SUN_KELVIN))
    spectrum = math.pi * (_SUN_RADIUS / _SUN_DISTANCE) ** 2 * planck * 1e-9
    # Relative optical mass of the air.
    angle = 90.0 - elevation
    mass = 1.0 / (math.cos(math.radians(angle)) + 0.15 * (93.885 - angle) ** -1.253)
    molecules = 0.008735 * micrometres**-4.08
    haze = (0.04608 * turbidity - 0.04586) * micrometres**-1.3
    spectrum *= np.exp(-mass * (molecules + haze + _OZONE * _OZONE_CM))
    xyz = 10.0 * _matching_functions(_NANOMETRES) @ spectrum
    red, green, blue = np.maximum(_RGB_OF_XYZ @ xyz, 0.0).tolist()
    return red, green, blue


def _matching_functions(nanometres: Float64Array) -> Float64Array:
    """CIE 1931 colour matching functions (3, N) as sums of lobes [Wyman13]."""

    def lobe(centre: float, below: float, above: float) -> Float64Array:
        return np.asarray(np.exp(-0.5 * ((nanometres - centre) / np.where(nanometres < centre, below, above)) ** 2))

    return np.stack([
        1.056 * lobe(599.8, 37.9, 31.0) + 0.362 * lobe(442.0, 16.0, 26.7) - 0.065 * lobe(501.1, 20.4, 26.2),
        0.821 * lobe(568.8, 46.9, 40.5) + 0.286 * lobe(530.9, 16.3, 31.1),
        1.217 * lobe(437.0, 11.8, 36.0) + 0.681 * lobe(459.0, 26.0, 13.8),
    ])  # fmt: skip


@lru_cache(maxsize=16)
def horizontal_irradiance(turbidity: float, elevation: float, sun: float) -> RGB:
    """Irradiance of the ground by sky and sun; sun: a factor of the latter."""
    n = 64
    theta = 0.5 * math.pi * (np.arange(n) + 0.5) / n
    phi = 2.0 * math.pi * (np.arange(2 * n) + 0.5) / (2 * n)
    up, around = (each.ravel() for each in np.meshgrid(theta, phi, indexing="ij"))
    directions = np.stack([np.sin(up) * np.sin(around), np.cos(up), -np.sin(up) * np.cos(around)], axis=1)
    angle = _sun_angle(elevation)
    radiance = sky_radiance(directions, np.array([0.0, math.cos(angle), -math.sin(angle)]), turbidity)
    weights = np.cos(up) * np.sin(up) * (0.5 * math.pi / n) * (math.pi / n)
    total = weights @ radiance + sun * math.cos(angle) * np.array(sun_irradiance(turbidity, elevation))
    red, green, blue = total.tolist()
    return red, green, blue
