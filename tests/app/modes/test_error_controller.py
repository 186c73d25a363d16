"""How far off the picture is, asked of the worker once nothing else is to be done; here with a real one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetVisible
from app.document.commands.light import SetIntensity, SetRotation
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import CancelRequests, Request, Response
from app.modes.placement.indirect_controller import FINE_STAGE
from app.modes.placement.placement_messages import ComputeTransport, ErrorEstimated, EstimateError
from app.modes.placement.placement_status import RenderReport
from app.project.project import ProjectSpec
from app.stills.stills import render_project
from app.worker import indirect_tasks
from app.worker.cache import ArrayCache
from app.worker.indirect_tasks import IndirectTasks
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.curve.operators import Operator
from engine.precompute.indirect.sampling_settings import ROUGH, BounceSeries
from tests.scene_text import ground, material, placed, scaled

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)
SCENE = ground((16, 12)) + placed(
    "ball", "sphere", scaled(1, (0, 0.5, 0)), material('model = "rough_conductor", alpha = 0.3')
)


class WatchedClient(InProcessClient):
    """A worker in this process, and what it was asked."""

    def __init__(self, folder: Path) -> None:
        super().__init__(RequestDispatcher(ArrayCache(folder)))
        self.requests: list[Request] = []

    def send(self, request: Request) -> int:
        self.requests.append(request)
        return super().send(request)

    def sent(self, kind: type[Request]) -> int:
        return sum(isinstance(request, kind) for request in self.requests)

    def steps(self, n: int) -> list[Response]:
        """So many steps of its work."""
        return [answer for _ in range(n) for answer in self.poll(budget_s=0.0)]


class Desk:
    """An editor whose picture is drawn at once."""

    def __init__(self, folder: Path, n_bounces: int) -> None:
        self.scene = folder / "scene.toml"
        self.scene.write_text(SCENE)
        self.client = WatchedClient(folder / "cache")
        self.editor, self.now = Editor(self.client, str(self.scene)), 0.0
        self.until_open()
        self.editor.do(SetView.of(n_lights=500, n_bounces=n_bounces))

    def frames(self, n: int, seconds: float = 0.1) -> None:
        for _ in range(n):
            self.now += seconds
            self.editor.tick(self.now)
            self.editor.controller.rendered(RenderReport(exact=True))

    def until_open(self) -> None:
        for _ in range(1000):
            if self.editor.scene_is_open:
                return
            self.frames(1)
        raise AssertionError(self.editor.status)

    def until_finished(self) -> None:
        for _ in range(100_000):
            if self.editor.status.is_finished:
                return
            self.frames(1, 0.03)
        raise AssertionError(self.editor.status)

    def until_judged(self) -> None:
        for _ in range(100_000):
            if self.editor.status.estimate is not None:
                return
            self.frames(1)
        raise AssertionError(self.editor.status)


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path, 1)


def test_it_is_what_a_still_says_of_itself(desk: Desk) -> None:
    desk.until_judged()
    found = desk.editor.status.estimate
    project = ProjectSpec(str(desk.scene), overrides=(("sphere", 1),)).open()  # shadows as the editor keeps them
    still = render_project(project, lambda _: None, n_lights=500, series=BounceSeries(1), estimates_error=True)
    assert found is not None and still.error is not None
    assert 0.5 * still.error.overall < found.overall < 2.0 * still.error.overall and found.indirect is None
    assert desk.editor.status.image_error == found.overall


def test_the_error_is_estimated_for_the_curves_on_screen(desk: Desk) -> None:
    """The curve in hand is edited in the window alone; with what the worker was sent last, this was 10 % off."""
    desk.editor.select("ball.0.theta_h")
    desk.until_judged()
    n = desk.client.sent(ComputeTransport)
    desk.editor.do(AddOperator("ball.0", "theta_h", LIFT))
    desk.until_judged()
    found = desk.editor.status.estimate
    assert desk.client.sent(ComputeTransport) == n and found is not None and found.overall < 0.05


def test_the_error_of_indirect_light_is_estimated_as_it_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(indirect_tasks, "FINE", replace(ROUGH, name=FINE_STAGE))  # quicker, and as good for this
    desk = Desk(tmp_path, 2)
    desk.until_judged()
    whole = desk.editor.status.estimate
    assert whole is not None and whole.indirect is not None and 0.0 < whole.indirect < 0.1
    monkeypatch.setattr(IndirectTasks, "light", None)  # as if the picture had none of it
    desk.editor.do(SetIntensity(0.5))
    desk.until_judged()
    without = desk.editor.status.estimate
    assert without is not None and without.indirect is None


def test_a_picture_in_which_nothing_reflects_is_not_off(desk: Desk) -> None:
    """Nothing was answered: a script that waits for it waited for half an hour, and `precompute` failed."""
    for key, _ in desk.editor.document.layers():
        desk.editor.do(SetVisible(key, False))
    desk.until_finished()
    desk.frames(60)
    found = desk.editor.status.estimate
    assert found is not None and found.is_negligible


def test_an_edit_gives_it_up_and_undo_brings_it_back(desk: Desk) -> None:
    desk.until_finished()
    assert desk.client.sent(EstimateError) == 0  # the hand has just come to rest
    desk.until_judged()
    before = desk.editor.status.estimate
    desk.editor.do(AddOperator("ball.0", "theta_h", LIFT))
    assert desk.editor.status.estimate is None
    desk.until_judged()
    lifted = desk.editor.status.estimate
    assert lifted != before and desk.client.sent(EstimateError) == 2
    desk.editor.undo()
    desk.until_finished()
    assert desk.editor.status.estimate == before and desk.client.sent(EstimateError) == 2  # it is remembered
    desk.editor.redo()
    desk.until_finished()
    assert desk.editor.status.estimate == lifted and desk.client.sent(EstimateError) == 2


def test_what_is_asked_is_dropped_at_the_next_edit(desk: Desk) -> None:
    desk.until_finished()
    desk.editor._client = Held(desk.client)  # what asks, and does not work meanwhile
    desk.frames(8)
    assert desk.client.sent(EstimateError) == 1
    assert desk.client.steps(4) == []  # it has begun
    desk.editor.do(AddOperator("ball.0", "theta_h", LIFT))
    desk.frames(1)
    assert [request.of for request in desk.client.requests if isinstance(request, CancelRequests)] == [(EstimateError,)]
    assert not any(isinstance(answer, ErrorEstimated) for answer in desk.client.steps(200))


def test_few_lights_are_reported(desk: Desk) -> None:
    desk.until_judged()
    usual = desk.editor.status.estimate
    desk.editor.do(SetView.of(n_lights=20))  # as few as a preview has
    desk.frames(1)
    desk.until_judged()
    few = desk.editor.status.estimate
    assert usual is not None and few is not None and few.overall > 1.5 * usual.overall


def test_light_on_the_move_has_the_worker_to_itself(desk: Desk) -> None:
    desk.until_judged()
    n = desk.client.sent(EstimateError)
    desk.editor.begin_drag()
    for turn in range(5):
        desk.editor.do(SetRotation(10.0 * (turn + 1)))
        desk.frames(10)
        assert desk.editor.status.estimate is None
    assert desk.client.sent(EstimateError) == n
    desk.editor.end_drag()
    desk.until_judged()
    assert desk.client.sent(EstimateError) == n + 1


def test_what_the_user_stopped_is_not_requested_again(desk: Desk) -> None:
    desk.until_finished()
    desk.editor._client = Held(desk.client)
    desk.frames(8)
    desk.editor.cancel_work()
    desk.editor._client = desk.client
    desk.frames(50)
    assert desk.editor.status.estimate is None and desk.client.sent(EstimateError) == 1
    desk.editor.resume_work()
    desk.until_judged()


class Held:
    """The same worker, which does nothing by itself."""

    alive, pid, arriving = True, None, False

    def __init__(self, client: WatchedClient) -> None:
        self.send, self.close = client.send, client.close

    def poll(self, budget_s: float = 0.0) -> list[Response]:
        return []
