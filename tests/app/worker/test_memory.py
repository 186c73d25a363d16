"""The worker's memory over many scenes and many edits: flat, once everything has been there."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
import weakref
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from PIL import Image

from app.messages.worker_messages import Shutdown
from app.worker import worker
from app.worker.cache import ArrayCache
from app.worker.schedule import Schedule
from engine.material.bumps import Bumps
from engine.scene.scene_loader import load_scene
from tests.app.worker.ball_and_lamp import SCENE, opened
from tests.opened import open_in_process

ROOT = Path(__file__).resolve().parents[3]
MOST_MB = 20.0
PROGRAM = """
import sys
from dataclasses import replace
from pathlib import Path
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from app.system.system import release_memory
from app.modes.placement.placement_messages import FreezeIndirect
from tests.app.worker.ball_and_lamp import GLOSS, compute, with_layer, work
from tests.opened import ask_for_scene

source, what, n = sys.argv[1], sys.argv[2], int(sys.argv[3])
client = InProcessClient(RequestDispatcher(ArrayCache(Path(source).parent / "cache")))

def answered(*requests):
    for request in requests:
        client.send(request)
    return client.poll(float("inf"))

def opening(i):
    ask_for_scene(client, source, resolution=(48, 36))
    answered()

def edit(i):
    layer = work(GLOSS, "rough_conductor", alpha=0.1 + 0.85 * (i * 0.618 % 1.0)).layer
    request = with_layer(compute(n_bounces=2, n_lights=80), GLOSS, layer=layer, bands=(64, 16))
    answered(request)
    answered(FreezeIndirect(request.scene, GLOSS, 0))

def megabytes():
    release_memory()  # as the worker does when nothing is asked of it
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

opening(0)
do = opening if what == "openings" else edit
warm = max(n // 4, 6)
for i in range(n + warm):
    if i == warm:
        before = megabytes()
    do(i)
print(megabytes() - before)
"""


@pytest.fixture
def source(tmp_path: Path) -> str:
    """The small scene with images on its ball, 12 MB once they are read."""
    rng = np.random.default_rng(1)
    for name in ("colour", "bump"):
        Image.fromarray(rng.integers(0, 256, (512, 1024, 3), np.uint8)).save(tmp_path / f"{name}.png")
    text = SCENE.replace('name = "ball"\n', 'name = "ball"\nbump_map = { file = "bump.png" }\n')
    text = text.replace('[{ model = "lambert" }, {', '[{ model = "lambert", texture = "colour.png" }, {')
    (tmp_path / "scene.toml").write_text(text)
    (tmp_path / "plain.toml").write_text(SCENE)
    return str(tmp_path / "scene.toml")


def growth(source: str, what: str, n: int) -> float:
    """Megabytes by which a process has grown over so many of these, after a quarter as many."""
    command = [sys.executable, "-c", PROGRAM, source, what, str(n)]
    run = subprocess.run(command, cwd=ROOT, env=dict(os.environ), capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return float(run.stdout)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(("what", "n"), [("openings", 16), ("edits", 12)])
def test_memory_is_flat(source: str, what: str, n: int) -> None:
    grown = growth(source, what, n)
    assert grown < MOST_MB, grown


@pytest.mark.sweep
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(("what", "n"), [("openings", 200), ("edits", 2000)])
def test_memory_stays_flat(source: str, what: str, n: int) -> None:
    grown = growth(source, what, n)
    assert grown < MOST_MB, grown


def test_no_circle_keeps_a_scene(source: str) -> None:
    # Counted references alone free it: the collector runs when many objects are made, and a scene is few, and large.
    scene = load_scene(source)
    assert scene.bump_normals.objects
    gone = weakref.ref(scene.textures), weakref.ref(scene)
    del scene
    assert [each() for each in gone] == [None, None]


def test_nor_do_flawed_bumps(source: str) -> None:
    Path(source).with_name("bump.png").write_bytes(b"no image any more")
    scene = load_scene(Path(source).with_name("plain.toml"))
    scene = scene.with_bumps({"ball": Bumps(bump_map=str(Path(source).with_name("bump.png")))})
    assert scene.bump_normals.flaws
    gone = weakref.ref(scene)
    del scene
    assert gone() is None


def test_a_scene_goes_when_another_is_looked_at(source: str, tmp_path: Path) -> None:
    tasks = opened(source, ArrayCache(tmp_path / "store"))
    first = weakref.ref(tasks.context.rest_scene)
    gc.disable()
    try:
        open_in_process(tasks, source)
        assert first() is None
    finally:
        gc.enable()


def test_memory_goes_back_once_after_work(monkeypatch: pytest.MonkeyPatch) -> None:
    released, waits = [], []
    requests = iter([[], [], ["work"], [], [], [Shutdown()]])

    class Channel:
        def __init__(self) -> None:
            self.due: list[object] = []

        def receive(self, deadline: float) -> object:
            return self.due.pop(0) if self.due else None

        def wait(self, timeout: float | None) -> bool:
            waits.append(timeout)
            self.due = list(next(requests))
            return bool(self.due)

        def send(self, message: object) -> None:
            pass

    class Works:
        def __init__(self) -> None:
            self.asked: list[object] = []

        def accept(self, request: object) -> None:
            self.asked.append(request)

        def choose(self) -> object:
            return SimpleNamespace(id=1, revision=1, is_foreground=True) if self.asked else None

        def step(self) -> None:
            self.asked.pop()

    monkeypatch.setattr(worker, "release_memory", lambda: released.append(len(waits)))
    worker.Worker(cast(Any, Channel())).run(cast(Schedule, Works()))
    # Nothing was done before the third wait; after the work it waits for a second, gives memory back once, and sleeps.
    assert waits == [None, None, None, worker.IDLE_SECONDS, None, None] and released == [4]


HOLES = """
import sys
from pathlib import Path
from app.system.system import keep_memory_compact
if sys.argv[1] == "compact":
    keep_memory_compact()
before = bytearray(24 << 20)
del before  # from here on the C library maps nothing smaller by itself
large, small = [], []
for _ in range(20):
    large.append(bytearray(b"x") * (6 << 20))
    small.append(bytearray(b"x") * (64 << 10))
del large
print(int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_freed_arrays_leave_no_holes_between_others() -> None:
    def held(how: str) -> float:
        return float(subprocess.check_output([sys.executable, "-c", HOLES, how], cwd=ROOT, text=True))

    assert held("compact") < 60.0 < held("as it is")
