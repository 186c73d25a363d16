"""The menu bar at the top: menus left, which Alt opens; exposure, tone mapping, compare, fit, undo, mode and help
right.

What is in the menus is declared with the operators (`app.operators.registry`); entries with choices of their own are
drawn here. The controls at the right are always visible.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.document.looks import look_names
from app.document.view_state import EXPOSURE, GAMMA, OpenPanel, SetView
from app.operators.keymap import KEYMAP_LABELS
from app.operators.registry import MENUS, OPERATORS, Menu, keys_of
from app.operators.view import is_pixel_for_pixel
from engine.core.colour import VIEWS, ConfigView, view_label
from engine.core.colour_config import ConfigCatalogue
from engine.inverse.transferred_edit import MEASURES, Measure
from ui.layout import PANELS, is_behind
from ui.panels import library, rows, widgets
from ui.panels.actions import Action, MoveCameraTo, OpenFile, RunOperator, SetPanel, SetPreference, ShowPanel
from ui.panels.context import PanelContext
from ui.panels.window_operators import ALT, is_on, perform
from ui.theme import Icon

EXPOSURE_WIDTH, LEAST_EXPOSURE_WIDTH, TONE_WIDTH, FIT_WIDTH, GAP = 118.0, 64.0, 108.0, 42.0, 12.0
GAMMA_LABEL = 52.0
MENU_HANDLE = "menu.colours"
MODE_WIDTH = 84.0
RECENT_WIDTH = 320.0
PREVIEW = 56.0
NOT_SAVED = ": there are edits that no session has yet"
# Pixels of a drag per stop: along the short track, a few pixels would be several stops.
PIXELS_A_STOP = 50.0


def draw(context: PanelContext) -> list[Action]:
    """The whole bar."""
    actions: list[Action] = []
    padding = ImVec2(imgui.get_style().frame_padding.x, imgui.get_style().frame_padding.y)
    imgui.push_style_var(imgui.StyleVar_.frame_padding, ImVec2(padding.x, context.px(9)))
    if imgui.begin_main_menu_bar():
        imgui.push_style_var(imgui.StyleVar_.frame_padding, padding)
        requested = context.state.opens_menu or _menu_opened_by_alt(context)
        for menu in MENUS:
            if menu.title == requested:
                imgui.open_popup(menu.title)
                actions.append(SetPanel({"opens_menu": ""}))
            actions += _menu(context, menu)
        actions += _controls(context)
        imgui.pop_style_var()
        imgui.end_main_menu_bar()
    imgui.pop_style_var()
    return actions


def _menu(context: PanelContext, menu: Menu) -> list[Action]:
    """A menu, with those within it."""
    if not _begin(context, menu.title):
        return []
    actions: list[Action] = []
    for row in menu.rows:
        if row is None:
            imgui.separator()
        elif isinstance(row, Menu):
            actions += _menu(context, row)
        else:
            actions += CHOICES[row](context) if row in CHOICES else _entry(context, row)
    imgui.end_menu()
    return actions


def _begin(context: PanelContext, title: str) -> bool:
    """Whether a menu, or a submenu, is open: to be ended then."""
    corner, extent = imgui.get_cursor_screen_pos(), imgui.calc_text_size(title)
    context.handles.note(f"menu.{title}", corner.x + 0.5 * extent.x, corner.y + 0.5 * extent.y)
    return imgui.begin_menu(title)


def _entry(context: PanelContext, name: str, text: str = "") -> list[Action]:
    """The entry of an operator, grey where it cannot run; its tooltip says why, or what it does where no key has it."""
    operator = OPERATORS[name]
    why_not = operator.why_not(context)
    text = text or operator.entry_text(context)
    pressed = imgui.menu_item_simple(text, context.keys_of(name), is_on(context, name), not why_not)
    context.handles.note_item(f"menu.{name}")
    widgets.tooltip(why_not or ("" if context.keys_of(name) else operator.help))
    return perform(context, name) if pressed else []


# ---------------------------------------------------------------------------------------------- entries with choices


def _recent(context: PanelContext) -> list[Action]:
    """The files opened last; missing ones are grey."""
    if not _begin(context, OPERATORS["open_recent"].entry):
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


def _builtin_scenes(context: PanelContext) -> list[Action]:
    if not context.scenes or not _begin(context, OPERATORS["open_builtin"].entry):
        return []
    actions: list[Action] = []
    for name in context.scenes:
        if imgui.menu_item_simple(name.capitalize(), None, name == context.document.source):
            actions.append(OpenFile(name))
    imgui.end_menu()
    return actions


def _recover(context: PanelContext) -> list[Action]:
    """Edits that can be recovered, where there are any."""
    if not context.recoveries:
        return []
    imgui.separator()
    return _entry(context, "recover", f"{OPERATORS['recover'].entry} ({len(context.recoveries)})")


def _panels(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    for panel in PANELS:
        is_open = context.view.panel_open(panel.key)
        if imgui.menu_item_simple(panel.title, None, is_open):
            in_sight = is_open and not is_behind(panel)
            actions.append(OpenPanel(panel.key, False) if in_sight else ShowPanel(panel.key))
    return actions


def _saved_views(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    for bookmark in context.view.bookmarks:
        if imgui.menu_item_simple(f"{bookmark.name}###saved.{bookmark.name}"):
            actions.append(MoveCameraTo(bookmark.viewpoint, bookmark.name))
    return actions


MOUSE = (("mouse", "blender", "Mouse as in Blender"), ("mouse", "maya", "Mouse as in Maya"))
SCROLL = (("scroll", "dolly", "Wheel: nearer, farther"), ("scroll", "orbit", "Trackpad: two fingers orbit"))


def _conventions(context: PanelContext) -> list[Action]:
    """The mouse and trackpad conventions."""
    actions: list[Action] = []
    for group in (MOUSE, SCROLL):
        imgui.separator()
        for name, value, text in group:
            if imgui.menu_item_simple(text, None, getattr(context.preferences, name) == value):
                actions.append(SetPreference({name: value}))
            context.handles.note_item(f"menu.{name}.{value}")
    return actions


def _looks(context: PanelContext) -> list[Action]:
    """The looks of the document, the current one checked."""
    actions: list[Action] = []
    names = look_names(context.document)
    if names and _begin(context, OPERATORS["look"].entry_text(context)):
        for index, name in enumerate(names):
            if imgui.menu_item_simple(f"{name}###look.{name}", None, name == context.document.look):
                actions.append(RunOperator("look", name))
            context.handles.note_item(f"menu.look.{index}")
        imgui.end_menu()
    return actions


def _stored(context: PanelContext) -> list[Action]:
    """The stored pictures, the one that is compared checked; a click on that ends the comparison."""
    actions: list[Action] = []
    for index, name in enumerate(context.stored_names):
        is_compared = name == context.view.stored
        if imgui.menu_item_simple(f"{name}###stored.{name}", None, is_compared):
            actions.append(RunOperator("compare_with", "" if is_compared else name))
        context.handles.note_item(f"menu.stored.{index}")
    if not context.stored_names:
        imgui.text_disabled("None is stored yet")
    return actions


def _keymaps(context: PanelContext) -> list[Action]:
    """The keys that arrange objects."""
    if not _begin(context, OPERATORS["keymap"].entry):
        return []
    actions: list[Action] = []
    for keys, label in KEYMAP_LABELS.items():
        if imgui.menu_item_simple(label, None, context.preferences.keys == keys):
            actions.append(SetPreference({"keys": keys}))
        context.handles.note_item(f"menu.keys.{keys}")
    imgui.end_menu()
    return actions


def _resolution(context: PanelContext) -> list[Action]:
    picture = context.picture
    size = "" if picture is None else f" ({picture.width} x {picture.height})"
    return _entry(context, "resolution", f"{OPERATORS['resolution'].entry}{size}")


def _views(context: PanelContext, handle: str = MENU_HANDLE) -> list[Action]:
    """The choice of the view transform, in a list or a menu."""
    actions: list[Action] = []
    for name, known in VIEWS.items():
        if imgui.menu_item_simple(known.label, None, name == context.view.tone_mapping):
            actions.append(SetView.of(tone_mapping=name))
        context.handles.note_item(f"{handle}.{name}")
        widgets.tooltip(known.tooltip)
    for catalogue in context.catalogues:
        actions += _configured_views(context, catalogue, handle == MENU_HANDLE)
    imgui.separator()
    return actions + _gamma(context)


def _configured_views(context: PanelContext, catalogue: ConfigCatalogue, nests: bool) -> list[Action]:
    """The displays of an OpenColorIO configuration with their views, and its looks; nests: as submenus, which a list
    has not."""
    shown, actions = context.view.tone_mapping, list[Action]()
    own = shown if isinstance(shown, ConfigView) and shown.config == catalogue.config else None
    look = "" if own is None else own.look
    imgui.separator()
    imgui.text_disabled(Path(catalogue.config).name)
    widgets.tooltip(catalogue.note or catalogue.config)
    for display, views in catalogue.displays:
        if nests and not _begin(context, display):
            continue
        if not nests:
            imgui.text_disabled(f"  {display}")
        for name in views:
            is_chosen = own is not None and (own.display, own.view) == (display, name)
            if imgui.menu_item_simple(f"{name}###{display}.{name}", None, is_chosen):
                actions.append(SetView.of(tone_mapping=ConfigView(catalogue.config, display, name, look)))
            context.handles.note_item(f"menu.colours.{display}.{name}")
        if nests:
            imgui.end_menu()
    if nests and own is not None and catalogue.looks and _begin(context, "Look"):
        for each in ("", *catalogue.looks):
            if imgui.menu_item_simple(each or "None", None, each == look):
                actions.append(SetView.of(tone_mapping=replace(own, look=each)))
            context.handles.note_item(f"menu.look.{each}")
        imgui.end_menu()
    return actions


def _gamma(context: PanelContext) -> list[Action]:
    row = rows.Row(
        GAMMA, context.view.gamma, lambda gamma: SetView.of(gamma=gamma), "view.gamma", GAMMA.default, drag=None,
        origin=1.0,
    )  # fmt: skip
    return rows.draw(context, row, GAMMA_LABEL)


def _transfer(context: PanelContext, measure: Measure) -> list[Action]:
    """The entry of a measure of a transferred edit, and below it the other selected objects as it would make them."""
    actions = _entry(context, f"transfer_{measure}")
    entries, side, gap = context.transferred(measure), context.px(PREVIEW), context.px(4)
    for i, entry in enumerate(entries):
        if i:
            imgui.same_line(0.0, gap)
        corner = imgui.get_cursor_screen_pos()
        imgui.dummy(ImVec2(side, side))
        context.handles.note_item(f"menu.transfer_{measure}.{i}")
        widgets.tooltip(f"{entry.name}, as it would be.")
        library.draw_thumbnail(context, entry, corner, side)
    return actions


# How the operators are drawn that a menu has with their choices, or with what they apply to.
CHOICES: dict[str, Callable[[PanelContext], list[Action]]] = {
    "open_recent": _recent, "open_builtin": _builtin_scenes, "recover": _recover, "show": _panels,
    "go_to_view": _saved_views, "conventions": _conventions, "keymap": _keymaps, "resolution": _resolution,
    "view": _views, "look": _looks, "compare_with": _stored,
    **{f"transfer_{measure}": partial(_transfer, measure=measure) for measure in MEASURES},
}  # fmt: skip


def _menu_opened_by_alt(context: PanelContext) -> str | None:
    """The menu that Alt opens: by itself the first, with a menu's first letter that one."""
    if context.alt_tapped:
        return MENUS[0].title
    letters = {menu.title: getattr(imgui.Key, menu.title[0].lower()) for menu in MENUS}
    return next((title for title, key in letters.items() if imgui.is_key_chord_pressed(ALT | int(key))), None)


# ---------------------------------------------------------------------------------------------- controls at the right


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
    actions = _title(context, width + buttons)
    imgui.set_cursor_pos_x(imgui.get_window_width() - width - buttons)
    _centre()
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
    comparing = context.view.compare is not None
    hint = "End the comparison" if comparing else "Remember this picture as A and compare: a divider shows A | B"
    actions = _button(context, "compare", Icon.COMPARE, hint)
    _next(context.px(GAP))
    actions += _button(context, "undo", Icon.UNDO, _undo_hint("Undo", context.undo_label))
    _next(0.0)
    actions += _button(context, "redo", Icon.REDO, _undo_hint("Redo", context.redo_label))
    _next(context.px(GAP))
    actions += _button(context, "picture", Icon.CAMERA, "Save the picture")
    _next(0.0)
    return actions + _button(context, "help", Icon.HELP, "All shortcuts")


def _button(context: PanelContext, name: str, icon: str, hint: str) -> list[Action]:
    """An operator's button, lit where the operator is on; its tooltip ends in its keys."""
    enabled = not OPERATORS[name].why_not(context)
    hint = f"{hint}. ({context.keys_of(name)})"
    pressed = widgets.icon_button(context, name, icon, hint, enabled, lit=is_on(context, name))
    return perform(context, name) if pressed else []


def _undo_hint(verb: str, label: str | None) -> str:
    return f"{verb}: {label}" if label else f"Nothing to {verb.lower()}"


def _next(gap: float) -> None:
    """Continue in the middle of the bar's height, `gap` pixels further."""
    imgui.same_line(0.0, gap)
    _centre()


def _centre() -> None:
    imgui.set_cursor_pos_y(round(0.5 * (imgui.get_window_height() - imgui.get_frame_height())))


def _title(context: PanelContext, controls: float) -> list[Action]:
    """The name of what is open, between menus and controls, and the marks beside it: that there is something to read
    about its files, and that another program has written one of them."""
    name = f"{context.name}*" if context.unsaved else context.name
    imgui.same_line(0.0, context.px(18))
    marks = _marks(context)
    room = imgui.get_window_width() - controls - imgui.get_cursor_pos_x() - context.px(16)
    room -= len(marks) * imgui.get_frame_height()
    if name and imgui.calc_text_size(name).x < room:
        imgui.align_text_to_frame_padding()
        imgui.text_disabled(name)
        widgets.tooltip(f"{context.document.source}{NOT_SAVED if context.unsaved else ''}")
        imgui.same_line(0.0, context.px(4))
    if room < 0.0:
        return []
    actions: list[Action] = []
    for operator, icon, hint in marks:
        _centre()
        actions += _button(context, operator, icon, hint)
        imgui.same_line(0.0, 0.0)
    return actions


def _marks(context: PanelContext) -> list[tuple[str, str, str]]:
    """Operator, icon and tooltip of each mark; none where all is shown as the files say."""
    marks = []
    if not context.report.is_silent or context.state.shows_report:
        said = context.report.summary() or "All that the file contains is shown"
        marks.append(("report", Icon.REPORT, f"{said[0].upper()}{said[1:]}"))
    if changed := context.status.changed_files:
        first, more = Path(changed[0]).name, f" and {len(changed) - 1} more" if len(changed) > 1 else ""
        marks.append(("reload", Icon.LOOP, f"{first}{more}: saved by another program. Reload; edits stay"))
    return marks


def _exposure(context: PanelContext, width: float) -> list[Action]:
    def set_exposure(stops: float) -> SetView:
        return SetView.of(exposure=stops)

    imgui.set_next_item_width(width)
    row = rows.Row(
        EXPOSURE, context.view.exposure, set_exposure, "view.exposure", EXPOSURE.default, drag=None, origin=0.0,
        pixels_a_unit=PIXELS_A_STOP,
    )  # fmt: skip
    return rows.control(context, row)


def _tone_mapping(context: PanelContext) -> list[Action]:
    actions: list[Action] = []
    imgui.set_next_item_width(context.px(TONE_WIDTH))
    if widgets.begin_combo("##tone", view_label(context.view.tone_mapping), is_tall=True):
        actions += _views(context, "colours")
        imgui.end_combo()
    context.handles.note_item("view.tone_mapping")
    widgets.tooltip("The view: how light becomes colour on the screen and in PNG files.")
    return actions


def _fit(context: PanelContext) -> list[Action]:
    choices = (
        ("Fit", f"Fit the picture to the panel. ({keys_of('whole')})"),
        ("1:1", f"One pixel of the picture is one pixel of the screen. ({keys_of('pixels')})"),
    )
    chosen = 0 if context.view.fit else 1 if is_pixel_for_pixel(context) else -1
    pressed = widgets.segments(context, "view.fit", choices, chosen, least=FIT_WIDTH)
    return [] if pressed is None else perform(context, ("whole", "pixels")[pressed])
