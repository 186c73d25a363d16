"""Matching a picture in the editor: one match at a time, whose answer is one step of the history, and of the
view's where the camera was aligned.

    idle ── begin ──► matching ── answer ──► applied, as one edit; the photograph is stored to be compared with
                         │
                         ├── stop, another scene ──► idle, nothing changed
                         └── refused: the process says why, or the object has other layers by then

What was found last is kept as long as the scene is open: the curve panel shows how far its curves are determined, while
they are as they were found.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.editor.editor import Editor
from app.photo.apply_answer import apply_answer
from app.photo.match_refusal import match_refusal
from app.photo.match_settings import MatchAnswer, MatchSettings, result_line
from app.photo.photo_matcher import Ended, PhotoMatcher
from engine.core.errors import InsituError
from engine.inverse.photo_targets import Target
from engine.material.layer import Layer

Layers = tuple[Layer, ...]


class Matcher(Protocol):
    """What it needs of `PhotoMatcher`."""

    @property
    def progress(self) -> str: ...

    def begin(self, document: Document, view: object, settings: MatchSettings) -> None: ...

    def stop(self) -> None: ...

    def close(self) -> None: ...

    def take_ended(self) -> list[Ended]: ...


@dataclass(frozen=True, eq=False)
class Found:
    """What a match has left: of which settings, the answer, and the object's layers then."""

    settings: MatchSettings
    answer: MatchAnswer
    layers: Layers

    def deviation(self, document: Document, key: str, curve: str) -> NDArray[np.float64] | None:
        """How far a curve is determined, (J, 3), the standard deviation of its bands; None where it is not as it was
        found."""
        owner, _, number = key.rpartition(".")
        if owner != self.settings.object or all(each.name != owner for each in document.objects):
            return None
        if document.object(owner).layers != self.layers:
            return None
        return self.answer.deviations.get(Target(int(number), curve))


class PhotoController:
    """The matches of one editor."""

    def __init__(self, editor: Editor, matcher: Matcher | None = None) -> None:
        self._editor, self._matcher = editor, matcher or PhotoMatcher()
        self._begun: tuple[MatchSettings, Layers] | None = None
        self._scene: tuple[str, int] | None = None
        self.found: Found | None = None

    @property
    def progress(self) -> str:
        """What is done, and how much of it, also while the answer waits for the end of a drag; "" for nothing."""
        if self._begun is None:
            return ""
        return self._matcher.progress or f"matched {self._begun[0].file.name}"

    def begin(self, settings: MatchSettings) -> None:
        """Begin a match. Raises InsituError."""
        editor = self._editor
        if self._begun is not None:
            raise InsituError("a picture is still being matched; wait, or stop it")
        if refusal := match_refusal(editor.document, settings):
            raise InsituError(refusal)
        layers = editor.document.object(settings.object).layers
        self._begun, self._scene = (settings, layers), self._scene_now
        self._matcher.begin(editor.pictured, editor.view, settings)

    def stop(self) -> None:
        """Stop; the document stays as it is."""
        if self._begun is not None:
            self._begun = None
            self._matcher.stop()
            self._matcher.take_ended()  # an answer that has just come is not that of the next match
            self._editor.notify("stopped matching")

    def close(self) -> None:
        """End the process."""
        self._begun = None
        self._matcher.close()

    def follow(self) -> bool:
        """Take what has come, once a frame; returns whether there is something new."""
        if self._scene is not None and self._scene != self._scene_now:
            self.stop()
            self._scene = self.found = None
        if self._begun is None or self._editor.history.dragging:  # an answer does not become part of a drag
            return False
        ended = self._matcher.take_ended()
        for each in ended:
            begun, self._begun = self._begun, None
            if begun is not None:
                self._end(each, *begun)
        return bool(ended)

    @property
    def _scene_now(self) -> tuple[str, int]:
        """The scene that is open, and the number of its opening."""
        return self._editor.document.source, self._editor.scenes.tracing.scene

    def _end(self, ended: Ended, settings: MatchSettings, layers: Layers) -> None:
        editor, answer = self._editor, ended.answer
        if answer is None:
            editor.notify(ended.line, True)
            return
        now = next((each.layers for each in editor.document.objects if each.name == settings.object), None)
        if now != layers:
            editor.notify(f"{settings.object} was edited while it was matched; match it again", True)
            return
        is_made, refusal = apply_answer(editor, answer)
        if not is_made:
            return
        self.found = Found(settings, answer, editor.document.object(settings.object).layers)
        try:
            editor.stored.store_file(answer.light, settings.file)
        except InsituError as error:
            refusal = "; ".join(filter(None, (refusal, f"the photograph is not compared: {error}")))
        editor.notify("; ".join(filter(None, (result_line(answer), refusal))))
