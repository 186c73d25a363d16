"""The bar at the top: menus left; exposure, tone mapping, compare, fit, undo, picture and help always at hand right."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.commands import ResetCurve
from app.view_state import TONE_MAPPINGS, OpenPanel, SetView
from ui.layout import PANELS, is_behind
from ui.panels import widgets
from ui.panels.actions import Action, AskFile, OpenFile, Redo, ResetLayout, Screenshot, ShowPanel, Undo
from ui.panels.context import PanelContext
from ui.panels.help import keys_of, perform
from ui.theme import Icon

TONE_LABELS = {"filmic": "Filmic", "linear": "Linear", "false_colour": "False colour"}
TONE_HINTS = {
    "filmic": "Bright light rolls off gently, as on film.",
    "linear": "Straight to the screen; bright light clips.",
    "false_colour": "Colours stand for brightness: for measuring by eye.",
}
EXPOSURE_WIDTH, TONE_WIDTH, FIT_WIDTH, GAP = 118.0, 108.0, 42.0, 12.0
LEAST_EXPOSURE, LARGEST_EXPOSURE = -8.0, 8.0


def draw(context: PanelContext) -> list[Action]:
    """The whole bar."""
    actions: list[Action] = []
    padding = ImVec2(imgui.get_style().frame_padding.x, imgui.get_style().frame_padding.y)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(padding.x, context.px(9)))
    if imgui.begin_main_menu_bar():
        imgui.push_style_var(imgui.StyleVar_.frame_padding, padding)
        for title, entries in (("File", _file), ("Edit", _edit), ("View", _view), ("Help", _help)):
            if imgui.begin_menu(title):
                actions += entries(context)
                imgui.end_menu()
        actions += _controls(context)
        imgui.pop_style_var()
        imgui.end_main_menu_bar()
    imgui.pop_style_var()
    return actions


def _entry(context: PanelContext, text: str, name: str, enabled: bool = True, on: bool = False) -> list[Action]:
    """A menu entry for a named shortcut."""
    pressed = imgui.menu_item_simple(text, keys_of(name), on, enabled)
    return perform(context, name) if pressed else []


def _file(context: PanelContext) -> list[Action]:
    actions = _entry(context, "Open…", "open")
    if context.scenes and imgui.begin_menu("Built-in scenes"):
        for name in context.scenes:
            if imgui.menu_item_simple(name.capitalize(), None, name == context.document.source):
                actions.append(OpenFile(name))
        imgui.end_menu()
    if imgui.menu_item_simple("Open environment…"):
        actions.append(AskFile("open_environment"))
    selected = context.view.selected is not None
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
    imgui.separator()
    actions += _entry(context, "Save a picture of the window", "screenshot")
    imgui.separator()
    return actions + _entry(context, "Quit", "quit")


def _edit(context: PanelContext) -> list[Action]:
    undo = f"Undo {context.undo_label}" if context.undo_label else "Undo"
    redo = f"Redo {context.redo_label}" if context.redo_label else "Redo"
    actions = _entry(context, undo, "undo", context.undo_label is not None)
    actions += _entry(context, redo, "redo", context.redo_label is not None)
    imgui.separator()
    selected = context.view.selected
    curve = selected is not None and selected.factor is not None
    actions += _entry(context, "Copy the material", "copy_material", selected is not None)
    actions += _entry(context, "Copy the curve", "copy_curve", curve)
    actions += _entry(context, "Paste", "paste", selected is not None)
    actions += _entry(context, "Paste as further layers", "paste_layers", selected is not None)
    imgui.separator()
    operator = context.view.operator is not None
    actions += _entry(context, "Mute the operator", "mute", operator)
    actions += _entry(context, "Delete the operator", "delete", operator)
    if imgui.menu_item_simple("Reset the curve", None, False, curve):
        assert selected is not None and selected.factor is not None
        actions += [ResetCurve(selected.key, selected.factor), SetView.of(operator=None)]
    return actions


def _view(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    for panel in PANELS:
        is_open = context.view.panel_open(panel.key)
        if imgui.menu_item_simple(panel.title, None, is_open):
            in_sight = is_open and not is_behind(panel)
            actions.append(OpenPanel(panel.key, False) if in_sight else ShowPanel(panel.key))
    if imgui.menu_item_simple("Put panels back in place"):
        actions.append(ResetLayout())
    imgui.separator()
    actions += _entry(context, "Fit the picture", "fit", on=context.view.fit)
    actions += _entry(context, "Compare with this moment", "compare", on=context.view.compare is not None)
    return actions + _entry(context, "Logarithmic curve", "log", on=context.view.log_y)


def _help(context: PanelContext) -> list[Action]:
    return _entry(context, "Shortcuts", "help", on=context.view.show_shortcuts)


def _controls(context: PanelContext) -> list[Action]:
    gap = imgui.get_style().item_spacing.x
    button = imgui.get_frame_height()
    segments = 2 * context.px(FIT_WIDTH) + 1
    width = context.px(EXPOSURE_WIDTH + TONE_WIDTH + 3 * GAP + 10) + segments + 5 * button + 2 * gap
    _title(context, width)
    imgui.set_cursor_pos_x(imgui.get_window_width() - width)
    _centre()
    actions = _exposure(context)
    actions += _tone_mapping(context)
    actions += _fit(context)
    _gap(context)
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
    if widgets.icon_button(context, "screenshot", Icon.CAMERA, "Save a picture of the whole window. (F12)"):
        actions.append(Screenshot())
    _next(0.0)
    if widgets.icon_button(context, "help", Icon.HELP, "All shortcuts. (?)", lit=context.view.show_shortcuts):
        actions += perform(context, "help")
    return actions


def _gap(context: PanelContext) -> None:
    _next(context.px(GAP))


def _next(gap: float) -> None:
    """Go on in the middle of the bar's height, `gap` pixels further."""
    imgui.same_line(0.0, gap)
    _centre()


def _centre() -> None:
    imgui.set_cursor_pos_y(round(0.5 * (imgui.get_window_height() - imgui.get_frame_height())))


def _hint(verb: str, label: str | None, keys: str) -> str:
    return f"{verb}: {label}. ({keys})" if label else f"Nothing to {verb.lower()}. ({keys})"


def _title(context: PanelContext, controls: float) -> None:
    """The scene's name, between menus and controls."""
    source = context.document.source
    name = Path(source).stem if Path(source).suffix else source
    if name == "scene":
        name = Path(source).parent.name
    imgui.same_line(0.0, context.px(18))
    room = imgui.get_window_width() - controls - imgui.get_cursor_pos_x() - context.px(16)
    if name and imgui.calc_text_size(name).x < room:
        imgui.align_text_to_frame_padding()
        imgui.text_disabled(name)
        widgets.tooltip(source)


def _exposure(context: PanelContext) -> list[Action]:
    imgui.set_next_item_width(context.px(EXPOSURE_WIDTH))
    hand, moved = widgets.slider(
        context,
        "exposure",
        context.view.exposure,
        LEAST_EXPOSURE,
        LARGEST_EXPOSURE,
        "%+.2f EV",
        handle="view.exposure",
        origin=0.0,
    )
    widgets.tooltip("Exposure of the display in stops; the light in the scene stays. Right click for 0. ([ and ])")
    if imgui.is_item_clicked(1):
        return [SetView.of(exposure=0.0)]
    return [SetView.of(exposure=moved)] if hand.changed else []


def _tone_mapping(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    _next(imgui.get_style().item_spacing.x)
    imgui.set_next_item_width(context.px(TONE_WIDTH))
    if imgui.begin_combo("##tone", TONE_LABELS[context.view.tone_mapping]):
        for mapping in TONE_MAPPINGS:
            pressed, _ = imgui.selectable(TONE_LABELS[mapping], mapping == context.view.tone_mapping)
            widgets.tooltip(TONE_HINTS[mapping])
            if pressed:
                actions.append(SetView.of(tone_mapping=mapping))
        imgui.end_combo()
    context.handles.note_item("view.tone_mapping")
    widgets.tooltip("How light becomes screen colour: changes the display, not the light.")
    return actions


def _fit(context: PanelContext) -> list[Action]:
    _next(imgui.get_style().item_spacing.x)
    choices = (
        ("Fit", "The picture as large as the panel allows. (F)"),
        ("1:1", "One pixel of the picture is one pixel of the screen. (F)"),
    )
    pressed = widgets.segments(context, "view.fit", choices, 0 if context.view.fit else 1, least=FIT_WIDTH)
    return [] if pressed is None else [SetView.of(fit=pressed == 0)]
