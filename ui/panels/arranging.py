"""What moving, rotating and scaling by hand have in common: the selected objects as they stand, places in the picture,
and the edits.

All follows from where the objects stood when the hand took them, so that a pointer that returns restores them to the
last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from app.document.arranging import pivot_of, placed_objects, placing
from app.document.commands.several import named_together
from engine.core.camera import camera_frame, pixel_directions
from engine.scene.arrangement import PlacedObject, middle_of, moved, rotated, scaled
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.panels.picture_handles import Place, on_screen
from ui.panels.viewport_layout import PictureRect
from ui.panels.window_state import ArrangeGrip, SnapTarget

Float64Array = NDArray[np.float64]

ARM = 0.14  # of the picture's height: the length of an arm, and the radius of a ring
AXES = "xyz"
SNAP_METRES, SNAP_DEGREES, SNAP_SCALE = 0.1, 15.0, 0.1
_LEVEL = 0.02  # the sine of the angle at which a direction meets a plane too far away
_NOTHING = 1e-9  # metres, degrees or a share: the rounding of a pointer that has returned


@dataclass(frozen=True)
class Arranged:
    """The selected objects, the active one last: as they stand, and as they stood at the start of a drag."""

    context: PanelContext
    placed: PictureRect
    objects: tuple[PlacedObject, ...]
    start: tuple[PlacedObject, ...]

    @property
    def active(self) -> PlacedObject:
        """The active object as it stands."""
        return self.objects[-1]

    @property
    def middle(self) -> Float64Array:
        """The point (3,) that handles are at, as they stand: their common middle, or the centre of the active one."""
        return self._middle_of(self.objects)

    @property
    def first_middle(self) -> Float64Array:
        """The same at the start (3,)."""
        return self._middle_of(self.start)

    def _middle_of(self, placed: Sequence[PlacedObject]) -> Float64Array:
        pivot = pivot_of(placed, self.context.state.pivot)
        return middle_of(placed) if pivot is None else pivot

    @property
    def about(self) -> Float64Array | None:
        """The point that they are rotated and scaled about; None: each about its own centre."""
        return None if len(self.start) == 1 else pivot_of(self.start, self.context.state.pivot)

    @property
    def stands(self) -> bool:
        """Whether what is moved without an axis stands on the ground, or on a surface under the mouse; with Ctrl held
        it does not."""
        is_free = bool(imgui.get_io().key_ctrl)
        return not is_free and (snaps_to(self.context, "ground") or snaps_to(self.context, "surfaces"))

    @property
    def name(self) -> str:
        """What they are called in labels."""
        return named_together([each.name for each in self.objects])

    def arm_at(self, point: Float64Array) -> float:
        """The length in metres of an arm of a handle at a point; 0 where that is not in front of the camera."""
        camera = self.context.camera
        depth = float((point - np.array(camera.position)) @ camera_frame(camera)[2])
        return ARM * 2.0 * np.tan(np.radians(camera.fov_y) / 2.0) * max(depth, 0.0)

    def on_screen(self, *points: Float64Array) -> list[Place] | None:
        """Places of points (3,) on screen; None where one is not in front of the camera."""
        found = on_screen(self.context, self.placed, np.array(points))
        return None if found is None else [(float(x), float(y)) for x, y in found]

    def place_of(self, point: Float64Array) -> Float64Array | None:
        """The place of a point on screen (2,)."""
        places = self.on_screen(point)
        return None if places is None else np.array(places[0])

    def ray_to(self, place: Place) -> Float64Array:
        """The unit direction (3,) from the camera to a place on screen."""
        size = max(round(self.placed.width), 1), max(round(self.placed.height), 1)
        return pixel_directions(
            self.context.camera, size, place[0] - self.placed.x, place[1] - self.placed.y
        ).astype(np.float64)  # fmt: skip

    def on_plane(self, place: Place, point: Float64Array, normal: Float64Array) -> Float64Array | None:
        """The point (3,) of a plane that is seen at a place; None beyond its horizon."""
        towards, eye = self.ray_to(place), np.array(self.context.camera.position)
        slope, rise = float(towards @ normal), float((point - eye) @ normal)
        return None if abs(slope) < _LEVEL or rise / slope <= 0.0 else eye + towards * (rise / slope)

    # ------------------------------------------------------------------------------------------------------------ edits

    def moved(self, by: Float64Array) -> list[Action]:
        """Move them by metres (3,) from the start."""
        is_there = bool((np.abs(by) < _NOTHING).all())
        return self.to(self.start if is_there else _within(lambda: moved(self.start, by)), "move")

    def rotated(self, axis: Float64Array, degrees: float) -> list[Action]:
        """Rotate them about a unit axis from the start, counter-clockwise seen from its end."""
        if abs(degrees) < _NOTHING:
            return self.to(self.start, "rotate")
        rotation = turned_about(axis, degrees)
        return self.to(_within(lambda: rotated(self.start, rotation, self.about)), "rotate")

    def scaled(self, factors: Float64Array, axes: Float64Array | None) -> list[Action]:
        """Scale them by factors (3,) from the start, along axes, the columns of (3, 3); None: as `scaled` says."""
        if (np.abs(factors - 1.0) < _NOTHING).all():
            return self.to(self.start, "scale")
        return self.to(_within(lambda: scaled(self.start, factors, self.about, axes)), "scale")

    def to(self, placed: Sequence[PlacedObject] | None, verb: str) -> list[Action]:
        """Place them so, where that is elsewhere than now."""
        if placed is None:
            return []
        now = {each.name: each.transform for each in self.objects}
        return [placing(placed, verb)] if any(now[each.name] != each.transform for each in placed) else []

    def in_steps(self, value: float, step: float) -> float:
        """A value in multiples of a step, where drags snap to steps."""
        return round(round(value / step) * step, 6) if snaps_to_steps(self.context) else value

    def snapped_move(self, by: Float64Array, which: NDArray[np.bool_]) -> Float64Array:
        """A move (3,) with which the active object's position has multiples of the snap's step along these axes, where
        it snaps to steps."""
        if not snaps_to_steps(self.context):
            return by
        old = np.array(self.start[-1].transform.translation)
        steps = np.round(np.round((old + by) / SNAP_METRES) * SNAP_METRES, 6)
        return np.where(which, steps - old, by)


def objects_of(context: PanelContext) -> tuple[PlacedObject, ...]:
    """The selected objects that have a surface, the active one last."""
    return tuple(placed_objects(context.document, context.view.selected_objects, context.resting_box_of))


def placed_in(context: PanelContext, name: str) -> PlacedObject | None:
    """An object as it stands; None where it has no surface."""
    return next(iter(placed_objects(context.document, [name], context.resting_box_of)), None)


def arranged(context: PanelContext, placed: PictureRect) -> Arranged | None:
    """The selected objects in the picture; None where nothing with a surface is selected."""
    objects = objects_of(context)
    if not objects:
        return None
    grip = context.state.grip
    start = grip.start if isinstance(grip, ArrangeGrip) and grip.start else objects
    if [each.name for each in start] != [each.name for each in objects]:
        start = objects
    return Arranged(context, placed, objects, start)


def snaps_to_steps(context: PanelContext) -> bool:
    """Whether drags snap to steps: with Ctrl held, or, where that is what they snap to, without."""
    return bool(imgui.get_io().key_ctrl) != snaps_to(context, "increments")


def snaps_to(context: PanelContext, target: SnapTarget) -> bool:
    """Whether snapping is on, and to this."""
    return context.state.snaps and context.state.snap_to == target


def turned_about(axis: Float64Array, degrees: float) -> Float64Array:
    """The rotation (3, 3) about a unit axis, counter-clockwise seen from its end."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.radians(degrees)
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def own_axes(placed: PlacedObject) -> Float64Array:
    """The directions of an object's own axes, the columns of (3, 3)."""
    return placed.transform.own_axes


def _within(edit: Callable[[], list[PlacedObject]]) -> list[PlacedObject] | None:
    """The result of an edit, None where it leaves the range of transforms."""
    try:
        return edit()
    except ValueError:
        return None
