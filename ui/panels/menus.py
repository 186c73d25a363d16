"""The menu bar at the top: menus left, which Alt opens; exposure, tone mapping, compare, fit, undo, mode and help
right.

The controls at the right are always visible.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from imgui_bundle import ImVec2, imgui

from app.document.commands.curves import ResetCurve
from app.document.document import Selection
from app.document.view_state import OpenPanel, SetView
from engine.core.colour import VIEWS
from ui.layout import PANELS, is_behind
from ui.panels import number_fields, widgets
from ui.panels.actions import (
    Action,
    AskFile,
    MoveCameraTo,
    OpenFile,
    Redo,
    ResetLayout,
    SetPanel,
    SetPreference,
    ShowPanel,
    Undo,
)
from ui.panels.context import PanelContext
from ui.panels.shortcuts import ALT, keys_of, perform
from ui.theme import Icon

EXPOSURE_WIDTH, LEAST_EXPOSURE_WIDTH, TONE_WIDTH, FIT_WIDTH, GAP = 118.0, 64.0, 108.0, 42.0, 12.0
MODE_WIDTH = 84.0
RECENT_WIDTH = 320.0
NOT_SAVED = ": there are edits that no session has yet"
LEAST_EXPOSURE, LARGEST_EXPOSURE = -8.0, 8.0
# Pixels of a drag per stop: along the short track, a few pixels would be several stops.
PIXELS_A_STOP = 50.0


def draw(context: PanelContext) -> list[Action]:
    """The whole bar."""
    actions: list[Action] = []
    padding = ImVec2(imgui.get_style().frame_padding.x, imgui.get_style().frame_padding.y)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(padding.x, context.px(9)))
    if imgui.begin_main_menu_bar():
        imgui.push_style_var(imgui.StyleVar_.frame_padding, padding)
        requested = _menu_opened_by_alt(context)
        for title, entries in MENUS:
            if title == requested:
                imgui.open_popup(title)
            if _begin(context, title):
                actions += entries(context)
                imgui.end_menu()
        actions += _controls(context)
        imgui.pop_style_var()
        imgui.end_main_menu_bar()
    imgui.pop_style_var()
    return actions


def _begin(context: PanelContext, title: str) -> bool:
    """Whether a menu, or a submenu, is open: to be ended then."""
    corner, extent = imgui.get_cursor_screen_pos(), imgui.calc_text_size(title)
    context.handles.note(f"menu.{title}", corner.x + 0.5 * extent.x, corner.y + 0.5 * extent.y)
    return imgui.begin_menu(title)


def _entry(context: PanelContext, text: str, name: str, enabled: bool = True, on: bool = False) -> list[Action]:
    """A menu entry for a named shortcut."""
    pressed = imgui.menu_item_simple(text, keys_of(name), on, enabled)
    context.handles.note_item(f"menu.{name}")
    return perform(context, name) if pressed else []


def _file(context: PanelContext) -> list[Action]:
    actions = _entry(context, "New", "new") + _entry(context, "Open…", "open") + _recent(context)
    if context.scenes and _begin(context, "Built-in scenes"):
        for name in context.scenes:
            if imgui.menu_item_simple(name.capitalize(), None, name == context.document.source):
                actions.append(OpenFile(name))
        imgui.end_menu()
    if imgui.menu_item_simple("Open environment…"):
        actions.append(AskFile("open_environment"))
    selected = context.selected_layer is not None
    if imgui.menu_item_simple("Import measured BRDF…", None, False, selected):
        actions.append(AskFile("open_measured"))
    widgets.tooltip("Make the selected object of a measured material, MERL .binary or Cornell .brdf: nothing is lost.")
    if imgui.menu_item_simple("Export as measured BRDF…", None, False, selected):
        actions.append(AskFile("save_measured"))
    widgets.tooltip("Write the selected object's material, edits and all, as a table of angles (MERL .binary).")
    if imgui.menu_item_simple("Export for Mitsuba 3…", None, False, bool(context.document.objects)):
        actions.append(AskFile("save_scene"))
    widgets.tooltip("Write the scene as it is now into a folder, with a program that renders the final frame from it.")
    imgui.separator()
    actions += _entry(context, "Save session", "save")
    actions += _entry(context, "Save session as…", "save_as")
    if context.recoveries:
        imgui.separator()
        if imgui.menu_item_simple(f"Recover edits… ({len(context.recoveries)})"):
            actions.append(SetPanel({"shows_recoveries": True}))
    imgui.separator()
    actions += _entry(context, "Save the picture…", "picture", context.picture is not None)
    imgui.separator()
    return actions + _entry(context, "Quit", "quit")


def _recent(context: PanelContext) -> list[Action]:
    """The files opened last; missing ones are grey."""
    if not _begin(context, "Open recent"):
        return []
    actions: list[Action] = []
    entries = context.recent()
    for index, entry in enumerate(entries):
        name, folder = entry.path.name, widgets.fitting(str(entry.path.parent), context.px(RECENT_WIDTH))
        if imgui.menu_item_simple(f"{name}###{entry.path}", folder, False, entry.exists):
            actions.append(OpenFile(str(entry.path)))
        context.handles.note_item(f"menu.recent.{index}")
    if not entries:
        imgui.text_disabled("Nothing yet")
    imgui.end_menu()
    return actions


def _edit(context: PanelContext) -> list[Action]:
    undo = f"Undo {context.undo_label}" if context.undo_label else "Undo"
    redo = f"Redo {context.redo_label}" if context.redo_label else "Redo"
    actions = _entry(context, undo, "undo", context.undo_label is not None)
    actions += _entry(context, redo, "redo", context.redo_label is not None)
    undo, redo = (f": {label}" if label else "" for label in (context.camera_undo_label, context.camera_redo_label))
    actions += _entry(context, f"Undo the view{undo}", "undo_look", context.camera_undo_label is not None)
    actions += _entry(context, f"Redo the view{redo}", "redo_look", context.camera_redo_label is not None)
    imgui.separator()
    selected = context.selected_layer
    curve = selected is not None and selected.factor is not None
    actions += _entry(context, "Copy the material", "copy_material", selected is not None)
    actions += _entry(context, "Copy the curve", "copy_curve", curve)
    actions += _entry(context, "Paste", "paste", selected is not None)
    actions += _entry(context, "Paste as further layers", "paste_layers", selected is not None)
    imgui.separator()
    operator = context.view.operator is not None
    actions += _entry(context, "Mute the operator", "mute", operator)
    actions += _entry(context, "Delete the operator", "delete", operator)
    if imgui.menu_item_simple("Reset the curve", None, False, _can_reset(context, selected)):
        assert selected is not None and selected.factor is not None
        actions += [ResetCurve(selected.key, selected.factor), SetView.of(operator=None)]
    context.handles.note_item("menu.reset_curve")
    return actions


def _can_reset(context: PanelContext, selected: Selection | None) -> bool:
    """Whether the selected curve has operators that may be removed."""
    if selected is None or selected.factor is None or context.document.is_frozen(selected.key):
        return False
    is_editable = context.document.object(selected.object).editable
    return is_editable and bool(context.document.layer(selected.key).operators(selected.factor))


def _view(context: PanelContext) -> list[Action]:
    """The picture's entries come first: in a small window the rest of the menu scrolls."""
    actions = _entry(context, "The picture alone", "alone", on=context.state.single_panel)
    actions += _entry(context, "Fit the picture", "whole", on=context.view.fit)
    actions += _entry(context, "Pixel for pixel", "pixels", on=_is_pixel_for_pixel(context))
    if _begin(context, "Camera"):
        actions += _camera(context)
        imgui.end_menu()
    if _begin(context, "Colours"):
        actions += _views(context, "menu.colours")
        imgui.end_menu()
    actions += _resolution(context)
    actions += _entry(context, "Compare with now", "compare", on=context.view.compare is not None)
    actions += _entry(context, "Show the error", "error", on=context.view.shows_error)
    actions += _entry(context, "Logarithmic curve", "log", on=context.view.log_y)
    imgui.separator()
    for panel in PANELS:
        is_open = context.view.panel_open(panel.key)
        if imgui.menu_item_simple(panel.title, None, is_open):
            in_sight = is_open and not is_behind(panel)
            actions.append(OpenPanel(panel.key, False) if in_sight else ShowPanel(panel.key))
    if imgui.menu_item_simple("Reset the layout"):
        actions.append(ResetLayout())
    imgui.separator()
    return actions + _entry(context, "Save a picture of the window", "screenshot")


CAMERA_ENTRIES = (
    ("Frame the selection", "frame"), ("Frame all", "frame_all"), ("", ""), ("Front", "view_front"),
    ("Right", "view_right"), ("Top", "view_top"), ("Back", "view_back"), ("Left", "view_left"),
    ("Bottom", "view_bottom"), ("", ""), ("Level horizon", "level"), ("The scene's own camera", "own_view"),
)  # fmt: skip
MOUSE = (("mouse", "blender", "Mouse as in Blender"), ("mouse", "maya", "Mouse as in Maya"))
SCROLL = (("scroll", "dolly", "Wheel: nearer, farther"), ("scroll", "orbit", "Trackpad: two fingers orbit"))


def _camera(context: PanelContext) -> list[Action]:
    """Views of the camera, and the mouse and trackpad conventions."""
    actions = _entry(context, "Lens, size, saved views…", "camera", on=context.state.shows_camera)
    for bookmark in context.view.bookmarks:
        if imgui.menu_item_simple(f"{bookmark.name}###saved.{bookmark.name}"):
            actions.append(MoveCameraTo(bookmark.viewpoint, bookmark.name))
    imgui.separator()
    is_open = bool(context.document.objects)
    for text, name in CAMERA_ENTRIES:
        if name:
            enabled = is_open and (name != "frame" or context.view.selected is not None)
            actions += _entry(context, text, name, enabled)
        else:
            imgui.separator()
    for group in (MOUSE, SCROLL):
        imgui.separator()
        for name, value, text in group:
            if imgui.menu_item_simple(text, None, getattr(context.preferences, name) == value):
                actions.append(SetPreference({name: value}))
            context.handles.note_item(f"menu.{name}.{value}")
    return actions


def _resolution(context: PanelContext) -> list[Action]:
    picture = context.picture
    text = "Resolution…" if picture is None else f"Resolution… ({picture.width} x {picture.height})"
    if not imgui.menu_item_simple(text, None, False, picture is not None) or picture is None:
        return []
    return [SetPanel({"resolution": (picture.width, picture.height)})]


def _help(context: PanelContext) -> list[Action]:
    return _entry(context, "Shortcuts", "help", on=context.view.show_shortcuts)


MENUS = (("File", _file), ("Edit", _edit), ("View", _view), ("Help", _help))


def _menu_opened_by_alt(context: PanelContext) -> str | None:
    """The menu that Alt opens: by itself the first, with a menu's first letter that one."""
    if context.alt_tapped:
        return MENUS[0][0]
    letters = {title: getattr(imgui.Key, title[0].lower()) for title, _ in MENUS}
    return next((title for title, key in letters.items() if imgui.is_key_chord_pressed(ALT | int(key))), None)


def _controls(context: PanelContext) -> list[Action]:
    """The controls at the right; in a narrow window those that there is room for."""
    gap = imgui.get_style().item_spacing.x
    buttons = 5 * imgui.get_frame_height() + 2 * context.px(GAP) + context.px(10)
    room = imgui.get_window_width() - imgui.get_cursor_pos_x() - buttons - gap
    exposure = max(min(context.px(EXPOSURE_WIDTH), room - gap), context.px(LEAST_EXPOSURE_WIDTH))
    several = len(context.modes) > 1
    fields: tuple[tuple[float, Callable[[PanelContext], list[Action]]], ...] = (
        *([(len(context.modes) * context.px(MODE_WIDTH), _modes)] if several else []),
        (exposure, partial(_exposure, width=exposure)),
        (context.px(TONE_WIDTH), _tone_mapping),
        (2 * context.px(FIT_WIDTH) + 1, _fit),
    )
    width, shown = 0.0, []
    for wide, draw_field in fields:
        if width + wide + gap <= room:
            width += wide + gap
            shown.append(draw_field)
    _title(context, width + buttons)
    imgui.set_cursor_pos_x(imgui.get_window_width() - width - buttons)
    _centre()
    actions: list[Action] = []
    for draw_field in shown:
        actions += draw_field(context)
        _next(gap)
    return actions + _buttons(context)


def _modes(context: PanelContext) -> list[Action]:
    """The choice of the mode, where there are several."""
    choices = [(mode.title, mode.tooltip or mode.title) for mode in context.modes]
    pressed = widgets.segments(context, "mode", choices, context.modes.index(context.mode), least=MODE_WIDTH)
    return [] if pressed is None else [SetView.of(mode=context.modes[pressed].name)]


def _buttons(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    comparing = context.view.compare is not None
    hint = "End the comparison." if comparing else "Remember this picture as A and compare: a divider shows A | B."
    if widgets.icon_button(context, "compare", Icon.COMPARE, f"{hint} (C)", lit=comparing):
        actions += perform(context, "compare")
    _gap(context)
    if widgets.icon_button(context, "undo", Icon.UNDO, _hint("Undo", context.undo_label, "Ctrl Z"),
                           enabled=context.undo_label is not None):  # fmt: skip
        actions.append(Undo())
    _next(0.0)
    if widgets.icon_button(context, "redo", Icon.REDO, _hint("Redo", context.redo_label, "Ctrl Y"),
                           enabled=context.redo_label is not None):  # fmt: skip
        actions.append(Redo())
    _gap(context)
    if widgets.icon_button(context, "picture", Icon.CAMERA, "Save the picture. (F12)", context.picture is not None):
        actions += perform(context, "picture")
    _next(0.0)
    if widgets.icon_button(context, "help", Icon.HELP, "All shortcuts. (?)", lit=context.view.show_shortcuts):
        actions += perform(context, "help")
    return actions


def _gap(context: PanelContext) -> None:
    _next(context.px(GAP))


def _next(gap: float) -> None:
    """Continue in the middle of the bar's height, `gap` pixels further."""
    imgui.same_line(0.0, gap)
    _centre()


def _centre() -> None:
    imgui.set_cursor_pos_y(round(0.5 * (imgui.get_window_height() - imgui.get_frame_height())))


def _hint(verb: str, label: str | None, keys: str) -> str:
    return f"{verb}: {label}. ({keys})" if label else f"Nothing to {verb.lower()}. ({keys})"


def _title(context: PanelContext, controls: float) -> None:
    """The name of what is open, between menus and controls."""
    name = f"{context.name}*" if context.unsaved else context.name
    imgui.same_line(0.0, context.px(18))
    room = imgui.get_window_width() - controls - imgui.get_cursor_pos_x() - context.px(16)
    if name and imgui.calc_text_size(name).x < room:
        imgui.align_text_to_frame_padding()
        imgui.text_disabled(name)
        widgets.tooltip(f"{context.document.source}{NOT_SAVED if context.unsaved else ''}")


def _exposure(context: PanelContext, width: float) -> list[Action]:
    imgui.set_next_item_width(width)
    hand, moved = number_fields.slider(
        context,
        "exposure",
        context.view.exposure,
        LEAST_EXPOSURE,
        LARGEST_EXPOSURE,
        "%+.2f EV",
        handle="view.exposure",
        origin=0.0,
        pixels_a_unit=PIXELS_A_STOP,
    )
    widgets.tooltip("Exposure of the display in stops; the scene's light is unchanged. Right click for 0. ([ and ])")
    if imgui.is_item_clicked(1):
        return [SetView.of(exposure=0.0)]
    return [SetView.of(exposure=moved)] if hand.changed else []


def _tone_mapping(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    imgui.set_next_item_width(context.px(TONE_WIDTH))
    if widgets.begin_combo("##tone", VIEWS[context.view.tone_mapping].label):
        actions += _views(context, "colours")
        imgui.end_combo()
    context.handles.note_item("view.tone_mapping")
    widgets.tooltip("The view: how light becomes colour on the screen and in PNG files.")
    return actions


def _views(context: PanelContext, handle: str) -> list[Action]:
    """The choice of the view transform, in a list or a menu."""
    actions: list[Action] = []
    for name, known in VIEWS.items():
        if imgui.menu_item_simple(known.label, None, name == context.view.tone_mapping):
            actions.append(SetView.of(tone_mapping=name))
        context.handles.note_item(f"{handle}.{name}")
        widgets.tooltip(known.tooltip)
    return actions


def _fit(context: PanelContext) -> list[Action]:
    choices = (
        ("Fit", "Fit the picture to the panel. (0)"),
        ("1:1", "One pixel of the picture is one pixel of the screen. (1)"),
    )
    chosen = 0 if context.view.fit else 1 if _is_pixel_for_pixel(context) else -1
    pressed = widgets.segments(context, "view.fit", choices, chosen, least=FIT_WIDTH)
    return [] if pressed is None else perform(context, ("whole", "pixels")[pressed])


def _is_pixel_for_pixel(context: PanelContext) -> bool:
    return not context.view.fit and context.view.zoom == 1.0
