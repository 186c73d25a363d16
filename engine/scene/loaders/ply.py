"""A strict reader of PLY files (ASCII, binary little and big endian).

Every count in the header is checked against the available bytes before anything is allocated, so that a truncated file,
a negative count and a header that claims 10⁹ vertices all end in one line that names the error. Bytes after the last
element are skipped with a note. Polygons and strips (`tristrips`, a list in which −1 separates strips) become
triangles. Read are x y z, nx ny nz, texture coordinates (s t, u v or texture_u texture_v of vertices, or a list
texcoord of each face, as MeshLab writes them), colours of vertices and faces (`vertex_colours` says which are sRGB),
vertex indices of faces, and the images of `comment TextureFile`: the first, or, where faces have a texnumber, the one
with this number, each a part. Other properties are listed as not shown.
trimesh reads such files differently: see `engine.scene.mesh`.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError, describe_value
from engine.core.safe_files import read_regular_file
from engine.material.layer_maps import LayerMaps
from engine.scene.description import LayerDescription
from engine.scene.loaders.image_files import FileImages
from engine.scene.loaders.model import ImportedModel, ImportedPart, UnshownProperty
from engine.scene.loaders.ply_rows import (
    COLOURS,
    CORNERS,
    TEXCOORD,
    TEXNUMBER,
    Column,
    Element,
    Lists,
    Property,
    read_ascii,
    read_binary,
)
from engine.scene.loaders.vertex_colours import linear_colours, vertex_opacity
from engine.scene.mesh import MAX_MESH_BYTES, Mesh, mend_mesh, without_unused_vertices
from engine.scene.polygons import left_out_notes, repeated_polygons, triangulate

_MAX_HEADER = 65536
_MAX_COUNT = 2**31 - 1
_MOST_UNSHOWN, _MOST_TEXTURES = 64, 256
_TYPES = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
          "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
          "double": "f8", "float64": "f8"}  # fmt: skip
_UV_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
_PLACES = ("x", "y", "z")
_NORMALS = ("nx", "ny", "nz")
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_WHOLE = {"u1": 255.0, "u2": 65535.0}

Columns = dict[tuple[str, str], Column | Lists]


def read_ply(file: Path) -> ImportedModel:
    """Read a PLY file; raises LoadError naming the line, element or byte."""
    data = read_regular_file(file, MAX_MESH_BYTES)
    elements, byte_order, body, textures = _parse_header(data, file)
    if byte_order:
        columns, notes = read_binary(data, body, elements, byte_order, file)
    else:
        columns, notes = read_ascii(data, body, elements, file)
    columns, n_short = _without_short_faces(columns)
    vertices = _vectors(columns, _PLACES, file)
    normals = _vectors(columns, _NORMALS, file) if ("vertex", "nx") in columns else None
    uncut = list[str]()
    triangles, face, corner = _triangles(columns, vertices, len(data), file, uncut)
    uvs = _uvs(columns, triangles, corner)
    kept, n_repeated = _unrepeated(columns, face, is_plain=normals is None and uvs is None)
    triangles, face, uvs = triangles[kept], face[kept], None if uvs is None else uvs[kept]
    mesh = Mesh(vertices, triangles, normals, uvs)
    colours = _colours(columns, elements, mesh, face)
    notes = (*notes, *left_out_notes(n_repeated, n_short), *uncut)
    parts = []
    for texture, own in _by_texture(columns, textures, face):
        part = Mesh(vertices, triangles[own], normals, None if uvs is None else uvs[own], None, _of(colours, own))
        part, mended = mend_mesh(part if len(textures) < 2 else without_unused_vertices(part), file)
        layers, texture_notes = _textured(texture, part, file)
        name = Path(texture).stem if len(textures) > 1 else ""
        parts.append(ImportedPart(part, layers, opacity=vertex_opacity(part), name=name))
        notes = (*notes, *mended, *texture_notes)
    return ImportedModel(tuple(parts), notes, unshown=_unshown(elements))


def _of(values: npt.NDArray[np.float32] | None, rows: npt.NDArray[np.bool_]) -> npt.NDArray[np.float32] | None:
    return None if values is None else values[rows]


def _by_texture(
    columns: Columns, textures: list[str], face: npt.NDArray[np.int64]
) -> list[tuple[str, npt.NDArray[np.bool_]]]:
    """The images of a file, and which triangles (T,) show each: by the number of their face, the first in strips."""
    numbers = _stacked(columns, "face", (TEXNUMBER,))
    if len(textures) < 2 or numbers is None:
        return [(textures[0] if textures else "", np.ones(len(face), bool))]
    usable = np.clip(np.nan_to_num(np.rint(numbers[:, 0])), 0, len(textures) - 1)
    own = np.append(usable, 0)[face]
    found = [(name, own == number) for number, name in enumerate(textures)]
    return [(name, rows) for name, rows in found if rows.any()]


def _textured(texture: str, mesh: Mesh, file: Path) -> tuple[tuple[LayerDescription, ...], tuple[str, ...]]:
    """The material of the image that MeshLab and scanners name in a comment, None without one; and notes."""
    if not texture:
        return (), ()
    if mesh.uvs is None:
        return (), (f"image {describe_value(texture)} is not shown: there are no texture coordinates",)
    try:
        name = FileImages(file.parent).find(file.parent, texture)
    except LoadError as error:
        return (), (f"image {describe_value(texture)} is not shown: {error.reason}",)
    maps = LayerMaps(name, "srgb", vertex_colours=mesh.colours is not None)
    return (LayerDescription(model="lambert", maps=maps, parameters={"albedo": (1.0, 1.0, 1.0)}),), ()


def _triangles(
    columns: Columns, vertices: npt.NDArray[np.float64], n_bytes: int, file: Path, notes: list[str]
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Triangles of all faces, then of all strips; the face of each, −1 in strips; and the place of each corner among
    all corners of faces (T, 3). notes: on faces that are not cut exactly."""
    triangles, owners, corners = [], [], []
    for element, read in (("face", partial(_of_polygons, notes)), ("tristrips", _of_strips)):
        lists = next((columns[element, name] for name in CORNERS if (element, name) in columns), None)
        if isinstance(lists, Lists):
            found, owner, corner = read(lists, vertices, n_bytes, file)
            triangles.append(found)
            owners.append(owner)
            corners.append(corner)
    if not triangles:
        raise LoadError(file, "element face", "no list vertex_indices", "a list of vertex indices")
    return np.concatenate(triangles), np.concatenate(owners), np.concatenate(corners)


def _without_short_faces(columns: Columns) -> tuple[Columns, int]:
    """The columns without faces that have no area, of one or two corners; and how many these are."""
    name = next((name for name in CORNERS if ("face", name) in columns), "")
    lists = columns.get(("face", name))
    if not isinstance(lists, Lists) or (lists.lengths >= 3).all():
        return columns, 0
    whole = lists.lengths >= 3
    corners = Lists(lists.lengths[whole], lists.values[np.repeat(whole, lists.lengths)])
    values = {
        key: each.values if isinstance(each, Lists) else each for key, each in columns.items() if key[0] == "face"
    }
    others = {key: each[whole] for key, each in values.items() if len(each) == len(whole)}
    return columns | others | {("face", name): corners}, int((~whole).sum())


def _unrepeated(columns: Columns, face: npt.NDArray[np.int64], is_plain: bool) -> tuple[npt.NDArray[np.bool_], int]:
    """Which triangles (T,) are of strips, or of faces that repeat no other, and how many faces do."""
    lists = next((columns["face", name] for name in CORNERS if ("face", name) in columns), None)
    if not isinstance(lists, Lists):
        return np.ones(len(face), bool), 0
    repeated = repeated_polygons(lists.values.astype(np.int64), lists.lengths, either_way=is_plain)
    return ~np.append(repeated, False)[face], int(repeated.sum())


def _uvs(
    columns: Columns, triangles: npt.NDArray[np.int32], corner: npt.NDArray[np.int64]
) -> npt.NDArray[np.float32] | None:
    """Texture coordinates of the triangles' corners, (T, 3, 2), if faces or vertices have some. corner (T, 3): the
    place of each among the corners of faces, −1 in strips, whose coordinates are then 0."""
    lists = next((columns["face", name] for name in CORNERS if ("face", name) in columns), None)
    coordinates = columns.get(("face", TEXCOORD))
    if isinstance(lists, Lists) and isinstance(coordinates, Lists):
        has_all = coordinates.lengths == 2 * lists.lengths
        if has_all.any():
            of_corners = np.zeros((len(lists.values) + 1, 2))
            of_corners[:-1][np.repeat(has_all, lists.lengths)] = coordinates.values[
                np.repeat(has_all, coordinates.lengths)
            ].reshape(-1, 2)
            return np.clip(of_corners, -1e30, 1e30).astype(np.float32)[corner]
    for names in _UV_NAMES:
        values = _stacked(columns, "vertex", names)
        if values is not None:
            return np.clip(values, -1e30, 1e30).astype(np.float32)[triangles]
    return None


def _colours(
    columns: Columns, elements: list[Element], mesh: Mesh, face: npt.NDArray[np.int64]
) -> npt.NDArray[np.float32] | None:
    """Linear colours of the triangles' corners, (T, 3, 4): of their vertices, else of their faces, white in strips."""
    for element in (each for name in ("vertex", "face") for each in elements if each.name == name):
        for names, is_srgb in zip(COLOURS, (True, False), strict=True):
            types = {p.name: p.type for p in element.properties}
            values = _stacked(columns, element.name, names if names[3] in types else names[:3])
            if values is None:
                continue
            whole = _WHOLE.get(types[names[0]], 255.0 if values.max(initial=0.0) > 1.0 else 1.0)
            colours = linear_colours(values / whole, is_srgb)
            if element.name == "vertex":
                return colours[mesh.triangles]
            of_faces = np.concatenate([colours, np.ones((1, 4), np.float32)])[face]
            return np.repeat(of_faces[:, None], 3, axis=1)
    return None


def _unshown(elements: list[Element]) -> tuple[UnshownProperty, ...]:
    """Properties that are not read."""
    known = {*_PLACES, *_NORMALS, *(name for names in (*_UV_NAMES, *COLOURS) for name in names)}
    found: list[UnshownProperty] = []
    for element in elements:
        for p in element.properties:
            is_read = element.reads(p) and (element.name != "vertex" or p.name in known)
            if not is_read and element.count and len(found) < _MOST_UNSHOWN:
                name = f"{describe_value(element.name)}.{describe_value(p.name)}"
                found.append(UnshownProperty(name, element.count, "data that no picture shows"))
    return tuple(found)


def _parse_header(data: bytes, file: Path) -> tuple[list[Element], str, int, list[str]]:
    """Elements, byte order ("" for ASCII), the start of the body, and the images of comments."""
    if not data.startswith((b"ply\n", b"ply\r")):
        raise LoadError(file, "first line", data[:16].decode("ascii", "replace"), "ply")
    end = data.find(b"end_header", 0, _MAX_HEADER)
    body = data.find(b"\n", end) + 1
    if end < 0 or body <= 0:
        raise LoadError(file, "header", "no end_header", f"end_header within {_MAX_HEADER} bytes")
    elements: list[Element] = []
    byte_order: str | None = None
    textures: list[str] = []
    for number, line in enumerate(data[:end].decode("utf-8", "replace").splitlines()[1:], start=2):
        words = line.split()
        if not words or words[0] in ("comment", "obj_info"):
            if len(words) > 2 and words[1] == "TextureFile":
                textures.append(line.partition("TextureFile")[2].strip())
            continue
        if words[0] == "format" and len(words) == 3 and words[1] in _FORMATS and words[2] == "1.0":
            byte_order = _FORMATS[words[1]]
        elif words[0] == "element" and len(words) == 3:
            elements.append(Element(words[1], _parse_count(words[2], number, file), []))
        elif words[0] == "property" and elements and (found := _parse_property(words)):
            elements[-1].properties.append(found)
        else:
            raise LoadError(file, f"line {number}", line, "a PLY 1.0 format, element or property")
    if byte_order is None:
        raise LoadError(file, "header", "no format", "format ascii, binary_little_endian or binary_big_endian")
    return elements, byte_order, body, textures[:_MOST_TEXTURES]


def _parse_count(word: str, number: int, file: Path) -> int:
    """The number of rows that an element claims."""
    count = int(word) if word.removeprefix("-").isdecimal() and len(word) < 20 else None
    if count is None or not 0 <= count <= _MAX_COUNT:
        raise LoadError(file, f"line {number}: count", word, f"a number from 0 to {_MAX_COUNT}")
    return count


def _parse_property(words: list[str]) -> Property | None:
    """`property TYPE NAME` or `property list TYPE TYPE NAME`, None if it is neither."""
    if len(words) == 3 and words[1] in _TYPES:
        return Property(words[2], _TYPES[words[1]])
    if len(words) == 5 and words[1] == "list" and words[2] in _TYPES and words[3] in _TYPES:
        if _TYPES[words[2]][0] != "f":
            return Property(words[4], _TYPES[words[3]], _TYPES[words[2]])
    return None


def _stacked(columns: Columns, element: str, names: tuple[str, ...]) -> npt.NDArray[np.float64] | None:
    """Columns as (N, k); None if one of them is not there."""
    found = [columns.get((element, name)) for name in names]
    values = [each.values if isinstance(each, Lists) else each for each in found if each is not None]
    if len(values) < len(names) or len({len(each) for each in values}) != 1:
        return None
    return np.stack(values, axis=1).astype(np.float64)


def _vectors(columns: Columns, names: tuple[str, ...], file: Path) -> npt.NDArray[np.float64]:
    """Three columns of the vertices as (N, 3)."""
    found = _stacked(columns, "vertex", names)
    if found is None:
        raise LoadError(file, "element vertex", "missing properties", f"the properties {' '.join(names)}")
    return found


def _of_polygons(
    notes: list[str], faces: Lists, vertices: npt.NDArray[np.float64], n_bytes: int, file: Path
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """The polygons as triangles, in the order of the file; the polygon of each; and the places of their corners."""
    corners = _indices(faces, len(vertices), "face", 0, file)
    if not len(corners):
        return np.zeros((0, 3), np.int32), np.zeros(0, np.int64), np.zeros((0, 3), np.int64)
    triangles = triangulate(vertices[corners], faces.lengths, n_bytes, notes.append)
    return (
        corners[triangles],
        np.searchsorted(np.cumsum(faces.lengths), triangles[:, 0], "right"),
        triangles.astype(np.int64),
    )


def _of_strips(
    strips: Lists, vertices: npt.NDArray[np.float64], n_bytes: int, file: Path
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
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
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    return triangles, np.full(len(triangles), -1), np.full((len(triangles), 3), -1)


def _indices(lists: Lists, n_vertices: int, element: str, least: int, file: Path) -> npt.NDArray[np.int32]:
    """The indices of lists, checked before they are narrowed."""
    values = lists.values
    inside = (values >= least) & (values < n_vertices) & (values == np.floor(values))
    if not inside.all():
        at = int(np.argmin(inside))
        k = int(np.searchsorted(np.cumsum(lists.lengths), at, "right"))
        raise LoadError(file, f"{element} {k}", f"{values[at]:.17g}", f"indices from {least} to {n_vertices - 1}")
    return values.astype(np.int32)
