"""What a person waits for has the processors as other programs have them, and what nobody waits for has not."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.messages.worker_messages import Request, Response, SetCamera
from app.modes.orbit.orbit_messages import EstimateOrbit
from app.modes.placement.placement_messages import EstimateError, PrepareRelighting, SampleEdited
from app.worker.process import LAST, LITTLE, NICENESS, Background
from app.worker.schedule import Schedule
from app.worker.worker import Worker
from engine.core.threads import on_threads, pool
from engine.scene.raycaster import RayCaster

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="threads have no priority of their own")


def priority(_: object = None) -> int:
    """That of this thread."""
    return os.getpriority(os.PRIO_PROCESS, 0)


ROOT = Path(__file__).resolve().parents[3]
BEHIND = min(priority() + NICENESS, 19)


def everywhere() -> set[int]:
    """Of this thread, and of those that it shares its work with."""
    with pool() as threads:
        return {priority(), *on_threads(priority, range(8)), *threads.map(priority, range(8))}


@pytest.mark.parametrize("last", [False, True])
def test_a_worker_stands_a_little_behind_the_window(last: bool) -> None:
    say = (
        "import os; from app.worker.process import yield_to_window; "
        f"yield_to_window({last}); print(os.getpriority(0, 0))"
    )
    told = subprocess.run([sys.executable, "-c", say], cwd=ROOT, check=True, capture_output=True)
    assert int(told.stdout) == min(priority() + (LAST if last else LITTLE), LAST) and 0 < LITTLE < NICENESS


def test_a_thread_steps_back_with_all_that_work_for_it() -> None:
    ours, background = priority(), Background()
    assert background.run(everywhere) == {BEHIND}
    assert everywhere() == {ours}  # and nobody else
    assert background.run(everywhere) == {BEHIND}


def test_rays_are_traced_as_those_wait_who_ask(monkeypatch: pytest.MonkeyPatch) -> None:
    caster = RayCaster(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float), np.array([[0, 1, 2]]), threads=2)
    seen: set[int] = set()
    ask = lambda: caster._split(1 << 18, lambda part: seen.add(priority()))  # noqa: E731
    for _ in range(2):
        seen.clear()
        Background().run(ask)
        assert seen == {BEHIND}
        seen.clear()
        ask()
        assert seen == {priority()}


def test_what_a_step_raises_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        Background().run(lambda: 1 // 0)


class Noting:
    """Takes three steps for anything, and notes with what priority."""

    def __init__(self) -> None:
        self.found: dict[type[Request], set[int]] = {}

    def handle(self, request: Request) -> Iterator[Response | None]:
        for _ in range(3):
            self.found.setdefault(type(request), set()).add(priority())
            yield None


def test_the_worker_steps_back_for_what_nobody_waits_for() -> None:
    tasks = Noting()
    worker, schedule = Worker(None), Schedule(tasks)
    look = SetCamera(1)
    behind = EstimateOrbit(None, 1, look, look), EstimateError(None), PrepareRelighting(None), SampleEdited(None)
    for request in (look, *behind):
        schedule.accept(request)
    while (chosen := schedule.choose()) is not None:
        worker._advance(schedule, chosen)
    assert tasks.found.pop(SetCamera) == {priority()}
    assert tasks.found == dict.fromkeys(map(type, behind), {BEHIND})
