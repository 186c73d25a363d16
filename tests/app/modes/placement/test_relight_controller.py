"""When the worker is asked to make a scene ready for another sky."""

from __future__ import annotations

import pytest

from app.document.commands.layers import SetParameter
from app.document.commands.mix import SetMix
from app.document.described import document_from_description
from app.messages.worker_messages import CancelRequests, Request
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import LightsReady, PrepareRelighting, RelightingPrepared
from app.modes.placement.relight_controller import IDLE_SECONDS, RelightController
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE

DOCUMENT = document_from_description("scene.toml", parse_description(SCENE, "scene.toml"))
OTHER = document_from_description("scene.toml", parse_description(SCENE, "scene.toml"))


@pytest.fixture
def sent() -> list[Request]:
    return []


@pytest.fixture
def controller(sent: list[Request]) -> RelightController:
    def send(request: Request) -> int:
        sent.append(request)
        return len(sent)

    return RelightController(send, Curves())


def rest(controller: RelightController, begin: float = 0.0) -> None:
    """Let a picture rest until the scene is asked for."""
    for now in (begin, begin + IDLE_SECONDS):
        controller.update(now, DOCUMENT, 1, True)


def test_it_is_asked_once_when_the_picture_rests(controller: RelightController, sent: list[Request]) -> None:
    controller.update(0.0, DOCUMENT, 1, False)
    controller.update(9.0, DOCUMENT, 1, True)
    assert not sent
    rest(controller, 9.0)
    rest(controller, 20.0)
    assert [type(request) for request in sent] == [PrepareRelighting] and sent[0].revision == 1
    controller.receive(RelightingPrepared(0, id=1))
    rest(controller, 30.0)
    assert len(sent) == 1


@pytest.mark.parametrize("changed", [(OTHER, 1), (DOCUMENT, 2)])
def test_another_picture_gives_up_what_is_under_way(
    controller: RelightController, sent: list[Request], changed
) -> None:
    rest(controller)
    controller.update(5.0, *changed, False)
    assert isinstance(sent[-1], CancelRequests) and sent[-1].of == (PrepareRelighting,)
    for now in (6.0, 6.0 + IDLE_SECONDS):
        controller.update(now, *changed, True)
    assert [type(request) for request in sent] == [PrepareRelighting, CancelRequests, PrepareRelighting]


def test_what_came_is_not_given_up(controller: RelightController, sent: list[Request]) -> None:
    rest(controller)
    controller.receive(RelightingPrepared(0, id=1))
    controller.update(5.0, OTHER, 1, False)
    assert len(sent) == 1


def test_lights_can_be_mixed_until_a_material_changes(controller: RelightController, sent: list[Request]) -> None:
    rest(controller)
    assert not controller.mixes(DOCUMENT)
    controller.receive(RelightingPrepared(0, 2, id=1))
    assert controller.mixes(DOCUMENT) and controller.mixes(SetMix("lamp", "strength", 1.0).apply(DOCUMENT))
    assert not controller.mixes(SetParameter("pot.0", "albedo", 0.2).apply(DOCUMENT))
    controller.forget()
    assert not controller.mixes(DOCUMENT)


def test_lights_can_be_mixed_before_the_rest_is_prepared(controller: RelightController, sent: list[Request]) -> None:
    rest(controller)
    controller.receive(LightsReady(0, 2, id=7))  # of an older request
    assert not controller.mixes(DOCUMENT)
    controller.receive(LightsReady(0, 2, id=1))
    assert controller.mixes(DOCUMENT) and not controller.is_ready
    # A drag gives up the rest; once the picture rests again it is asked for, though the document is the same.
    controller.update(5.0, OTHER, 1, False)
    assert isinstance(sent[-1], CancelRequests) and controller.mixes(OTHER)
    rest(controller, 6.0)
    assert [type(request) for request in sent] == [PrepareRelighting, CancelRequests, PrepareRelighting]


def test_what_failed_is_not_asked_for_again(controller: RelightController, sent: list[Request]) -> None:
    rest(controller)
    controller.receive_failure(1)
    rest(controller, 10.0)
    assert len(sent) == 1


def test_a_new_worker_is_asked_anew(controller: RelightController, sent: list[Request]) -> None:
    rest(controller)
    controller.forget()
    rest(controller, 10.0)
    assert [type(request) for request in sent] == [PrepareRelighting] * 2
