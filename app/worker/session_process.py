"""Long work on a document by a process of its own, at low priority, while the editor goes on; one task at a time.

The process is given the document as a session, and tells its progress in lines of JSON on its standard output: what
strangers' files do to it does nothing to the window. It ends with its parent, and is killed to stop it. A module that
is such a process calls `begin_child` first and `open_session` for its scene, and ends with `tell(said=…, failed=…)`.
What is too large for a line it writes into `answer_folder`, which a thread of the window's process reads.
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
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from app.document.document import Document
from app.document.view_state import ViewState
from app.system.lazy_import import program_environment, qualified
from app.system.paths import log_directory, open_log
from app.system.system import end_with_parent, lower_priority
from app.worker.process import LITTLE, NICENESS, yield_to_window
from engine.core.errors import InsituError

if TYPE_CHECKING:
    from app.project.project import Project

Answer = TypeVar("Answer")
_PATIENCE_S = 5.0


@dataclass
class SessionTask:
    """What is to be done with a document. name: what it is called to the user; arguments: of the process; fraction: how
    much is done; stage: what is being done; process: once it is started; words: what it has told; result: what
    was read of that, None where it failed."""

    name: str
    document: Document
    view: ViewState
    arguments: tuple[str, ...] = ()
    fraction: float = 0.0
    stage: str = ""
    process: subprocess.Popen[bytes] | None = None
    is_stopped: bool = False
    words: dict[str, Any] = field(default_factory=dict)
    result: Any = None

    @property
    def said(self) -> str:
        """Its last words, in a line."""
        return str(self.words.get("said", ""))

    @property
    def failed(self) -> bool:
        """Whether it failed."""
        return bool(self.words.get("failed", True))


class TaskAnswer(NamedTuple, Generic[Answer]):
    """What a task was for. answer: its result, None where there is none: line says why."""

    answer: Answer | None
    line: str = ""


class SessionProcess:
    """The tasks of one module. log: the file of what its process prints; done: what its tasks are when they have
    succeeded, such as "drawn"; cleans: called in a thread when a task was stopped; reads: called in a thread when
    one has succeeded, with the folder of its answer: returns the task's result, or raises InsituError."""

    def __init__(
        self, module: str, log: str, done: str, cleans: Callable[[SessionTask], None] = lambda task: None,
        reads: Callable[[SessionTask, Path], Any] = lambda task, folder: None,
    ) -> None:  # fmt: skip
        self._module, self._log, self._done, self._cleans, self._reads = module, log, done, cleans, reads
        self.task: SessionTask | None = None
        self._thread = threading.Thread()
        self._lock = threading.Lock()
        self._ended: list[SessionTask] = []

    def begin(self, task: SessionTask) -> None:
        """Begin a task; the one before must have ended, or been stopped."""
        self.task = task
        self._thread = threading.Thread(target=self._carry_out, args=(task,), daemon=True)
        self._thread.start()

    def stop(self) -> SessionTask | None:
        """Stop what is under way; returns it."""
        with self._lock:
            task, self.task = self.task, None
            if task is not None:
                task.is_stopped = True
                if task.process is not None:
                    task.process.kill()
        return task

    def take_ended(self) -> list[SessionTask]:
        """The tasks that have ended since, or were stopped."""
        with self._lock:
            ended, self._ended = self._ended, []
        return ended

    def take_answers(self) -> list[TaskAnswer[Any]]:
        """What has come of the tasks that have ended since, but for those that were stopped."""
        return [TaskAnswer(task.result, task.said) for task in self.take_ended() if not task.is_stopped]

    def progress(self, doing: str) -> str:
        """What is being done, such as "saving", how much of it, and at what it is; "" for nothing."""
        task = self.task
        return "" if task is None else " ".join(filter(None, (doing, task.name, f"{task.fraction:.0%}", task.stage)))

    def close(self) -> None:
        """Stop what is under way, and wait until its temporary files are gone."""
        self.stop()
        if self._thread.ident is not None:
            self._thread.join(_PATIENCE_S)

    def _carry_out(self, task: SessionTask) -> None:
        """In a thread, because to write the session and to start a process takes more than a frame has: until the task
        has ended."""
        try:
            with tempfile.TemporaryDirectory(prefix="insitu-", ignore_cleanup_errors=True) as folder:
                self._run(task, Path(folder))
                if not task.failed and not task.is_stopped:
                    task.result = self._reads(task, Path(folder))
        except (OSError, InsituError) as error:
            task.words = {"said": f"{task.name}: it could not be {self._done}, {error}"}
        except Exception as error:  # a bug, or no memory: whatever it is, the task must end
            task.words = {"said": f"{task.name}: it could not be {self._done}: {type(error).__name__} {error}"}
        finally:
            if task.is_stopped:
                self._cleans(task)
            with self._lock:
                self._ended.append(task)
                if self.task is task:
                    self.task = None

    def _run(self, task: SessionTask, folder: Path) -> None:
        """Run the process of a task, whose session is written to a folder. Raises OSError and InsituError."""
        from app.files.session import dump_session

        session = folder / "document.insitu"
        session.write_text(dump_session(task.document, task.view), encoding="utf-8")
        command = [sys.executable, "-P", "-m", qualified(self._module), str(session), str(os.getpid())]
        with open_log(self._log) as log, self._lock:
            if task.is_stopped:
                return
            task.process = process = subprocess.Popen(
                [*command, *task.arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log,
                env=program_environment(),
            )  # fmt: skip
        with process:
            assert process.stdout is not None
            for line in process.stdout:
                with contextlib.suppress(ValueError, AttributeError):  # a library's words
                    words = json.loads(line)
                    task.fraction = words.get("fraction", task.fraction)
                    task.stage = words.get("stage", task.stage)
                    task.words = words if "said" in words else task.words
        if not task.said:
            task.words = {"said": f"{task.name}: {self._how_it_ended(process.returncode)}"}

    def _how_it_ended(self, status: int) -> str:
        """Why a process that said nothing has done nothing."""
        if status < 0:
            return f"it was not {self._done}, signal {-status} ended the process; is memory short?"
        return f"it could not be {self._done}: a bug in Insitu (for a report: {log_directory() / self._log})"


# ---------------------------------------------------------------------------------------------------------- the process


def begin_child() -> tuple[str, list[str]]:
    """Give way to the window, and end with it; returns the session's file, and the task's arguments."""
    session, parent, *arguments = sys.argv[1:]
    end_with_parent(int(parent))
    yield_to_window()
    lower_priority(NICENESS - LITTLE)
    return session, arguments


def open_session(session: str) -> Project:
    """The scene of the session, whose folder is then deleted. Raises InsituError."""
    from app.project.project import open_project
    from app.system.kernel_cache import use_kernel_cache

    use_kernel_cache()
    project = open_project(session)
    shutil.rmtree(Path(session).parent, ignore_errors=True)  # the parent may be killed before it does
    return project


def answer_folder(session: str) -> Path:
    """The folder for what the task's `reads` is to read: made anew, because that of the session is deleted."""
    folder = Path(session).parent
    folder.mkdir(mode=0o700, exist_ok=True)
    return folder


def tell(**what: object) -> None:
    """Tell the window something."""
    try:
        print(json.dumps(what), flush=True)
    except OSError:  # the parent has ended
        os._exit(0)
