"""Kernels made ready: who compiles, who waits for whom, and that a failure costs time alone."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from app.messages.worker_messages import CancelRequests, Progress, Response
from app.modes.deform.deform_messages import PrepareDeform
from app.modes.orbit.orbit_messages import DrawHeadlight, OrbitPictureDrawn, OrbitProgress, PrepareOrbit
from app.modes.placement.placement_messages import (
    BandsPlanned,
    ContractTransport,
    IndirectFound,
    LayerPicture,
    MapsSampled,
    PlanBands,
    SampleMaps,
    StageDone,
)
from app.system.kernel_cache import kernel_folders
from app.worker import kernels
from app.worker.cache import ArrayCache
from app.worker.kernels import PARTS, Kernels
from app.worker.schedule import InProcessClient
from engine.material.layer_maps import Images
from engine.material.strokes import Stroke, Strokes, pack_dabs
from tests.app.worker.ball_and_lamp import compute, opened
from tests.quick_indirect import light_quickly

ROOT = Path(__file__).resolve().parents[3]


class Compiler:
    """A compiling process that ends when it is told to."""

    def __init__(self, part: str, first: str, log: list[str]) -> None:
        self.part, self.first, self._log = part, first, log
        self.done, self.is_killed = threading.Event(), False

    def wait(self, timeout_s: float | None) -> None:
        assert self.done.wait(10.0)
        self._log.append(f"{self.part} compiled")

    def kill(self) -> None:
        self.is_killed = True


@pytest.fixture
def log(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What happened, in order, around kernels that nobody compiles."""
    happened: list[str] = []
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(kernels, "warm_up", lambda part: happened.append(f"{part} read"))
    return happened


@pytest.fixture
def compilers(log: list[str], monkeypatch: pytest.MonkeyPatch) -> list[Compiler]:
    started: list[Compiler] = []

    def start(part: str, first: str = "") -> Compiler:
        started.append(Compiler(part, first, log))
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
    assert [compiler.part for compiler in compilers] == [kernels.LATER_PART] and log == [
        f"{part} read" for part in PARTS
    ]


def test_a_failure_holds_nobody_up_and_is_tried_again(
    log: list[str], compilers: list[Compiler], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(part: str) -> None:
        raise RuntimeError("no compiler today")

    monkeypatch.setattr(kernels, "warm_up", fail)
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


def test_where_no_kernels_are_kept_nobody_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    kernels.note_compiled()
    assert kernels.are_compiled()


class Later:
    """The process that compiles what is wanted later, as `subprocess.Popen`, and ends when a test says so."""

    def __init__(self, first: str = "") -> None:
        self.has_ended, self.first = False, first

    def kill(self) -> None:
        self.has_ended = True

    def wait(self, timeout_s: float = 0.0) -> int:
        if not self.has_ended:
            raise subprocess.TimeoutExpired("compiler", timeout_s)
        return 0


class Waiting(Kernels):
    """Kernels that are ready when a test says so."""

    def __init__(self, first_time: bool) -> None:
        self.first_time = first_time
        self._ready = threading.Event()
        self._later = None
        self._first = ""

    def wait_for(self, later: Later) -> None:
        """Only what is wanted later is still to come."""
        self._ready.set()
        self._later = later

    def finish(self) -> None:
        self._ready.set()


@pytest.mark.parametrize("first_time", [True, False])
def test_transport_waits_for_them_and_says_so_the_first_time(source: str, store: ArrayCache, first_time: bool) -> None:
    tasks = opened(source, store)
    tasks.context.kernels = waiting = Waiting(first_time)
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


@pytest.mark.parametrize("has_compiled", [True, False], ids=["compiled", "failed"])
def test_indirect_light_waits_for_its_kernels_and_quick_requests_do_not(
    source: str, store: ArrayCache, log: list[str], has_compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    light_quickly(monkeypatch)
    tasks, later = opened(source, store), Later()
    tasks.context.kernels = waiting = Waiting(first_time=True)
    waiting.wait_for(later)
    client = InProcessClient(tasks)
    client.send(compute(n_bounces=2))
    answers: list[Response] = []
    while not any(isinstance(answer, Progress) and answer.text == kernels.FIRST_TIME for answer in answers):
        answers += client.poll(budget_s=0.0)
    # The direct light did not wait; and what a drag asks for meanwhile is answered.
    assert [answer.stage for answer in answers if isinstance(answer, StageDone)] == ["coarse", "preview"]
    client.send(ContractTransport(compute().scene.layers[0], None))
    answers = [answer for _ in range(8) for answer in client.poll(budget_s=0.0)]
    assert any(isinstance(answer, LayerPicture) for answer in answers)
    assert not any(isinstance(answer, IndirectFound) for answer in answers)
    if has_compiled:
        kernels.note_compiled(kernels.INDIRECT)
    later.has_ended = True
    answers = client.poll(budget_s=float("inf"))
    assert any(isinstance(answer, IndirectFound) for answer in answers)
    assert [answer.exact for answer in answers if isinstance(answer, StageDone)] == [True]


@pytest.mark.parametrize("mode", [kernels.ORBIT, kernels.DEFORM])
def test_a_mode_waits_for_its_kernels_and_plain_pictures_do_not(
    source: str, store: ArrayCache, log: list[str], monkeypatch: pytest.MonkeyPatch, mode: str
) -> None:
    """The process that compiles begins anew with what is waited for, once."""
    started: list[Later] = []
    monkeypatch.setattr(kernels, "_start_compiler", lambda part, first: started.append(Later(first)) or started[-1])
    tasks = opened(source, store)
    tasks.context.kernels = waiting = Waiting(first_time=True)
    waiting.wait_for(before := Later())
    client, state = InProcessClient(tasks), compute().scene
    prepare = PrepareDeform(state, 1, n_rays=16) if mode == kernels.DEFORM else PrepareOrbit(state, 1, n_points=50)
    client.send(prepare)
    answers = [answer for _ in range(8) for answer in client.poll(budget_s=0.0)]
    said = [answer for answer in answers if isinstance(answer, Progress)]
    assert said and all((each.stage, each.text) == (kernels.COMPILING, kernels.FIRST_TIME) for each in said)
    assert before.has_ended and [later.first for later in started] == [mode]
    client.send(DrawHeadlight(tasks.context.open_placement.scene.description.camera, (16, 12), state))
    answers = [answer for _ in range(40) for answer in client.poll(budget_s=0.0)]
    assert any(isinstance(answer, OrbitPictureDrawn) and answer.radiance.any() for answer in answers)
    assert not any(isinstance(answer, OrbitProgress) for answer in answers)
    client.send(CancelRequests())
    client.poll(budget_s=0.0)
    assert not client.wait(0.0) and len(started) == 1
    kernels.note_compiled(mode)
    client.send(prepare)
    answers = client.poll(budget_s=0.0)
    assert not any(isinstance(answer, Progress) and answer.stage == kernels.COMPILING for answer in answers)


def test_what_is_next_in_order_is_not_begun_anew(log: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kernels, "_start_compiler", lambda *_: pytest.fail("started anew"))
    for what in kernels.LATER[: kernels.LATER.index(kernels.ORBIT)]:
        kernels.note_compiled(what)
    waiting = Waiting(first_time=True)
    waiting.wait_for(later := Later())
    next(waiting.until_ready(kernels.ORBIT, goes_first=True))
    assert not later.has_ended


def test_what_is_wanted_later_waits_for_the_process_that_compiles_it(compilers: list[Compiler]) -> None:
    made = Kernels()
    steps = made.until_ready(kernels.DEFORM)
    next(steps)  # that process is not started yet
    for compiler in compilers:
        compiler.done.set()
    kernels.note_compiled(kernels.DEFORM)
    assert list(steps) == []


def test_a_dab_waits_for_its_kernels_and_a_plan_of_bands_does_not(
    source: str, store: ArrayCache, log: list[str]
) -> None:
    tasks = opened(source, store)
    tasks.context.kernels = waiting = Waiting(first_time=True)
    waiting.wait_for(Later())
    client = InProcessClient(tasks)
    stroke = Stroke(0.2, dabs=pack_dabs([[0.0, 0.5, 0.0]], [[0.0, 1.0, 0.0]]))
    key, layer = compute().scene.layers[0].key, compute().scene.layers[0].layer
    client.send(SampleMaps(((key, Images(strokes=Strokes((stroke,)))),)))
    client.send(PlanBands((layer,)))
    answers = [answer for _ in range(8) for answer in client.poll(budget_s=0.0)]
    assert [type(answer) for answer in answers] == [BandsPlanned]
    kernels.note_compiled(kernels.PAINTING)
    assert any(isinstance(answer, MapsSampled) for answer in client.poll(budget_s=float("inf")))


def test_what_is_wanted_later_is_compiled_after_the_rest_and_once(compilers: list[Compiler], log: list[str]) -> None:
    first = Kernels()
    for compiler in compilers:
        compiler.done.set()
    first.prepare_and_wait()
    assert [compiler.part for compiler in compilers] == [*PARTS, kernels.LATER_PART]
    assert not first.is_ready(kernels.PAINTING)
    for what in kernels.LATER:
        kernels.note_compiled(what)
    assert first.is_ready(kernels.PAINTING)
    compilers.clear()
    Kernels().prepare_and_wait()
    assert compilers == []


def test_the_user_may_wait_for_indirect_light_and_for_nothing_after_it(
    log: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def behind(niceness: int) -> None:
        log.append(f"behind by {niceness}, compiled: {[what for what in kernels.LATER if kernels.are_compiled(what)]}")

    monkeypatch.setattr("app.worker.kernel_warm_up.warm_up_later", lambda first, is_done: iter(kernels.LATER))
    monkeypatch.setattr(kernels, "step_behind", behind)
    monkeypatch.setattr(kernels, "yield_to_window", lambda last: log.append(f"last: {last}"))
    monkeypatch.setattr(kernels, "warm_up", lambda part: kernels._warm_up_later(""))
    monkeypatch.setattr(kernels, "end_with_parent", lambda parent: None)
    monkeypatch.setattr(kernels.gc, "set_threshold", lambda threshold: None)
    monkeypatch.setattr(sys, "argv", ["kernels", kernels.LATER_PART, "1"])
    kernels.main()
    assert log == ["last: False", f"behind by 19, compiled: {[kernels.PAINTING, kernels.INDIRECT]}"]
    assert all(map(kernels.are_compiled, kernels.LATER))


@pytest.fixture
def store(tmp_path: Path) -> ArrayCache:
    return ArrayCache(tmp_path / "cache")


def test_the_compiler_is_loaded_without_scipy_which_stays_usable() -> None:
    program = """
import sys
from app.worker.kernels import load_compiler
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
        code = f"import app.worker.kernels as k; k.load_compiler(); k.warm_up({part!r})"
        assert subprocess.run([sys.executable, "-c", code], env=environment).returncode == 0
    assert 0.9 * kernels.N_FILES <= sum(1 for _ in tmp_path.rglob("*.nbc")) <= 1.1 * kernels.N_FILES


def test_an_installation_compiles_all_once(compilers: list[Compiler], log: list[str], monkeypatch) -> None:
    monkeypatch.setattr(Compiler, "wait", lambda compiler, timeout_s=0.0: log.append(f"{compiler.part} compiled"))
    kernels.compile_all()
    first, later = [f"{part} compiled" for part in PARTS], f"{kernels.LATER_PART} compiled"
    # What is needed later is compiled by one process in order, and by two others that begin with Orbit and with Deform.
    assert kernels.are_compiled() and log == [*first, *(f"{part} read" for part in PARTS), *3 * [later]]
    assert [compiler.first for compiler in compilers] == ["", "", "", kernels.ORBIT, kernels.DEFORM]
    assert [compiler.is_killed for compiler in compilers] == [False, False, False, True, True]
    for what in kernels.LATER:
        kernels.note_compiled(what)
    kernels.compile_all()
    assert len(compilers) == len(PARTS) + 3


def test_a_process_that_has_compiled_all_is_ended(compilers: list[Compiler], monkeypatch: pytest.MonkeyPatch) -> None:
    """Its last kernel may be noted before it ends by itself: nobody would wait for it then."""

    def wait(compiler: Compiler, timeout_s: float | None = None) -> None:
        if compiler.part == kernels.LATER_PART and timeout_s is not None:
            for what in kernels.LATER:
                kernels.note_compiled(what)
            raise subprocess.TimeoutExpired(compiler.part, timeout_s)

    monkeypatch.setattr(Compiler, "wait", wait)
    kernels.compile_all()
    assert [compiler.is_killed for compiler in compilers] == [False, False, True, True, True]
