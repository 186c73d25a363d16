"""Which requests stand: their answers count, and a new worker is given them again."""

import numpy as np

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
from app.modes.placement.placement_messages import ContractTransport
from app.worker.client import PendingRequests
from engine.measured.measurement import NO_MEASUREMENT
from tests.app.worker.faulty_tasks import compute


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
