"""The worker's process: how it is started and ended, and which of Insitu's processes and threads get the processors
first.

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
tenth of a processor for the picture that the user waited for.

`client` decides when a worker starts and ends. This module imports little, so that the worker can be started before all
else, and gives way before it imports its libraries.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from app.system.lazy_import import program_environment, qualified
from app.system.system import HAS_THREAD_PRIORITIES, lower_priority, start_with_socket, use_batch_scheduling

if TYPE_CHECKING:
    from app.worker.shared_arrays import Method


TASKS = "app.worker.kernels:prepared_tasks"
HEARTBEAT_SECONDS = 0.25


@dataclass(frozen=True)
class StartedWorker:
    """A process that was started, and this end of its socket; no message has been exchanged yet."""

    process: subprocess.Popen[bytes]
    socket: socket.socket
    method: Method | None = None


def start_worker(
    handlers: str = TASKS, heartbeat: float = HEARTBEAT_SECONDS, method: Method | None = None
) -> StartedWorker:
    """Start the process, which takes this process a few milliseconds; raises OSError when the system refuses."""
    ours, theirs = socket.socketpair()
    with theirs:
        command = [sys.executable, "-P", "-m", qualified("app.worker")]
        command += ["--parent", str(os.getpid()), "--handlers", handlers, "--heartbeat", str(heartbeat)]
        command += ["--method", method] if method else []
        try:
            process = start_with_socket(command, theirs, program_environment())
        except BaseException:
            ours.close()
            raise
    return StartedWorker(process, ours, method)


class WorkerProcess:
    """One worker and this end of its channel."""

    def __init__(self, started: StartedWorker) -> None:
        from app.worker.channel import Channel  # late: it imports NumPy

        self._process = started.process
        self.channel = Channel(started.socket, started.method)

    @property
    def pid(self) -> int:
        return self._process.pid

    def end(self, grace_s: float) -> None:
        """Close the channel, which ends the worker; one that still runs after `grace_s` is killed."""
        self.channel.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(grace_s)
        if self._process.returncode is None:
            self._process.kill()

    def reaped(self) -> bool:
        """Whether the process is gone, its entry in the process table too."""
        return self._process.poll() is not None

    def wait_until_gone(self, timeout_s: float) -> None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout_s)

    def how_it_ended(self) -> str:
        """How a process ended whose channel has closed, in words."""
        self.wait_until_gone(0.02)
        status = self._process.returncode
        if status is None:
            return "it closed its connection"
        if status < 0:
            return f"it was ended by {_signal_name(-status)}"
        return f"it ended with status {status}"


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


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
