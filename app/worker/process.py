"""Starts and ends the worker process; `client` decides when.

This module imports little, so that the worker can be started before all else and imports its libraries meanwhile.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING

from app.system.lazy_import import IMPORT_FOLDER, qualified
from app.system.system import start_with_socket

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
            process = start_with_socket(command, theirs, _environment())
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


def _environment() -> dict[str, str]:
    """This process's environment, and the places from which it imports."""
    places = dict.fromkeys([str(IMPORT_FOLDER), *(place for place in sys.path if place)])
    return {**os.environ, "PYTHONPATH": os.pathsep.join(places)}


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
