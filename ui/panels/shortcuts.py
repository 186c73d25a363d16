"""Shortcuts: one table that the keyboard, the menus and the overlay under `?` all read."""

from __future__ import annotations

from dataclasses import dataclass

from imgui_bundle import ImVec2, imgui

from app.document.commands.curves import MuteOperator, RemoveOperator
from app.document.document import Selection, all_factors
from app.document.solo import toggle_solo
from app.document.view_state import SetView, Tool
from app.files.pasting import copy_curve, copy_material
from engine.scene.builtin import DEFAULT_SCENE
from ui import theme as look
from ui.panels import camera_gestures, paint, timeline
from ui.panels.actions import (
    Action,
    AskFile,
    Copy,
    OpenFile,
    Paste,
    Quit,
    Redo,
    RedoCamera,
    SaveSession,
    Screenshot,
    SetPanel,
    ShowPanel,
    Undo,
    UndoCamera,
)
from ui.panels.context import PanelContext
from ui.panels.curve_gestures import OperatorGroup, operators_in_use, tool_of

TWO_COLUMNS, THREE_COLUMNS, KEYS_WIDTH = 840.0, 1200.0, 106.0
CTRL, SHIFT, ALT = (int(key) for key in (imgui.Key.mod_ctrl, imgui.Key.mod_shift, imgui.Key.mod_alt))
Key = imgui.Key


# The groups of which one is chosen in the menu View > Camera.
BLENDER, MAYA = "Camera: mouse as in Blender", "Camera: mouse as in Maya"
WHEEL, TRACKPAD = "Camera: wheel", "Camera: trackpad"
CHOICES = {BLENDER: ("mouse", "blender"), MAYA: ("mouse", "maya"), WHEEL: ("scroll", "dolly"),
           TRACKPAD: ("scroll", "orbit")}  # fmt: skip


@dataclass(frozen=True)
class Shortcut:
    """`chord` for imgui (None: a mouse gesture, listed only), its label, and the name of its action. `own` is the text
    in a menu, where the row has several keys or is not listed at all."""

    group: str
    keys: str
    text: str
    name: str = ""
    chord: int | None = None
    own: str = ""


SHORTCUTS = (
    Shortcut("File", "Ctrl O", "Open a scene or session", "open", CTRL | int(Key.o)),
    Shortcut("File", "Ctrl N", "New: the built-in scene", "new", CTRL | int(Key.n)),
    Shortcut("File", "Ctrl S", "Save the session", "save", CTRL | int(Key.s)),
    Shortcut("File", "Ctrl Shift S", "Save the session under a new name", "save_as", CTRL | SHIFT | int(Key.s)),
    Shortcut("File", "F12", "Save the picture: PNG of 8 or 16 bits, EXR", "picture", int(Key.f12)),
    Shortcut("File", "Shift F12", "Save a picture of the window", "screenshot", SHIFT | int(Key.f12)),
    Shortcut("File", "Ctrl Q", "Quit; asks where edits are not saved", "quit", CTRL | int(Key.q)),
    Shortcut("Edit", "Ctrl Z", "Undo; one drag is one step", "undo", CTRL | int(Key.z)),
    Shortcut("Edit", "Ctrl Y", "Redo (also Ctrl Shift Z)", "redo", CTRL | int(Key.y)),
    Shortcut("", "", "", "redo", CTRL | SHIFT | int(Key.z)),
    Shortcut("Edit", "Alt Z", "Undo the view: where the camera was", "undo_look", ALT | int(Key.z)),
    Shortcut("Edit", "Shift Alt Z", "Redo the view", "redo_look", SHIFT | ALT | int(Key.z)),
    Shortcut("Edit", "Esc", "Leave, cancel the drag, deselect: one per press"),
    Shortcut("Edit", "Ctrl C", "Copy the object's material", "copy_material", CTRL | int(Key.c)),
    Shortcut("Edit", "Ctrl Shift C", "Copy the curve", "copy_curve", CTRL | SHIFT | int(Key.c)),
    Shortcut("Edit", "Ctrl V", "Paste: material, layer or curve", "paste", CTRL | int(Key.v)),
    Shortcut("Edit", "Ctrl Shift V", "Paste the material's layers on top", "paste_layers", CTRL | SHIFT | int(Key.v)),
    Shortcut("Picture", "Click", "Select the object"),
    Shortcut("Picture", "Drop", "A material of the library onto an object"),
    Shortcut("Picture", "Alt click", "Show the lobe there; Shift Alt drag moves it"),
    Shortcut("Picture", "Shift drag", "Turn the light (also the wheel over its dial)"),
    Shortcut("Picture", "O", "Placement, or Orbit, where the camera moves freely", "orbit", int(Key.o)),
    Shortcut("Picture", "G", "Placement, or Deform, where objects bend", "deform", int(Key.g)),
    Shortcut("Picture", "C", "Compare: remember this picture as A, show A | B", "compare", int(Key.c)),
    Shortcut("Picture", "E", "Show the error, in false colours", "error", int(Key.e)),
    Shortcut("Picture", "Space", "The picture alone; where it is animated, in Deform: play", "alone", int(Key.space)),
    Shortcut("Picture", "Ctrl Alt wheel", "Magnify the picture about the mouse"),
    Shortcut("Picture", "Ctrl Alt drag", "Move the magnified picture"),
    Shortcut("Picture", "0   1", "Fit the picture, show it pixel for pixel", "whole", int(Key._0), "0"),
    Shortcut("", "", "", "pixels", int(Key._1), "1"),
    Shortcut("Picture", "[  ]", "Exposure down, up; the brush smaller, larger", "darker", int(Key.left_bracket)),
    Shortcut("", "", "", "brighter", int(Key.right_bracket)),
    Shortcut("Picture", "S", "See the selected layer alone, or all again", "solo", int(Key.s)),
    Shortcut("Material", "Right click", "Put a parameter back to the scene's value"),
    Shortcut("Material", "Double click", "Type a number; a drag with Shift is fine"),
    Shortcut("Curve", "Drag a b c d", "Where the edit begins, holds and ends"),
    Shortcut("Curve", "Drag the ring", "How strong the edit is"),
    Shortcut("Curve", "Drag the curve", "Pull it there: a new operator"),
    Shortcut("Curve", "Tab", "Next handle for the keys; with Shift the one before"),
    Shortcut("Curve", "Arrow keys", "Move that handle; with Shift by tenths"),
    Shortcut("Curve", "T   A", "Translate, amplify", "translate", int(Key.t)),
    Shortcut("", "", "", "amplify", int(Key.a)),
    Shortcut("Curve", "X   Y   D", "Along the angle, in height, diagonal", "axis_x", int(Key.x)),
    Shortcut("", "", "", "axis_y", int(Key.y)),
    Shortcut("", "", "", "axis_xy", int(Key.d)),
    Shortcut("Curve", "L", "Logarithmic height", "log", int(Key.l)),
    Shortcut("Curve", "M", "Mute the operator", "mute", int(Key.m)),
    Shortcut("Curve", "Delete", "Delete the operator", "delete", int(Key.delete)),
    Shortcut("Curve", "Wheel", "Zoom the angle; with Shift the height"),
    Shortcut("Curve", "Middle drag", "Pan; double click shows all"),
    Shortcut("Material", "B", "Show the BRDF: sphere, lobe, slice, albedo", "brdf", int(Key.b)),
    Shortcut(BLENDER, "Middle drag", "Orbit about the point of interest"),
    Shortcut(BLENDER, "Shift middle", "Pan"),
    Shortcut(BLENDER, "Ctrl middle", "Nearer, farther"),
    Shortcut(MAYA, "Alt drag", "Orbit about the point of interest"),
    Shortcut(MAYA, "Alt middle", "Pan"),
    Shortcut(MAYA, "Alt right", "Nearer, farther"),
    Shortcut(WHEEL, "Wheel", "Nearer to what is under the mouse"),
    Shortcut(TRACKPAD, "Two fingers", "Orbit; Shift pans, Ctrl goes nearer"),
    Shortcut("Camera", "F   Home", "Frame the selection, frame all", "frame", int(Key.f), "F"),
    Shortcut("", "", "", "frame_all", int(Key.home), "Home"),
    Shortcut("", "", "", "frame", int(Key.keypad_decimal)),
    Shortcut("Camera", "N", "Lens, horizon, size, saved views", "camera", int(Key.n)),
    Shortcut(
        "Camera", "Keypad 1 3 7", "From the front, the right, the top", "view_front", int(Key.keypad1), "Keypad 1"
    ),
    Shortcut("", "", "", "view_right", int(Key.keypad3), "Keypad 3"),
    Shortcut("", "", "", "view_top", int(Key.keypad7), "Keypad 7"),
    Shortcut(
        "Camera",
        "with Ctrl",
        "From the back, the left, the bottom",
        "view_back",
        CTRL | int(Key.keypad1),
        "Ctrl Keypad 1",
    ),
    Shortcut("", "", "", "view_left", CTRL | int(Key.keypad3), "Ctrl Keypad 3"),
    Shortcut("", "", "", "view_bottom", CTRL | int(Key.keypad7), "Ctrl Keypad 7"),
    Shortcut("Camera", "Keypad 4 6 8 2", "Orbit by 15°", "turn_left", int(Key.keypad4)),
    Shortcut("", "", "", "turn_right", int(Key.keypad6)),
    Shortcut("", "", "", "turn_up", int(Key.keypad8)),
    Shortcut("", "", "", "turn_down", int(Key.keypad2)),
    Shortcut("Camera", "Keypad + -", "Nearer, farther", "nearer", int(Key.keypad_add)),
    Shortcut("", "", "", "farther", int(Key.keypad_subtract)),
    Shortcut("Camera", "Keypad 0", "The scene's own camera", "own_view", int(Key.keypad0)),
    Shortcut("Help", "Alt", "The menus; Alt F, E, V, H: one of them"),
    Shortcut("Help", "?", "This list", "help", SHIFT | int(Key.slash)),
    Shortcut("", "", "", "help", int(Key.f1)),
)
# Actions that a held key repeats.
REPEATED = frozenset(
    {"undo", "redo", "undo_look", "redo_look", "darker", "brighter", "nearer", "farther", *camera_gestures.TURNS}
)
CAMERA_MOVES = frozenset(
    {"frame", "frame_all", "nearer", "farther", "own_view", "level", *camera_gestures.SIDES, *camera_gestures.TURNS}
)
# Actions that would change document or view during a gesture.
EDITING = CAMERA_MOVES | {"undo", "redo", "undo_look", "redo_look", "mute", "delete", "paste", "paste_layers"}


def keyboard(context: PanelContext) -> list[Action]:
    """The actions of the key pressed in this pass; none while the user types, or chooses from a list or a file."""
    if context.keys_taken or context.state.question is not None:
        return []
    actions: list[Action] = []
    for shortcut in SHORTCUTS:
        if context.state.grip is not None and shortcut.name in EDITING:
            continue
        if shortcut.name == "alone" and imgui.get_io().nav_visible:  # the key presses the control that has the frame
            continue
        if shortcut.chord is not None and (imgui.is_key_chord_pressed(shortcut.chord) or _repeats(context, shortcut)):
            actions += (_play(context) if shortcut.name == "alone" else []) or perform(context, shortcut.name)
    return actions


def _repeats(context: PanelContext, shortcut: Shortcut) -> bool:
    """Whether the system repeats the shortcut while its keys are held, and its action goes step by step."""
    if context.repeated is None or shortcut.name not in REPEATED:
        return False
    return shortcut.chord == imgui.get_io().key_mods | int(context.repeated)


def keys_of(name: str) -> str:
    """The keys shown beside a menu entry."""
    return next((keys for s in SHORTCUTS if s.name == name and (keys := s.own or s.keys)), "")


def perform(context: PanelContext, name: str) -> list[Action]:
    """The actions of a named shortcut in the present state."""
    view = context.view
    simple: dict[str, list[Action]] = {
        "new": [OpenFile(DEFAULT_SCENE)],
        "open": [AskFile("open_scene")],
        "save": [SaveSession()],
        "save_as": [AskFile("save_session")],
        "picture": [AskFile("save_picture")],
        "screenshot": [Screenshot()],
        "quit": [Quit()],
        "undo": [Undo()],
        "redo": [Redo()],
        "undo_look": [UndoCamera()],
        "redo_look": [RedoCamera()],
        "camera": [SetPanel({"shows_camera": not context.state.shows_camera, "renames": None})],
        "compare": [SetView.of(compare=None if view.compare is not None else context.document)],
        "error": [SetView.of(shows_error=not view.shows_error)],
        "orbit": [SetView.of(mode=_other_mode(context, "orbit"))],
        "deform": [SetView.of(mode=_other_mode(context, "deform"))],
        "alone": [SetPanel({"single_panel": not context.state.single_panel})],
        "whole": [SetView.of(fit=True)],
        "pixels": [SetView.of(fit=False, zoom=1.0, centre=(0.5, 0.5))],
        "darker": [SetView.of(exposure=view.exposure - 1.0 / 3.0)],
        "brighter": [SetView.of(exposure=view.exposure + 1.0 / 3.0)],
        "log": [SetView.of(log_y=not view.log_y, curve_zoom=None)],
        "brdf": [ShowPanel("brdf")],
        "solo": [toggle_solo(view, layer.key)] if (layer := context.selected_layer) else [],
        "help": [SetView.of(show_shortcuts=not view.show_shortcuts)],
        "paste": [Paste()],
        "paste_layers": [Paste(as_layers=True)],
    }
    if name in ("darker", "brighter") and paint.painting_layer_key(context) is not None:
        return [paint.resize_brush(context.state.brush, -1 if name == "darker" else 1)]
    if name in simple:
        return simple[name]
    if name in CAMERA_MOVES:
        return camera_gestures.command(context, name)
    if name in ("translate", "amplify") or name.startswith("axis_"):
        return [SetView.of(active_tool=_tool(tool_of(_operators_in_use(context)), name), operator=None)]
    if name in ("copy_material", "copy_curve"):
        return _copy(context, name)
    return _on_operator(context, name)


def _play(context: PanelContext) -> list[Action]:
    """Play or stop, where there is a timeline below the picture."""
    return timeline.toggle_playback(context) if context.mode.strip else []


def _other_mode(context: PanelContext, name: str) -> str:
    """The mode of this name where there is one, or the first one where it is the present mode already."""
    names = [mode.name for mode in context.modes]
    return name if name in names and context.mode.name != name else names[0]


def _copy(context: PanelContext, name: str) -> list[Action]:
    """The selected object's material, or the selected curve."""
    selected, document = context.selected_layer, context.document
    if selected is None:
        return []
    if name == "copy_material":
        return [Copy(copy_material(document, selected.object), f"the material of {selected.object}")]
    if selected.factor is None:
        return []
    return [Copy(copy_curve(document, selected.key, selected.factor), f"the curve {_curve_label(context, selected)}")]


def _curve_label(context: PanelContext, selected: Selection) -> str:
    factors = all_factors(context.document.layer(selected.key).model)
    return next(factor.word for factor in factors if factor.name == selected.factor)


def _tool(tool: Tool, change: str) -> str:
    kind, _, axes = tool.partition("_")
    return f"{kind}_{change[5:]}" if change.startswith("axis_") else f"{change}_{axes}"


def _operators_in_use(context: PanelContext) -> OperatorGroup:
    """The operators in use on the selected curve."""
    selected = context.selected_layer
    if selected is None or selected.factor is None:
        return operators_in_use((), context.view)
    return operators_in_use(context.document.layer(selected.key).operators(selected.factor), context.view)


def _on_operator(context: PanelContext, name: str) -> list[Action]:
    """Mute or delete the selected operator."""
    selected, index = context.selected_layer, context.view.operator
    if not isinstance(selected, Selection) or selected.factor is None or index is None:
        return []
    operators = context.document.layer(selected.key).operators(selected.factor)
    if index >= len(operators):
        return []
    if name == "delete":
        return [RemoveOperator(selected.key, selected.factor, index)]
    return [MuteOperator(selected.key, selected.factor, index, not operators[index].muted)]


def draw(context: PanelContext) -> list[Action]:
    """The overlay that lists all shortcuts; closes at the next click or key."""
    if not context.view.show_shortcuts:
        return []
    viewport = imgui.get_main_viewport()
    imgui.set_next_window_pos(viewport.get_work_center(), imgui.Cond_.always, ImVec2(0.5, 0.5))
    imgui.set_next_window_size_constraints(ImVec2(0, 0), viewport.work_size)
    flags = (
        imgui.WindowFlags_.no_title_bar | imgui.WindowFlags_.no_collapse | imgui.WindowFlags_.no_docking
        | imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_saved_settings | imgui.WindowFlags_.no_move
    )  # fmt: skip
    imgui.push_style_color(imgui.Col_.window_bg, look.pack(look.grey(40, 0.985)))
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(context.px(28), context.px(22)))
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
    imgui.begin("Shortcuts###shortcuts", None, flags)
    context.theme.push_bold()
    imgui.text_unformatted("Shortcuts")
    imgui.pop_font()
    imgui.dummy(ImVec2(1, context.px(4)))
    _columns(context)
    focused = imgui.is_window_hovered(imgui.HoveredFlags_.allow_when_blocked_by_popup)
    imgui.end()
    imgui.pop_style_var(2)
    imgui.pop_style_color()
    if imgui.is_mouse_clicked(0) and not focused:
        return [SetView.of(show_shortcuts=False)]
    return []


def _columns(context: PanelContext) -> None:
    imgui.begin_group()
    for group in ("File", "Edit", "Material", "Help"):
        _group(context, group)
    imgui.end_group()
    for least, groups in ((TWO_COLUMNS, ("Picture", "Curve")), (THREE_COLUMNS, (*CHOICES, "Camera"))):
        if imgui.get_main_viewport().work_size.x >= context.px(least):
            imgui.same_line(0.0, context.px(32))
        imgui.begin_group()
        for group in groups:
            _group(context, group)
        imgui.end_group()


def _group(context: PanelContext, group: str) -> None:
    name, value = CHOICES.get(group, ("", ""))
    is_chosen = not name or getattr(context.preferences, name) == value
    imgui.push_style_color(imgui.Col_.text, look.pack(look.ACCENT if is_chosen else look.TEXT_FAINT))
    imgui.text_unformatted(group if is_chosen else f"{group} (View > Camera)")
    imgui.pop_style_color()
    for shortcut in (s for s in SHORTCUTS if s.group == group):
        imgui.text_unformatted(shortcut.keys)
        imgui.same_line(context.px(KEYS_WIDTH))
        imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_SOFT))
        imgui.text_unformatted(shortcut.text)
        imgui.pop_style_color()
    imgui.dummy(ImVec2(1, context.px(6)))
