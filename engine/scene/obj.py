"""A strict reader of Wavefront OBJ files: vertices, normals and polygons, every line understood or refused by number.

Materials, groups, lines and points say nothing that a scene file does not say itself and are stepped over; a material
library is never opened, but one outside the folder is refused, so that a file that reaches out is noticed. Corners with
the same position and normal become one vertex, whatever their texture coordinates; those count where all corners of the
file have them. trimesh reads such files otherwise: see `mesh`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.errors import LoadError
from engine.files import resolve_inside
from engine.scene.mesh import Mesh, fan_triangles

_IGNORED = frozenset("vp o g s usemtl l p mg usemap maplib lod shadow_obj trace_obj bevel c_interp d_interp".split())
_MAX_INDEX_DIGITS = 12
_MOST_LIBRARIES = 64


@dataclass
class _Lines:
    """What has been read so far; corners are (position, normal or −1, texture or −1), faces their numbers of
    corners."""

    file: Path
    positions: list[list[float]] = field(default_factory=list)
    normals: list[list[float]] = field(default_factory=list)
    textures: list[list[float]] = field(default_factory=list)
    corners: list[tuple[int, int, int]] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    libraries: set[str] = field(default_factory=set)
    known_corners: dict[str, tuple[int, int, int]] = field(default_factory=dict)
    number: int = 0


def parse_obj(data: bytes, file: Path) -> Mesh:
    """The mesh in the bytes of an OBJ file; raises LoadError naming the line and what stands there."""
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
    return _assemble(state)


def _read_line(state: _Lines, words: list[str]) -> None:
    """Take one line into the state."""
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
        for name in words[1:]:
            if name not in state.libraries:
                _check_library(state, name)
    else:
        raise _refused(state, " ".join(words), "v, vn, vt, f, o, g, s, usemtl, mtllib or a comment")


def _check_library(state: _Lines, name: str) -> None:
    """Note a material library of the file's folder; following names to where they lead takes long."""
    if len(state.libraries) == _MOST_LIBRARIES:
        raise _refused(state, f"mtllib {name}", f"at most {_MOST_LIBRARIES} material libraries")
    resolve_inside(state.file.parent, name, state.file, f"line {state.number}: mtllib")
    state.libraries.add(name)


def _numbers(state: _Lines, words: list[str], counts: tuple[int, ...]) -> list[float]:
    """The first three of a line's numbers."""
    try:
        numbers = [float(word) for word in words[1:]]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or "_" in "".join(words):
        raise _refused(state, " ".join(words), f"{counts[0]} numbers after {words[0]}")
    return numbers[:3]


def _read_face(state: _Lines, words: list[str]) -> None:
    """A polygon of corners `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative indices count back from the last one."""
    if len(words) < 3:
        raise _refused(state, "f " + " ".join(words), "at least 3 corners")
    for word in words:
        state.corners.append(state.known_corners.get(word) or _read_corner(state, word))
    state.lengths.append(len(words))
    state.lines.append(state.number)


def _read_corner(state: _Lines, word: str) -> tuple[int, int, int]:
    """(position, normal, texture) of a corner; one that counts from the first on means the same wherever it stands."""
    parts = word.split("/")
    if len(parts) > 3:
        raise _refused(state, word, "v, v/vt, v//vn or v/vt/vn")
    position = _index(state, word, parts[0], len(state.positions), "v")
    normal = _index(state, word, parts[2], len(state.normals), "vn") if len(parts) == 3 and parts[2] else -1
    texture = _index(state, word, parts[1], len(state.textures), "vt") if len(parts) > 1 and parts[1] else -1
    corner = position, normal, texture
    if "-" not in word:
        state.known_corners[word] = corner
    return corner


def _index(state: _Lines, word: str, digits: str, count: int, kind: str) -> int:
    """The zero-based index of a reference; those that point forward are checked at the end."""
    plain = digits.removeprefix("-")
    if not (plain.isascii() and plain.isdecimal() and len(plain) <= _MAX_INDEX_DIGITS) or int(plain) == 0:
        raise _refused(state, word, f"indices from 1, or from -1 down, to {kind}")
    number = int(digits)
    if number < 0 and count + number < 0:
        raise _refused(state, word, f"{kind} indices from -{count} to -1")
    return count + number if number < 0 else number - 1


def _assemble(state: _Lines) -> Mesh:
    """Fans of triangles over vertices that differ in position or normal."""
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
    positions = np.array(state.positions)[keys // width]
    normals = np.array(state.normals)[keys % width] if has_normals else None
    lengths = np.array(state.lengths)
    return Mesh(positions, fan_triangles(index.astype(np.int32), lengths), normals, _uvs(state, corners[:, 2], lengths))


def _uvs(state: _Lines, textures: npt.NDArray[np.int64], lengths: npt.NDArray[np.int64]) -> npt.NDArray | None:
    """Of each triangle's corners, (T, 3, 2), where all corners have some."""
    if (textures < 0).any():
        return None
    # In double precision here: what is too large for single is to be found by `validate_mesh`, not by a warning.
    values = np.clip(np.array(state.textures), -1e30, 1e30).astype(np.float32)
    return values[textures[fan_triangles(np.arange(len(textures), dtype=np.int32), lengths)]]


def _check_range(state: _Lines, indices: npt.NDArray[np.int64], count: int, kind: str) -> None:
    """Refuses indices past the last vertex or normal, by the line of their face."""
    if (indices >= count).any():
        at = int(np.argmax(indices >= count))
        face = int(np.searchsorted(np.cumsum(state.lengths), at, "right"))
        raise LoadError(
            state.file, f"line {state.lines[face]}: {kind} index", int(indices[at]) + 1, f"an index from 1 to {count}"
        )


def _refused(state: _Lines, value: str, expected: str) -> LoadError:
    """An error at the current line."""
    return LoadError(state.file, f"line {state.number}", value, expected)
