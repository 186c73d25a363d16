"""Matches a material with a model by a process of its own (`app.worker.session_process`): the worker goes on with the
picture, and measured files are read there alone. `python -m app.worker.material_matcher SESSION PARENT SETTINGS` is the
process. It traces the object's view once more; a request to the worker would make the picture wait in turn, and be void
whenever the camera moves.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from app.document.document import Document
from app.document.material_match import MaterialAnswer, MaterialMatch, MaterialMatchErrors, load_match
from app.document.view_state import ViewState
from app.files.layer_records import StrictModel
from app.files.materials import Material, dump_material, parse_material
from app.worker.session_process import SessionProcess, SessionTask, TaskAnswer, begin_child, open_session, tell
from engine.core.errors import InsituError

LOG = "material-match.log"
OPENING = "opening the scene"
WHERE = "what the match found"
Positive = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class MaterialMatcher:
    """Matches one material at a time."""

    def __init__(self) -> None:
        self._matching = SessionProcess("app.worker.material_matcher", LOG, "matched", reads=_read_answer)

    @property
    def progress(self) -> str:
        """How much is done; "" for nothing."""
        return self._matching.progress("matching")

    def begin(self, document: Document, view: ViewState, match: MaterialMatch) -> None:
        """Begin to match a material; the one before must have ended."""
        arguments = (match.dump(),)
        self._matching.begin(SessionTask(match.title, document, replace(view, bookmarks=()), arguments, stage=OPENING))

    def stop(self) -> None:
        """Stop; nothing comes of it."""
        self._matching.stop()

    def close(self) -> None:
        """Stop, and wait until temporary files are gone."""
        self._matching.close()

    def take_ended(self) -> list[TaskAnswer[MaterialAnswer]]:
        """What has come of those that have ended, but for those that were stopped."""
        return self._matching.take_answers()


def _read_answer(task: SessionTask, folder: Path) -> MaterialAnswer:
    return load_answer(task.words.get("answer"))


class _AnswerRecord(StrictModel):
    material: str
    before: Positive
    brdf: Positive
    picture: Positive | None


def dump_answer(answer: MaterialAnswer) -> dict[str, Any]:
    """The answer as JSON has it; the layer is a material of the library's form."""
    errors = answer.errors
    text = dump_material(Material("match", (answer.layer,)))
    return {"material": text, "before": errors.before, "brdf": errors.brdf, "picture": errors.picture}


def load_answer(tree: object) -> MaterialAnswer:
    """The answer that was dumped. Raises InsituError where it is none: the process has read a stranger's file."""
    try:
        record = _AnswerRecord.model_validate_json(json.dumps(tree))
    except ValidationError as error:
        raise InsituError(f"{WHERE} cannot be read: {str(error).splitlines()[0]}") from None
    layers = parse_material(record.material, WHERE).layers
    if len(layers) != 1:
        raise InsituError(f"{WHERE}: {len(layers)} layers, expected one")
    return MaterialAnswer(layers[0], MaterialMatchErrors(record.before, record.brdf, record.picture))


# ---------------------------------------------------------------------------------------------------------- the process


def main(session: str, match: MaterialMatch) -> None:
    """Match a material in the scene of a session, and tell what was found."""
    from app.project.material_matching import found_source, match_material
    from engine.core.generators import run_to_end

    try:
        project = open_session(session)
        steps = match_material(project, found_source(match, project.document))
        found = run_to_end(steps, lambda step: tell(fraction=step[0], stage=step[1]))
    except InsituError as refusal:
        tell(said=f"{match.title} was not matched: {refusal}", failed=True)
        return
    tell(said=f"matched {match.title}", failed=False, answer=dump_answer(found))


if __name__ == "__main__":
    file, (text,) = begin_child()
    main(file, load_match(text))
