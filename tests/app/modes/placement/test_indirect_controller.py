"""What the window asks for and shows of indirect light, with answers put in the worker's mouth."""

from dataclasses import replace

import numpy as np
import pytest

from app.document.commands.layers import SetFresnelTerm, SetFrozen
from app.document.commands.plan import SetFirstBands
from app.document.document import Selection, document_from_description
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.editor_status import Status
from app.messages.worker_messages import RequestFailed, SetCamera
from app.modes.placement.curves import Curves
from app.modes.placement.indirect_controller import FREEZE_PATIENCE, IDLE_SECONDS, IndirectController
from app.modes.placement.indirect_picture import edited_albedo
from app.modes.placement.placement_events import IndirectRadiance
from app.modes.placement.placement_messages import (
    FreezeIndirect,
    FreezingProgress,
    IndirectFound,
    IndirectFrozen,
    IndirectImproved,
    IndirectNoise,
)
from engine.curve.operators import Operator
from engine.precompute.indirect.frozen_light import FrozenGloss, FrozenLight, Modes, SelectedCurve
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE, FakeClient

SELECTED = Selection("pot", 1, "theta_h")
LIFT = Operator("amplify", "y", 0.0, 0.0, 1.0, 1.2, magnitude=2.0)
ROWS, WEIGHTS = np.zeros((4, 4), np.int32), np.full((4, 4), 0.25, np.float32)


class StartedController:
    """A controller at work on the scene of the fake worker."""

    def __init__(self) -> None:
        self.client, self.curves, self.now = FakeClient(), Curves(), 0.0
        self.document = document_from_description("shelf", parse_description(SCENE, "shelf"))
        self.controller = IndirectController(self.client.send, self.curves)

    def update(
        self, selected: Selection | None = SELECTED, n_bounces: int = 3, revision: int = 1, second: int | None = None
    ):
        self.now += 0.1
        return self.controller.update(self.now, self.document, selected, n_bounces, second, revision)

    @property
    def asked(self) -> list[FreezeIndirect]:
        return [request for request in self.client.requests if isinstance(request, FreezeIndirect)]

    def found(self, number: int = 1, stage: str = "fine", revision: int = 1) -> None:
        self.controller.receive_samples(IndirectFound(number, stage, ROWS + number, WEIGHTS, revision=revision))

    def frozen(self, number: int = 1, noise: float | None = 0.02, is_last: bool = True) -> None:
        """The answer to the newest request: two samples a layer, powers 1, d and d²."""
        wish = self.asked[-1]
        reflected, bands = {}, {}
        for look in wish.scene.visible:
            if look.key in wish.curves:
                bands[look.key] = np.ones((3, len(look.coefficients[wish.curves[look.key]]), 3, 2), np.float32)
            else:
                reflected[look.key] = np.stack([np.full((2, 3), 10.0**n, np.float32) for n in range(3)])
        mine = [
            look for look in wish.scene.visible if look.key.rpartition(".")[0] == (wish.key or "").rpartition(".")[0]
        ]
        albedos = {look.key: np.ones((32, *(*map(len, look.coefficients), 1)[:2])) / 1e4 for look in mine}
        self.answer = replace(frozen_for(wish, reflected, bands, albedos, number), is_last=is_last)
        self.controller.receive_frozen(self.answer)
        if noise is not None:
            self.controller.receive_noise(IndirectNoise(number, wish.serial, noise, mean=0.5))

    def edit(self, key: str, factor: str, *operators: Operator) -> None:
        layer = self.document.layer(key)
        self.document = self.document.with_layer(key, layer.with_operators(factor, operators))
        self.controller.edited()


def frozen_for(
    wish: FreezeIndirect, reflected: dict[str, np.ndarray], bands: dict[str, np.ndarray],
    albedos: dict[str, np.ndarray], number: int = 1, unit: float = 1.0,
) -> IndirectFrozen:  # fmt: skip
    """The answer to a request: reflected (D, p, 3) and bands (3, J, D, p) by key."""
    keys = tuple(look.key for look in wish.scene.visible)
    by_number = {keys.index(key): np.ascontiguousarray(part.transpose(2, 0, 1)) for key, part in reflected.items()}
    light = FrozenLight(by_number, {keys.index(key): part for key, part in bands.items()})
    return IndirectFrozen(number, wish.serial, keys, wish.curves, light, albedos, unit)


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


def test_noise_is_that_of_the_light_on_screen(controller: StartedController) -> None:
    controller.update()
    controller.found(1)
    controller.frozen(1, noise=None)
    assert controller.update() and controller.controller.noise is None
    assert (
        not controller.controller.is_complete and controller.controller.noise_of_picture(0.0) == 0.0
    )  # nothing is claimed before it is known
    controller.controller.receive_noise(IndirectNoise(1, controller.asked[-1].serial, 0.02, mean=0.5))
    controller.update()
    assert controller.controller.noise == 0.02 and controller.controller.is_complete
    assert controller.controller.noise_of_picture(1.5) == pytest.approx(
        0.02 * 0.5 / 2.0
    )  # a quarter of the light is indirect
    controller.found(2)
    controller.frozen(2, noise=None)
    controller.update()
    assert controller.controller.noise is None and not controller.controller.is_complete


def improved(controller: StartedController, number: int, serial: int, is_sampled: bool = True) -> IndirectImproved:
    """Light with more rays, in the worker's words."""
    found = IndirectFound(number, "fine", ROWS + number, WEIGHTS)
    frozen = replace(controller.answer, number=number, serial=serial)
    return IndirectImproved(found, frozen, IndirectNoise(number, serial, 0.01, 0.5, is_sampled), revision=1)


def test_light_with_more_rays_takes_the_place_of_what_is_shown_at_once(controller: StartedController) -> None:
    controller.update()
    controller.found(1)
    controller.frozen(1, noise=None)
    serial, light = controller.asked[-1].serial, controller.controller
    light.receive_noise(IndirectNoise(1, serial, 0.02, 0.5, is_sampled=False))
    controller.update()
    assert light.lacks_rays and light.is_complete
    for number, is_sampled in ((2, False), (3, True)):
        light.receive_improved(improved(controller, number, serial, is_sampled))
        events = controller.update()
        assert {event.key for event in events if isinstance(event, IndirectRadiance)}
        assert all((event.footprint.rows == ROWS + number).all() for event in events)
        assert light.is_complete and light.noise == 0.01 and light.lacks_rays != is_sampled
    assert len(controller.asked) == 1


def test_light_with_more_rays_of_an_older_freezing_is_drawn_with_the_newer(controller: StartedController) -> None:
    controller.update()
    controller.found(1)
    controller.frozen(1)
    older = controller.asked[-1].serial
    controller.update(Selection("floor", 0, "theta_i"))
    assert controller.asked[-1].serial != older
    controller.controller.receive_improved(improved(controller, 2, older))
    controller.update(Selection("floor", 0, "theta_i"))
    assert not controller.controller.is_complete
    controller.frozen(2)
    controller.update(Selection("floor", 0, "theta_i"))
    assert controller.controller.is_complete


def test_what_is_frozen_by_hand_costs_no_bands(controller: StartedController) -> None:
    controller.document = SetFrozen("pot", True).apply(controller.document)
    controller.update()
    assert [(request.key, request.factor) for request in controller.asked] == [(None, None)]
    controller.document = SetFrozen("pot", False).apply(controller.document)
    controller.now += FREEZE_PATIENCE
    controller.update()
    assert (controller.asked[-1].key, controller.asked[-1].factor) == ("pot.1", 0)


def test_the_noise_of_a_diffuse_object_is_measured_again_when_idle(controller: StartedController) -> None:
    selected = Selection("floor", 0, "theta_i")
    controller.update(selected)
    controller.found()
    controller.frozen()
    controller.edit("floor.0", "theta_i", LIFT)
    for _ in range(2):
        controller.now += IDLE_SECONDS
        controller.update(selected)
    assert len(controller.asked) == 2 and not controller.controller.is_complete and controller.controller.noise == 0.02
    controller.frozen(noise=3.76)
    controller.update(selected)
    assert controller.controller.noise == 3.76 and controller.controller.is_complete


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


OTHER = Selection("floor", 0, "theta_i")


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


@pytest.mark.parametrize("ends", ["whole", "lost", "failed", "stopped"])
def test_edits_are_followed_before_what_gloss_sends_on_is_there(controller: StartedController, ends: str) -> None:
    controller.update()
    controller.found()
    controller.frozen(is_last=False, noise=None)
    assert controller.update() and controller.controller.follows_edits and controller.controller.awaits_frozen
    controller.edit("pot.1", "theta_h", LIFT)
    assert controller.update() and not controller.controller.is_complete
    controller.edit("pot.1", "theta_h")
    controller.update()
    match ends:
        case "whole":
            controller.frozen()
        case "lost":
            controller.controller.lose_request()
        case "failed":
            controller.controller.receive_failure(len(controller.client.requests))
        case _:
            controller.controller.cancelled()
    for _ in range(4):
        controller.update()
    n_asked = 2 if ends == "lost" else 1
    assert controller.controller.is_complete == (ends == "whole") and len(controller.asked) == n_asked


def test_what_belongs_to_other_samples_is_not_shown(controller: StartedController) -> None:
    controller.update()
    controller.found(number=2)
    controller.frozen(number=1)
    assert controller.update() == []


def test_a_rough_light_is_not_the_last(controller: StartedController) -> None:
    controller.update()
    controller.found(1, "rough")
    controller.frozen(1)
    assert controller.update() and not controller.controller.is_complete
    controller.found(2)
    assert not controller.controller.is_complete
    controller.frozen(2)
    assert controller.update() and controller.controller.is_complete


def test_light_brings_the_footprint_of_its_own_samples(controller: StartedController) -> None:
    controller.update()
    controller.found(1, "rough")
    controller.frozen(1)
    controller.found(2)  # what reflects it has not come yet
    assert {int(event.footprint.rows[0, 0]) for event in controller.update()} == {1}
    controller.frozen(2)
    assert {int(event.footprint.rows[0, 0]) for event in controller.update()} == {2}


def test_light_of_the_transport_before_is_not_the_last(controller: StartedController) -> None:
    controller.update(revision=1)
    controller.found(revision=1)
    controller.frozen()
    controller.update(revision=1)
    assert controller.controller.is_complete
    controller.update(revision=2)
    controller.frozen()
    assert controller.update(revision=2) and not controller.controller.is_complete  # the light may have turned
    controller.found(revision=2)  # it is the same
    controller.update(revision=2)
    assert controller.controller.is_complete


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


def test_fewer_bounces_take_it_away(controller: StartedController) -> None:
    controller.update()
    controller.found()
    controller.frozen()
    controller.update()
    assert {(event.key, event.radiance) for event in controller.update(n_bounces=1)} == {
        ("pot.0", None), ("pot.1", None), ("floor.0", None),
    }  # fmt: skip


def test_light_comes_in_units_of_its_own(controller: StartedController) -> None:
    controller.update()
    controller.found()
    wish = controller.asked[-1]
    reflected = {
        look.key: np.stack([np.full((2, 3), 3.0, np.float32)]) for look in wish.scene.visible if look.key != wish.key
    }
    bands = np.full(
        (3, len(next(x for x in wish.scene.visible if x.key == wish.key).coefficients[0]), 1, 2), 0.0, np.float32
    )
    controller.controller.receive_frozen(frozen_for(wish, reflected, {wish.key: bands}, {}, unit=1e24))
    shown = {event.key: event.radiance for event in controller.update()}
    np.testing.assert_allclose(shown["floor.0"], 3e24, rtol=1e-6)
    assert not controller.controller.picture.is_clamped


def test_an_albedo_beyond_all_bounds_is_bright_where_there_is_light_and_said(controller: StartedController) -> None:
    # d = 1e19: d² is 1e38 and fits, times 100 it does not. Where nothing comes by that power, nothing is shown.
    controller.update()
    controller.found()
    wish = controller.asked[-1]
    powers = np.stack([np.full((2, 3), value, np.float32) for value in (1.0, 0.0, 0.0)])
    reflected = {look.key: powers if look.key == "floor.0" else 100 * powers[::-1] for look in wish.scene.visible}
    mine = next(look for look in wish.scene.visible if look.key == wish.key)
    bands = np.zeros((3, len(mine.coefficients[0]), 3, 2), np.float32)
    e = {wish.key: np.full((32, *map(len, mine.coefficients)), 1e19)}
    reflected.pop(wish.key)
    controller.controller.receive_frozen(frozen_for(wish, reflected, {wish.key: bands}, e))
    shown = {event.key: event.radiance for event in controller.update()}
    np.testing.assert_array_equal(shown["floor.0"], 1.0)
    assert (
        np.isfinite(shown["pot.0"]).all() and shown["pot.0"].min() > 1e35 and controller.controller.picture.is_clamped
    )


def with_gloss(answer: IndirectFrozen, controller: StartedController) -> IndirectFrozen:
    """The answer with what the gloss sends on: a light of 1 per unit of its first band, to the floor."""
    i_gloss, curve = answer.keys.index("pot.1"), controller.curves.coefficients(controller.document, "pot.1")["theta_h"]
    sent = controller.curves.outgoing_gain(controller.document, "pot.1") * curve
    n, effect = len(curve), np.zeros((len(curve), 3))
    effect[0] = 1.0
    knots, modes = np.array([0, n - 1]), Modes(np.ones((n, 1), np.float32), np.zeros((1, n)))
    by_layer = {answer.keys.index("floor.0"): np.stack([np.array([[1.0, 1.0], [0.0, 0.0]], np.float32)] * 3)}
    gloss = FrozenGloss(SelectedCurve(i_gloss, 0), np.ones(3), sent, knots, effect, modes, np.ones(3), by_layer)
    return replace(answer, light=replace(answer.light, gloss=(gloss,)))


def test_light_sent_on_follows_the_curve_and_is_frozen_anew_at_once_when_that_has_moved_far(
    controller: StartedController,
) -> None:
    controller.update()
    controller.found()
    controller.frozen()
    controller.controller.receive_frozen(with_gloss(controller.answer, controller))
    controller.update()
    gain = controller.curves.outgoing_gain(controller.document, "pot.1")
    frozen = controller.curves.coefficients(controller.document, "pot.1")["theta_h"]
    for magnitude, n_asked in ((1.02, 1), (9.0, 2)):  # near: only once the hand rests
        controller.edit("pot.1", "theta_h", replace(LIFT, magnitude=magnitude))
        floor = {event.key: event.radiance for event in controller.update()}["floor.0"]
        albedo = edited_albedo(controller.document, controller.answer, controller.curves)
        curve = controller.curves.coefficients(controller.document, "pot.1")["theta_h"]
        sent_on = gain * (curve - frozen)[0]
        assert (sent_on > 0.0).all()
        np.testing.assert_allclose(floor, np.tile(1 + 10 * albedo + 100 * albedo**2 + sent_on, (2, 1)), rtol=1e-5)
        controller.update()
        assert len(controller.asked) == n_asked


def test_undo_after_a_far_edit_goes_back_to_what_was_frozen_near_it(controller: StartedController) -> None:
    controller.update()
    controller.found()
    controller.frozen()
    before = controller.answer = with_gloss(controller.answer, controller)
    controller.controller.receive_frozen(before)
    controller.update()
    controller.edit("pot.1", "theta_h", replace(LIFT, magnitude=9.0))
    controller.update()
    controller.update()
    controller.frozen()
    controller.controller.receive_frozen(with_gloss(controller.answer, controller))
    controller.update()
    assert controller.controller.picture.departure == 0.0
    controller.edit("pot.1", "theta_h", replace(LIFT, magnitude=1.02))  # nearer to the curve of before
    controller.update()
    assert 0.0 < controller.controller.picture.departure < 0.1 and len(controller.asked) == 2
    controller.edit("pot.1", "theta_h")
    controller.update()
    assert controller.controller.picture.departure == 0.0 and controller.controller.is_complete
    for _ in range(5):
        controller.update()
    assert len(controller.asked) == 2


def test_what_knots_leave_out_of_an_edit_is_a_part_of_the_error(controller: StartedController) -> None:
    controller.update()
    controller.found()
    controller.frozen(noise=0.02)
    answer = with_gloss(controller.answer, controller)
    [gloss] = answer.light.gloss
    gloss.effect[:] = 1.0  # light meets all bands, of which two are knots
    controller.controller.receive_frozen(answer)
    controller.update()
    assert controller.controller.noise == pytest.approx(0.02)
    controller.edit("pot.1", "theta_h", Operator("amplify", "y", 0.0, 0.3, 0.5, 0.7, magnitude=1.1))
    controller.update()
    assert controller.controller.noise is not None and controller.controller.noise > 0.021
