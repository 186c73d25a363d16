"""Blocks are whole and sound, or refused; no room is an error; nothing is left behind."""

import gc
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from app.system import system
from app.worker import shared_arrays
from app.worker.shared_arrays import (
    Block,
    BlockError,
    Method,
    OutOfMemory,
    create_block,
    kept_block_name,
    open_kept_block,
    sweep_dead_blocks,
)
from tests.app.limits import largest_file, open_descriptors, small_disk

METHODS: tuple[Method, ...] = ("memfd", "named", "kept")
LATER = float("inf")


def block_of(data: bytes, generation: int = 3, method: Method = "named") -> tuple[int, int]:
    return _opened(create_block([data], generation, method))


def _opened(made: tuple[int | Path, int]) -> tuple[int, int]:
    """As the receiver has it: by its descriptor."""
    block, size = made
    return (block, size) if isinstance(block, int) else (open_kept_block(*kept_block_name(block)), size)


@pytest.mark.parametrize("method", METHODS)
def test_buffers_come_back_and_are_read_only(method: Method) -> None:
    sent = [os.urandom(5000), b"", os.urandom(3_000_000)]
    block = Block(*_reordered(create_block(sent, 7, method), 7))
    assert block.verify(LATER)
    received = block.buffers()
    assert [bytes(buffer) for buffer in received] == sent
    assert all(buffer.readonly for buffer in received)
    start = np.frombuffer(received[2], np.uint8).__array_interface__["data"][0]
    assert start % 64 == 0  # aligned for every dtype


def _reordered(made: tuple[int | Path, int], generation: int) -> tuple[int, int, int]:
    descriptor, size = _opened(made)
    return descriptor, generation, size


@pytest.mark.parametrize("method", METHODS)
def test_arrays_outlive_the_block_and_the_memory_goes_with_them(method: Method) -> None:
    gc.collect()  # what earlier tests dropped closes its descriptors now
    before = open_descriptors()
    block = Block(*_reordered(create_block([b"\1" * 8192], 1, method), 1))
    assert block.verify(LATER)
    array = np.frombuffer(block.buffers()[0], np.uint8)[100:200]
    del block
    gc.collect()
    assert array.sum() == 100  # 100 bytes of value 1, still mapped
    del array
    gc.collect()
    assert open_descriptors() == before


def test_partial_block_is_refused() -> None:
    """The header is written last: a sender killed in the middle of a block has left none."""
    descriptor = os.memfd_create("test")
    os.posix_fallocate(descriptor, 0, 8192)
    os.pwrite(descriptor, b"\1" * 4096, 40)
    with pytest.raises(BlockError, match="without a complete header"):
        Block(descriptor, 1, 8192)


def test_block_shorter_than_announced_is_refused_before_it_is_mapped() -> None:
    descriptor, size = block_of(b"x" * 5000)
    os.ftruncate(descriptor, size - 1)  # to touch the missing page would be a SIGBUS
    with pytest.raises(BlockError, match="announced"):
        Block(descriptor, 3, size)


@pytest.mark.parametrize("place", [45, 60, 2000, -1])
def test_one_flipped_bit_is_refused(place: int) -> None:
    """In the table, the padding, the data, the last byte."""
    descriptor, size = block_of(b"x" * 5000)
    place %= size
    os.pwrite(descriptor, bytes([os.pread(descriptor, 1, place)[0] ^ 4]), place)
    block = Block(descriptor, 3, size)
    with pytest.raises(BlockError, match="checksum"):
        block.verify(LATER)


def test_block_of_another_generation_is_refused() -> None:
    descriptor, size = block_of(b"x" * 5000, generation=3)
    with pytest.raises(BlockError, match="generation 3 where 4"):
        Block(descriptor, 4, size)


def test_nothing_is_handed_out_before_all_is_verified() -> None:
    block = Block(*_reordered(block_of(bytes(9 << 20)), 3))
    assert not block.verify(time.monotonic())  # one slice of nine
    with pytest.raises(BlockError, match="not verified yet"):
        block.buffers()
    n_slices = 1
    while not block.verify(time.monotonic()):
        n_slices += 1
    assert n_slices >= 8
    assert len(block.buffers()[0]) == 9 << 20


def test_sealed_block_cannot_be_changed_by_its_sender() -> None:
    descriptor, _ = block_of(b"x" * 5000, method="memfd")
    with pytest.raises(PermissionError):
        os.pwrite(descriptor, b"y", 100)
    with pytest.raises(PermissionError):
        os.ftruncate(descriptor, 100)
    os.close(descriptor)


@pytest.mark.parametrize("method", METHODS)
def test_no_room_is_an_error_and_leaves_nothing(method: Method) -> None:
    before = open_descriptors()
    with largest_file(1 << 16), pytest.raises(OutOfMemory, match="no memory for 2 MiB of results"):
        create_block([bytes(2 << 20)], 1, method)
    assert open_descriptors() == before


@pytest.mark.parametrize("method", ["named", "kept"])
def test_full_memory_folder_is_an_error_not_a_sigbus(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: Method
) -> None:
    with small_disk(tmp_path / "shm", 1 << 20) as folder:
        monkeypatch.setattr(system, "memory_folder", lambda: folder)
        with pytest.raises(OutOfMemory, match="No space left on device"):
            create_block([bytes(2 << 20)], 1, method)
        assert os.listdir(folder) == []


def test_more_than_the_machine_has_is_refused_before_it_is_reserved(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_arrays, "available_memory", lambda: 20 << 20)
    with pytest.raises(OutOfMemory, match="20 MiB are free"):
        create_block([bytes(19 << 20)], 1)


def test_available_memory_is_plausible() -> None:
    available = shared_arrays.available_memory()
    assert 1 << 20 < available < os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")


def test_sweep_removes_names_of_dead_processes_only(tmp_path: Path) -> None:
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()
    dead, living = f"insitu-{child.pid}-0.block", f"insitu-{os.getpid()}-0.block"
    for name in (dead, living, "insitu.block"):
        (tmp_path / name).touch()
    sweep_dead_blocks(tmp_path)
    assert sorted(os.listdir(tmp_path)) == sorted([living, "insitu.block"])


def test_a_kept_block_lies_in_its_file_until_it_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(system, "memory_folder", lambda: tmp_path)
    file, size = create_block([b"x" * 5000], 3, "kept")
    assert isinstance(file, Path) and os.listdir(tmp_path) == [file.name]
    block = Block(open_kept_block(*kept_block_name(file)), 3, size)
    assert os.listdir(tmp_path) == []
    assert block.verify(LATER) and bytes(block.buffers()[0]) == b"x" * 5000
    with pytest.raises(BlockError, match="cannot be opened: No such file"):
        open_kept_block(*kept_block_name(file))
