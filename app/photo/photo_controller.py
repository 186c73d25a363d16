"""Matching a picture in the editor (`app.editor.background_match`): the answer is one step of the history, and of the
view's where the camera was aligned; the photograph is stored to be compared with.

What was found last is kept as long as the scene is open: the curve panel shows how far its curves are determined, while
they are as they were found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.document.commands.light import SetRotation
from app.document.commands.mix import SetMix
from app.document.document import Document
from app.document.linked_layers import Layers
from app.editor.background_match import BackgroundMatch, Matcher
from app.editor.editor import Editor
from app.photo.apply_answer import apply_answer
from app.photo.match_refusal import match_refusal
from app.photo.match_settings import MatchAnswer, MatchSettings, result_line
from app.photo.photo_matcher import PhotoMatcher
from engine.core.errors import InsituError
from engine.inverse.photo_targets import Target

# The edits of what is found of the light.
LIGHT_EDITS = (SetRotation, SetMix)


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


class PhotoController(BackgroundMatch[MatchSettings, MatchAnswer]):
    """The matches of photographs in one editor. found: what the last one has left."""

    WHAT = "a picture"

    def __init__(self, editor: Editor, matcher: Matcher[MatchSettings, MatchAnswer] | None = None) -> None:
        super().__init__(editor, matcher or PhotoMatcher())
        self._light = editor.document.light  # when the match began
        self.found: Found | None = None

    def begin(self, settings: MatchSettings) -> None:
        """Begin a match. Raises InsituError."""
        if refusal := match_refusal(self._editor.document, settings):
            raise InsituError(refusal)
        self._begin(settings, settings.file.name, settings.object)
        self._light = self._editor.document.light

    def _scene_changed(self) -> None:
        self.found = None

    def _put(self, settings: MatchSettings, answer: MatchAnswer) -> None:
        editor = self._editor
        commands, notes = answer.edit.commands, answer.notes
        if editor.document.light != self._light and any(isinstance(each, LIGHT_EDITS) for each in commands):
            commands = tuple(each for each in commands if not isinstance(each, LIGHT_EDITS))
            notes = (*notes, "the light stays as it was edited meanwhile")
        edit = replace(answer.edit, commands=(*settings.begin, *commands))
        answer = replace(answer, edit=edit, notes=notes)
        is_made, refusal = apply_answer(editor, answer)
        if not is_made:
            return
        self.found = Found(settings, answer, editor.document.object(settings.object).layers)
        try:
            editor.stored.store_file(answer.light, settings.file)
        except InsituError as error:
            refusal = "; ".join(filter(None, (refusal, f"the photograph is not compared: {error}")))
        editor.notify("; ".join(filter(None, (result_line(answer), refusal))))
