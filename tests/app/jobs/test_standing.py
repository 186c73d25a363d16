"""Which requests stand: their answers count, and a new worker is given them again."""

import numpy as np

from app.jobs.messages import Cancel, Failed, HandOutTable, OpenScene, Progress, SceneOpened, TableHandedOut
from app.jobs.standing import Standing
from app.placement.messages import Contract
from engine.measured.measurement import NOTHING
from tests.app.jobs.faulty_tasks import compute


def contract(id: int) -> Contract:
    return Contract("ball.0", "A", (), id=id)


def ids(standing: Standing) -> list[int]:
    return [request.id for request in standing.requests()]


def standing_at(*requests: object) -> Standing:
    standing = Standing()
    for request in requests:
        standing.add(request)  # type: ignore[arg-type]
    return standing


SCENE, LIGHT = OpenScene("open", id=1), compute("pictures 1", id=2)


def test_newest_of_each_kind_stands_in_the_order_a_worker_needs() -> None:
    assert ids(standing_at(SCENE, LIGHT, contract(3))) == [1, 2, 3]


def test_newer_request_replaces_its_kind_and_what_was_built_on_it() -> None:
    assert ids(standing_at(SCENE, LIGHT, contract(3), contract(4))) == [1, 2, 4]
    assert ids(standing_at(SCENE, LIGHT, contract(3), compute("", id=4))) == [1, 4]
    assert ids(standing_at(SCENE, LIGHT, contract(3), OpenScene("open", id=4))) == [4]


def test_answers_to_what_stands_are_current_and_others_stale() -> None:
    standing = standing_at(SCENE, LIGHT, compute("", id=3))
    assert not standing.is_current(Progress("a", 0.5, id=2))
    assert standing.is_current(Progress("a", 0.5, id=3))
    assert standing.is_current(Progress("a", 0.5, id=1))


def test_cancel_leaves_an_opened_scene() -> None:
    standing = standing_at(SCENE, LIGHT)
    standing.settle(SceneOpened("{}", id=1))
    standing.add(Cancel())
    assert ids(standing) == [1]


def test_cancel_gives_up_a_scene_that_is_not_open_yet() -> None:
    assert ids(standing_at(SCENE, LIGHT, Cancel())) == []


def test_scene_that_fails_leaves_the_one_before() -> None:
    standing = standing_at(SCENE)
    standing.settle(SceneOpened("{}", id=1))
    standing.add(OpenScene("no such file", id=5))
    standing.add(compute("", id=6))
    standing.settle(Failed("no such file", id=5))
    assert ids(standing) == [1]  # the transport was asked of the scene that failed


def test_failed_request_stands_no_longer() -> None:
    standing = standing_at(SCENE, LIGHT, contract(3))
    standing.settle(Failed("", id=3))
    assert ids(standing) == [1, 2]
    standing.settle(Failed("", id=2))
    assert ids(standing) == [1]


def test_a_table_is_wanted_whatever_scene_is_open() -> None:
    # A new worker is asked again, until it has come.
    standing = standing_at(SCENE, HandOutTable("x.binary", id=2), compute("pictures 1", id=3))
    standing.add(Cancel(id=4))
    standing.add(OpenScene("other", id=5))
    assert ids(standing) == [5, 2]
    standing.settle(TableHandedOut(NOTHING, np.zeros(0, np.float32), id=2))
    assert ids(standing) == [5]


def test_opened_scene_that_is_given_up_does_not_come_back() -> None:
    standing = standing_at(SCENE)
    standing.settle(SceneOpened("{}", id=1))
    standing.drop(1)
    assert ids(standing) == []


def sent(standing: Standing) -> list[int]:
    return [request.id for request in standing.to_send()]


def test_each_worker_is_sent_each_request_once() -> None:
    standing = standing_at(SCENE)
    assert sent(standing) == [1] and sent(standing) == []
    standing.add(LIGHT)
    assert sent(standing) == [2]
    standing.new_worker()
    assert sent(standing) == [1, 2]


def test_a_scene_that_stands_again_is_sent_to_a_worker_that_gave_it_up() -> None:
    # A new worker is opening the scene when another is asked for, which it cannot open; or when the work is cancelled.
    for end in (Failed("no such file", id=3), Cancel(id=3)):
        standing = standing_at(SCENE)
        standing.heard(SceneOpened("", id=1))
        standing.settle(SceneOpened("", id=1))
        standing.new_worker()
        assert sent(standing) == [1]
        if isinstance(end, Failed):
            standing.add(OpenScene("nowhere", id=3))
            assert sent(standing) == [3]
            standing.settle(end)
        else:
            standing.add(end)
        assert sent(standing) == [1]


def test_a_scene_that_the_worker_has_open_is_not_sent_again() -> None:
    standing = standing_at(SCENE)
    sent(standing)
    standing.heard(SceneOpened("", id=1))
    standing.settle(SceneOpened("", id=1))
    standing.add(OpenScene("nowhere", id=3))
    sent(standing)
    standing.settle(Failed("no such file", id=3))
    assert sent(standing) == []
