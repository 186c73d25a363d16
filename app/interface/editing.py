"""The history of a scene that is edited without a window: commands of the document and moves of the camera, as one."""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.document.commands import EditCommand
from app.document.document import Document
from app.document.history import History
from app.document.view_state import Viewpoint
from app.project.reading import read_measurements
from engine.scene.description import Camera


@dataclass(frozen=True)
class EditedScene:
    """A state of the history: the document and the viewpoint."""

    document: Document
    viewpoint: Viewpoint


@dataclass(frozen=True)
class _Edit:
    """One of the document's commands; measured BRDFs that it names are read at once."""

    command: EditCommand

    @property
    def label(self) -> str:
        return self.command.label

    def apply(self, state: EditedScene) -> EditedScene:
        return replace(state, document=read_measurements(self.command.apply(state.document)))


@dataclass(frozen=True)
class _MoveCamera:
    """Moves the camera, and sets the resolution, None for the present one."""

    camera: Camera
    resolution: tuple[int, int] | None = None
    label: str = "camera"

    def apply(self, state: EditedScene) -> EditedScene:
        resolution = self.resolution or state.viewpoint.resolution
        return replace(state, viewpoint=Viewpoint(self.camera, resolution))


class Editing:
    """The present state of a scene and the steps around it."""

    def __init__(self, document: Document, camera: Camera, resolution: tuple[int, int]) -> None:
        self._camera, self._resolution = camera, resolution
        self._history = History(EditedScene(document, Viewpoint(camera, resolution)))

    @property
    def document(self) -> Document:
        return self._history.document.document

    @property
    def viewpoint(self) -> Viewpoint:
        return self._history.document.viewpoint

    @property
    def camera(self) -> Camera:
        """The camera that pictures are seen from."""
        return self.viewpoint.camera or self._camera

    @property
    def resolution(self) -> tuple[int, int]:
        """Width and height of pictures."""
        return self.viewpoint.resolution or self._resolution

    def do(self, command: EditCommand) -> None:
        """Carry out one of the editor's commands. Raises InsituError, and nothing changes then."""
        self._history.do(_Edit(command))

    def look_from(self, camera: Camera, resolution: tuple[int, int] | None = None) -> None:
        """Move the camera; resolution: of pictures from there, None for the present one."""
        self._history.do(_MoveCamera(camera, resolution))

    def undo(self) -> str | None:
        """Undo one step; returns its label, None where there is none."""
        return self._history.undo()

    def redo(self) -> str | None:
        """Redo one step; returns its label, None where there is none."""
        return self._history.redo()
