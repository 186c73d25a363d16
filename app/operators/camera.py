"""Operators that move the camera: each is one step of the view's own history."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from app.document.view_state import Viewpoint
from app.editor.editor import Editor
from app.operators.operator import SCENE, Gesture, Operator, ScriptKey, ValueRecord
from engine.scene.camera_moves import (
    Side,
    dolly_camera,
    frame_box,
    level_horizon,
    orbit_camera,
    pan_camera,
    view_from_side,
    with_focal_length,
)
from engine.scene.description import Camera, Number, Text

KEY_DEGREES, KEY_NEARER = 15.0, 0.8
# The conventions of which the user chooses one of each pair, and the preferences that choose them.
BLENDER, MAYA = "Camera: mouse as in Blender", "Camera: mouse as in Maya"
WHEEL, TRACKPAD = "Camera: wheel", "Camera: trackpad"
CHOICES = {BLENDER: ("mouse", "blender"), MAYA: ("mouse", "maya"), WHEEL: ("scroll", "dolly"),
           TRACKPAD: ("scroll", "orbit")}  # fmt: skip

Turn = Annotated[Number, Field(ge=-1e6, le=1e6)]


class MoveCamera(ValueRecord):
    """Moves the camera, one step of the view's own history, in the order of the fields."""

    own: Annotated[Literal[True] | None, Field(description="Begins at the scene's own camera.")] = None
    side: Annotated[Side | None, Field(description="Looks from this side of the scene.")] = None
    focal: Annotated[
        Annotated[Number, Field(gt=0.0, le=1e6)] | None, Field(description="The lens, mm on film of 36 x 24 mm.")
    ] = None
    frame: Annotated[Text | None, Field(description='The object that fills the picture, or `"all"`.')] = None
    orbit: Annotated[tuple[Turn, Turn] | None, Field(description="Degrees to its right and up.")] = None
    pan: Annotated[tuple[Turn, Turn] | None, Field(description="Heights of the picture to its right and up.")] = None
    dolly: Annotated[
        Annotated[Number, Field(ge=1e-6, le=1e6)] | None, Field(description="Times the distance that it had.")
    ] = None
    level: Annotated[Literal[True] | None, Field(description="Ends with a level horizon.")] = None

    @model_validator(mode="after")
    def _is_something(self) -> MoveCamera:
        if not self.model_fields_set:
            raise ValueError(f"at least one of {', '.join(type(self).model_fields)}")
        return self


def _move(editor: Editor, move: MoveCamera) -> str | None:
    camera = editor.camera_history.own_camera if move.own else editor.camera_history.camera
    if move.side is not None:
        camera = view_from_side(camera, move.side)
    if move.focal is not None:
        camera = with_focal_length(camera, move.focal)
    if move.frame is not None:
        names = [state.name for state in editor.document.objects]
        box = editor.camera_history.box_of(None if move.frame == "all" and "all" not in names else move.frame)
        camera = frame_box(camera, box, editor.camera_history.aspect)
    if move.orbit is not None:
        camera = orbit_camera(camera, *map(math.radians, move.orbit))
    if move.pan is not None:
        camera = pan_camera(camera, *move.pan)
    if move.dolly is not None:
        camera = dolly_camera(camera, move.dolly)
    return _see_from(editor, level_horizon(camera) if move.level else camera, "camera")


def _see_from(editor: Editor, camera: Camera, label: str) -> str | None:
    return editor.camera_history.set_viewpoint(Viewpoint(camera, editor.view.resolution), label)


def _frame(editor: Editor, name: str | None) -> str | None:
    """Frame an object, or all."""
    box = editor.camera_history.box_of(name)
    camera = frame_box(editor.camera_history.camera, box, editor.camera_history.aspect)
    return _see_from(editor, camera, f"frame {name or 'all'}")


def _frame_selection(editor: Editor, value: None) -> str | None:
    names = editor.view.selected_objects
    if len(names) < 2:
        return _frame(editor, names[0] if names else None)
    boxes = np.array([editor.camera_history.box_of(name) for name in names])
    box = np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    camera = frame_box(editor.camera_history.camera, box, editor.camera_history.aspect)
    return _see_from(editor, camera, f"frame {len(names)} objects")


def _side(side: Side, key: str, help: str = "", listed_keys: str = "") -> Operator:
    """Look from a side of the scene."""

    def run(editor: Editor, value: None) -> str | None:
        return _see_from(editor, view_from_side(editor.camera_history.camera, side), f"from the {side}")

    return Operator(f"view_{side}", run, (key,), help, listed_keys, entry=side.capitalize(), needs=SCENE, waits=True)


def _turn(name: str, key: str, right: float, up: float, help: str = "", listed_keys: str = "") -> Operator:
    """Orbit by a step to the right and up."""
    angles = math.radians(KEY_DEGREES * right), math.radians(KEY_DEGREES * up)

    def run(editor: Editor, value: None) -> str | None:
        return _see_from(editor, orbit_camera(editor.camera_history.camera, *angles), "orbit")

    return Operator(name, run, (key,), help, listed_keys, needs=SCENE, repeats=True, waits=True)


def _approach(name: str, key: str, factor: float, help: str = "", listed_keys: str = "") -> Operator:
    """Go to so many times the distance."""

    def run(editor: Editor, value: None) -> str | None:
        return _see_from(editor, dolly_camera(editor.camera_history.camera, factor), name)

    return Operator(name, run, (key,), help, listed_keys, needs=SCENE, repeats=True, waits=True)


CONVENTIONS = {
    BLENDER: (
        Gesture("Middle drag", "Orbit about the point of interest"), Gesture("Shift middle", "Pan"),
        Gesture("Ctrl middle", "Nearer, farther"),
    ),
    MAYA: (
        Gesture("Alt drag", "Orbit about the point of interest"), Gesture("Alt middle", "Pan"),
        Gesture("Alt right", "Nearer, farther"),
    ),
    WHEEL: (Gesture("Wheel", "Nearer to what is under the mouse"),),
    TRACKPAD: (Gesture("Two fingers", "Orbit; Shift pans, Ctrl goes nearer"),),
}  # fmt: skip

CAMERA = (
    Operator(
        "camera", _move,
        script=ScriptKey(
            MoveCamera, "Moves the camera, one step of the view's own history: see below."
        ),
    ),
    Operator("go_to_view", entry="Saved views"),
    Operator("conventions", entry="Mouse and trackpad"),
    Operator(
        "frame", _frame_selection, ("F", "Keypad ."), "Frame the selection, frame all", "F   Home",
        entry="Frame the selection", needs=SCENE, waits=True,
    ),
    Operator(
        "frame_all", lambda editor, value: _frame(editor, None), ("Home",), entry="Frame all", needs=SCENE, waits=True
    ),
    Operator(
        "camera_panel", keys=("N",), help="Lens, horizon, size, saved views", entry="Lens, size, saved views…"
    ),
    _side("front", "Keypad 1", "From the front, the right, the top", "Keypad 1 3 7"),
    _side("right", "Keypad 3"),
    _side("top", "Keypad 7"),
    _side("back", "Ctrl Keypad 1", "From the back, the left, the bottom", "with Ctrl"),
    _side("left", "Ctrl Keypad 3"),
    _side("bottom", "Ctrl Keypad 7"),
    _turn("turn_left", "Keypad 4", -1.0, 0.0, "Orbit by 15°", "Keypad 4 6 8 2"),
    _turn("turn_right", "Keypad 6", 1.0, 0.0),
    _turn("turn_up", "Keypad 8", 0.0, 1.0),
    _turn("turn_down", "Keypad 2", 0.0, -1.0),
    _approach("nearer", "Keypad +", KEY_NEARER, "Nearer, farther", "Keypad + -"),
    _approach("farther", "Keypad -", 1.0 / KEY_NEARER),
    Operator(
        "level", lambda editor, value: _see_from(editor, level_horizon(editor.camera_history.camera), "level horizon"),
        entry="Level horizon", needs=SCENE, waits=True,
    ),
    Operator(
        "own_view", lambda editor, value: _see_from(editor, editor.camera_history.own_camera, "the scene's own camera"),
        ("Keypad 0",), "The scene's own camera", entry="The scene's own camera", needs=SCENE, waits=True,
    ),
)  # fmt: skip
