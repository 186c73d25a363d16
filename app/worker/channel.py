"""Messages over one socket between the window's process and the worker.

A frame is a fixed header, a pickled message and, beside it (SCM_RIGHTS), the descriptor of one shared block with the
message's large buffers (pickle protocol 5, out of band); where descriptors cannot be sent, the header has its name.
Only the two ends of a socket pair that this program opened exchange frames, which is why pickle is safe.

The socket never blocks. `receive` takes what is there and works on it until a deadline, checksum included: the window
calls it in every frame. `send`, for the worker, waits while the window is behind; the socket's buffer is short, so that
only a few tens of messages (and their blocks) are ever under way.

`multiprocessing`'s Queue and Connection were rejected: a process killed in the middle of a message leaves locks taken
and readers waiting for the rest.
"""

from __future__ import annotations

import io
import os
import pickle
import select
import socket
import struct
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

import numpy as np

from app.messages.worker_messages import Message
from app.system.system import has_hung_up, receive_with, send_with
from app.worker.shared_arrays import Block, Method, create_block, kept_block_name, open_kept_block

SHARED_FROM = 4096  # bytes: smaller buffers go inside the message
_MAGIC = b"INSF"
# Magic, bytes of the pickle, generation of the block (0: none) and its bytes; the process and serial that name it.
_HEADER = struct.Struct("<4sIQQQQ")
_LARGEST_PICKLE = 64 << 20
_READ = 1 << 16
_SEND_BUFFER = 1 << 16
_MAX_DESCRIPTORS = 16  # a stream hands out the descriptors of one frame at a time


class ChannelClosed(Exception):
    """The other end is gone."""


class ChannelError(Exception):
    """The bytes that arrived are no valid message; nothing more can be read."""


class _Frame:
    """Bytes to send and the block: a descriptor, which goes with the first of them, or a file that the receiver
    opens."""

    def __init__(self, data: bytes, block: int | Path | None) -> None:
        self.data = memoryview(data)
        self._block = block

    @property
    def descriptor(self) -> int | None:
        return self._block if isinstance(self._block, int) else None

    def sent(self, n_bytes: int) -> None:
        """Note that so many bytes were sent, and the block with them."""
        self.data = self.data[n_bytes:]
        if self.descriptor is not None:
            os.close(self.descriptor)
            self._block = None
        elif not self.data:
            self._block = None

    def close(self) -> None:
        """Drop the frame, unsent or sent in part: the block will not be opened."""
        if isinstance(self._block, Path):
            self._block.unlink(missing_ok=True)
        elif self._block is not None:
            os.close(self._block)
        self._block = None


class Channel:
    """One end of the socket pair; `lock` is held while a frame is written, so that frames stay whole."""

    def __init__(self, sock: socket.socket, method: Method | None = None) -> None:
        sock.setblocking(False)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        self._socket = sock
        self._method = method
        self._generation = 0
        self._outgoing: deque[_Frame] = deque()
        self._incoming = bytearray()
        self._descriptors: deque[int] = deque()
        self._ended = False
        self._checking: tuple[bytes, Block] | None = None
        self.lock = threading.Lock()

    def fileno(self) -> int:
        return self._socket.fileno()

    # ---------------------------------------------------------------------------------------------------------- sending

    def post(self, message: Message) -> None:
        """Queue a message; `flush` sends it. Raises OutOfMemory when there is no room for its arrays."""
        self._outgoing.append(self._encode(message))

    def flush(self) -> bool:
        """Send what the socket takes now; True when nothing is left. Raises ChannelClosed."""
        while self._outgoing:
            frame = self._outgoing[0]
            if not self._send_some(frame):
                return False
            if not frame.data:
                self._outgoing.popleft()
        return True

    def send(self, message: Message) -> None:
        """Send a message whole, waiting while the other end is behind. Raises ChannelClosed, OutOfMemory."""
        frame = self._encode(message)
        with self.lock:
            self._outgoing.append(frame)
            while not self.flush():
                select.select([], [self._socket], [])

    def send_if_free(self, message: Message) -> None:
        """Send a small message now, or drop it when another is being written or the socket is full."""
        if not self.lock.acquire(blocking=False):
            return
        try:
            if select.select([], [self._socket], [], 0)[1]:
                self._outgoing.append(self._encode(message))
                self.flush()
        finally:
            self.lock.release()

    def _encode(self, message: Message) -> _Frame:
        buffers: list[memoryview] = []
        payload = _pickle(message, buffers)
        if len(payload) > _LARGEST_PICKLE:
            raise ValueError(f"a message of {len(payload)} bytes beside its arrays, expected at most {_LARGEST_PICKLE}")
        if not buffers:
            return _Frame(_HEADER.pack(_MAGIC, len(payload), 0, 0, 0, 0) + payload, None)
        self._generation += 1
        block, size = create_block(buffers, self._generation, self._method)
        name = kept_block_name(block) if isinstance(block, Path) else (0, 0)
        return _Frame(_HEADER.pack(_MAGIC, len(payload), self._generation, size, *name) + payload, block)

    def _send_some(self, frame: _Frame) -> bool:
        try:
            frame.sent(send_with(self._socket, frame.data, frame.descriptor))
        except BlockingIOError:
            return False
        except OSError as error:
            raise ChannelClosed(str(error)) from error
        return True

    # -------------------------------------------------------------------------------------------------------- receiving

    def receive(self, deadline: float) -> Message | None:
        """The next message that is complete and verified by the monotonic time `deadline`, else None.

        Raises ChannelClosed once the other end is gone and all its complete messages were handed out; ChannelError and
        BlockError when what arrived is not valid.
        """
        while True:
            if self._checking is not None:
                return self._finish_check(deadline)
            frame = self._take_frame()
            if frame is not None:
                payload, generation, size, name = frame
                if not generation:
                    return _unpickle(payload, [])
                self._checking = payload, Block(self._take_descriptor(name), generation, size)
            elif not self._read() or time.monotonic() >= deadline:
                return None

    @property
    def is_checking(self) -> bool:
        """Whether a message has arrived that `receive` has not checked to its end."""
        return self._checking is not None

    def wait(self, timeout: float | None) -> bool:
        """Sleep until something can be received, or for `timeout` seconds; returns whether there is something."""
        if self._checking is not None or self._frame_is_complete():
            return True
        return bool(select.select([self._socket], [], [], timeout)[0])

    def has_hung_up(self, timeout_s: float) -> bool:
        """Whether the other end is gone, known within `timeout_s`; nothing is taken from the socket."""
        return has_hung_up(self._socket, timeout_s)

    def close(self) -> None:
        for descriptor in self._descriptors:
            os.close(descriptor)
        for frame in self._outgoing:
            frame.close()
        self._descriptors.clear()
        self._outgoing.clear()
        self._checking = None
        self._socket.close()

    def _finish_check(self, deadline: float) -> Message | None:
        assert self._checking is not None
        payload, block = self._checking
        if not block.verify(deadline):
            return None
        self._checking = None
        return _unpickle(payload, block.buffers())

    def _frame_is_complete(self) -> bool:
        if len(self._incoming) < _HEADER.size:
            return False
        magic, length, *_ = _HEADER.unpack_from(self._incoming)
        if magic != _MAGIC or length > _LARGEST_PICKLE:
            raise ChannelError("a frame without our header")
        return bool(len(self._incoming) >= _HEADER.size + length)

    def _take_frame(self) -> tuple[bytes, int, int, tuple[int, int]] | None:
        """The pickle, generation and size of the block, and the numbers of its name."""
        if not self._frame_is_complete():
            return None
        _, length, generation, size, *name = _HEADER.unpack_from(self._incoming)
        end = _HEADER.size + length
        payload = bytes(memoryview(self._incoming)[_HEADER.size : end])
        del self._incoming[:end]
        return payload, generation, size, (name[0], name[1])

    def _take_descriptor(self, name: tuple[int, int]) -> int:
        if any(name):
            return open_kept_block(*name)
        if not self._descriptors:
            raise ChannelError("a message without its block: too many files are open")
        return self._descriptors.popleft()

    def _read(self) -> bool:
        """Read bytes and descriptors from the socket; False when there are none now."""
        if self._ended:
            raise ChannelClosed("the other end closed the connection")
        try:
            data, descriptors, some_were_lost = receive_with(self._socket, _READ, _MAX_DESCRIPTORS)
        except BlockingIOError:
            return False
        except OSError as error:
            raise ChannelClosed(str(error)) from error
        self._descriptors.extend(descriptors)
        if some_were_lost:
            raise ChannelError("a block could not be received: too many files are open")
        self._ended = not data
        self._incoming += data
        return True


class _Pickler(pickle.Pickler):
    """Every large array is sent as a plain contiguous buffer, also slices and memory maps."""

    def reducer_override(self, value: Any) -> Any:
        plain = type(value) is np.ndarray and value.flags.forc
        if isinstance(value, np.ndarray) and not plain and value.nbytes >= SHARED_FROM and not value.dtype.hasobject:
            return np.array(value, order="C", subok=False).__reduce_ex__(5)
        return NotImplemented


def _pickle(message: Message, buffers: list[memoryview]) -> bytes:
    """The pickled message; its large buffers are appended to `buffers` instead."""

    def stays_inside(buffer: pickle.PickleBuffer) -> bool:
        view = buffer.raw()
        if len(view) < SHARED_FROM:
            return True
        buffers.append(view)
        return False

    stream = io.BytesIO()
    _Pickler(stream, protocol=5, buffer_callback=stays_inside).dump(message)
    return stream.getvalue()


def _unpickle(payload: bytes, buffers: list[memoryview]) -> Message:
    try:
        message = pickle.loads(payload, buffers=buffers)
    except Exception as error:
        raise ChannelError(f"a message that cannot be read: {error}") from error
    if not isinstance(message, Message):
        raise ChannelError(f"a {type(message).__name__} where a message was expected")
    return message
