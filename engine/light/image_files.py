"""Reading radiance images, OpenEXR and Radiance HDR, from files that may be hostile, broken or not images at all.

Regular files only, size and header checked before any pixel is read. OpenEXR says of many broken files that they have
no parts, without raising, and prints to standard error; both are turned into one LoadError here. Negative and
non-finite values pass: what they mean is the caller's to say.

OpenImageIO 3.2 was tried (Apache-2.0, 20 MB installed). It reads probes and textures to the same numbers, and refuses
cut files and headers that claim 10 GB; of processor time HDR takes it half (14 ms a million pixels, 31 here), OpenEXR
two thirds to four fifths, PNG about as much and JPEG a third more than Pillow. It was not taken: an image is read once,
the checks below would stay, and so would Pillow and OpenEXR, by which pictures are shown and written.
"""

from __future__ import annotations

import io
import os
import re
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from engine.errors import LoadError
from engine.files import place_of

MAX_FILE_BYTES = 1 << 30
MAX_SIDE = 16_384
MAX_PIXELS = 1 << 25

_EXR_MAGIC = b"\x76\x2f\x31\x01"


def read_radiance_image(file: Path) -> NDArray[np.float32]:
    """The RGB image in an .exr or .hdr file (told by content, not by name): (H, W, 3) float32, row 0 on top.

    Raises LoadError for what cannot be read as one whole RGB image of at most 2^25 pixels.
    """
    try:
        file = place_of(file)
    except OSError as error:
        raise LoadError(file, "file", str(error), "a readable file") from None
    start = _check_regular_file(file)
    if start.startswith(_EXR_MAGIC):
        return _read_exr(file)
    if start.startswith(b"#?"):
        return _read_hdr(file)
    raise LoadError(file, "first bytes", start[:8], "an OpenEXR or a Radiance HDR image")


def _check_regular_file(file: Path) -> bytes:
    """Refuse what is missing, not a regular file, empty or too large; returns the first bytes."""
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
    return os.open(file, flags | getattr(os, "O_NONBLOCK", 0))  # a pipe nobody writes to would never open otherwise


def _check_size(file: Path, width: int, height: int) -> None:
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE and width * height <= MAX_PIXELS):
        expected = f"sides of 1 to {MAX_SIDE} and at most {MAX_PIXELS} pixels"
        raise LoadError(file, "image size", f"{width} x {height}", expected)


def _read_exr(file: Path) -> NDArray[np.float32]:
    _check_exr_compression(file)
    _check_exr_header(file, _open_exr(file, header_only=True).header)
    channels = _open_exr(file, header_only=False).channels
    planes = [channels[name].pixels for name in "RGB"]
    kinds = [plane.dtype.name for plane in planes]  # known only now: the library's header does not tell
    if len(set(kinds)) > 1 or kinds[0] not in ("float16", "float32"):
        raise LoadError(file, "types of channels R, G, B", ", ".join(kinds), "all half or all float")
    return np.stack([plane.astype(np.float32) for plane in planes], axis=2)


def _open_exr(file: Path, header_only: bool) -> Any:
    """The one part of an OpenEXR file; its absence, in whatever way the library puts it, becomes a LoadError."""
    import OpenEXR

    OpenEXR.setMaxImageSize(MAX_SIDE, MAX_SIDE)  # for the whole process; the library's own default is no limit
    parts, complaint = [], ""
    with silenced_library() as said:
        try:
            with _for_library(file) as source:
                parts = OpenEXR.File(source, separate_channels=True, header_only=header_only).parts
        except Exception as error:  # the library raises RuntimeError, ValueError, TypeError and its own
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
    """What OpenEXR opens a file by: its name, which it takes for UTF-8; of any other the open file."""
    name = str(file)
    if os.fsencode(name) == name.encode(errors="surrogatepass"):
        yield name
    else:
        with open(file, "rb") as opened:
            yield opened


@contextmanager
def silenced_library() -> Iterator[list[str]]:
    """Keep the library's remarks out of the terminal: C++ on standard error, Python on standard output.

    The lines from standard error are in the list on leaving. Standard error is the whole process's, so that what other
    threads say meanwhile is lost with it: hold this for one call only.
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
    """Read the raw compression byte: the library takes one it does not know for ZIP, without a word."""
    import OpenEXR

    with open(file, "rb") as opened:
        _, found, value = opened.read(65_536).partition(b"compression\0compression\0\1\0\0\0")
    n_known = int(OpenEXR.NUM_COMPRESSION_METHODS)
    if found and value and value[0] >= n_known:
        raise LoadError(file, "OpenEXR compression", value[0], f"0 to {n_known - 1}")


def _check_exr_header(file: Path, header: dict[str, Any]) -> None:
    kind = str(header.get("type", "scanlineimage")).rsplit(".", maxsplit=1)[-1]
    if kind not in ("scanlineimage", "tiledimage"):
        raise LoadError(file, "OpenEXR storage", kind, "scan lines or tiles (deep images are not supported)")
    (left, top), (right, bottom) = header["dataWindow"]
    width, height = int(right) - int(left) + 1, int(bottom) - int(top) + 1
    _check_size(file, width, height)
    (left, top), (right, bottom) = header["displayWindow"]
    display = (int(right) - int(left) + 1, int(bottom) - int(top) + 1)
    if display != (width, height):
        raise LoadError(file, "data window", f"{width} x {height}", f"the display window, {display[0]} x {display[1]}")
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


def _read_hdr(file: Path) -> NDArray[np.float32]:
    """Radiance RGBE: (r, g, b) 2^(e - 136), 0 where e = 0 [Ward91]; flat, old and new run-length scanlines.

    EXPOSURE lines are ignored, as by nearly every other program.
    """
    # Late: the only compiled part of reading a file, not needed by a process that reads OpenEXR alone.
    from engine.light._kernels import decode_rgbe

    with open(file, "rb") as opened:
        width, height, position = _parse_hdr_header(file, opened.read(65_536))
    _check_size(file, width, height)
    data = np.fromfile(file, np.uint8)
    pixels = np.zeros((height, width, 4), np.uint8)
    status, row, byte = decode_rgbe(data, position, pixels)
    if status != 0:
        found = {
            1: f"file ends at byte {len(data)}",
            2: f"a run at byte {byte} leaves its scanline",
            3: f"another width at byte {byte}",
            4: f"a repeat at byte {byte} with nothing to repeat",
        }[status]
        raise LoadError(file, f"scanline {row} of {height}", found, f"{width} pixels")
    scale = np.exp2(np.arange(256, dtype=np.float32) - np.float32(136.0))
    scale[0] = 0.0
    return pixels[..., :3].astype(np.float32) * scale[pixels[..., 3:]]


def _parse_hdr_header(file: Path, head: bytes) -> tuple[int, int, int]:
    """Width, height and the first byte of the pixels."""
    header, blank, rest = head.partition(b"\n\n")
    if not blank:
        raise LoadError(file, "Radiance header", "no empty line at its end", "a header, an empty line, the size")
    formats = re.findall(rb"^FORMAT\s*=\s*(\S+)", header, re.MULTILINE)
    if formats and formats[-1] != b"32-bit_rle_rgbe":
        raise LoadError(file, "FORMAT", formats[-1].decode(errors="replace"), "32-bit_rle_rgbe")
    line, newline, _ = rest.partition(b"\n")
    size = re.fullmatch(rb"-Y (\d{1,9}) \+X (\d{1,9})", line.strip())
    if not newline or not size:
        raise LoadError(file, "size line", line[:60].decode(errors="replace"), '"-Y HEIGHT +X WIDTH"')
    return int(size[2]), int(size[1]), len(header) + 2 + len(line) + 1
