"""Carries out a script's step that matches a photograph: finds the material, and takes it over as one edit."""

from __future__ import annotations

import tempfile
from pathlib import Path

from app.editor.editor import Editor
from app.files.session import dump_session
from app.operators.photos import MatchStep
from app.photo.apply_answer import apply_answer


def match_photo_step(editor: Editor, step: MatchStep) -> str:
    """Returns one line that says why what was found is refused, "" where it is not. Raises InsituError."""
    from app.photo.photo_match import match_photo
    from app.photo.photo_matcher import answer_of
    from app.project.project import open_project
    from engine.core.generators import run_to_end

    with tempfile.TemporaryDirectory(prefix="insitu-") as folder:
        session = Path(folder) / "picture.insitu"
        session.write_text(dump_session(editor.document, editor.view), encoding="utf-8")
        project = open_project(str(session))
    outcome = run_to_end(match_photo(project, step.request()))
    for line in (*outcome.lines, *outcome.notes):
        editor.notify(line)
    _, refusal = apply_answer(editor, answer_of(project, outcome))
    return refusal
