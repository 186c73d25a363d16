"""A strict reader of PLY files (ASCII, binary little and big endian).

Every count in the header is checked against the available bytes before anything is allocated, so that a truncated file,
a negative count and a header that claims 10⁹ vertices all end in one line that names the error. Bytes after the last
element are skipped with a note. Polygons and strips (`tristrips`, a list in which −1 separates strips) become
triangles; properties other than x y z, nx ny nz, texture coordinates (s t, u v or texture_u texture_v) and the vertex
indices of faces are skipped. trimesh reads such files differently: see `mesh`.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.scene.mesh import Mesh, MeshFile
from engine.scene.polygons import TooIntricateError, triangulate

_MAX_HEADER = 65536
_MAX_COUNT = 2**31 - 1
_TYPES = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
          "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
          "double": "f8", "float64": "f8"}  # fmt: skip
_CODES = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I"}
_CORNERS = ("vertex_indices", "vertex_index")
_SURFACES = ("face", "tristrips")
_UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}

Column = npt.NDArray[np.float64] | npt.NDArray[np.int64]


@dataclass(frozen=True)
class _Property:
    name: str
    type: str
    count_type: str | None = None  # set for lists


@dataclass
class _Element:
    name: str
    count: int
    properties: list[_Property]

    def has_lists(self) -> bool:
        """Whether its rows differ in length."""
        return any(p.count_type for p in self.properties)

    def reads(self, p: _Property) -> bool:
        """Whether a property is used; others are skipped."""
        return self.name == "vertex" and not p.count_type or self.name in _SURFACES and p.name in _CORNERS


@dataclass
class _Lists:
    """Rows of different length: the lengths (N,) and all values one after the other."""

    lengths: npt.NDArray[np.int64]
    values: npt.NDArray[np.float64]


def parse_ply(data: bytes, file: Path) -> MeshFile:
    """Parse the bytes of a PLY file; raises LoadError naming the line, element or byte."""
    elements, byte_order, body = _parse_header(data, file)
    if byte_order:
        columns, notes = _read_binary(data, body, elements, byte_order, file)
    else:
        columns, notes = _read_ascii(data, body, elements, file)
    vertices = _vectors(columns, "vertex", "x y z", file)
    normals = _vectors(columns, "vertex", "nx ny nz", file) if ("vertex", "nx") in columns else None
    triangles = _triangles(columns, vertices, len(data), file)
    return MeshFile(Mesh(vertices, triangles, normals, _uvs(columns, triangles)), notes)


def _triangles(columns: dict, vertices: npt.NDArray[np.float64], n_bytes: int, file: Path) -> npt.NDArray[np.int32]:
    """Triangles of all faces, then of all strips."""
    found = []
    for element, read in (("face", _of_polygons), ("tristrips", _of_strips)):
        lists = next((columns[element, name] for name in _CORNERS if (element, name) in columns), None)
        if isinstance(lists, _Lists):
            found.append(read(lists, vertices, n_bytes, file))
    if not found:
        raise LoadError(file, "element face", "no list vertex_indices", "a list of vertex indices")
    return np.concatenate(found)


def _uvs(columns: dict, triangles: npt.NDArray[np.int32]) -> npt.NDArray[np.float32] | None:
    """Texture coordinates of the triangles' corners, (T, 3, 2), if the vertices have some."""
    for names in _UV_NAMES:
        found = [columns.get(("vertex", name)) for name in names]
        if not any(column is None or isinstance(column, _Lists) for column in found):
            values = np.stack(found, axis=1).astype(np.float64)  # type: ignore[arg-type]
            return np.clip(values, -1e30, 1e30).astype(np.float32)[triangles]
    return None


def _parse_header(data: bytes, file: Path) -> tuple[list[_Element], str, int]:
    """Elements, byte order ("" for ASCII) and the start of the body."""
    if not data.startswith((b"ply\n", b"ply\r")):
        raise LoadError(file, "first line", data[:16].decode("ascii", "replace"), "ply")
    end = data.find(b"end_header", 0, _MAX_HEADER)
    body = data.find(b"\n", end) + 1
    if end < 0 or body <= 0:
        raise LoadError(file, "header", "no end_header", f"end_header within {_MAX_HEADER} bytes")
    elements: list[_Element] = []
    byte_order: str | None = None
    for number, line in enumerate(data[:end].decode("ascii", "replace").splitlines()[1:], start=2):
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        if words[0] == "format" and len(words) == 3 and words[1] in _FORMATS and words[2] == "1.0":
            byte_order = _FORMATS[words[1]]
        elif words[0] == "element" and len(words) == 3:
            elements.append(_Element(words[1], _parse_count(words[2], number, file), []))
        elif words[0] == "property" and elements and (found := _parse_property(words)):
            elements[-1].properties.append(found)
        else:
            raise LoadError(file, f"line {number}", line, "a PLY 1.0 format, element or property")
    if byte_order is None:
        raise LoadError(file, "header", "no format", "format ascii, binary_little_endian or binary_big_endian")
    return elements, byte_order, body


def _parse_count(word: str, number: int, file: Path) -> int:
    """The number of rows that an element claims."""
    count = int(word) if word.removeprefix("-").isdecimal() and len(word) < 20 else None
    if count is None or not 0 <= count <= _MAX_COUNT:
        raise LoadError(file, f"line {number}: count", word, f"a number from 0 to {_MAX_COUNT}")
    return count


def _parse_property(words: list[str]) -> _Property | None:
    """`property TYPE NAME` or `property list TYPE TYPE NAME`, None if it is neither."""
    if len(words) == 3 and words[1] in _TYPES:
        return _Property(words[2], _TYPES[words[1]])
    if len(words) == 5 and words[1] == "list" and words[2] in _TYPES and words[3] in _TYPES:
        if _TYPES[words[2]][0] != "f":
            return _Property(words[4], _TYPES[words[3]], _TYPES[words[2]])
    return None


def _read_binary(data: bytes, start: int, elements: list[_Element], order: str, file: Path) -> tuple:
    """All columns of a binary body, by (element, property), and notes."""
    columns: dict[tuple[str, str], Column | _Lists] = {}
    for element in elements:
        if not element.has_lists():
            found, start = _read_rows(data, start, element, order, {}, file)
        else:
            found, start = _read_list_rows(data, start, element, order, file)
        columns |= found
    rest = len(data[start:].strip())  # many programs end a file with a new line
    return columns, (f"{rest} bytes after the last element are left out",) if rest else ()


def _row_type(element: _Element, order: str, lengths: dict[str, int]) -> np.dtype:
    """The layout of one row when every list has a known length."""
    fields: list[tuple] = []
    for i, p in enumerate(element.properties):
        if p.count_type:
            fields += [(f"n{i}", order + p.count_type), (f"v{i}", order + p.type, (lengths[p.name],))]
        else:
            fields.append((f"v{i}", order + p.type))
    return np.dtype(fields)


def _read_rows(data: bytes, start: int, element: _Element, order: str, lengths: dict[str, int], file: Path) -> tuple:
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
    columns: dict[tuple[str, str], Column | _Lists] = {}
    for i, p in enumerate(element.properties):
        if element.reads(p):
            values = rows[f"v{i}"].astype(np.float64)
            counts = rows[f"n{i}"].astype(np.int64) if p.count_type else None
            columns[element.name, p.name] = values if counts is None else _Lists(counts, values.reshape(-1))
    return columns, end


def _read_list_rows(data: bytes, start: int, element: _Element, order: str, file: Path) -> tuple:
    """Read an element with lists: at a fixed stride if the first row's lengths hold for all, else row by row."""
    if not element.count:
        return {(element.name, p.name): _Lists(np.zeros(0, np.int64), np.zeros(0)) for p in element.properties}, start
    lengths, first_end = _first_lengths(data, start, element, order, file)
    if start + (first_end - start) * element.count <= len(data):
        columns, end = _read_rows(data, start, element, order, lengths, file)
        if columns is not None:
            return columns, end
    return _walk_rows(data, start, element, order, file)


def _first_lengths(data: bytes, start: int, element: _Element, order: str, file: Path) -> tuple[dict[str, int], int]:
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


def _walk_rows(data: bytes, start: int, element: _Element, order: str, file: Path) -> tuple:
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
            columns[element.name, p.name] = _Lists(lengths, flat) if p.count_type else flat
    return columns, start


def _counter(p: _Property, order: str) -> struct.Struct | None:
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


def _scalar(data: bytes, start: int, layout: str, element: _Element, file: Path) -> int:
    """One value at a byte offset."""
    if start + np.dtype(layout).itemsize > len(data):
        _truncated(data, start, element, np.dtype(layout).itemsize, file)
    return np.frombuffer(data, layout, 1, start)[0]


def _truncated(data: bytes, start: int, element: _Element, row: int, file: Path) -> NoReturn:
    """An error: an element claims more rows than there are bytes for."""
    raise LoadError(
        file,
        f"element {element.name}",
        f"{element.count} rows, truncated at byte {len(data)}",
        f"at most {max(0, len(data) - start) // row} rows in the bytes that are there",
    )


def _read_ascii(data: bytes, start: int, elements: list[_Element], file: Path) -> tuple:
    """All columns of an ASCII body, one row a line, and notes."""
    first = data.count(b"\n", 0, start) + 1
    lines = [(first + i, words) for i, line in enumerate(data[start:].split(b"\n")) if (words := line.split())]
    claimed = sum(e.count for e in elements if e.properties)
    if claimed > len(lines):
        raise LoadError(file, "rows in the body", len(lines), f"{claimed} rows, as the header counts")
    columns: dict[tuple[str, str], Column | _Lists] = {}
    at = 0
    for element in (e for e in elements if e.properties):
        rows = lines[at : at + element.count]
        columns |= _ascii_lists(rows, element, file) if element.has_lists() else _ascii_rows(rows, element, file)
        at += element.count
    rest = len(lines) - at
    return columns, (f"{rest} lines after the last element are left out",) if rest else ()


def _ascii_rows(rows: list[tuple[int, list[bytes]]], element: _Element, file: Path) -> dict:
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


def _ascii_lists(rows: list[tuple[int, list[bytes]]], element: _Element, file: Path) -> dict:
    """The columns of lines that contain lists."""
    table = _fast_table(rows)
    if table is not None and len(element.properties) == 1 and (table[:, 0] == table.shape[1] - 1).all():
        return {(element.name, element.properties[0].name): _Lists(table[:, 0].astype(np.int64), table[:, 1:].ravel())}
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
        (element.name, p.name): _Lists(np.array(counts[p.name], np.int64), np.array(values[p.name], np.float64))
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


def _vectors(columns: dict, element: str, names: str, file: Path) -> npt.NDArray[np.float64]:
    """Three columns as (N, 3)."""
    found = [columns.get((element, name)) for name in names.split()]
    if any(column is None or isinstance(column, _Lists) for column in found):
        raise LoadError(file, f"element {element}", "missing properties", f"the properties {names}")
    return np.stack(found, axis=1)  # type: ignore[arg-type]


def _of_polygons(faces: _Lists, vertices: npt.NDArray[np.float64], n_bytes: int, file: Path) -> npt.NDArray[np.int32]:
    """The polygons as triangles, in the order of the file."""
    if len(faces.lengths) and (short := faces.lengths < 3).any():
        k = int(np.argmax(short))
        raise LoadError(file, f"face {k}", f"{faces.lengths[k]} vertices", "at least 3 vertices")
    corners = _indices(faces, len(vertices), "face", 0, file)
    if not len(corners):
        return np.zeros((0, 3), np.int32)
    try:
        return corners[triangulate(vertices[corners], faces.lengths, n_bytes)]
    except TooIntricateError as error:
        found = f"{faces.lengths[error.polygon]} vertices"
        raise LoadError(file, f"face {error.polygon}", found, "a polygon that is quickly cut into triangles") from None


def _of_strips(strips: _Lists, vertices: npt.NDArray[np.float64], n_bytes: int, file: Path) -> npt.NDArray[np.int32]:
    """Triangles of strips: each corner makes one with the two before it, every other one with opposite winding.
    Triangles that repeat a corner only connect strips."""
    corners = _indices(strips, len(vertices), "tristrips", -1, file)
    begins = np.zeros(len(corners), bool)
    begins[(np.cumsum(strips.lengths) - strips.lengths)[strips.lengths > 0]] = True
    begins[1:] |= corners[:-1] < 0
    places = np.arange(len(corners))
    since = places - np.maximum.accumulate(np.where(begins, places, 0))
    last = np.flatnonzero((since >= 2) & (corners >= 0))
    triangles = np.stack([corners[last - 2], corners[last - 1], corners[last]], axis=1)
    odd = since[last] % 2 == 1
    triangles[odd] = triangles[odd][:, (1, 0, 2)]
    a, b, c = triangles.T
    return triangles[(a != b) & (b != c) & (c != a)]


def _indices(lists: _Lists, n_vertices: int, element: str, least: int, file: Path) -> npt.NDArray[np.int32]:
    """The indices of lists, checked before they are narrowed."""
    values = lists.values
    inside = (values >= least) & (values < n_vertices) & (values == np.floor(values))
    if not inside.all():
        at = int(np.argmin(inside))
        k = int(np.searchsorted(np.cumsum(lists.lengths), at, "right"))
        raise LoadError(file, f"{element} {k}", f"{values[at]:.17g}", f"indices from {least} to {n_vertices - 1}")
    return values.astype(np.int32)
