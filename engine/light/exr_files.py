"""Reads OpenEXR images: scan lines or tiles, one part or several, whatever their channels are.

The header is checked before any pixel is read. For many broken files the library reports no parts without raising, and
prints to standard error; both become one LoadError here. Of a mip map the finest level is read. Data are placed in the
display window, and primaries converted to Rec. 709. `exr_channels` finds the picture among parts and channels.

The library has two interfaces, and neither is enough. The older one reads rows and chosen channels, which bounds the
memory, but only of the first part and no subsampled channels. The newer one reads the whole file, and is used for
those.
"""

from __future__ import annotations

import io
import os
import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from engine.core.colour import REC709, luminance_weights, xyz_to_rec709
from engine.core.errors import LoadError
from engine.light.exr_channels import (
    ChosenChannels,
    Float32Array,
    PartChannels,
    choose_channels,
    interpolate_plane,
    rgb_of_planes,
)
from engine.light.picture_bands import (
    MAX_SIDE,
    check_size,
    divisor_of,
    empty_image,
    fill_in_bands,
    to_rec709_with_note,
    transform_colours,
)

EXR_MAGIC = b"\x76\x2f\x31\x01"
# Of the pixels of all parts, where a file must be read whole.
MAX_WHOLE_BYTES = 1 << 32
# Pixels of a tile, which the library holds whole, where the picture has fewer.
MAX_TILE_PIXELS = 1 << 22

_WHOLE = "a whole OpenEXR image, not cut off or damaged"
_TYPES = {"UINT": np.uint32, "HALF": np.float16, "FLOAT": np.float32}
_FLAT = ("scanlineimage", "tiledimage")

# Reads the chosen channels from the first to before the last of the rows of a data window, counted from its top: planes
# (rows, W) by name.
ReadPlanes = Callable[[int, int], dict[str, Float32Array]]
Window = tuple[tuple[int, int], tuple[int, int]]
Samplings = dict[str, tuple[int, int]]  # along x and y, of channels by name


def read_exr(file: Path, notes: list[str], is_colour: bool, most_pixels: int | None) -> Float32Array:
    """The image in its display window and in Rec. 709: (H, W, 3). Raises LoadError."""
    _check_compression(file)
    parts = _open_exr(file, header_only=True)
    flat = [k for k, part in enumerate(parts) if _storage(part.header) in _FLAT]
    if not flat:
        kind = _storage(parts[0].header)
        raise LoadError(file, "OpenEXR storage", kind, "scan lines or tiles (deep images are not supported)")
    channels = {k: _channels(file, parts[k].header) for k in flat}
    described = [PartChannels(k, str(parts[k].header.get("name", "")), list(channels[k])) for k in flat]
    chosen = choose_channels(described, notes)
    if chosen is None:
        raise LoadError(file, "channels", "none", "R, G and B, or others of a picture")
    header = parts[chosen.part].header
    for part in parts:
        _check_tiles(file, part.header)
    sampling = {name: channels[chosen.part][name] for name in chosen.read}
    data, display = _windows(file, header, notes)
    convert = _conversion(chosen, header, is_colour, notes)
    is_first = chosen.part == 0 and set(sampling.values()) == {(1, 1)}
    if not is_first:
        _check_whole_size(file, [part.header for part in parts])
    rows = _rows_of_first_part if is_first else _rows_of_any_part
    with rows(file, chosen, sampling, data, notes) as read_planes:
        return _in_display_window(file, lambda a, b: convert(read_planes(a, b)), data, display, most_pixels, notes)


def _storage(header: dict[str, Any]) -> str:
    return str(header.get("type", "scanlineimage")).rpartition(".")[2]


def _channels(file: Path, header: dict[str, Any]) -> Samplings:
    """The sampling of each channel, along x and y, by its name."""
    try:
        return {channel.name: (int(channel.xSampling), int(channel.ySampling)) for channel in header["channels"]}
    except UnicodeDecodeError as error:
        raise LoadError(file, "channel name", error.object, "text") from None


def _windows(file: Path, header: dict[str, Any], notes: list[str]) -> tuple[Window, Window]:
    """Data and display window, each of an accepted size. Data that lie wholly outside are the picture, with a note."""
    data, display = _window(header, "dataWindow"), _window(header, "displayWindow")
    for (left, top), (right, bottom) in (data, display):
        check_size(file, right - left + 1, bottom - top + 1)
    (left, top), (right, bottom) = data
    (x0, y0), (x1, y1) = display
    if left > x1 or right < x0 or top > y1 or bottom < y0:
        where = f"({left}, {top}) to ({right}, {bottom})"
        notes.append(f"data from {where} outside the display window ({x0}, {y0}) to ({x1}, {y1}): shown without it")
        return data, data
    if data != display:
        sizes = f"{right - left + 1} x {bottom - top + 1} pixels of data from ({left - x0}, {top - y0}) on"
        notes.append(
            f"{sizes} in a picture of {x1 - x0 + 1} x {y1 - y0 + 1}: what is outside is cut off, the rest black"
        )
    return data, display


def _window(header: dict[str, Any], name: str) -> Window:
    """The first and the last column and row of a window."""
    (left, top), (right, bottom) = header[name]
    return (int(left), int(top)), (int(right), int(bottom))


def _conversion(
    chosen: ChosenChannels, header: dict[str, Any], is_colour: bool, notes: list[str]
) -> Callable[[dict[str, Float32Array]], Float32Array]:
    """The function from planes (H, W) by name to RGB (H, W, 3) in Rec. 709."""
    primaries, matrix = list(REC709), None
    said = header.get("chromaticities")
    if said is not None and not isinstance(said, tuple):  # an attribute of that name with another type
        notes.append("chromaticities that are none, taken for Rec. 709's")
    elif said is not None and is_colour and chosen.kind != "xyz":
        primaries = [float(each) for each in said]
        matrix = to_rec709_with_note(primaries, notes)
    if chosen.kind == "xyz" and is_colour:
        notes.append("CIE XYZ, converted to Rec. 709")
        matrix = xyz_to_rec709()
    try:
        luminance_weights(primaries)
    except ValueError:
        primaries = list(REC709)

    def convert(planes: dict[str, Float32Array]) -> Float32Array:
        rgb = rgb_of_planes(chosen, planes, primaries)
        return rgb if matrix is None else transform_colours(rgb, matrix)

    return convert


def _in_display_window(
    file: Path, read: Callable[[int, int], Float32Array], data: Window, display: Window, most_pixels: int | None,
    notes: list[str],
) -> Float32Array:  # fmt: skip
    """The display window of an image with a data window: pixels outside are cropped, missing ones are black.

    read: rows of the data window, counted from its top, as RGB.
    """
    (left, top), (right, bottom) = data
    (x0, y0), (x1, y1) = display
    width, height = x1 - x0 + 1, y1 - y0 + 1
    columns = slice(max(x0, left), min(x1, right) + 1)

    def read_band(start: int, stop: int) -> Float32Array:
        first, last = max(y0 + start, top), min(y0 + stop, bottom + 1)
        if first >= last:
            return np.zeros((stop - start, width, 3), np.float32)
        inside = read(first - top, last - top)[:, columns.start - left : columns.stop - left]
        if inside.shape[:2] == (stop - start, width):
            return inside
        band = np.zeros((stop - start, width, 3), np.float32)
        band[first - y0 - start : last - y0 - start, columns.start - x0 : columns.stop - x0] = inside
        return band

    k = divisor_of(file, width, height, most_pixels, notes)
    image = empty_image(height, width, k)
    fill_in_bands(image, height, k, max(width, right - left + 1), read_band)
    return image


@contextmanager
def _rows_of_first_part(
    file: Path, chosen: ChosenChannels, sampling: Samplings, data: Window, notes: list[str]
) -> Iterator[ReadPlanes]:
    """Reads rows of channels without subsampling, by the library's older interface."""
    import OpenEXR

    (left, top), (right, _) = data

    def read_planes(start: int, stop: int) -> dict[str, Float32Array]:
        planes = {}
        for name, kind in types.items():
            with silence_library():
                pixels = opened.channels([name], kind, top + start, top + stop - 1)[0]
            plane = np.frombuffer(pixels, _TYPES[str(kind)]).reshape(stop - start, right - left + 1)
            planes[name] = plane.astype(np.float32)
        return planes

    try:
        with _for_library(file) as source:
            with silence_library():
                opened = OpenEXR.InputFile(source)
            described = opened.header()["channels"]
            types = {name: described[name].type for name in sampling}
            _note_integers([name for name, kind in types.items() if str(kind) == "UINT"], notes)
            yield read_planes
    except LoadError:
        raise
    except Exception as error:  # the library raises OSError, RuntimeError, ValueError, TypeError and its own exceptions
        raise LoadError(file, "OpenEXR pixels", str(error), _WHOLE) from None


@contextmanager
def _rows_of_any_part(
    file: Path, chosen: ChosenChannels, sampling: Samplings, data: Window, notes: list[str]
) -> Iterator[ReadPlanes]:
    """Reads rows of any channels, by the library's newer interface, which reads all of the file at once."""
    (left, top), (right, bottom) = data
    width, height = right - left + 1, bottom - top + 1
    # A part that is damaged is not in the list, so that the others' places in it change.
    found = {part.part_index: part.channels for part in _open_exr(file, header_only=False)}
    if not found.get(chosen.part):
        raise LoadError(file, f"OpenEXR pixels of part {chosen.part}", "nothing", _WHOLE)
    whole = {name: found[chosen.part][name].pixels for name in sampling}
    _note_integers([name for name, plane in whole.items() if plane.dtype == np.uint32], notes)
    for name, (x, y) in sampling.items():
        if x < 1 or y < 1 or whole[name].shape != (-(-height // y), -(-width // x)):
            raise LoadError(file, f"sampling of channel {name}", f"{x} x {y}", "divisors of the data window")

    def read_planes(start: int, stop: int) -> dict[str, Float32Array]:
        planes = {}
        for name, plane in whole.items():
            if sampling[name] == (1, 1):
                planes[name] = plane[start:stop].astype(np.float32)
            else:
                y = sampling[name][1]
                first, last = start // y, (stop - 1) // y + 2
                rows = np.arange(start, stop) - first * y
                planes[name] = interpolate_plane(plane[first:last].astype(np.float32), sampling[name], rows, width)
        return planes

    yield read_planes


def _note_integers(names: list[str], notes: list[str]) -> None:
    if names:
        notes.append(f"integers in channel {', '.join(names)}, read as they are")


def _check_whole_size(file: Path, headers: list[dict[str, Any]]) -> None:
    """Raises LoadError for a file whose parts do not fit into memory together."""
    total = 0
    for header in headers:
        (left, top), (right, bottom) = _window(header, "dataWindow")
        total += 4 * len(header["channels"]) * (right - left + 1) * (bottom - top + 1)
    if total > MAX_WHOLE_BYTES:
        expected = f"at most {MAX_WHOLE_BYTES >> 20} MB, unless the picture is the first part"
        raise LoadError(file, "pixels of all parts", f"{total >> 20} MB", expected)


def _check_tiles(file: Path, header: dict[str, Any]) -> None:
    """Raises LoadError for tiles that take much more memory than the part."""
    tiles = header.get("tiles")
    if tiles is None:
        return
    (left, top), (right, bottom) = _window(header, "dataWindow")
    most = max(MAX_TILE_PIXELS, (right - left + 1) * (bottom - top + 1))
    if tiles.xSize * tiles.ySize > most:
        raise LoadError(file, "OpenEXR tile", f"{tiles.xSize} x {tiles.ySize} pixels", f"at most {most} pixels")


def _open_exr(file: Path, header_only: bool) -> list[Any]:
    """The parts of an OpenEXR file; raises LoadError for their absence, however the library reports it."""
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
        raise LoadError(file, what, reason or complaint or "nothing", _WHOLE)
    return list(parts)


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


def _check_compression(file: Path) -> None:
    """Checks the raw compression bytes of all parts: the library silently treats an unknown one as ZIP."""
    import OpenEXR

    with open(file, "rb") as opened:
        head = opened.read(65_536)
    n_known = int(OpenEXR.NUM_COMPRESSION_METHODS)
    for found in re.finditer(re.escape(b"compression\0compression\0\1\0\0\0") + b"(.)", head, re.DOTALL):
        if found[1][0] >= n_known:
            raise LoadError(file, "OpenEXR compression", found[1][0], f"0 to {n_known - 1}")
