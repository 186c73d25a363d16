"""Materials in files of their own: the layers of one object as TOML, for the library, the clipboard, and to share.

    version = 1
    name = "Gold leaf"
    category = "Metals"
    layer = [{ model = "rough_conductor", name = "gold", alpha = 0.2, eta = [...], k = [...] }]
    [[curve]]
    layer = 0
    factor = "theta_h"
    operator = [{ kind = "amplify", axis = "y", regions = [0.1, 0.2, 0.4, 0.6], magnitude = 0.5 }]

`layer` is the same as in a scene file, so that it can be copied from one to the other in a text editor; a session's
form was rejected for being long. `hidden` lists the layers that are not shown. `part` is only in what was copied:
"layer" makes it one to add on top of others, a curve's name that curve of the first layer.

The library has materials that come with the program, and the user's own. Its files are read one at a time, a few
milliseconds each, between frames: the window opens before its library is there. A faulty file stays in the list with
its error, so that it can be found and repaired.

A material of measured BRDFs waits for its files: the worker reads them before their layers are put on an object. The
edit is carried out when the response comes, as one step of the history; until then the document does not change.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from app.document.commands.curves import SetOperators
from app.document.commands.layers import AddLayers, SetMaterial, operators_of_copy
from app.document.document import Document, Selection, split_key
from app.document.linked_layers import Layers, layers_from_descriptions, linked_indices, synchronize_layers
from app.document.named_files import FILE, measurement_in, unread_files, with_full_paths, with_measurements
from app.files.layer_records import MAX_LAYERS, CurveRecord, StrictModel, description_of, operator_lines, with_curves
from app.files.material_files import MARK, complete_material, is_material_file, split_material
from app.messages.file_messages import MaterialsRead, MeasurementsRead, ReadMaterials, ReadMeasured
from app.messages.worker_messages import Request
from app.system.atomic import save_file
from app.system.paths import full_path, is_file_name, material_directory
from engine.core.errors import InsituError, LoadError
from engine.core.safe_files import exists, resolved
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.measured.measurement import Measurement
from engine.scene.builtin import builtin_materials
from engine.scene.description import LayerDescription, Text
from engine.scene.toml_text import check_version, first_validation_error, load_toml, parse_toml, toml_lines, toml_value

MATERIAL_VERSION = 1
MAX_MATERIAL_BYTES = 4 * 2**20
MAX_NAME = 64
SUFFIX = ".toml"
LAYER = "layer"

Index = Annotated[int, Field(strict=True, ge=0, lt=MAX_LAYERS)]
ShortText = Annotated[str, Field(min_length=1, max_length=MAX_NAME, strict=True)]


@dataclass(frozen=True)
class Material:
    """All layers of an object under a name. `part`: what was copied, LAYER or a curve of the first layer; "": all."""

    name: str
    layers: Layers
    category: str = "Own"
    part: str = ""


class MaterialCurveRecord(CurveRecord):
    """The operators on a curve of one of the layers, counted from 0."""

    layer: Index


class MaterialRecord(StrictModel):
    """A whole material file."""

    version: Annotated[int, Field(strict=True)]
    name: ShortText
    category: ShortText = "Own"
    part: Text | None = None
    hidden: tuple[Index, ...] = ()
    layers: Annotated[tuple[LayerDescription, ...], Field(alias="layer", min_length=1, max_length=MAX_LAYERS)]
    curves: Annotated[tuple[MaterialCurveRecord, ...], Field(alias="curve", max_length=8 * MAX_LAYERS)] = ()


def load_material(path: Path) -> Material:
    """Read a material file; LoadError names the place of the first error."""
    material = _material(load_toml(path, MAX_MATERIAL_BYTES), str(path))
    return replace(material, layers=with_full_paths(material.layers, resolved(path).parent))


def parse_material(text: str, where: str) -> Material:
    """The material in a text, called `where` in the message of LoadError."""
    try:
        tree = parse_toml(text, where)
    except LoadError:
        raise LoadError(where, "text", f"{text[:24]!r}", "a material that was copied") from None
    return _material(tree, where)


def save_material(path: Path, material: Material, *, private: bool = False) -> None:
    """Write a material file, whole or not at all. InsituError says why it cannot be written, also where it could not be
    read again."""
    text = dump_material(material)
    if dump_material(parse_material(text, f"{path}: not written, it could not be read again")) != text:
        raise InsituError(f"{path}: not written, another material would be read from it")
    save_file(path, text.encode(), private=private)


def dump_material(material: Material, folder: Path | None = None) -> str:
    """The TOML text that reads back as an equal material; measured files inside ``folder`` are named from there."""
    head = {"version": MATERIAL_VERSION, "name": material.name, "category": material.category}
    hidden = [index for index, layer in enumerate(material.layers) if not layer.visible]
    lines = [
        "# An Insitu material. Angles of operators in radians.",
        *toml_lines(head | {"part": material.part or None, "hidden": hidden or None}),
        "layer = [",
        *(f"  {toml_value(description_of(layer, folder))}," for layer in material.layers),
        "]",
        *_curve_lines(material.layers),
    ]
    return "\n".join(lines) + "\n"


def _curve_lines(layers: Layers) -> Iterator[str]:
    for index, layer in enumerate(layers):
        for factor, operators in () if layer.rises else layer.edits:
            yield "[[curve]]"
            yield from toml_lines({"layer": index, "factor": factor})
            yield from operator_lines(operators)


def _material(tree: dict[str, Any], file: str) -> Material:
    check_version(tree, Path(file), MATERIAL_VERSION)
    try:
        record = MaterialRecord.model_validate(tree)
    except ValidationError as error:
        raise first_validation_error(error, tree, file, MaterialRecord) from None
    plain = layers_from_descriptions(file, record.name, record.layers)
    beyond = next((i for i in (*record.hidden, *(c.layer for c in record.curves)) if i >= len(plain)), None)
    if beyond is not None:
        raise LoadError(file, "layer", beyond, f"0 to {len(plain) - 1}, the layers counted from 0")
    layers = synchronize_layers(
        tuple(
            with_curves(file, f"layer {i}", layer, [c for c in record.curves if c.layer == i]).replace(
                visible=i not in record.hidden
            )
            for i, layer in enumerate(plain)
        )
    )
    if record.part not in (None, LAYER, *layers[0].model.curve_names):
        raise LoadError(file, "part", str(record.part), f"{LAYER}, or a curve of {layers[0].model.name}")
    return Material(record.name, layers, record.category, record.part or "")


OWN = "Own"
MOST_FILES = 2000


@dataclass(frozen=True)
class LibraryEntry:
    """One material of the library. `problem`: the line that says why its file cannot be used; it has no layers then."""

    path: Path
    material: Material
    is_own: bool = False
    problem: str = ""

    @property
    def name(self) -> str:
        return self.material.name

    @property
    def category(self) -> str:
        return OWN if self.is_own else self.material.category

    def matches(self, search: str) -> bool:
        """Whether every word of the search is in its name, its category or the names of its layers and models."""
        layers = " ".join(f"{layer.name} {layer.model.label}" for layer in self.material.layers)
        text = f"{self.name} {self.category} {layers}".lower()
        return all(word in text for word in search.lower().split())


@dataclass
class Library:
    """All materials, built-in ones first, then by category and name. `folder`: that of the user's own."""

    folder: Path | None = None
    _entries: tuple[LibraryEntry, ...] = ()
    _unread: list[Path] | None = field(default=None)

    @property
    def entries(self) -> tuple[LibraryEntry, ...]:
        """Those read so far."""
        return self._entries

    def read_next(self) -> bool:
        """Read one more file; returns whether there is another left. The first call lists the folders."""
        if self._unread is None:
            self._unread = [*builtin_materials(), *_own_files(self._own_folder())]
        if self._unread:
            self._put(_read(self._unread.pop(0), self._own_folder()))
        return bool(self._unread)

    def read_all(self) -> None:
        """Read all that is left."""
        while self.read_next():
            pass

    def entry(self, name: str) -> LibraryEntry:
        """The material of that name; InsituError when there is none, or its file is wrong."""
        self.read_all()
        found = next((entry for entry in reversed(self._entries) if entry.name == name), None)
        if found is None:
            raise InsituError(f"there is no material {name!r} in the library")
        if found.problem:
            raise InsituError(found.problem)
        return found

    def save(self, name: str, layers: Layers) -> LibraryEntry:
        """Store a material under a name among the user's own, replacing one of the same name; returns its entry."""
        name = name.strip()
        if not 0 < len(name) <= MAX_NAME or not name.isprintable():
            raise InsituError(f"{name!r} is no name for a material, expected 1 to {MAX_NAME} characters")
        path = self._path_for(name)
        material = Material(name, layers, OWN)
        save_material(path, material, private=True)
        entry = LibraryEntry(path, material, is_own=True)
        self._put(entry)
        return entry

    def delete(self, path: Path) -> None:
        """Delete one of the user's own materials."""
        entry = next((entry for entry in self._entries if entry.path == path and entry.is_own), None)
        if entry is None:
            raise InsituError(f"{path}: only your own materials can be deleted")
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise InsituError(f"{path}: not deleted, {error.strerror or error}") from error
        self._entries = tuple(other for other in self._entries if other is not entry)

    def _own_folder(self) -> Path:
        if self.folder is None:
            self.folder = material_directory()
        return self.folder

    def _path_for(self, name: str) -> Path:
        """The file of the user's material of this name, or an unused one."""
        own = next((entry.path for entry in self._entries if entry.is_own and entry.name == name), None)
        if own is not None:
            return own
        stem = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "material"
        names = (self._own_folder() / f"{stem}{suffix}{SUFFIX}" for suffix in ("", *(f"_{n}" for n in range(2, 1000))))
        return next(path for path in names if not path.exists())

    def _put(self, entry: LibraryEntry) -> None:
        others = [other for other in self._entries if other.path != entry.path]
        self._entries = tuple(sorted([*others, entry], key=lambda e: (e.is_own, e.category, e.name.lower())))


def categories(entries: Iterable[LibraryEntry]) -> list[str]:
    """The categories in the order of the entries."""
    return list(dict.fromkeys(entry.category for entry in entries))


def _own_files(folder: Path) -> list[Path]:
    """Those in the folder; on a cluster's machine those of them that were sent."""
    files = (path for path in folder.glob(f"*{SUFFIX}") if not path.name.startswith("."))
    return sorted(filter(exists, files))[:MOST_FILES]


def _read(path: Path, own: Path) -> LibraryEntry:
    is_own = path.parent == own
    try:
        return LibraryEntry(path, load_material(path), is_own)
    except InsituError as error:
        return LibraryEntry(path, Material(path.stem, (), "Cannot be read"), is_own, str(error))


def copy_material(document: Document, name: str) -> Material:
    """All of an object's material, with the object's name."""
    return Material(name, document.object(name).layers)


def copy_layer(document: Document, key: str) -> Material:
    """One layer on its own, with its Fresnel term where it has one."""
    name, index = split_key(document, key)
    layers = document.object(name).layers
    lead = layers[linked_indices(layers, index)[0]] if layers[index].rises else layers[index]
    terms = [layer for layer in layers if layer.rises and layer.follows == lead.name]
    alone = tuple(each.replace(under="", covers=()) for each in (lead.replace(follows=""), *terms))
    return Material(lead.name, alone, part=LAYER)


def copy_curve(document: Document, key: str, factor: str) -> Material:
    """One curve of a layer."""
    layer = document.layer(key)
    alone = layer.with_fresnel(None).replace(follows="", rises=False, under="", covers=())
    return Material(layer.name, (alone,), part=layer.model.leader(factor))


def paste_command(
    material: Material, document: Document, selected: Selection | None, as_layers: bool
) -> SetMaterial | AddLayers | SetOperators:
    """The edit. Raises InsituError where nothing is selected that could take it."""
    if selected is None:
        raise InsituError("nothing is selected; select the object or the curve to paste onto")
    if material.part in ("", LAYER):
        layers: Layers = tuple(layer.replace(frozen=False) for layer in material.layers)
        if as_layers or material.part == LAYER:
            return AddLayers(selected.object, layers)
        return SetMaterial(selected.object, layers, material.name)
    if selected.factor is None:
        raise InsituError("no curve is selected; select the one to paste onto")
    operators = operators_of_copy(material.layers[0], material.part, document.layer(selected.key), selected.factor)
    return SetOperators(selected.key, selected.factor, operators)


def measured_layers(file: Path, cloth: bool = False) -> Layers:
    """The diffuse part and the highlight of a file that is still to be read, when its best curves are chosen; or one
    layer of P·Q·P."""
    parts = (("measured_cloth", "cloth"),) if cloth else (("measured_diffuse", "diffuse"), ("measured", "highlight"))
    unread = Measurement(str(resolved(file)), is_import=True)
    return tuple(make_layer(MODELS[model], {FILE: unread}, name) for model, name in parts)


def import_measured(object_name: str, file: Path, cloth: bool = False) -> SetMaterial:
    """The edit that makes an object of what was measured; cloth: as in `measured_layers`."""
    return SetMaterial(object_name, measured_layers(file, cloth), file.stem)


def full_material_name(name: str) -> str:
    """The name of a material for another folder or machine: the absolute path of a file, also of one of the user's own
    materials; a built-in one has its name everywhere. Raises InsituError."""
    if is_material_file(name):
        file, material = split_material(name)
        return full_path(file) + (MARK + material if material else "")
    if is_file_name(name):
        return full_path(name)
    entry = Library().entry(name)
    return str(entry.path) if entry.is_own else name


class PendingMeasurement:
    """At most one edit that waits; a newer one replaces it. ``send`` sends a request."""

    def __init__(self, send: Callable[[Request], int]) -> None:
        self._send = send
        self._waiting: tuple[int, SetMaterial | AddLayers] | None = None

    @property
    def is_under_way(self) -> bool:
        """Whether an edit waits for its files."""
        return self._waiting is not None

    def waits_for(self, id: int) -> bool:
        """Whether an edit waits for the response to this request."""
        return self._waiting is not None and self._waiting[0] == id

    def defer_command(self, command: object, document: Document) -> bool:
        """Whether a command has to wait; if so its files are requested. Raises InsituError where it would not be
        carried out."""
        if not isinstance(command, SetMaterial | AddLayers):
            return False
        if isinstance(command, SetMaterial) and command.file:
            command.check(document)
            self._waiting = self._send(ReadMaterials(command.file, command.name)), command
            return True
        files = unread_files(command.layers)
        if files:
            command.apply(document)
            self._waiting = self._send(ReadMeasured(files, command.layers)), command
        return bool(files)

    def complete_edit(self, response: MeasurementsRead | MaterialsRead) -> SetMaterial | AddLayers | None:
        """The edit that waited for this response, complete."""
        if self._waiting is None or self._waiting[0] != response.id:
            return None
        (_, command), self._waiting = self._waiting, None
        if isinstance(response, MeasurementsRead):
            return replace(command, layers=with_measurements(command.layers, response.found))
        assert isinstance(command, SetMaterial)
        return complete_material(command, response.materials, response.chosen)

    def cancel(self, id: int | None = None) -> None:
        """Give up the edit that waits, or only if it waits for that request."""
        if self._waiting is not None and id in (None, self._waiting[0]):
            self._waiting = None


def describe_reading(layers: tuple[Layer, ...]) -> str:
    """One line on the files of layers that were just read."""
    there = dict.fromkeys(found for layer in layers if (found := measurement_in(layer)) is not None)
    return "; ".join(describe_measurement(each) for each in there)


def describe_measurement(measurement: Measurement) -> str:
    """A file, what was filled in it, and the error of its factors alone."""
    report, name = measurement.report, Path(measurement.file).name
    if report is None:
        return f"{name}: not read"
    filled = f"{report.n_missing:,} missing samples and {report.n_below:,} below the horizon filled"
    error = f"error of the curves alone: a factor of {math.exp(report.error):.2f} (log RMS {report.error:.3f})"
    return f"{name}: {filled}; {error}; the residual is stored, too"
