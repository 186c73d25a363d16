"""Reads textures, weight maps, normal maps and heights: PNG, JPEG, WebP, KTX 2 and OpenEXR, from files that may be
hostile or broken.

The content determines the format, not the name. The header is read and its size checked before a pixel is decoded: a
file of 600 kB can contain a square of 13,000. An image of more than `MAX_PIXELS` is reduced to a half or a quarter of
its size, texels the means of the area that they cover, in linear values: a JPEG is not even decoded beyond that size,
others are converted in bands, very large OpenEXR images read in bands (`engine.light.radiance_files`). Values are
returned linear: 8-bit images are decoded by sRGB (IEC 61966-2-1) unless stated otherwise, 16-bit and OpenEXR images are
linear unless stated otherwise.

Normal maps and heights become slopes, the derivatives of a surface along u and v. Slopes can be averaged: their mean
over a pixel is the mean slope of what the pixel shows, where a mean of normals would need normalization. 8-bit and
16-bit codes have a centre that is exactly flat, 128 and 32,768, as painted maps intend; in OpenEXR it is 0.5. Normal
maps are never decoded by sRGB.
"""

from __future__ import annotations

import io
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import decode_srgb
from engine.core.errors import LoadError
from engine.core.safe_files import temporary_file
from engine.light import resampling
from engine.light.radiance_files import read_radiance_image
from engine.light.resampling import block_means
from engine.material.layer_maps import Channel, Space
from engine.texture.basis import KTX2_MAGIC, ktx2_size, open_ktx2

MAX_IMAGE_BYTES = 1 << 30
MAX_SIDE = 16_384
# An image's cost depends on its pixels, not on its file: this many take about 1 s of processor time and 200 MB, even if
# they are blank and come in 60 kB. A camera's pictures have as many; of larger images only means are stored.
MAX_PIXELS = 1 << 24
# 16,384 squared: decoded, a byte or four for each.
MOST_READ = 1 << 28
BRIGHTEST = 1e4
_ORIENTATION_TAG = 274  # of EXIF
_BAND_PIXELS = 1 << 22
_MAGIC = {
    b"\x89PNG\r\n\x1a\n": "PNG", b"\xff\xd8\xff": "JPEG", b"\x76\x2f\x31\x01": "EXR", b"RIFF": "WebP",
    KTX2_MAGIC: "KTX2",
}  # fmt: skip
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)

Image = NDArray[np.float32]


ReportNote = Callable[[str], None]
Values = NDArray[np.generic]


def ignore_note(note: str) -> None:
    """For callers who do not report that an image is reduced."""


def read_texture(data: bytes, file: Path | str, space: Space = "", report: ReportNote = ignore_note) -> Image:
    """A colour image as linear Rec. 709, (H, W, 3), row 0 on top; raises LoadError naming `file`."""

    def linear(values: Values) -> Image:
        return _shares(values, (space or ("srgb" if values.dtype == np.uint8 else "linear")) == "srgb")

    pixels = np.minimum(read_image(data, file, linear, report, is_colour=True), np.float32(BRIGHTEST))
    return np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels


def read_weight(data: bytes, file: Path | str, report: ReportNote = ignore_note, channel: Channel = "grey") -> Image:
    """Shares in [0, 1] from a channel of an image, (H, W, 1), row 0 on top, linear. grey: the luminance of a colour
    image; a: its opacity, 1 of an image that has none, and of OpenEXR images; max: the largest of its colours, those of
    8 bits decoded by sRGB."""

    def shares(values: Values) -> Image:
        if channel == "grey":
            return grey_shares(values)
        if channel == "max":
            return _shares(values, as_srgb=values.dtype == np.uint8).max(axis=2, keepdims=True)
        found = _shares(values, as_srgb=False)
        place = min("rgb".index(channel), found.shape[2] - 1)
        return found[..., place : place + 1]

    if channel == "a":
        return read_opacity(data, file, report) if has_alpha(data, file) else np.ones((1, 1, 1), np.float32)
    return np.minimum(read_image(data, file, shares, report), np.float32(1.0))


def read_opacity(data: bytes, file: Path | str, report: ReportNote = ignore_note) -> Image:
    """The alpha of an image, in [0, 1], (H, W, 1), row 0 on top; of one without alpha its luminance."""
    return np.minimum(read_image(data, file, grey_shares, report, is_opacity=True), np.float32(1.0))


def has_alpha(data: bytes, file: Path | str) -> bool:
    """Whether an image has alpha: of a PNG or WebP by its header; never a JPEG, and of OpenEXR it is not read."""
    kind = _kind(data)
    if kind not in ("PNG", "WebP", "KTX2"):
        return False
    with _open_image(data, file, kind) as picture:
        return bool(picture.has_transparency_data)


def grey_shares(values: Values) -> Image:
    """Values of a file as grey shares of the largest, linear, (H, W, 1); of colours their luminance."""
    shares = _shares(values, as_srgb=False)
    return shares if shares.shape[2] == 1 else (shares @ _LUMINANCE)[..., None]


def reduction(width: int, height: int) -> int:
    """The divisor of an image's sides that leaves at most `MAX_PIXELS`."""
    return resampling.reduction(width, height, MAX_PIXELS)


def is_image(data: bytes, file: Path | str) -> bool:
    """Whether it is of a format that is read, by its first bytes. Raises LoadError for a header that is damaged."""
    return image_size(data, file) is not None or _kind(data) == "EXR"


def image_size(data: bytes, file: Path | str) -> tuple[int, int] | None:
    """(width, height) from the header, without decoding; None for OpenEXR and what is no image."""
    kind = _kind(data)
    if kind in ("", "EXR"):
        return None
    if kind == "KTX2":
        size = ktx2_size(data, file)
        _check_size(*size, file)
        return size
    with _open_image(data, file, kind) as picture:
        width, height = picture.size
        return width, height


def image_orientation(data: bytes, file: Path | str) -> int:
    """How the camera was held that took a photograph, 1 to 8, by its EXIF data; 1, upright, where it has none that
    can be read."""
    kind = _kind(data)
    with suppress(Exception):  # whatever the library makes of damaged data: the pixels do not need it
        if kind in ("JPEG", "PNG", "WebP"):
            with _open_image(data, file, kind) as picture:
                found = picture.getexif().get(_ORIENTATION_TAG)
            return found if isinstance(found, int) and 1 <= found <= 8 else 1
    return 1


def check_image(data: bytes, file: Path | str) -> None:
    """Raise LoadError for an image that is cut off, without decoding it where that can be seen otherwise: by the
    checksums of a PNG, the end of a JPEG, the length of a WebP. KTX 2 and OpenEXR images are decoded."""
    kind = _kind(data)
    if kind == "WebP" and int.from_bytes(data[4:8], "little") + 8 > len(data):
        raise LoadError(file, "WebP image", f"truncated at byte {len(data)}", "a whole image")
    if kind == "JPEG" and b"\xff\xd9" in data[-1024:]:
        return
    if kind == "EXR":
        _read_exr(data, file, ignore_note, is_colour=False)
    if kind in ("PNG", "JPEG", "KTX2"):
        with _open_image(data, file, kind) as picture:
            if kind == "PNG":
                picture.verify()
            elif kind == "JPEG":
                picture.draft("RGB", (1, 1))
                picture.load()


def _shares(values: NDArray[np.generic], as_srgb: bool) -> Image:
    """Values of a file, integers as shares of the largest, decoded if they are sRGB."""
    if values.dtype == np.uint8:
        codes = np.arange(256, dtype=np.float32) / np.float32(255.0)
        return (decode_srgb(codes) if as_srgb else codes)[values]
    shares = np.asarray(values, np.float32) / np.float32(65535.0 if values.dtype == np.uint16 else 1.0)
    return decode_srgb(shares) if as_srgb else shares


def read_image(
    data: bytes,
    file: Path | str,
    decode: Callable[[Values], Image],
    report: ReportNote = ignore_note,
    is_colour: bool = False,
    is_opacity: bool = False,
) -> Image:
    """Return what `decode` makes of the file's values (h, W, 1 or 3), uint8, uint16 or float32, row by row: the image,
    or a reduced one if it has too many pixels, which is reported to `report`. is_colour: whether primaries that a file
    names are converted to Rec. 709, and values outside of its gamut are clipped at 0. is_opacity: of an image that has
    alpha, that is decoded instead."""
    kind = _kind(data)
    if not kind:
        raise LoadError(file, "first bytes", data[:8], "a PNG, JPEG, WebP, KTX 2 or OpenEXR image")
    if kind == "EXR":
        values = _read_exr(data, file, report, is_colour)
        height, width = values.shape[:2]
        k = reduction(width, height)
        pixels = _means([values], decode, k)
    else:
        with _open_image(data, file, kind) as picture:
            width, height = picture.size
            k = reduction(width, height)
            if k > 1 and kind == "JPEG":
                picture.draft(picture.mode, (-(-width // k), -(-height // k)))
            left = reduction(*picture.size)  # divisor that remains after decoding
            pixels = _means(_bands(picture, max(_BAND_PIXELS // width // left, 1) * left, is_opacity), decode, left)
    if k > 1:
        report(f"{file}: {width} x {height} pixels, shown at {pixels.shape[1]} x {pixels.shape[0]}")
    return pixels


def _bands(picture: Any, rows: int, is_opacity: bool) -> Iterator[Values]:
    """Yield the values of so many rows at a time."""
    width, height = picture.size
    if rows >= height:
        yield _integers(_alpha(picture) if is_opacity else picture)
        return
    for top in range(0, height, rows):
        band = picture.crop((0, top, width, min(top + rows, height)))
        yield _integers(_alpha(band) if is_opacity else band)


def _means(bands: Iterable[Values], decode: Callable[[Values], Image], k: int) -> Image:
    """Mean of each k x k decoded values."""
    found = [block_means(values, k, decode) for values in bands]
    return np.ascontiguousarray(found[0] if len(found) == 1 else np.concatenate(found), np.float32)


def _kind(data: bytes) -> str:
    """PNG, JPEG, EXR, WebP or KTX2, by the first bytes; "" for others."""
    kind = next((name for magic, name in _MAGIC.items() if data.startswith(magic)), "")
    return "" if kind == "WebP" and data[8:12] != b"WEBP" else kind


@contextmanager
def _open_image(data: bytes, file: Path | str, kind: str) -> Iterator[Any]:
    """A picture of an allowed size; the library's errors become LoadErrors."""
    from PIL.JpegImagePlugin import JpegImageFile
    from PIL.PngImagePlugin import PngImageFile
    from PIL.WebPImagePlugin import WebPImageFile

    if kind == "KTX2":
        _check_size(*ktx2_size(data, file), file)
        yield open_ktx2(data, file)
        return
    if kind == "WebP":
        _check_size(*_webp_size(data), file)  # opening it takes memory for all of its pixels
    try:
        # Without the library's own limit, which is lower and applies to the whole process.
        readers: dict[str, Any] = {"JPEG": JpegImageFile, "PNG": PngImageFile, "WebP": WebPImageFile}
        with readers[kind](io.BytesIO(data)) as opened:
            width, height = opened.size
            _check_size(width, height, file)
            yield opened
    except LoadError:
        raise
    except Exception as error:  # the library raises OSError, ValueError, SyntaxError, struct.error and its own
        raise LoadError(file, f"{kind} image", str(error), "a whole image, not cut off or damaged") from None


def _webp_size(data: bytes) -> tuple[int, int]:
    """(width, height) by the header of a WebP file's first chunk: of a canvas, a lossless or a lossy image [RFC9649];
    (1, 1) where it is none of these, which decoding reports."""
    chunk, head = data[12:16], data[20:30].ljust(10, b"\0")
    if chunk == b"VP8X":
        return 1 + int.from_bytes(head[4:7], "little"), 1 + int.from_bytes(head[7:10], "little")
    if chunk == b"VP8L":
        bits = int.from_bytes(head[1:5], "little")
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    if chunk == b"VP8 ":
        width, height = (int.from_bytes(head[at : at + 2], "little") & 0x3FFF for at in (6, 8))
        return max(width, 1), max(height, 1)
    return 1, 1


def _alpha(picture: Any) -> Any:
    """The alpha of a picture as a grey one; the picture itself where it has none."""
    return picture.convert("RGBA").getchannel("A") if picture.has_transparency_data else picture


def _integers(opened: Any) -> Values:
    """(H, W, 1 or 3) uint8, for a grey image of 16 bits uint16; alpha is dropped."""
    if opened.mode.startswith("I"):
        return np.asarray(opened).astype(np.uint16)[..., None]
    if opened.mode in ("1", "L", "LA"):
        return np.asarray(opened.convert("L"))[..., None]
    return np.asarray(opened.convert("RGB"))


def _read_exr(data: bytes, file: Path | str, report: ReportNote, is_colour: bool) -> Image:
    """By the reader of environments, which takes files: the bytes go to a temporary one."""
    with tempfile.NamedTemporaryFile(suffix=".exr") as copy:
        copy.write(data)
        copy.flush()
        try:
            notes: list[str] = []
            with temporary_file(Path(copy.name)):
                pixels = read_radiance_image(Path(copy.name), notes, is_colour, MAX_PIXELS)
        except LoadError as error:
            raise LoadError(file, error.what, error.value, error.expected) from None
    _check_size(pixels.shape[1], pixels.shape[0], file)
    for note in notes:
        report(f"{file}: {note}")
    if any("converted" in note for note in notes):
        pixels = np.maximum(pixels, np.float32(0.0))  # NaN stays NaN
    return _usable(pixels, lambda note: report(f"{file}: {note}"))


def _check_size(width: int, height: int, file: Path | str) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE and width * height <= MOST_READ):
        expected = f"sides of 1 to {MAX_SIDE} and at most {MOST_READ} pixels"
        raise LoadError(file, "image size", f"{width} x {height}", expected)


def _usable(pixels: Image, report: Callable[[str], None]) -> Image:
    """Values (H, W, 3) as factors from 0 to `BRIGHTEST`: others are clamped, infinite ones to the file's brightest; NaN
    becomes the mean of the others of its channel."""
    is_usable = (pixels >= 0.0) & (pixels <= BRIGHTEST)  # false for NaN too
    if is_usable.all():
        return pixels
    row, column, _ = (int(i) for i in np.argwhere(~is_usable)[0])
    report(
        f"{int((~is_usable).any(axis=2).sum())} pixels with numbers that are none or not from 0 to {BRIGHTEST:g}, the "
        f"first ({column}, {row}): taken as the mean of the others, or as the nearest that can be"
    )
    is_number = ~np.isnan(pixels)
    brightest = pixels.max(where=np.isfinite(pixels), initial=0.0)
    clipped = np.clip(np.where(np.isposinf(pixels), brightest, pixels), 0.0, BRIGHTEST)
    n_numbers = np.maximum(is_number.sum(axis=(0, 1)), 1)
    means = clipped.sum(axis=(0, 1), where=is_number, dtype=np.float64) / n_numbers
    return np.where(is_number, clipped, means.astype(np.float32))


# tan 87 degrees: steeper slopes, or normals into the surface, are clamped to it.
STEEPEST = 20.0
_MIDDLES = {"uint8": 128, "uint16": 32768}


def read_normal_map(data: bytes, file: Path | str, report: ReportNote = ignore_note, flip_green: bool = False) -> Image:
    """Slopes (H, W, 2) of a normal map's texels along its x and y, row 0 on top; flip_green: y, its green, means down.
    Raises LoadError."""
    slopes = read_image(data, file, lambda values: _slopes(values, file), report)
    if flip_green:
        slopes[..., 1] *= -1.0
    return slopes


def _slopes(values: Values, file: Path | str) -> Image:
    """Slopes from numbers (h, W, 3) of a file."""
    if values.shape[2] != 3:
        raise LoadError(file, "channels", values.shape[2], "the three of a normal map; heights are a bump_map")
    if middle := _MIDDLES.get(values.dtype.name):
        vectors = (values.astype(np.float32) - np.float32(middle)) / np.float32(middle - 1)
    else:
        vectors = np.float32(2.0) * np.asarray(values, np.float32) - np.float32(1.0)
    flat = np.hypot(vectors[..., 0], vectors[..., 1])
    up = np.maximum(vectors[..., 2], np.maximum(flat, np.float32(1e-3)) / np.float32(STEEPEST))
    return np.ascontiguousarray(-vectors[..., :2] / up[..., None], np.float32)


def read_directions(data: bytes, file: Path | str, degrees: float, report: ReportNote = ignore_note) -> Image:
    """(cos 2θ, sin 2θ) of angles θ, of which 0 to `degrees` are a grey image's black to white, (H, W, 2), row 0 on top;
    of a colour image its luminance. Raises LoadError."""

    def doubled(values: Values) -> Image:
        angles = np.float32(np.radians(2.0 * degrees)) * grey_shares(values)[..., 0]
        return np.stack([np.cos(angles), np.sin(angles)], axis=2)

    return read_image(data, file, doubled, report)


def read_direction_vectors(data: bytes, file: Path | str, report: ReportNote = ignore_note) -> Image:
    """(cos 2θ, sin 2θ) of the angles θ of directions (2 red - 1, 2 green - 1), (H, W, 2), row 0 on top; of vectors
    shorter than 1, which are means of several directions, as much shorter. Raises LoadError."""

    def doubled(values: Values) -> Image:
        found = _shares(values, as_srgb=False)
        x, y = np.moveaxis(2.0 * found[..., [0, min(1, found.shape[2] - 1)]] - 1.0, 2, 0)
        length = np.maximum(np.hypot(x, y), np.float32(1e-6))
        return np.stack([x * x - y * y, 2.0 * x * y], axis=2) / (length * np.maximum(length, 1.0))[..., None]

    return read_image(data, file, doubled, report)


def read_heights(data: bytes, file: Path | str, report: ReportNote = ignore_note) -> Image:
    """Derivatives along u and v of heights from 0 to 1 of an image that repeats, (H, W, 2), row 0 on top; for a colour
    image those of its luminance. Raises LoadError."""
    height = read_image(data, file, grey_shares, report)[..., 0]
    n_rows, n_columns = height.shape
    along_u = (np.roll(height, -1, axis=1) - np.roll(height, 1, axis=1)) * np.float32(0.5 * n_columns)
    along_v = (np.roll(height, 1, axis=0) - np.roll(height, -1, axis=0)) * np.float32(0.5 * n_rows)
    return np.stack([along_u, along_v], axis=2)
