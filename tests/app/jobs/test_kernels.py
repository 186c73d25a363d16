"""Kernels made ready: who compiles, who waits for whom, and that a failure costs time alone."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.jobs import kernels
from app.jobs.cache import Store
from app.jobs.in_process import InProcessClient
from app.jobs.kernels import PARTS, Kernels
from app.jobs.placement import _telling_first_time
from app.kernel_cache import kernel_folders
from app.messages import Progress, Response
from app.placement.messages import StageDone
from tests.app.jobs.test_tasks import compute, opened, source

__all__ = ["source"]  # a fixture

ROOT = Path(__file__).resolve().parents[3]


class Compiler:
    """A compiling process that ends when it is told to."""

    def __init__(self, part: str, log: list[str]) -> None:
        self.part, self._log = part, log
        self.done = threading.Event()

    def wait(self, timeout_s: float | None) -> None:
        assert self.done.wait(10.0)
        self._log.append(f"{self.part} compiled")


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What happened, in order, around kernels that nobody compiles."""
    happened: list[str] = []
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(kernels, "rehearse", lambda part: happened.append(f"{part} read"))
    return happened


@pytest.fixture
def compilers(log: list[str], monkeypatch: pytest.MonkeyPatch) -> list[Compiler]:
    started: list[Compiler] = []

    def start(part: str) -> Compiler:
        started.append(Compiler(part, log))
        return started[-1]

    monkeypatch.setattr(kernels, "_start_compiler", start)
    return started


def test_the_first_time_each_part_is_compiled_by_a_process(log: list[str], compilers: list[Compiler]) -> None:
    made = Kernels()
    assert made.first_time and [compiler.part for compiler in compilers] == list(PARTS)
    made.prepare()
    compilers[1].done.set()
    assert not made.wait(0.05) and log == []  # reading one that is not there would compile it here
    compilers[0].done.set()
    assert made.wait(10.0)
    assert log == [*(f"{part} compiled" for part in PARTS), *(f"{part} read" for part in PARTS)]


def test_the_next_time_they_are_only_read(log: list[str], compilers: list[Compiler]) -> None:
    first = Kernels()
    for compiler in compilers:
        compiler.done.set()
    first.prepare()
    assert first.wait(10.0)
    compilers.clear()
    log.clear()
    second = Kernels()
    second.prepare()
    assert second.wait(10.0) and not second.first_time
    assert compilers == [] and log == [f"{part} read" for part in PARTS]


def test_a_failure_holds_nobody_up_and_is_tried_again(
    log: list[str], compilers: list[Compiler], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(part: str) -> None:
        raise RuntimeError("no compiler today")

    monkeypatch.setattr(kernels, "rehearse", fail)
    made = Kernels()
    for compiler in compilers:
        compiler.done.set()
    made.prepare()
    assert made.wait(10.0)
    assert Kernels().first_time


def test_what_other_sources_were_compiled_to_is_not_there(log: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    kernels.note_compiled()
    assert kernels.are_compiled() and not kernels.are_compiled(kernels.INDIRECT)
    monkeypatch.setattr(kernels, "kernel_digest", lambda: "of others")
    assert not kernels.are_compiled()


def test_a_part_is_compiled_by_one_process_at_a_time(log: list[str]) -> None:
    """Who comes second waits for the first: what that has compiled, it reads."""

    def second() -> None:
        with kernels.alone("the rest"):
            log.append("second")

    waiting = threading.Thread(target=second)
    with kernels.alone("the rest"), kernels.alone("projection"):
        waiting.start()
        waiting.join(0.2)
        log.append("first")
    waiting.join(10.0)
    assert log == ["first", "second"]


def test_where_no_lock_can_be_had_it_is_compiled_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    with kernels.alone("the rest"):
        pass


def test_where_no_kernels_are_kept_nobody_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    kernels.note_compiled()
    assert kernels.are_compiled()


def test_indirect_light_says_so_while_it_compiles(log: list[str]) -> None:
    def steps() -> Iterator[Response | None]:
        yield Progress("indirect light", 0.5, text="looking around")
        yield None

    rough, fine = list(_telling_first_time(steps(), False)), list(_telling_first_time(steps(), True))
    for answers in (rough, fine):  # a rough one does not call all that a fine one calls
        assert [(a.fraction, a.text) for a in answers if isinstance(a, Progress)] == [
            (0.0, kernels.FIRST_TIME),
            (0.5, f"looking around, {kernels.FIRST_TIME}"),
        ]
    assert [a.text for a in _telling_first_time(steps(), True) if isinstance(a, Progress)] == ["looking around"]


class Waiting(Kernels):
    """Kernels that are ready when a test says so."""

    def __init__(self, first_time: bool) -> None:
        self.first_time = first_time
        self._ready = threading.Event()

    def finish(self) -> None:
        self._ready.set()


@pytest.mark.parametrize("first_time", [True, False])
def test_transport_waits_for_them_and_says_so_the_first_time(source: str, store: Store, first_time: bool) -> None:
    tasks = opened(source, store)
    tasks.bench.kernels = waiting = Waiting(first_time)
    client = InProcessClient(tasks)
    client.send(compute())
    answers: list[Response] = []
    for _ in range(6):
        answers += client.poll(budget_s=0.0)
    said = [(answer.stage, answer.text) for answer in answers if isinstance(answer, Progress)]
    assert bool(said) == first_time and all(stage == kernels.COMPILING for stage, _ in said)
    assert not any(isinstance(answer, StageDone) for answer in answers)
    waiting.finish()
    answers = client.poll(budget_s=float("inf"))
    assert [answer.stage for answer in answers if isinstance(answer, StageDone)] == ["coarse", "preview", "final"]
    assert not any(isinstance(answer, Progress) and answer.stage == kernels.COMPILING for answer in answers)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "cache")


def test_the_compiler_is_loaded_without_scipy_which_stays_usable() -> None:
    program = """
import sys
from app.jobs.kernels import load_compiler
load_compiler()
assert not [name for name in sys.modules if name.split(".")[0] == "scipy"]
import numba, numpy
twice = numba.njit(lambda x: 2 * x)
assert twice(21) == 42
assert not [name for name in sys.modules if name.split(".")[0] == "scipy"]
from scipy.spatial import cKDTree
assert cKDTree(numpy.eye(3)).query([0.9, 0, 0])[1] == 0
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stderr


def test_compiling_is_told_by_the_files_that_are_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    waiting = Waiting(first_time=True)
    assert waiting.fraction == 0.0
    of_these_sources, of_others = tmp_path / kernel_folders()[0], tmp_path / "of_others"
    for folder in (of_these_sources, of_others):
        folder.mkdir()
        for i in range(kernels.N_FILES // 2):
            (folder / f"kernel-{i}.nbc").touch()
    assert waiting.fraction == 0.5
    for i in range(2 * kernels.N_FILES):
        (of_these_sources / f"kernel-{i}.nbc").touch()
    assert waiting.fraction == 0.99  # all but what is compiled last


@pytest.mark.sweep
def test_as_many_files_are_compiled_as_are_counted(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    for part in PARTS:
        code = f"import app.jobs.kernels as k; k.load_compiler(); k.rehearse({part!r})"
        assert subprocess.run([sys.executable, "-c", code], env=environment).returncode == 0
    assert 0.9 * kernels.N_FILES <= sum(1 for _ in tmp_path.rglob("*.nbc")) <= 1.1 * kernels.N_FILES


def test_an_installation_compiles_all_once(compilers: list[Compiler], log: list[str], monkeypatch) -> None:
    monkeypatch.setattr(Compiler, "wait", lambda compiler, timeout_s: log.append(f"{compiler.part} compiled"))
    kernels.compile_all()
    assert [compiler.part for compiler in compilers] == list(PARTS) and kernels.are_compiled()
    assert log == [f"{part} compiled" for part in PARTS] + [f"{part} read" for part in PARTS]
    kernels.compile_all()
    assert len(compilers) == len(PARTS)
