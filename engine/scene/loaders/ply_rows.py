"""The rows of PLY files (ASCII, binary little and big endian) as columns of numbers.

Every count is checked against the available bytes before anything is allocated.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError

_CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I"}
CORNERS = ("vertex_indices", "vertex_index")
SURFACES = ("face", "tristrips")
# Of faces: texture coordinates of the corners, a list, and the number of the image, a scalar.
TEXCOORD, TEXNUMBER = "texcoord", "texnumber"
COLOURS = (("red", "green", "blue", "alpha"), ("r", "g", "b", "a"))

Column = npt.NDArray[np.float64] | npt.NDArray[np.int64]


@dataclass(frozen=True)
class Property:
    name: str
    type: str
    count_type: str | None = None  # set for lists


@dataclass
class Element:
    name: str
    count: int
    properties: list[Property]

    def has_lists(self) -> bool:
        """Whether its rows differ in length."""
        return any(p.count_type for p in self.properties)

    def reads(self, p: Property) -> bool:
        """Whether a property is used; others are skipped."""
        if p.count_type:
            return self.name in SURFACES and p.name in CORNERS or (self.name, p.name) == ("face", TEXCOORD)
        of_faces = {TEXNUMBER, *(name for names in COLOURS for name in names)}
        return self.name == "vertex" or self.name == "face" and p.name in of_faces


@dataclass
class Lists:
    """Rows of different length: the lengths (N,) and all values one after the other."""

    lengths: npt.NDArray[np.int64]
    values: npt.NDArray[np.float64]


def read_binary(data: bytes, start: int, elements: list[Element], order: str, file: Path) -> tuple:
    """All columns of a binary body, by (element, property), and notes."""
    columns: dict[tuple[str, str], Column | Lists] = {}
    for element in elements:
        if not element.has_lists():
            found, start = _read_rows(data, start, element, order, {}, file)
        else:
            found, start = _read_list_rows(data, start, element, order, file)
        columns |= found
    rest = len(data[start:].strip())  # many programs end a file with a new line
    return columns, (f"{rest} bytes after the last element are left out",) if rest else ()


def _row_type(element: Element, order: str, lengths: dict[str, int]) -> np.dtype:
    """The layout of one row when every list has a known length."""
    fields: list[tuple] = []
    for i, p in enumerate(element.properties):
        if p.count_type:
            fields += [(f"n{i}", order + p.count_type), (f"v{i}", order + p.type, (lengths[p.name],))]
        else:
            fields.append((f"v{i}", order + p.type))
    return np.dtype(fields)


def _read_rows(data: bytes, start: int, element: Element, order: str, lengths: dict[str, int], file: Path) -> tuple:
    """Columns of an element whose rows all have one layout, and the start of the next element; no columns if the length
    of a list changes."""
    if not element.properties:
        return {}, start
    layout = _row_type(element, order, lengths)
    end = start + layout.itemsize * element.count
    if end > len(data):
        _truncated(data, start, element, layout.itemsize, file)
    rows = np.frombuffer(data, layout, element.count, start)
    if any((rows[f"n{i}"] != lengths[p.name]).any() for i, p in enumerate(element.properties) if p.count_type):
        return None, start
    columns: dict[tuple[str, str], Column | Lists] = {}
    for i, p in enumerate(element.properties):
        if element.reads(p):
            values = rows[f"v{i}"].astype(np.float64)
            counts = rows[f"n{i}"].astype(np.int64) if p.count_type else None
            columns[element.name, p.name] = values if counts is None else Lists(counts, values.reshape(-1))
    return columns, end


def _read_list_rows(data: bytes, start: int, element: Element, order: str, file: Path) -> tuple:
    """Read an element with lists: at a fixed stride if the first row's lengths hold for all, else row by row."""
    if not element.count:
        return {(element.name, p.name): Lists(np.zeros(0, np.int64), np.zeros(0)) for p in element.properties}, start
    lengths, first_end = _first_lengths(data, start, element, order, file)
    if start + (first_end - start) * element.count <= len(data):
        columns, end = _read_rows(data, start, element, order, lengths, file)
        if columns is not None:
            return columns, end
    return _walk_rows(data, start, element, order, file)


def _first_lengths(data: bytes, start: int, element: Element, order: str, file: Path) -> tuple[dict[str, int], int]:
    """The list lengths of the row at `start`, and the end of that row."""
    lengths: dict[str, int] = {}
    for p in element.properties:
        if p.count_type:
            lengths[p.name] = int(_scalar(data, start, order + p.count_type, element, file))
            start += np.dtype(p.count_type).itemsize
        start += np.dtype(p.type).itemsize * max(0, lengths.get(p.name, 1))
        if start > len(data) or lengths.get(p.name, 0) < 0:
            raise LoadError(
                file,
                f"element {element.name}: list {p.name} of its first row",
                lengths.get(p.name, 1),
                "a length that fits the file",
            )
    return lengths, start


def _walk_rows(data: bytes, start: int, element: Element, order: str, file: Path) -> tuple:
    """Read an element with lists of different lengths, one row at a time; unused properties are skipped."""
    size = len(data)
    if element.count > size - start:
        _truncated(data, start, element, 1, file)
    found: dict[str, tuple[list[int], list[int]]] = {p.name: ([], []) for p in element.properties if element.reads(p)}
    steps = [(_counter(p, order), np.dtype(p.type).itemsize, found.get(p.name)) for p in element.properties]
    for row in range(element.count):
        for counter, itemsize, runs in steps:
            n = 1
            if counter is not None:
                if start + counter.size > size:
                    _truncated(data, start, element, counter.size, file)
                (n,) = counter.unpack_from(data, start)
                start += counter.size
            end = start + itemsize * n
            if n < 0 or end > size:
                raise LoadError(
                    file,
                    f"element {element.name}: row {row}",
                    f"a list of {n}",
                    f"a length that fits the file of {size} bytes",
                )
            if runs is not None:
                runs[0].append(n)
                runs[1].append(start)
            start = end
    columns = {}
    for p in element.properties:
        if p.name in found:
            lengths, starts = (np.array(each, np.int64) for each in found[p.name])
            flat = _gather_runs(data, starts, lengths, order + p.type)
            columns[element.name, p.name] = Lists(lengths, flat) if p.count_type else flat
    return columns, start


def _counter(p: Property, order: str) -> struct.Struct | None:
    """Return a function that reads the length of a list."""
    return struct.Struct(order + _CODES[p.count_type]) if p.count_type else None


def _gather_runs(
    data: bytes, starts: npt.NDArray[np.int64], lengths: npt.NDArray[np.int64], layout: str
) -> npt.NDArray[np.float64]:
    """All values of runs that begin at byte offsets, one run after the other."""
    size = np.dtype(layout).itemsize
    within = np.arange(int(lengths.sum())) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    at = np.repeat(starts, lengths) + size * within
    octets = np.frombuffer(data, np.uint8)[at[:, None] + np.arange(size)]
    return octets.view(layout)[:, 0].astype(np.float64)


def _scalar(data: bytes, start: int, layout: str, element: Element, file: Path) -> int:
    """One value at a byte offset."""
    if start + np.dtype(layout).itemsize > len(data):
        _truncated(data, start, element, np.dtype(layout).itemsize, file)
    return np.frombuffer(data, layout, 1, start)[0]


def _truncated(data: bytes, start: int, element: Element, row: int, file: Path) -> NoReturn:
    """An error: an element claims more rows than there are bytes for."""
    raise LoadError(
        file,
        f"element {element.name}",
        f"{element.count} rows, truncated at byte {len(data)}",
        f"at most {max(0, len(data) - start) // row} rows in the bytes that are there",
    )


def read_ascii(data: bytes, start: int, elements: list[Element], file: Path) -> tuple:
    """All columns of an ASCII body, one row a line, and notes."""
    first = data.count(b"\n", 0, start) + 1
    lines = [(first + i, words) for i, line in enumerate(data[start:].split(b"\n")) if (words := line.split())]
    claimed = sum(e.count for e in elements if e.properties)
    if claimed > len(lines):
        raise LoadError(file, "rows in the body", len(lines), f"{claimed} rows, as the header counts")
    columns: dict[tuple[str, str], Column | Lists] = {}
    at = 0
    for element in (e for e in elements if e.properties):
        rows = lines[at : at + element.count]
        columns |= _ascii_lists(rows, element, file) if element.has_lists() else _ascii_rows(rows, element, file)
        at += element.count
    rest = len(lines) - at
    return columns, (f"{rest} lines after the last element are left out",) if rest else ()


def _ascii_rows(rows: list[tuple[int, list[bytes]]], element: Element, file: Path) -> dict:
    """The columns of lines with one number for each property."""
    width = len(element.properties)
    table = _fast_table(rows)
    if table is not None and table.shape[1] == width:
        return {(element.name, p.name): table[:, i] for i, p in enumerate(element.properties)}
    table = np.empty((len(rows), width))
    for i, (number, words) in enumerate(rows):
        if len(words) != width:
            raise LoadError(file, f"line {number}", _join(words), f"{width} numbers")
        table[i] = _numbers(words, number, file)
    return {(element.name, p.name): table[:, i] for i, p in enumerate(element.properties)}


def _ascii_lists(rows: list[tuple[int, list[bytes]]], element: Element, file: Path) -> dict:
    """The columns of lines that contain lists."""
    table = _fast_table(rows)
    if table is not None and len(element.properties) == 1 and (table[:, 0] == table.shape[1] - 1).all():
        return {(element.name, element.properties[0].name): Lists(table[:, 0].astype(np.int64), table[:, 1:].ravel())}
    counts: dict[str, list[int]] = {p.name: [] for p in element.properties}
    values: dict[str, list[float]] = {p.name: [] for p in element.properties}
    for number, words in rows:
        numbers, at = _numbers(words, number, file), 0
        for p in element.properties:
            n = 1
            if p.count_type:
                n = int(numbers[at]) if at < len(numbers) and numbers[at].is_integer() else -1
                at += 1
            if n < 0 or at + n > len(numbers):
                raise LoadError(file, f"line {number}", _join(words), "a list length and as many numbers")
            counts[p.name].append(n)
            values[p.name] += numbers[at : at + n]
            at += n
        if at != len(numbers):
            raise LoadError(file, f"line {number}", _join(words), f"{at} numbers")
    return {
        (element.name, p.name): Lists(np.array(counts[p.name], np.int64), np.array(values[p.name], np.float64))
        for p in element.properties
    }


def _fast_table(rows: list[tuple[int, list[bytes]]]) -> npt.NDArray[np.float64] | None:
    """All lines as one table if they are numbers, equally many on each, else None: then the reader goes line by
    line."""
    width = len(rows[0][1]) if rows else 0
    if not width or any(len(words) != width for _, words in rows):
        return None
    flat = [word for _, words in rows for word in words]
    try:
        return None if any(b"_" in word for word in flat) else np.array(flat).astype(np.float64).reshape(-1, width)
    except ValueError:
        return None


def _numbers(words: list[bytes], number: int, file: Path) -> list[float]:
    """The numbers of a line; underscores, which Python accepts in numbers, are invalid."""
    try:
        if any(b"_" in word for word in words):
            raise ValueError
        return [float(word) for word in words]
    except ValueError:
        raise LoadError(file, f"line {number}", _join(words), "numbers") from None


def _join(words: list[bytes]) -> str:
    """A line's words as text."""
    return b" ".join(words[:16]).decode("ascii", "replace")
