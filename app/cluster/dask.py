"""A Dask cluster from this side: connecting, sending files, submitting tasks and waiting for their results.

Waiting goes in steps of a quarter of a second, so that Ctrl-C works; on leaving, tasks that have not begun are
cancelled, and the results of others are dropped.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import queue
import re
import socket
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import CancelledError
from functools import partial
from pathlib import Path
from typing import Any

from distributed import Client, Future, KilledWorker
from distributed.comm import CommClosedError

from app.cluster.program import QUESTION, describe_mismatch, program_digest
from app.cluster.scene_bundle import SceneBundle, bundle_files, missing_pieces, pieces_of, store_piece
from engine.core.errors import InsituError
from engine.core.safe_files import portable_name

CONNECT_SECONDS = 5.0
WORKERLESS_SECONDS = 60.0
STEP_SECONDS = 0.25
LONGEST_GREETING = 1 << 20
# What Dask raises where a connection has ended; some are no `Exception` where they come from its event loop.
CANCELLED = (asyncio.CancelledError, CancelledError)
LOST = (OSError, TimeoutError, CommClosedError, RuntimeError, *CANCELLED)

_ADDRESS = re.compile(r"(tcp://|tls://)?([\w.-]+|\[[0-9a-fA-F:]+\]):(\d{1,5})")


class Cluster:
    """A connected scheduler. Close it, or use `with`."""

    def __init__(self, address: str) -> None:
        """Connect. Raises InsituError where no scheduler answers."""
        _silence_libraries()
        self.address = address
        try:
            _require_greeting(address)
            self._client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
        except InsituError:
            raise
        except Exception as error:  # Dask may raise anything for another program's answer
            raise InsituError(
                f"--scheduler {address}: no Dask scheduler answers there, expected its HOST:PORT"
            ) from error
        self._tasks: dict[int, Future] = {}
        self._workerless_since: float | None = None
        self._checked_workers: set[str] = set()

    @property
    def n_workers(self) -> int:
        """Workers that the scheduler knows now. Raises InsituError where it has gone."""
        return len(self._workers())

    def require_same_program(self) -> None:
        """Raise InsituError where a worker that was not checked before has another Insitu: it would fail on what it is
        sent, without an error message."""
        workers = self._workers() - self._checked_workers
        if not workers:
            return
        with self._connected():
            # `eval` exists everywhere, and text can be sent either way.
            answers = self._client.run(eval, QUESTION, workers=sorted(workers), on_error="return")
        for where, answer in answers.items():
            if isinstance(answer, OSError):  # the worker has gone meanwhile
                continue
            if answer != program_digest():
                raise InsituError(f"--scheduler {self.address}: {describe_mismatch(f'the worker at {where}')}")
            self._checked_workers.add(where)

    def send(self, paths: Iterable[Path]) -> SceneBundle:
        """Send the scheduler what it lacks of these files; returns their bundle. Raises InsituError."""
        self.require_same_program()
        there = {portable_name(path): path for path in paths}
        try:
            bundle = bundle_files(there.values())
        except OSError as error:
            raise InsituError(f"--scheduler {self.address}: the scene cannot be sent, {error}") from error
        try:
            with self._connected():
                missing = set(self._client.run_on_scheduler(missing_pieces, bundle.pieces))
                for sent in bundle.files:
                    for digest, piece in zip(sent.pieces, pieces_of(there[sent.name]), strict=False):
                        if digest in missing:
                            self._client.run_on_scheduler(store_piece, piece)
                            missing.remove(digest)
        except (ImportError, AttributeError) as error:
            raise InsituError(
                f"--scheduler {self.address}: the same Insitu is not installed there ({error}); scheduler and workers "
                "need that of this computer"
            ) from error
        return bundle

    def submit(self, call: Callable[..., object], *arguments: object) -> Future:
        """A task, which may take the results of others as arguments. Raises InsituError where the cluster is lost."""
        with self._connected():
            return self._client.submit(call, *arguments, key=f"insitu-{call.__name__}-{uuid.uuid4().hex}", pure=False)

    def results(self, tasks: Mapping[int, Future]) -> Iterator[tuple[int, Any] | None]:
        """Number and result of each task, as they come, and None every quarter of a second meanwhile. Raises what a
        task raises, and InsituError where the cluster is lost."""
        done: queue.SimpleQueue[int] = queue.SimpleQueue()
        self._tasks = dict(tasks)
        for number, task in tasks.items():
            task.add_done_callback(partial(_put, done, number))
        while self._tasks:
            try:
                number = done.get(timeout=STEP_SECONDS)
            except queue.Empty:
                self._check()
                yield None
                continue
            yield number, self._result(self._tasks.pop(number))

    def close(self) -> None:
        """Cancel what is not done, and disconnect."""
        with contextlib.suppress(*LOST):  # nothing can be cancelled there any more
            if self._tasks and self._client.status == "running":
                self._client.cancel(list(self._tasks.values()), force=True)
        self._tasks = {}
        with contextlib.suppress(*LOST):
            self._client.close(timeout=1.0)

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _result(self, task: Future) -> Any:
        while True:
            try:
                return task.result(timeout=STEP_SECONDS)
            except TimeoutError:  # the worker that had it is lost, and another one computes it again
                self._check()
            except KilledWorker as error:
                raise InsituError(
                    f"--scheduler {self.address}: workers ended {error.allowed_failures + 1} times at the same "
                    "task; do they have enough memory?"
                ) from error
            except (CommClosedError, *CANCELLED) as error:
                raise self._lost() from error
            except Exception as error:
                if task.cancelled():
                    raise self._lost() from error
                raise

    def _check(self) -> None:
        """Raise InsituError where no worker will do the work any more."""
        if self._client.status in ("closing", "closed", "newly-created") or self._client.scheduler is None:
            raise self._lost()
        if self._client.status != "running":
            return
        if self.n_workers:
            self._workerless_since = None
            self.require_same_program()
        elif self._workerless_since is None:
            self._workerless_since = time.monotonic()
        elif time.monotonic() - self._workerless_since > WORKERLESS_SECONDS:
            raise InsituError(
                f"--scheduler {self.address}: it has had no worker for {WORKERLESS_SECONDS:.0f} s; start some with "
                "`dask worker ADDRESS --nthreads 1`, of the same Insitu as this computer's"
            )

    def _workers(self) -> set[str]:
        """The workers' addresses. Raises InsituError where the scheduler has gone.

        The scheduler itself is asked: Dask's `Client.scheduler_info` reads a field which a timer overwrites every two
        seconds with an answer that lists no workers.
        """
        if self._client.scheduler is None:
            raise self._lost()
        with self._connected():
            identity = self._client.sync(self._client.scheduler.identity, n_workers=-1)
        return set(identity["workers"])

    @contextlib.contextmanager
    def _connected(self) -> Iterator[None]:
        """Raises as InsituError what Dask raises where the scheduler is lost."""
        try:
            yield
        except LOST as error:
            raise self._lost() from error

    def _lost(self) -> InsituError:
        return InsituError(
            f"--scheduler {self.address}: the scheduler has gone; finished work is stored, run the command again"
        )


def _silence_libraries() -> None:
    """Silence the libraries' loggers, because errors are reported in one line: Dask gives some of its loggers levels of
    their own, and writes whole tracebacks when a scheduler goes."""
    for name in ("asyncio", "distributed", "tornado", *logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("asyncio", "distributed", "tornado"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)


def _require_greeting(address: str) -> None:
    """Check that a scheduler greets the connection; of anything else Dask's client would wait for half a minute, and
    log errors when it is released. Raises OSError, InsituError for what is no address."""
    parts = _ADDRESS.fullmatch(address)
    if parts is None or int(parts[3]) > 0xFFFF:
        raise InsituError(f"--scheduler {address}: expected HOST:PORT of a Dask scheduler")
    with socket.create_connection((parts[2].strip("[]"), int(parts[3])), CONNECT_SECONDS) as connection:
        if parts[1] != "tls://":
            # Its greeting begins with how many bytes follow [distributed.comm.tcp]: of "SSH-2.0-" that would be 3e18.
            length = int.from_bytes(connection.recv(8, socket.MSG_WAITALL), "little")
            if not 0 < length < LONGEST_GREETING:
                raise ConnectionError("no greeting")


def _put(done: queue.SimpleQueue[int], number: int, task: Future) -> None:
    done.put(number)
