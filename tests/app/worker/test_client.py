"""The worker process and its client: requests, answers, and errors in a job."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from app.messages.worker_messages import (
    CancelRequests,
    FetchTable,
    OpenScene,
    Progress,
    RequestFailed,
    SceneOpened,
    SetCamera,
    TableFetched,
    ViewTraced,
)
from app.modes.placement.placement_messages import ContractTransport, LayerPicture, LayerTransport, StageDone
from app.worker.client import Client, PendingRequests
from app.worker.shared_arrays import Method
from engine.measured.measurement import NO_MEASUREMENT
from tests.app.worker.answers import collect, of, open_scene, seen, wait_until_idle
from tests.app.worker.faulty_tasks import HANDLERS, compute, picture

pytestmark = pytest.mark.usefixtures("state_folder")


# -------------------------------------------------------------------------------------------------- the happy path


@pytest.mark.parametrize("method", ["memfd", "named", "kept"])
def test_answers_arrive_with_their_arrays(method: Method) -> None:
    with Client(HANDLERS, method=method) as client:
        scene = client.send(OpenScene("open scene", revision=3))
        client.send(SetCamera(scene))
        numbers = [scene, client.send(compute("pictures 20", revision=4))]
        answers = collect(client, seen(StageDone))
    opened, looked = answers[:2]
    assert isinstance(opened, SceneOpened) and isinstance(looked, ViewTraced)
    assert (opened.id, opened.revision, opened.description) == (numbers[0], 3, "scene")
    np.testing.assert_array_equal(looked.frame["pixel"], np.arange(10_000))
    for index, answer in enumerate(answers[2:-1]):
        assert isinstance(answer, LayerPicture)
        assert (answer.id, answer.revision) == (numbers[1], 4)
        np.testing.assert_array_equal(answer.radiance, picture(index))
        assert not answer.radiance.flags.writeable


def test_arrays_travel_to_the_worker_too(client: Client) -> None:
    coefficients = np.random.default_rng(1).random((512, 3))
    client.send(ContractTransport(coefficients, "A"))
    (answer,) = collect(client, seen(LayerTransport))
    assert isinstance(answer, LayerTransport)
    np.testing.assert_array_equal(answer.coefficients_first, coefficients)
    assert answer.scale == coefficients.sum()  # the worker could read them


def test_contraction_is_served_while_a_transport_runs(client: Client) -> None:
    client.send(compute("forever"))
    collect(client, seen(Progress))
    wish = client.send(ContractTransport(np.ones((4, 3)), "A"))
    answers = collect(client, seen(LayerTransport))
    assert of(LayerTransport, answers)[0].id == wish


def test_answers_to_an_older_request_are_dropped(client: Client) -> None:
    client.send(compute("forever"))
    collect(client, seen(Progress))
    time.sleep(0.05)  # answers of the first are on the way
    newer = client.send(compute("pictures 3"))
    assert {answer.id for answer in collect(client, seen(StageDone))} == {newer}


def test_cancel_stops_the_worker_and_its_answers(client: Client, tmp_path: Path) -> None:
    client.send(compute(f"forever {tmp_path / 'note'}"))
    collect(client, seen(Progress))
    client.send(CancelRequests())
    assert client.poll() == []
    wait_until_idle(client)
    assert (tmp_path / "note").read_text() == "closed"


def test_worker_prints_nothing() -> None:
    program = (
        "from app.worker.client import Client; from tests.app.worker.faulty_tasks import HANDLERS\n"
        "with Client(HANDLERS) as c:\n  while c.busy: c.wait(1); c.poll()\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, timeout=90)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")


def test_constructing_sending_and_polling_do_not_wait() -> None:
    with Client(HANDLERS) as client:
        client.send(OpenScene("sleep 60"))
        for _ in range(10):
            assert client.poll() == []  # and no answer that was waited for


def test_poll_keeps_to_its_budget_under_a_flood(client: Client) -> None:
    client.send(compute("flood"))
    collect(client, seen(Progress))
    durations = []
    for _ in range(50):
        start = time.monotonic()
        client.poll(0.002)
        durations.append(time.monotonic() - start)
    assert np.median(durations) < 0.01


def test_window_that_does_not_poll_holds_the_worker_back_and_loses_nothing(client: Client) -> None:
    client.send(compute("pictures 600"))
    collect(client, seen(LayerPicture, 1))
    time.sleep(0.3)
    answers = collect(client, seen(StageDone))
    indices = [answer.radiance[0, 0] for answer in of(LayerPicture, answers) if isinstance(answer, LayerPicture)]
    assert indices == sorted(indices)
    assert indices[-1] == 599
    assert len(indices) >= 500  # all but those collected before the pause


def test_close_ends_the_worker_even_within_a_long_step() -> None:
    client = Client(HANDLERS)
    client.send(compute("sleep 3600"))
    collect(client, seen(Progress))
    pid = client.pid
    client.close()  # which would take an hour if it waited for the step
    assert pid is not None
    with pytest.raises(ProcessLookupError):
        os.kill(pid, 0)
    assert client.poll() == []
    with pytest.raises(ValueError, match="closed"):
        client.send(CancelRequests())


# ------------------------------------------------------------------------------------------------- errors in a job


def test_errors_leave_the_worker_alive(client: Client, state_folder: Path) -> None:
    pid = client.pid
    client.send(OpenScene("load_error"))
    (failed,) = collect(client, seen(RequestFailed))
    assert isinstance(failed, RequestFailed)
    assert failed.line == "a.ply: vertex 3 = nan, expected finite numbers; nothing was changed"
    client.send(OpenScene("bug"))
    failed = collect(client, seen(RequestFailed))[-1]
    assert isinstance(failed, RequestFailed)
    log = state_folder / "log" / "worker.log"
    assert failed.line.endswith(f"Undo the last edit to go on (for a report: {log})")
    assert 'raise ValueError("two\\nlines")' in log.read_text()
    open_scene(client)
    assert client.pid == pid


def test_worker_out_of_memory_says_so_and_goes_on(client: Client) -> None:
    """Address space limited to 2 GiB, 4 GiB wanted."""
    pid = client.pid
    client.send(compute("out_of_memory"))
    failed = collect(client, seen(RequestFailed))[-1]
    assert isinstance(failed, RequestFailed)
    assert failed.line.startswith("out of memory; lower the resolution")
    open_scene(client)
    assert client.pid == pid


def test_result_without_room_for_it_fails_its_request(client: Client) -> None:
    pid = client.pid
    client.send(compute("no_room"))
    failed = collect(client, seen(RequestFailed))[-1]
    assert isinstance(failed, RequestFailed)
    assert failed.line.startswith("no memory for 1 MiB of results: File too large")
    open_scene(client)
    assert client.pid == pid


def contract(id: int) -> ContractTransport:
    return ContractTransport(None, "A", id=id)


def ids(standing: PendingRequests) -> list[int]:
    return [request.id for request in standing.requests()]


def standing_at(*requests: object) -> PendingRequests:
    standing = PendingRequests()
    for request in requests:
        standing.add(request)  # type: ignore[arg-type]
    return standing


SCENE, LOOK, LIGHT = OpenScene("open", id=1), SetCamera(1, id=2), compute("pictures 1", id=3)


def look_of(standing: PendingRequests) -> None:
    """The scene and the look at it are answered."""
    for answer in (SceneOpened("{}", id=1), ViewTraced(None, id=2)):  # type: ignore[arg-type]
        standing.note_response(answer)
        standing.settle(answer)


def test_newest_of_each_kind_stands_in_the_order_a_worker_needs() -> None:
    assert ids(standing_at(SCENE, LOOK, LIGHT, contract(4))) == [1, 2, 3, 4]


def test_newer_request_replaces_its_kind_and_what_was_built_on_it() -> None:
    assert ids(standing_at(SCENE, LOOK, LIGHT, contract(4), contract(5))) == [1, 2, 3, 5]
    assert ids(standing_at(SCENE, LOOK, LIGHT, contract(4), compute("", id=5))) == [1, 2, 5]
    assert ids(standing_at(SCENE, LOOK, LIGHT, contract(4), SetCamera(1, id=5))) == [1, 5]
    assert ids(standing_at(SCENE, LOOK, LIGHT, contract(4), OpenScene("open", id=5))) == [5]


def test_answers_to_what_stands_are_current_and_others_stale() -> None:
    standing = standing_at(SCENE, LIGHT, compute("", id=4))
    assert not standing.is_current(Progress("a", 0.5, id=3))
    assert standing.is_current(Progress("a", 0.5, id=4))
    assert standing.is_current(Progress("a", 0.5, id=1))


def test_cancel_leaves_an_opened_scene() -> None:
    standing = standing_at(SCENE, LOOK, LIGHT)
    look_of(standing)
    standing.add(CancelRequests())
    assert ids(standing) == [1, 2]


def test_cancel_gives_up_a_scene_that_is_not_open_yet() -> None:
    assert ids(standing_at(SCENE, LOOK, LIGHT, CancelRequests())) == []


def test_scene_that_fails_leaves_the_one_before() -> None:
    standing = standing_at(SCENE, LOOK)
    look_of(standing)
    standing.add(OpenScene("no such file", id=5))
    standing.add(SetCamera(5, id=6))
    standing.add(compute("", id=7))
    standing.settle(RequestFailed("no such file", id=5))
    assert ids(standing) == [1, 2]  # the look and the transport were asked of the scene that failed


def test_look_that_fails_leaves_the_one_before() -> None:
    standing = standing_at(SCENE, LOOK)
    look_of(standing)
    for scene in ((), (OpenScene("other", id=5),)):
        for request in (*scene, SetCamera(5 if scene else 1, id=6)):
            standing.add(request)
        standing.settle(RequestFailed("no memory for it", id=6))
        assert ids(standing) == [1, 2]


def test_failed_request_stands_no_longer() -> None:
    standing = standing_at(SCENE, LOOK)
    look_of(standing)
    for request in (LIGHT, contract(4)):
        standing.add(request)
    standing.settle(RequestFailed("", id=4))
    assert ids(standing) == [1, 2, 3]
    standing.settle(RequestFailed("", id=3))
    assert ids(standing) == [1, 2]


def test_a_table_is_wanted_whatever_scene_is_open() -> None:
    # A new worker is asked again, until it has come.
    standing = standing_at(SCENE, FetchTable("x.binary", id=2), compute("pictures 1", id=3))
    standing.add(CancelRequests(id=4))
    standing.add(OpenScene("other", id=5))
    assert ids(standing) == [5, 2]
    standing.settle(TableFetched(NO_MEASUREMENT, np.zeros(0, np.float32), id=2))
    assert ids(standing) == [5]


def test_opened_scene_that_is_given_up_does_not_come_back() -> None:
    standing = standing_at(SCENE, LOOK)
    look_of(standing)
    standing.drop(1)
    assert ids(standing) == []


def sent(standing: PendingRequests) -> list[int]:
    return [request.id for request in standing.unsent()]


def test_each_worker_is_sent_each_request_once() -> None:
    standing = standing_at(SCENE)
    assert sent(standing) == [1] and sent(standing) == []
    standing.add(LIGHT)
    assert sent(standing) == [3]
    standing.worker_restarted()
    assert sent(standing) == [1, 3]


def test_a_scene_that_stands_again_is_sent_to_a_worker_that_gave_it_up() -> None:
    # A new worker is opening the scene when another is asked for, which it cannot open; or when the work is cancelled.
    for end in (RequestFailed("no such file", id=4), CancelRequests(id=4)):
        standing = standing_at(SCENE, LOOK)
        look_of(standing)
        standing.worker_restarted()
        assert sent(standing) == [1, 2]
        if isinstance(end, RequestFailed):
            standing.add(OpenScene("nowhere", id=4))
            assert sent(standing) == [4]
            standing.settle(end)
        else:
            standing.add(end)
        assert sent(standing) == [1, 2]


def test_a_scene_that_the_worker_sees_is_not_sent_again() -> None:
    standing = standing_at(SCENE, LOOK)
    sent(standing)
    look_of(standing)
    standing.add(OpenScene("nowhere", id=3))
    sent(standing)
    standing.settle(RequestFailed("no such file", id=3))
    assert sent(standing) == []
