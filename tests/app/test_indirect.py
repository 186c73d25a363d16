"""What the window asks for and shows of indirect light, with answers put in the worker's mouth."""

from dataclasses import replace

import numpy as np
import pytest

from app.commands import SetFresnelTerm, SetFrozen
from app.document import Selection, document_from_description
from app.indirect import FREEZE_PATIENCE, REST_SECONDS, IndirectTalk
from app.jobs.messages import Freeze, Frozen, IndirectFound, IndirectNoise
from app.picture import Curves, IndirectFootprint, IndirectRadiance
from app.series_commands import SetFirstBands
from engine.curve.operators import Operator
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE, FakeClient

SELECTED = Selection("pot", 1, "theta_h")
LIFT = Operator("amplify", "y", 0.0, 0.0, 1.0, 1.2, magnitude=2.0)
ROWS, WEIGHTS = np.zeros((4, 4), np.int32), np.full((4, 4), 0.25, np.float32)


class Talk:
    """A talk under way about the scene of the fake worker."""

    def __init__(self) -> None:
        self.client, self.curves, self.now = FakeClient(), Curves(), 0.0
        self.document = document_from_description("shelf", parse_description(SCENE, "shelf"))
        self.talk = IndirectTalk(self.client.send, self.curves)

    def update(
        self, selected: Selection | None = SELECTED, n_bounces: int = 3, revision: int = 1, second: int | None = None
    ):
        self.now += 0.1
        return self.talk.update(self.now, self.document, selected, n_bounces, second, revision)

    @property
    def asked(self) -> list[Freeze]:
        return [request for request in self.client.requests if isinstance(request, Freeze)]

    def found(self, number: int = 1, stage: str = "fine") -> None:
        self.talk.took_found(IndirectFound(number, stage, ROWS, WEIGHTS))

    def frozen(self, number: int = 1):
        """The answer to the newest request: two samples a layer, powers 1, d and d²."""
        wish = self.asked[-1]
        reflected, n_bands = {}, 0
        for look in wish.looks:
            if look.key == wish.key and wish.factor is not None:
                n_bands = len(look.coefficients[wish.factor])
            else:
                reflected[look.key] = np.stack([np.full((2, 3), 10.0**n, np.float32) for n in range(3)])
        mine = [look for look in wish.looks if look.key.rpartition(".")[0] == (wish.key or "").rpartition(".")[0]]
        albedos = {look.key: np.ones((32, *(*map(len, look.coefficients), 1)[:2])) / 1e4 for look in mine}
        bands = np.ones((3, n_bands, 3, 2), np.float32)
        return self.talk.took_frozen(Frozen(number, wish.serial, wish.key, wish.factor, reflected, bands, albedos))

    def edit(self, key: str, factor: str, *operators: Operator) -> None:
        layer = self.document.layer(key)
        self.document = self.document.with_layer(key, layer.with_operators(factor, operators))
        self.talk.edited()


@pytest.fixture
def talk() -> Talk:
    return Talk()


def test_direct_light_asks_for_nothing(talk: Talk) -> None:
    assert talk.update(n_bounces=1) == [] and not talk.asked and talk.talk.is_complete


def test_one_freezing_and_then_the_sums(talk: Talk) -> None:
    talk.update()
    talk.update()
    assert len(talk.asked) == 1 and (talk.asked[0].key, talk.asked[0].factor) == ("pot.1", 0)
    assert {look.key for look in talk.asked[0].looks} == {"pot.0", "pot.1", "floor.0"}
    assert not talk.talk.is_complete
    talk.found()
    assert [type(event) for event in talk.frozen()] == [IndirectFootprint]
    assert not talk.talk.is_shown
    shown = {event.key: event.radiance for event in talk.update() if isinstance(event, IndirectRadiance)}
    assert talk.talk.is_shown
    albedo = talk.talk._albedo(talk.document, talk.talk._frozen[1])
    expected = 1 + 10 * albedo + 100 * albedo**2
    np.testing.assert_allclose(shown["floor.0"], np.tile(expected, (2, 1)), rtol=1e-5)
    curve = talk.curves.coefficients(talk.document, "pot.1")["theta_h"].sum(axis=0)
    np.testing.assert_allclose(shown["pot.1"], np.tile(curve * (1 + albedo + albedo**2), (2, 1)), rtol=1e-5)
    assert talk.talk.is_complete and talk.update() == []


def test_the_selected_curve_needs_no_other_freezing_and_moves_all_layers(talk: Talk) -> None:
    talk.update()
    talk.found()
    talk.frozen()
    talk.update()
    talk.edit("pot.1", "theta_h", LIFT)
    assert {event.key for event in talk.update()} == {"pot.0", "pot.1", "floor.0"}
    assert len(talk.asked) == 1 and not talk.talk.is_complete


def test_a_layer_that_shares_the_curve_needs_no_other_freezing_either(talk: Talk) -> None:
    talk.document = SetFresnelTerm("pot.1", True).apply(talk.document)
    talk.update()
    talk.found()
    talk.frozen()
    talk.update()
    talk.edit("pot.1", "theta_h", LIFT)
    assert {event.key for event in talk.update()} == {"pot.0", "pot.1", "pot.2", "floor.0"}
    assert len(talk.asked) == 1 and not talk.talk.is_complete
    talk.now += REST_SECONDS
    talk.update()
    assert len(talk.asked) == 2


def test_what_a_glossy_object_sends_is_frozen_anew_once_the_hand_rests(talk: Talk) -> None:
    talk.update()
    talk.found()
    talk.frozen()
    talk.edit("pot.1", "theta_h", LIFT)
    talk.update()
    talk.now += REST_SECONDS
    talk.update()
    assert len(talk.asked) == 2
    talk.frozen()
    assert talk.update() and talk.talk.is_complete
    talk.now += REST_SECONDS
    talk.update()
    assert len(talk.asked) == 2


def test_the_second_bounce_has_as_many_bands_as_are_asked_for(talk: Talk) -> None:
    for second in (None, 8, 1):
        talk.update(second=second)
        talk.found()
        talk.frozen()
        talk.update(second=second)
    assert [request.by_albedo for request in talk.asked] == [False, False, True]
    looks = [next(look for look in request.looks if look.key == "pot.1") for request in talk.asked]
    assert [len(look.sent[0]) for look in looks] == [64, 8, 1]
    assert all(look.coefficients[0] is looks[0].sent[0] for look in looks)


def test_other_bands_at_the_first_bounce_are_frozen_anew(talk: Talk) -> None:
    talk.update()
    talk.found()
    talk.frozen()
    talk.update()
    talk.document = SetFirstBands(16).apply(talk.document)
    assert talk.update() == [] and not talk.talk.is_complete and len(talk.asked) == 2
    look = next(look for look in talk.asked[-1].looks if look.key == "pot.1")
    assert [len(values) for values in look.coefficients] == [16, 16]


def test_a_freezing_is_awaited_once_there_is_light_to_freeze(talk: Talk) -> None:
    assert not talk.talk.awaits_frozen
    talk.update()
    assert not talk.talk.awaits_frozen  # finding the light takes long
    talk.found()
    assert talk.talk.awaits_frozen
    talk.frozen()
    assert not talk.talk.awaits_frozen


def test_noise_is_that_of_the_light_on_screen(talk: Talk) -> None:
    talk.update()
    talk.found(1)
    talk.talk.took_noise(IndirectNoise(1, 0.02))
    assert talk.talk.noise is None
    talk.frozen(1)
    talk.update()
    assert talk.talk.noise == 0.02
    talk.found(2)
    talk.frozen(2)
    talk.update()
    assert talk.talk.noise is None


def test_what_is_frozen_by_hand_costs_no_bands(talk: Talk) -> None:
    talk.document = SetFrozen("pot", True).apply(talk.document)
    talk.update()
    assert [(request.key, request.factor) for request in talk.asked] == [(None, None)]
    talk.document = SetFrozen("pot", False).apply(talk.document)
    talk.now += FREEZE_PATIENCE
    talk.update()
    assert (talk.asked[-1].key, talk.asked[-1].factor) == ("pot.1", 0)


def test_a_matt_object_has_no_shape_to_freeze(talk: Talk) -> None:
    selected = Selection("floor", 0, "theta_i")
    talk.update(selected)
    talk.found()
    talk.frozen()
    talk.edit("floor.0", "theta_i", LIFT)
    for _ in range(2):
        talk.now += REST_SECONDS
        talk.update(selected)
    assert len(talk.asked) == 1 and talk.talk.is_complete


def test_an_answer_to_an_older_request_is_not_taken_for_the_newer(talk: Talk) -> None:
    talk.update()
    talk.found()
    late = talk.asked[-1]
    talk.now += FREEZE_PATIENCE
    talk.edit("floor.0", "theta_i", LIFT)
    talk.update()
    assert talk.asked[-1] is not late
    events = talk.talk.took_frozen(Frozen(1, late.serial, late.key, late.factor, {}, np.zeros((3, 0, 3, 0)), {}))
    assert events == [] and talk.update() == []


@pytest.mark.parametrize(("key", "factor"), [("pot.1", "theta_d"), ("floor.0", "theta_i"), ("pot.0", "theta_i")])
def test_any_other_curve_is_frozen_anew(talk: Talk, key: str, factor: str) -> None:
    talk.update()
    talk.found()
    talk.frozen()
    talk.edit(key, factor, LIFT)
    assert talk.update() == [] and len(talk.asked) == 2 and not talk.talk.is_complete
    talk.frozen()
    assert talk.update() and talk.talk.is_complete


def test_another_selection_keeps_the_picture_until_its_freezing_is_here(talk: Talk) -> None:
    talk.update()
    talk.found()
    talk.frozen()
    talk.update()
    assert talk.update(Selection("floor", 0, "theta_i")) == [] and len(talk.asked) == 2
    assert talk.frozen() == []  # the footprint is the same
    assert {event.key for event in talk.update(Selection("floor", 0, "theta_i"))} == {"pot.0", "pot.1", "floor.0"}


def test_one_request_at_a_time_but_patience_ends(talk: Talk) -> None:
    talk.update()
    talk.edit("floor.0", "theta_i", LIFT)
    talk.update()
    assert len(talk.asked) == 1
    talk.now += FREEZE_PATIENCE
    talk.update()
    assert len(talk.asked) == 2


def test_what_belongs_to_other_samples_is_not_shown(talk: Talk) -> None:
    talk.update()
    talk.found(number=2)
    assert talk.frozen(number=1) == [] and talk.update() == []


def test_a_rough_light_is_not_the_last(talk: Talk) -> None:
    talk.update()
    talk.found(1, "rough")
    talk.frozen(1)
    assert talk.update() and not talk.talk.is_complete
    talk.found(2)
    assert not talk.talk.is_complete
    assert [type(event) for event in talk.frozen(2)] == [IndirectFootprint]
    assert talk.update() and talk.talk.is_complete


def test_a_new_transport_is_told_what_to_freeze(talk: Talk) -> None:
    talk.update(revision=1)
    talk.update(revision=2)
    assert [request.revision for request in talk.asked] == [1, 2]


def test_a_hidden_layer_sends_nothing_on(talk: Talk) -> None:
    state = talk.document.object("floor")
    hidden = replace(state, layers=tuple(layer.replace(visible=False) for layer in state.layers))
    objects = tuple(hidden if each.name == "floor" else each for each in talk.document.objects)
    talk.document = replace(talk.document, objects=objects)
    talk.update()
    assert {look.key for look in talk.asked[-1].looks} == {"pot.0", "pot.1"}


def test_fewer_bounces_take_it_away(talk: Talk) -> None:
    talk.update()
    talk.found()
    talk.frozen()
    talk.update()
    assert {(event.key, event.radiance) for event in talk.update(n_bounces=1)} == {
        ("pot.0", None), ("pot.1", None), ("floor.0", None),
    }  # fmt: skip


