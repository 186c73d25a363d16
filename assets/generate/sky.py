"""A clear sky with its sun over a plain: the daylight model of Preetham et al. [Preetham99] and the sun's own light.

Photometric units are divided by EXPOSURE. The sun's disc (half a degree wide, 6.8e-5 sr) is smaller than a texel: its
energy is spread over a disc of one degree with a soft border, which fits half floats and keeps its irradiance.
"""

import numpy as np

from .mesh import Floats
from .panorama import HEIGHT, WIDTH, directions, panorama, smooth_step

TURBIDITY = 2.6
SUN_ELEVATION = np.radians(38.0)
SUN_AZIMUTH = np.radians(-52.0)  # left of the centre column
EXPOSURE = 25.0  # kcd/m² to a radiance of 1
SUN_ILLUMINANCE = 92.0  # klx on a surface that faces it, through this much air
SUN_TINT = np.array([1.08, 0.985, 0.83])
SUN_RADIUS = np.radians(0.75)
GROUND_ALBEDO = np.array([0.20, 0.175, 0.135])

# Distribution coefficients A..E as (slope, offset) in turbidity, for Y, x and y [Preetham99, appendix A.2].
PEREZ = {
    "Y": ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)),
    "x": ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)),
    "y": ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)),
}
# Zenith chromaticity: rows (T², T, 1), columns (θs³, θs², θs, 1) [Preetham99, appendix A.2].
ZENITH_X = (
    (0.00166, -0.00375, 0.00209, 0.0),
    (-0.02903, 0.06377, -0.03202, 0.00394),
    (0.11693, -0.21196, 0.06052, 0.25886),
)
ZENITH_Y = (
    (0.00275, -0.00610, 0.00317, 0.0),
    (-0.04214, 0.08970, -0.04153, 0.00516),
    (0.15346, -0.26756, 0.06670, 0.26688),
)
XYZ_TO_RGB = np.array(
    [[3.2404542, -1.5371385, -0.4985314], [-0.9692660, 1.8760108, 0.0415560], [0.0556434, -0.2040259, 1.0572252]]
)


def sun_direction() -> Floats:
    c = np.cos(SUN_ELEVATION)
    return np.array([c * np.sin(SUN_AZIMUTH), np.sin(SUN_ELEVATION), -c * np.cos(SUN_AZIMUTH)])


def _perez(name: str, cos_theta: Floats, gamma: Floats) -> Floats:
    """F(θ, γ) = (1 + A exp(B / cosθ)) (1 + C exp(Dγ) + E cos²γ) [Preetham99, eq. 3]."""
    a, b, c, d, e = (slope * TURBIDITY + offset for slope, offset in PEREZ[name])
    return (1 + a * np.exp(b / cos_theta)) * (1 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2)


def sky_radiance(d: Floats) -> Floats:
    """The sky's own radiance (N, 3) along directions above the horizon."""
    theta_s = np.pi / 2 - SUN_ELEVATION
    cos_theta = np.maximum(d[:, 1], 0.01)
    gamma = np.arccos(np.clip(d @ sun_direction(), -1, 1))
    chi = (4 / 9 - TURBIDITY / 120) * (np.pi - 2 * theta_s)
    t_powers, theta_powers = np.array([TURBIDITY**2, TURBIDITY, 1]), np.array([theta_s**3, theta_s**2, theta_s, 1])
    zenith = {
        "Y": (4.0453 * TURBIDITY - 4.9710) * np.tan(chi) - 0.2155 * TURBIDITY + 2.4192,
        "x": t_powers @ np.array(ZENITH_X) @ theta_powers,
        "y": t_powers @ np.array(ZENITH_Y) @ theta_powers,
    }
    above, sun_below_zenith = np.ones(1), np.array([theta_s])
    # The fit reddens the last degrees above the horizon: the colour of 8 degrees is kept below them.
    heights = {"Y": cos_theta, "x": np.maximum(cos_theta, 0.14), "y": np.maximum(cos_theta, 0.14)}
    luminance, x, y = (
        zenith[name] * _perez(name, height, gamma) / _perez(name, above, sun_below_zenith)
        for name, height in heights.items()
    )
    xyz = np.stack([x / y * luminance, luminance, (1 - x - y) / y * luminance], axis=-1)
    return np.maximum(xyz @ XYZ_TO_RGB.T, 0) / EXPOSURE


def _sky_irradiance() -> Floats:
    """∫ L cosθ dω of the sky alone on level ground, (3,)."""
    d = directions(64, 128)
    solid_angle = np.sqrt(1 - d[..., 1] ** 2) * (np.pi / 64) ** 2
    weight = (np.maximum(d[..., 1], 0) * solid_angle).reshape(-1, 1)
    return (sky_radiance(d.reshape(-1, 3)) * weight).sum(axis=0)


def sun_irradiance() -> Floats:
    """On a surface that faces the sun, (3,)."""
    return SUN_ILLUMINANCE / EXPOSURE * SUN_TINT


def picture() -> Floats:
    ground = GROUND_ALBEDO / np.pi * (_sky_irradiance() + sun_irradiance() * np.sin(SUN_ELEVATION))
    horizon = sky_radiance(np.array([[0.0, 0.01, -1.0]]))[0]

    def radiance(d: Floats) -> Floats:
        haze = smooth_step(-0.10, 0.0, d[:, 1])[:, None] ** 3
        below = ground * (1 - haze) + 0.8 * horizon * haze
        return np.where(d[:, 1:2] > 0, sky_radiance(d), below)

    return panorama(radiance) + _sun()


def _sun() -> Floats:
    """The sun's disc alone (HEIGHT, WIDTH, 3), scaled so that the picture's own quadrature gives its irradiance."""
    facing = sun_direction()

    def disc(d: Floats) -> Floats:
        angle = np.arccos(np.clip(d @ facing, -1, 1))
        return smooth_step(SUN_RADIUS, 0.4 * SUN_RADIUS, angle)[:, None] * np.ones(3)

    image = panorama(disc, samples=8)
    theta = np.pi * (np.arange(HEIGHT + 1)) / HEIGHT
    solid_angle = (np.cos(theta[:-1]) - np.cos(theta[1:])) * 2 * np.pi / WIDTH
    return image / (image[..., 0] * solid_angle[:, None]).sum() * sun_irradiance()
