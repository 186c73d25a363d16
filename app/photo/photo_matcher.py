"""Matches a photograph by a process of its own (`app.worker.session_process`): a stranger's picture file is read there
alone, and the editor goes on meanwhile. `python -m app.photo.photo_matcher SESSION PARENT SETTINGS` is the process.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.document.document import Document
from app.document.view_state import ViewState
from app.photo.match_settings import MatchAnswer, MatchSettings, dump_answer, load_answer, load_settings
from app.worker.session_process import (
    SessionProcess,
    SessionTask,
    TaskAnswer,
    answer_folder,
    begin_child,
    open_session,
    tell,
)
from engine.core.errors import InsituError
from engine.inverse.camera_fit import PointPair

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from app.photo.photo_match import PhotoOutcome
    from app.project.project import Project

LOG = "match.log"
# The photograph comes back in the picture's size up to so many pixels, else in the size that was compared.
MOST_PIXELS = 1 << 20


class PhotoMatcher:
    """Matches one photograph at a time."""

    def __init__(self) -> None:
        self._matching = SessionProcess("app.photo.photo_matcher", LOG, "matched", reads=_read_answer)

    @property
    def progress(self) -> str:
        """How much is done; "" for nothing."""
        return self._matching.progress("matching")

    def begin(self, document: Document, view: ViewState, settings: MatchSettings) -> None:
        """Begin to match a photograph; the one before must have ended. Raises InsituError."""
        document = settings.begun(document)
        task = SessionTask(settings.file.name, document, replace(view, bookmarks=()), (settings.dump(),))
        self._matching.begin(task)

    def stop(self) -> None:
        """Stop; nothing comes of it."""
        self._matching.stop()

    def close(self) -> None:
        """Stop, and wait until temporary files are gone."""
        self._matching.close()

    def take_ended(self) -> list[TaskAnswer[MatchAnswer]]:
        """What has come of those that have ended, but for those that were stopped."""
        return self._matching.take_answers()


def _read_answer(task: SessionTask, folder: Path) -> MatchAnswer:
    return load_answer(str(task.words.get("answer")), folder)


# ---------------------------------------------------------------------------------------------------------- the process


def main(session: str, settings: MatchSettings) -> None:
    """Match a photograph to the scene of a session, and tell what was found."""
    from app.photo.photo_match import match_photo
    from app.photo.photo_request import PhotoRequest
    from engine.core.generators import StillProgress, run_to_end

    def follow(step: StillProgress) -> None:
        tell(fraction=step.fraction, stage=step.text)

    try:
        project = open_session(session)
        request = PhotoRequest(
            settings.object, settings.file, settings.transfer, tuple(PointPair(*pair) for pair in settings.pairs),
            settings.mask, settings.targets, exposure=settings.exposure, finds_rotation=settings.finds_rotation,
            finds_lights=settings.finds_lights, in_shares=True,
        )  # fmt: skip
        outcome = run_to_end(match_photo(project, request), follow)
        found = dump_answer(answer_of(project, outcome), answer_folder(session))
    except (InsituError, OSError) as refusal:
        tell(said=str(refusal), failed=True)
        return
    tell(said=f"matched {settings.file.name}", failed=False, answer=found)


def answer_of(project: Project, outcome: PhotoOutcome) -> MatchAnswer:
    """What the window is told of an outcome."""
    match = outcome.match
    light = _as_light(project.scene.description.camera.resolution, outcome)
    return MatchAnswer(
        outcome.edit, match.exposure, match.error, match.before, outcome.notes, match.deviations, light,
        *((None, ()) if outcome.camera is None else (outcome.camera.camera, outcome.camera.missed)),
    )  # fmt: skip


def _as_light(shown: tuple[int, int], outcome: PhotoOutcome) -> NDArray[np.float32]:
    """The photograph (H, W, 4) as light of the scene, in the size that is shown where it has that."""
    import numpy as np

    photo = outcome.photo
    fits = shown[0] * photo.size[1] == shown[1] * photo.size[0] and shown[0] <= photo.size[0]
    size = shown if fits and shown[0] * shown[1] <= MOST_PIXELS else outcome.resolution
    # All of the picture is shown, also what is too bright to be compared.
    seen = replace(photo, usable=np.ones_like(photo.usable)).resized(size).radiance / max(outcome.match.exposure, 1e-30)
    return np.concatenate([seen, np.ones_like(seen[..., :1])], axis=2, dtype=np.float32)


if __name__ == "__main__":
    file, (text,) = begin_child()
    main(file, load_settings(text))
