"""Reads radiance images, OpenEXR and Radiance HDR, from files that may be malicious, broken or not images at all.

Accepts regular files only, and checks size and header before any pixel is read (`exr_files`, `hdr_files`). An image of
more than `MAX_PIXELS` is averaged to a half or a quarter of its size, one band of rows at a time (`picture_bands`).
Negative and non-finite values pass: the caller handles them. Images are interpreted as their headers state: data window
within display window, primaries converted to Rec. 709, orientation by the size line.

OpenImageIO 3.2 was rejected after a trial (Apache-2.0, 20 MB installed). It reads probes and textures to the same
numbers, and refuses truncated files and headers that claim 10 GB. It takes half of the processor time for HDR (14 ms a
million pixels, 31 here), two thirds to four fifths for OpenEXR, about as much for PNG, and a third more than Pillow for
JPEG. But an image is read once, the checks below would remain, and so would Pillow and OpenEXR, which show and write
pictures.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError
from engine.core.safe_files import local_path
from engine.light.exr_files import EXR_MAGIC, read_exr
from engine.light.hdr_files import read_hdr
from engine.light.picture_bands import MAX_PIXELS

MAX_FILE_BYTES = 1 << 30


def read_radiance_image(
    file: Path,
    notes: list[str] | None = None,
    is_colour: bool = True,
    most_pixels: int | None = None,
    may_reduce: bool = True,
) -> NDArray[np.float32]:
    """The RGB image in an .exr or .hdr file (identified by content, not by name): (H, W, 3) float32, row 0 at the top.

    notes receives a line for each conversion. is_colour: False where the numbers are not colours, such as normals or
    weights, and must not be converted. most_pixels: the size that an image of more than `MAX_PIXELS` is reduced to, by
    default that number; not may_reduce: one of more is refused. Raises LoadError for anything that cannot be read as
    one complete image with sides of at most 16,384.
    """
    said: list[str] = [] if notes is None else notes
    largest = (MAX_PIXELS if most_pixels is None else most_pixels) if may_reduce else None
    start = read_start(file)
    file = local_path(file)
    if start.startswith(EXR_MAGIC):
        return read_exr(file, said, is_colour, largest)
    if start.startswith(b"#?") or b"FORMAT=32-bit_rle_" in start:  # some programs leave the first line out
        return read_hdr(file, said, largest)
    raise LoadError(file, "first bytes", start[:8], "an OpenEXR or a Radiance HDR image")


def read_start(file: Path) -> bytes:
    """The first bytes of a file. Raises LoadError for files that are missing, not regular, empty or too large."""
    try:
        opened = open(local_path(file), "rb", opener=_open_without_waiting)
    except (OSError, ValueError) as error:
        raise LoadError(file, "file", str(error), "a readable file") from None
    with opened:
        status = os.fstat(opened.fileno())
        if not stat.S_ISREG(status.st_mode):
            raise LoadError(file, "file", "not a regular file", "a regular file")
        if not 0 < status.st_size <= MAX_FILE_BYTES:
            raise LoadError(file, "file size", f"{status.st_size} bytes", f"1 to {MAX_FILE_BYTES} bytes")
        return opened.read(512)


def _open_without_waiting(file: str, flags: int) -> int:
    return os.open(file, flags | getattr(os, "O_NONBLOCK", 0))  # otherwise opening a pipe without a writer would block
