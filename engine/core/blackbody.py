"""The colour of a black body, by its temperature in kelvin."""

from __future__ import annotations

from functools import lru_cache

LEAST_KELVIN, MOST_KELVIN = 1667.0, 25000.0


@lru_cache(maxsize=256)  # asked for each light in each frame
def blackbody_colour(kelvin: float) -> tuple[float, float, float]:
    """Linear Rec. 709 of a black body between 1,667 and 25,000 K, of luminance 1: hot or cold, a light stays as bright.

    Its chromaticity is a cubic spline of the Planckian locus, within 0.001 of it [Kim02]. Below about 1,900 K blue
    would be negative: it is 0, and the others are a little less. ValueError for other temperatures.
    """
    if not LEAST_KELVIN <= kelvin <= MOST_KELVIN:
        raise ValueError(f"{kelvin:g} K, expected {LEAST_KELVIN:g} to {MOST_KELVIN:g}")
    u = 1e3 / kelvin
    if kelvin <= 4000.0:
        x = ((-0.2661239 * u - 0.2343589) * u + 0.8776956) * u + 0.179910
    else:
        x = ((-3.0258469 * u + 2.1070379) * u + 0.2226347) * u + 0.240390
    if kelvin <= 2222.0:
        y = ((-1.1063814 * x - 1.34811020) * x + 2.18555832) * x - 0.20219683
    elif kelvin <= 4000.0:
        y = ((-0.9549476 * x - 1.37418593) * x + 2.09137015) * x - 0.16748867
    else:
        y = ((3.0817580 * x - 5.87338670) * x + 3.75112997) * x - 0.37001483
    # CIE XYZ of luminance Y = 1, and from there to Rec. 709.
    big_x, big_z = x / y, (1.0 - x - y) / y
    red = 3.2404542 * big_x - 1.5371385 - 0.4985314 * big_z
    green = -0.9692660 * big_x + 1.8760108 + 0.0415560 * big_z
    blue = max(0.0556434 * big_x - 0.2040259 + 1.0572252 * big_z, 0.0)
    luminance = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    return red / luminance, green / luminance, blue / luminance
