"""A strict reader of Wavefront OBJ files: vertices, normals and polygons; invalid numbers are rejected with their line.

Groups, lines and points are skipped, because scene files have their own; so are lines that no standard defines, with a
note. Materials are not read, and the material library is not opened: whatever its name, nothing outside the folder is
touched. Corners with the same position and normal become one vertex, whatever their texture coordinates, which count
only if all corners of the file have them. trimesh reads them differently: see `mesh`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError, describe_value
from engine.scene.mesh import Mesh, MeshFile
from engine.scene.polygons import TooIntricateError, triangulate

_IGNORED = frozenset("vp o g s usemtl l p mg usemap maplib lod shadow_obj trace_obj bevel c_interp d_interp".split())
_MAX_INDEX_DIGITS = 12
_MOST_NAMES = 4


@dataclass
class _Lines:
    """The data read so far; corners are (position, normal or −1, texture or −1), faces are indices of corners."""

    file: Path
    positions: list[list[float]] = field(default_factory=list)
    normals: list[list[float]] = field(default_factory=list)
    textures: list[list[float]] = field(default_factory=list)
    corners: list[tuple[int, int, int]] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    libraries: dict[str, None] = field(default_factory=dict)
    unknown: dict[str, int] = field(default_factory=dict)
    known_corners: dict[str, tuple[int, int, int]] = field(default_factory=dict)
    number: int = 0


def parse_obj(data: bytes, file: Path) -> MeshFile:
    """Parse the bytes of an OBJ file; raises LoadError naming the line and its content."""
    state = _Lines(file)
    if b"\0" in data:
        raise LoadError(file, f"byte {data.index(0)}", "binary data", "the text of an OBJ file")
    held: list[str] = []
    for state.number, line in enumerate(data.decode("utf-8", "replace").split("\n"), start=1):
        line = line.rstrip()
        if line.endswith("\\"):
            held.append(line[:-1])
            continue
        if held:
            line, held = " ".join((*held, line)), []
        _read_line(state, line.partition("#")[0].split())
    if held:
        raise LoadError(file, f"line {state.number}", "\\", "a line after the last continuation")
    return MeshFile(_assemble(state, len(data)), _notes(state), _listed(state.libraries))


def _read_line(state: _Lines, words: list[str]) -> None:
    """Add one line to the state."""
    if not words or words[0] in _IGNORED:
        return
    if words[0] == "f":
        _read_face(state, words[1:])
    elif words[0] == "v":
        state.positions.append(_numbers(state, words, (3, 4, 6, 7)))
    elif words[0] == "vn":
        state.normals.append(_numbers(state, words, (3,)))
    elif words[0] == "vt":
        state.textures.append((_numbers(state, words, (1, 2, 3)) + [0.0])[:2])
    elif words[0] == "mtllib":
        state.libraries[" ".join(words[1:])] = None
    else:
        state.unknown[words[0]] = state.unknown.get(words[0], 0) + 1


def _notes(state: _Lines) -> tuple[str, ...]:
    """A note on skipped lines, if there were any."""
    if not state.unknown:
        return ()
    n = sum(state.unknown.values())
    return (f"{n} lines of unknown kinds are left out: {_listed(state.unknown)}",)


def _listed(names: dict[str, Any]) -> str:
    """The first few names, shortened."""
    more = len(names) - _MOST_NAMES
    return ", ".join(describe_value(name) for name in [*names][:_MOST_NAMES]) + (
        f" and {more} more" if more > 0 else ""
    )


def _numbers(state: _Lines, words: list[str], counts: tuple[int, ...]) -> list[float]:
    """The first three numbers of a line."""
    try:
        numbers = [float(word) for word in words[1:]]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or "_" in "".join(words):
        raise _line_error(state, " ".join(words), f"{counts[0]} numbers after {words[0]}")
    return numbers[:3]


def _read_face(state: _Lines, words: list[str]) -> None:
    """A polygon of corners `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative indices count back from the last one."""
    if len(words) < 3:
        raise _line_error(state, "f " + " ".join(words), "at least 3 corners")
    for word in words:
        state.corners.append(state.known_corners.get(word) or _read_corner(state, word))
    state.lengths.append(len(words))
    state.lines.append(state.number)


def _read_corner(state: _Lines, word: str) -> tuple[int, int, int]:
    """(position, normal, texture) of a corner; absolute indices are cached, because their meaning does not depend on
    the line."""
    parts = word.split("/")
    if len(parts) > 3:
        raise _line_error(state, word, "v, v/vt, v//vn or v/vt/vn")
    position = _index(state, word, parts[0], len(state.positions), "v")
    normal = _index(state, word, parts[2], len(state.normals), "vn") if len(parts) == 3 and parts[2] else -1
    texture = _index(state, word, parts[1], len(state.textures), "vt") if len(parts) > 1 and parts[1] else -1
    corner = position, normal, texture
    if "-" not in word:
        state.known_corners[word] = corner
    return corner


def _index(state: _Lines, word: str, digits: str, count: int, kind: str) -> int:
    """The zero-based index of a reference; forward references are checked at the end."""
    plain = digits.removeprefix("-")
    if not (plain.isascii() and plain.isdecimal() and len(plain) <= _MAX_INDEX_DIGITS) or int(plain) == 0:
        raise _line_error(state, word, f"indices from 1, or from -1 down, to {kind}")
    number = int(digits)
    if number < 0 and count + number < 0:
        raise _line_error(state, word, f"{kind} indices from -{count} to -1")
    return count + number if number < 0 else number - 1


def _assemble(state: _Lines, n_bytes: int) -> Mesh:
    """Triangles over vertices that differ in position or normal."""
    if not state.lengths:
        raise LoadError(state.file, "faces", 0, "at least one line f")
    corners = np.array(state.corners, np.int64)
    _check_range(state, corners[:, 0], len(state.positions), "v")
    _check_range(state, corners[:, 1], len(state.normals), "vn")
    _check_range(state, corners[:, 2], len(state.textures), "vt")
    has_normals = bool((corners[:, 1] >= 0).all())
    if not has_normals:
        corners[:, 1] = 0
    width = max(1, len(state.normals))
    keys, index = np.unique(corners[:, 0] * width + corners[:, 1], return_inverse=True)
    positions = np.array(state.positions)
    normals = np.array(state.normals)[keys % width] if has_normals else None
    lengths = np.array(state.lengths)
    try:
        triangles = triangulate(positions[corners[:, 0]], lengths, n_bytes)
    except TooIntricateError as error:
        line, found = state.lines[error.polygon], f"{state.lengths[error.polygon]} corners"
        raise LoadError(state.file, f"line {line}", found, "a polygon that is quickly cut into triangles") from None
    uvs = _uvs(state, corners[:, 2], triangles)
    return Mesh(positions[keys // width], index.astype(np.int32)[triangles], normals, uvs)


def _uvs(state: _Lines, textures: npt.NDArray[np.int64], triangles: npt.NDArray[np.int32]) -> npt.NDArray | None:
    """Texture coordinates of the triangles' corners, (T, 3, 2), if all corners have some."""
    if (textures < 0).any():
        return None
    # In double precision here: `validate_mesh` reports values too large for single precision, not a warning.
    values = np.clip(np.array(state.textures), -1e30, 1e30).astype(np.float32)
    return values[textures[triangles]]


def _check_range(state: _Lines, indices: npt.NDArray[np.int64], count: int, kind: str) -> None:
    """Reject indices past the last vertex or normal, with the line of their face."""
    if (indices >= count).any():
        at = int(np.argmax(indices >= count))
        face = int(np.searchsorted(np.cumsum(state.lengths), at, "right"))
        raise LoadError(
            state.file, f"line {state.lines[face]}: {kind} index", int(indices[at]) + 1, f"an index from 1 to {count}"
        )


def _line_error(state: _Lines, value: str, expected: str) -> LoadError:
    """An error at the current line."""
    return LoadError(state.file, f"line {state.number}", value, expected)
