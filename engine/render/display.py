"""From linear radiance to display values and picture files: pictures in files appear as in the window.

Exposure in stops, then the view: Narkowicz' fit of the ACES reference rendering on the brightest and darkest channel, a
plain clamp, or a view of OpenColorIO (`engine.core.colour`); then sRGB (IEC 61966-2-1).
shaders/common/tone_mapping.glsl does the same, and slow twins test both. Relative errors are shown in false colours, as
light of which `false_colour` has a shade for each factor of 1.4.

Files are OpenEXR for linear radiance, PNG for the screen. The OpenEXR library raises no error when the disk is full; so
it writes into memory, and the bytes go to disk like all others.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from engine.core.colour import TABULATED_VIEWS, AnyView, ConfigView, display_transform, encode_srgb
from engine.core.colour_config import config_transform
from engine.light.environment import LUMINANCE
from engine.render.crop import Crop, cropped

BRIGHTEST = 1e4
# In false colours: the error whose colour is that of radiance 1, and the ends of the scale.
MIDDLE_ERROR = 0.01
LEAST_ERROR, MOST_ERROR = MIDDLE_ERROR / 16.0, MIDDLE_ERROR * 16.0
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
    radiance: NDArray[np.floating], exposure: float = 0.0, tone_mapping: AnyView = "filmic"
) -> NDArray[np.uint8]:
    """Convert linear Rec. 709 radiance (H, W, 3) to 8-bit sRGB; exposure in stops, clamped to ±64."""
    return np.round(255.0 * display_values(radiance, exposure, tone_mapping)).astype(np.uint8)


def display_values(
    radiance: NDArray[np.floating], exposure: float = 0.0, tone_mapping: AnyView = "filmic"
) -> NDArray[np.floating]:
    """The same as floats in [0, 1]."""
    exposed = np.asarray(radiance, np.float64) * 2.0 ** min(max(exposure, -64.0), 64.0)
    if isinstance(tone_mapping, ConfigView):
        return config_transform(exposed, tone_mapping)
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


def error_to_radiance(share: ArrayLike) -> NDArray[np.float64]:
    """Radiance that represents a relative error: proportional to its square."""
    return np.asarray((np.asarray(share, np.float64) / MIDDLE_ERROR) ** 2)


class PictureLayer(NamedTuple):
    """A layer of a picture: values (H, W, n), or (H, W) for one channel, and the letters of its channels, such as
    "RGB", "XYZ" or "Z". The channels are named "name.R" and so on, without a name "R"."""

    name: str
    letters: str
    values: NDArray[np.floating]

    def channels(self) -> dict[str, NDArray[np.float32]]:
        """Each channel (H, W) by its name. Raises ValueError for another number of channels, or values that are not
        finite."""
        planes = self.values[..., None] if self.values.ndim == 2 else self.values
        if planes.ndim != 3 or planes.shape[2] != len(self.letters) or not np.isfinite(planes).all():
            what = self.name or "radiance"
            expected = f"(H, W, {len(self.letters)}) and every value finite"
            raise ValueError(f"{what} has shape {self.values.shape}, expected {expected}")
        prefix = f"{self.name}." if self.name else ""
        return {
            prefix + letter: np.ascontiguousarray(planes[..., i], np.float32) for i, letter in enumerate(self.letters)
        }


def exr_bytes(
    radiance: NDArray[np.float32], comment: str = "", layers: Iterable[PictureLayer] = (), crop: Crop | None = None
) -> bytes:
    """An OpenEXR file of linear radiance (H, W, 3), all values finite: 32-bit channels R, G, B, ZIP-compressed, and
    those of more layers, whose names differ. With alpha (H, W, 4), which is multiplied into the light, also A.

    comment: for the file's header, if not empty; crop: what is written of it, as a data window in the display window
    of the whole.
    """
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    if crop is not None:
        size = radiance.shape[1], radiance.shape[0]
        x, y, width, height = crop.box(size)
        windows = {"dataWindow": (x, y, width, height), "displayWindow": (0, 0, *size)}
        header |= {
            name: (np.array([x, y], np.int32), np.array([x + w - 1, y + h - 1], np.int32))
            for name, (x, y, w, h) in windows.items()
        }
    header |= {"comments": comment} if comment else {}
    channels: dict[str, NDArray[np.float32]] = {}
    for layer in (PictureLayer("", "RGBA" if radiance.shape[2:] == (4,) else "RGB", radiance), *layers):
        channels |= layer._replace(values=cropped(layer.values, crop)).channels()
    buffer = io.BytesIO()
    OpenEXR.File(header, channels).write(buffer)
    return buffer.getvalue()


def png_bytes(
    radiance: NDArray[np.float32], exposure: float = 0.0, tone_mapping: AnyView = "filmic", gamma: float = 1.0
) -> bytes:
    """A PNG, 8-bit sRGB, of linear radiance (H, W, 3) as the editor's viewport shows it; with alpha (H, W, 4), by which
    PNG does not multiply its colours."""
    if radiance.shape[2] == 3:
        shown = display_values(radiance, exposure, tone_mapping) ** (1.0 / gamma)
        return pixels_png(np.round(255.0 * shown).astype(np.uint8))
    colour, alpha = without_alpha(radiance)
    shown = display_values(colour, exposure, tone_mapping) ** (1.0 / gamma)
    return pixels_png(np.round(255.0 * np.concatenate([shown, alpha], axis=2)).astype(np.uint8))


def without_alpha(radiance: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The colours (H, W, 3) of what covers pixels, black where nothing does, and alpha (H, W, 1), of radiance that
    alpha is multiplied into (H, W, 4)."""
    light, alpha = np.split(np.asarray(radiance, np.float64), [3], axis=2)
    return np.divide(light, alpha, out=np.zeros_like(light), where=alpha > 0.0), np.clip(alpha, 0.0, 1.0)


def deep_png(values: NDArray[np.floating]) -> bytes:
    """A PNG, 16 bits a channel, of sRGB-encoded values (H, W, 3) in [0, 1], or with alpha (H, W, 4).

    Written here [W3C PNG, third edition]: Pillow has no 16-bit RGB, and the libraries that do are far larger than these
    lines or unmaintained. Rows are stored as differences to the row above, which compresses smooth pictures.
    """
    height, width, n_channels = values.shape
    colour_type = 6 if n_channels == 4 else 2  # truecolour, with alpha or without
    rows = np.round(65535.0 * np.clip(values, 0.0, 1.0)).astype(">u2").view(np.uint8).reshape(height, -1)
    up = rows - np.concatenate([np.zeros_like(rows[:1]), rows[:-1]])
    lines = np.concatenate([np.full((height, 1), 2, np.uint8), up], axis=1)
    head = struct.pack(">IIBBBBB", width, height, 16, colour_type, 0, 0, 0)
    parts = ((b"IHDR", head), (b"sRGB", b"\0"), (b"IDAT", zlib.compress(lines.tobytes(), 6)), (b"IEND", b""))
    chunks = (
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in parts
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def pixels_png(pixels: NDArray[np.uint8]) -> bytes:
    """A PNG of pixels (H, W, 3), 8-bit sRGB, or with alpha (H, W, 4)."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()
