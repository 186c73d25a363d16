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
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from app.document.linked_layers import Layers, layers_from_descriptions, synchronize_layers
from app.document.named_files import with_full_paths
from app.files.layer_records import MAX_LAYERS, CurveRecord, StrictModel, description_of, operator_lines, with_curves
from app.system.atomic import save_file
from engine.core.errors import InsituError, LoadError
from engine.core.safe_files import resolved
from engine.scene.description import LayerDescription, Text
from engine.scene.toml_text import check_version, load_toml, parse_toml, toml_lines, toml_value
from engine.scene.validation_errors import first_validation_error

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
