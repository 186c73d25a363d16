"""What the window asks for of indirect light, and when."""

from dataclasses import replace

import numpy as np
import pytest

from app.document.commands.layers import SetFresnelTerm, SetFrozen
from app.document.commands.plan import SetFirstBands
from app.document.document import Selection
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.editor_status import Status
from app.messages.worker_messages import RequestFailed, SetCamera
from app.modes.placement.indirect_controller import FREEZE_PATIENCE, IDLE_SECONDS
from app.modes.placement.indirect_picture import edited_albedo
from app.modes.placement.placement_events import IndirectRadiance
from app.modes.placement.placement_messages import (
    FreezeIndirect,
    FreezingProgress,
    IndirectFound,
)
from tests.app.fake_worker import FakeClient
from tests.app.modes.placement.started_controller import LIFT, ROWS, SELECTED, WEIGHTS, StartedController, frozen_for

OTHER = Selection("floor", 0, "theta_i")


@pytest.fixture
def controller() -> StartedController:
    return StartedController()


def test_direct_light_asks_for_nothing(controller: StartedController) -> None:
    assert controller.update(n_bounces=1) == [] and not controller.asked and controller.controller.is_complete


def test_one_freezing_and_then_the_sums(controller: StartedController) -> None:
    controller.update()
    controller.update()
    assert len(controller.asked) == 1 and (controller.asked[0].key, controller.asked[0].factor) == ("pot.1", 0)
    assert {look.key for look in controller.asked[0].scene.visible} == {"pot.0", "pot.1", "floor.0"}
    assert not controller.controller.is_complete
    controller.found()
    controller.frozen()
    assert not controller.controller.picture.is_shown
    shown = {event.key: event.radiance for event in controller.update() if isinstance(event, IndirectRadiance)}
    assert controller.controller.picture.is_shown
    albedo = edited_albedo(controller.document, controller.answer, controller.curves)
    expected = 1 + 10 * albedo + 100 * albedo**2
    np.testing.assert_allclose(shown["floor.0"], np.tile(expected, (2, 1)), rtol=1e-5)
    curve = controller.curves.coefficients(controller.document, "pot.1")["theta_h"].sum(axis=0)
    np.testing.assert_allclose(shown["pot.1"], np.tile(curve * (1 + albedo + albedo**2), (2, 1)), rtol=1e-5)
    assert controller.controller.is_complete and controller.update() == []


def test_the_selected_curve_needs_no_other_freezing_and_moves_all_layers(controller: StartedController) -> None:
    controller.update()
    controller.found()
    controller.frozen()
    controller.update()
    controller.edit("pot.1", "theta_h", LIFT)
    assert {event.key for event in controller.update()} == {"pot.0", "pot.1", "floor.0"}
    assert len(controller.asked) == 1 and not controller.controller.is_complete


def test_a_layer_that_shares_the_curve_needs_no_other_freezing_either(controller: StartedController) -> None:
    controller.document = SetFresnelTerm("pot.1", True).apply(controller.document)
    controller.update()
    controller.found()
    controller.frozen()
    controller.update()
    controller.edit("pot.1", "theta_h", LIFT)
    assert {event.key for event in controller.update()} == {"pot.0", "pot.1", "pot.2", "floor.0"}
    assert len(controller.asked) == 1 and not controller.controller.is_complete
    controller.now += IDLE_SECONDS
    controller.update()
    assert len(controller.asked) == 2


def test_what_a_glossy_object_sends_is_frozen_anew_once_the_hand_rests(controller: StartedController) -> None:
    controller.update()
    controller.found()
    controller.frozen()
    controller.edit("pot.1", "theta_h", LIFT)
    controller.update()
    controller.now += IDLE_SECONDS
    controller.update()
    assert len(controller.asked) == 2
    controller.frozen()
    assert controller.update() and controller.controller.is_complete
    controller.now += IDLE_SECONDS
    controller.update()
    assert len(controller.asked) == 2


def test_the_second_bounce_has_as_many_bands_as_are_asked_for(controller: StartedController) -> None:
    for second in (None, 8, 1):
        controller.update(second=second)
        controller.found()
        controller.frozen()
        controller.update(second=second)
    assert [request.second_bands for request in controller.asked] == [None, 8, 1]


def test_other_bands_at_the_first_bounce_are_frozen_anew(controller: StartedController) -> None:
    controller.update()
    controller.found()
    controller.frozen()
    controller.update()
    controller.document = SetFirstBands(16).apply(controller.document)
    controller.controller.edited()
    controller.update()
    assert not controller.controller.is_complete and len(controller.asked) == 1  # its bands serve until then
    controller.now += IDLE_SECONDS
    controller.update()
    assert len(controller.asked) == 2
    look = next(look for look in controller.asked[-1].scene.visible if look.key == "pot.1")
    assert look.bands == (16, 16)


def test_a_freezing_is_awaited_once_there_is_light_to_freeze(controller: StartedController) -> None:
    assert not controller.controller.awaits_frozen
    controller.update()
    assert not controller.controller.awaits_frozen  # finding the light takes long
    controller.found()
    assert controller.controller.awaits_frozen
    controller.frozen()
    assert not controller.controller.awaits_frozen


def test_a_freezing_that_takes_long_is_in_the_status_until_it_is_there(controller: StartedController) -> None:
    controller.update()
    controller.found()
    assert controller.controller.status(Status()) == {}
    serial = controller.asked[-1].serial
    controller.controller.receive_progress(FreezingProgress(serial - 1, 0.9))  # an older one's
    assert controller.controller.status(Status()) == {}
    controller.controller.receive_progress(FreezingProgress(serial, 0.25))
    said = controller.controller.status(Status())
    assert (said["stage"], said["fraction"]) == ("indirect light", 0.25)
    assert controller.controller.status(Status(stage="final", fraction=0.5)) == {}  # it is said to be first
    controller.frozen(is_last=False)
    assert controller.controller.status(Status()) == said
    controller.frozen()
    assert controller.controller.status(Status()) == {}


@pytest.mark.parametrize("fails", [False, True])
def test_a_freezing_that_failed_or_was_stopped_is_not_awaited(editor: Editor, client: FakeClient, fails: bool) -> None:
    editor.do(SetView.of(n_bounces=3, selected=SELECTED))
    editor.tick(1.0)
    editor.tick(2.0)
    freezing = client.sent(FreezeIndirect)[-1]
    client.answer(client.sent(SetCamera)[-1], IndirectFound(1, "fine", ROWS, WEIGHTS))
    client.finish_stage("final", exact=True)
    editor.tick(2.1)
    n_sent = len(client.sent(FreezeIndirect))
    assert editor.controller.awaits_response and client.sent(FreezeIndirect)[-1] is freezing
    if fails:
        client.answer(freezing, RequestFailed("no memory"))
    else:
        editor.cancel_work()
    editor.tick(2.2)
    assert not editor.controller.awaits_response
    editor.tick(2.2 + 2.0 * FREEZE_PATIENCE)
    assert len(client.sent(FreezeIndirect)) == n_sent
    editor.do(SetView.of(selected=Selection("floor", 0, "theta_i")))  # another freezing need not wait for that one
    editor.tick(2.3 + 2.0 * FREEZE_PATIENCE)
    assert len(client.sent(FreezeIndirect)) == n_sent + 1


def test_what_is_frozen_by_hand_costs_no_bands(controller: StartedController) -> None:
    controller.document = SetFrozen("pot", True).apply(controller.document)
    controller.update()
    assert [(request.key, request.factor) for request in controller.asked] == [(None, None)]
    controller.document = SetFrozen("pot", False).apply(controller.document)
    controller.now += FREEZE_PATIENCE
    controller.update()
    assert (controller.asked[-1].key, controller.asked[-1].factor) == ("pot.1", 0)


def test_an_answer_to_an_older_request_is_not_taken_for_the_newer(controller: StartedController) -> None:
    controller.update()
    controller.found()
    late = controller.asked[-1]
    controller.now += FREEZE_PATIENCE
    controller.edit("floor.0", "theta_i", LIFT)
    controller.update()
    assert controller.asked[-1] is not late
    controller.controller.receive_frozen(frozen_for(late, {}, {}, {}))
    assert controller.update() == []


@pytest.mark.parametrize(("key", "factor"), [("pot.1", "theta_d"), ("floor.0", "theta_i"), ("pot.0", "theta_i")])
def test_any_other_curve_is_frozen_anew(controller: StartedController, key: str, factor: str) -> None:
    controller.update()
    controller.found()
    controller.frozen()
    controller.edit(key, factor, LIFT)
    assert controller.update() == [] and len(controller.asked) == 2 and not controller.controller.is_complete
    controller.frozen()
    assert controller.update() and controller.controller.is_complete


def test_another_selection_keeps_the_picture_until_its_freezing_is_here(controller: StartedController) -> None:
    controller.update()
    controller.found()
    controller.frozen()
    before = controller.update()
    assert controller.update(Selection("floor", 0, "theta_i")) == [] and len(controller.asked) == 2
    controller.frozen()
    after = controller.update(Selection("floor", 0, "theta_i"))
    assert {event.key for event in after} == {"pot.0", "pot.1", "floor.0"}
    footprints = {id(event.footprint) for event in (*before, *after)}
    assert len(footprints) == 1  # it is on the graphics card already


def test_one_request_at_a_time_but_patience_ends(controller: StartedController) -> None:
    controller.update()
    controller.edit("floor.0", "theta_i", LIFT)
    controller.update()
    assert len(controller.asked) == 1
    controller.now += FREEZE_PATIENCE
    controller.update()
    assert len(controller.asked) == 2


def test_a_selection_that_comes_back_needs_no_other_freezing(controller: StartedController) -> None:
    controller.update()
    controller.found()
    controller.frozen(noise=0.02)
    controller.update(OTHER)
    controller.frozen(noise=0.03)
    controller.update(OTHER)
    assert len(controller.asked) == 2 and controller.controller.noise == 0.03
    for selected, noise in ((SELECTED, 0.02), (OTHER, 0.03)):
        controller.update(selected)
        assert len(controller.asked) == 2 and controller.controller.is_complete and controller.controller.noise == noise
    # Under other light, or after another edit, it does.
    controller.edit("pot.0", "theta_i", LIFT)
    for _ in range(4):
        controller.update(OTHER)
    assert len(controller.asked) == 3 and not controller.controller.is_complete


def test_a_selection_that_comes_back_while_another_is_frozen_is_there_at_once(controller: StartedController) -> None:
    controller.update()
    controller.found()
    controller.frozen()
    controller.update(OTHER)
    controller.update()
    assert controller.controller.is_complete
    controller.frozen()  # of the other one: too late
    controller.update()
    assert len(controller.asked) == 2 and controller.controller.is_complete


def test_a_new_worker_begins_anew(controller: StartedController) -> None:
    controller.update()
    controller.found()
    controller.frozen()
    controller.update()
    controller.controller.worker_restarted()
    controller.update()
    assert (
        len(controller.asked) == 2 and not controller.controller.is_complete and controller.controller.picture.is_shown
    )


def test_a_new_transport_is_told_what_to_freeze(controller: StartedController) -> None:
    controller.update(revision=1)
    controller.update(revision=2)
    assert [request.revision for request in controller.asked] == [1, 2]


def test_a_hidden_layer_sends_nothing_on(controller: StartedController) -> None:
    state = controller.document.object("floor")
    hidden = replace(state, layers=tuple(layer.replace(visible=False) for layer in state.layers))
    objects = tuple(hidden if each.name == "floor" else each for each in controller.document.objects)
    controller.document = replace(controller.document, objects=objects)
    controller.update()
    assert {look.key for look in controller.asked[-1].scene.visible} == {"pot.0", "pot.1"}
