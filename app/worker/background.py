"""Which work of ours has the processors first: what a person waits for as others have them, all else after that.

    window                                                                                as any process
    worker; the compiling of what first pictures need, direct and indirect light          a little behind
    a worker's thread for what nobody waits for (`Request.is_foreground`)                    behind
    the compiling of what is wanted later                                                 behind all

A process that has stepped back cannot step forward again, but on Linux each thread stands for itself: the worker's
first thread never steps back, and lets another take the steps of what nobody waits for. One of both works at a time.
Where threads have no priority of their own, all the worker does is waited for.

The window's thread sleeps between frames and has to run at once when something happens, so those of the worker do not
take a processor from one that runs (SCHED_BATCH). Where OpenGL is software, a frame is also 20 ms of work for threads
of its own, which the worker's get in the way of: from a little behind, these leave it two thirds (frames at a start
took 0.6 of their time). Rejected: a worker that steps back by 10, which beside a busy program of another kind had a
tenth of a processor for the picture that a person waited for.
Light to import, for it is imported first of all.
"""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from app.system.system import HAS_THREAD_PRIORITIES, lower_priority, use_batch_scheduling

Result = TypeVar("Result")
LITTLE = 3
NICENESS = 10
LAST = 19
_OOM_SCORE = "800"  # the system, short of memory, ends us before the window


def yield_to_window(last: bool = False) -> None:
    """Leave Ctrl-C, a little of the processor and, when memory runs out, survival to the window; `last`: the processor
    to everybody."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    use_batch_scheduling()
    lower_priority(LAST if last else LITTLE)
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w", encoding="ascii") as file:
        file.write(_OOM_SCORE)


class Background:
    """A thread that has stepped back, and those that it shares its work with."""

    def __init__(self) -> None:
        self._thread: ThreadPoolExecutor | None = None

    def run(self, step: Callable[[], Result]) -> Result:
        """Have it take a step, and wait for that; raises what the step raises."""
        if not HAS_THREAD_PRIORITIES:
            return step()
        if self._thread is None:
            self._thread = ThreadPoolExecutor(1, "background", initializer=step_behind)
        return self._thread.submit(step).result()


def step_behind(niceness: int = NICENESS) -> None:
    """Have this thread, and those that it shares its work with from now on, leave the processors to others."""
    from engine.core.threads import use_own_threads  # late: it brings NumPy

    lower_priority(niceness)
    use_own_threads()
