"""Reads Radiance HDR images: RGBE or XYZE, flat or in either run-length encoding, in any order of pixels [Ward91]."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import xyz_to_rec709
from engine.core.errors import LoadError
from engine.light.picture_bands import (
    Float32Array,
    check_size,
    divisor_of,
    empty_image,
    fill_in_bands,
    to_rec709_with_note,
    transform_colours,
)

_RGBE, _XYZE = b"32-bit_rle_rgbe", b"32-bit_rle_xyze"
Header = dict[bytes, list[bytes]]


class _Side(NamedTuple):
    """One half of a size line: the axis, the number of pixels along it, and whether its coordinate increases."""

    axis: bytes
    grows: bool
    n: int


def read_hdr(file: Path, notes: list[str], most_pixels: int | None) -> Float32Array:
    """Reads (r, g, b) 2^(e - 136), 0 where e = 0 [Ward91].

    As Radiance defines it, values are divided by all EXPOSURE and COLORCORR of the header, XYZ becomes RGB, and the
    size line determines the order of the pixels. GAMMA concerns displays: the numbers are linear whatever it says.
    """
    # Imported late: the only compiled part of reading a file, which a process that reads only OpenEXR does not need.
    from engine.light._kernels import decode_rgbe

    with open(file, "rb") as opened:
        header, (first, second), position = _parse_header(file, opened.read(65_536))
    width, height = (second.n, first.n) if first.axis == b"Y" else (first.n, second.n)
    check_size(file, width, height)
    k = divisor_of(file, width, height, most_pixels, notes)
    factor, matrix = _conversion(header, notes)
    data = np.fromfile(file, np.uint8)
    scale = np.exp2(np.arange(256, dtype=np.float32) - np.float32(136.0))
    scale[0] = 0.0
    before = np.empty((0, second.n, 4), np.uint8)  # the scanline before a band, of which that may repeat a pixel

    def read(start: int, stop: int) -> Float32Array:
        nonlocal before, position
        n_before = len(before)
        quads = np.concatenate([before, np.zeros((stop - start, second.n, 4), np.uint8)])
        status, row, position = decode_rgbe(data, position, n_before, quads)
        if status != 0:
            found = {
                1: f"file ends at byte {len(data)}",
                2: f"a run at byte {position} leaves its scanline",
                3: f"another width at byte {position}",
                4: f"a repeat at byte {position} with nothing to repeat",
            }[status]
            raise LoadError(file, f"scanline {start + row - n_before} of {first.n}", found, f"{second.n} pixels")
        before = quads[-1:].copy()
        band = quads[n_before:, :, :3].astype(np.float32)
        with np.errstate(over="ignore"):
            band *= scale[quads[n_before:, :, 3:]] * factor
        return band if matrix is None else transform_colours(band, matrix)

    image = empty_image(height, width, k)
    fill_in_bands(_by_scanlines(image, first, second), first.n, k, second.n, read)
    return image


def _by_scanlines(image: Float32Array, first: _Side, second: _Side) -> Float32Array:
    """A view of an image, with rows from the top and pixels from the left, by the file's scanlines (first, second, 3);
    Y increases upwards."""
    view = image if first.axis == b"Y" else image.swapaxes(0, 1)
    for k, side in enumerate((first, second)):
        if side.grows != (side.axis == b"X"):
            view = np.flip(view, k)
    return view


def _conversion(header: Header, notes: list[str]) -> tuple[Float32Array, NDArray[np.float64] | None]:
    """What the header does to the numbers: their factors (3,) by EXPOSURE and COLORCORR, and the matrix to Rec. 709."""
    factor = np.ones(3)
    for name, count in ((b"EXPOSURE", 1), (b"COLORCORR", 3)):
        for value in header.get(name, ()):
            numbers = _floats(value, count)
            if numbers is not None and all(1e-30 < each < 1e30 for each in numbers):
                factor = factor / numbers
    if (np.abs(factor - 1.0) > 1e-6).any():
        notes.append(f"exposure of the header taken off: radiance times {' '.join(f'{each:.4g}' for each in factor)}")
    if header.get(b"FORMAT", [b""])[-1] == _XYZE:
        notes.append("CIE XYZ, converted to Rec. 709")
        return factor.astype(np.float32), xyz_to_rec709()
    primaries = _floats(header.get(b"PRIMARIES", [b""])[-1], 8)
    matrix = None if primaries is None or not any(primaries) else to_rec709_with_note(primaries, notes)
    return factor.astype(np.float32), matrix


def _floats(value: bytes, count: int) -> list[float] | None:
    """`count` finite numbers, or None."""
    try:
        numbers = [float(word) for word in value.split()]
    except ValueError:
        return None
    return numbers if len(numbers) == count and np.isfinite(numbers).all() else None


def _parse_header(file: Path, head: bytes) -> tuple[Header, tuple[_Side, _Side], int]:
    """The values of each name, the two halves of the size line, and the position of the first byte of the pixels."""
    blank = re.search(rb"\r?\n[ \t]*\r?\n", head)
    if not blank:
        raise LoadError(file, "Radiance header", "no empty line at its end", "a header, an empty line, the size")
    header: Header = {}
    for line in head[: blank.start()].splitlines():
        name, equals, value = line.partition(b"=")
        if equals and not line.startswith(b"#"):
            header.setdefault(name.strip(), []).append(value.strip())
    kind = header.get(b"FORMAT", [_RGBE])[-1]
    if kind not in (_RGBE, _XYZE):
        raise LoadError(file, "FORMAT", kind.decode(errors="replace"), "32-bit_rle_rgbe or 32-bit_rle_xyze")
    line, newline, _ = head[blank.end() :].partition(b"\n")
    found = re.fullmatch(rb"([+-])([XY]) (\d{1,9}) ([+-])([XY]) (\d{1,9})", line.strip())
    if not newline or not found or found[2] == found[5]:
        raise LoadError(file, "size line", line[:60].decode(errors="replace"), '"-Y HEIGHT +X WIDTH"')
    sides = _Side(found[2], found[1] == b"+", int(found[3])), _Side(found[5], found[4] == b"+", int(found[6]))
    return header, sides, blank.end() + len(line) + 1
