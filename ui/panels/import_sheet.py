"""The sheet below the file's name: what the file contains, every property that is not shown, and what was repaired.

It lies over the picture, which stays usable, and reads like a page: a line of numbers, then what is not shown with its
effect on the picture in words, by group or the most frequent first, then the repairs. All of it goes to the clipboard
as text, also what is too long for the sheet. Everything is laid out by the sheet's own width: imgui does not know the
window's in the first frame, which stays for a while on a slow machine.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.operators.registry import keys_of
from engine.core.errors import plain_line
from engine.scene.import_report import ImportReport, group_of, report_lines, sorted_unshown
from engine.scene.loaders.model import UnshownProperty
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import Action, CopyText, SetPanel
from ui.panels.context import PanelContext
from ui.theme import Icon

WIDTH, LEAST_WIDTH, MARGIN, PADDING = 560.0, 280.0, 12.0, 14.0
COUNT_WIDTH, LEAST_BODY = 56.0, 90.0
# Of the window's height, so that the curve stays in reach below it; in a low window all of it.
HEIGHT_SHARE, LEAST_HEIGHT = 0.66, 560.0
ORDERS = (
    ("By place", "By where the file has them: materials, nodes, meshes."),
    ("By count", "The most frequent first."),
)
MOST_LINES = 500  # of a list: thousands would take longer to draw than a frame has
COMPLETE = "All that the file contains is shown, as the file says."


def draw(context: PanelContext) -> list[Action]:
    """The sheet while it is open; nothing while a file is being chosen."""
    if not context.state.shows_report or context.state.question is not None:
        return []
    viewport, report = imgui.get_main_viewport(), context.report
    room = viewport.work_size
    width = max(min(context.px(WIDTH), room.x - context.px(4 * MARGIN)), context.px(LEAST_WIDTH))
    top = ImVec2(viewport.get_work_center().x, viewport.work_pos.y + context.px(MARGIN))
    actions: list[Action] = []
    with widgets.strip(context, "Import report###report", top, ImVec2(0.5, 0.0), ImVec2(PADDING, 10)) as is_seen:
        if is_seen:
            imgui.dummy(ImVec2(width, 0))
            actions += _title(context, report, width)
            _contents(report, width)
            if report.is_silent:
                _wrapped(COMPLETE, look.TEXT_SOFT, width)
            else:
                height = max(HEIGHT_SHARE * room.y, min(room.y, context.px(LEAST_HEIGHT)))
                actions += _body(context, report, width, viewport.work_pos.y + height - context.px(2 * MARGIN))
    return actions


def _title(context: PanelContext, report: ImportReport, width: float) -> list[Action]:
    actions: list[Action] = []
    start = imgui.get_cursor_pos_x()
    imgui.align_text_to_frame_padding()
    context.theme.push_bold()
    imgui.text_unformatted(widgets.shortened(report.files[0] if report.files else context.name, context.px(WIDTH / 2)))
    imgui.pop_font()
    widgets.tooltip(context.document.source)
    imgui.same_line(start + width - 2 * imgui.get_frame_height() - context.px(4))
    if widgets.icon_button(context, "report.copy", Icon.COPY, "Copy all of it as text."):
        text = "\n".join((context.document.source, *report_lines(report)))
        actions.append(CopyText(text, "what the file contains"))
    imgui.same_line(0.0, context.px(4))
    if widgets.icon_button(context, "report.close", Icon.CLOSE, f"Close this. (Esc, {keys_of('report')})"):
        actions.append(SetPanel({"shows_report": False}))
    return actions


def _contents(report: ImportReport, width: float) -> None:
    """The numbers of what is in the file, as words in as many lines as they need; names are in the tooltips."""
    gap, end = imgui.get_font_size(), imgui.get_cursor_pos_x() + width
    is_first = True
    for kind, number, names in report.contents():
        if not number and kind not in ("objects", "triangles"):
            continue
        figure, word = f"{number:,}", kind if number != 1 else kind[:-1]
        needed = imgui.calc_text_size(f"{figure} {word}").x
        if not is_first:
            imgui.same_line(0.0, gap)
            if imgui.get_cursor_pos_x() + needed > end:
                imgui.new_line()
        is_first = False
        imgui.begin_group()
        imgui.text_unformatted(figure)
        imgui.same_line(0.0, 0.3 * gap)
        _coloured(word, look.TEXT_SOFT)
        imgui.end_group()
        widgets.tooltip(_names(names))
    imgui.spacing()


def _names(names: tuple[str, ...], most: int = 24) -> str:
    """Names in lines, not more than a tooltip holds."""
    lines = [plain_line(name) for name in names[:most]]
    return "\n".join([*lines, *([f"and {len(names) - most} more"] if len(names) > most else [])])


def _body(context: PanelContext, report: ImportReport, width: float, foot: float) -> list[Action]:
    """What is not shown and what was repaired, in a list that scrolls where the window is too low for it."""
    actions: list[Action] = []
    if report.unshown:
        imgui.separator()
        actions += _order(context, report, width)
    inner = width - imgui.get_style().scrollbar_size
    room = max(foot - imgui.get_cursor_screen_pos().y - context.px(PADDING), context.px(LEAST_BODY))
    imgui.set_next_window_size_constraints(ImVec2(width, 0.0), ImVec2(width, room))
    if imgui.begin_child("body", ImVec2(width, 0.0), imgui.ChildFlags_.auto_resize_y):
        if report.unshown:
            _unshown(context, report.unshown, inner)
        if report.notes:
            _heading(context, "Repaired or left out", len(report.notes))
            for note in report.notes[:MOST_LINES]:
                _wrapped(plain_line(note), look.TEXT_SOFT, inner)
            _rest(len(report.notes), inner)
    imgui.end_child()
    return actions


def _order(context: PanelContext, report: ImportReport, width: float) -> list[Action]:
    """The heading of what is not shown, and the choice of its order."""
    start = imgui.get_cursor_pos_x()
    imgui.align_text_to_frame_padding()
    _heading(context, "Not shown, or in part", len(report.unshown))
    imgui.same_line(start + width - widgets.segments_width(context, [text for text, _ in ORDERS]))
    pressed = widgets.segments(context, "report.order", ORDERS, int(context.state.report_by_count))
    return [] if pressed is None else [SetPanel({"report_by_count": pressed == 1})]


def _unshown(context: PanelContext, unshown: tuple[UnshownProperty, ...], width: float) -> None:
    """A line for each property: how often, its name, and below it what the picture lacks."""
    by_count, group = context.state.report_by_count, ""
    for each in sorted_unshown(unshown, by_count)[:MOST_LINES]:
        if not by_count and group_of(each) != group:
            if group:
                imgui.dummy(ImVec2(1, context.px(4)))
            group = group_of(each)
            _coloured(group[:1].upper() + group[1:], look.ACCENT)
        start = imgui.get_cursor_pos_x()
        count = f"{each.count:,}"
        imgui.set_cursor_pos_x(start + context.px(COUNT_WIDTH - 14) - imgui.calc_text_size(count).x)
        _coloured(count, look.TEXT_SOFT)
        imgui.same_line(start + context.px(COUNT_WIDTH))
        imgui.begin_group()
        name = each.name if by_count else each.name.removeprefix(f"{group}.")
        room = width - context.px(COUNT_WIDTH)
        imgui.text_unformatted(widgets.fitting(plain_line(name), room))
        widgets.tooltip(plain_line(each.name))
        _wrapped(plain_line(each.effect), look.TEXT_SOFT, room)
        imgui.end_group()
    _rest(len(unshown), width)
    imgui.dummy(ImVec2(1, context.px(6)))


def _rest(number: int, width: float) -> None:
    """How many lines of a list are not drawn."""
    if number > MOST_LINES:
        _wrapped(f"and {number - MOST_LINES:,} more; the text that is copied has all of them", look.TEXT_SOFT, width)


def _heading(context: PanelContext, text: str, number: int) -> None:
    context.theme.push_bold()
    imgui.text_unformatted(text)
    imgui.pop_font()
    imgui.same_line(0.0, 0.5 * imgui.get_font_size())
    _coloured(f"{number:,}", look.TEXT_FAINT)


def _coloured(text: str, ink: look.Colour) -> None:
    imgui.push_style_color(imgui.Col_.text, look.pack(ink))
    imgui.text_unformatted(text)
    imgui.pop_style_color()


def _wrapped(text: str, ink: look.Colour, width: float) -> None:
    """Text in lines of this width; the window's own is not known in its first frame."""
    imgui.push_text_wrap_pos(imgui.get_cursor_pos_x() + width)
    _coloured(text, ink)
    imgui.pop_text_wrap_pos()
