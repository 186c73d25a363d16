"""Writing pictures: OpenEXR for linear radiance, PNG for the screen.

A full disk raises nothing in the OpenEXR library: what was written is opened again and compared bit by bit before it
counts as written.
"""

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.errors import InsituError, LoadError
from engine.light.image_files import read_radiance_image, silenced_library
from engine.render.display import ToneMapping, display_picture


def write_exr(path: Path, radiance: NDArray[np.float32]) -> None:
    """Write linear radiance (H, W, 3) as 32-bit channels R, G, B, ZIP-compressed, and read it back.

    Raises InsituError when what stands on the disk is not what was given; the file is then not to be used.
    """
    import OpenEXR

    if radiance.ndim != 3 or radiance.shape[2] != 3 or not np.isfinite(radiance).all():
        raise ValueError(f"radiance has shape {radiance.shape}, expected (H, W, 3) and every value finite")
    pixels = np.ascontiguousarray(radiance, np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    complaint = ""
    with silenced_library():
        try:
            OpenEXR.File(header, {"RGB": pixels}).write(str(path))
        except Exception as error:  # the library raises RuntimeError, ValueError, TypeError and its own
            complaint = str(error).strip().replace("\n", " ")
    try:
        stands = np.array_equal(read_radiance_image(path), pixels)
    except LoadError as error:
        stands, complaint = False, complaint or str(error.value)
    if not stands:
        reason = complaint or "what stands there differs from the picture"
        raise InsituError(f"{path}: the picture was not written whole ({reason}); is the disk full?")


def png_bytes(radiance: NDArray[np.float32], exposure: float = 0.0, tone_mapping: ToneMapping = "filmic") -> bytes:
    """A PNG, 8 bits and sRGB, of linear radiance (H, W, 3) as the editor's viewport shows it."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(display_picture(radiance, exposure, tone_mapping)).save(buffer, "PNG")
    return buffer.getvalue()
