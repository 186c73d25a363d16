"""Pictures of looks beside the one that is edited: finished ones, drawn while the editor goes on.

A process of its own draws them, one after the other, at low priority, as `app.stills.layer_saver` does: the worker goes
on with the look that is edited. Each is drawn coarsely first, and stays until what it was made of changes. The process
keeps the scene; what is no longer wanted is stopped between two of its steps. Both ends exchange pickled values, as
window and worker do, in a thread here. `python -m app.stills.look_pictures PARENT` is the process.

A picture is that of `insitu render --look` in the same resolution, to the bit. Rejected: transport kept from one look
to the next, which those of other materials could share, but which takes as much memory as the editor's own.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import IO, TYPE_CHECKING, Any, get_args

import numpy as np
from numpy.typing import NDArray

from app.document.document import Document
from app.document.looks import in_look
from app.document.view_state import LooksShown
from app.system.lazy_import import program_environment, qualified
from app.system.paths import log_directory, open_log
from app.system.system import end_with_parent, lower_priority
from app.worker.process import LITTLE, NICENESS, yield_to_window
from engine.core.errors import InsituError
from engine.scene.description import Camera
from engine.settings import RenderSettings

if TYPE_CHECKING:
    from app.project.project import Project

LOG = "looks.log"
# A coarse picture has this share of the sides of the finished one.
COARSE = 0.25
# A view that has just changed is drawn after so many seconds without another change.
IDLE_SECONDS = 0.4
# Pictures that are kept, those of looks that are not shown among them.
MOST_PICTURES = 12
# Of a pixel: four floats of linear light, and what is on screen of them.
PICTURE_BYTES, SCREEN_BYTES = 16, 4
# Of a process that draws stills besides what precomputing takes, whose estimate may be an eighth too low: on teatray
# 291 MiB more at 512 x 384 and 275 at 128 x 96, on cornell 211, of kernels, of finer light and of trials.
STILL_BYTES, STILL_ERROR, POSED_TRIANGLE_BYTES = 320 << 20, 0.125, 150


@dataclass(frozen=True)
class LookView:
    """A look to draw: its document, which knows of no others, from a camera in a resolution (width, height). opening:
    tells scenes apart that were opened one after the other under the same name."""

    document: Document
    camera: Camera
    resolution: tuple[int, int]
    settings: RenderSettings
    opening: int = 0

    @property
    def coarse(self) -> LookView:
        """The same in few pixels."""
        width, height = (max(round(COARSE * side), 1) for side in self.resolution)
        return replace(self, resolution=(width, height))


@dataclass(frozen=True, eq=False)
class LookPicture:
    """A picture of a look, linear (H, W, 3 or 4), and the view that it was drawn for, maybe coarsely."""

    of: LookView
    radiance: NDArray[np.float32]
    is_coarse: bool


def look_alone(document: Document, name: str) -> Document:
    """The document of one look, which knows of no others."""
    return replace(in_look(document, name), looks=())


def looks_memory(precomputing_bytes: float, n_triangles: int, resolution: tuple[int, int]) -> tuple[float, float]:
    """The most main memory and memory of the GPU, in bytes, that pictures of looks in a resolution (width, height) take
    besides the editor's own: of the process that draws them, with the scene in a look's pose; of the pictures
    that are kept, and the one that comes; and of textures of those that are shown: of each its light, what is on screen
    and a copy of that."""
    n_pixels = resolution[0] * resolution[1]
    process = (1.0 + STILL_ERROR) * precomputing_bytes + STILL_BYTES + n_triangles * POSED_TRIANGLE_BYTES
    pictures = (MOST_PICTURES + 1) * n_pixels * PICTURE_BYTES
    return process + pictures, max(get_args(LooksShown)) * n_pixels * (PICTURE_BYTES + 2 * SCREEN_BYTES)


@dataclass(frozen=True)
class _Job:
    number: int
    name: str
    view: LookView
    is_coarse: bool


class LookPictures:
    """The pictures of looks by name. `draw` starts the process, and a picture at a time."""

    def __init__(self) -> None:
        self._wanted: dict[str, LookView] = {}
        self._wanted_since = float("-inf")
        self._pictures: dict[str, LookPicture] = {}
        self._failed: dict[str, tuple[LookView, str]] = {}
        self._job: _Job | None = None
        self._fraction = 0.0
        self._number = 0
        self._answers: queue.SimpleQueue[tuple[int, str, Any]] = queue.SimpleQueue()
        self._painter: _Painter | None = None
        self._stopped = False

    @property
    def pictures(self) -> Mapping[str, LookPicture]:
        """What was drawn last of each look."""
        return self._pictures

    @property
    def n_bytes(self) -> int:
        """Of all pictures that are kept."""
        return sum(each.radiance.nbytes for each in self._pictures.values())

    @property
    def process(self) -> int | None:
        """The process that draws, None where there is none."""
        return None if self._painter is None else self._painter.pid

    @property
    def is_finished(self) -> bool:
        """Whether nothing is left to draw of what is wanted."""
        return not self._stopped and self._next() is None and self._job is None

    @property
    def is_due(self) -> bool:
        """Whether something waits to be begun, which another frame does once it rests."""
        return self._job is None and not self._stopped and self._next() is not None

    @property
    def is_stopped(self) -> bool:
        """Whether drawing was stopped, until something changes."""
        return self._stopped

    @property
    def progress(self) -> str:
        """The look that is being drawn, and how much of it is done; "" for none."""
        return "" if self._job is None else f"drawing {self._job.name} {self._fraction:.0%}"

    def is_current(self, name: str) -> bool:
        """Whether the picture of a look is finished, and of what is wanted now."""
        picture = self._pictures.get(name)
        return picture is not None and not picture.is_coarse and picture.of == self._wanted.get(name)

    def is_outdated(self, name: str) -> bool:
        """Whether the picture of a look, if there is one, is of something else than what is wanted now."""
        picture = self._pictures.get(name)
        return picture is not None and picture.of != self._wanted.get(name)

    def state(self, name: str) -> str:
        """What the user is told of a look's picture: "" where it is finished."""
        if self.is_current(name):
            return ""
        failed = self._failed.get(name)
        if failed is not None and failed[0] == self._wanted.get(name):
            return failed[1]
        if self._stopped:
            return "stopped"
        is_drawn = self._job is not None and self._job.name == name
        return f"updating {self._fraction:.0%}" if is_drawn else "updating"

    def want(self, now: float, views: Mapping[str, LookView]) -> None:
        """What is to be shown, by the names of looks; once a frame. Begins what is missing, once it rests."""
        if dict(views) != self._wanted:
            for name, view in views.items():  # a look that was renamed, or is like another one
                same = (each for each in self._pictures.values() if each.of == view and not each.is_coarse)
                if (picture := next(same, None)) is not None:
                    self._pictures[name] = picture
            self._wanted, self._wanted_since, self._stopped = dict(views), now, False
            others = [name for name in self._pictures if name not in views]
            for name in others[: max(len(self._pictures) - MOST_PICTURES, 0)]:
                del self._pictures[name]
        self._stop_unwanted()
        if self._job is None and now - self._wanted_since >= IDLE_SECONDS and not self._stopped:
            job = self._next()
            if job is not None:
                self._begin(job)
            elif not self._wanted:
                self.close()

    def take(self) -> bool:
        """Take what has come from the process; returns whether there is something new."""
        is_new = False
        with contextlib.suppress(queue.Empty):
            while True:
                number, what, value = self._answers.get_nowait()
                is_new |= self._take(number, what, value)
        return is_new

    def stop(self) -> None:
        """Stop drawing, until what is wanted changes."""
        self._stopped = self._stopped or self._job is not None or self._next() is not None
        self._send(None)
        self._job = None

    def resume(self) -> None:
        """Go on with what was stopped."""
        self._stopped = False

    def close(self, patience_s: float = 0.0) -> None:
        """End the process, and wait so long until it has; pictures stay."""
        painter, self._painter, self._job = self._painter, None, None
        if painter is not None:
            painter.close(patience_s)

    # ----------------------------------------------------------------------------------------------------------- inside

    def _next(self) -> _Job | None:
        """What is to be drawn next: all coarsely first."""
        due = [
            (name, view) for name, view in self._wanted.items()
            if not self.is_current(name) and self._failed.get(name, (None, ""))[0] != view
        ]  # fmt: skip
        for name, view in due:
            picture = self._pictures.get(name)
            if picture is None or picture.of != view:
                return _Job(0, name, view, True)
        return _Job(0, *due[0], False) if due else None

    def _stop_unwanted(self) -> None:
        job = self._job
        if job is not None and self._wanted.get(job.name) != job.view:
            self._send(None)
            self._job = None

    def _begin(self, job: _Job) -> None:
        self._number += 1
        self._job, self._fraction = replace(job, number=self._number), 0.0
        if self._painter is None:
            self._painter = _Painter(self._answers)
        self._send((self._number, job.view.coarse if job.is_coarse else job.view))

    def _send(self, what: tuple[int, LookView] | None) -> None:
        """Give the process something to draw, None: nothing."""
        if self._painter is not None:
            self._painter.put(what)

    def _take(self, number: int, what: str, value: Any) -> bool:
        job = self._job
        if what == "ended" and value is self._painter:
            self._painter = None
        elif what == "ended" or job is None or number != job.number:
            return False
        if job is None:
            return False
        if what == "fraction":
            self._fraction = value
        elif what == "picture":
            self._pictures[job.name] = LookPicture(job.view, value, job.is_coarse)
            self._job = None
        else:
            said = value if what == "failed" else f"could not be drawn: a bug in Insitu ({log_directory() / LOG})"
            self._fail(job, said)
        return True

    def _fail(self, job: _Job, said: str) -> None:
        self._failed[job.name] = job.view, said
        self._job = None


class _Painter:
    """A process that draws, from here. Threads start it, write to it and read from it: a start takes longer than a
    frame has, and a large scene or a picture is more than a pipe holds. answers: what it says, with the number of the
    request; its end as (0, "ended", this)."""

    def __init__(self, answers: queue.SimpleQueue[tuple[int, str, Any]]) -> None:
        self._answers, self._requests = answers, queue.SimpleQueue[Any]()
        self._lock, self._closed = threading.Lock(), False
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def pid(self) -> int | None:
        """Its number, None before it has started."""
        return None if self._process is None else self._process.pid

    def put(self, request: tuple[int, LookView] | None) -> None:
        """Give it something to draw, None: nothing."""
        self._requests.put(request)

    def close(self, patience_s: float = 0.0) -> None:
        """End it, and wait so long until it has."""
        with self._lock:
            self._closed = True
            if self._process is not None:
                self._process.kill()
        if patience_s:
            self._thread.join(patience_s)

    def _run(self) -> None:
        """In a thread: start the process, and read what it says until it ends."""
        command = [sys.executable, "-P", "-m", qualified("app.stills.look_pictures"), str(os.getpid())]
        try:
            with open_log(LOG) as log, self._lock:
                if self._closed:
                    return
                self._process = process = subprocess.Popen(
                    command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, env=program_environment()
                )
        except OSError:
            self._answers.put((0, "ended", self))
            return
        writer = threading.Thread(target=self._write, args=(process,), daemon=True)
        writer.start()
        assert process.stdout is not None
        with contextlib.suppress(OSError, EOFError, pickle.UnpicklingError):
            while True:
                self._answers.put(pickle.load(process.stdout))
        self._answers.put((0, "ended", self))
        self._requests.put(None)  # so that the other thread ends as well
        writer.join()
        with contextlib.suppress(OSError), process:  # closes what is open
            process.kill()

    def _write(self, process: subprocess.Popen[bytes]) -> None:
        """In a thread: give the process what it is to draw."""
        assert process.stdin is not None
        with contextlib.suppress(OSError):
            while process.poll() is None:
                pickle.dump(self._requests.get(), process.stdin)
                process.stdin.flush()


# ---------------------------------------------------------------------------------------------------------- the process


class _StoppedError(Exception):
    """The picture is no longer wanted."""


class _OpenScene:
    """The scene that looks are drawn of."""

    def __init__(self) -> None:
        self._project: Project | None = None
        self._opened: tuple[str, int] | None = None

    def project(self, view: LookView) -> Project:
        """The look, loaded and posed; what it has in common with the one before is shared. Raises InsituError."""
        from app.document.named_files import layers_of_document
        from app.document.view_state import Viewpoint
        from app.project.project import open_project
        from app.worker.cache import ArrayCache
        from app.worker.file_tasks import ensure_tables
        from engine.core.generators import run_to_end

        opened = view.document.source, view.opening
        if self._project is None or self._opened != opened:
            self._project, self._opened = open_project(view.document.source, view.resolution), opened
        run_to_end(ensure_tables(layers_of_document(view.document), ArrayCache()))
        edited = self._project.edited(view.document, Viewpoint(view.camera, view.resolution))
        self._project = replace(edited, settings=view.settings)
        return self._project


def _draw_all(inlet: IO[bytes], outlet: IO[bytes]) -> None:
    """Draw what is wanted last, until the other end is closed."""
    from app.stills.stills import StillProgress, render_picture

    wanted: queue.SimpleQueue[tuple[int, LookView] | None] = queue.SimpleQueue()
    threading.Thread(target=_read_requests, args=(inlet, wanted), daemon=True).start()
    scene = _OpenScene()

    def tell(number: int, what: str, value: object) -> None:
        pickle.dump((number, what, value), outlet)
        outlet.flush()

    while True:
        request = wanted.get()
        while not wanted.empty():
            request = wanted.get()
        if request is None:
            continue
        number, view = request

        def follow(step: StillProgress, number: int = number) -> None:
            if not wanted.empty():
                raise _StoppedError
            tell(number, "fraction", step.fraction)

        try:
            tell(number, "picture", render_picture(scene.project(view), follow))
        except _StoppedError:
            continue
        except InsituError as refusal:
            tell(number, "failed", str(refusal))


def _read_requests(inlet: IO[bytes], wanted: queue.SimpleQueue[tuple[int, LookView] | None]) -> None:
    with contextlib.suppress(OSError, EOFError):
        while True:
            wanted.put(pickle.load(inlet))
    os._exit(0)  # the parent has ended, or has no more use for it


def main() -> None:
    """Draw looks for the process at the other end; what libraries print goes to the log."""
    from app.system.kernel_cache import use_kernel_cache

    outlet = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    use_kernel_cache()
    with contextlib.suppress(BrokenPipeError):
        _draw_all(sys.stdin.buffer, outlet)


if __name__ == "__main__":
    end_with_parent(int(sys.argv[1]))
    yield_to_window()
    lower_priority(NICENESS - LITTLE)
    main()
