"""A strict reader of Wavefront OBJ files: vertices, normals, colours, polygons and their materials; invalid numbers are
rejected with their line.

Each material in use becomes a part of its name (`mtl` reads its library). Groups are skipped, because scene files have
their own; lines and points are listed as not shown, and lines that no standard defines get a note. Corners with the
same position and normal become one vertex, whatever their texture coordinates, which a part has if all of its corners
do. A file without normals is smooth, also across its materials, unless all of its faces stand after `s off`.

Colours behind positions (`v x y z r g b`) are sRGB, as MeshLab and Blender write them. trimesh reads such files
differently: see `engine.scene.mesh`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError, list_names
from engine.core.safe_files import read_regular_file
from engine.scene.loaders.model import ImportedModel, UnshownProperty
from engine.scene.loaders.mtl import words_of_line
from engine.scene.loaders.mtl_materials import Materials
from engine.scene.loaders.vertex_colours import linear_colours
from engine.scene.mesh import (
    MAX_MESH_BYTES,
    Mesh,
    mend_mesh,
    select_faces,
    with_normals,
    without_unused_vertices,
)
from engine.scene.polygons import left_out_notes, repeated_polygons, triangulate

# Lines that are skipped: what the picture lacks without them, "" for nothing.
_SKIPPED = {
    "vp": "", "o": "", "g": "", "mg": "", "l": "lines are not drawn", "p": "points are not drawn",
    "usemap": "an image that is not shown", "maplib": "images that are not shown", "lod": "shown whatever the level",
    "shadow_obj": "the shape itself casts shadows", "trace_obj": "the shape itself is reflected",
    "bevel": "no bevels", "c_interp": "colours are those of the material", "d_interp": "opacity is the material's",
}  # fmt: skip
_MAX_INDEX_DIGITS = 12
_MOST_NAMES = 4
_MOST_MATERIALS = 4095  # a scene has as many objects, and a floor


@dataclass
class _Lines:
    """The data read so far.

    Positions, normals and texture coordinates are numbers one after the other, and so are the colours of the vertices
    `coloured`. corners: each (position, normal or −1, texture or −1) once; a face is `lengths` of their `ids`, on one
    of the `lines`, with one of the `materials`, whose names are numbered, −1 for none. uncut: notes on faces that are
    not cut exactly.
    """

    file: Path
    positions: list[float] = field(default_factory=list)
    colours: list[float] = field(default_factory=list)
    coloured: list[int] = field(default_factory=list)
    normals: list[float] = field(default_factory=list)
    textures: list[float] = field(default_factory=list)
    corners: list[tuple[int, int, int]] = field(default_factory=list)
    ids: list[int] = field(default_factory=list)
    lengths: list[int] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    materials: list[int] = field(default_factory=list)
    names: dict[str, int] = field(default_factory=dict)
    libraries: dict[str, None] = field(default_factory=dict)
    skipped: dict[str, int] = field(default_factory=dict)
    unknown: dict[str, int] = field(default_factory=dict)
    known_corners: dict[str, int] = field(default_factory=dict)
    number: int = 0
    material: int = -1
    smoothing: bool = True
    is_smooth: bool = False
    n_repeated: int = 0
    n_short: int = 0
    n_bare: int = 0
    uncut: list[str] = field(default_factory=list)


def read_obj(file: Path) -> ImportedModel:
    """Read an OBJ file and its libraries of materials; raises LoadError naming the line and its content."""
    data = read_regular_file(file, MAX_MESH_BYTES)
    state = _parse(data, file)
    mesh, material, is_mapped = _assemble(state, len(data))
    mesh, notes = mend_mesh(mesh, file)
    used, counts = np.unique(material, return_counts=True)
    if len(used) > _MOST_MATERIALS:
        raise LoadError(file, "materials", len(used), f"at most {_MOST_MATERIALS}")
    if len(used) > 1 and state.is_smooth:
        mesh = with_normals(mesh)  # before it is divided: no edge at the border of a material
    materials = Materials(file, state.libraries)
    names = {number: name for name, number in state.names.items()}
    parts = []
    for k, own in zip(
        used.tolist(), np.split(np.argsort(material, kind="stable"), np.cumsum(counts)[:-1]), strict=True
    ):
        part = mesh if len(used) == 1 else without_unused_vertices(select_faces(mesh, own))
        part = part if is_mapped[own].all() else replace(part, uvs=None)
        parts.append(replace(materials.part(part, names.get(k, "")), smooth=state.is_smooth))
    notes = [*_notes(state), *notes, *materials.notes]
    skipped = tuple(UnshownProperty(key, n, _SKIPPED[key]) for key, n in state.skipped.items() if _SKIPPED[key])
    return ImportedModel(tuple(parts), tuple(notes), unshown=(*skipped, *materials.unshown), unread=materials.unread)


def _parse(data: bytes, file: Path) -> _Lines:
    """All lines of a file."""
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
        _read_line(state, words_of_line(line))
    if held:
        raise LoadError(file, f"line {state.number}", "\\", "a line after the last continuation")
    return state


def _read_line(state: _Lines, words: list[str]) -> None:
    """Add one line to the state."""
    if not words:
        return
    if words[0] in _SKIPPED:
        state.skipped[words[0]] = state.skipped.get(words[0], 0) + 1
        return
    match words[0]:
        case "v":
            _read_vertex(state, words)
        case "f":
            _read_face(state, words)
        case "vn":
            state.normals += _numbers(state, words, (3,))
        case "vt":
            state.textures += (_numbers(state, words, (1, 2, 3)) + [0.0])[:2]
        case "usemtl":
            state.material = state.names.setdefault(" ".join(words[1:]), len(state.names))
        case "mtllib":
            state.libraries[" ".join(words[1:])] = None
        case "s":
            state.smoothing = words[1:] not in (["off"], ["0"])
        case _:
            state.unknown[words[0]] = state.unknown.get(words[0], 0) + 1


def _notes(state: _Lines) -> tuple[str, ...]:
    """Notes on lines that are skipped, faces without an area and repeated ones, if there were any."""
    lines = []
    if state.unknown:
        names = list_names(state.unknown, _MOST_NAMES)
        lines.append(f"{sum(state.unknown.values())} lines of unknown kinds are left out: {names}")
    if state.n_bare:
        lines.append(f"normals are computed: {state.n_bare} corners of faces have none")
    return (*lines, *left_out_notes(state.n_repeated, state.n_short), *state.uncut)


def _numbers(state: _Lines, words: list[str], counts: tuple[int, ...]) -> list[float]:
    """The numbers of a line; underscores, which Python accepts in numbers, are invalid."""
    try:
        numbers = [float(word) for word in words[1:]]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or "_" in "".join(words):
        raise _line_error(state, " ".join(words), f"{counts[0]} numbers after {words[0]}")
    return numbers


def _read_vertex(state: _Lines, words: list[str]) -> None:
    """A position; a weight may follow, or a colour, or both."""
    numbers = _numbers(state, words, (3, 4, 6, 7))
    if len(numbers) > 4:
        state.coloured.append(len(state.positions) // 3)
        state.colours += numbers[-3:]
    state.positions += numbers[:3]


def _read_face(state: _Lines, words: list[str]) -> None:
    """A polygon of corners `v`, `v/vt`, `v//vn` or `v/vt/vn`; negative indices count back from the last one."""
    if len(words) < 4:
        state.n_short += 1
        return
    known = state.known_corners
    for word in words[1:]:
        known_id = known.get(word)
        state.ids.append(_read_corner(state, word) if known_id is None else known_id)
    state.lengths.append(len(words) - 1)
    state.lines.append(state.number)
    state.materials.append(state.material)
    state.is_smooth |= state.smoothing


def _read_corner(state: _Lines, word: str) -> int:
    """The id of a corner. Those with absolute indices are cached, because their meaning does not depend on the line."""
    parts = word.split("/")
    if len(parts) > 3:
        raise _line_error(state, word, "v, v/vt, v//vn or v/vt/vn")
    position = _index(state, word, parts[0], len(state.positions) // 3, "v")
    normal = _index(state, word, parts[2], len(state.normals) // 3, "vn") if len(parts) == 3 and parts[2] else -1
    texture = _index(state, word, parts[1], len(state.textures) // 2, "vt") if len(parts) > 1 and parts[1] else -1
    state.corners.append((position, normal, texture))
    number = len(state.corners) - 1
    if "-" not in word:
        state.known_corners[word] = number
    return number


def _index(state: _Lines, word: str, digits: str, count: int, kind: str) -> int:
    """The zero-based index of a reference; forward references are checked at the end."""
    plain = digits.removeprefix("-")
    if not (plain.isascii() and plain.isdecimal() and len(plain) <= _MAX_INDEX_DIGITS) or int(plain) == 0:
        raise _line_error(state, word, f"indices from 1, or from -1 down, to {kind}")
    number = int(digits)
    if number < 0 and count + number < 0:
        raise _line_error(state, word, f"{kind} indices from -{count} to -1")
    return count + number if number < 0 else number - 1


def _assemble(state: _Lines, n_bytes: int) -> tuple[Mesh, npt.NDArray[np.int32], npt.NDArray[np.bool_]]:
    """Triangles over vertices that differ in position or normal; of each its material, and whether it has texture
    coordinates (T,)."""
    if not state.lengths:
        raise LoadError(state.file, "faces", 0, "at least one line f")
    positions, normals = (np.reshape(np.array(each), (-1, 3)) for each in (state.positions, state.normals))
    textures = np.reshape(np.array(state.textures), (-1, 2))
    corners = np.array(state.corners, np.int64)[np.array(state.ids, np.int64)]
    for column, count, kind in ((0, len(positions), "v"), (1, len(normals), "vn"), (2, len(textures), "vt")):
        _check_range(state, corners[:, column], count, kind)
    has_normals = bool((corners[:, 1] >= 0).all())
    state.n_bare = 0 if has_normals or (corners[:, 1] < 0).all() else int((corners[:, 1] < 0).sum())
    if not has_normals:
        corners[:, 1] = 0
    width = max(1, len(normals))
    keys, vertex = np.unique(corners[:, 0] * width + corners[:, 1], return_inverse=True)
    lengths = np.array(state.lengths)
    triangles = triangulate(positions[corners[:, 0]], lengths, n_bytes, state.uncut.append)
    polygon = np.searchsorted(np.cumsum(lengths), triangles[:, 0], "right")
    is_plain = not has_normals and not len(textures)
    kept = ~repeated_polygons(corners[:, 0], lengths, either_way=is_plain)[polygon]
    state.n_repeated = len(lengths) - len(np.unique(polygon[kept]))
    triangles, polygon = triangles[kept], polygon[kept]
    mesh = Mesh(
        positions[keys // width], vertex.astype(np.int32)[triangles], normals[keys % width] if has_normals else None,
        _uvs(textures, corners[:, 2][triangles]), colours=_colours(state, corners[:, 0][triangles]),
    )  # fmt: skip
    return mesh, np.array(state.materials, np.int32)[polygon], np.asarray((corners[:, 2] >= 0)[triangles].all(axis=1))


def _uvs(textures: npt.NDArray[np.float64], which: npt.NDArray[np.int64]) -> npt.NDArray[np.float32] | None:
    """Texture coordinates of the triangles' corners, (T, 3, 2), 0 for those that have none; None if none has any."""
    if not (which >= 0).any():
        return None
    # In double precision here: `mend_mesh` counts values too large for single precision.
    values = np.clip(textures, -1e30, 1e30).astype(np.float32)
    return np.where((which >= 0)[..., None], values[np.maximum(which, 0)], np.float32(0.0))


def _colours(state: _Lines, vertices: npt.NDArray[np.int64]) -> npt.NDArray[np.float32] | None:
    """Linear colours of the triangles' corners, (T, 3, 4), white where a vertex has none; None if none has any."""
    if not state.coloured:
        return None
    colours = np.ones((len(state.positions) // 3, 4), np.float32)
    colours[state.coloured] = linear_colours(np.reshape(np.array(state.colours), (-1, 3)))
    return colours[vertices]


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
