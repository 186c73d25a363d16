"""The camera of the view, its own undo history, and where objects are in their files.

The camera is a part of the view, not of the document: moving it is no edit, and has an undo of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document, ObjectState
from app.document.history import History
from app.document.view_state import SetViewpoint, Viewpoint, ViewState
from app.editor.view_controller import ViewController
from app.system.memory import require_memory_for
from engine.core.errors import InsituError
from engine.scene.composition import ObjectSource
from engine.scene.description import Camera, ObjectDescription, SceneDescription
from engine.scene.ground_boxes import find_ground_boxes
from engine.scene.light_placement import facing_of

if TYPE_CHECKING:
    from engine.scene.added_objects import AddedObject

NO_CAMERA = Camera(position=(0.0, 0.0, 1.0), target=(0.0, 0.0, 0.0))
Box = NDArray[np.float64]


class CameraHost(Protocol):
    """What the camera history needs of the editor."""

    view: ViewState

    @property
    def document(self) -> Document: ...

    def notify(self, text: str, is_error: bool = False) -> None: ...


class CameraHistory:
    """The camera and resolution of one scene. At the end of a drag it notifies `controller`, which then traces the view
    without waiting for the idle time.

    own_camera, own_resolution: those of the scene's file; history: that of the view, separate from the document's.
    """

    def __init__(self, host: CameraHost, controller: ViewController) -> None:
        self._host, self._controller = host, controller
        self.own_camera, self.own_resolution = NO_CAMERA, (0, 0)
        self.history = History(Viewpoint())
        self._boxes: dict[ObjectSource, Box] = {}
        self._described: dict[str, ObjectDescription] = {}

    def scene_opened(self, description: SceneDescription, boxes: Box) -> None:
        """Take over another scene, with the box (2, 3) of each of its objects, NaN where an object has no surface."""
        self.own_resolution = description.camera.resolution
        self.own_camera = Camera(**{name: getattr(description.camera, name) for name in Camera.model_fields})
        named = zip((described.name for described in description.objects), boxes, strict=False)
        self._boxes = {name: box for name, box in named if np.all(np.isfinite(box))}
        self._described = {described.name: described for described in description.objects}

    def add_boxes(self, objects: Iterable[AddedObject]) -> None:
        """Take over the boxes of objects that the scene's file does not have."""
        self._boxes |= {each.source: each.box for each in objects if np.all(np.isfinite(each.box))}

    def reset_history(self) -> None:
        """Forget all steps: the present camera is the start of the history."""
        self.history = History(self._host.view.viewpoint)

    @property
    def camera(self) -> Camera:
        """The camera that the scene is seen from, or is about to be."""
        return self._host.view.camera or self.own_camera

    @property
    def resolution(self) -> tuple[int, int]:
        """(width, height) of the picture, in pixels."""
        return self._host.view.resolution or self.own_resolution

    @property
    def aspect(self) -> float:
        """The picture's width divided by its height."""
        width, height = self.resolution
        return width / max(height, 1)

    def set_viewpoint(self, look: Viewpoint, label: str, gesture: str | None = None) -> str | None:
        """Move the camera and set the resolution, as one step of the history; consecutive steps of one gesture are
        merged.

        Returns None, or one line with the reason: the picture would need more memory than there is.
        """
        camera = None if look.camera == self.own_camera else look.camera
        resolution = None if look.resolution == self.own_resolution else look.resolution
        try:
            if resolution not in (None, self._host.view.resolution):
                require_memory_for(resolution, "choose fewer")
        except InsituError as error:
            self._host.notify(str(error), True)
            return str(error)
        if self._history_now().do(SetViewpoint(Viewpoint(camera, resolution), label), gesture):
            self._apply_viewpoint(self.history.document)
        return None

    def resize(self, resolution: tuple[int, int] | None) -> str | None:
        """Set the resolution at once (None: the scene's own); returns None, or the reason why not."""
        refusal = self.set_viewpoint(self._host.view.viewpoint._replace(resolution=resolution), "the picture's size")
        self._controller.hand_released()
        return refusal

    def begin_drag(self, label: str) -> None:
        """Begin a camera drag: all moves until ``end_drag`` are one step."""
        self._history_now().begin_drag(label)

    def drag_to(self, look: Viewpoint) -> None:
        """Move the camera during a drag; does nothing where the drag began in another scene."""
        if self.history.dragging:
            self.set_viewpoint(look, "")

    def end_drag(self) -> None:
        """End the drag: the view is traced without waiting for the idle time."""
        if self.history.dragging:
            self._history_now().end_drag()
            self._controller.hand_released()

    def cancel_drag(self) -> None:
        """Cancel the drag under way."""
        if self.history.dragging:
            self._history_now().cancel_drag()
            self._apply_viewpoint(self.history.document)
            self._controller.hand_released()

    def undo(self) -> str | None:
        """Go one step back in the view's history, not the document's; returns its label, None where there is none."""
        return self._describe_step(self._history_now().undo, "view undone")

    def redo(self) -> str | None:
        """Go one step forward; returns its label, None where there is none."""
        return self._describe_step(self._history_now().redo, "view redone")

    def restore_viewpoint(self, seen: Viewpoint) -> None:
        """Return to the view that was traced last, where the present one cannot be traced; the history has no trace of
        it."""
        self._apply_viewpoint(seen)
        self.history.retract(lambda before: before == seen)

    def box_of(self, name: str | None) -> Box:
        """The least and the largest corner (2, 3) of an object, in metres; None: of all visible objects, without lamps
        and the grounds and backdrops behind them."""
        there = [state for state in self._host.document.objects if state.source in self._boxes]
        found = [state for state in there if state.name == name]
        if name is not None and not found:
            names = ", ".join(state.name for state in there)
            raise InsituError(f"there is no object {name!r} to be framed; available: {names}")
        found = (
            found
            or [state for state in there if state.visible and not state.is_lamp and not _is_backdrop(state)]
            or there
        )
        boxes = np.array([state.transform.moved_box(self._boxes[state.source]) for state in found])
        if not len(boxes):
            raise InsituError("there is nothing to be framed")
        boxes = boxes[~find_ground_boxes(boxes)]
        return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])

    def resting_box(self, name: str) -> Box | None:
        """The box (2, 3) of an object where its file has it, in metres; None where it has no surface."""
        return next((self._boxes.get(each.source) for each in self._host.document.objects if each.name == name), None)

    def resting_facing(self, name: str) -> NDArray[np.float64] | None:
        """The direction (3,) that a lamp shines to where its file has it; None for one that shines to all sides. It is
        known as soon as the lamp is in the document, before the worker has it in the scene."""
        source = next((each.source for each in self._host.document.objects if each.name == name), None)
        described = self._described.get(source) if isinstance(source, str) else source
        return None if described is None else facing_of(described)

    def _history_now(self) -> History[Viewpoint]:
        """The history, with its present state set to the view: a session or a script may have set that directly."""
        self.history.document = self._host.view.viewpoint
        return self.history

    def _apply_viewpoint(self, look: Viewpoint) -> None:
        self._host.view = replace(self._host.view, **look._asdict())

    def _describe_step(self, step: Callable[[], str | None], what: str) -> str | None:
        label = step()
        if label is not None:
            self._apply_viewpoint(self.history.document)
            self._controller.hand_released()
            self._host.notify(f"{what}: {label}")
        return label


def _is_backdrop(state: ObjectState) -> bool:
    """Whether an object was added as a backdrop: it stands behind what is framed."""
    return state.added is not None and state.added.primitive == "backdrop"
