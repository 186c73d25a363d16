"""Side A of the A/B picture: what is asked of the worker for it, and what the renderer is told."""

import numpy as np
import pytest

from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetParameter, SetVisible
from app.document.commands.light import SetEnvironment, SetRotation
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import RequestFailed
from app.modes.placement.indirect_picture import IndirectPicture
from app.modes.placement.placement_events import ComparisonRefined
from app.modes.placement.placement_messages import ContractTransport, LayerPicture
from app.modes.placement.placement_status import RenderReport
from engine.curve.operators import Operator
from tests.app.fake_worker import FakeClient

EXACT = RenderReport(128, 128, 0.0, True)
LIFT = AddOperator("floor.0", "theta_i", Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0))


@pytest.fixture
def early(client: FakeClient) -> Editor:
    """An editor at time 0.1: its coarse stage has come, and A was remembered then."""
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    client.finish_stage("coarse", exact=False)
    editor.tick(0.05)
    remember(editor, 0.1)
    return editor


def remember(editor: Editor, now: float) -> list[ComparisonRefined]:
    editor.do(SetView.of(compare=editor.document))
    return refined(editor, now)


def refined(editor: Editor, now: float) -> list[ComparisonRefined]:
    """What a tick tells of A."""
    return [event for event in editor.tick(now) if isinstance(event, ComparisonRefined)]


def finish(editor: Editor, client: FakeClient, now: float) -> list[ComparisonRefined]:
    """The final stage comes and the renderer shows all of it; what is told of A in the tick after."""
    client.finish_stage("final", exact=True)
    editor.tick(now)
    editor.controller.rendered(EXACT)
    return refined(editor, now + 0.01)


def asked_for_a(client: FakeClient) -> list[ContractTransport]:
    return [request for request in client.sent(ContractTransport) if request.factor is None]


def test_an_exact_picture_needs_nothing(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    finish(editor, client, 1.0)
    assert remember(editor, 1.1) == []
    assert editor.status.compared_exact
    editor.do(LIFT)
    editor.tick(1.2)
    assert editor.status.compared_exact


def test_a_follows_b_as_long_as_they_are_alike(early: Editor, client: FakeClient) -> None:
    assert not early.status.compared_exact
    assert refined(early, 0.2) == []  # nothing has come since
    client.finish_stage("preview", exact=False)
    (event,) = refined(early, 0.3)
    assert event.appearances == {} and not early.status.compared_exact
    (event,) = finish(early, client, 1.0)
    assert event.appearances == {} and early.status.compared_exact
    assert refined(early, 1.1) == []
    assert asked_for_a(client) == []


def test_with_indirect_light_an_a_of_other_curves_stays_as_it_is(
    early: Editor, client: FakeClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    early.do(LIFT)
    with monkeypatch.context() as patched:
        patched.setattr(IndirectPicture, "is_shown", True)
        assert finish_edited(early, client) == []
        assert asked_for_a(client) == [] and not early.status.compared_exact
    refined(early, 1.3)
    assert len(asked_for_a(client)) == 1


def test_layers_edited_meanwhile_are_asked_for(early: Editor, client: FakeClient) -> None:
    before = early.document
    early.do(LIFT)
    early.do(SetParameter("floor.0", "albedo", 0.9))
    early.do(SetVisible("pot.0", False))
    early.do(SetVisible("pot.1", False))
    edited = early.document
    assert finish_edited(early, client) == []
    (request,) = asked_for_a(client)
    assert request.layer.key == "floor.0"
    assert request.layer.layer == before.layer("floor.0")
    assert early.status.picture == "exact"  # asking for A takes nothing from B
    answer_for_a(client, 7.0)
    (event,) = refined(early, 1.3)
    assert early.status.compared_exact and early.status.picture == "exact"
    assert early.document is edited
    look = event.appearances["floor.0"]
    assert look.radiance is not None and look.radiance[0, 0] == 7.0
    # Gain and visibility are A's; a layer whose curves are on screen needs no radiance.
    np.testing.assert_array_equal(look.gain, before.layer("floor.0").scale())
    assert event.appearances["pot.1"].visible and event.appearances["pot.1"].radiance is None
    assert refined(early, 1.4) == []


def finish_edited(editor: Editor, client: FakeClient) -> list[ComparisonRefined]:
    """The final stage comes, then the edited layer's picture for B."""
    told = finish(editor, client, 1.0)
    client.contract("final")
    client.requests.clear()  # B's own request for that layer
    editor.tick(1.1)
    editor.controller.rendered(EXACT)
    return told + refined(editor, 1.2)


def answer_for_a(client: FakeClient, value: float) -> None:
    request = asked_for_a(client)[-1]
    layer = request.layer
    client.answer(request, LayerPicture(layer.key, "final", np.full((4, 3), value), layer.coefficients))


def test_another_light_waits_for_the_old_one_to_come_back(early: Editor, client: FakeClient) -> None:
    before = early.document
    early.do(SetEnvironment("studio"))
    early.tick(0.2)
    early.tick(0.6)
    assert finish(early, client, 1.0) == []
    assert not early.status.compared_exact and asked_for_a(client) == []
    early.undo()
    early.tick(2.0)
    early.tick(2.5)
    (event,) = finish(early, client, 3.0)
    assert event.appearances == {} and early.status.compared_exact
    assert early.document == before


def test_a_light_on_the_move_is_not_taken_for_a(early: Editor, client: FakeClient) -> None:
    # The sky behind the scene turns at once, before any transport does.
    early.begin_drag()
    early.do(SetRotation(77.0))
    client.finish_stage("preview", exact=False)
    assert refined(early, 0.3) == []


def test_a_that_cannot_be_drawn_stays_as_it_is(early: Editor, client: FakeClient) -> None:
    early.do(LIFT)
    finish_edited(early, client)
    request = asked_for_a(client)[-1]
    client.answer(request, RequestFailed("out of memory"))
    early.tick(1.3)
    for now in (2.0, 10.0, 20.0):
        assert refined(early, now) == []
    assert asked_for_a(client) == [request]
    assert not early.status.compared_exact


def test_a_request_that_got_lost_is_made_again(early: Editor, client: FakeClient) -> None:
    early.do(LIFT)
    finish_edited(early, client)
    assert len(asked_for_a(client)) == 1
    early.tick(2.0)
    assert len(asked_for_a(client)) == 1
    early.tick(6.0)
    assert len(asked_for_a(client)) == 2


def test_nothing_is_asked_after_the_comparison_ended(early: Editor, client: FakeClient) -> None:
    early.do(LIFT)
    early.do(SetView.of(compare=None))
    assert finish_edited(early, client) == []
    assert early.status.compared_exact
