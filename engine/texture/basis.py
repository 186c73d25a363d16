"""KTX 2 images whose texels Basis Universal compresses, ETC1S or UASTC, as glTF's KHR_texture_basisu has them.

The library that decodes them is native: it runs where the program decides (`engine.core.native_decoders`). It is
opengl-basisu. alktx2 decodes the same texels, of ETC1S and of UASTC; it is four times as large, and makes PNG files of
them.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np

from engine.core.errors import LoadError
from engine.core.native_decoders import Arrays, DecoderError, decode_natively

_ZSTANDARD = 2
KTX2_MAGIC = b"\xabKTX 20\xbb\r\n\x1a\n"


def ktx2_size(data: bytes, file: Path | str) -> tuple[int, int]:
    """(width, height) of a KTX 2 file, by its header; raises LoadError if its texels are not those of Basis Universal,
    which have no format of Vulkan."""
    if len(data) < 48:
        raise LoadError(file, "KTX 2 header", f"truncated at byte {len(data)}", "80 bytes")
    vulkan_format, _, width, height, _, _, _, _, scheme = struct.unpack_from("<9I", data, 12)
    if vulkan_format != 0 or scheme > _ZSTANDARD:
        found = f"format {vulkan_format} packed by scheme {scheme}"
        raise LoadError(file, "KTX 2 image", found, "texels of Basis Universal, ETC1S or UASTC")
    return width, height


def open_ktx2(data: bytes, file: Path | str) -> Any:
    """A picture (PIL) of the largest level, with alpha if any texel has it; raises LoadError."""
    from PIL import Image

    width, height = ktx2_size(data, file)
    try:
        pixels = decode_natively(decode_basis, data).get("pixels", np.zeros(0))
    except DecoderError as error:
        raise LoadError(file, "KTX 2 image", str(error), "texels of Basis Universal, ETC1S or UASTC") from None
    if pixels.dtype != np.uint8 or pixels.shape != (height, width, 4):
        raise LoadError(file, "KTX 2 image", f"decoded as {pixels.shape}", f"{width} x {height} pixels")
    picture = Image.fromarray(pixels)
    return picture if pixels[..., 3].min() < 255 else picture.convert("RGB")


def decode_basis(data: bytes) -> Arrays:
    """The texels (height, width, 4) of the largest level; for `decode_natively`."""
    try:
        import opengl_basisu
    except ImportError:
        raise DecoderError("opengl-basisu is not installed: it has no wheel for some systems") from None

    texture = opengl_basisu.open(data)
    return {"pixels": np.asarray(texture.transcode(opengl_basisu.Target.RGBA8).data)}
