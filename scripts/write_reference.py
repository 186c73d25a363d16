"""Writes the pages of docs/reference/ from what the program itself declares; a test keeps them current.

    .venv/bin/python -m scripts.write_reference

The command line comes from typer, the file formats from the pydantic models that read them, models from their tables of
parameters; shortcuts, menus and the keys of scripts from the operators (`app.operators`), render settings from
`engine.settings`. What another key of a scene or a session means is written in docs/reference/keys.toml.
"""

from __future__ import annotations

import dataclasses
import tomllib
import types
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import typer
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from app.cli.program import cli
from app.files.layer_records import CurveRecord, LayerRecord, OperatorRecord
from app.files.light_records import LightRecord, MixRecord, PaintedRecord, SunRecord
from app.files.records import (
    AddedRecord,
    BackgroundRecord,
    BookmarkRecord,
    DeformerRecord,
    LookRecord,
    ObjectRecord,
    SessionRecord,
    TransformRecord,
    ViewRecord,
)
from app.operators.arrange import Addition, Aim, Grouping, Move, PaintedAddition, PlacedByHand
from app.operators.camera import MoveCamera
from app.operators.curve_drawing import CurvePoints, CurveStroke
from app.operators.edits import CurveLink, Deform, Drag, HighlightStep, PaintStroke
from app.operators.files import CurveTable, MaterialFile, MeasuredFile, VariantChoice
from app.operators.inspect import ConfiguredView
from app.operators.keymap import KEYMAP_LABELS, KEYMAPS, in_keymap
from app.operators.material_matches import MatchMaterial
from app.operators.photos import MatchStep
from app.operators.registry import GROUPS, MENUS, OPERATORS, Menu, keys_of, listed_lines
from app.operators.script import ScriptRecord, StepRecord
from app.operators.selecting import BoxSelection
from app.operators.transfers import Transfer
from engine.material import MODELS
from engine.material.bumps import Bumps
from engine.material.layer_maps import LayerMaps
from engine.material.map_tables import map_fields
from engine.material.opacity import Opacity
from engine.material.parameters import Parameter
from engine.scene import surface_kinds
from engine.scene.description import (
    CameraDescription,
    ConeDescription,
    EnvironmentDescription,
    LayerDescription,
    ObjectDescription,
    SceneDescription,
    SunDescription,
)
from engine.settings import SETTINGS, Setting

Tables = list[tuple[str, type[BaseModel]]]

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "reference"
# Tables of each format: where they stand in the file, and the model that reads them.
SCENE: Tables = [
    ("Top of the file", SceneDescription), ("[camera]", CameraDescription), ("[environment]", EnvironmentDescription),
    ("[[environment.sun]]", SunDescription),
    ("[[object]]", ObjectDescription), ("object.cone", ConeDescription), ("object.layer", LayerDescription),
    ("object.deform.membrane", surface_kinds.Membrane), ("object.deform.subsurface", surface_kinds.Subsurface),
    ("object.deform.patch", surface_kinds.Detail), ("object.deform.wrinkles", surface_kinds.Wrinkles),
]  # fmt: skip
SESSION: Tables = [
    ("Top of the file", SessionRecord), ("[light]", LightRecord), ("light.suns", SunRecord),
    ("light.painted", PaintedRecord),
    ("light.mix", MixRecord), ("[background]", BackgroundRecord), ("[view]", ViewRecord),
    ("[[object]]", ObjectRecord),
    ("[[object.layer]]", LayerRecord), ("[[object.layer.curve]]", CurveRecord), ("its operator", OperatorRecord),
    ("object.added", AddedRecord), ("object.transform", TransformRecord),
    ("[[object.deformer]]", DeformerRecord), ("[[bookmark]]", BookmarkRecord),
    ("[[look]]", LookRecord),
]  # fmt: skip
SCRIPT: Tables = [
    ("Top of the file", ScriptRecord), ("[[step]]", StepRecord), ("drag", Drag), ("deform", Deform), ("add", Addition),
    ("move", Move),
    ("place_light", PlacedByHand), ("paint_light", PaintedAddition),
    ("link", CurveLink),
    ("paint", PaintStroke), ("paint_highlight", HighlightStep), ("transfer", Transfer),
    ("match_material", MatchMaterial),
    ("measured", MeasuredFile), ("material_file", MaterialFile), ("table", CurveTable),
    ("variant_set", VariantChoice), ("draw_curve", CurveStroke), ("set_points", CurvePoints), ("camera", MoveCamera),
    ("match", MatchStep), ("aim", Aim), ("group", Grouping),
    ("box_select", BoxSelection), ("ocio", ConfiguredView),
]  # fmt: skip
SHOWN: dict[tuple[type[BaseModel], str], str] = {
    (ObjectDescription, "bumps"): "`normal_map` or `bump_map`, `coat_normal_map`, `tangent`"
}
PLAIN = {bool: "true or false", int: "an integer", float: "a number", str: "text", tuple: "2 values", Any: "a value"}
NAMED = {
    LayerMaps: "a table of images",
    Bumps: "tables of images",
    Opacity: "a table",
    surface_kinds.DeformSurface: "a table",
}
MISSING = "This key has no description: write one in docs/reference/keys.toml"


def pages() -> dict[str, str]:
    """Each generated page's name and text."""
    meanings = tomllib.loads((FOLDER / "keys.toml").read_text(encoding="utf-8"))
    return {
        "command-line.md": _command_line(),
        "scene-file.md": _format("The scene file", SCENE, meanings),
        "session-file.md": _format("The session file", SESSION, meanings),
        "script-file.md": _format("The script file", SCRIPT, meanings),
        "models.md": _models(),
        "shortcuts.md": _shortcuts(),
    }


def _command_line() -> str:
    group = typer.main.get_command(cli)
    blocks = [_head("The command line", "app/cli/program.py"), group.help or "", group.epilog or ""]
    for name, command in group.commands.items():  # type: ignore[attr-defined]
        if command.hidden:
            continue
        context = typer.Context(command, info_name=f"insitu {name}")
        usage = " ".join(["insitu", name, *command.collect_usage_pieces(context)])
        records = [record for each in command.params if (record := each.get_help_record(context))]
        blocks += [f"## insitu {name}", command.help or "", f"```\n{usage}\n```"]
        blocks.append(_table(("option", "what it does"), [(f"`{words}`", text) for words, text in records]))
    return _joined(blocks)


def _format(title: str, tables: Tables, meanings: Mapping[str, Any]) -> str:
    modules = dict.fromkeys(f"{model.__module__.replace('.', '/')}.py" for _, model in tables)
    blocks = [_head(title, *modules), meanings[title]]
    for place, model in tables:
        rows = [
            (SHOWN.get((model, name), f"`{field.alias or name}`"), _kind(field), _default(field),
             _meaning(meanings, model, name))
            for name, field in model.model_fields.items()
            if model is not LayerDescription or name not in ("maps", "parameters")  # which stand in the layer itself
        ]  # fmt: skip
        if model is LayerDescription:
            own = meanings["LayerMaps"]
            rows += [
                (f"`{each.name}`", _kind_of(type(each.default)), _default_of(each.default), own[each.name])
                for each in dataclasses.fields(LayerMaps) if each.name in map_fields()
            ]  # fmt: skip
        blocks += [f"## {place}", meanings.get(model.__name__, {}).get("about", "")]
        blocks.append(_table(("key", "value", "default", "meaning"), rows))
    return _joined(blocks)


def _models() -> str:
    blocks = [_head("Models", "engine/material/")]
    blocks.append("Each layer of a material names one of these models; its other keys are the model's parameters.")
    for name, model in sorted(MODELS.items()):
        blocks += [f"## {name}", f"**{model.label}.** {' '.join(model.tooltip.split())}"]
        rows = [
            (f"`{each.name}`", each.expected + (f", {each.unit}" if each.unit else ""), _value(each), each.tooltip)
            for each in model.parameters
        ]
        blocks.append(_table(("parameter", "value", "default", "meaning"), rows) if rows else "")
    return _joined(blocks)


def _shortcuts() -> str:
    blocks = [_head("Shortcuts and menus", "app/operators/")]
    blocks.append("`?` shows this list in the window. Keys work while nothing is being typed.")
    for group in GROUPS:
        rows = [(f"`{keys}`", text) for keys, text in listed_lines(group)]
        blocks += [f"## {group}", _table(("keys, mouse", "what they do"), rows)]
    for keys, label in KEYMAP_LABELS.items():
        rows = [
            (f"`{'`, `'.join(own)}`", OPERATORS[name].entry or in_keymap(OPERATORS[name], keys).help)
            for name, (own, _) in KEYMAPS[keys].items()
        ]
        if rows:
            said = "*Edit > Arrange > Keys* chooses these in place of the keys above."
            blocks += [f"## Keys: {label}", said, _table(("keys", "what they do"), rows)]
    blocks.append("## Menus")
    entries = [row for menu in MENUS for row in _menu_rows(menu, menu.title)]
    return _joined([*blocks, _table(("entry", "keys", "why it cannot be chosen"), entries)])


def _menu_rows(menu: Menu, place: str) -> Iterator[tuple[str, str, str]]:
    for row in menu.rows:
        if isinstance(row, Menu):
            yield from _menu_rows(row, f"{place} > {row.title}")
        elif row is not None:
            operator, keys = OPERATORS[row], keys_of(row)
            reason = "" if operator.needs is None else operator.needs.reason
            yield f"{place} > {operator.entry}", keys and f"`{keys}`", reason


def _value(parameter: Parameter) -> str:
    return "" if parameter.kind == "file" else f"`{_literal(parameter.default)}`"


def _head(title: str, *sources: str) -> str:
    named = ", ".join(f"`{source}`" for source in sources)
    return f"# {title}\n\nWritten by `scripts/write_reference.py` from {named}."


def _meaning(meanings: Mapping[str, Any], model: type[BaseModel], name: str) -> str:
    text = model.model_fields[name].description or meanings.get(model.__name__, {}).get(name)
    if model is ViewRecord and name in SETTINGS:
        text = _setting_meaning(SETTINGS[name])
    if not text:
        raise SystemExit(f"{model.__name__}.{name}: {MISSING}")
    return text


def _setting_meaning(setting: Setting) -> str:
    """A render setting's meaning, with that of the value for as many as required."""
    if not setting.as_required:
        return setting.help
    (value,) = setting.as_required
    rest = "as many as required where it is left out" if value is None else f"{value}: as many as required"
    return f"{setting.help[:-1]}; {rest}."


def _kind(field: FieldInfo) -> str:
    return _kind_of(field.annotation, field.metadata)


def _kind_of(annotation: Any, metadata: Sequence[Any] = ()) -> str:
    """What a value may be, in words: kind, range, choices."""
    origin, parts = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return _kind_of(parts[0], [*parts[1:], *metadata])
    if origin is Literal:
        return " or ".join(f"`{_literal(part)}`" for part in parts)
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(_kind_of(part, metadata) for part in parts if part is not type(None)))
    if origin is tuple and len(parts) == 2 and parts[1] is Ellipsis:
        return f"a list of {_plural(_kind_of(parts[0]))}"
    if origin is tuple:
        kinds = list(dict.fromkeys(map(_kind_of, parts)))
        return f"{len(parts)} values: {kinds[0]} each" if len(kinds) == 1 else ", ".join(kinds)
    if origin is dict:
        return f"a table of {_plural(_kind_of(parts[1]))}"
    known = PLAIN.get(annotation) or NAMED.get(annotation) or "a table"
    return known + _range(metadata)


def _plural(kind: str) -> str:
    return {"a table": "tables", "a number": "numbers", "a value": "values", "text": "texts"}.get(kind, kind)


def _range(metadata: Sequence[Any]) -> str:
    bounds: dict[str, float] = {}
    for each in metadata:
        for part in each.metadata if isinstance(each, FieldInfo) else [each]:
            bounds |= {key: getattr(part, key) for key in ("ge", "gt", "le", "lt") if hasattr(part, key)}
    words = {"ge": "from", "gt": "over", "le": "to", "lt": "below"}
    said = [f"{words[key]} {bounds[key]:g}" for key in ("ge", "gt", "le", "lt") if bounds.get(key) is not None]
    return f" {' '.join(said)}" if said else ""


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    return _default_of(field.get_default(call_default_factory=True))


def _default_of(value: Any) -> str:
    if isinstance(value, BaseModel) or dataclasses.is_dataclass(value) or value in (None, "", (), {}):
        return ""
    return f"`{_literal(value)}`"


def _literal(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (tuple, list)):
        return f"[{', '.join(map(_literal, value))}]"
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(text.replace('|', chr(92) + '|') for text in row)} |" for row in cells)


def _joined(blocks: Sequence[str]) -> str:
    return "\n\n".join(block.strip() for block in blocks if block.strip()) + "\n"


def outdated() -> Iterator[str]:
    """The names of pages that do not say what the program does now."""
    for name, text in pages().items():
        path = FOLDER / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            yield name


if __name__ == "__main__":
    for page, text in pages().items():
        (FOLDER / page).write_text(text, encoding="utf-8")
