"""A strict reader of OFF files of Geomview, in text: positions, normals, colours, texture coordinates and polygons.

trimesh reads them too, but drops colours, cuts concave polygons as if they were convex, and takes a file that lacks
faces without a word. A colour is of integers up to 255 or of shares, in sRGB; of an index into a table of colours,
which no file has, nothing is shown.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file
from engine.scene.loaders.model import ImportedModel, ImportedPart, UnshownProperty
from engine.scene.loaders.vertex_colours import linear_colours, vertex_opacity
from engine.scene.mesh import MAX_MESH_BYTES, Mesh, mend_mesh
from engine.scene.mesh_defects import describe_holes
from engine.scene.polygons import left_out_notes, repeated_polygons, triangulate

_HEADER = re.compile(r"(ST)?(C)?(N)?(4)?(n)?OFF")
Rows = list[tuple[int, list[str]]]


def read_off(file: Path) -> ImportedModel:
    """Read an OFF file; raises LoadError naming the line and its content."""
    data = read_regular_file(file, MAX_MESH_BYTES)
    has_uvs, has_normals, rows = _read_header(data, file)
    (number, words), *rows = rows or [(1, [])]
    n_vertices, n_faces = _counts(words, number, file)
    if n_vertices + n_faces > len(rows):
        raise LoadError(file, "lines", len(rows), f"{n_vertices} vertices and {n_faces} faces, as line {number} counts")
    table = _table(rows[:n_vertices], file)
    faces = rows[n_vertices : n_vertices + n_faces]
    corners, lengths, shares, n_indexed, n_short = _read_faces(faces, n_vertices, file)
    if not lengths:
        raise LoadError(file, "faces", 0, "at least one face")
    uncut = list[str]()
    triangles = triangulate(table[corners, :3], np.array(lengths), len(data), uncut.append)
    face = np.searchsorted(np.cumsum(lengths), triangles[:, 0], "right")
    normals, colours, uvs = _columns(table, has_normals, has_uvs)
    is_plain = normals is None and uvs is None
    repeated = repeated_polygons(np.array(corners), np.array(lengths), either_way=is_plain)
    triangles, face = np.array(corners, np.int32)[triangles][~repeated[face]], face[~repeated[face]]
    of_corners = None if colours is None else colours[triangles]
    if shares is not None:
        of_corners = np.repeat(shares[face][:, None], 3, axis=1)
    mesh = Mesh(table[:, :3], triangles, normals, None if uvs is None else uvs[triangles], colours=of_corners)
    mesh, notes = mend_mesh(mesh, file)
    notes += [*left_out_notes(int(repeated.sum()), n_short), *uncut]
    left = len(rows) - n_vertices - n_faces
    if left:
        notes.append(f"{left} lines after the last face are left out")
    n_more = n_vertices if colours is None and table.shape[1] > 3 + 3 * has_normals + 2 * has_uvs else 0
    unshown = (
        UnshownProperty("face.colour index", n_indexed, "the file has no table of colours"),
        UnshownProperty("vertex.numbers behind", n_more, "too few for a colour"),
    )
    return ImportedModel(
        (ImportedPart(mesh, opacity=vertex_opacity(mesh)),),
        (*notes, *describe_holes(mesh)),
        unshown=tuple(each for each in unshown if each.count),
    )


def _read_header(data: bytes, file: Path) -> tuple[bool, bool, Rows]:
    """Whether vertices have texture coordinates and normals; and the words of each line that has some."""
    text = data.decode("utf-8", "replace")
    lines = (line.partition("#")[0] if "#" in line else line for line in text.split("\n"))
    rows = [(i, words) for i, line in enumerate(lines, 1) if (words := line.split())]
    kind = _HEADER.fullmatch(rows[0][1][0]) if rows else None
    if kind is None:
        raise LoadError(file, "first word", rows[0][1][0] if rows else "nothing", "OFF")
    number, (name, *rest) = rows[0]
    if kind[4] or kind[5] or rest[:1] == ["BINARY"]:
        raise LoadError(file, f"line {number}", " ".join([name, *rest]), "OFF in text, with three coordinates")
    return kind[1] is not None, kind[3] is not None, [(number, rest), *rows[1:]] if rest else rows[1:]


def _counts(words: list[str], number: int, file: Path) -> tuple[int, int]:
    """The numbers of vertices and faces."""
    if len(words) < 2 or not all(word.isascii() and word.isdecimal() and len(word) < 10 for word in words[:2]):
        raise LoadError(file, f"line {number}", " ".join(words), "the numbers of vertices, faces and edges")
    return int(words[0]), int(words[1])


def _table(rows: Rows, file: Path) -> npt.NDArray[np.float64]:
    """The numbers of all vertices; integers in colours are recognized by `_columns`."""
    width = len(rows[0][1]) if rows else 3
    for number, words in rows:
        if len(words) != width or width < 3:
            raise LoadError(
                file, f"line {number}", " ".join(words), f"{max(width, 3)} numbers, as for the first vertex"
            )
    return np.array([_numbers(words, number, file) for number, words in rows]).reshape(-1, width)


def _columns(
    table: npt.NDArray[np.float64], has_normals: bool, has_uvs: bool
) -> tuple[npt.NDArray[np.float64] | None, npt.NDArray[np.float32] | None, npt.NDArray[np.float32] | None]:
    """Normals (V, 3), linear colours (V, 4) and texture coordinates (V, 2) behind positions, None for those that are
    not there."""
    rest = table[:, 3:]
    normals, rest = (rest[:, :3], rest[:, 3:]) if has_normals and rest.shape[1] >= 3 else (None, rest)
    uvs, rest = (rest[:, -2:], rest[:, :-2]) if has_uvs and rest.shape[1] >= 2 else (None, rest)
    colours = None
    if rest.shape[1] >= 3:
        colours = linear_colours(rest[:, :4] / (255.0 if rest[:, :3].max(initial=0.0) > 1.0 else 1.0))
    return normals, colours, None if uvs is None else np.clip(uvs, -1e30, 1e30).astype(np.float32)


def _read_faces(
    rows: Rows, n_vertices: int, file: Path
) -> tuple[list[int], list[int], npt.NDArray[np.float32] | None, int, int]:
    """The corners of all faces, how many each has, linear colours (F, 4) if any face has one, white for others; how
    many have an index in place of a colour, and how many rows are points and edges."""
    corners: list[int] = []
    lengths: list[int] = []
    shares = np.ones((len(rows), 4))
    coloured, n_indexed, n_short = False, 0, 0
    known: dict[str, int] = {}  # indices that were checked
    for number, words in rows:
        count = int(words[0]) if words[0].isascii() and words[0].isdecimal() and len(words[0]) < 10 else -1
        own = words[1 : count + 1]
        if count < 0 or len(own) < count:
            raise LoadError(file, f"line {number}", " ".join(words[:16]), "a number of corners, and as many indices")
        if count < 3:
            n_short += 1
            continue
        for word in own:
            vertex = known.get(word)
            if vertex is None:
                if not (word.isascii() and word.isdecimal() and len(word) < 10 and int(word) < n_vertices):
                    raise LoadError(file, f"line {number}", word, f"indices from 0 to {n_vertices - 1}")
                vertex = known[word] = int(word)
            corners.append(vertex)
        lengths.append(count)
        colour = words[count + 1 :]
        n_indexed += len(colour) == 1
        if len(colour) >= 3:
            values = _numbers(colour[:4], number, file)
            whole = all(word.isdecimal() for word in colour[:3])
            shares[len(lengths) - 1, : len(values)] = np.array(values) / (255.0 if whole else 1.0)
            coloured = True
    return corners, lengths, linear_colours(shares[: len(lengths)]) if coloured else None, n_indexed, n_short


def _numbers(words: list[str], number: int, file: Path) -> list[float]:
    """The numbers of a line; underscores, which Python accepts in numbers, are invalid."""
    try:
        if any("_" in word for word in words):
            raise ValueError
        return [float(word) for word in words]
    except ValueError:
        raise LoadError(file, f"line {number}", " ".join(words[:16]), "numbers") from None
