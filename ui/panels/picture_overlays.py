"""What panels draw over the picture: a sketch of the view while the camera moves, the lobe of a pixel, and the legend
of errors.

The sketch: in a mode that draws while something moves, before it has drawn anything, the picture of the view before,
projected onto the plane through the camera's target. In any other the objects' boxes as the camera sees them, over the
view before, darkened. Only while the camera differs from that of the picture, and no mode draws what it sees meanwhile:
another resolution, pose or bump is awaited as well, but from the picture's own camera, which shows it as it is.
"""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from engine.core.camera import camera_frame, pixel_directions, project
from engine.render.display import LEAST_ERROR, MOST_ERROR, error_to_radiance, false_colour
from engine.scene.camera_moves import distance
from engine.scene.description import Camera
from ui import theme as look
from ui.panels.context import PanelContext
from ui.panels.pictures import Picture
from ui.panels.viewport_layout import PictureRect
from ui.surface_lobe import SurfaceLobe

# -------------------------------------------------------------------------------------- the view while the camera moves


# Corners are numbered by bits: 1 for the larger x, 2 for y, 4 for z. Edges join those that differ in one of them.
CORNERS = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)])
EDGES = np.array([(i, i | bit) for bit in (1, 2, 4) for i in range(8) if not i & bit])
NEAREST = 1e-3  # of the distance to the target; a point behind the camera has no place in the picture
MOST_BOXES = 256
N_CELLS = 8  # across a picture that is projected, each drawn without perspective

Float64Array = NDArray[np.float64]


def draw_sketch(context: PanelContext, placed: PictureRect, picture: Picture) -> None:
    """Draw over the picture, in the panel's draw list."""
    if not context.status.is_away or context.status.follows_input or not has_moved(context):
        return
    seen = context.picture_camera
    if context.status.draws_moving and seen is not None:
        _draw_turned(placed, picture, turned_grid(seen, context.camera, (placed.width, placed.height)))
    else:
        _draw_boxes(context, placed)


def _draw_turned(placed: PictureRect, picture: Picture, grid: Float64Array | None) -> None:
    """The picture on a grid of `turned_grid`; as it is where there is none."""
    if grid is None:
        return
    draw_list = imgui.get_window_draw_list()
    start, end = ImVec2(placed.x, placed.y), ImVec2(placed.x + placed.width, placed.y + placed.height)
    draw_list.push_clip_rect(start, end, True)
    draw_list.add_rect_filled(start, end, look.pack(look.grey(0)))
    upper, lower = picture.corners()
    us = np.linspace(upper.x, lower.x, N_CELLS + 1).tolist()
    vs = np.linspace(upper.y, lower.y, N_CELLS + 1).tolist()
    corners = [[ImVec2(x, y) for x, y in row] for row in (grid + (placed.x, placed.y)).tolist()]
    for i, j in np.ndindex(N_CELLS, N_CELLS):
        draw_list.add_image_quad(
            picture.reference, corners[i][j], corners[i][j + 1], corners[i + 1][j + 1], corners[i + 1][j],
            ImVec2(us[j], vs[i]), ImVec2(us[j + 1], vs[i]), ImVec2(us[j + 1], vs[i + 1]), ImVec2(us[j], vs[i + 1]),
        )  # fmt: skip
    draw_list.pop_clip_rect()


def _draw_boxes(context: PanelContext, placed: PictureRect) -> None:
    draw_list = imgui.get_window_draw_list()
    end = ImVec2(placed.x + placed.width, placed.y + placed.height)
    draw_list.add_rect_filled(ImVec2(placed.x, placed.y), end, look.pack(look.grey(0, 0.5)))
    chosen = context.view.selected_objects
    for state in [state for state in context.document.objects if state.visible][:MOST_BOXES]:
        box = context.box_of(state.name)
        is_selected = state.name in chosen
        ink = look.pack(look.ACCENT if is_selected else look.grey(225, 0.8))
        for (x0, y0), (x1, y1) in (
            [] if box is None else visible_edges(box, context.camera, (placed.width, placed.height))
        ):
            start, stop = ImVec2(placed.x + x0, placed.y + y0), ImVec2(placed.x + x1, placed.y + y1)
            draw_list.add_line(start, stop, ink, context.px(2.0 if is_selected else 1.2))


def has_moved(context: PanelContext) -> bool:
    """Whether the camera is not that of the picture."""
    seen = context.picture_camera
    return seen is None or any(getattr(seen, name) != value for name, value in context.camera if name != "resolution")


def turned_grid(seen: Camera, camera: Camera, size: tuple[float, float]) -> Float64Array | None:
    """Where another camera sees points of a picture of so many pixels across and down, N_CELLS + 1 in a row and in a
    column (N_CELLS + 1, N_CELLS + 1, 2), if they are on the plane through its target that faces it; None where the
    other camera sees that plane's back, or a part of it is not in front of the camera."""
    width, height = round(size[0]), round(size[1])
    columns, rows = np.meshgrid(np.linspace(0.0, width, N_CELLS + 1), np.linspace(0.0, height, N_CELLS + 1))
    directions = pixel_directions(seen, (width, height), columns, rows).astype(np.float64)
    forward = camera_frame(seen)[2]
    points = seen.position + directions * (distance(seen) / (directions @ forward))[..., None] - camera.position
    depths = points @ camera_frame(camera)[2]
    if depths.min() < NEAREST * distance(camera) or (points @ forward).max() <= 0.0:
        return None
    return project(camera, (width, height), points)


def visible_edges(box: Float64Array, camera: Camera, size: tuple[float, float]) -> Float64Array:
    """A box (2, 3) as lines (E, 2, 2) in a picture of so many pixels across and down: the parts of its twelve edges
    that are in front of the camera."""
    corners = np.where(CORNERS, box[1], box[0]) - np.array(camera.position)
    ends = corners[EDGES]
    depths = ends @ camera_frame(camera)[2] - NEAREST * distance(camera)
    ends, depths = ends[depths.max(axis=1) > 0.0], depths[depths.max(axis=1) > 0.0]
    share = np.clip(depths[:, :1] / np.where(depths[:, :1] == depths[:, 1:], 1.0, depths[:, :1] - depths[:, 1:]), 0, 1)
    cut = ends[:, 0] + share * (ends[:, 1] - ends[:, 0])
    kept = np.where((depths < 0.0)[..., None], cut[:, None], ends)
    width, height = size
    return project(camera, (round(width), round(height)), kept)


# ------------------------------------------------------------------------------------------- the lobe of a picked pixel


LOBE_SIZE = 110.0


def draw_lobe(context: PanelContext, x: float, y: float, scale: float) -> None:
    """Draw over a picture whose upper left corner is at (x, y), `scale` screen pixels for each of its own."""
    board = context.brdf
    if context.view.lobe_pixel is None:
        return
    board.shown.add("surface")
    lobe = board.surface
    if lobe is None:
        return
    draw_list = imgui.get_window_draw_list()
    places = lobe.pixels(context.px(LOBE_SIZE) / scale) * scale + (x, y)
    base = ImVec2(x + scale * (lobe.point.column + 0.5), y + scale * (lobe.point.row + 0.5))
    context.handles.note("viewport.lobe", base.x, base.y)
    _faces(draw_list, lobe, places)
    _wires(draw_list, places)
    draw_list.add_circle_filled(base, context.px(3), look.pack(look.grey(20)))
    draw_list.add_circle_filled(base, context.px(2), look.pack(look.ACCENT))


def _faces(draw_list: imgui.ImDrawList, lobe: SurfaceLobe, places: np.ndarray) -> None:
    """Quads between neighbouring rings and azimuths; those of no extent are left out."""
    beside = np.roll(places, -1, axis=1)
    corners = np.stack([places[:-1], beside[:-1], beside[1:], places[1:]], axis=2).reshape(-1, 4, 2)
    spread = np.abs(corners - corners[:, :1]).max(axis=(1, 2))
    inks = packed(lobe.shades.reshape(-1, 3))
    for face in lobe.order[spread[lobe.order] > 0.3].tolist():
        one, two, three, four = (ImVec2(*corner) for corner in corners[face].tolist())
        draw_list.add_quad_filled(one, two, three, four, int(inks[face]))


def _wires(draw_list: imgui.ImDrawList, places: np.ndarray) -> None:
    """Some rings, and lines outwards from the normal: the shape is visible on a picture of its own colour."""
    ink = look.pack(look.grey(255, 0.4))
    for ring in places[2::3]:
        draw_list.add_polyline([ImVec2(*place) for place in ring.tolist()], ink, 1.0, int(imgui.ImDrawFlags_.closed))
    for line in np.moveaxis(places, 1, 0)[::5]:
        draw_list.add_polyline([ImVec2(*place) for place in line.tolist()], ink, 1.0, 0)


def packed(colours: np.ndarray, alpha: float = 0.9) -> np.ndarray:
    """Linear colours (N, 3) in [0, 1] as imgui's 32-bit values, sRGB encoded."""
    encoded = np.clip(colours, 0.0, 1.0) ** (1.0 / 2.2)
    red, green, blue = np.rint(255.0 * encoded).astype(np.uint32).T
    return np.asarray(red | green << 8 | blue << 16 | np.uint32(round(255 * alpha)) << 24)


# ---------------------------------------------------------------------------- the legend of the false colours of errors


N_SHADES, TICKS = 32, (0.001, 0.01, 0.1)
BAR = 10.0


def legend_height(context: PanelContext) -> float:
    """The height of the bar and the labels below it, in small type."""
    return context.px(BAR + 2 + look.SMALL_SIZE)


def draw_legend(context: PanelContext, draw_list: imgui.ImDrawList, corner: ImVec2, room: float) -> None:
    """Draw it from an upper left corner, in this width."""
    bar, gap = context.px(BAR), context.px(2)
    shares = np.geomspace(LEAST_ERROR, MOST_ERROR, N_SHADES + 1)
    colours = false_colour(np.repeat(error_to_radiance(np.sqrt(shares[:-1] * shares[1:]))[:, None], 3, axis=1))
    for i, colour in enumerate(colours):
        left, right = corner.x + room * i / N_SHADES, corner.x + room * (i + 1) / N_SHADES
        packed = look.pack((float(colour[0]), float(colour[1]), float(colour[2]), 1.0))
        draw_list.add_rect_filled(ImVec2(left, corner.y), ImVec2(right, corner.y + bar), packed)
    imgui.push_font(None, look.SMALL_SIZE)
    for share in TICKS:
        text = f"{100.0 * share:g} %"
        x = corner.x + room * np.log(share / LEAST_ERROR) / np.log(MOST_ERROR / LEAST_ERROR)
        width = imgui.calc_text_size(text).x
        place = ImVec2(min(max(x - 0.5 * width, corner.x), corner.x + room - width), corner.y + bar + gap)
        draw_list.add_text(place, look.pack(look.TEXT_SOFT), text)
    imgui.pop_font()


def plate(context: PanelContext, draw_list: imgui.ImDrawList, place: ImVec2, text: str, ink: look.Colour) -> None:
    """Words over the picture, on a background that keeps them legible."""
    extent, pad = imgui.calc_text_size(text), context.px(6)
    upper = ImVec2(place.x - pad, place.y - 0.6 * pad)
    lower = ImVec2(place.x + extent.x + pad, place.y + extent.y + 0.6 * pad)
    draw_list.add_rect_filled(upper, lower, look.pack(look.grey(26, 0.88)), context.px(4))
    draw_list.add_text(place, look.pack(ink), text)
