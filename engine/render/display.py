"""From linear radiance to the screen's values, as shaders/common/tone_mapping.glsl does; one slow twin tests both.

Exposure in stops, then Narkowicz' fit of the ACES reference rendering or a plain clamp, then sRGB (IEC 61966-2-1).
False colours are for looking at numbers in the window, which reads them out; files have the numbers themselves.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

ToneMapping = Literal["filmic", "linear"]

BRIGHTEST = 1e4


def display_picture(
    radiance: NDArray[np.floating], exposure: float = 0.0, tone_mapping: ToneMapping = "filmic"
) -> NDArray[np.uint8]:
    """Linear Rec. 709 radiance (H, W, 3) as 8-bit sRGB; exposure in stops, held to ±64."""
    exposed = np.asarray(radiance, np.float64) * 2.0 ** min(max(exposure, -64.0), 64.0)
    mapped = filmic(exposed) if tone_mapping == "filmic" else np.clip(exposed, 0.0, 1.0)
    return np.round(255.0 * encode_srgb(mapped)).astype(np.uint8)


def filmic(radiance: NDArray[np.floating]) -> NDArray[np.float64]:
    """Narkowicz 2016: x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14), held to [0, 1]."""
    x = np.clip(np.asarray(radiance, np.float64), 0.0, BRIGHTEST)
    return np.clip((x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0)


def encode_srgb(linear: NDArray[np.floating]) -> NDArray[np.float64]:
    """IEC 61966-2-1 of values in [0, 1]."""
    linear = np.asarray(linear, np.float64)
    power = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, power)
