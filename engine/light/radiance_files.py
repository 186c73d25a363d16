"""Reads radiance images, OpenEXR and Radiance HDR, from files that may be malicious, broken or not images at all.

Accepts regular files only, and checks size and header before any pixel is read. An image of more than `MAX_PIXELS` is
averaged to a half or a quarter of its size, one band of rows at a time. For many broken files OpenEXR reports no parts
without raising, and prints to standard error; both become one LoadError here. Negative and non-finite values pass: the
caller handles them. Images are interpreted as their headers state: data window within display window, primaries
converted to Rec. 709, orientation by the size line.

OpenImageIO 3.2 was rejected after a trial (Apache-2.0, 20 MB installed). It reads probes and textures to the same
numbers, and refuses truncated files and headers that claim 10 GB. It takes half of the processor time for HDR (14 ms a
million pixels, 31 here), two thirds to four fifths for OpenEXR, about as much for PNG, and a third more than Pillow for
JPEG. But an image is read once, the checks below would remain, and so would Pillow and OpenEXR, which show and write
pictures.
"""

from __future__ import annotations

import io
import os
import re
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import to_rec709, xyz_to_rec709
from engine.core.errors import LoadError
from engine.core.safe_files import local_path
from engine.light.resampling import block_means, reduction

MAX_FILE_BYTES = 1 << 30
MAX_SIDE = 16_384
MAX_PIXELS = 1 << 25
_BAND_PIXELS = 1 << 22

_RGBE = b"32-bit_rle_rgbe"
_EXR_MAGIC = b"\x76\x2f\x31\x01"

# Reads from the first to the last of these rows of a data window, inclusive: (rows, width of the data window, 3).
ReadRows = Callable[[int, int], NDArray[np.float32]]


def read_radiance_image(
    file: Path, notes: list[str] | None = None, is_colour: bool = True, most_pixels: int | None = None
) -> NDArray[np.float32]:
    """The RGB image in an .exr or .hdr file (identified by content, not by name): (H, W, 3) float32, row 0 at the top.

    notes receives a line for each conversion. is_colour: False where the numbers are not colours, such as normals or
    weights, and must not be converted. most_pixels: the size that an image of more than `MAX_PIXELS` is reduced to, by
    default that number. Raises LoadError for anything that cannot be read as one complete RGB image with sides of at
    most 16,384.
    """
    said: list[str] = [] if notes is None else notes
    most_pixels = MAX_PIXELS if most_pixels is None else most_pixels
    try:
        file = local_path(file)
    except OSError as error:
        raise LoadError(file, "file", str(error), "a readable file") from None
    start = _check_regular_file(file)
    if start.startswith(_EXR_MAGIC):
        return _read_exr(file, said, is_colour, most_pixels)
    if start.startswith((b"#?", b"FORMAT=32-bit")):
        return _read_hdr(file, said, most_pixels)
    raise LoadError(file, "first bytes", start[:8], "an OpenEXR or a Radiance HDR image")


def _check_regular_file(file: Path) -> bytes:
    """Refuses files that are missing, not regular, empty or too large; returns the first bytes."""
    try:
        opened = open(file, "rb", opener=_open_without_waiting)
    except (OSError, ValueError) as error:
        raise LoadError(file, "file", str(error), "a readable file") from None
    with opened:
        status = os.fstat(opened.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise LoadError(file, "file", "not a regular file", "a regular file")
        if not 0 < status.st_size <= MAX_FILE_BYTES:
            raise LoadError(file, "file size", f"{status.st_size} bytes", f"1 to {MAX_FILE_BYTES} bytes")
        return opened.read(16)


def _open_without_waiting(file: str, flags: int) -> int:
    return os.open(file, flags | getattr(os, "O_NONBLOCK", 0))  # otherwise opening a pipe without a writer would block


def _check_size(file: Path, width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise LoadError(file, "image size", f"{width} x {height}", f"sides of 1 to {MAX_SIDE}")


def _reduction(width: int, height: int, most_pixels: int, notes: list[str]) -> int:
    """The divisor of the sides; 1 unless the image is too large."""
    if width * height <= MAX_PIXELS:
        return 1
    k = reduction(width, height, most_pixels)
    notes.append(f"{width} x {height} pixels, shown at {-(-width // k)} x {-(-height // k)}")
    return k


def _rows_of_band(width: int, k: int) -> int:
    """The number of rows to read at a time: whole blocks."""
    return max(_BAND_PIXELS // (width * k), 1) * k


def _means(band: NDArray[np.float32], k: int) -> NDArray[np.float32]:
    """Means of each k x k pixels; a value that is not finite affects its own block only."""
    with np.errstate(invalid="ignore", over="ignore"):
        return block_means(band, k, lambda values: np.asarray(values, np.float32))


def _read_exr(file: Path, notes: list[str], is_colour: bool, most_pixels: int) -> NDArray[np.float32]:
    """Reads an OpenEXR image, whole or by rows, in its display window and in Rec. 709."""
    _check_exr_compression(file)
    header = _open_exr(file, header_only=True).header
    _check_exr_header(file, header)
    (left, top), (right, bottom) = _window(header, "dataWindow")
    if (right - left + 1) * (bottom - top + 1) <= MAX_PIXELS:
        channels = _open_exr(file, header_only=False).channels
        planes = [channels[name].pixels for name in "RGB"]
        kinds = [plane.dtype.name for plane in planes]  # known only now: the library's header does not state them
        if len(set(kinds)) > 1 or kinds[0] not in ("float16", "float32"):
            raise LoadError(file, "types of channels R, G, B", ", ".join(kinds), "all half or all float")
        data = np.stack([plane.astype(np.float32) for plane in planes], axis=2)
        image = _crop_to_display_window(
            lambda first, last: data[first - top : last + 1 - top], header, most_pixels, notes
        )
    else:
        with _exr_rows(file, header) as read_rows:
            image = _crop_to_display_window(read_rows, header, most_pixels, notes)
    said = header.get("chromaticities")
    if said is None or not is_colour:
        return image
    if not isinstance(said, tuple):  # an attribute of that name with another type
        notes.append("chromaticities that are none, taken for Rec. 709's")
        return image
    return _convert_to_rec709(image, [float(each) for each in said], notes)


@contextmanager
def _exr_rows(file: Path, header: dict[str, Any]) -> Iterator[ReadRows]:
    """A function that reads rows of an OpenEXR image, using the library's older interface: the newer one reads the
    whole image."""
    import OpenEXR

    (left, _), (right, _) = _window(header, "dataWindow")
    kinds: dict[str, type[np.floating]] = {"HALF": np.float16, "FLOAT": np.float32}

    def read_rows(first: int, last: int) -> NDArray[np.float32]:
        with silence_library():
            planes = opened.channels("RGB", named["R"], first, last)
        shape = last - first + 1, right - left + 1
        return np.stack([np.frombuffer(p, kinds[str(named["R"])]).reshape(shape).astype(np.float32) for p in planes], 2)

    try:
        with _for_library(file) as source:
            with silence_library():
                opened = OpenEXR.InputFile(source)
            described = opened.header()["channels"]
            named = {name: described[name].type for name in "RGB"}
            found = [str(named[name]) for name in "RGB"]
            if len(set(found)) > 1 or found[0] not in kinds:
                raise LoadError(file, "types of channels R, G, B", ", ".join(found).lower(), "all half or all float")
            yield read_rows
    except LoadError:
        raise
    except Exception as error:  # the library raises OSError, RuntimeError, ValueError, TypeError and its own exceptions
        expected = "a whole OpenEXR image, not cut off or damaged"
        raise LoadError(file, "OpenEXR pixels", str(error), expected) from None


def _crop_to_display_window(
    read_rows: ReadRows, header: dict[str, Any], most_pixels: int, notes: list[str]
) -> NDArray[np.float32]:
    """The display window of an image with a data window: pixels outside are cropped, missing ones are black."""
    (x0, y0), (x1, y1) = _window(header, "displayWindow")
    (left, top), (right, bottom) = _window(header, "dataWindow")
    width, height = x1 - x0 + 1, y1 - y0 + 1
    if (x0, y0, x1, y1) != (left, top, right, bottom):
        sizes = f"{right - left + 1} x {bottom - top + 1} pixels of data from ({left - x0}, {top - y0}) on"
        notes.append(f"{sizes} in a picture of {width} x {height}: what is outside is cut off, the rest black")
    k = _reduction(width, height, most_pixels, notes)
    n_rows = _rows_of_band(max(width, right - left + 1), k)
    image = np.zeros((-(-height // k), -(-width // k), 3), np.float32)
    columns = slice(max(x0, left), min(x1, right) + 1)
    for start in range(y0, y1 + 1, n_rows):
        end = min(start + n_rows, y1 + 1)
        first, last = max(start, top), min(end - 1, bottom)
        if first > last:
            continue
        inside = read_rows(first, last)[:, columns.start - left : columns.stop - left]
        band = inside
        if inside.shape[:2] != (end - start, width):
            band = np.zeros((end - start, width, 3), np.float32)
            band[first - start : last + 1 - start, columns.start - x0 : columns.stop - x0] = inside
        means = _means(band, k)
        image[(start - y0) // k : (start - y0) // k + len(means)] = means
    return image


def _window(header: dict[str, Any], name: str) -> tuple[tuple[int, int], tuple[int, int]]:
    """The first and the last column and row of a window."""
    (left, top), (right, bottom) = header[name]
    return (int(left), int(top)), (int(right), int(bottom))


def _convert_to_rec709(
    image: NDArray[np.float32], chromaticities: list[float], notes: list[str]
) -> NDArray[np.float32]:
    """Converts an image with other primaries to Rec. 709."""
    listed = " ".join(f"{each:.4g}" for each in chromaticities)
    try:
        matrix = to_rec709(chromaticities)
    except ValueError:
        notes.append(f"primaries {listed} are those of no colours, taken for Rec. 709's")
        return image
    if matrix is None:
        return image
    notes.append(f"primaries {listed}, converted to Rec. 709 (Bradford)")
    return _transform_colours(image, matrix)


def _transform_colours(image: NDArray[np.float32], matrix: NDArray[np.float64]) -> NDArray[np.float32]:
    """Transforms colours by a matrix; a value that is not finite affects its own pixel only."""
    with np.errstate(invalid="ignore", over="ignore"):
        return (image.reshape(-1, 3) @ matrix.T.astype(np.float32)).reshape(image.shape)


def _open_exr(file: Path, header_only: bool) -> Any:
    """The single part of an OpenEXR file; raises LoadError for its absence, however the library reports it."""
    import OpenEXR

    OpenEXR.setMaxImageSize(MAX_SIDE, MAX_SIDE)  # for the whole process; the library's default has no limit
    parts, complaint = [], ""
    with silence_library() as said:
        try:
            with _for_library(file) as source:
                parts = OpenEXR.File(source, separate_channels=True, header_only=header_only).parts
        except Exception as error:  # the library raises RuntimeError, ValueError, TypeError and its own exceptions
            complaint = str(error)
    what = "OpenEXR header" if header_only else "OpenEXR pixels"
    if not parts:
        reason = said[0].partition("(EXR_ERR_")[2].partition(") ")[2] if said else ""
        raise LoadError(file, what, reason or complaint or "nothing", "a whole OpenEXR image, not cut off or damaged")
    if len(parts) > 1:
        raise LoadError(file, "number of OpenEXR parts", len(parts), "1")
    return parts[0]


@contextmanager
def _for_library(file: Path) -> Iterator[str | BinaryIO]:
    """The argument by which OpenEXR opens a file: its name, which it interprets as UTF-8; otherwise the open file."""
    name = str(file)
    if os.fsencode(name) == name.encode(errors="surrogatepass"):
        yield name
    else:
        with open(file, "rb") as opened:
            yield opened


@contextmanager
def silence_library() -> Iterator[list[str]]:
    """Suppresses the library's output to the terminal: C++ on standard error, Python on standard output.

    On exit the list holds the lines from standard error. Standard error belongs to the whole process, so the output of
    other threads is lost meanwhile: use this for one call only.
    """
    lines: list[str] = []
    with tempfile.TemporaryFile() as sink, redirect_stdout(io.StringIO()):
        saved = os.dup(2)
        os.dup2(sink.fileno(), 2)
        try:
            yield lines
        finally:
            os.dup2(saved, 2)
            os.close(saved)
            sink.seek(0)
            lines.extend(sink.read(10_000).decode(errors="replace").splitlines())


def _check_exr_compression(file: Path) -> None:
    """Checks the raw compression byte: the library silently treats an unknown one as ZIP."""
    import OpenEXR

    with open(file, "rb") as opened:
        _, found, value = opened.read(65_536).partition(b"compression\0compression\0\1\0\0\0")
    n_known = int(OpenEXR.NUM_COMPRESSION_METHODS)
    if found and value and value[0] >= n_known:
        raise LoadError(file, "OpenEXR compression", value[0], f"0 to {n_known - 1}")


def _check_exr_header(file: Path, header: dict[str, Any]) -> None:
    """Raises LoadError unless the header is that of one flat RGB image of an accepted size."""
    kind = str(header.get("type", "scanlineimage")).rsplit(".", maxsplit=1)[-1]
    if kind not in ("scanlineimage", "tiledimage"):
        raise LoadError(file, "OpenEXR storage", kind, "scan lines or tiles (deep images are not supported)")
    (left, top), (right, bottom) = _window(header, "dataWindow")
    _check_size(file, right - left + 1, bottom - top + 1)
    (x0, y0), (x1, y1) = _window(header, "displayWindow")
    _check_size(file, x1 - x0 + 1, y1 - y0 + 1)
    if left > x1 or right < x0 or top > y1 or bottom < y0:
        raise LoadError(file, "data window", f"({left}, {top}) to ({right}, {bottom})",
                        f"a part of the display window, ({x0}, {y0}) to ({x1}, {y1})")  # fmt: skip
    if str(header.get("envmap", "")).endswith("CUBE"):
        raise LoadError(file, "envmap", "cube", "a lat-long or an angular map")
    try:
        channels = {channel.name: channel for channel in header["channels"]}
    except UnicodeDecodeError as error:
        raise LoadError(file, "channel name", error.object, "text") from None
    if not {"R", "G", "B"} <= channels.keys():
        raise LoadError(file, "channels", ", ".join(sorted(channels)), "R, G and B")
    sampling = {(channels[name].xSampling, channels[name].ySampling) for name in "RGB"}
    if sampling != {(1, 1)}:
        raise LoadError(file, "channel sampling", sorted(sampling), "1 x 1")


def _read_hdr(file: Path, notes: list[str], most_pixels: int) -> NDArray[np.float32]:
    """Reads Radiance RGBE: (r, g, b) 2^(e - 136), 0 where e = 0 [Ward91]; flat, old and new run-length scanlines.

    As Radiance defines it, values are divided by all EXPOSURE and COLORCORR of the header, XYZ becomes RGB, and the
    size line determines the order of the pixels.
    """
    # Imported late: the only compiled part of reading a file, which a process that reads only OpenEXR does not need.
    from engine.light._kernels import decode_rgbe

    with open(file, "rb") as opened:
        header, size, position = _parse_hdr_header(file, opened.read(65_536))
    first, second = size
    width, height = (second.n, first.n) if first.axis == b"Y" else (first.n, second.n)
    _check_size(file, width, height)
    data = np.fromfile(file, np.uint8)
    k = _reduction(width, height, most_pixels, notes)
    n_rows = min(_rows_of_band(second.n, k), first.n)
    scale = np.exp2(np.arange(256, dtype=np.float32) - np.float32(136.0))
    scale[0] = 0.0
    image = np.empty((-(-first.n // k), -(-second.n // k), 3), np.float32)
    quads = np.zeros(
        (n_rows + 1, second.n, 4), np.uint8
    )  # below the row before, of which a scanline may repeat a pixel
    for start in range(0, first.n, n_rows):
        n, before = min(n_rows, first.n - start), int(start > 0)
        status, row, position = decode_rgbe(data, position, before, quads[: n + before])
        if status != 0:
            found = {
                1: f"file ends at byte {len(data)}",
                2: f"a run at byte {position} leaves its scanline",
                3: f"another width at byte {position}",
                4: f"a repeat at byte {position} with nothing to repeat",
            }[status]
            raise LoadError(file, f"scanline {start + row - before} of {first.n}", found, f"{second.n} pixels")
        read = quads[before : n + before]
        means = _means(read[..., :3].astype(np.float32) * scale[read[..., 3:]], k)
        image[start // k : start // k + len(means)] = means
        quads[0] = read[-1]
    return _apply_header(_orient_scanlines(image, first, second), header, notes)


class _Side(NamedTuple):
    """One half of a size line: the axis, the number of pixels along it, and whether its coordinate increases."""

    axis: bytes
    grows: bool
    n: int


def _orient_scanlines(image: NDArray[np.float32], first: _Side, second: _Side) -> NDArray[np.float32]:
    """Orients scanlines (first, second, 3) as rows from the top and pixels from the left; Y increases upwards."""
    for k, side in enumerate((first, second)):
        if side.grows != (side.axis == b"X"):
            image = np.flip(image, k)
    return np.ascontiguousarray(image if first.axis == b"Y" else image.swapaxes(0, 1))


def _apply_header(
    image: NDArray[np.float32], header: dict[bytes, list[bytes]], notes: list[str]
) -> NDArray[np.float32]:
    """Applies EXPOSURE, COLORCORR, FORMAT and PRIMARIES to the pixels."""
    factor = np.ones(3)
    for name, count in ((b"EXPOSURE", 1), (b"COLORCORR", 3)):
        for value in header.get(name, ()):
            numbers = _floats(value, count)
            if numbers is not None and all(1e-30 < each < 1e30 for each in numbers):
                factor = factor / numbers
    if (np.abs(factor - 1.0) > 1e-6).any():
        notes.append(f"exposure of the header taken off: radiance times {' '.join(f'{each:.4g}' for each in factor)}")
        image = image * factor.astype(np.float32)
    if header.get(b"FORMAT", [b""])[-1] == b"32-bit_rle_xyze":
        notes.append("CIE XYZ, converted to Rec. 709")
        return _transform_colours(image, xyz_to_rec709())
    primaries = _floats(header.get(b"PRIMARIES", [b""])[-1], 8)
    return image if primaries is None or not any(primaries) else _convert_to_rec709(image, primaries, notes)


def _floats(value: bytes, count: int) -> list[float] | None:
    """`count` finite numbers, or None."""
    try:
        numbers = [float(word) for word in value.split()]
    except ValueError:
        return None
    return numbers if len(numbers) == count and np.isfinite(numbers).all() else None


def _parse_hdr_header(file: Path, head: bytes) -> tuple[dict[bytes, list[bytes]], tuple[_Side, _Side], int]:
    """The values of each name, the two halves of the size line, and the position of the first byte of the pixels."""
    blank = re.search(rb"\r?\n[ \t]*\r?\n", head)
    if not blank:
        raise LoadError(file, "Radiance header", "no empty line at its end", "a header, an empty line, the size")
    header: dict[bytes, list[bytes]] = {}
    for line in head[: blank.start()].splitlines():
        name, equals, value = line.partition(b"=")
        if equals and not line.startswith(b"#"):
            header.setdefault(name.strip(), []).append(value.strip())
    kind = header.get(b"FORMAT", [_RGBE])[-1]
    if kind not in (_RGBE, b"32-bit_rle_xyze"):
        raise LoadError(file, "FORMAT", kind.decode(errors="replace"), "32-bit_rle_rgbe or 32-bit_rle_xyze")
    line, newline, _ = head[blank.end() :].partition(b"\n")
    found = re.fullmatch(rb"([+-])([XY]) (\d{1,9}) ([+-])([XY]) (\d{1,9})", line.strip())
    if not newline or not found or found[2] == found[5]:
        raise LoadError(file, "size line", line[:60].decode(errors="replace"), '"-Y HEIGHT +X WIDTH"')
    sides = _Side(found[2], found[1] == b"+", int(found[3])), _Side(found[5], found[4] == b"+", int(found[6]))
    return header, sides, blank.end() + len(line) + 1
