"""Which of Insitu's processes and threads get the processors first: those that the user waits for, then all others.

    window                                                                                as any process
    worker; the compiling of what first pictures need, direct and indirect light          a little behind
    a worker's thread for what nobody waits for (`Request.is_foreground`)                    behind
    the compiling of what is needed later                                                 behind all

A process that has lowered its priority cannot raise it again, but on Linux each thread has its own: the worker's first
thread never lowers it, and lets another take the steps of what nobody waits for. One of the two works at a time. Where
threads have no priority of their own, all the worker does counts as waited for.

The window's thread sleeps between frames and has to run at once when something happens, so those of the worker do not
take a processor from one that runs (SCHED_BATCH). Where OpenGL is software, a frame is also 20 ms of work for threads
of its own, which compete with the worker's: at a slightly lower priority, the worker leaves them two thirds (frames at
a start took 0.6 of their time). Rejected: a worker at niceness 10, which beside a busy program of another kind got a
tenth of a processor for the picture that the user waited for. This module imports little, because it is imported first
of all.
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
_OOM_SCORE = "800"  # when memory runs out, the system ends the worker before the window


def yield_to_window(last: bool = False) -> None:
    """Give way to the window: ignore Ctrl-C, lower the priority a little, and be the first to end when memory runs out;
    `last`: lower the priority below all other processes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    use_batch_scheduling()
    lower_priority(LAST if last else LITTLE)
    with contextlib.suppress(OSError), open("/proc/self/oom_score_adj", "w", encoding="ascii") as file:
        file.write(_OOM_SCORE)


class Background:
    """A thread of lower priority, and those that it shares its work with."""

    def __init__(self) -> None:
        self._thread: ThreadPoolExecutor | None = None

    def run(self, step: Callable[[], Result]) -> Result:
        """Let it take a step, and wait for that; raises what the step raises."""
        if not HAS_THREAD_PRIORITIES:
            return step()
        if self._thread is None:
            self._thread = ThreadPoolExecutor(1, "background", initializer=step_behind)
        return self._thread.submit(step).result()


def step_behind(niceness: int = NICENESS) -> None:
    """Lower the priority of this thread, and of those that it shares its work with from now on."""
    from engine.core.threads import use_own_threads  # late: it imports NumPy

    lower_priority(niceness)
    use_own_threads()
