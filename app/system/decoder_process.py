"""Runs decoders of native libraries in a process of their own, so that no file can end the worker or take its memory.

The process starts with the first decoder that is needed and ends when none was for a while. It may use `MEMORY` beyond
what it needs itself (on Linux; elsewhere the system decides) and is ended when data takes longer than its size allows;
the next one gets a new process. Requests and replies go through its standard streams, framed by their lengths: arrays
come back as `.npz` without pickled objects, so that a corrupted process can be wrong, but cannot run anything here.
`python -m app.system.decoder_process` is the process.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import importlib
import io
import os
import signal
import struct
import subprocess
import sys
import threading
from typing import IO, Any

import numpy as np

from app.system.lazy_import import program_environment, qualified
from app.system.system import limit_memory
from engine.core.native_decoders import Arrays, Decoder, DecoderError, run_here, use_runner

MEMORY = 2 << 30
BASE_SECONDS, SECONDS_A_MEGABYTE = 20.0, 5.0  # imports of large libraries included
IDLE_SECONDS = 20.0
# Beyond the time that data may take, the process ends by itself: whoever asked may have been killed.
_MORE_SECONDS = 5.0
_REQUEST, _REPLY = struct.Struct("<HQd"), struct.Struct("<BQ")
_ARRAYS, _FAILURE = 0, 1


class DecoderProcess:
    """The process, and a runner of decoders in it (`engine.core.native_decoders`); one request at a time."""

    def __init__(self, base_seconds: float = BASE_SECONDS, idle_seconds: float = IDLE_SECONDS) -> None:
        self._lock = threading.RLock()
        self._process: subprocess.Popen[bytes] | None = None
        self._idle: threading.Timer | None = None
        self._base_seconds, self._idle_seconds = base_seconds, idle_seconds

    def __call__(self, decoder: Decoder, data: bytes) -> Arrays:
        with self._lock:
            if self._idle is not None:
                self._idle.cancel()
            seconds = self._base_seconds + SECONDS_A_MEGABYTE * len(data) / 2**20
            took_long = threading.Event()
            try:
                process = self._process = self._process or _start()
                watch = threading.Timer(seconds, _end, (process, took_long))
                watch.start()
                try:
                    status, reply = _ask(process, decoder, data, seconds)
                finally:
                    watch.cancel()
            except (OSError, EOFError, MemoryError):
                self.close()
                late = took_long.is_set()
                reason = f"takes longer than {seconds:.0f} s" if late else "ends the decoder, or needs its memory"
                raise DecoderError(reason) from None
            except BaseException:
                self.close()  # its reply would be taken for that to the next request
                raise
            self._idle = threading.Timer(self._idle_seconds, self.close)
            self._idle.daemon = True
            self._idle.start()
        if status == _FAILURE:
            raise DecoderError(reply.decode("utf-8", "replace"))
        try:
            with np.load(io.BytesIO(reply), allow_pickle=False) as arrays:
                return dict(arrays)
        except Exception:  # of a process that the data has corrupted
            raise DecoderError("makes the decoder answer nonsense") from None

    def close(self) -> None:
        """End the process, if there is one."""
        with self._lock:
            if self._idle is not None:
                self._idle.cancel()
            if self._process is not None:
                self._process.kill()
                for stream in (self._process.stdin, self._process.stdout):
                    assert stream is not None
                    with contextlib.suppress(OSError):
                        stream.close()
                self._process.wait()
                self._process = None


@functools.cache
def use_decoder_process() -> None:
    """Run native decoders in a process of their own from now on."""
    process = DecoderProcess()
    atexit.register(process.close)
    use_runner(process)


def _start() -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", qualified("app.system.decoder_process")],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        env=program_environment(),
    )  # fmt: skip


def _end(process: subprocess.Popen[bytes], took_long: threading.Event) -> None:
    took_long.set()
    process.kill()


def _ask(process: subprocess.Popen[bytes], decoder: Decoder, data: bytes, seconds: float) -> tuple[int, bytes]:
    """Status and content of the reply to a request; raises OSError or EOFError if the process ends."""
    assert process.stdin is not None and process.stdout is not None
    name = f"{decoder.__module__}:{decoder.__qualname__}".encode()
    process.stdin.write(_REQUEST.pack(len(name), len(data), seconds + _MORE_SECONDS) + name)
    process.stdin.write(data)
    process.stdin.flush()
    status, length = _REPLY.unpack(_read(process.stdout, _REPLY.size))
    if length > 2 * MEMORY:
        raise EOFError
    return status, _read(process.stdout, length)


def _read(stream: IO[bytes], n_bytes: int) -> bytes:
    data = stream.read(n_bytes)
    if len(data) < n_bytes:
        raise EOFError
    return data


def main() -> None:
    """Answer requests until their stream ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Libraries that print must not write into the replies.
    requests, replies = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    limit_memory(MEMORY)
    with contextlib.suppress(EOFError):
        while True:
            n_name, n_data, seconds = _REQUEST.unpack(_read(requests, _REQUEST.size))
            module, _, function = _read(requests, n_name).decode().partition(":")
            data, buffer = _read(requests, n_data), io.BytesIO()
            _end_after(seconds)
            try:
                arrays = run_here(getattr(importlib.import_module(module), function), data)
                named: dict[str, Any] = {name: np.asarray(array) for name, array in arrays.items()}
                np.savez(buffer, **named)
                status, reply = _ARRAYS, buffer.getvalue()
            except (DecoderError, MemoryError) as error:
                status, reply = _FAILURE, (str(error) or "needs too much memory").encode()
            _end_after(0.0)
            replies.write(_REPLY.pack(status, len(reply)))
            replies.write(reply)
            replies.flush()


def _end_after(seconds: float) -> None:
    """Let the system end this process after so many seconds, even in native code; 0: not. Not on Windows."""
    if sys.platform != "win32":
        signal.setitimer(signal.ITIMER_REAL, seconds)


if __name__ == "__main__":
    main()
