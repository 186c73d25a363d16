"""What runs when: newer cancels older, quick requests run between steps, errors end one job alone."""

import logging
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.document.light_state import LightState
from app.document.scene_state import SceneState
from app.messages.worker_messages import (
    CancelRequests,
    OpenScene,
    Progress,
    Request,
    RequestFailed,
    Response,
    SetCamera,
)
from app.modes.orbit.orbit_messages import DrawHeadlight, DrawOrbit
from app.modes.placement.placement_messages import ContractTransport, LayerPicture, LayerTransport, StageDone
from app.worker.schedule import InProcessClient, Schedule
from engine.scene.description import Camera
from tests.app.worker.faulty_tasks import FaultyTasks, compute
from tests.opened import run_in_process


def contract(value: float, **numbers: int) -> ContractTransport:
    return ContractTransport(np.full((8, 3), value), "A", **numbers)


def names(responses: list[Response]) -> list[str]:
    return [type(response).__name__ for response in responses]


def test_answers_carry_the_numbers_of_their_request() -> None:
    responses = run_in_process(FaultyTasks(), compute("pictures 2", id=5, revision=17))
    assert names(responses) == ["LayerPicture", "LayerPicture", "StageDone"]
    assert {(response.id, response.revision) for response in responses} == {(5, 17)}


def test_contraction_runs_between_the_steps_of_a_transport() -> None:
    client = InProcessClient(FaultyTasks())
    light = client.send(compute("pictures 3"))
    assert names(client.poll(0)) == ["LayerPicture"]
    wish = client.send(contract(2.0))
    responses = client.poll(10)
    assert [(type(r), r.id) for r in responses] == [
        (LayerTransport, wish),
        (LayerPicture, light),
        (LayerPicture, light),
        (StageDone, light),
    ]


def test_contraction_waits_for_its_scene_and_for_its_transport_to_begin() -> None:
    client = InProcessClient(FaultyTasks())
    for request in (OpenScene("open x"), compute("pictures 2"), contract(2.0)):
        client.send(request)
    assert names(client.poll(10)) == ["SceneOpened", "LayerPicture", "LayerTransport", "LayerPicture", "StageDone"]


class Steps:
    """Takes three steps for anything, and notes them."""

    def __init__(self) -> None:
        self.done: list[str] = []

    def handle(self, request: Request) -> Iterator[Response | None]:
        for _ in range(3):
            self.done.append(type(request).__name__)
            yield None


@pytest.mark.parametrize(
    "drawing",
    [
        DrawOrbit(Camera(position=(0.0, 0.0, 1.0), target=(0.0, 0.0, 0.0)), (4, 3), "moving"),
        DrawHeadlight(Camera(position=(0.0, 0.0, 1.0), target=(0.0, 0.0, 0.0)), (4, 3), SceneState(LightState(), ())),
    ],
    ids=["orbit", "plain"],
)
def test_orbit_draws_while_a_camera_is_traced_and_nothing_else_is_done(drawing: Request) -> None:
    # A hand that moves on meets a look that began when it rested.
    handler = Steps()
    schedule = Schedule(handler)
    schedule.accept(SetCamera(1))
    schedule.step()
    schedule.accept(contract(2.0))
    schedule.accept(drawing)
    while schedule.choose() is not None:
        schedule.step()
    assert handler.done == ["SetCamera", *3 * [type(drawing).__name__], *2 * ["SetCamera"], *3 * ["ContractTransport"]]


def test_contraction_is_served_when_nothing_else_runs() -> None:
    (response,) = run_in_process(FaultyTasks(), contract(2.0))
    assert isinstance(response, LayerTransport)
    assert response.scale == 48.0  # 8 × 3 coefficients of 2


def test_newer_transport_cancels_the_older_and_closes_it(tmp_path: Path) -> None:
    client = InProcessClient(FaultyTasks())
    client.send(compute(f"forever {tmp_path / 'note'}"))
    client.poll(0)
    newer = client.send(compute("pictures 1"))
    assert (tmp_path / "note").read_text() == "closed"
    assert {response.id for response in client.poll(10)} == {newer}


def test_only_the_newest_of_waiting_requests_runs() -> None:
    client = InProcessClient(FaultyTasks())
    client.send(OpenScene("open a"))
    for n in (1, 2, 3):
        client.send(compute(f"pictures {n}"))
    assert names(client.poll(10)) == ["SceneOpened"] + ["LayerPicture"] * 3 + ["StageDone"]


def test_cancel_stops_what_runs_and_what_waits(tmp_path: Path) -> None:
    client = InProcessClient(FaultyTasks())
    client.send(compute(f"forever {tmp_path / 'note'}"))
    client.poll(0)
    client.send(contract(1.0))
    client.send(CancelRequests())
    assert (tmp_path / "note").exists()
    assert client.poll(10) == []


def test_new_scene_cancels_everything(tmp_path: Path) -> None:
    client = InProcessClient(FaultyTasks())
    client.send(compute(f"forever {tmp_path / 'note'}"))
    client.poll(0)
    client.send(contract(1.0))
    client.send(OpenScene("open b"))
    assert names(client.poll(10)) == ["SceneOpened"]


def test_error_meant_for_the_user_is_handed_on_verbatim() -> None:
    (response,) = run_in_process(FaultyTasks(), OpenScene("load_error", id=4))
    expected = "a.ply: vertex 3 = nan, expected finite numbers; nothing was changed"
    assert response == RequestFailed(expected, id=4)


def test_other_errors_become_one_line_and_a_traceback_in_the_log(caplog: pytest.LogCaptureFixture) -> None:
    responses = run_in_process(FaultyTasks(), OpenScene("bug", id=4))
    assert responses[-1] == RequestFailed("the computation failed: a bug in Insitu. Undo the last edit to go on", id=4)
    (record,) = caplog.records
    assert record.levelno == logging.ERROR
    assert record.exc_info is not None


def test_verb_that_does_not_exist_fails_its_request_alone(caplog: pytest.LogCaptureFixture) -> None:
    client = InProcessClient(FaultyTasks())
    client.send(OpenScene("no_such_verb"))
    assert names(client.poll(10)) == ["RequestFailed"]
    client.send(OpenScene("open a"))
    assert names(client.poll(10)) == ["SceneOpened"]


def test_scene_that_fails_takes_along_what_was_asked_of_it() -> None:
    client = InProcessClient(FaultyTasks())
    for request in (OpenScene("load_error"), compute("pictures 2"), contract(1.0)):
        client.send(request)
    assert names(client.poll(10)) == ["RequestFailed"]


def test_failed_contraction_leaves_the_transport_running(caplog: pytest.LogCaptureFixture) -> None:
    client = InProcessClient(FaultyTasks())
    client.send(compute("pictures 2"))
    client.poll(0)
    client.send(ContractTransport(None, "A"))  # type: ignore[arg-type]
    assert names(client.poll(10)) == ["RequestFailed", "LayerPicture", "StageDone"]


def test_poll_returns_after_its_budget() -> None:
    client = InProcessClient(FaultyTasks())
    client.send(compute("forever"))
    responses = client.poll(0.02)
    assert 1 <= len(responses) <= 20  # a step takes 2 ms
    assert all(isinstance(response, Progress) for response in responses)
    assert client.wait(0)
    client.close()


def test_nothing_to_do() -> None:
    schedule = Schedule(FaultyTasks())
    assert schedule.choose() is None
    assert schedule.step() is None
