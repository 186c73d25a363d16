"""The picture: click selects, hover names, Shift-drag rotates the light, A/B divider; gestures move the camera over
it."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.document.commands.light import SetRotation
from app.document.selection import clicked, solo_layer, toggled
from app.document.view_state import LIGHTING_WORDS, SetView
from app.messages.editor_status import Status
from app.operators.registry import keys_of
from app.system.lazy_import import import_named
from engine.core.errors import list_names
from engine.material.layer import object_of
from ui import theme as look
from ui.panels import (
    box_select,
    camera,
    gizmo,
    grab,
    highlight,
    inspection,
    lamp_handles,
    light_by_hand,
    look_panes,
    paint,
    photo_pairs,
    picture_handles,
    picture_marks,
    picture_overlays,
    scopes,
    stored_pictures,
    sun_handles,
    viewport_header,
    widgets,
)
from ui.panels.actions import Action, BeginDrag, EndDrag, HoldGrip, RunOperator, SetPanel
from ui.panels.context import PanelContext
from ui.panels.library import apply, dropped_material
from ui.panels.picture_handles import PictureHandle
from ui.panels.pictures import Picture
from ui.panels.viewport_layout import PAN, PictureRect, ViewportRect, gestures, viewport_rect
from ui.panels.window_state import BoxGrip, Grip, HighlightGrip, LightGrip, PaintedGrip, PaintGrip
from ui.theme import Icon

DEGREES_PER_PIXEL = 0.5
DIVIDER_REACH, CLICK_REACH = 7.0, 3.0
TURN_OR_CLICK = "rotation or click"  # with Shift: a drag turns the light, a click selects as well
LEGEND_WIDTH = 230.0
BELOW = 0.9  # of the panel's height: where a label hides little of the picture
ERROR_LEGEND = "Error, relative to the mean"
ERROR_AWAITED = "Estimating the error…"
ERROR_UNKNOWN = "No error estimate"


def draw(context: PanelContext) -> list[Action]:
    """The whole panel, inside its window."""
    corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    draw_list = imgui.get_window_draw_list()
    end = ImVec2(corner.x + room.x, corner.y + room.y)
    if not imgui.is_window_docked():
        draw_list.add_rect_filled(corner, end, look.pack(look.BACKDROP))
    if room.x < 8 or room.y < 8:
        return []
    taken, below = import_named(context.mode.strip)(context, corner, room) if context.mode.strip else (0.0, [])
    left = ImVec2(room.x, room.y - taken)
    if context.view.looks_shown > 1:
        return look_panes.draw(look_panes.with_stand_in(context), corner, left, _draw_picture) + below
    return _draw_picture(context, corner, left) + below


def _draw_picture(context: PanelContext, corner: ImVec2, room: ImVec2) -> list[Action]:
    """The picture in its rectangle."""
    end, draw_list = ImVec2(corner.x + room.x, corner.y + room.y), imgui.get_window_draw_list()
    imgui.invisible_button("picture", room)
    context.handles.note_item("viewport.centre")
    picture = context.picture
    if picture is None:
        _draw_waiting(context, corner, room, 0.5)
        return []
    space = viewport_rect(corner, room, picture)
    placed = space.place(context.view)
    draw_list.push_clip_rect(corner, end, True)
    upper, lower = picture.corners()
    far = ImVec2(placed.x + placed.width, placed.y + placed.height)
    draw_list.add_image(picture.reference, ImVec2(placed.x, placed.y), far, upper, lower)
    if inspection.shows_error(context) and context.error_overlay is not None:
        # Right of the divider: the other picture has errors of its own.
        share = 0.0 if context.view.compare is None else context.view.compare_divider
        start = ImVec2(placed.x + share * placed.width, placed.y)
        draw_list.add_image(context.error_overlay.reference, start, far, ImVec2(share, 0), ImVec2(1, 1))
    if context.highlight_overlay is not None:
        draw_list.add_image(context.highlight_overlay.reference, ImVec2(placed.x, placed.y), far)
    stored_pictures.draw_over_picture(context, placed)
    picture_overlays.draw_sketch(context, placed, picture)
    picture_marks.draw_crop(context, placed)
    handles = [*picture_handles.handles_of(context, placed), *gizmo.handles(context, placed)]
    handles += [*sun_handles.handles(context, placed), *lamp_handles.handles(context, placed)]
    handles = [] if context.state.draws_crop else handles
    picture_handles.draw_handles(context, handles)
    inspection.draw_grid(context, space, placed)
    picture_marks.draw_probes(context, placed)
    photo_pairs.draw_marks(context, placed)
    actions = [*inspection.magnify(context, space, placed), *picture_marks.pin(context, placed, picture)]
    actions += _gestures(context, picture, space, placed, handles)
    if _is_divided(context):
        _draw_divider(context, placed, corner.y, end.y)
    picture_overlays.draw_lobe(context, placed.x, placed.y, placed.scale)
    _draw_labels(context, ImVec2(max(placed.x, corner.x), max(placed.y, corner.y)), room)
    _draw_zoom(context, end)
    inspection.draw_stops_legend(context, end)
    if inspection.shows_error(context) or stored_pictures.legend(context):
        low = min(placed.y + placed.height, end.y - scopes.height(context, room))  # above the scopes
        _draw_error_legend(context, ImVec2(max(placed.x, corner.x), low))
    if context.status.picture == "waiting":
        _draw_waiting(context, corner, room, BELOW)
    draw_list.pop_clip_rect()
    return actions


def _gestures(
    context: PanelContext, picture: Picture, space: ViewportRect, placed: PictureRect, handles: list[PictureHandle]
) -> list[Action]:
    """Gestures over the picture: they move the camera, or the picture in its panel, or act on the scene."""
    if grab.is_under_way(context):
        return grab.go_on(context, placed)
    if isinstance(context.state.grip, BoxGrip):
        return box_select.go_on(context, placed, picture)
    moved = camera.navigate(context, placed, picture)
    if moved is not None:
        clicked = camera.was_a_click(context, moved)
        return [*moved, *_pick_lobe(context, picture, placed)] if clicked else moved
    return gestures(context, space, placed) or _interact(context, picture, placed, handles)


def _is_divided(context: PanelContext) -> bool:
    """Whether a divider is between two pictures."""
    return context.view.compare is not None or stored_pictures.is_split(context)


def divider_x(context: PanelContext, placed: PictureRect) -> float:
    """Screen column of the A/B divider."""
    return placed.x + context.view.compare_divider * placed.width


def _interact(
    context: PanelContext, picture: Picture, placed: PictureRect, handles: list[PictureHandle]
) -> list[Action]:
    mouse = imgui.get_mouse_pos()
    grip = context.state.grip
    comparing = _is_divided(context)
    on_divider = (
        comparing
        and not context.state.draws_crop
        and abs(mouse.x - divider_x(context, placed)) <= context.px(DIVIDER_REACH)
    )
    if comparing:
        context.handles.note("viewport.divider", divider_x(context, placed), placed.y + 0.5 * placed.height)
    context.handles.note("viewport.corner", placed.x, placed.y)
    actions: list[Action] = []
    if grip is not None and grip.handle.startswith(PAN):
        return actions
    handle = picture_handles.held_handle(context, handles) or picture_handles.under_mouse(context, handles)
    if handle is not None and imgui.is_item_hovered() and grip is None:
        picture_handles.hover(handle)
        actions += [SetView.of(hovered=None)] if context.view.hovered is not None else []
    elif imgui.is_item_hovered() and grip is None:
        actions += _hover(context, picture, placed, on_divider)
    elif context.view.hovered is not None and not imgui.is_item_active():
        actions.append(SetView.of(hovered=None))
    if imgui.is_item_activated() and handle is not None:
        actions += picture_handles.take_hold(handle)
    elif imgui.is_item_activated():
        actions += _take_hold(context, picture, placed, on_divider)
    elif imgui.is_item_active() and grip is not None and handle is not None and handle.name == grip.handle:
        actions += picture_handles.drag_actions(context, handle)
    elif imgui.is_item_active() and grip is not None:
        actions += _drag(context, picture, placed, grip, mouse)
    if imgui.is_item_deactivated() and isinstance(grip, HighlightGrip):
        actions += highlight.end()
    elif imgui.is_item_deactivated() and grip is not None:
        if isinstance(grip, LightGrip | PaintedGrip):
            actions += light_by_hand.end(context, grip, placed.pixel(mouse.x, mouse.y, picture))
        actions += [EndDrag(), HoldGrip(None), *(picture_marks.end_crop() if grip.handle == picture_marks.CROP else [])]
        if grip.handle == TURN_OR_CLICK:
            actions += _toggle(context, _object_at(context, placed.pixel(mouse.x, mouse.y, picture)))
    return actions + _drop(context, picture, placed)


def _drop(context: PanelContext, picture: Picture, placed: PictureRect) -> list[Action]:
    """A material of the library over the picture: the object that would get it is outlined, and gets it when
    dropped."""
    if not imgui.begin_drag_drop_target():
        return []
    mouse = imgui.get_mouse_pos()
    pixel = placed.pixel(mouse.x, mouse.y, picture)
    name = context.object_at(*pixel) if pixel else None
    actions: list[Action] = [SetView.of(hovered=name)] if name != context.view.hovered else []
    entry = dropped_material(context) if name else None
    if entry is not None and name:
        actions += [apply(entry, name), RunOperator("select", name), SetView.of(hovered=None)]
    imgui.end_drag_drop_target()
    return actions


def _hover(context: PanelContext, picture: Picture, placed: PictureRect, on_divider: bool) -> list[Action]:
    if context.state.draws_crop:
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
        return []
    if on_divider:
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
        widgets.tooltip(_comparison_hint(context))
        return []
    if _turns_light():
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
        return []
    if highlight.is_on(context):
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
        highlight.draw_circle(context, placed.scale)
        return [SetView.of(hovered=None)] if context.view.hovered is not None else []
    if paint.painting_layer_key(context) is not None:
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
        paint.draw_circle(context, placed.scale)
        return [SetView.of(hovered=None)] if context.view.hovered is not None else []
    state = context.state
    if imgui.get_io().key_alt or state.picks_lobe or state.picking or light_by_hand.is_placing(context):
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
    mouse = imgui.get_mouse_pos()
    is_photo = state.picking is not None and photo_pairs.shows_photo(context)
    name = None if is_photo else _object_at(context, placed.pixel(mouse.x, mouse.y, picture))
    # At once, without a tooltip's delay.
    place = ImVec2(mouse.x + context.px(14), mouse.y + context.px(12))
    pixel, copied = placed.pixel(mouse.x, mouse.y, picture), []
    if pixel is not None and (state.shows_values or state.copies_values):
        copied = inspection.draw_values(context, pixel, name or "")
    elif name:
        picture_overlays.plate(context, imgui.get_foreground_draw_list(), place, name, look.TEXT)
    return [SetView.of(hovered=name), *copied] if name != context.view.hovered else copied


def _turns_light() -> bool:
    """Whether a drag rotates the environment; with Alt, too, it is the lobe's."""
    io = imgui.get_io()
    return bool(io.key_shift and not io.key_alt)


def _comparison_hint(context: PanelContext) -> str:
    if stored_pictures.is_split(context):
        return f"Left: {context.view.stored}. Right: the present picture."
    text = "Left: the saved picture (A). Right: the current one (B)."
    if context.status.compared_exact:
        return text
    return f"{text} A is a preview: it becomes exact with B, while the light and the roughness are the same."


def _take_hold(context: PanelContext, picture: Picture, placed: PictureRect, on_divider: bool) -> list[Action]:
    mouse = imgui.get_mouse_pos()
    if context.state.draws_crop:
        return picture_marks.begin_crop(placed, mouse)
    if context.state.picking:
        return photo_pairs.pick(context, picture, placed)
    if on_divider:
        return [HoldGrip(Grip("divider", (mouse.x - divider_x(context, placed), 0.0)))]
    if _turns_light():
        grip = Grip(TURN_OR_CLICK, (mouse.x, context.document.light.rotation))
        return [BeginDrag("rotate the environment"), HoldGrip(grip)]
    if highlight.is_on(context):
        highlight.draw_circle(context, placed.scale)
        return highlight.begin(context, placed.point(mouse.x, mouse.y))
    if paint.painting_layer_key(context) is not None:
        paint.draw_circle(context, placed.scale)
        return paint.begin(context, placed.point(mouse.x, mouse.y))
    if light_by_hand.is_placing(context):
        return light_by_hand.begin(context, placed.pixel(mouse.x, mouse.y, picture))
    if imgui.get_io().key_alt or context.state.picks_lobe:
        picked = _pick_lobe(context, picture, placed)
        return [*picked, SetPanel({"picks_lobe": False}), HoldGrip(Grip("lobe", (0.0, 0.0)))]
    name = _object_at(context, placed.pixel(mouse.x, mouse.y, picture))
    if imgui.get_io().key_ctrl:
        return _toggle(context, name)
    if name is None or imgui.is_mouse_double_clicked(imgui.MouseButton_.left):
        return [RunOperator("select", name)]
    return [RunOperator("select", clicked(context.document, context.view, name))]


def _toggle(context: PanelContext, name: str | None) -> list[Action]:
    """Select an object as well, with the others of its group, or no longer."""
    if name is None:
        return []
    return [RunOperator("select", toggled(context.view, *clicked(context.document, context.view, name)))]


def _object_at(context: PanelContext, pixel: tuple[int, int] | None) -> str | None:
    """The object at a pixel; None where the picture has moved on from the traced view."""
    status = context.status
    is_turned = status.draws_moving and picture_overlays.has_moved(context)
    has_moved_on = status.is_away and (status.follows_input or is_turned)
    return None if pixel is None or has_moved_on else context.object_at(*pixel)


def _pick_lobe(context: PanelContext, picture: Picture, placed: PictureRect) -> list[Action]:
    """The lobe of what is under the mouse, of the object's selected layer; none beside all objects."""
    mouse = imgui.get_mouse_pos()
    pixel = placed.pixel(mouse.x, mouse.y, picture)
    name = context.object_at(*pixel) if pixel else None
    if name is None:
        return [SetView.of(lobe_pixel=None)]
    selected = context.view.selected
    other: list[Action] = [] if selected is not None and selected.object == name else [RunOperator("select", name)]
    return [*other, SetView.of(lobe_pixel=pixel)] if pixel != context.view.lobe_pixel else other


def _drag(context: PanelContext, picture: Picture, placed: PictureRect, grip: Grip, mouse: ImVec2) -> list[Action]:
    if isinstance(grip, HighlightGrip):
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
        highlight.draw_circle(context, placed.scale)
        return highlight.go_on(context, grip, placed.point(mouse.x, mouse.y))
    if isinstance(grip, PaintGrip):
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
        paint.draw_circle(context, placed.scale)
        return paint.go_on(context, grip, placed.point(mouse.x, mouse.y))
    if isinstance(grip, LightGrip | PaintedGrip):
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)
        return light_by_hand.go_on(context, grip, placed.pixel(mouse.x, mouse.y, picture))
    if grip.handle == picture_marks.CROP:
        return picture_marks.drag_crop(placed, grip, mouse)
    if grip.handle == "divider":
        share = (mouse.x - grip.offset[0] - placed.x) / max(placed.width, 1.0)
        return [SetView.of(compare_divider=share)]
    if grip.handle == TURN_OR_CLICK and abs(mouse.x - grip.offset[0]) > context.px(CLICK_REACH):
        return [HoldGrip(Grip("rotation", (mouse.x, grip.offset[1])))]
    if grip.handle == "rotation":
        turn = (mouse.x - grip.offset[0]) / context.theme.scale * DEGREES_PER_PIXEL
        return [SetRotation(grip.offset[1] - turn)]
    return _pick_lobe(context, picture, placed) if grip.handle == "lobe" else []


def _draw_divider(context: PanelContext, placed: PictureRect, upper: float, lower: float) -> None:
    """The divider with its handle and letters, within the visible part of the picture."""
    draw_list = imgui.get_window_draw_list()
    x = round(divider_x(context, placed)) + 0.5
    top, bottom = max(placed.y, upper), min(placed.y + placed.height, lower)
    draw_list.add_line(ImVec2(x, top), ImVec2(x, bottom), look.pack(look.grey(0, 0.55)), context.px(3))
    draw_list.add_line(ImVec2(x, top), ImVec2(x, bottom), look.pack(look.grey(240)), context.px(1))
    middle = ImVec2(x, 0.5 * (top + bottom))
    draw_list.add_circle_filled(middle, context.px(9), look.pack(look.grey(240)))
    size = context.px(4)
    for side in (-1.0, 1.0):
        tip = ImVec2(middle.x + side * 1.5 * size, middle.y)
        back = middle.x + side * 0.5 * size
        draw_list.add_triangle_filled(tip, ImVec2(back, middle.y - 0.8 * size), ImVec2(back, middle.y + 0.8 * size),
                                      look.pack(look.grey(40)))  # fmt: skip
    names = ("A" if context.status.compared_exact else "preview  A", "B")
    if stored_pictures.is_split(context):
        names = context.view.stored, "Now"
    for text, side in zip(names, (-1.0, 1.0), strict=True):
        extent = imgui.calc_text_size(text)
        near = x + side * context.px(14)
        # The strip of a stored picture is at the upper edge.
        y = bottom - context.px(10) - extent.y if context.view.stored else top + context.px(10)
        spot = ImVec2(near if side > 0.0 else near - extent.x, y)
        pad = context.px(5)
        far = ImVec2(spot.x + extent.x + pad, spot.y + extent.y + 2)
        draw_list.add_rect_filled(ImVec2(spot.x - pad, spot.y - 2), far, look.pack(look.grey(20, 0.75)), context.px(4))
        draw_list.add_text(spot, look.pack(look.TEXT), text)


def _draw_zoom(context: PanelContext, end: ImVec2) -> None:
    """The zoom of the picture, where it is neither fitted nor pixel for pixel."""
    if context.view.fit or context.view.zoom == 1.0:
        return
    text = f"{context.view.zoom:.0%}"
    extent, pad = imgui.calc_text_size(text), context.px(12)
    beside = context.px(inspection.LEGEND_WIDTH) + 2.0 * pad if inspection.shows_stops(context) else 0.0
    place = ImVec2(end.x - extent.x - pad - beside, end.y - extent.y - pad)
    context.handles.note("viewport.zoom", place.x + extent.x, place.y)
    picture_overlays.plate(context, imgui.get_window_draw_list(), place, text, look.TEXT_SOFT)


def error_missing(status: Status) -> str:
    """The message where there are no false colours to show."""
    if status.no_estimate_reason:
        return status.no_estimate_reason
    return ERROR_AWAITED if status.image_error is not None or status.is_finished else ERROR_UNKNOWN


def _draw_error_legend(context: PanelContext, corner: ImVec2) -> None:
    """The legend of the false colours over the picture, above its lower left corner; or why there are none."""
    pad, width, of_difference = context.px(12), context.px(LEGEND_WIDTH), stored_pictures.legend(context)
    known = bool(of_difference) or context.error_overlay is not None
    words = of_difference or (ERROR_LEGEND if known else error_missing(context.status))
    width = max(width, imgui.calc_text_size(words).x)
    line, bar = imgui.get_text_line_height(), picture_overlays.legend_height(context) + 0.3 * pad if known else 0.0
    place = ImVec2(corner.x + pad, corner.y - 1.5 * pad - line - bar)
    draw_list = imgui.get_window_draw_list()
    if not known:
        picture_overlays.plate(context, draw_list, place, words, look.TEXT)
        return
    low = ImVec2(place.x - 0.5 * pad, place.y - 0.3 * pad)
    high = ImVec2(place.x + width + 0.5 * pad, place.y + line + bar + 0.3 * pad)
    draw_list.add_rect_filled(low, high, look.pack(look.grey(26, 0.88)), context.px(4))
    draw_list.add_text(place, look.pack(look.TEXT), words)
    context.handles.note("viewport.errors", place.x, place.y)
    draw_bar = stored_pictures.draw_legend if of_difference else picture_overlays.draw_legend
    draw_bar(context, draw_list, ImVec2(place.x, place.y + line + 0.3 * pad), width)


def _draw_labels(context: PanelContext, corner: ImVec2, room: ImVec2) -> None:
    """Labels that the light is not that in place, and that layers or channels are hidden, so that the picture is not
    taken for the whole material's in its place."""
    view, texts, has_header = context.view, [], viewport_header.is_shown(context, room)
    if view.lighting != "scene" and view.mode == "placement":
        texts.append(f"{Icon.EMITTER}  {LIGHTING_WORDS[view.lighting]} ({keys_of('lighting')})")
    if channel := inspection.channel_label(context):
        texts.append(f"{channel} ({keys_of('channel_colour')})")
    if crop := picture_marks.crop_label(context):
        texts.append(crop)
    if note := context.status.catcher_note:
        names = list_names(context.document.shadow_catchers)
        texts.append(f"{Icon.HIDDEN}  {names}: shadow catchers are shown as objects {note}")
    solo = solo_layer(context.document, view)
    if solo is not None:
        texts.append(f"{Icon.SOLO}  {object_of(solo)}: {context.document.layer(solo).name} alone")
    for row, text in enumerate(texts):
        below = 10 + (stored_pictures.HEIGHT if view.stored else 0) + viewport_header.HEIGHT * has_header
        place = ImVec2(corner.x + context.px(12), corner.y + context.px(below + 28 * row))
        picture_overlays.plate(context, imgui.get_window_draw_list(), place, text, look.ACCENT)


def _draw_waiting(context: PanelContext, corner: ImVec2, room: ImVec2, down: float) -> None:
    """Show what the window waits for, as a label so far down: there may be objects behind it, lit from the camera."""
    status = context.status
    text = f"{status.text or status.stage}…" if status.stage else "Starting to compute…"
    extent = imgui.calc_text_size(text)
    place_x, place_y = corner.x + 0.5 * (room.x - extent.x), corner.y + down * room.y - extent.y
    draw_list = imgui.get_window_draw_list()
    width, height, pad = context.px(220), context.px(3), context.px(14)
    left, top = corner.x + 0.5 * (room.x - width), place_y + extent.y + context.px(12)
    upper = ImVec2(min(place_x, left) - pad, place_y - pad)
    lower = ImVec2(max(place_x + extent.x, left + width) + pad, top + height + pad)
    draw_list.add_rect_filled(upper, lower, look.pack(look.grey(28, 0.85)), context.px(6))
    draw_list.add_text(ImVec2(round(place_x), round(place_y)), look.pack(look.TEXT_SOFT), text)
    draw_list.add_rect_filled(ImVec2(left, top), ImVec2(left + width, top + height), look.pack(look.FRAME), height)
    share = context.status.fraction or 0.0
    if share > 0.0:
        draw_list.add_rect_filled(
            ImVec2(left, top), ImVec2(left + max(share * width, height), top + height), look.pack(look.ACCENT), height
        )
