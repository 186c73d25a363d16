"""Takes over what a match of a picture found, in the window and in scripts."""

from __future__ import annotations

from app.document.view_state import Viewpoint
from app.editor.editor import Editor
from app.photo.match_settings import MatchAnswer


def apply_answer(editor: Editor, answer: MatchAnswer) -> tuple[bool, str]:
    """Make the edit, one step of the document's history, then see the scene as the photograph does, with its sides, a
    step of the view's; returns whether the edit was made, and one line where either was refused, "" otherwise."""
    refusal = editor.do(answer.edit)
    if refusal is not None:
        return False, refusal
    if answer.camera is None:
        return True, ""
    look = Viewpoint(answer.camera, (answer.light.shape[1], answer.light.shape[0]))
    refusal = editor.camera_history.set_viewpoint(look, "align the camera to a picture")
    editor.scenes.tracing.hand_released()
    return True, "" if refusal is None else f"the camera stays as it was: {refusal}"
