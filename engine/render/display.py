"""From linear radiance to display values: pictures in files look as in the window.

Exposure in stops, then the view: Narkowicz' fit of the ACES reference rendering on the brightest and darkest channel, a
plain clamp, or a view of OpenColorIO (`engine.core.colour`); then sRGB (IEC 61966-2-1).
shaders/common/tone_mapping.glsl does the same, and slow twins test both.
"""

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import TABULATED_VIEWS, ToneMapping, display_transform, encode_srgb
from engine.light.environment import LUMINANCE

BRIGHTEST = 1e4
_DARKEST_STOP, _BRIGHTEST_STOP = -8.0, 8.0
# Polynomial fit of matplotlib's viridis, from the constant term on.
_VIRIDIS = np.array(
    [
        [0.2777273272, 0.0054073445, 0.3340998053],
        [0.1050930431, 1.4046135299, 1.3845901621],
        [-0.3308618287, 0.2148475595, 0.0950951630],
        [-4.6342304990, -5.7991009734, -19.3324409563],
        [6.2282699363, 14.1799333669, 56.6905526007],
        [4.7763849783, -13.7451453777, -65.3530326334],
        [-5.4354558559, 4.6458526121, 26.3124352496],
    ]
)


def display_picture(
    radiance: NDArray[np.floating], exposure: float = 0.0, tone_mapping: ToneMapping = "filmic"
) -> NDArray[np.uint8]:
    """Convert linear Rec. 709 radiance (H, W, 3) to 8-bit sRGB; exposure in stops, clamped to ±64."""
    return np.round(255.0 * display_values(radiance, exposure, tone_mapping)).astype(np.uint8)


def display_values(
    radiance: NDArray[np.floating], exposure: float = 0.0, tone_mapping: ToneMapping = "filmic"
) -> NDArray[np.floating]:
    """The same as floats in [0, 1]."""
    exposed = np.asarray(radiance, np.float64) * 2.0 ** min(max(exposure, -64.0), 64.0)
    if tone_mapping in TABULATED_VIEWS:
        return display_transform(exposed, tone_mapping)
    if tone_mapping == "false_colour":
        return false_colour(exposed)
    return encode_srgb(filmic(exposed) if tone_mapping == "filmic" else np.clip(exposed, 0.0, 1.0))


def filmic(radiance: NDArray[np.floating]) -> NDArray[np.float64]:
    """Narkowicz 2016 on the brightest and the darkest channel; the middle one keeps its relative position between them.

    f(x) = x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14), clamped to [0, 1]. Applied to each channel separately it
    would turn orange to yellow and gold to olive; the tone curve of Adobe's DNG SDK keeps hues in the same way.
    """
    x = np.clip(np.asarray(radiance, np.float64), 0.0, BRIGHTEST)
    high, low = x.max(axis=-1, keepdims=True), x.min(axis=-1, keepdims=True)
    top, bottom = (np.clip((v * (2.51 * v + 0.03)) / (v * (2.43 * v + 0.59) + 0.14), 0.0, 1.0) for v in (high, low))
    return bottom + (top - bottom) * (x - low) / np.maximum(high - low, 1e-20)


def false_colour(radiance: NDArray[np.floating]) -> NDArray[np.float64]:
    """log2 of luminance in bands of one stop from dark blue to yellow, the lower half of each slightly darker."""
    luminance = np.maximum(radiance, 0.0) @ LUMINANCE
    stops = np.clip(np.log2(np.maximum(luminance, 1e-12)), _DARKEST_STOP, _BRIGHTEST_STOP)
    t = ((stops - _DARKEST_STOP) / (_BRIGHTEST_STOP - _DARKEST_STOP))[..., None]
    colour = np.zeros((*stops.shape, 3))
    for coefficients in _VIRIDIS[::-1]:
        colour = colour * t + coefficients
    return np.clip(colour, 0.0, 1.0) * np.where(stops % 1.0 < 0.5, 0.85, 1.0)[..., None]
