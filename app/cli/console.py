"""What commands speak to: the terminal (one line on standard error, an exit status, never a traceback) and the window,
which the composition root passes in, because `app` itself never imports `ui`.

It imports little: the editor starts through it without the command line's own library.
"""

from __future__ import annotations

import io
import json
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from app.system.atomic import write_atomically
from app.system.paths import state_directory
from engine.core.errors import InsituError, plain_line

if TYPE_CHECKING:
    from app.operators.script import Step
    from engine.core.colour import ConfigView

FAILED, USAGE, INTERRUPTED = 1, 2, 130
ERROR_FILE = "last-error.txt"

# Words that are commands when they come first; a file of such a name is opened as ./render.
COMMANDS = ("edit", "render", "precompute", "screenshot", "plan", "info", "measure", "doctor", "import-brdf",
            "export-brdf", "export", "save-scene", "save-environment", "contact-sheet", "diff", "match")  # fmt: skip


def run_guarded(work: Callable[[], int]) -> int:
    """The exit status of `work`, whatever it raises: 0, 1 (failed: one line says why), 130 (Ctrl-C, quiet)."""
    try:
        return work()
    except KeyboardInterrupt:
        return INTERRUPTED
    except InsituError as error:
        print_error(str(error))
    except BrokenPipeError:
        _forget_output()  # the reader of the output has closed it
    except MemoryError:
        print_error("there is not enough memory for this; try a smaller --resolution or fewer --lights")
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        print_error(f"{where}{error.strerror or error}")
    except Exception as error:  # a defect: the user gets a line, the log the details
        print_error(f"this failed: a bug in Insitu (for a report: {_write_traceback(error)})")
    return FAILED


def print_line(line: str) -> None:
    """One line on standard output, made printable whatever names and values of files are in it: all commands print by
    this."""
    print(plain_line(line, keep_spaces=True), flush=True)


def print_json(values: dict[str, Any]) -> None:
    """Values on standard output as JSON, whose escapes make names of files printable."""
    print(json.dumps(values, indent=2, allow_nan=False), flush=True)


def escape_unprintable() -> None:
    """Print characters that the terminal does not have, such as in names of files, by their number: a line that cannot
    be printed would end the work when all of it is done."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def print_error(line: str) -> None:
    """One line on standard error."""
    print(f"insitu: {plain_line(line)}", file=sys.stderr)


def _write_traceback(error: Exception) -> str:
    """Write the details of a defect to a file; returns its name, or the reason where none can be written."""
    try:
        file = state_directory() / ERROR_FILE
        write_atomically(file, "".join(traceback.format_exception(error)).encode(errors="replace"), private=True)
    except OSError:
        return f"{type(error).__name__}: {error}"
    return str(file)


def _forget_output() -> None:
    """Redirect standard output to nowhere, so that Python's own flush at exit does not fail again."""
    descriptor = os.open(os.devnull, os.O_WRONLY)
    os.dup2(descriptor, sys.stdout.fileno())
    os.close(descriptor)


class Frontend(Protocol):
    """The window, with a display and without one."""

    def open_window(self, source: str, view: ConfigView | None = None) -> int:
        """Open the editor and run until it is closed; returns the exit status."""

    def take_screenshot(
        self, source: str, output: Path, steps: Sequence[Step], size: tuple[int, int], scale: float,
        resolution: tuple[int, int] | None,
    ) -> None:  # fmt: skip
        """Save a picture of the whole editor window after the steps, without a display. Raises InsituError."""

    def describe_graphics(self) -> str:
        """Renderer and version of OpenGL without a display. Raises InsituError that says what to install."""

    def describe_display(self) -> str:
        """The display and the OpenGL that a window would get. Raises InsituError where there is none."""
