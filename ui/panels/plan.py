"""The plan of the picture: every line shows its value and the reason, and can be overridden and set back.

An override is an edit of the document, undone and saved as any other; a dot marks it.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.document.commands.plan import OverrideLine
from app.modes.placement.plan_table import PlanTableRow, plan_table
from ui import theme as look
from ui.display_names import with_display_names
from ui.panels import widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.theme import Icon

VALUE_WIDTH, DOT = 118.0, 3.0
PLANNED = "As planned"
PICTURE = "The whole picture"
HINT = "Override this line of the plan. It is an edit: it can be undone, and is saved with the session."
GIVE_BACK = "Back to the planned value."


def draw(context: PanelContext) -> list[Action]:
    """The plan table, a heading above the lines of the picture and of each layer."""
    actions: list[Action] = []
    group: str | None = None
    for line in plan_table(context.document, context.view, context.status):
        if line.group != group:
            _heading(context, line.group, is_first=group is None)
            group = line.group
        actions += _line(context, line)
    return actions


def _heading(context: PanelContext, key: str, is_first: bool) -> None:
    if not is_first:
        imgui.dummy(ImVec2(0.0, context.px(4)))
    imgui.push_style_color(imgui.Col_.text, look.pack(look.TEXT_FAINT))
    imgui.separator_text(with_display_names(context.document, key) if key else PICTURE)
    imgui.pop_style_color()


def _line(context: PanelContext, line: PlanTableRow) -> list[Action]:
    """Name and value on one line, the reason below."""
    actions: list[Action] = []
    side, gap = imgui.get_frame_height(), imgui.get_style().item_spacing.x
    start, corner = imgui.get_cursor_pos_x(), imgui.get_cursor_screen_pos()
    width = min(context.px(VALUE_WIDTH), 0.55 * imgui.get_content_region_avail().x)
    edge = start + imgui.get_content_region_avail().x
    if line.is_set:
        middle = ImVec2(corner.x - context.px(6), corner.y + 0.5 * side)
        imgui.get_window_draw_list().add_circle_filled(middle, context.px(DOT), look.pack(look.ACCENT))
    widgets.rich_label(widgets.subscripted(line.title))
    if line.is_set:
        imgui.same_line(edge - width - side - 0.5 * gap)
        if widgets.icon_button(context, f"plan.{line.line}.reset", Icon.RESET, GIVE_BACK):
            actions.append(OverrideLine(line.line, None))
    if line.choices:
        imgui.same_line(edge - width)
        actions += _value(context, line, width)
    else:
        imgui.same_line(edge - imgui.calc_text_size(line.value).x)
        widgets.rich_label(line.value)
    imgui.set_cursor_pos_y(imgui.get_cursor_pos_y() - 0.5 * imgui.get_style().item_spacing.y)
    widgets.caption(line.reason)
    return actions


def _value(context: PanelContext, line: PlanTableRow, width: float) -> list[Action]:
    """The value, and a list of the choices, the plan's own first."""
    choices = [widgets.Choice(PLANNED), *(widgets.Choice(text) for text, _ in line.choices)]
    chosen = [1 + place for place, (text, _) in enumerate(line.choices) if text == line.value] if line.is_set else [0]
    imgui.set_next_item_width(width)
    picked = widgets.choose(context, f"plan.{line.line}", choices, chosen, HINT, shown=line.value)
    return [] if picked is None else [OverrideLine(line.line, line.choices[picked - 1][1] if picked else None)]
