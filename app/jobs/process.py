"""Starting and ending the worker process; no decision about when."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

from app.jobs.channel import Channel
from app.jobs.shared_arrays import Method

_SOURCE = Path(__file__).resolve().parents[2]


class WorkerProcess:
    """One worker and our end of its channel."""

    def __init__(self, handlers: str, heartbeat: float, method: Method | None) -> None:
        """Start the process, which takes a few milliseconds here; raises OSError when the system refuses."""
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        with theirs:
            command = [sys.executable, "-P", "-m", "app.jobs.worker"]
            command += ["--socket", str(theirs.fileno()), "--parent", str(os.getpid())]
            command += ["--handlers", handlers, "--heartbeat", str(heartbeat)]
            command += ["--method", method] if method else []
            try:
                self._process = subprocess.Popen(
                    command,
                    pass_fds=[theirs.fileno()],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    env=_environment(),
                )
            except BaseException:
                ours.close()
                raise
        self.channel = Channel(ours, method)

    @property
    def pid(self) -> int:
        return self._process.pid

    def end(self, grace_s: float) -> None:
        """Close the channel, on which the worker ends by itself; what still runs after `grace_s` is killed."""
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
        """In words, for a process whose channel has closed."""
        self.wait_until_gone(0.02)
        status = self._process.returncode
        if status is None:
            return "it closed its connection"
        if status < 0:
            return f"it was ended by {_signal_name(-status)}"
        return f"it ended with status {status}"


def _environment() -> dict[str, str]:
    """Ours, and the places from which this process imports."""
    places = dict.fromkeys([str(_SOURCE), *(place for place in sys.path if place)])
    return {**os.environ, "PYTHONPATH": os.pathsep.join(places)}


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
