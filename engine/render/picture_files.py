"""Pictures as the bytes of files: OpenEXR for linear radiance, PNG for the screen.

The OpenEXR library raises no error when the disk is full; so it writes into memory, and the bytes go to disk like all
others.
"""

import io
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import ToneMapping
from engine.render.display import display_picture


def exr_bytes(radiance: NDArray[np.float32], comment: str = "") -> bytes:
    """An OpenEXR file of linear radiance (H, W, 3), all values finite: 32-bit channels R, G, B, ZIP-compressed.

    comment: for the file's header, if not empty.
    """
    import OpenEXR

    if radiance.ndim != 3 or radiance.shape[2] != 3 or not np.isfinite(radiance).all():
        raise ValueError(f"radiance has shape {radiance.shape}, expected (H, W, 3) and every value finite")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header |= {"comments": comment} if comment else {}
    buffer = io.BytesIO()
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(radiance, np.float32)}).write(buffer)
    return buffer.getvalue()


def png_bytes(radiance: NDArray[np.float32], exposure: float = 0.0, tone_mapping: ToneMapping = "filmic") -> bytes:
    """A PNG, 8-bit sRGB, of linear radiance (H, W, 3) as the editor's viewport shows it."""
    return pixels_png(display_picture(radiance, exposure, tone_mapping))


def deep_png(values: NDArray[np.floating]) -> bytes:
    """A PNG, 16 bits a channel, of sRGB-encoded values (H, W, 3) in [0, 1].

    Written here [W3C PNG, third edition]: Pillow has no 16-bit RGB, and the libraries that do are far larger than these
    lines or unmaintained. Rows are stored as differences to the row above, which compresses smooth pictures.
    """
    height, width, _ = values.shape
    rows = np.round(65535.0 * np.clip(values, 0.0, 1.0)).astype(">u2").view(np.uint8).reshape(height, -1)
    up = rows - np.concatenate([np.zeros_like(rows[:1]), rows[:-1]])
    lines = np.concatenate([np.full((height, 1), 2, np.uint8), up], axis=1)
    head = struct.pack(">IIBBBBB", width, height, 16, 2, 0, 0, 0)
    parts = ((b"IHDR", head), (b"sRGB", b"\0"), (b"IDAT", zlib.compress(lines.tobytes(), 6)), (b"IEND", b""))
    chunks = (
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in parts
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def pixels_png(pixels: NDArray[np.uint8]) -> bytes:
    """A PNG of pixels (H, W, 3), 8-bit sRGB."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()
