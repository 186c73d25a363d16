"""Operators on files: scenes, sessions, measured materials and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from app.document.scene_files import can_turn, has_variants, split_axis
from app.editor.editor import Editor
from app.files.material_files import MARK
from app.operators.operator import CURVE, LAYER, LOOK, SCENE, Need, Operator, ScriptKey, ValueRecord
from engine.scene.description import Text


class MeasuredFile(ValueRecord):
    file: Annotated[Text, Field(description="A MERL table or Cornell's samples.")]
    cloth: Annotated[bool, Field(description="Whether it is fitted as cloth, P·Q·P.")] = False


def _import_measured(editor: Editor, measured: MeasuredFile) -> str | None:
    return editor.exchange.import_measured(Path(measured.file), measured.cloth)


class MaterialFile(ValueRecord):
    file: Annotated[Text, Field(description="A MaterialX file.")]
    material: Annotated[str, Field(description="A material in it; else its first.")] = ""


def _import_material(editor: Editor, value: MaterialFile) -> str | None:
    return editor.exchange.import_material(f"{value.file}{MARK}{value.material}" if value.material else value.file)


class CurveTable(ValueRecord):
    file: Annotated[Text, Field(description="A table of angles in degrees and values (CSV).")]


def _load_table(editor: Editor, table: CurveTable) -> str | None:
    return editor.exchange.read_table(table.file)


class VariantChoice(ValueRecord):
    set: Annotated[Text, Field(description="A set of variants of the stage.")]
    variant: Annotated[Text, Field(description="One of them.")]


def _choose_variant(editor: Editor, choice: VariantChoice) -> str | None:
    return editor.scenes.choose_variants({choice.set: choice.variant})


MESH = Need("a scene file says where its objects are; open a mesh", lambda context: can_turn(context.document.source))
STAGE = Need("only stages of USD have sets of variants", lambda context: has_variants(context.document.source))

FILES = (
    Operator("open", keys=("Ctrl O",), help="Open a scene or session", entry="Open…"),
    Operator("new", keys=("Ctrl N",), help="New: an empty scene", entry="New"),
    Operator("open_recent", entry="Open recent"),
    Operator("open_builtin", entry="Built-in scenes"),
    Operator("open_environment", entry="Open environment…"),
    Operator(
        "reload", lambda editor, value: editor.scenes.reload(), ("Ctrl R",),
        "Reload files saved by other programs; edits stay", entry="Reload", needs=SCENE, waits=True,
        script=ScriptKey(Literal[True], "Reads the scene's files again."),
    ),
    Operator(
        "z_up", lambda editor, value: editor.scenes.turn_up(None if value is None else "z" if value else "y"),
        help="Turn a mesh whose Z axis points up, as in CAD, or turn it back; edits stay.", entry="Z is up",
        is_on=lambda context: split_axis(context.document.source)[1] == "z", needs=MESH, waits=True,
        script=ScriptKey(bool, "Whether the Z axis of an opened mesh points up."),
    ),
    Operator(
        "variant_set", _choose_variant, needs=STAGE, waits=True,
        script=ScriptKey(VariantChoice, "Opens a stage of USD with a variant of one of its sets: see below."),
    ),
    Operator("report", keys=("I",), help="What the file has, and what is not shown", entry="What the file contains"),
    Operator("save", keys=("Ctrl S",), help="Save the session", entry="Save session"),
    Operator(
        "save_as", keys=("Ctrl Shift S",), help="Save the session under a new name", entry="Save session as…",
        script=ScriptKey(Text, "Saves the session in a file (.insitu)."),
    ),
    Operator(
        "save_scene", entry="Save as scene…", needs=SCENE,
        help="Save the scene as it is now with everything it needs, in a folder or in one file.",
        script=ScriptKey(Text, "Saves the scene with everything it needs: a folder, or a file (.insitu.zip)."),
    ),
    Operator(
        "save_environment", entry="Save the environment…", needs=SCENE,
        help="Write the environment with what is painted on it, its suns and their mix as an OpenEXR map.",
    ),
    Operator("recover", entry="Recover edits…"),
    Operator(
        "measured", _import_measured, entry="Import measured BRDF…", needs=LAYER,
        help="Make the selected object of a measured material: MERL .binary, Cornell .brdf or RGL .bsdf.",
        script=ScriptKey(MeasuredFile, "Imports a measured BRDF: see below."),
    ),
    Operator(
        "material_file", _import_material, entry="Import MaterialX…", needs=LAYER,
        help="Give the selected object a material of a MaterialX file (.mtlx); of several, Variant has the others.",
        script=ScriptKey(MaterialFile, "Imports a material of MaterialX: see below."),
    ),
    Operator(
        "match_picture", entry="Match a picture…", needs=LAYER,
        help="Find the selected object's material in a photograph that was taken in the scene's light.",
    ),
    Operator(
        "table", _load_table, entry="Load a curve table…", needs=CURVE,
        help="Put a table (CSV: angle in degrees, one value or red, green, blue) on the selected curve.",
        script=ScriptKey(CurveTable, "Puts a table on the selected curve: see below."),
    ),
    Operator(
        "export_measured", entry="Export as measured BRDF…", needs=LAYER,
        help="Write the selected object's material, edits and all, as a table of angles (MERL .binary).",
    ),
    Operator(
        "export_scene", entry="Export for Mitsuba 3…", needs=SCENE,
        help="Write the scene as it is now into a folder, with a program that renders the final frame from it.",
        script=ScriptKey(Text, "Writes the scene for Mitsuba 3 into a folder."),
    ),
    Operator(
        "picture", keys=("F12",), help="Save the picture: PNG of 8 or 16 bits, EXR", entry="Save the picture…",
        needs=SCENE, script=ScriptKey(Text, "Writes the picture alone to a PNG or EXR file."),
    ),
    Operator(
        "contact_sheet", entry="Save contact sheet…", needs=LOOK,
        help="All looks, drawn in the background, on one page with their names: PNG.",
    ),
    Operator(
        "screenshot", keys=("Shift F12",), help="Save a picture of the window", entry="Save a picture of the window"
    ),
    Operator("capture", script=ScriptKey(Text, "Writes the window to a PNG file.")),
    Operator("quit", keys=("Ctrl Q",), help="Quit; asks where edits are not saved", entry="Quit"),
)  # fmt: skip
