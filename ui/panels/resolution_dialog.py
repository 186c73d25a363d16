"""The dialog for another resolution of the picture: presets of the scene's own, or numbers, and their cost."""

from __future__ import annotations

from imgui_bundle import ImVec2, ImVec4, imgui

from app.system.memory import bytes_for, gib, memory_bytes
from engine.material.parameters import Parameter
from engine.scene.description import MAX_RESOLUTION
from ui import theme as look
from ui.panels import rows, widgets
from ui.panels.actions import Action, RunOperator, SetPanel
from ui.panels.context import PanelContext

Size = tuple[int, int]
PRESETS = ((0.25, "1/4"), (0.5, "1/2"), (1.0, "Scene"), (2.0, "2 x"), (4.0, "4 x"))
HINT = "Share of the scene's own resolution."
FIELD = 84.0
SIDES = tuple(
    Parameter(
        side, "scalar", 512.0, side.capitalize(), f"The picture's {side} in pixels.", minimum=1.0,
        maximum=float(MAX_RESOLUTION), step=2.0, form="%.0f",
    )
    for side in ("width", "height")
)  # fmt: skip


def draw(context: PanelContext) -> list[Action]:
    """A small window over the picture while the dialog is open."""
    size, picture = context.state.resolution, context.picture
    if size is None or picture is None:
        return []
    actions: list[Action] = []
    viewport = imgui.get_main_viewport()
    top = ImVec2(viewport.get_work_center().x, viewport.work_pos.y + context.px(12))
    with widgets.strip(context, "Resolution###resolution", top, ImVec2(0.5, 0.0), ImVec2(14, 12)) as is_seen:
        if is_seen:
            presets = [scale_size(context.own_resolution, share) for share, _ in PRESETS]
            chosen = presets.index(size) if size in presets else -1
            pressed = widgets.segments(context, "resolution", [(text, HINT) for _, text in PRESETS], chosen, least=44.0)
            actions += _numbers(context, size)
            actions += [] if pressed is None else [SetPanel({"resolution": presets[pressed]})]
            costs_too_much = _cost(context, size, (picture.width, picture.height))
            actions += _buttons(context, size, not costs_too_much)
    return actions


def scale_size(size: Size, share: float) -> Size:
    """A size times a number, clamped to what a scene may have."""
    width, height = (min(max(round(side * share), 1), MAX_RESOLUTION) for side in size)
    return width, height


def _numbers(context: PanelContext, size: Size) -> list[Action]:
    actions: list[Action] = []
    for index, (name, other) in enumerate((("width", size[1]), ("height", size[0]))):
        if index:
            imgui.same_line()
            imgui.text_unformatted("x")
            imgui.same_line()
        imgui.set_next_item_width(context.px(FIELD))

        def set_side(side: float, other: int = other, is_width: bool = index == 0) -> Action:
            return SetPanel({"resolution": (round(side), other) if is_width else (other, round(side))})

        own = float(context.own_resolution[index])
        actions += rows.control(
            context, rows.Row(SIDES[index], float(size[index]), set_side, f"resolution.{name}", own, drag=None)
        )
    return actions


def _cost(context: PanelContext, size: Size, now: Size) -> bool:
    """The memory that the picture will need, beside its present need; returns whether that is more than there is."""
    needed, (free, _) = bytes_for(size), memory_bytes()
    times = size[0] * size[1] / (now[0] * now[1])
    too_much = free is not None and needed > free
    there = "" if free is None else f" of {gib(free)} that are free"
    imgui.push_style_color(imgui.Col_.text, ImVec4(*(look.BAD if too_much else look.TEXT_SOFT)))
    imgui.text_unformatted(f"About {gib(needed)} of memory{there}")
    imgui.text_unformatted(f"{times:.3g} times the pixels there are now, and the time" if times != 1.0 else "As now")
    imgui.pop_style_color()
    return too_much


def _buttons(context: PanelContext, size: Size, enabled: bool) -> list[Action]:
    close = SetPanel({"resolution": None})
    imgui.spacing()
    hint = "Compute the picture at this resolution. All edits stay."
    if widgets.text_button(context, "resolution.apply", "Apply", hint, enabled=enabled):
        return [RunOperator("resolution", size), close]
    imgui.same_line()
    return [close] if widgets.text_button(context, "resolution.cancel", "Cancel", "Cancel. (Esc)") else []
