"""Painting a layer's weight map with the mouse over the picture: the brush's controls, its circle, its strokes."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from imgui_bundle import ImVec2, imgui

from app.document.commands.maps import BlendByMap, Paint, SetMap, blended_with
from app.document.document import layer_key
from engine.material.layer import object_of
from engine.material.layer_maps import LayerMaps
from ui import theme as look
from ui.panels import rows, widgets
from ui.panels.actions import Action, BeginDrag, EndDrag, HoldGrip, SetPanel
from ui.panels.context import PanelContext
from ui.panels.window_state import BRUSH, Brush, PaintGrip
from ui.scene_view import sample_path, spots_at, stroke_at
from ui.theme import Icon

STEP = 2.0**0.25
STRIP = 320.0  # the least width of the strip, at scale 1
Point = tuple[float, float]

PAINT = "Paint the map with the mouse over the picture; Esc ends it."
START = (
    ("Full", "The map begins white: the layer is everywhere, and the brush takes it away."),
    ("Empty", "The map begins black: the layer is nowhere but where the brush brings it."),
)
TOWARDS = (
    ("Add", "The brush brings the layer. With Ctrl or Alt held it takes it away."),
    ("Remove", "The brush takes the layer away. With Ctrl or Alt held it brings it."),
)
BLEND = "Another layer gets this map inverted: where one is, the other is not. They are painted together from then on."


def painting_layer_key(context: PanelContext) -> str | None:
    """The layer that dragging over the picture paints; None where it does not."""
    selected, document = context.view.selected, context.document
    if not context.state.paints or selected is None:
        return None
    state = document.object(selected.object)
    fixed = not state.editable or state.is_lamp or document.is_frozen(selected.key)
    return None if fixed else selected.key


def draw(context: PanelContext, key: str, maps: LayerMaps, width: float) -> list[Action]:
    """The row under the weight map; for a uniform one its value, where the brush is on."""
    widgets.label(context, "", width)
    on = context.state.paints
    actions: list[Action] = []
    if widgets.switch(context, "material.paint", "Paint", PAINT, on):
        actions.append(_switched(context, maps, not on))
    if not maps.weight and (on or maps.has_weight):
        imgui.same_line(0.0, context.px(4))
        start = widgets.segments(context, "material.weight_start", START, 0 if maps.weight_start == 1.0 else 1)
        if start is not None:
            actions += [
                SetMap(key, "weight_start", 1.0 - start),
                _with_value(context.state.brush, "erases", start == 0),
            ]
    return actions + (_blend(context, key, width) if maps.has_weight else [])


def _switched(context: PanelContext, maps: LayerMaps, on: bool) -> Action:
    """Toggle the brush; a map that is white all over can only be erased, so then the brush erases."""
    brush = context.state.brush
    if on and not maps.has_weight:
        brush = replace(brush, erases=True)
    return SetPanel({"paints": on, "brush": brush, "shows_images": True})


def _blend(context: PanelContext, key: str, width: float) -> list[Action]:
    """A menu of the object's other layers; those blended with this one already have a mark."""
    name = object_of(key)
    others = {
        layer_key(name, i): layer.title
        for i, layer in enumerate(context.document.object(name).layers)
        if layer_key(name, i) != key and not layer.rises
    }
    if not others:
        return []
    together = [text for other, text in others.items() if other in blended_with(context.document, key)]
    choices = [widgets.Choice(text) for text in others.values()]
    chosen = [place for place, text in enumerate(others.values()) if text in together]
    widgets.label(context, "Blend with", width)
    picked = widgets.choose(
        context, "material.blend", choices, chosen, BLEND, shown=", ".join(together) or "No other layer"
    )
    return [] if picked is None else [BlendByMap(key, list(others)[picked])]


def draw_strip(context: PanelContext, corner: ImVec2, room: ImVec2) -> list[Action]:
    """The brush's controls at the lower edge of the picture, near the pointer."""
    if painting_layer_key(context) is None or room.x < context.px(STRIP):
        return []
    actions: list[Action] = []
    foot = ImVec2(corner.x + 0.5 * room.x, corner.y + room.y - context.px(10))
    with widgets.strip(context, "Brush###brush", foot, ImVec2(0.5, 1.0), ImVec2(8, 6)) as is_seen:
        if is_seen:
            actions += _brush(context, min(context.px(120), (room.x - context.px(STRIP)) / 3.0 + context.px(60)))
    return actions


def _brush(context: PanelContext, width: float) -> list[Action]:
    """Paint or erase, three sliders, and a button that ends painting."""
    brush, gap = context.state.brush, context.px(6)
    pressed = widgets.segments(context, "brush", TOWARDS, int(brush.erases))
    actions = [] if pressed is None else [_with_value(brush, "erases", bool(pressed))]
    for parameter in BRUSH:
        imgui.same_line(0.0, gap)
        imgui.set_next_item_width(width)
        name = parameter.name
        actions += rows.control(
            context,
            rows.Row(
                parameter, getattr(brush, name), partial(_with_value, brush, name), f"brush.{name}", parameter.default,
                drag=None,
            ),
        )  # fmt: skip
    imgui.same_line(0.0, gap)
    if widgets.icon_button(context, "brush_off", Icon.CLOSE, "End painting (Esc)."):
        actions.append(SetPanel({"paints": False}))
    return actions


def _with_value(brush: Brush, name: str, value: float | bool) -> Action:
    return SetPanel({"brush": replace(brush, **{name: value})})  # type: ignore[arg-type]


def resize_brush(brush: Brush, steps: int) -> Action:
    """The brush, larger or smaller by so many steps."""
    low, high = BRUSH[0].limits
    return _with_value(brush, "radius", min(max(brush.radius * STEP**steps, low), high))


# ---------------------------------------------------------------------------------------------------------- the picture


def begin(context: PanelContext, place: Point) -> list[Action]:
    """The button was pressed at a place of the picture, in its pixels."""
    brush = context.state.brush
    erases = brush.erases != _is_inverted()
    grip = PaintGrip("paint", place, False, 0.0 if erases else 1.0)
    return [BeginDrag(), *_stroke(context, grip, [place], place)]


def _is_inverted() -> bool:
    """Whether a key inverts the brush: Ctrl, or Alt where that does not move the camera."""
    io = imgui.get_io()
    return bool(io.key_alt or io.key_ctrl)


def go_on(context: PanelContext, grip: PaintGrip, place: Point) -> list[Action]:
    """The button is held and the mouse is at a place of the picture."""
    if place == grip.offset:
        return []
    return _stroke(context, grip, sample_path([grip.offset, place], context.state.brush.radius), place)


def _stroke(context: PanelContext, grip: PaintGrip, places: list[Point], end: Point) -> list[Action]:
    """Dabs at places that see the selected object; over nothing there is no stroke."""
    key, brush = painting_layer_key(context), context.state.brush
    if key is None:
        return [EndDrag(), HoldGrip(None)]
    name = object_of(key)
    spots = spots_at(lambda x, y: context.spot_at(x, y) if context.object_at(x, y) == name else None, places)
    if not spots:
        return [HoldGrip(replace(grip, offset=end))]
    metres = grip.metres or brush.radius * spots[0].metres
    stroke = stroke_at(spots, metres, grip.value, brush.strength, brush.hardness)
    return [Paint(key, stroke, not grip.begun), HoldGrip(replace(grip, offset=end, begun=True, metres=metres))]


def draw_circle(context: PanelContext, scale: float) -> None:
    """The brush's circle about the mouse, and whether it adds; scale: pixels of the screen per pixel of the picture."""
    mouse, brush = imgui.get_mouse_pos(), context.state.brush
    draw_list = imgui.get_window_draw_list()
    radius, line = brush.radius * scale, context.px(1.5)
    held = context.state.grip
    adds = held.value > 0.5 if isinstance(held, PaintGrip) else brush.erases == _is_inverted()
    aside = 0.7071 * radius + context.px(8)
    beside = ImVec2(mouse.x + aside, mouse.y + aside)
    for ink, more in ((look.grey(0, 0.55), line), (look.grey(245), 0.0)):
        draw_list.add_circle(mouse, radius + 0.5 * more, look.pack(ink), 0, line + more)
        _sign(draw_list, beside, context.px(4) + 0.5 * more, adds, look.pack(ink), line + more)


def _sign(draw_list: imgui.ImDrawList, centre: ImVec2, size: float, adds: bool, ink: int, wide: float) -> None:
    draw_list.add_line(ImVec2(centre.x - size, centre.y), ImVec2(centre.x + size, centre.y), ink, wide)
    if adds:
        draw_list.add_line(ImVec2(centre.x, centre.y - size), ImVec2(centre.x, centre.y + size), ink, wide)
