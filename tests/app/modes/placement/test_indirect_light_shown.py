"""What the window shows of the indirect light that comes: the newest that fits the picture, and its noise."""

from dataclasses import replace

import numpy as np
import pytest

from app.document.document import Selection
from app.modes.placement.indirect_controller import IDLE_SECONDS
from app.modes.placement.indirect_picture import edited_albedo
from app.modes.placement.placement_events import IndirectRadiance
from app.modes.placement.placement_messages import (
    IndirectFound,
    IndirectFrozen,
    IndirectImproved,
    IndirectNoise,
)
from engine.curve.operators import Operator
from engine.precompute.indirect.frozen_light import FrozenGloss, Modes, SelectedCurve
from tests.app.modes.placement.started_controller import LIFT, ROWS, WEIGHTS, StartedController, frozen_for


@pytest.fixture
def controller() -> StartedController:
    return StartedController()


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
