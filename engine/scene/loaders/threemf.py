"""3MF files [ThreeMF]: the parts that a file builds, in metres with Y up; base materials and groups of colours.

A base material becomes a part of its name in its colour, which is sRGB; triangles without one become a part of their
object's name, with colours at their corners where these are of a group of colours. Triangles of a group of texture
coordinates become a part with that texture, which is sRGB; its image is named by its number among the images of the
archive (`threemf_image_reader`). Faces are flat: the format has no normals. Mixtures are listed as not shown.

The reader is our own. Of files as slicers write them, each object in a model of its own, trimesh 5.2 (with lxml 6.1 and
networkx 3.6) places nothing, and takes all objects of a model for the one that is named; of copies with one part number
it keeps one; and it drops materials and colours. XML is read by expat without building a tree; a document type,
in which entities would be declared, is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError, describe_value, printable_name
from engine.core.safe_files import read_regular_file
from engine.core.zip_files import ZipArchive
from engine.material.layer_maps import LayerMaps, Wrap
from engine.material.opacity import OPAQUE, Opacity
from engine.scene.description import LayerDescription
from engine.scene.loaders.model import ImportedModel, ImportedPart, UnshownProperty
from engine.scene.loaders.vertex_colours import linear_colours, vertex_opacity
from engine.scene.mesh import (
    MAX_MESH_BYTES,
    MAX_UV,
    Mesh,
    join_meshes,
    place_copies,
    select_faces,
    validate_mesh,
    without_unused_vertices,
)
from engine.scene.mesh_defects import describe_holes
from engine.texture.texture_files import check_image

_MAIN = "3d/3dmodel.model"
_METRES = {"micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048, "meter": 1.0}
# Limit of vertices and faces of all copies, plus one for every 16 bytes of XML: small files must not cost much. A
# component takes as long to be placed as so many vertices.
MOST_COPIED, XML_BYTES = 1_000_000, 16
OF_A_COMPONENT = 8
_DEEPEST = 32
_MOST_UNSHOWN = 64
_IMAGE_ENDINGS = (".png", ".jpg", ".jpeg")
_WRAPS: dict[str, Wrap] = {"wrap": "repeat", "mirror": "mirror", "clamp": "clamp", "none": "clamp"}
_MOST_PARTS = 4095
_Y_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
_NOT_SHOWN = {
    "compositematerials": "mixtures of materials", "multiproperties": "mixed properties",
    "beamlattice": "lattices of beams", "slicestack": "slices",
    "pbmetallicdisplayproperties": "metalness and roughness",
    "pbspeculardisplayproperties": "specular colours and glossiness", "translucentdisplayproperties": "translucency",
}  # fmt: skip

# Elements that say what is read, or belong to others that are listed.
_SILENT = frozenset(
    "resources build metadata metadatagroup mesh vertices triangles components trianglesets triangleset ref refrange "
    "composite multi beams beam beamsets beamset balls ball polygon segment slice sliceref "
    "pbmetallic pbspecular translucent".split()
)

Float64Array = npt.NDArray[np.float64]
Attributes = dict[str, str]


class Key(NamedTuple):
    """An object or a group of a model: the model's name in the archive, and its number there."""

    model: str
    id: str


@dataclass
class _Object:
    """An object of a model: its triangles, with the property of each (group, and its entry for each corner; group −1
    for none), or the objects that it consists of, with their places."""

    name: str
    default: tuple[int, int] = (-1, 0)
    vertices: list[float] = field(default_factory=list)
    triangles: list[int] = field(default_factory=list)
    properties: list[tuple[int, int, int, int]] = field(default_factory=list)
    components: list[tuple[Key, Float64Array]] = field(default_factory=list)


@dataclass
class _Group:
    """Base materials, with names, or colours: linear red, green, blue and alpha; or, of a texture, u, v, 0 and 0."""

    is_material: bool
    texture: Key | None = None
    names: list[str] = field(default_factory=list)
    entries: list[tuple[float, float, float, float]] = field(default_factory=list)


@dataclass
class _Contents:
    """What the models of a file contain. groups: by their number in `numbers`; build: objects and their places;
    textures: the image of each in the archive, and how it continues beyond its edges."""

    metres: float = 1e-3
    objects: dict[Key, _Object] = field(default_factory=dict)
    groups: list[_Group] = field(default_factory=list)
    numbers: dict[Key, int] = field(default_factory=dict)
    build: list[tuple[Key, Float64Array]] = field(default_factory=list)
    unshown: dict[str, int] = field(default_factory=dict)
    textures: dict[Key, tuple[str, tuple[Wrap, Wrap]]] = field(default_factory=dict)


def threemf_image_reader(file: Path) -> Callable[[int], bytes]:
    """A function that reads the images of a 3MF file by their numbers. Raises LoadError."""
    archive = ZipArchive(read_regular_file(file, MAX_MESH_BYTES), file)
    names = _image_names(archive)

    def read(number: int) -> bytes:
        if number >= len(names):
            raise LoadError(file, "image", number, f"an image from 0 to {len(names) - 1}")
        return archive.read(names[number])

    return read


def _image_names(archive: ZipArchive) -> list[str]:
    return sorted(name for name in archive.names if name.lower().endswith(_IMAGE_ENDINGS))


def read_3mf(file: Path) -> ImportedModel:
    """Read a 3MF file; raises LoadError naming the model and the line."""
    archive = ZipArchive(read_regular_file(file, MAX_MESH_BYTES), file)
    models = sorted((name for name in archive.names if name.lower().endswith(".model")), key=_main_first)
    if not models:
        raise LoadError(file, "models", 0, "a file 3D/3dmodel.model in the archive")
    contents, n_bytes = _Contents(), 0
    for name in models:
        data = archive.read(name)
        n_bytes += len(data)
        _ModelReader(contents, name, file, is_main=name == models[0]).read(data)
    places, notes = _placed_objects(contents, MOST_COPIED + n_bytes // XML_BYTES, file)
    table = _group_table(contents.groups)
    pieces: dict[tuple[object, ...], tuple[str, int, int, list[Mesh]]] = {}
    for key, matrices in places.items():
        for part, (name, group, entry, mesh) in _pieces(key, contents, table, file).items():
            found = pieces.setdefault(part, (name, group, entry, []))
            found[3].append(place_copies(mesh, np.array(matrices)))
    if len(pieces) > _MOST_PARTS:
        raise LoadError(file, "materials and objects", len(pieces), f"at most {_MOST_PARTS}")
    if not pieces:
        raise LoadError(file, "faces", 0, "at least one object with triangles in the build")
    images = _Images(archive, contents, file)
    parts = [
        _part(name, contents.groups[group] if group >= 0 else None, entry, meshes, images)
        for name, group, entry, meshes in pieces.values()
    ]
    unshown = tuple(
        UnshownProperty(printable_name(name, 64), count, f"no {_NOT_SHOWN.get(name, 'element that is read')}")
        for name, count in contents.unshown.items()
    )
    notes += dict.fromkeys(images.notes)
    notes += describe_holes(join_meshes([part.mesh for part in parts]))
    return ImportedModel(tuple(parts), tuple(notes), unshown=unshown)


class _Images:
    """The images of a file's textures. notes: on those that cannot be shown."""

    def __init__(self, archive: ZipArchive, contents: _Contents, file: Path) -> None:
        self._archive, self._contents, self._file = archive, contents, file
        self._numbers = {name.lower(): number for number, name in enumerate(_image_names(archive))}
        self.notes: list[str] = []

    def maps(self, texture: Key) -> LayerMaps:
        """A texture as what multiplies a layer; nothing, with a note, where it cannot be shown."""
        path, wrap = self._contents.textures.get(texture, ("", ("repeat", "repeat")))
        number = self._numbers.get(path.lower())
        if number is None:
            self.notes.append(f"image {describe_value(path or texture.id)} is not shown: it is not in the archive")
            return LayerMaps()
        try:
            check_image(self._archive.read(_image_names(self._archive)[number]), f"{self._file}#{number}")
        except LoadError as error:
            self.notes.append(f"image {describe_value(path)} is not shown: {error.reason}")
            return LayerMaps()
        return LayerMaps(f"#{number}", "srgb", texture_wrap=wrap)


def _main_first(name: str) -> tuple[bool, str]:
    return not name.lower().endswith(_MAIN), name


def _part(name: str, group: _Group | None, entry: int, meshes: list[Mesh], images: _Images) -> ImportedPart:
    """A part of these triangles, of a base material or a texture where there is a group."""
    mesh = join_meshes(meshes)
    if group is None:
        return ImportedPart(mesh, opacity=vertex_opacity(mesh), smooth=False, name=name)
    if group.texture is not None:
        white = LayerDescription(
            model="lambert", maps=images.maps(group.texture), parameters={"albedo": (1.0, 1.0, 1.0)}
        )
        return ImportedPart(mesh, (white,), smooth=False, name=name)
    *albedo, alpha = group.entries[entry]
    layers = (LayerDescription(model="lambert", parameters={"albedo": tuple(albedo)}),)
    opacity = Opacity("blend", opacity_factor=alpha) if 0.0 < alpha < 1.0 else OPAQUE
    return ImportedPart(mesh, layers, opacity=opacity, smooth=False, name=name)


def _placed_objects(contents: _Contents, most: int, file: Path) -> tuple[dict[Key, list[Float64Array]], list[str]]:
    """The places (4, 4) of each object with triangles, in metres with Y up; a note on objects that are not there."""
    scale = np.diag([contents.metres] * 3 + [1.0])
    found: dict[Key, list[Float64Array]] = {}
    waiting = [(key, _Y_UP @ scale @ matrix, 0) for key, matrix in contents.build]
    n = n_steps = n_missing = 0
    while waiting:
        key, matrix, depth = waiting.pop()
        item = contents.objects.get(key)
        n_steps += 1
        if item is None:
            n_missing += 1
            continue
        n += (len(item.vertices) + len(item.triangles)) // 3
        if depth > _DEEPEST or n + OF_A_COMPONENT * n_steps > most:
            expected = f"at most {most} vertices and faces of all copies, {_DEEPEST} levels, and no object in itself"
            raise LoadError(file, f"{key.model}: object {key.id}", f"{n} at level {depth}", expected)
        if item.triangles:
            found.setdefault(key, []).append(matrix)
        waiting += [(part, matrix @ place, depth + 1) for part, place in item.components]
    notes = [f"{n_missing} objects that the file places are not in it"] if n_missing else []
    return {key: found[key] for key in contents.objects if key in found}, notes


class _GroupTable(NamedTuple):
    """All groups (G,), and a last one for triangles without: is_material, is_textured (G + 1,); sizes (G + 1,): their
    numbers of entries; first (G + 1,): where their entries begin among those of all (N, 4): colours, or u, v, 0, 0."""

    is_material: npt.NDArray[np.bool_]
    is_textured: npt.NDArray[np.bool_]
    sizes: npt.NDArray[np.int64]
    first: npt.NDArray[np.int64]
    entries: npt.NDArray[np.float32]


def _group_table(groups: list[_Group]) -> _GroupTable:
    sizes = np.array([*(len(group.entries) for group in groups), 1])
    entries = [*(entry for group in groups for entry in group.entries), (1.0,) * 4]
    is_material = np.array([*(group.is_material for group in groups), False])
    is_textured = np.array([*(group.texture is not None for group in groups), False])
    return _GroupTable(is_material, is_textured, sizes, np.cumsum(sizes) - sizes, np.array(entries, np.float32))


def _pieces(
    key: Key, contents: _Contents, table: _GroupTable, file: Path
) -> dict[tuple[object, ...], tuple[str, int, int, Mesh]]:
    """The triangles of an object by part: of each base material, and of the object itself for the rest; with the part's
    name, its group and its entry there, −1 for none."""
    item = contents.objects[key]
    vertices = np.array(item.vertices).reshape(-1, 3)
    mesh = Mesh(vertices, np.array(item.triangles, np.int64).reshape(-1, 3).astype(np.int32))
    mesh = validate_mesh(mesh, file, f"{key.model}: object {key.id}: ")
    properties = np.array(item.properties, np.int64).reshape(-1, 4)
    _check_properties(properties, key, table, file)
    is_material = table.is_material[properties[:, 0]]
    found: dict[tuple[object, ...], tuple[str, int, int, Mesh]] = {}
    is_textured = table.is_textured[properties[:, 0]]
    faces = np.flatnonzero(is_material | is_textured)
    kinds = np.where(is_textured[:, None], properties[:, :1] * [1, 0], properties[:, :2])[faces]
    pairs, which, counts = np.unique(kinds, axis=0, return_inverse=True, return_counts=True)
    if len(pairs) > _MOST_PARTS:
        raise LoadError(file, f"{key.model}: object {key.id}: materials", len(pairs), f"at most {_MOST_PARTS}")
    by_pair = np.split(faces[np.argsort(which.ravel(), kind="stable")], np.cumsum(counts)[:-1])
    for (number, entry), own in zip(pairs.tolist(), by_pair, strict=False):
        piece, group = without_unused_vertices(select_faces(mesh, own)), contents.groups[number]
        name = group.names[entry] if group.is_material else item.name
        if not group.is_material:
            uvs = table.entries[table.first[number] + properties[own, 1:], :2]
            piece = replace(piece, uvs=np.ascontiguousarray(uvs))
        found[number, entry] = name, number, entry, piece
    rest = ~(is_material | is_textured)
    if rest.any():
        bare = mesh
        if (properties[rest, 0] >= 0).any():
            bare = replace(mesh, colours=table.entries[table.first[properties[:, 0], None] + properties[:, 1:]])
        bare = bare if rest.all() else without_unused_vertices(select_faces(bare, rest))
        found[key] = item.name, -1, -1, bare
    return found


def _check_properties(properties: npt.NDArray[np.int64], key: Key, table: _GroupTable, file: Path) -> None:
    """Refuse entries that a group does not have."""
    outside = (properties[:, 1:] >= table.sizes[properties[:, 0]][:, None]) | (properties[:, 1:] < 0)
    if outside.any():
        k = int(np.argmax(outside.any(axis=1)))
        most = int(table.sizes[properties[k, 0]]) - 1
        where = f"{key.model}: object {key.id}: property of triangle {k}"
        raise LoadError(file, where, properties[k, 1:].tolist(), f"entries from 0 to {most}")


class _ModelReader:
    """Reads one model of a file into its contents."""

    def __init__(self, contents: _Contents, model: str, file: Path, is_main: bool) -> None:
        self._contents, self._model, self._file, self._is_main = contents, model, file, is_main
        self._object = _Object("")
        self._group = _Group(False)
        self._starts: dict[str, Callable[[Attributes], None]] = {
            "model": self._read_unit, "object": self._read_object, "vertex": self._read_vertex,
            "triangle": self._read_triangle, "component": self._read_component, "item": self._read_item,
            "basematerials": self._read_group, "colorgroup": self._read_group, "base": self._read_entry,
            "color": self._read_entry, "texture2d": self._read_texture, "texture2dgroup": self._read_group,
            "tex2coord": self._read_coordinates,
        }  # fmt: skip

    def read(self, data: bytes) -> None:
        """Read the XML. Raises LoadError."""
        self._parser = expat.ParserCreate()
        self._parser.buffer_text = True
        self._parser.StartElementHandler = self._start
        self._parser.StartDoctypeDeclHandler = self._refuse_document_type
        try:
            self._parser.Parse(data, True)
        except expat.ExpatError as error:
            raise LoadError(self._file, self._where, str(error), "well-formed XML") from None
        except (KeyError, ValueError, OverflowError) as error:
            raise LoadError(self._file, self._where, str(error), "numbers in the attributes of 3MF") from None

    @property
    def _where(self) -> str:
        return f"{self._model}: line {self._parser.CurrentLineNumber}"

    def _start(self, name: str, attributes: Attributes) -> None:
        local = name.rpartition(":")[2]
        read = self._starts.get(local)
        if read is not None:
            self._tag = local
            read(attributes)
        elif local not in _SILENT and (local in self._contents.unshown or len(self._contents.unshown) < _MOST_UNSHOWN):
            self._contents.unshown[local] = self._contents.unshown.get(local, 0) + 1

    def _refuse_document_type(self, *_: object) -> None:
        raise LoadError(self._file, self._where, "a document type", "XML without one, as 3MF requires")

    def _read_unit(self, own: Attributes) -> None:
        unit = own.get("unit", "millimeter")
        if self._is_main:
            if unit not in _METRES:
                raise LoadError(self._file, f"{self._where}: unit", unit, ", ".join(_METRES))
            self._contents.metres = _METRES[unit]

    def _read_object(self, own: Attributes) -> None:
        key = Key(self._model, own["id"])
        if key in self._contents.objects:
            raise LoadError(self._file, f"{self._where}: object", own["id"], "numbers that differ")
        self._object = _Object(printable_name(own.get("name", "") or f"object {own['id']}", 48))
        if "pid" in own:
            self._object.default = self._number_of(own["pid"]), _index(own.get("pindex", "0"))
        self._contents.objects[key] = self._object

    def _read_vertex(self, own: Attributes) -> None:
        self._object.vertices += (float(own["x"]), float(own["y"]), float(own["z"]))

    def _read_triangle(self, own: Attributes) -> None:
        self._object.triangles += (_index(own["v1"]), _index(own["v2"]), _index(own["v3"]))
        group, first = self._object.default
        if "p1" in own or "pid" in own:
            group, first = self._number_of(own["pid"]) if "pid" in own else group, _index(own.get("p1", "0"))
            entries = first, _index(own.get("p2", own.get("p1", "0"))), _index(own.get("p3", own.get("p1", "0")))
        else:
            entries = first, first, first
        self._object.properties.append((group, *entries) if group >= 0 else (-1, 0, 0, 0))

    def _read_component(self, own: Attributes) -> None:
        self._object.components.append((self._key(own), _matrix(own)))

    def _read_item(self, own: Attributes) -> None:
        if self._is_main:
            self._contents.build.append((self._key(own), _matrix(own)))

    def _read_group(self, own: Attributes) -> None:
        texture = Key(self._model, own["texid"]) if self._tag == "texture2dgroup" else None
        self._group = _Group(self._tag == "basematerials", texture)
        self._contents.numbers[Key(self._model, own["id"])] = len(self._contents.groups)
        self._contents.groups.append(self._group)

    def _read_entry(self, own: Attributes) -> None:
        text = own.get("displaycolor") or own.get("color") or "#FFFFFF"
        digits = bytes.fromhex(text.removeprefix("#"))
        if len(digits) not in (3, 4):
            raise LoadError(self._file, f"{self._where}: colour", text, "#RRGGBB or #RRGGBBAA")
        red, green, blue, alpha = linear_colours(np.frombuffer(digits, np.uint8)[None] / 255.0)[0].tolist()
        self._group.entries.append((red, green, blue, alpha))
        self._group.names.append(printable_name(own.get("name", "") or describe_value(text), 48))

    def _read_texture(self, own: Attributes) -> None:
        u, v = (_WRAPS.get(own.get(f"tilestyle{axis}", "wrap"), "repeat") for axis in "uv")
        self._contents.textures[Key(self._model, own["id"])] = own["path"].strip("/"), (u, v)

    def _read_coordinates(self, own: Attributes) -> None:
        u, v = (min(max(float(own[axis]), -MAX_UV), MAX_UV) for axis in "uv")
        self._group.entries.append((u, v, 0.0, 0.0))

    def _number_of(self, pid: str) -> int:
        """The number of a group; −1 for one that is not shown."""
        return self._contents.numbers.get(Key(self._model, pid), -1)

    def _key(self, own: Attributes) -> Key:
        """The object that a component or an item names, in this model or another."""
        path = next((value for name, value in own.items() if name.rpartition(":")[2] == "path"), None)
        return Key(self._model if path is None else path.strip("/"), own["objectid"])


def _index(text: str) -> int:
    number = int(text)
    if not 0 <= number < 2**31:
        raise ValueError(f"index {number}")
    return number


def _matrix(own: Attributes) -> Float64Array:
    """The place (4, 4) of an object: the file has the rows of a matrix for row vectors."""
    matrix = np.eye(4)
    if "transform" in own:
        rows = np.array([float(word) for word in own["transform"].split()])
        if rows.shape != (12,) or not (np.abs(rows) <= 1e12).all():
            raise ValueError(f"transform {own['transform'][:60]}")
        matrix[:3] = rows.reshape(4, 3).T
    return matrix
