"""Pairs of points that align the camera to a photograph: a click on a point of the picture, then one on the same point
of the photograph, which is a stored picture and takes the picture's place meanwhile."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from imgui_bundle import ImVec2, imgui

from app.photo.match_settings import MatchSettings, PhotoPair
from engine.core.camera import project
from engine.inverse.camera_fit import LEAST_PAIRS
from ui import theme as look
from ui.panels import pair_picking, picture_overlays, stored_pictures, widgets
from ui.panels.actions import Action, HoldGrip, SetPanel
from ui.panels.context import PanelContext
from ui.panels.pictures import Picture
from ui.panels.viewport_layout import PictureRect
from ui.panels.window_state import Grip, StatusMessage
from ui.theme import Icon

MARK = 5.0
CAMERAS = (
    ("As it is", "The photograph was taken by the scene's camera."),
    ("By points", "The camera is aligned by four or more points whose places in the photograph you show."),
)
FIRST = "Click a point in the picture"
SECOND = "Click the same point in the photograph"


def shows_photo(context: PanelContext) -> bool:
    """Whether the photograph is in the picture's place."""
    settings = context.state.match
    if settings is None or stored_pictures.overlay(context) != "stored":
        return False
    return context.view.stored in context.stored_names_of(settings.file)


def pick(context: PanelContext, picture: Picture, placed: PictureRect) -> list[Action]:
    """A click on the picture, or on the photograph."""
    settings, picking, mouse = context.state.match, context.state.picking, imgui.get_mouse_pos()
    pixel = placed.pixel(mouse.x, mouse.y, picture)
    hold: list[Action] = [HoldGrip(Grip("pair", (0.0, 0.0)))]
    # The second click of a double click would take the place in the picture for that in the photograph.
    is_double = imgui.is_mouse_double_clicked(imgui.MouseButton_.left)
    if settings is None or picking is None or pixel is None or is_double:
        return hold
    if not picking.photo:
        return [_message(context, f"{picking.file.name} is still being read"), *hold]
    if picking.point is not None and shows_photo(context):
        photo = stored_pictures.stored_place(context, placed)
        place = (mouse.x - photo.x) / photo.width, (mouse.y - photo.y) / photo.height
        if not (0.0 <= place[0] <= 1.0 and 0.0 <= place[1] <= 1.0):
            return hold
        pairs = (*settings.pairs, PhotoPair(place, picking.point))
        return [SetPanel({"match": replace(settings, pairs=pairs)}), *pair_picking.go_on(picking, None), *hold]
    if stored_pictures.overlay(context) is not None:  # chosen in the strip: back to what is to be clicked
        return [*pair_picking.go_on(picking, picking.point), *hold]
    spot = context.spot_at(*pixel)
    if spot is None or context.status.is_away:
        return [_message(context, "there is no surface of the scene there"), *hold]
    x, y, z = (float(value) for value in spot.place)
    return [*pair_picking.go_on(picking, (x, y, z)), *hold]


def _message(context: PanelContext, text: str) -> Action:
    return SetPanel({"message": StatusMessage(text, context.now)})


def draw_marks(context: PanelContext, placed: PictureRect) -> None:
    """A numbered ring at each point of the picture, or each place of the photograph."""
    settings, camera = context.state.match, context.picture_camera
    if settings is None or context.state.picking is None or camera is None:
        return
    if shows_photo(context):
        placed = stored_pictures.stored_place(context, placed)
        places = [pair.place for pair in settings.pairs]
    else:
        points = np.array([pair.point for pair in settings.pairs]).reshape(-1, 3)
        size = 1000, max(round(1000 * placed.height / max(placed.width, 1.0)), 1)
        seen = project(camera, size, points - np.array(camera.position)) / np.array(size)
        places = [(float(u), float(v)) for u, v in seen]
    draw_list = imgui.get_window_draw_list()
    for number, (u, v) in enumerate(places, 1):
        at = ImVec2(placed.x + u * placed.width, placed.y + v * placed.height)
        context.handles.note(f"viewport.pair.{number}", at.x, at.y)
        for ink, width in ((look.grey(0, 0.8), 3.0), (look.ACCENT, 1.5)):
            draw_list.add_circle(at, context.px(MARK), look.pack(ink), 0, context.px(width))
        beside = ImVec2(at.x + context.px(MARK + 8.0), at.y - context.px(9))
        picture_overlays.plate(context, draw_list, beside, str(number), look.TEXT)


# ------------------------------------------------------------------------------------------------------------ the panel


def draw(context: PanelContext, settings: MatchSettings, label: float, missed: tuple[float, ...]) -> list[Action]:
    """The rows of the panel: whether the camera is aligned, and the pairs; missed: by how much each was, pixels."""
    widgets.label(context, "Camera", label)
    picking = context.state.picking
    picks = picking is not None
    pressed = widgets.segments(context, "match.camera", CAMERAS, int(picks or bool(settings.pairs)))
    if pressed == 0:
        return [SetPanel({"match": replace(settings, pairs=())}), *pair_picking.leave(context)]
    if pressed == 1 and not picks:
        return pair_picking.begin(context, settings.file)
    if not picks and not settings.pairs:
        return []
    actions: list[Action] = []
    if picking is not None:
        widgets.label(context, "", label)
        widgets.caption(FIRST if picking.point is None else SECOND)
    for number, pair in enumerate(settings.pairs):
        widgets.label(context, f"Point {number + 1}", label)
        x, y, z = (round(each, 2) + 0.0 for each in pair.point)  # no -0.00
        off = f"   {missed[number]:.2g} px off" if len(missed) == len(settings.pairs) else ""
        imgui.align_text_to_frame_padding()
        imgui.text_disabled(f"{x:.2f}, {y:.2f}, {z:.2f}{off}")
        imgui.same_line()
        widgets.align_right(imgui.get_frame_height())
        if widgets.icon_button(context, f"match.pair.{number}", Icon.CLOSE, "Remove this pair."):
            rest = tuple(each for i, each in enumerate(settings.pairs) if i != number)
            actions.append(SetPanel({"match": replace(settings, pairs=rest)}))
    return actions


def are_enough(context: PanelContext, settings: MatchSettings) -> bool:
    """Whether the camera can be aligned, or need not be."""
    wants = context.state.picking is not None or bool(settings.pairs)
    return not wants or len(settings.pairs) >= LEAST_PAIRS
