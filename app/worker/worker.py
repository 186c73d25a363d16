"""The second process, which does all the slow work: `python -m app.worker`, started by `client`.

One thread at a time works: it checks for new requests, advances a job by one step, sends what came out, and begins
again; work that nobody waits for goes to another thread, of lower priority (`background`). A small one sends a sign of
life every quarter of a second, and ends the process when the window is gone: however the window died, no orphan
computes on. On Linux the kernel also ends the worker with its parent (PR_SET_PDEATHSIG). Spawned, never forked: a fork
of a process with threads and a GL context is undefined.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import logging
import os
import sys
import threading
from collections.abc import Sequence
from typing import Any, cast

from app.messages.worker_messages import Heartbeat, Request, RequestFailed, Shutdown
from app.system.decoder_process import use_decoder_process
from app.system.kernel_cache import use_kernel_cache
from app.system.lazy_import import import_named
from app.system.paths import log_directory, open_log
from app.system.system import end_with_parent, inherited_socket, keep_memory_compact, release_memory
from app.worker.channel import Channel, ChannelClosed
from app.worker.process import Background
from app.worker.schedule import Schedule
from app.worker.shared_arrays import OutOfMemory, sweep_dead_blocks

IDLE_SECONDS = 1.0  # after which memory goes back to the system


class Worker:
    """Serves one channel until it closes or a Shutdown arrives."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._background = Background()
        self.heartbeat = Heartbeat("starting")

    def run(self, schedule: Schedule) -> None:
        has_worked = False
        while self._take_requests(schedule):
            chosen = schedule.choose()
            self._announce(chosen)
            if chosen is not None:
                self._advance(schedule, chosen)
                has_worked = True
            elif has_worked and not self._channel.wait(IDLE_SECONDS):
                # What one scene or edit leaves between the next one's arrays adds up to hundreds of megabytes.
                release_memory()
                has_worked = False
            elif not has_worked:
                self._channel.wait(None)

    def _take_requests(self, schedule: Schedule) -> bool:
        """Accept what has arrived; False on Shutdown."""
        while (message := self._channel.receive(deadline=float("inf"))) is not None:
            if isinstance(message, Shutdown):
                return False
            schedule.accept(cast(Request, message))
        return True

    def _announce(self, request: Request | None) -> None:
        """Tell the client which request is worked on, so that it knows the culprit should this process die."""
        beat = Heartbeat("busy", id=request.id, revision=request.revision) if request else Heartbeat("idle")
        if beat != self.heartbeat:
            self.heartbeat = beat
            self._channel.send(beat)

    def _advance(self, schedule: Schedule, chosen: Request) -> None:
        response = schedule.step() if chosen.is_foreground else self._background.run(schedule.step)
        if response is None:
            return
        try:
            self._channel.send(response)
        except OutOfMemory as error:
            self._channel.send(schedule.fail(error))


def beat(worker: Worker, channel: Channel, interval: float, parent: int) -> None:
    """Send a sign of life each `interval` seconds; end the process once the window is gone."""
    while True:
        if channel.has_hung_up(interval) or os.getppid() != parent:
            os._exit(0)
        with contextlib.suppress(ChannelClosed):
            channel.send_if_free(worker.heartbeat)


def log_to_file() -> str:
    """Send the log and everything on stderr to the log file; returns its name for messages, "" when there is none."""
    try:
        with open_log("worker.log") as file:
            os.dup2(file.fileno(), 2)
    except OSError:
        return ""
    return f" (for a report: {log_directory() / 'worker.log'})"


def arguments(argv: Sequence[str] | None) -> Any:
    parser = argparse.ArgumentParser(prog="app.worker")
    parser.add_argument("--parent", type=int, required=True, help="process to end with")
    parser.add_argument("--handlers", required=True, help="module:name of what makes the tasks")
    parser.add_argument("--method", choices=("memfd", "named", "kept"), default=None, help="where shared blocks live")
    parser.add_argument("--heartbeat", type=float, default=0.25, help="seconds between signs of life")
    parser.add_argument("socket", help="where our end of the socket pair is: see `app.system.system.inherited_socket`")
    return parser.parse_args(argv)


def serve(channel: Channel, options: Any) -> None:
    """Start the heartbeat, load the handlers, serve; handlers that cannot be loaded are reported in a message."""
    details = log_to_file()
    logging.basicConfig(format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    faulthandler.enable()
    worker = Worker(channel)
    threading.Thread(target=beat, args=(worker, channel, options.heartbeat, options.parent), daemon=True).start()
    try:
        handler = import_named(options.handlers)()
    except Exception:
        logging.getLogger("insitu.jobs").exception("the worker's tasks could not be loaded")
        channel.send(RequestFailed(f"computing could not be started: a bug in Insitu{details}"))
        sys.exit(1)
    worker.run(Schedule(handler, details))


def main(argv: Sequence[str] | None = None) -> None:
    options = arguments(argv)
    keep_memory_compact()
    use_kernel_cache()
    use_decoder_process()
    end_with_parent(options.parent)
    sweep_dead_blocks()
    channel = Channel(inherited_socket(options.socket), options.method)
    with contextlib.suppress(ChannelClosed):
        serve(channel, options)
