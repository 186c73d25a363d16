"""Each call that not every system has, and what stands in for it."""

from __future__ import annotations

import errno
import mmap
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from app.system.system import (
    SEAL_TRIES,
    anonymous_file,
    has_hung_up,
    kill_group,
    process_lives,
    read_at,
    reserve,
    resident_bytes,
    seal,
    start_with_socket,
    write_at,
)

ROOT = Path(__file__).resolve().parents[3]
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="where /proc tells it")


@pytest.mark.parametrize("positional", [True, False])
def test_bytes_are_read_and_written_at_their_place(tmp_path: Path, positional: bool) -> None:
    descriptor = os.open(tmp_path / "file", os.O_RDWR | os.O_CREAT)
    reserve(descriptor, 100)
    assert write_at(descriptor, memoryview(b"later"), 50, positional) == 5
    assert write_at(descriptor, memoryview(b"first"), 10, positional) == 5
    assert read_at(descriptor, 5, 50, positional) == b"later"
    assert read_at(descriptor, 7, 9, positional) == b"\0first\0"
    os.close(descriptor)


@pytest.mark.parametrize("allocates", [True, False])
def test_room_is_reserved(tmp_path: Path, allocates: bool) -> None:
    descriptor = os.open(tmp_path / "file", os.O_RDWR | os.O_CREAT)
    reserve(descriptor, 1 << 16, allocates)
    assert os.fstat(descriptor).st_size == 1 << 16
    os.close(descriptor)


@pytest.mark.parametrize("polls", [True, False])
def test_a_closed_end_is_seen_and_nothing_is_read(polls: bool) -> None:
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    assert not has_hung_up(ours, 0.0, polls)
    theirs.send(b"words")
    assert not has_hung_up(ours, 0.0, polls)
    assert ours.recv(10) == b"words"
    theirs.close()
    assert has_hung_up(ours, 60.0, polls)
    ours.close()


def test_a_process_finds_the_socket_that_it_was_handed() -> None:
    ours, theirs = socket.socketpair()
    program = "import sys; from app.system.system import inherited_socket; inherited_socket(sys.argv[1]).send(b'here')"
    with ours, theirs:
        process = start_with_socket([sys.executable, "-c", program], theirs, {**os.environ, "PYTHONPATH": str(ROOT)})
        assert ours.recv(10) == b"here"
        assert process.wait() == 0


def test_a_group_is_killed_with_all_that_it_started(tmp_path: Path) -> None:
    words = tmp_path / "child"
    program = (
        "import pathlib, subprocess, sys, time\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        f"pathlib.Path({str(words)!r}).write_text(str(child.pid) + '.')\n"
        "time.sleep(600)"
    )
    process = subprocess.Popen([sys.executable, "-c", program], start_new_session=True)
    while not (words.exists() and words.read_text().endswith(".")):
        time.sleep(0.01)
    kill_group(process.pid)
    assert process.wait() < 0
    child = int(words.read_text().rstrip("."))
    deadline = time.monotonic() + 60.0
    while process_lives(child) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert not process_lives(child)


def test_processes_live_until_they_end() -> None:
    assert process_lives(os.getpid()) and process_lives(1)
    process = subprocess.Popen([sys.executable, "-c", ""])
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # it has ended, and nobody has collected it
    assert not process_lives(process.pid)
    process.wait()
    assert not process_lives(process.pid) and not process_lives(2**22 + 1)


@pytest.mark.skipif(sys.platform != "linux", reason="memfd_create(2)")
@pytest.mark.parametrize("n_busy", [1, 100])
def test_a_page_that_the_system_has_hold_of_does_not_keep_a_block_from_being_sealed(
    monkeypatch: pytest.MonkeyPatch, n_busy: int
) -> None:
    import fcntl

    seal_file, tries = fcntl.fcntl, list[int]()

    def busy(descriptor: int, command: int, seals: int) -> int:
        tries.append(seals)
        if seals & fcntl.F_SEAL_WRITE and len(tries) <= n_busy:
            raise OSError(errno.EBUSY, "busy")
        return seal_file(descriptor, command, seals)

    monkeypatch.setattr(fcntl, "fcntl", busy)
    descriptor = anonymous_file()
    os.ftruncate(descriptor, 10)
    seal(descriptor)
    with pytest.raises(PermissionError):
        os.ftruncate(descriptor, 5)
    assert len(tries) == min(n_busy, SEAL_TRIES) + 1
    os.close(descriptor)


@pytest.mark.parametrize("has_proc", [pytest.param(True, marks=LINUX), False])
def test_memory_that_a_process_holds(has_proc: bool) -> None:
    before = resident_bytes(os.getpid(), has_proc)
    held = mmap.mmap(-1, 64 << 20)  # not memory that was freed before, and is resident already
    held.write(os.urandom(1 << 20) * 64)
    assert 56 << 20 < resident_bytes(os.getpid(), has_proc) - before < 80 << 20
    held.close()
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    assert resident_bytes(ended.pid, has_proc) == 0


@LINUX
def test_a_windows_thread_asks_for_memory_without_a_library() -> None:
    asked = "import os, sys; from app.system.memory import resident_megabytes as asked; assert asked(os.getpid()) > 1"
    subprocess.run([sys.executable, "-c", f"{asked}; assert 'psutil' not in sys.modules"], cwd=ROOT, check=True)
