"""A match of an object's material that a process of its own finds while the editor goes on; one at a time. Its answer
is for the material that the object had when it began.

    idle ── begin ──► matching ── answer ──► put on the object
                         │
                         ├── stop, another scene ──► idle, nothing changed
                         └── dropped: the process says why, or the object has other layers by then

An answer that comes during a drag, of the camera as well, waits for its end, of which it is no part. Where the files of
the scene are read again, edits stay, and so does the match.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, Generic, Protocol, TypeVar

from app.document.document import Document
from app.document.linked_layers import Layers
from app.document.view_state import ViewState
from app.worker.session_process import TaskAnswer
from engine.core.errors import InsituError

if TYPE_CHECKING:
    from app.editor.editor import Editor

Settings = TypeVar("Settings")
SettingsTaken = TypeVar("SettingsTaken", contravariant=True)
Answer = TypeVar("Answer")


class Matcher(Protocol[SettingsTaken, Answer]):
    """The process that matches."""

    @property
    def progress(self) -> str: ...

    def begin(self, document: Document, view: ViewState, settings: SettingsTaken) -> None: ...

    def stop(self) -> None: ...

    def close(self) -> None: ...

    def take_ended(self) -> list[TaskAnswer[Answer]]: ...


class BackgroundMatch(ABC, Generic[Settings, Answer]):
    """The matches of one kind in one editor. WHAT: is matched, in words."""

    WHAT: ClassVar[str]

    def __init__(self, editor: Editor, matcher: Matcher[Settings, Answer]) -> None:
        self._editor, self._matcher = editor, matcher
        self._begun: tuple[Settings, str, Layers] | None = None
        self._name = ""
        self._scene: tuple[str, int] | None = None

    @property
    def progress(self) -> str:
        """What is done, and how much of it, also while the answer waits for the end of a drag; "" for nothing."""
        return "" if self._begun is None else self._matcher.progress or f"matched {self._name}"

    @abstractmethod
    def _put(self, settings: Settings, answer: Answer) -> None:
        """Put an answer on its object."""

    @abstractmethod
    def _scene_changed(self) -> None:
        """Another scene is open than at the last match."""

    def _begin(self, settings: Settings, name: str, object: str) -> None:
        """Begin a match for an object of the document. name: of what is matched. Raises InsituError."""
        if self._begun is not None:
            raise InsituError(f"{self.WHAT} is still being matched; wait, or stop it")
        document = self._editor.document
        layers = document.object(object).layers
        self._matcher.begin(document, self._editor.view, settings)
        self._begun, self._name, self._scene = (settings, object, layers), name, self._scene_now

    def stop(self) -> None:
        """Stop; the document stays as it is."""
        if self._begun is not None:
            self._give_up()
            self._editor.notify("stopped matching")

    def close(self) -> None:
        """End the process."""
        self._begun = None
        self._matcher.close()

    def follow(self) -> bool:
        """Take what has come, once a frame; returns whether there is something new."""
        if self._scene is not None and self._scene != self._scene_now:
            self._give_up()  # in silence: the line about the new scene says more
            self._scene = None
            self._scene_changed()
        drags = self._editor.history.dragging or self._editor.camera_history.history.dragging
        if self._begun is None or drags:
            return False
        ended = self._matcher.take_ended()
        for each in ended:
            begun, self._begun = self._begun, None
            if begun is not None:
                self._end(each, *begun)
        return bool(ended)

    def _give_up(self) -> None:
        if self._begun is not None:
            self._begun = None
            self._matcher.stop()
            self._matcher.take_ended()  # an answer that has just come is not that of the next match

    @property
    def _scene_now(self) -> tuple[str, int]:
        """The scene that is open, and the number of its opening."""
        return self._editor.document.source, self._editor.scenes.n_opened

    def _end(self, ended: TaskAnswer[Answer], settings: Settings, object: str, layers: Layers) -> None:
        editor = self._editor
        if ended.answer is None:
            editor.notify(ended.line, True)
            return
        now = next((each.layers for each in editor.document.objects if each.name == object), None)
        if now != layers:
            why = "is no longer in the scene" if now is None else "was edited while it was matched; match it again"
            editor.notify(f"what was found is dropped: {object} {why}", True)
            return
        self._put(settings, ended.answer)
