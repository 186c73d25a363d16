"""Operators (`app.operators`) as the window carries them out: their keys, and the actions of those that need a window.

An operator that needs none is the action `RunOperator`, by its name.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import get_args

from imgui_bundle import imgui

from app.document.arranging import Pivot
from app.document.document import all_factors
from app.document.view_state import SetView, Tool
from app.files.materials import copy_curve, copy_material
from app.operators.edits import selected_curve
from app.operators.registry import OPERATORS
from engine.curve.operators import collapse
from engine.curve.table_text import MAX_ROWS, table_text
from engine.scene.builtin import EMPTY_SCENE
from ui.panels import box_select, gizmo, grab, highlight, paint, timeline
from ui.panels.actions import (
    Action,
    AskFile,
    Copy,
    CopyText,
    OpenFile,
    Paste,
    Quit,
    ResetLayout,
    RunOperator,
    SaveSession,
    Screenshot,
    SetPanel,
    ShowPanel,
    StorePicture,
)
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import operators_in_use, tool_of
from ui.panels.window_state import SCOPES, VALUE_SIDES, SnapTarget, StatusMessage

Key = imgui.Key
CTRL, SHIFT, ALT = (int(key) for key in (Key.mod_ctrl, Key.mod_shift, Key.mod_alt))
MODIFIERS = {"Ctrl": CTRL, "Shift": SHIFT, "Alt": ALT}
# Keys whose names imgui writes otherwise; "?" is what the key of the slash prints with Shift.
KEYS = {
    ",": int(Key.comma), ".": int(Key.period), "[": int(Key.left_bracket), "]": int(Key.right_bracket),
    "/": int(Key.slash), "\\": int(Key.backslash), "=": int(Key.equal), "-": int(Key.minus),
    "?": SHIFT | int(Key.slash),
    "Keypad .": int(Key.keypad_decimal), "Keypad +": int(Key.keypad_add), "Keypad -": int(Key.keypad_subtract),
}  # fmt: skip


# Operators that switch a field of the window's state of their name.
SWITCHES = ("snaps", "aligns")
PIVOTS: tuple[Pivot, ...] = get_args(Pivot)
SNAP_TARGETS: tuple[SnapTarget, ...] = get_args(SnapTarget)


def chord_of(keys: str) -> int:
    """The chord for imgui of keys such as "Ctrl Shift S" or "Keypad 1"."""
    chord, words = 0, keys.split()
    while words[0] in MODIFIERS:
        chord |= MODIFIERS[words.pop(0)]
    key = " ".join(words)
    if key in KEYS:
        return chord | KEYS[key]
    name = key.replace(" ", "").lower()
    return chord | int(getattr(Key, f"_{name}" if name.isdigit() else name))


# ------------------------------------------------------------------------------------------ what only a window can do


def perform(context: PanelContext, name: str) -> list[Action]:
    """The actions of an operator that a key or a menu invokes; where it cannot run now, a message that says why."""
    if reason := OPERATORS[name].why_not(context):
        return [SetPanel({"message": StatusMessage(reason, context.now)})]
    return WINDOW_OPERATORS[name](context) if name in WINDOW_OPERATORS else [RunOperator(name)]


def is_on(context: PanelContext, name: str) -> bool:
    """Whether a menu shows the operator's entry as checked."""
    if name == "alone":
        return context.state.single_panel
    if name == "camera_panel":
        return context.state.shows_camera
    if name.startswith("gizmo_"):
        return name == f"gizmo_{context.state.gizmo}"
    if name.startswith("pivot_"):
        return name == f"pivot_{context.state.pivot}"
    if name.startswith("snap_"):
        return name == f"snap_{context.state.snap_to}"
    if name in SWITCHES:
        return bool(getattr(context.state, name))
    if name == "values":
        return context.state.shows_values
    if name == "scopes":
        return bool(context.state.scope)
    if name == "average":
        return context.state.values_side > 1
    if name == "report":
        return context.state.shows_report
    is_on = OPERATORS[name].is_on
    return is_on is not None and is_on(context)


def _leave_alone(context: PanelContext) -> list[Action]:
    return [SetPanel({"single_panel": not context.state.single_panel})]


def play_or_leave_alone(context: PanelContext) -> list[Action]:
    """Play or stop, where there is a timeline below the picture; else show the picture alone, or all panels again."""
    return (timeline.toggle_playback(context) if context.mode.strip else []) or _leave_alone(context)


def _toggle_camera_panel(context: PanelContext) -> list[Action]:
    return [SetPanel({"shows_camera": not context.state.shows_camera, "renames": None})]


def _toggle_values(context: PanelContext) -> list[Action]:
    return [SetPanel({"shows_values": not context.state.shows_values})]


def _zoom(context: PanelContext, step: int) -> list[Action]:
    return [SetPanel({"zoom_steps": context.state.zoom_steps + step})]


def _toggle_scopes(context: PanelContext) -> list[Action]:
    return [SetPanel({"scope": "" if context.state.scope else SCOPES[0]})]


def _choose_average(context: PanelContext) -> list[Action]:
    """Values of one pixel, then the mean of 3 x 3, then of 5 x 5."""
    sides = VALUE_SIDES
    side = sides[(sides.index(context.state.values_side) + 1) % len(sides)]
    return [SetPanel({"values_side": side, "shows_values": True})]


def _grab_or_aim(kind: str, context: PanelContext) -> list[Action]:
    """Let the selected objects follow the mouse; a sun, which is nowhere, gets the handles that aim it."""
    return grab.begin(kind, context) if context.view.sun is None else _choose_gizmo(kind, context)


def _choose_gizmo(tool: str, context: PanelContext) -> list[Action]:
    """Show the handles of a tool of the gizmo, or none where they are there already."""
    return [SetPanel({"gizmo": "" if context.state.gizmo == tool else tool})]


def _toggle(name: str, context: PanelContext) -> list[Action]:
    """Switch a field of the window's state on or off."""
    return [SetPanel({name: not getattr(context.state, name)})]


def _toggle_highlight(context: PanelContext) -> list[Action]:
    """Begin or end painting the selected object's highlight; the brush of the weight map is put away."""
    return [SetPanel({"paints_highlight": not context.state.paints_highlight, "paints": False})]


def _toggle_report(context: PanelContext) -> list[Action]:
    return [SetPanel({"shows_report": not context.state.shows_report})]


def _expose(name: str, step: int, context: PanelContext) -> list[Action]:
    """Exposure, or while the brush is in use its size."""
    if highlight.is_on(context):
        return [highlight.resize(context.state.highlight, step)]
    if paint.painting_layer_key(context) is not None:
        return [paint.resize_brush(context.state.brush, step)]
    return [RunOperator(name)]


def _set_tool(context: PanelContext, kind: str = "", axes: str = "") -> list[Action]:
    """Choose the tool of the next edit: of another kind, or along other axes, than that of the operators in use."""
    curve = selected_curve(context)
    tool = tool_of(operators_in_use(() if curve is None else curve[2], context.view))
    now_kind, _, now_axes = tool.partition("_")
    if not now_axes:  # a tool that draws
        now_kind, now_axes = "translate", "y"
    chosen: Tool = f"{kind or now_kind}_{axes or now_axes}"  # type: ignore[assignment]
    return [SetView.of(active_tool=chosen, operator=None)]


def _copy_material(context: PanelContext) -> list[Action]:
    selected = context.selected_layer
    if selected is None:
        return []
    return [Copy(copy_material(context.document, selected.object), f"the material of {selected.object}")]


def _copy_curve(context: PanelContext) -> list[Action]:
    selected = context.selected_layer
    if selected is None or selected.factor is None:
        return []
    factors = all_factors(context.document.layer(selected.key).model)
    label = next(factor.word for factor in factors if factor.name == selected.factor)
    return [Copy(copy_curve(context.document, selected.key, selected.factor), f"the curve {label}")]


def _copy_table(context: PanelContext) -> list[Action]:
    """The selected curve as text: sampled where it bends, with a row of words above."""
    curve = selected_curve(context)
    if curve is None:
        return []
    key, factor, operators = curve
    table = collapse(operators, context.document.layer(key).generated_curve(factor), most=MAX_ROWS // 2)
    return [CopyText(table_text(table), f"{len(table.gammas)} rows of {key} {factor}")]


def _set_resolution(context: PanelContext) -> list[Action]:
    picture = context.picture
    return [] if picture is None else [SetPanel({"resolution": (picture.width, picture.height)})]


def _always(*actions: Action) -> Callable[[PanelContext], list[Action]]:
    return lambda context: list(actions)


WINDOW_OPERATORS: dict[str, Callable[[PanelContext], list[Action]]] = {
    "new": _always(OpenFile(EMPTY_SCENE)),
    "open": _always(AskFile("open_scene")),
    "add": _always(SetPanel({"opens_menu": "Add"})),
    "add_file": _always(AskFile("add_file")),
    "open_environment": _always(AskFile("open_environment")),
    "material_file": _always(AskFile("open_material")),
    "measured": _always(AskFile("open_measured")),
    "match_picture": _always(AskFile("open_photo")),
    "export_measured": _always(AskFile("save_measured")),
    "export_scene": _always(AskFile("save_scene")),
    "save_scene": _always(AskFile("save_package")),
    "save_environment": _always(AskFile("save_environment")),
    "paint_image": _always(AskFile("paint_image")),
    "save": _always(SaveSession()),
    "save_as": _always(AskFile("save_session")),
    "recover": _always(SetPanel({"shows_recoveries": True})),
    "picture": _always(AskFile("save_picture")),
    "contact_sheet": _always(AskFile("save_sheet")),
    "screenshot": _always(Screenshot()),
    "quit": _always(Quit()),
    "copy_material": _copy_material,
    "copy_curve": _copy_curve,
    "copy_table": _copy_table,
    "table": _always(AskFile("open_table")),
    "paste": _always(Paste()),
    "paste_layers": _always(Paste(as_layers=True)),
    **{f"gizmo_{tool}": partial(_choose_gizmo, tool) for tool in gizmo.TOOLS},
    "grab": partial(_grab_or_aim, "move"),
    "turn": partial(_grab_or_aim, "rotate"),
    "resize": partial(grab.begin, "scale"),
    "aim": partial(grab.begin, "aim"),
    "box_select": box_select.begin,
    **{name: partial(_toggle, name) for name in SWITCHES},
    **{f"pivot_{pivot}": _always(SetPanel({"pivot": pivot})) for pivot in PIVOTS},
    **{f"snap_{target}": _always(SetPanel({"snap_to": target, "snaps": True})) for target in SNAP_TARGETS},
    "brdf": _always(ShowPanel("brdf")),
    "reset_layout": _always(ResetLayout()),
    "resolution": _set_resolution,
    "rename_look": lambda context: [SetPanel({"look_name": context.document.look})],
    "alone": _leave_alone,
    "camera_panel": _toggle_camera_panel,
    "report": _toggle_report,
    "pin_probe": _always(SetPanel({"pins_probe": True})),
    "draw_crop": _always(SetPanel({"draws_crop": True})),
    "store_picture": _always(StorePicture()),
    "compare_file": _always(AskFile("open_compared")),
    "open_config": _always(AskFile("open_config")),
    "values": _toggle_values,
    "scopes": _toggle_scopes,
    "average": _choose_average,
    "copy_values": _always(SetPanel({"copies_values": True})),
    "zoom_in": partial(_zoom, step=1),
    "zoom_out": partial(_zoom, step=-1),
    "darker": partial(_expose, "darker", -1),
    "brighter": partial(_expose, "brighter", 1),
    "translate": partial(_set_tool, kind="translate"),
    "amplify": partial(_set_tool, kind="amplify"),
    "axis_x": partial(_set_tool, axes="x"),
    "axis_y": partial(_set_tool, axes="y"),
    "axis_xy": partial(_set_tool, axes="xy"),
    "highlight_tool": _toggle_highlight,
    "draw_tool": _always(SetView.of(active_tool="stroke", operator=None)),
    "points_tool": _always(SetView.of(active_tool="points", operator=None)),
}
