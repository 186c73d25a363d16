"""Matching a material in the editor (`app.editor.background_match`): the answer is one edit. Its errors are shown
as long as the object has the layer that was found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.document.document import Document
from app.document.linked_layers import Layers
from app.document.material_match import MaterialAnswer, MaterialMatch
from app.editor.background_match import BackgroundMatch, Matcher
from app.worker.material_matcher import MaterialMatcher

if TYPE_CHECKING:
    from app.editor.editor import Editor


@dataclass(frozen=True)
class MaterialMatchOutcome:
    """What a match has left: the object's layers, and the edit in words with both errors."""

    object: str
    layers: Layers
    line: str


class MaterialMatching(BackgroundMatch[MaterialMatch, MaterialAnswer]):
    """The matches of materials in one editor."""

    WHAT = "a material"

    def __init__(self, editor: Editor, matcher: Matcher[MaterialMatch, MaterialAnswer] | None = None) -> None:
        super().__init__(editor, matcher or MaterialMatcher())
        self._outcome: MaterialMatchOutcome | None = None

    def note(self, document: Document) -> tuple[str, str]:
        """The object of the last match, and it in words with both errors; "" where the document no longer has it."""
        found = self._outcome
        if found is None or all(each.name != found.object for each in document.objects):
            return "", ""
        return (found.object, found.line) if document.object(found.object).layers == found.layers else ("", "")

    def begin(self, match: MaterialMatch) -> None:
        """Begin a match, whose source is found. Raises InsituError."""
        self._begin(match, match.title, match.object)

    def _scene_changed(self) -> None:
        self._outcome = None

    def _put(self, match: MaterialMatch, answer: MaterialAnswer) -> None:
        editor, command = self._editor, match.command(answer.layer)
        if editor.do(command) is not None:
            return
        line = f"{command.name}: error {answer.errors.text}"
        self._outcome = MaterialMatchOutcome(match.object, editor.document.object(match.object).layers, line)
        editor.notify(f"{line}; its images are left out" if match.has_images else line)
