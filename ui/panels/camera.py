"""The camera's controls over the picture: lens, horizon, the picture's size, and bookmarked views.

They are in the picture's upper right corner; the picture under them stays usable.
"""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.document.view_state import Bookmark, SetView, Viewpoint
from app.files.bookmarks import MAX_NAME, remove_bookmark
from app.operators.registry import keys_of
from engine.scene.camera_moves import FOCAL_LENGTH, focal_length, is_level, with_focal_length
from engine.scene.description import MAX_RESOLUTION
from ui import theme as look
from ui.panels import rows, widgets
from ui.panels.actions import Action, BeginCameraDrag, DragCamera, EndCameraDrag, MoveCameraTo, RunOperator, SetPanel
from ui.panels.context import PanelContext
from ui.panels.window_operators import perform
from ui.theme import Icon

WIDTH, LABEL_WIDTH, GAP = 264.0, 58.0, 6.0
THUMBNAIL, LEAST_LIST, MARGIN = (64.0, 48.0), 60.0, 10.0
CAMERA_DRAG = (BeginCameraDrag("focal length"), EndCameraDrag())


def draw(context: PanelContext, corner: ImVec2, room: ImVec2) -> list[Action]:
    """The controls, where they are switched on and the picture's panel, from its corner, has room for them."""
    if not context.state.shows_camera or not context.document.objects or room.x < context.px(WIDTH + 2 * MARGIN):
        return []
    actions: list[Action] = []
    at = ImVec2(corner.x + room.x - context.px(MARGIN), corner.y + context.px(MARGIN))
    with widgets.strip(context, "Camera###camera", at, ImVec2(1.0, 0.0), ImVec2(10, 8)) as is_seen:
        if is_seen:
            imgui.dummy(ImVec2(context.px(WIDTH - 20), 0))
            actions += _title(context) + _lens(context) + _horizon(context) + _size(context, room)
            actions += _views(context, corner.y + room.y - context.px(2 * MARGIN))
    return actions


def _title(context: PanelContext) -> list[Action]:
    context.theme.push_bold()
    imgui.align_text_to_frame_padding()
    imgui.text_unformatted("Camera")
    imgui.pop_font()
    widgets.same_line_at_right(2 * imgui.get_frame_height() + context.px(GAP))
    actions: list[Action] = []
    hint = f"Back to the scene's own camera. ({keys_of('own_view')})"
    if widgets.icon_button(context, "camera.reset", Icon.RESET, hint, enabled=context.camera != context.own_camera):
        actions += perform(context, "own_view")
    imgui.same_line(0.0, context.px(GAP))
    if widgets.icon_button(context, "camera.close", Icon.CLOSE, f"Close this. ({keys_of('camera_panel')})"):
        actions.append(SetPanel({"shows_camera": False, "renames": None}))
    return actions


def _lens(context: PanelContext) -> list[Action]:
    camera, own = context.camera, focal_length(context.own_camera.fov_y)

    def set_focal_length(focal: float) -> Action:
        back = camera.model_copy(update={"fov_y": context.own_camera.fov_y})  # to the last bit
        moved = back if focal == own else with_focal_length(camera, focal)
        return DragCamera(Viewpoint(moved, context.view.resolution))

    row = rows.Row(
        FOCAL_LENGTH, focal_length(camera.fov_y), set_focal_length, "camera.focal", own, CAMERA_DRAG, own,
        note=f"Here {camera.fov_y:.1f}° upright.",
    )  # fmt: skip
    return rows.draw(context, row, LABEL_WIDTH)


def _horizon(context: PanelContext) -> list[Action]:
    widgets.label(context, "Horizon", LABEL_WIDTH)
    level = is_level(context.camera)
    hint = "Turn the camera about its line of sight until the horizon is level. Orbiting keeps it level."
    if widgets.text_button(context, "camera.level", "Is level" if level else "Level", hint, enabled=not level):
        return perform(context, "level")
    return []


def _size(context: PanelContext, room: ImVec2) -> list[Action]:
    """The picture's resolution: the scene's own, its panel's, or any."""
    widgets.label(context, "Picture", LABEL_WIDTH)
    panel = (min(max(round(room.x), 1), MAX_RESOLUTION), min(max(round(room.y), 1), MAX_RESOLUTION))
    size, own = context.resolution, context.own_resolution
    choices = (
        ("Scene", f"The scene's own: {own[0]} x {own[1]} pixels."),
        ("Panel", f"As large as the panel: {panel[0]} x {panel[1]} pixels."),
        (f"{size[0]} x {size[1]}…", "Any size, with its cost."),
    )
    chosen = 0 if size == own else 1 if size == panel else 2
    pressed = widgets.segments(context, "camera.size", choices, chosen)
    if pressed == 2:
        return [SetPanel({"resolution": size})]
    return [] if pressed is None else [RunOperator("resolution", (own, panel)[pressed])]


# ---------------------------------------------------------------------------------------------------------------- views


def _views(context: PanelContext, foot: float) -> list[Action]:
    """The list of bookmarked views, as high as there is room above `foot`, and a button that bookmarks this one."""
    imgui.spacing()
    actions: list[Action] = []
    bookmarks = context.view.bookmarks
    if bookmarks:
        row = context.px(THUMBNAIL[1]) + imgui.get_style().item_spacing.y
        room = foot - imgui.get_cursor_screen_pos().y - imgui.get_frame_height() - context.px(2 * GAP)
        height = min(len(bookmarks) * row, max(room, context.px(LEAST_LIST)))
        if imgui.begin_child("views", ImVec2(context.px(WIDTH - 20), height)):
            for bookmark in bookmarks:
                actions += _view(context, bookmark)
        imgui.end_child()
    if widgets.text_button(
        context, "camera.save_view", f"{Icon.ADD}  Save this view", "Save it under a name, in the session."
    ):
        actions.append(RunOperator("save_view"))
    return actions


def _view(context: PanelContext, bookmark: Bookmark) -> list[Action]:
    """A row: the thumbnail, which goes to the view, the name, and the view's buttons."""
    name = bookmark.name
    imgui.push_id(name)
    actions: list[Action] = []
    corner, size = imgui.get_cursor_screen_pos(), ImVec2(*map(context.px, THUMBNAIL))
    if imgui.invisible_button("go", size):
        actions.append(MoveCameraTo(bookmark.viewpoint, name))
    context.handles.note_item(f"camera.view.{name}")
    is_here = _is_current_view(context, bookmark)
    _thumbnail(context, bookmark, corner, size, imgui.is_item_hovered() or is_here)
    widgets.tooltip("The camera is here." if is_here else "Go there. A view that was computed before shows at once.")
    imgui.same_line(0.0, context.px(GAP + 2))
    imgui.begin_group()
    actions += _name(context, name) if context.state.renames == name else _title_of(context, name)
    if widgets.icon_button(context, f"camera.update.{name}", Icon.CAMERA, f"Set {name} to this view.", not is_here):
        actions.append(RunOperator("save_view", name))
    imgui.same_line(0.0, 0.0)
    if widgets.icon_button(context, f"camera.rename.{name}", Icon.EDITABLE, "Rename it."):
        actions.append(SetPanel({"renames": name}))
    imgui.same_line(0.0, 0.0)
    if widgets.icon_button(context, f"camera.delete.{name}", Icon.DELETE, f"Delete {name}."):
        actions.append(SetView.of(bookmarks=remove_bookmark(context.view.bookmarks, name)))
    imgui.end_group()
    imgui.pop_id()
    return actions


def _is_current_view(context: PanelContext, bookmark: Bookmark) -> bool:
    camera, resolution = bookmark.viewpoint
    return (camera or context.own_camera, resolution or context.own_resolution) == (context.camera, context.resolution)


def _title_of(context: PanelContext, name: str) -> list[Action]:
    imgui.text_unformatted(widgets.fitting(name, imgui.get_content_region_avail().x))
    double = imgui.is_item_hovered() and imgui.is_mouse_double_clicked(0)
    return [SetPanel({"renames": name})] if double else []


def _name(context: PanelContext, name: str) -> list[Action]:
    """The name as text; Enter accepts it, and so does a click elsewhere."""
    imgui.set_next_item_width(-1.0)
    if imgui.get_io().want_text_input is False:
        imgui.set_keyboard_focus_here()
    _, typed = imgui.input_text("##name", name, imgui.InputTextFlags_.auto_select_all)
    context.handles.note_item("camera.name")
    if not imgui.is_item_deactivated():
        return []
    new = typed.strip()[: MAX_NAME + 1]
    close = SetPanel({"renames": None})
    is_renamed = imgui.is_item_deactivated_after_edit() and new != name
    return [RunOperator("rename_view", (name, new)), close] if is_renamed else [close]


def _thumbnail(context: PanelContext, bookmark: Bookmark, corner: ImVec2, size: ImVec2, lit: bool) -> None:
    draw_list, rounding = imgui.get_window_draw_list(), context.px(3)
    end = ImVec2(corner.x + size.x, corner.y + size.y)
    draw_list.add_rect_filled(corner, end, look.pack(look.WELL), rounding)
    picture = context.view_thumbnail(bookmark)
    if picture is not None:
        scale = min(size.x / picture.width, size.y / picture.height)
        width, height = scale * picture.width, scale * picture.height
        start = ImVec2(corner.x + 0.5 * (size.x - width), corner.y + 0.5 * (size.y - height))
        upper, lower = picture.corners()
        draw_list.add_image(picture.reference, start, ImVec2(start.x + width, start.y + height), upper, lower)
    else:
        extent = imgui.calc_text_size(Icon.CAMERA)
        place = ImVec2(0.5 * (corner.x + end.x - extent.x), 0.5 * (corner.y + end.y - extent.y))
        draw_list.add_text(place, look.pack(look.TEXT_FAINT), Icon.CAMERA)
    if lit:
        draw_list.add_rect(corner, end, look.pack(look.ACCENT), rounding, context.px(1.5))
