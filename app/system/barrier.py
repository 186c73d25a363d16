"""A barrier around the parts of a frame: an exception in one of them ends neither the program nor the other parts.

A panel, a response of the worker, an edit, the picture: each is run through the barrier. A part that fails is left out
until its inputs have changed, or a second has passed, so that a fault does not recur sixty times a second. The user
gets one line, once, and the log has the traceback. Commands and tests let faults through: there the same fault ends the
work, with one line and exit status 1.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import TypeVar

from app.system.paths import log_directory, open_log

RETRY_SECONDS = 1.0
Result = TypeVar("Result")


@dataclass(frozen=True)
class _Fault:
    """A failure of a part: its error, its inputs then (None: an event), and until when it is not repeated."""

    error: str
    made_of: tuple[object, ...] | None
    until: float

    def suppresses(self, error: str, now: float) -> bool:
        """Whether that error is not reported again, because it was reported just now."""
        return self.error == error and (self.made_of is not None or now < self.until)


class Barrier:
    """The barrier of one editor. holds: whether faults are caught; `on_fault` is called with the line about each."""

    def __init__(self, holds: bool = False, clock: Callable[[], float] = time.monotonic) -> None:
        self.holds = holds
        self.on_fault: Callable[[str], None] = lambda line: None
        self._clock = clock
        self._faults: dict[str, _Fault] = {}

    def run(
        self, part: str, work: Callable[[], Result], otherwise: Result, made_of: tuple[object, ...] | None = None
    ) -> Result:
        """The result of `work`; `otherwise` where it fails.

        made_of: the inputs of the part; as long as they are equal to those that it failed on, it is tried again once a
        second. None: an event, which does not come twice and is always tried.
        """
        if not self.holds:
            return work()
        if made_of is not None and self._is_suspended(part, made_of):
            return otherwise
        try:
            result = work()
        except Exception as error:
            self._record_fault(part, error, made_of)
            return otherwise
        if made_of is not None:
            self._faults.pop(part, None)
        return result

    def _is_suspended(self, part: str, made_of: tuple[object, ...]) -> bool:
        fault = self._faults.get(part)
        return fault is not None and fault.made_of == made_of and self._clock() < fault.until

    def _record_fault(self, part: str, error: Exception, made_of: tuple[object, ...] | None) -> None:
        now, said = self._clock(), f"{type(error).__name__}: {error}"
        before = self._faults.get(part)
        self._faults[part] = _Fault(said, made_of, now + RETRY_SECONDS)
        if before is None or not before.suppresses(said, now):
            self.on_fault(
                f"{part} failed: a bug in Insitu. Your edits are safe; undo the last one{_log_fault(part, error)}"
            )


def _log_fault(part: str, error: Exception) -> str:
    """Append the traceback to the log; returns words that say where it is."""
    try:
        said = f"{datetime.now():%Y-%m-%d %H:%M:%S} {part}\n{''.join(traceback.format_exception(error))}\n"
        with open_log("window.log") as file:
            file.write(said.encode(errors="backslashreplace"))
    except OSError:
        return ""
    return f" (for a report: {_display_path(log_directory() / 'window.log')})"


def _display_path(path: Path) -> str:
    """A path in the form that the user would write."""
    home = Path.home()
    return f"~/{path.relative_to(home)}" if path.is_relative_to(home) else str(path)
