"""Calls of the operating system that not every system has: the one place for them.

Each has an alternative for systems without it, which tests also run on the present system where that is possible; what
only Windows has is marked. This module imports neither NumPy nor psutil, because it is imported first of all.
"""

from __future__ import annotations

import array
import contextlib
import gc
import mmap
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path

HAS_ANONYMOUS_FILES = sys.platform == "linux"
# Descriptors, and with them blocks of memory, are sent over sockets; elsewhere blocks have a name until they are read.
PASSES_DESCRIPTORS = hasattr(socket, "SCM_RIGHTS")
# Elsewhere nice(2) applies to the whole process.
HAS_THREAD_PRIORITIES = sys.platform == "linux"
# The memory of processes is in files; elsewhere a library asks for it.
HAS_PROC = sys.platform == "linux"
_PR_SET_PDEATHSIG = 1
_POLL_SECONDS = 0.02
_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8
_LEAST_MAPPED = 4 << 20
_MOST_HEAPS = 2

# ------------------------------------------------------------------------------------------------------------ processes


def use_batch_scheduling() -> None:
    """Make this process, and the threads that it starts, never preempt a running one: sched(7), SCHED_BATCH. Does
    nothing elsewhere."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def lower_priority(niceness: int) -> None:
    """Lower the priority; niceness: by how much, as nice(2) counts. On Linux only of this thread, and those that it
    starts."""
    with contextlib.suppress(OSError):
        if sys.platform != "win32":
            os.nice(niceness)
        else:
            import psutil

            psutil.Process().nice(psutil.BELOW_NORMAL_PRIORITY_CLASS)


def keep_memory_compact() -> None:
    """Return freed arrays to the system (glibc, mallopt(3)); does nothing elsewhere.

    By default the size from which memory is mapped, and so returned, grows to 32 MiB, and each thread has a heap of its
    own: in a process that makes and frees arrays for hours, holes add up to more than what is in use.
    """
    if sys.platform == "linux":
        import ctypes

        mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
        if mallopt is not None:
            mallopt(_M_MMAP_THRESHOLD, _LEAST_MAPPED)
            mallopt(_M_ARENA_MAX, _MOST_HEAPS)


def end_with_parent(parent: int) -> None:
    """End this process when the thread that started it ends, also by SIGKILL, where the system can do that (Linux,
    prctl(2)); ends it at once if the parent has ended already."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(0)


def release_memory() -> None:
    """Return unused memory to the system, where the system's C library holds it (Linux, malloc_trim(3)): freed arrays
    are between others in its arenas, one for each thread. Takes some 10 ms."""
    gc.collect()
    if sys.platform == "linux":
        import ctypes

        with contextlib.suppress(AttributeError):  # only glibc has it
            ctypes.CDLL(None).malloc_trim(0)


def process_lives(pid: int) -> bool:
    """Whether a process of this number exists, of this user or another.

    One that has ended and is not collected yet, a zombie, does not count: in a container whose first process collects
    none they stay forever, and with them would all that is stored for running ones.
    """
    import psutil  # late: it takes longer to import than all else that asks this at a start

    try:
        return psutil.pid_exists(pid) and psutil.Process(pid).status() not in (psutil.STATUS_ZOMBIE, psutil.STATUS_DEAD)
    except psutil.AccessDenied:
        return True
    except psutil.NoSuchProcess:
        return False


def limit_memory(n_bytes: int) -> None:
    """Limit the address space of this process to so much more than it has now (Linux, setrlimit(2)); does nothing
    elsewhere, where the limit does not count what is mapped."""
    if sys.platform == "linux":
        import resource

        with open("/proc/self/statm", encoding="ascii") as file:
            now = int(file.read().split()[0]) * mmap.PAGESIZE
        resource.setrlimit(resource.RLIMIT_AS, (now + n_bytes, resource.RLIM_INFINITY))


def resident_bytes(pid: int, has_proc: bool = HAS_PROC) -> int:
    """Memory that a process holds in RAM; 0 where there is none of this number, or access is denied."""
    if has_proc:
        with contextlib.suppress(OSError), open(f"/proc/{pid}/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * mmap.PAGESIZE
        return 0
    import psutil  # late: it takes a window's thread 15 ms

    with contextlib.suppress(psutil.Error):
        return int(psutil.Process(pid).memory_info().rss)
    return 0


def kill_group(leader: int) -> None:
    """Kill a process that was started in a session of its own, and all of that session. Raises ProcessLookupError once
    there are none; on Windows, which has no groups, with the processes that it has started and not lost."""
    if sys.platform != "win32":
        os.killpg(leader, signal.SIGKILL)
        return
    import psutil

    try:
        process = psutil.Process(leader)
        for each in (*process.children(recursive=True), process):
            with contextlib.suppress(psutil.NoSuchProcess):
                each.kill()
    except psutil.NoSuchProcess:
        raise ProcessLookupError(leader) from None


def start_with_socket(
    command: Sequence[str], theirs: socket.socket, environment: Mapping[str, str]
) -> subprocess.Popen[bytes]:
    """Start a program that gets this end of a socket pair by `inherited_socket`; its command ends with a word for that.

    Raises OSError when the system refuses.
    """
    if sys.platform != "win32":
        word, passed, source = str(theirs.fileno()), (theirs.fileno(),), subprocess.DEVNULL
    else:  # a socket is shared with a running process, which reads its description
        word, passed, source = "-", (), subprocess.PIPE
    process = subprocess.Popen(
        [*command, word], pass_fds=passed, stdin=source, stdout=subprocess.DEVNULL, env=dict(environment)
    )
    if sys.platform == "win32":
        assert process.stdin is not None
        with process.stdin as pipe:
            pipe.write(theirs.share(process.pid))
    return process


def inherited_socket(word: str) -> socket.socket:
    """The socket that the parent process passed on."""
    if sys.platform != "win32":
        return socket.socket(fileno=int(word))
    return socket.fromshare(sys.stdin.buffer.read())


def has_hung_up(sock: socket.socket, timeout_s: float, polls: bool = hasattr(select, "poll")) -> bool:
    """Whether the other end of a socket is closed, known within `timeout_s`; nothing is read.

    polls: by poll(2), which also detects it behind unread data; else by peeking at what would be read next.
    """
    if polls and sys.platform != "win32":
        hangup = select.poll()
        hangup.register(sock.fileno(), 0)
        return bool(hangup.poll(timeout_s * 1000))
    end = time.monotonic() + timeout_s
    while True:
        try:
            if not sock.recv(1, socket.MSG_PEEK):
                return True
        except BlockingIOError:
            pass
        except OSError:
            return True
        if time.monotonic() >= end:
            return False
        time.sleep(_POLL_SECONDS)


# -------------------------------------------------------------------------------------------------------- files, memory


def memory_folder() -> Path:
    """The folder for files in memory: where the system has none, that for temporary files."""
    memory = Path("/dev/shm")
    return memory if os.access(memory, os.W_OK) else Path(tempfile.gettempdir())


def anonymous_file() -> int:
    """The descriptor of a new file in memory that has no name (memfd_create(2)); Linux alone."""
    if sys.platform == "linux":
        return os.memfd_create("insitu", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    raise OSError("no anonymous files on this system")


SEAL_TRIES = 4  # in each the kernel waits some 0.2 seconds


def seal(descriptor: int) -> None:
    """Seal an anonymous file against changes, so that a process that maps it gets no SIGBUS; does nothing elsewhere.

    Where pages stay busy only its length is sealed: contents have a checksum.
    """
    if sys.platform == "linux":
        import errno
        import fcntl

        length = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW
        for seals in (*[length | fcntl.F_SEAL_WRITE] * SEAL_TRIES, length):
            try:
                fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, seals)
                return
            except OSError as error:
                if error.errno in (errno.EPERM, errno.EINVAL):  # an ordinary file: no seals
                    return
                if error.errno != errno.EBUSY:  # while the system itself uses a page, because it moves it
                    raise


def reserve(descriptor: int, n_bytes: int, allocates: bool = sys.platform == "linux") -> None:
    """Give a new file this size, and reserve the space where the system can promise it. Raises OSError."""
    if allocates and sys.platform == "linux":
        os.posix_fallocate(descriptor, 0, n_bytes)
    else:
        os.ftruncate(descriptor, n_bytes)


def write_at(descriptor: int, data: memoryview, offset: int, positional: bool = hasattr(os, "pwrite")) -> int:
    """Write at a position of a file; returns how many bytes it took."""
    if positional and sys.platform != "win32":
        return os.pwrite(descriptor, data, offset)
    os.lseek(descriptor, offset, os.SEEK_SET)
    return os.write(descriptor, data)


def read_at(descriptor: int, n_bytes: int, offset: int, positional: bool = hasattr(os, "pread")) -> bytes:
    """At most so many bytes at a position of a file; other than the one where it is appended to."""
    if positional and sys.platform != "win32":
        return os.pread(descriptor, n_bytes, offset)
    os.lseek(descriptor, offset, os.SEEK_SET)
    return os.read(descriptor, n_bytes)


def open_last(path: Path) -> int:
    """Open a file to read it; its name is removed once it is open, or on Windows once it is closed."""
    if sys.platform == "win32":
        return os.open(path, os.O_RDONLY | os.O_BINARY | os.O_TEMPORARY)
    descriptor = os.open(path, os.O_RDONLY)
    os.unlink(path)
    return descriptor


# --------------------------------------------------------------------------------------------- descriptors over sockets


def send_with(sock: socket.socket, data: memoryview, descriptor: int | None) -> int:
    """Send what the socket takes, a descriptor with the first byte; returns how many bytes that was. Raises as
    `send`."""
    if descriptor is None:
        return sock.send(data)
    if sys.platform != "win32":
        return socket.send_fds(sock, [data], [descriptor])
    raise OSError("no descriptors over sockets on this system")


def receive_with(sock: socket.socket, n_bytes: int, n_descriptors: int) -> tuple[bytes, list[int], bool]:
    """At most so many bytes, and the descriptors that came with them; and whether some were lost. Raises as `recv`."""
    if sys.platform != "win32":
        received = array.array("i")
        room = socket.CMSG_SPACE(n_descriptors * received.itemsize)
        data, ancillary, flags, _ = sock.recvmsg(n_bytes, room, getattr(socket, "MSG_CMSG_CLOEXEC", 0))
        for level, kind, content in ancillary:
            if (level, kind) == (socket.SOL_SOCKET, socket.SCM_RIGHTS):
                received.frombytes(content[: len(content) - len(content) % received.itemsize])
        return data, list(received), bool(flags & socket.MSG_CTRUNC)
    return sock.recv(n_bytes), [], False
