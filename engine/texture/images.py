"""Reading textures and weight maps: PNG, JPEG and OpenEXR, from files that may be hostile or broken.

Told by content, not by name. The header is read, and the size it claims refused, before a pixel is decoded: a file of
600 kB can hold a square of 13,000. Numbers leave linear: 8-bit images are decoded by sRGB (IEC 61966-2-1) unless told
otherwise, 16-bit and OpenEXR images are linear unless told otherwise.
"""

from __future__ import annotations

import io
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.colour import decode_srgb
from engine.errors import LoadError
from engine.light.image_files import read_radiance_image
from engine.material.maps import Space

MAX_IMAGE_BYTES = 256 * 2**20
MAX_SIDE = 16_384
# What an image costs goes by its pixels, not by its file: so many take about 1 s of processor time and 200 MB, also
# where they are blank and come in 60 kB. A camera's pictures have as many.
MAX_PIXELS = 1 << 24
BRIGHTEST = 1e4
_MAGIC = {b"\x89PNG\r\n\x1a\n": "PNG", b"\xff\xd8\xff": "JPEG", b"\x76\x2f\x31\x01": "EXR"}
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)

Image = NDArray[np.float32]


def read_texture(data: bytes, file: Path | str, space: Space = "") -> Image:
    """A colour image as linear Rec. 709, (H, W, 3), row 0 on top; raises LoadError naming `file`."""
    values = file_values(data, file)
    as_srgb = (space or ("srgb" if values.dtype == np.uint8 else "linear")) == "srgb"
    linear = _shares(values, as_srgb)
    return checked(np.repeat(linear, 3, axis=2) if linear.shape[2] == 1 else linear, file)


def read_weight(data: bytes, file: Path | str) -> Image:
    """A grey image of shares in [0, 1], (H, W, 1), row 0 on top; of a colour image its luminance."""
    return np.minimum(checked(grey_shares(file_values(data, file)), file), np.float32(1.0))


def grey_shares(values: NDArray[np.generic]) -> Image:
    """Numbers of a file as grey shares of the largest, linear, (H, W, 1); of colours their luminance."""
    shares = _shares(values, as_srgb=False)
    return shares if shares.shape[2] == 1 else (shares @ _LUMINANCE)[..., None]


def image_size(data: bytes, file: Path | str) -> tuple[int, int] | None:
    """(width, height) by the header of a PNG or a JPEG, nothing decoded; None for bytes that begin as neither."""
    kind = _kind(data)
    if kind not in ("PNG", "JPEG"):
        return None
    with _opened(data, file, kind) as picture:
        width, height = picture.size
        return width, height


def _shares(values: NDArray[np.generic], as_srgb: bool) -> Image:
    """Numbers of a file, integers as shares of the largest, decoded where they are sRGB."""
    if values.dtype == np.uint8:
        codes = np.arange(256, dtype=np.float32) / np.float32(255.0)
        return (decode_srgb(codes) if as_srgb else codes)[values]
    shares = np.asarray(values, np.float32) / np.float32(65535.0 if values.dtype == np.uint16 else 1.0)
    return decode_srgb(shares) if as_srgb else shares


def file_values(data: bytes, file: Path | str) -> NDArray[np.generic]:
    """The numbers (H, W, 1 or 3) as the file has them: uint8, uint16 or float32."""
    kind = _kind(data)
    if not kind:
        raise LoadError(file, "first bytes", data[:8], "a PNG, JPEG or OpenEXR image")
    return _read_exr(data, file) if kind == "EXR" else _read_integers(data, file, kind)


def _kind(data: bytes) -> str:
    """PNG, JPEG or EXR, as the bytes begin; "" for others."""
    return next((name for magic, name in _MAGIC.items() if data.startswith(magic)), "")


def _read_integers(data: bytes, file: Path | str, kind: str) -> NDArray[np.generic]:
    """A PNG or a JPEG."""
    with _opened(data, file, kind) as picture:
        return _integers(picture)


@contextmanager
def _opened(data: bytes, file: Path | str, kind: str) -> Iterator[Any]:
    """A picture of a size that may be read; what the library says of it becomes a LoadError."""
    from PIL import Image as Pictures

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Pictures.DecompressionBombWarning)  # the size is judged here
            with Pictures.open(io.BytesIO(data), formats=[kind]) as opened:
                _check_size(*opened.size, file)
                yield opened
    except LoadError:
        raise
    except Pictures.DecompressionBombError:
        raise LoadError(file, "image size", "too many pixels", f"at most {MAX_PIXELS} pixels") from None
    except Exception as error:  # the library raises OSError, ValueError, SyntaxError, struct.error and its own
        raise LoadError(file, f"{kind} image", str(error), "a whole image, not cut off or damaged") from None


def _integers(opened: Any) -> NDArray[np.generic]:
    """(H, W, 1 or 3) uint8, of a grey image of 16 bits uint16; transparency is left out."""
    if opened.mode.startswith("I"):
        return np.asarray(opened).astype(np.uint16)[..., None]
    if opened.mode in ("1", "L", "LA"):
        return np.asarray(opened.convert("L"))[..., None]
    return np.asarray(opened.convert("RGB"))


def _read_exr(data: bytes, file: Path | str) -> Image:
    """By the reader of environments, which takes files: the bytes in one of their own."""
    with tempfile.NamedTemporaryFile(suffix=".exr") as copy:
        copy.write(data)
        copy.flush()
        try:
            pixels = read_radiance_image(Path(copy.name))
        except LoadError as error:
            raise LoadError(file, error.what, error.value, error.expected) from None
    _check_size(pixels.shape[1], pixels.shape[0], file)
    return pixels


def _check_size(width: int, height: int, file: Path | str) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE and width * height <= MAX_PIXELS):
        expected = f"sides of 1 to {MAX_SIDE} and at most {MAX_PIXELS} pixels"
        raise LoadError(file, "image size", f"{width} x {height}", expected)


def checked(pixels: Image, file: Path | str) -> Image:
    """The pixels if all are usable factors; raises LoadError."""
    good = (pixels >= 0.0) & (pixels <= BRIGHTEST)  # false for NaN too
    if not good.all():
        row, column, _ = np.unravel_index(int(np.argmin(good)), pixels.shape)
        expected = f"finite numbers from 0 to {BRIGHTEST:g}"
        raise LoadError(file, f"pixel ({column}, {row})", pixels[row, column].tolist(), expected)
    return np.ascontiguousarray(pixels, np.float32)
