"""A sketch of the view while the camera moves and no picture follows yet.

In a mode that draws while something moves, before it has drawn anything: the picture of the view before, projected onto
the plane through the camera's target. In any other: the objects' boxes as the camera sees them, over the view before,
darkened.

Only while the camera differs from that of the picture, and no mode draws what it sees meanwhile: another resolution,
pose or bump is awaited as well, but from the picture's own camera, which shows it as it is.
"""

from __future__ import annotations

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from engine.core.camera import camera_frame, pixel_directions, project
from engine.scene.camera_moves import distance
from engine.scene.description import Camera
from ui import theme as look
from ui.panels.context import PanelContext
from ui.panels.picture import Picture
from ui.panels.viewport_layout import PictureRect

# Corners are numbered by bits: 1 for the larger x, 2 for y, 4 for z. Edges join those that differ in one of them.
CORNERS = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)])
EDGES = np.array([(i, i | bit) for bit in (1, 2, 4) for i in range(8) if not i & bit])
NEAREST = 1e-3  # of the distance to the target; a point behind the camera has no place in the picture
MOST_BOXES = 256
N_CELLS = 8  # across a picture that is projected, each drawn without perspective

Float64Array = NDArray[np.float64]


def draw(context: PanelContext, placed: PictureRect, picture: Picture) -> None:
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
    selected = context.view.selected
    for state in [state for state in context.document.objects if state.visible][:MOST_BOXES]:
        box = context.box_of(state.name)
        is_selected = selected is not None and selected.object == state.name
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
