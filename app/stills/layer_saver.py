"""Saves pictures with their layers (`app.stills.picture_layers`) while the editor goes on.

A picture of every light takes as long as several stills, so a process of its own draws it, at low priority: the worker
goes on with what the user edits. It is given the document as a session, and tells its progress in lines of JSON on its
standard output. `python -m app.stills.layer_saver SESSION OUTPUT` is the process; it ends with the one that started it.
Rejected: a request to the worker, whose quick jobs would delay all slow ones, and whose slow ones this would delay.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import threading
from dataclasses import replace
from pathlib import Path

from app.document.document import Document
from app.document.view_state import ViewState
from app.system.atomic import require_place, write_atomically
from app.system.lazy_import import IMPORT_FOLDER, qualified
from app.system.paths import log_directory
from app.system.system import end_with_parent, lower_priority
from engine.core.errors import InsituError

NICENESS = 10
FAILED = "the layers could not be drawn: a bug in Insitu"


class LayerSaver:
    """Saves one picture with layers at a time."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._path = Path()
        self._session: Path | None = None
        self._lock = threading.Lock()
        self._fraction = 0.0
        self._messages: list[tuple[str, bool]] = []

    @property
    def is_busy(self) -> bool:
        """Whether a picture is being drawn."""
        return self._process is not None

    @property
    def progress(self) -> str:
        """What is being saved, and how much of it is done; "" for nothing."""
        return f"saving {self._path.name} {self._fraction:.0%}" if self.is_busy else ""

    def save(self, document: Document, view: ViewState, path: Path) -> None:
        """Begin to draw the document's picture with its layers for a file. Raises InsituError where that cannot be
        written, or another is being drawn."""
        from app.files.session import dump_session

        if self.is_busy:
            raise InsituError(f"{path.name}: {self._path.name} is still being saved; wait, or stop it")
        require_place(path)
        handle, name = tempfile.mkstemp(suffix=".insitu")
        os.close(handle)
        self._path, self._session, self._fraction = path, Path(name), 0.0
        text = dump_session(document, replace(view, bookmarks=()))
        write_atomically(self._session, text.encode())
        places = dict.fromkeys([str(IMPORT_FOLDER), *(place for place in sys.path if place)])
        command = [sys.executable, "-P", "-m", qualified("app.stills.layer_saver"), name, str(path), str(os.getpid())]
        with open(log_directory() / "layers.log", "ab") as log:
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(places)},
            )  # fmt: skip
        threading.Thread(target=self._follow, args=(self._process, path), daemon=True).start()

    def stop(self) -> None:
        """Stop drawing; the file stays as it was."""
        process = self._process
        if process is not None:
            self._end()
            with self._lock:
                self._messages.append((f"stopped saving {self._path.name}", False))

    def finished_messages(self) -> list[tuple[str, bool]]:
        """A line for the user for each that has ended, and whether it failed."""
        with self._lock:
            messages, self._messages = self._messages, []
        if messages and self._process is not None:
            self._end()
        return messages

    def close(self) -> None:
        """End what is under way."""
        self._end()

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
        if self._session is not None:
            self._session.unlink(missing_ok=True)
            self._session = None

    def _follow(self, process: subprocess.Popen[bytes], path: Path) -> None:
        """In a thread: take the process's lines until it ends."""
        assert process.stdout is not None
        told = ""
        with process.stdout as lines:
            for line in lines:
                with contextlib.suppress(ValueError):
                    said = json.loads(line)
                    self._fraction = said.get("fraction", self._fraction)
                    if told := said.get("saved", "") or said.get("refused", ""):
                        break
            else:
                said = {}
        with self._lock:
            if process is self._process:  # not stopped meanwhile
                self._messages.append((told or f"{path.name}: {FAILED}", "saved" not in said))


def main(session: str, output: str) -> None:
    """Draw the picture of a session with its layers, and write it; tell how far it is."""
    from app.project.project import open_project
    from app.stills.picture_layers import render_layers
    from app.stills.stills import write_picture
    from app.system.kernel_cache import use_kernel_cache

    def tell(**what: object) -> None:
        print(json.dumps(what), flush=True)

    use_kernel_cache()
    try:
        still = render_layers(open_project(session), lambda step: tell(fraction=step.fraction))
        said = "" if still.error is None else still.error.text
        write_picture(Path(output), still.picture, comment=said, layers=still.layers)
    except InsituError as error:
        tell(refused=str(error))
        return
    tell(saved="; ".join(filter(None, (f"saved {output} with {len(still.layers)} layers", said, still.warning))))


if __name__ == "__main__":
    end_with_parent(int(sys.argv[3]))
    lower_priority(NICENESS)
    main(sys.argv[1], sys.argv[2])
