"""Saves pictures with their layers (`app.stills.picture_layers`), and contact sheets, while the editor goes on.

A picture of every light, or of every look, takes as long as several stills, so a process of its own draws it, at low
priority: the worker goes on with what the user edits. It is given the document as a session, and tells its progress in
lines of JSON on its standard output. `python -m app.stills.layer_saver SESSION OUTPUT PARENT` is the process; it ends
with its parent. A PNG is a contact sheet, an EXR has layers. Rejected: a request to the worker, whose quick jobs would
delay all slow ones, and whose slow ones this would delay.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import threading
from dataclasses import dataclass, replace
from pathlib import Path

from app.document.document import Document
from app.document.view_state import ViewState
from app.system.atomic import require_place, sweep_temporaries
from app.system.lazy_import import program_environment, qualified
from app.system.paths import log_directory, open_log
from app.system.system import end_with_parent, lower_priority
from app.worker.process import LITTLE, NICENESS, yield_to_window
from engine.core.errors import InsituError
from engine.render.crop import Crop

LOG = "layers.log"
_PATIENCE_S = 5.0


@dataclass
class _Picture:
    """A picture that is being drawn. fraction: how much is done; process: once it is started."""

    path: Path
    document: Document
    view: ViewState
    fraction: float = 0.0
    process: subprocess.Popen[bytes] | None = None
    is_stopped: bool = False


class LayerSaver:
    """Saves one picture with layers, or one contact sheet, at a time."""

    def __init__(self) -> None:
        self._picture: _Picture | None = None
        self._thread = threading.Thread()
        self._lock = threading.Lock()
        self._messages: list[tuple[str, bool]] = []

    @property
    def is_busy(self) -> bool:
        """Whether a picture is being drawn."""
        return self._picture is not None

    @property
    def progress(self) -> str:
        """What is being saved, and how much of it is done; "" for nothing."""
        picture = self._picture
        return "" if picture is None else f"saving {picture.path.name} {picture.fraction:.0%}"

    def save(self, document: Document, view: ViewState, path: Path) -> None:
        """Begin to draw the document's picture with its layers, or its contact sheet, for a file. Raises InsituError
        where that cannot be written, or another is being drawn."""
        if self._picture is not None:
            raise InsituError(f"{path.name}: {self._picture.path.name} is still being saved; wait, or stop it")
        require_place(path)
        self._picture = _Picture(path, document, replace(view, bookmarks=()))
        self._thread = threading.Thread(target=self._draw, args=(self._picture,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Stop drawing; the file stays as it was."""
        with self._lock:
            picture, self._picture = self._picture, None
            if picture is not None:
                picture.is_stopped = True
                if picture.process is not None:
                    picture.process.kill()

    def finished_messages(self) -> list[tuple[str, bool]]:
        """A line for the user for each that has ended, and whether it failed."""
        with self._lock:
            messages, self._messages = self._messages, []
        return messages

    def close(self) -> None:
        """Stop what is under way, and wait until its temporary files are gone."""
        self.stop()
        if self._thread.ident is not None:
            self._thread.join(_PATIENCE_S)

    def _draw(self, picture: _Picture) -> None:
        """In a thread, because to write the session and to start a process takes more than a frame has: draw a picture,
        until it is written or stopped."""
        name, said = picture.path.name, ""
        try:
            with tempfile.TemporaryDirectory(prefix="insitu-", ignore_cleanup_errors=True) as folder:
                said, failed = self._run(picture, Path(folder))
        except (OSError, InsituError) as error:
            said, failed = f"{name}: it could not be drawn, {error}", True
        if picture.is_stopped:
            sweep_temporaries(picture.path.parent, name)
            if failed:
                said, failed = f"stopped saving {name}", False
        with self._lock:
            self._messages.append((said, failed))
            if self._picture is picture:
                self._picture = None

    def _run(self, picture: _Picture, folder: Path) -> tuple[str, bool]:
        """Run the process of a picture, whose session is written to a folder; returns its last words, and whether it
        failed. Raises OSError and InsituError."""
        from app.files.session import dump_session

        session = folder / "picture.insitu"
        session.write_text(dump_session(picture.document, picture.view), encoding="utf-8")
        command = [sys.executable, "-P", "-m", qualified("app.stills.layer_saver")]
        command += [str(session), str(picture.path), str(os.getpid()), json.dumps(picture.view.crop)]
        with open_log(LOG) as log, self._lock:
            if picture.is_stopped:
                return "", True
            picture.process = process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, env=program_environment()
            )
        said, failed = "", True
        with process:
            assert process.stdout is not None
            for line in process.stdout:
                with contextlib.suppress(ValueError):  # a library's words
                    words = json.loads(line)
                    picture.fraction = words.get("fraction", picture.fraction)
                    if "said" in words:
                        said, failed = words["said"], words["failed"]
        return said or f"{picture.path.name}: {_how_it_ended(process.returncode)}", failed


def _how_it_ended(status: int) -> str:
    """Why a process that said nothing has drawn no layers."""
    if status < 0:
        return f"it was not drawn, signal {-status} ended the process; is memory short?"
    return f"it could not be drawn: a bug in Insitu (for a report: {log_directory() / LOG})"


def main(session: str, output: str, crop: Crop | None) -> None:
    """Draw the picture of a session with its layers, or its contact sheet, and write it; tell how far it is. crop: what
    is written of the picture."""
    from app.project.project import open_project
    from app.stills.contact_sheet import render_sheet, sheet_of, write_sheet
    from app.stills.picture_layers import render_layers
    from app.stills.stills import Shown, write_picture
    from app.system.kernel_cache import use_kernel_cache

    def tell(**what: object) -> None:
        try:
            print(json.dumps(what), flush=True)
        except OSError:  # the parent has ended
            os._exit(0)

    use_kernel_cache()
    try:
        project = open_project(session)
        shutil.rmtree(Path(session).parent, ignore_errors=True)  # the parent may be killed before it does
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
    end_with_parent(int(sys.argv[3]))
    yield_to_window()
    lower_priority(NICENESS - LITTLE)
    sides = json.loads(sys.argv[4])
    main(sys.argv[1], sys.argv[2], sides and Crop.checked(sides))
