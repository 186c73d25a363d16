"""Saves pictures with their layers (`app.stills.picture_layers`), and contact sheets, while the editor goes on.

A picture of every light, or of every look, takes as long as several stills, so a process of its own draws it
(`app.worker.session_process`): the worker goes on with what the user edits. `python -m app.stills.layer_saver SESSION
PARENT OUTPUT CROP` is the process. A PNG is a contact sheet, an EXR has layers. Rejected: a request to the worker,
whose quick jobs would delay all slow ones, and whose slow ones this would delay.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

from app.document.document import Document
from app.document.view_state import ViewState
from app.system.atomic import require_place, sweep_temporaries
from app.worker.session_process import SessionProcess, SessionTask, begin_child, open_session, tell
from engine.core.errors import InsituError
from engine.render.crop import Crop

LOG = "layers.log"


class LayerSaver:
    """Saves one picture with layers, or one contact sheet, at a time."""

    def __init__(self) -> None:
        self._drawing = SessionProcess("app.stills.layer_saver", LOG, "drawn", _sweep)

    @property
    def is_busy(self) -> bool:
        """Whether a picture is being drawn."""
        return self._drawing.task is not None

    @property
    def progress(self) -> str:
        """What is being saved, and how much of it is done; "" for nothing."""
        return self._drawing.progress("saving")

    def save(self, document: Document, view: ViewState, path: Path) -> None:
        """Begin to draw the document's picture with its layers, or its contact sheet, for a file. Raises InsituError
        where that cannot be written, or another is being drawn."""
        if (task := self._drawing.task) is not None:
            raise InsituError(f"{path.name}: {task.name} is still being saved; wait, or stop it")
        require_place(path)
        arguments = str(path), json.dumps(view.crop)
        self._drawing.begin(SessionTask(path.name, document, replace(view, bookmarks=()), arguments))

    def stop(self) -> None:
        """Stop drawing; the file stays as it was."""
        self._drawing.stop()

    def finished_messages(self) -> list[tuple[str, bool]]:
        """A line for the user for each that has ended, and whether it failed."""
        return [
            (f"stopped saving {task.name}", False) if task.is_stopped and task.failed else (task.said, task.failed)
            for task in self._drawing.take_ended()
        ]

    def close(self) -> None:
        """Stop what is under way, and wait until its temporary files are gone."""
        self._drawing.close()


def _sweep(task: SessionTask) -> None:
    """Remove what a process that was stopped has left beside its file."""
    path = Path(task.arguments[0])
    sweep_temporaries(path.parent, path.name)


def main(session: str, output: str, crop: Crop | None) -> None:
    """Draw the picture of a session with its layers, or its contact sheet, and write it; tell how far it is. crop: what
    is written of the picture."""
    from app.stills.contact_sheet import render_sheet, sheet_of, write_sheet
    from app.stills.picture_layers import render_layers
    from app.stills.stills import Shown, write_picture

    try:
        project = open_session(session)
        if Path(output).suffix.lower() == ".png":
            sheet = sheet_of(project)
            pictures = render_sheet(project, sheet, lambda step: tell(fraction=step.fraction))
            write_sheet(Path(output), pictures, sheet, project.view)
            tell(said=f"saved {output} with {len(pictures)} looks", failed=False)
            return
        still = render_layers(project, lambda step: tell(fraction=step.fraction))
        error = "" if still.error is None else still.error.text
        write_picture(Path(output), still.picture, comment=error, layers=still.layers, shown=Shown(crop=crop))
    except InsituError as refusal:
        tell(said=str(refusal), failed=True)
        return
    said = "; ".join(filter(None, (f"saved {output} with {len(still.layers)} layers", error, still.warning)))
    tell(said=said, failed=False)


if __name__ == "__main__":
    file, (path, sides) = begin_child()
    crop = json.loads(sides)
    main(file, path, crop and Crop.checked(crop))
