"""When the worker is asked for rays that an edit needs, and what is said of them."""

from __future__ import annotations

import numpy as np
import pytest

from app.document.described import document_from_description
from app.document.document import Document
from app.messages.editor_status import Status
from app.messages.worker_messages import CancelRequests, Request, with_numbers
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import EditedSampled, SampleEdited, SamplingProgress
from app.modes.placement.placement_status import PlacementStatus
from app.modes.placement.sampling_controller import IDLE_SECONDS, STAGE, SamplingController
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE

DOCUMENT, OTHER = (
    document_from_description("scene.toml", parse_description(SCENE, "scene.toml")) for _ in range(2)
)  # fmt: skip
SAMPLED = EditedSampled(n_points=100, n_sets=250, n_added=50, n_noisy=2, noise_before=0.2, noise=0.1)


@pytest.fixture
def sent() -> list[Request]:
    return []


@pytest.fixture
def controller(sent: list[Request]) -> SamplingController:
    def send(request: Request) -> int:
        sent.append(request)
        return len(sent)

    return SamplingController(send, Curves())


def rest(
    controller: SamplingController, begin: float = 0.0, document: Document = DOCUMENT, lacks_rays: bool = True
) -> None:
    """Let a picture rest until rays may be asked for."""
    for now in (begin, begin + IDLE_SECONDS):
        controller.update(now, document, 1, True, lacks_rays)


def kinds(sent: list[Request]) -> list[type]:
    return [type(request) for request in sent]


def test_rays_are_asked_for_once_where_they_are_lacking(controller: SamplingController, sent: list[Request]) -> None:
    rest(controller, lacks_rays=False)
    controller.update(9.0, DOCUMENT, 1, False, True)  # a drag: later
    assert not sent
    rest(controller, 10.0)
    rest(controller, 20.0)
    assert kinds(sent) == [SampleEdited] and sent[0].revision == 1
    controller.receive(with_numbers(SAMPLED, 1, 1))
    rest(controller, 30.0)
    assert len(sent) == 1


@pytest.mark.parametrize("changed", [(OTHER, 1), (DOCUMENT, 2)])
def test_another_picture_gives_up_what_is_under_way(
    controller: SamplingController, sent: list[Request], changed: tuple[Document, int]
) -> None:
    rest(controller)
    controller.update(5.0, *changed, False, False)
    assert isinstance(sent[-1], CancelRequests) and sent[-1].of == (SampleEdited,)
    for now in (6.0, 6.0 + IDLE_SECONDS):
        controller.update(now, *changed, True, True)
    assert kinds(sent) == [SampleEdited, CancelRequests, SampleEdited]


def test_what_failed_or_was_stopped_is_not_asked_for_again(controller: SamplingController, sent: list[Request]) -> None:
    rest(controller)
    controller.receive_failure(1)
    rest(controller, 10.0)
    assert len(sent) == 1
    rest(controller, 20.0, OTHER)
    controller.interrupted()
    rest(controller, 30.0, OTHER)
    assert kinds(sent) == [SampleEdited] * 2


def test_the_status_says_how_far_it_is_and_then_what_came_of_it(controller: SamplingController) -> None:
    idle, busy = Status(), Status(stage="transport")
    assert controller.status(idle) == {}
    rest(controller)
    assert controller.status(idle) == {}  # the worker has other work before
    controller.receive_progress(SamplingProgress(0.4))
    assert {"stage": STAGE, "fraction": 0.4}.items() <= controller.status(idle).items()
    assert "stage" not in controller.status(busy)
    controller.receive(with_numbers(SAMPLED, 1, 1))
    said = controller.status(idle)
    assert "stage" not in said and said["sample_sets"] == 2.5
    status = PlacementStatus(**said)  # type: ignore[arg-type]
    for words in ("50 ", "100 points", "from 20.0 % to 10.0 %", "2.0 % of points"):
        assert words in status.sampling_reason
    controller.light_improved(7)
    controller.light_found(7)
    assert controller.status(idle) == said
    controller.light_found(8)  # as another light has it
    assert controller.status(idle) == {}


@pytest.mark.parametrize("seed", range(20))
def test_any_sequence_has_at_most_one_under_way_and_never_for_another_picture(seed: int) -> None:
    random, sent, under_way = np.random.default_rng(seed), list[Request](), list[int]()

    def send(request: Request) -> int:
        sent.append(request)
        under_way.clear()  # a newer one replaces it, and a cancel ends it
        if isinstance(request, SampleEdited):
            under_way.append(len(sent))
        return len(sent)

    controller, picture, now, rests, lacks_rays = SamplingController(send, Curves()), (DOCUMENT, 1), 0.0, True, True
    asked_for = picture
    for _ in range(400):
        now += float(random.choice([0.02, IDLE_SECONDS]))
        match random.integers(0, 9):
            case 0:
                picture = (OTHER if picture[0] is DOCUMENT else DOCUMENT, picture[1])  # an edit, or undo
            case 1:
                picture = (picture[0], picture[1] + 1)  # the light turned
            case 2:
                rests = not rests
            case 3:
                lacks_rays = not lacks_rays
            case 4 if under_way:
                controller.receive(with_numbers(SAMPLED, under_way.pop(), 1))
                lacks_rays = False
            case 5 if under_way:
                controller.receive_failure(under_way.pop())
            case 6:
                controller.interrupted()
                under_way.clear()
            case 7:
                controller.forget()
                under_way.clear()
            case 8:
                controller.lose_request()
                under_way.clear()
        n_before = len(sent)
        controller.update(now, *picture, rests, lacks_rays)
        if len(sent) > n_before and isinstance(sent[-1], SampleEdited):
            assert rests and lacks_rays and sent[-1].revision == picture[1]
            asked_for = picture
        assert not under_way or asked_for == picture
    assert any(isinstance(request, SampleEdited) for request in sent)
