"""Handles in Deform's picture: the grips of deformers, and the dividers of a split picture."""

from __future__ import annotations

from functools import partial

from imgui_bundle import ImVec2, imgui

from app.document.view_state import SetView
from ui import theme as look
from ui.modes.deform import pose_handles
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.picture_overlays import PictureHandle, Place
from ui.panels.viewport_layout import PictureRect

PARTS = ("Path traced", "Not rotated", "Deform")


def handles(context: PanelContext, placed: PictureRect) -> list[PictureHandle]:
    """Those of the selected object's deformers, and of the split."""
    found = pose_handles.handles(context, placed)
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
