"""How a process of ours makes way for the window: processor, Ctrl-C, memory. Light, for it is imported first of all."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import sys

_PR_SET_PDEATHSIG = 1
_NICENESS = 10  # the window comes first
_FURTHER = 9  # and the worker before those that help it
_OOM_SCORE = "800"  # and the system, short of memory, ends us before the window


def step_back(further: bool = False) -> None:
    """Leave Ctrl-C, the processor and, when memory runs out, survival to the window; `further`: behind the worker."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(OSError):
        os.nice(_FURTHER if further else _NICENESS)
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w", encoding="ascii") as file:
        file.write(_OOM_SCORE)


def die_with(parent: int) -> None:
    """End this process when the parent's thread that started it ends, also by SIGKILL (Linux, prctl(2))."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it died before we asked
        os._exit(0)
