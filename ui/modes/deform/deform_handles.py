"""Handles in Deform's picture: the grips of the selected object's deformers, and the dividers of a split picture.

Each deformer has its deformed axis, and a grip that changes its amount. A grip is a point of the object's box that goes
through all its deformers. The amount follows the drag by a few steps of Newton's method in the picture's plane, so that
every kind of deformer has a handle defined only by its point.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from app.document.commands import SetDeformer
from app.document.view_state import SetView
from engine.realtime.deformers import KINDS
from engine.realtime.zonal_harmonics.pose import AXES, Deformation, Pose, deform
from ui import theme as look
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.picture_handles import PictureHandle, Place, on_screen, value_at
from ui.panels.viewport_layout import PictureRect

PARTS = ("Path traced", "Not rotated", "Deform")


def handles(context: PanelContext, placed: PictureRect) -> list[PictureHandle]:
    """Those of the selected object's deformers, and of the split."""
    found = _grips(context, placed)
    if context.view.split is None or context.status.shown_by not in ("", "Deform"):
        return found
    _name_parts(context, placed, context.view.split)
    return [*found, *_dividers(placed, context.view.split)]


def _dividers(placed: PictureRect, split: tuple[float, float]) -> list[PictureHandle]:
    found = []
    for i, (share, parts) in enumerate(zip(split, zip(PARTS, PARTS[1:], strict=False), strict=True)):
        x, middle = placed.x + share * placed.width, placed.y + 0.5 * placed.height
        line = [(x, placed.y), (x, placed.y + placed.height)]
        hint = f"{parts[0]} | {parts[1]}: drag it."
        found.append(
            PictureHandle(f"split.{i}", (x, middle), line, "", hint, partial(_dragged, placed, split, i), True)
        )
    return found


def _dragged(placed: PictureRect, split: tuple[float, float], i: int, to: Place) -> list[Action]:
    """Drag a divider; it pushes the other along: where both are at one place, either can be dragged away."""
    share = (to[0] - placed.x) / max(placed.width, 1.0)
    moved = (share, max(share, split[1])) if i == 0 else (min(split[0], share), share)
    return [SetView.of(split=moved)] if moved != split else []


def _name_parts(context: PanelContext, placed: PictureRect, split: tuple[float, float]) -> None:
    """Label each part at its upper edge, where it is wide enough."""
    draw_list, ends = imgui.get_window_draw_list(), (0.0, *split, 1.0)
    for name, start, end in zip(PARTS, ends, ends[1:], strict=False):
        extent, pad = imgui.calc_text_size(name), context.px(6)
        if (end - start) * placed.width < extent.x + 4.0 * pad:
            continue
        x, y = placed.x + start * placed.width + 2.0 * pad, placed.y + 2.0 * pad
        corner, far = ImVec2(x - pad, y - 0.5 * pad), ImVec2(x + extent.x + pad, y + extent.y + 0.5 * pad)
        draw_list.add_rect_filled(corner, far, look.pack(look.grey(26, 0.88)), context.px(4))
        draw_list.add_text(ImVec2(x, y), look.pack(look.TEXT), name)


# ----------------------------------------------------------------------------------------------- the grips of deformers


Float64Array = NDArray[np.float64]

N_LINE = 33
BESIDE = 0.07  # of the height, between grips that would overlap
_STEP = {"degrees": 0.5, "": 0.005}
_FURTHEST = {"degrees": 15.0, "": 0.15}  # the most that an amount changes in a step


def _grips(context: PanelContext, placed: PictureRect) -> list[PictureHandle]:
    """The handles of the selected object, where it is visible."""
    selected = context.view.selected
    box = None if selected is None else context.resting_box_of(selected.object)
    if selected is None or box is None or not np.isfinite(box).all():
        return []
    state = context.document.object(selected.object)
    matrix, row = state.transform.matrix(box.mean(axis=0)), state.deformations
    box = box + dict(getattr(context.status, "carried", ())).get(selected.object, (0.0, 0.0, 0.0))
    found = []
    for index, deformation in enumerate(row):
        line = on_screen(context, placed, _posed(box, row, matrix, _axis(box, row, index)))
        if line is None:
            continue
        kind = KINDS[deformation.kind]
        amount = f"{deformation.amount:.1f}°" if kind.unit == "degrees" else f"{deformation.amount:.3f}"
        drag = partial(_dragged_grip, context, placed, selected.object, box, row, matrix, index)
        places = [(float(x), float(y)) for x, y in line]
        label = f"{deformation.kind} {selected.object}"
        found.append(
            PictureHandle(f"pose.handle.{index}", places[-1], places, label, f"{kind.title} {amount}: drag it.", drag)
        )
    return found


def _axis(box: Float64Array, row: tuple[Deformation, ...], index: int) -> Float64Array:
    """The line (N, 3) along a deformer's axis at rest, from its foot to its grip."""
    deformation = row[index]
    across, upward = grip = KINDS[deformation.kind].grip
    before = [each for each in row[:index] if (KINDS[each.kind].grip, each.axis) == (grip, deformation.axis)]
    upward += BESIDE * (len(before) + 1)
    i_across, i_axis, i_depth = AXES[deformation.axis]
    low, high = box
    line = np.empty((N_LINE, 3))
    line[:, [i_across, i_depth]] = 0.5 * (low + high)[[i_across, i_depth]]
    line[:, i_axis] = low[i_axis] + upward * (high - low)[i_axis] * np.linspace(0.0, 1.0, N_LINE)
    if across:  # up the axis, then out to the grip
        n = N_LINE // 2
        line[:n, i_axis] = low[i_axis] + upward * (high - low)[i_axis] * np.linspace(0.0, 1.0, n)
        line[n:, i_axis] = line[n - 1, i_axis]
        line[n:, i_across] += across * 0.5 * (high - low)[i_across] * np.linspace(0.0, 1.0, N_LINE - n)
    return line


def _posed(box: Float64Array, row: tuple[Deformation, ...], matrix: Float64Array, points: Float64Array) -> Float64Array:
    """Points (N, 3) after the row of deformers and the object's transform (4, 4)."""
    frames = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    return deform(Pose(points, frames), row, box).positions @ matrix[:3, :3].T + matrix[:3, 3]


def _dragged_grip(
    context: PanelContext,
    placed: PictureRect,
    name: str,
    box: Float64Array,
    row: tuple[Deformation, ...],
    matrix: Float64Array,
    index: int,
    to: Place,
) -> list[Action]:
    """Set the amount with which the grip is nearest to a place on screen."""
    deformation = row[index]
    kind, grip = KINDS[deformation.kind], _axis(box, row, index)[-1:]

    def seen(amount: float) -> Float64Array | None:
        changed = (*row[:index], replace(deformation, amount=amount), *row[index + 1 :])
        found = on_screen(context, placed, _posed(box, changed, matrix, grip))
        return None if found is None else np.asarray(found[0])

    amount = value_at(seen, deformation.amount, to, _STEP[kind.unit], _FURTHEST[kind.unit], kind.limits)
    return [SetDeformer(name, index, amount=amount)] if amount != deformation.amount else []
