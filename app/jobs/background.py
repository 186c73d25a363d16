"""How a process of ours makes way for the window: processor, Ctrl-C, memory. Light, for it is imported first of all."""

from __future__ import annotations

import contextlib
import signal

from app.machine.system import step_back_by

_NICENESS = 10  # the window comes first
_FURTHER = 9  # and the worker before those that help it
_OOM_SCORE = "800"  # and the system, short of memory, ends us before the window


def step_back(further: bool = False) -> None:
    """Leave Ctrl-C, the processor and, when memory runs out, survival to the window; `further`: behind the worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    step_back_by(_FURTHER if further else _NICENESS)
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w", encoding="ascii") as file:
        file.write(_OOM_SCORE)
