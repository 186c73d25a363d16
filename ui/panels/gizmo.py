"""The gizmo: handles over the picture that move, rotate or scale the selected objects, and the outlines of their boxes.

They are handles like those of deformers: clicks beside them select, camera drags stay camera drags, a drag is one step,
Esc takes it back, and scripts drag them by name (`gizmo.x`). Rejected: ImGuizmo, which comes with imgui: it takes the
mouse itself, before all of that.

Several objects have the handles at their common middle, or at that of the active one, with the axes of the world; one
is scaled along its own. Ctrl held during a drag snaps: to 0.1 m, 15 degrees, and factors of 0.1; where that is on in
the header, it is free.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from imgui_bundle import ImVec2, imgui
from numpy.typing import NDArray

from engine.core.camera import camera_frame
from engine.scene.arrangement import PlacedObject, box_of
from engine.scene.transform import LEAST_SCALE, MOST_METRES, MOST_SCALE, rotation_matrix
from ui import theme as look
from ui.panels.actions import Action
from ui.panels.arranging import (
    AXES,
    SNAP_DEGREES,
    SNAP_SCALE,
    Arranged,
    arranged,
    own_axes,
    snaps_to_steps,
    turned_about,
)
from ui.panels.context import PanelContext
from ui.panels.picture_handles import PictureHandle, Place, value_at
from ui.panels.picture_overlays import CORNERS, EDGES
from ui.panels.surface_snap import UP, aim_under, stand_under, target_of
from ui.panels.viewport_layout import PictureRect

Float64Array = NDArray[np.float64]

TOOLS = ("move", "rotate", "scale", "aim")
HOW = "drag it; Ctrl snaps."
MOST_OUTLINES = 64
WHITE = look.grey(240)
_N_RING = 48
_BESIDE = 1.15  # of half a box: how far from its middle the handles that scale it are, between these shares of an arm
_NEAR, _FAR = 0.6, 2.0


def handles(context: PanelContext, placed: PictureRect) -> list[PictureHandle]:
    """The handles of the chosen tool, and the outlines of what they move; none where the selected objects are hidden or
    not in front of the camera."""
    found = arranged(context, placed) if context.state.gizmo else None
    is_hidden = found is not None and not any(context.document.object(each.name).visible for each in found.objects)
    if found is None or is_hidden or found.arm_at(found.middle) == 0.0:
        return []
    draw_outlines(found)
    tools = {"move": _moving, "rotate": _rotating, "scale": _scaling, "aim": _aiming}
    return list(tools[context.state.gizmo](found))


def draw_outlines(arranged: Arranged) -> None:
    """The objects' boxes where they are to be, while the picture still shows them elsewhere."""
    context = arranged.context
    if not context.status.is_away and context.state.grip is None:
        return
    for each in arranged.objects[-MOST_OUTLINES:]:
        matrix = each.transform.matrix(each.pivot)
        corners = np.where(CORNERS, each.box[1], each.box[0]) @ matrix[:3, :3].T + matrix[:3, 3]
        places = arranged.on_screen(*corners)
        for start, end in [] if places is None else EDGES:
            line = ImVec2(*places[start]), ImVec2(*places[end])  # type: ignore[index]
            imgui.get_window_draw_list().add_line(*line, look.pack(look.with_alpha(look.ACCENT, 0.8)), context.px(1.2))


def _label(arranged: Arranged) -> str:
    return f"{arranged.context.state.gizmo} {arranged.name}"


# --------------------------------------------------------------------------------------------------------------- moving


def _moving(arranged: Arranged) -> Iterator[PictureHandle]:
    """An arm along each axis of the world, and a handle at the middle that goes over the ground."""
    middle, arm = arranged.middle, arranged.arm_at(arranged.middle)
    for k, axis in enumerate(np.eye(3)):
        if (line := arranged.on_screen(middle, middle + arm * axis)) is not None:
            hint = f"Along {AXES[k].upper()}, {arranged.active.transform.translation[k]:.3f} m: {HOW}"
            drag = partial(_move_along, arranged, k)
            yield _handle(arranged, AXES[k], line[1], line, hint, drag, look.CHANNELS[k])
    if (line := arranged.on_screen(middle)) is not None:
        hint = f"Over the ground: {HOW}"
        yield _handle(arranged, "ground", line[0], line, hint, partial(_move_over_ground, arranged))


def _handle(
    arranged: Arranged, name: str, place: Place, line: list[Place], hint: str, drag: Callable[[Place], list[Action]],
    ink: look.Colour = WHITE,
) -> PictureHandle:  # fmt: skip
    label = _label(arranged)
    return PictureHandle(f"gizmo.{name}", place, line, label, hint, drag, ink=ink, start=arranged.objects)


def _move_along(arranged: Arranged, k: int, to: Place) -> list[Action]:
    """Move so that the end of an arm is nearest to a place on screen."""
    axis, first = np.eye(3)[k], arranged.first_middle

    def seen(by: float) -> Float64Array | None:
        middle = first + by * axis
        return arranged.place_of(middle + arranged.arm_at(middle) * axis)

    now, arm = float((arranged.middle - first)[k]), arranged.arm_at(first)
    by = value_at(seen, now, to, 0.01 * arm, 2.0 * arm, (now - MOST_METRES, now + MOST_METRES))
    return arranged.moved(arranged.snapped_move(by * axis, axis > 0.0))


def _move_over_ground(arranged: Arranged, to: Place) -> list[Action]:
    """Move the middle in its level plane to a place on screen, or let the objects stand there on what they snap to."""
    first = arranged.first_middle
    if arranged.stands:
        place = arranged.place_of(first)
        return [] if place is None else stand_under(arranged, to, (to[0] - place[0], to[1] - place[1]))
    met = arranged.on_plane(to, first, UP)
    if met is None:
        return []
    by = (met - first) * (1.0, 0.0, 1.0)
    return arranged.moved(arranged.snapped_move(by, np.array([True, False, True])))


# --------------------------------------------------------------------------------------------------------------- aiming


def _aiming(arranged: Arranged) -> Iterator[PictureHandle]:
    """A handle at the point that the active light shines at, with a line from the light."""
    target = target_of(arranged.context, arranged.active)
    line = None if target is None else arranged.on_screen(arranged.active.centre, target)
    if line is not None:
        hint = f"What {arranged.active.name} shines at: drag it over the picture."
        yield _handle(arranged, "aim", line[1], line, hint, partial(aim_under, arranged))


# ------------------------------------------------------------------------------------------------------------- rotating


def _rotating(arranged: Arranged) -> Iterator[PictureHandle]:
    """A ring about each axis of the world, with a knob that turns along with the active object."""
    middle, arm = arranged.middle, arranged.arm_at(arranged.middle)
    for k, knob in enumerate(_knobs(arranged.start[-1])):
        turn = _turned_by(arranged, k)
        ring = [turned_about(np.eye(3)[k], turn + degrees) @ knob for degrees in np.linspace(0.0, 360.0, _N_RING + 1)]
        if (line := arranged.on_screen(*(middle + arm * each for each in ring))) is not None:
            hint = f"About {AXES[k].upper()}, {arranged.active.transform.rotation[k]:.1f}°: {HOW}"
            drag = partial(_rotate_about, arranged, k, knob)
            yield _handle(arranged, AXES[k], line[0], line, hint, drag, look.CHANNELS[k])


def _turned_by(arranged: Arranged, k: int) -> float:
    """By how many degrees the active object has been turned about an axis of the world since the start."""
    turned = own_axes(arranged.active) @ own_axes(arranged.start[-1]).T
    i, j = (k + 1) % 3, (k + 2) % 3
    return float(np.degrees(np.arctan2(turned[j, i] - turned[i, j], turned[i, i] + turned[j, j])))


def _knobs(placed: PlacedObject) -> Iterator[Float64Array]:
    """For each axis the direction (3,) of its knob: that of another axis of the object, across the ring's."""
    own = rotation_matrix(placed.transform.rotation)
    for k in range(3):
        across = [own[:, i] * (np.arange(3) != k) for i in ((k + 1) % 3, (k + 2) % 3)]
        longer = max(across, key=lambda each: float(np.linalg.norm(each)) > 0.5)
        yield longer / np.linalg.norm(longer)


def _rotate_about(arranged: Arranged, k: int, knob: Float64Array, to: Place) -> list[Action]:
    """Rotate so that a ring's knob is nearest to a place on screen."""
    axis, middle = np.eye(3)[k], arranged.middle
    arm = arranged.arm_at(middle)

    def seen(degrees: float) -> Float64Array | None:
        return arranged.place_of(middle + arm * turned_about(axis, degrees) @ knob)

    now = _turned_by(arranged, k)
    degrees = arranged.in_steps(value_at(seen, now, to, 0.5, 30.0, (now - 180.0, now + 180.0)), SNAP_DEGREES)
    return arranged.rotated(axis, degrees)


# -------------------------------------------------------------------------------------------------------------- scaling


def _scaling(arranged: Arranged) -> Iterator[PictureHandle]:
    """A handle beside the box along each axis, of one object its own, and one that scales all three."""
    alone = len(arranged.objects) == 1
    own = own_axes(arranged.active) if alone else np.eye(3)
    box = arranged.active.box if alone else box_of(arranged.start)
    middle, arm = arranged.middle, arranged.arm_at(arranged.middle)
    reach = np.clip(_BESIDE * 0.5 * np.ptp(box, axis=0), _NEAR * arm, _FAR * arm)
    right, up, _ = camera_frame(arranged.context.camera)
    aside = arm * (right + up) / np.sqrt(2.0)
    first = np.array(arranged.start[-1].transform.scale)
    grown = np.array(arranged.active.transform.scale) / first
    ways = [(AXES[k], reach[k] * own[:, k], np.arange(3) == k) for k in range(3)]
    for name, way, which in (*ways, ("all", aside, np.full(3, True))):
        size = float(np.exp(np.log(first[which]).mean())) if alone else 1.0  # at the start, as the handle shows it
        now = size * float(np.exp(np.log(grown[which]).mean()))
        if (line := arranged.on_screen(middle, middle + now * way)) is None:
            continue
        ink = look.CHANNELS[AXES.index(name)] if name in AXES else WHITE
        hint = f"{'All sides' if name == 'all' else name.upper()} × {now:.3f}: {HOW}"
        drag = partial(_scale_along, arranged, way, which, size, now)
        yield _handle(arranged, name, line[1], line, hint, drag, ink)


def _scale_along(
    arranged: Arranged, way: Float64Array, which: NDArray[np.bool_], size: float, now: float, to: Place
) -> list[Action]:
    """Scale so that a handle is nearest to a place on screen; which (3,): the axes that follow; size and now: their
    factor at the start and now."""

    def seen(factor: float) -> Float64Array | None:
        return arranged.place_of(arranged.middle + factor * way)

    found = arranged.in_steps(value_at(seen, now, to, 0.005 * now, now, (LEAST_SCALE, MOST_SCALE)), SNAP_SCALE)
    factors = np.where(which, max(found, SNAP_SCALE if snaps_to_steps(arranged.context) else LEAST_SCALE) / size, 1.0)
    return arranged.scaled(factors, None)
