"""All operators by name, their groups in the list of shortcuts, and the menus. How one is run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from app.document.view_state import PICTURE_CHANNELS
from app.editor.editor import Editor
from app.files.preferences import Keys, Preferences
from app.operators.arrange import ARRANGE, adding, painting
from app.operators.camera import CAMERA, CONVENTIONS
from app.operators.curve_drawing import DRAWING
from app.operators.edits import CURVES, EDITS, MATERIAL
from app.operators.files import FILES
from app.operators.inspect import INSPECT, channel_operator
from app.operators.keymap import in_keymap
from app.operators.looks import LOOKS
from app.operators.material_matches import MATERIAL_MATCHES
from app.operators.operator import Gesture, Operator
from app.operators.photos import PHOTOS
from app.operators.selecting import SELECTING
from app.operators.transfers import TRANSFERS
from app.operators.view import HELP, PICTURE
from engine.core.errors import InsituError
from engine.light.painted_lights import PAINTED_KINDS
from engine.scene.composition import LIGHTS, PROPS, SHAPES, SUN

GROUPS: dict[str, tuple[Operator | Gesture, ...]] = {
    "Edit": EDITS, "Select": SELECTING, "Arrange": ARRANGE, "Looks": LOOKS, "Picture": PICTURE, "Inspect": INSPECT,
    "Camera": CAMERA, **CONVENTIONS,
    "File": FILES, "Material": (*MATERIAL, *MATERIAL_MATCHES), "Curve": (*CURVES, *DRAWING, *TRANSFERS, *PHOTOS),
    "Help": HELP,
}  # fmt: skip
DEFAULT_KEYS: Keys = Preferences().keys
OPERATORS = {each.name: each for group in GROUPS.values() for each in group if isinstance(each, Operator)}


@dataclass(frozen=True)
class Menu:
    """A menu, or one within another: names of operators, None between two sections."""

    title: str
    rows: tuple[str | None | Menu, ...]

    def names(self) -> Iterator[str]:
        """The operators in it, and in the menus within it."""
        for row in self.rows:
            if isinstance(row, Menu):
                yield from row.names()
            elif row is not None:
                yield row


MENUS = (
    Menu("File", (
        "new", "open", "open_recent", "open_builtin", "open_environment", "reload", "z_up", "report", None,
        "material_file", "measured", "match_picture", None, "export_measured", "export_scene", None,
        "save", "save_as", "save_scene", "save_environment", "recover", None,
        "picture", "contact_sheet", None, "quit",
    )),
    Menu("Edit", (
        "undo", "redo", "undo_view", "redo_view", None, "copy_material", "copy_curve", "copy_table", "paste",
        "paste_layers", None, "highlight_tool",
        Menu("Transfer the curve's edit", ("transfer_ratio", "transfer_relative", "transfer_absolute")), None,
        Menu("Select", ("select_all", "select_none", "select_others", None, "box_select")),
        Menu("Arrange", (
            "grab", "turn", "resize", None, "gizmo_move", "gizmo_rotate", "gizmo_scale", None, "aim",
            "gizmo_aim", None, "drop_selected",
            Menu("Snapping", ("snaps", None, "snap_increments", "snap_ground", "snap_surfaces", None, "aligns")),
            Menu("Pivot", ("pivot_middle", "pivot_own", "pivot_active")), None, "put_back", "keymap",
        )),
        "duplicate", "linked_duplicate", "make_single_user", "delete_object", "hide", "show_all",
        "group_selected", "ungroup_selected", None,
        "table", "mute", "delete", "reset_curve", "unlink",
    )),
    Menu("Add", (
        *map(adding, SHAPES), None, *map(adding, PROPS), None, *map(adding, LIGHTS), adding(SUN), None,
        *map(painting, PAINTED_KINDS), None, "add_file",
    )),
    # The picture's entries come first: in a small window the rest of the menu scrolls.
    Menu("View", (
        "alone", "whole", "pixels",
        Menu("Camera", (
            "camera_panel", "go_to_view", None, "frame", "frame_all", None, "view_front", "view_right", "view_top",
            "view_back", "view_left", "view_bottom", None, "level", "own_view", "conventions",
        )),
        Menu("Colours", ("view", None, "open_config", "reset_exposure")),
        Menu("Inspect", (
            "values", "average", "copy_values", "pin_probe", "clear_probes", None, "draw_crop", "clear_crop", None,
            *map(channel_operator, PICTURE_CHANNELS), None, "zebra", "stops",
            "scopes", "error", None, "zoom_in", "zoom_out",
        )),
        Menu("Stored pictures", (
            "store_picture", "compare_file", None, "compare_with", None, "difference", "remove_stored",
        )),
        "resolution", "compare", Menu("Side by side", ("looks_1", "looks_2", "looks_4", "looks_6")), "lighting", "log",
        None, "show", "reset_layout", None, "screenshot",
    )),
    Menu("Looks", (
        "new_look", "look", None, "previous_look", "next_look", None, "rename_look", "look_up", "look_down",
        "delete_look",
    )),
    Menu("Help", ("help",)),
)  # fmt: skip


def keys_of(name: str, keys: Keys = DEFAULT_KEYS) -> str:
    """The keys shown beside an operator's menu entry and in tooltips; "" where it has none. keys: the keymap."""
    return next(iter(in_keymap(OPERATORS[name], keys).keys), "")


def listed_lines(group: str, keys: Keys = DEFAULT_KEYS) -> list[tuple[str, str]]:
    """The lines of a group in the list of shortcuts: keys or gesture, and what it does. keys: the keymap."""
    lines: list[tuple[str, str]] = []
    for each in GROUPS[group]:
        if isinstance(each, Gesture):
            lines.append((each.listed_keys, each.help))
            continue
        operator = in_keymap(each, keys)
        if operator.keys and operator.help:
            lines.append((operator.listed_keys or operator.keys[0], operator.help))
    return lines


def run_operator(editor: Editor, name: str, value: Any = None) -> str | None:
    """Carry out an operator that needs no window, with a value of its type (None: its default).

    Returns None, or one line that says why it was refused; the editor shows that line where it is an error.
    """
    operator = OPERATORS[name]
    if operator.run is None:
        raise ValueError(f"{name} is carried out by the window")
    if reason := operator.why_not(editor):
        return reason
    try:
        return operator.run(editor, value)
    except InsituError as error:
        editor.notify(str(error), True)
        return str(error)
