"""The bands of layers that an edit brings: planned by the worker, while the document is edited on."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from app.document.commands import EditCommand
from app.document.commands.layers import AddLayers, SetMaterial, SetModel, SetParameter, SetVariant, new_layer
from app.document.document import Document, Variant
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.files.materials import Library
from app.messages.worker_messages import RequestFailed
from app.modes.placement.placement_messages import BandsPlanned, ComputeTransport, PlanBands
from app.modes.placement.placement_status import RenderReport
from app.worker.tasks import RequestDispatcher
from engine.planner import band_counts, usual_bands
from tests.app.fake_worker import FakeClient
from tests.opened import run_in_process

BASE, GLOSS = new_layer("lambert").with_parameter("albedo", 0.1), new_layer("cook_torrance")
MOVED = {"lambert": "albedo", "cook_torrance": "sigma", "rough_conductor": "alpha"}


@pytest.fixture
def editor(client: FakeClient, monkeypatch: pytest.MonkeyPatch) -> Editor:
    """An editor that has no way to plan bands itself, with all of its scene delivered; the worker has yet to plan."""
    monkeypatch.delattr("app.modes.placement.band_plans.band_counts")
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    editor.controller.rendered(RenderReport(exact=True))
    assert editor.status.picture == "exact"
    client.plans = False
    client.requests.clear()
    return editor


def bands_asked(client: FakeClient, key: str) -> tuple[int, ...]:
    (work,) = (work for work in client.sent(ComputeTransport)[-1].scene.layers if work.key == key)
    assert tuple(len(values) for values in work.coefficients) == work.bands
    return work.bands


def gold(document: Document) -> EditCommand:
    return SetMaterial("pot", Library().entry("Gold").material.layers, "Gold")


EDITS: dict[str, tuple[Callable[[Document], EditCommand], str]] = {
    "a material of the library": (gold, "pot.0"),
    "one of the same models": (lambda document: SetMaterial("pot", (BASE, document.layer("pot.1"))), "pot.0"),
    "a layer more": (lambda _: AddLayers("pot", (GLOSS,)), "pot.2"),
    "another model": (lambda _: SetModel("pot.1", "cook_torrance"), "pot.1"),
}


@pytest.mark.parametrize("name", EDITS)
def test_transport_waits_for_the_workers_plan(editor: Editor, client: FakeClient, name: str) -> None:
    make, key = EDITS[name]
    assert editor.do(make(editor.document)) is None
    seen = editor.document.layer(key)
    for now in (2.0, 3.0, 4.0):  # the layer is edited on; it is planned as it came
        editor.tick(now)
        editor.controller.rendered(RenderReport(exact=True))
        assert editor.status.picture != "exact"
        assert editor.do(SetParameter(key, MOVED[seen.model.name], 0.1 * now)) is None
    (asked,) = client.sent(PlanBands)
    assert client.requests == [asked] and seen in asked.layers
    usual = usual_bands(seen.model)
    assert {
        factor: len(values) for factor, values in editor.controller.picture.wanted_coefficients(key).items()
    } == usual
    planned = {factor: 2 * n for factor, n in usual.items()}
    client.answer(asked, BandsPlanned((planned,) * len(asked.layers)))
    for now in (4.3, 4.6):  # bands other than the usual: the hand is to rest anew
        editor.tick(now)
    assert bands_asked(client, key) == tuple(planned.values())
    editor.do(SetParameter(key, MOVED[seen.model.name], 0.25))
    editor.tick(5.0)
    assert client.sent(PlanBands) == [asked]  # an edit keeps the plan


def test_a_variant_of_the_same_models_is_planned_anew(editor: Editor, client: FakeClient) -> None:
    """Else a sharp highlight would have the bands of the dull one before."""
    state = editor.document.object("pot")
    looks = (Variant("other", (BASE, state.layers[1])),)
    editor.history.document = editor.document.with_object(replace(state, variants=looks))
    editor.tick(1.5)
    assert not client.sent(PlanBands) and editor.do(SetVariant("other")) is None
    editor.tick(2.0)
    (asked,) = client.sent(PlanBands)
    assert editor.document.layer("pot.0") in asked.layers


def test_undo_finds_what_was_planned(editor: Editor, client: FakeClient) -> None:
    before = bands_of(editor, "pot.1")
    editor.do(SetModel("pot.1", "cook_torrance"))
    editor.tick(2.0)
    (asked,) = client.sent(PlanBands)
    client.answer(asked, BandsPlanned(({"theta_h": 8, "theta_d": 8},)))
    editor.tick(2.3)
    editor.undo()
    assert bands_of(editor, "pot.1") == before
    editor.redo()
    assert bands_of(editor, "pot.1") == {"theta_h": 8, "theta_d": 8}
    editor.tick(3.0)
    assert client.sent(PlanBands) == [asked]
    # Undone before the answer: nothing is waited for.
    editor.do(SetModel("pot.0", "phong"))
    editor.tick(4.0)
    client.finish_stage("final", exact=True)
    editor.undo()
    editor.tick(5.0)
    editor.controller.rendered(RenderReport(exact=True))
    assert editor.status.picture == "exact" and len(client.sent(PlanBands)) == 2


def bands_of(editor: Editor, key: str) -> dict[str, int]:
    return {factor: len(values) for factor, values in editor.controller.picture.wanted_coefficients(key).items()}


def test_what_cannot_be_planned_has_the_usual_bands(editor: Editor, client: FakeClient) -> None:
    editor.do(SetModel("pot.1", "cook_torrance"))
    editor.tick(2.0)
    client.answer(client.sent(PlanBands)[0], RequestFailed("internal error"))
    editor.tick(2.3)
    assert bands_asked(client, "pot.1") == tuple(usual_bands(GLOSS.model).values())
    assert editor.status.message == "internal error"


def test_the_worker_plans_layers() -> None:
    layers = (GLOSS, *Library().entry("Car paint, blue").material.layers)
    *_, planned = run_in_process(RequestDispatcher(), PlanBands(layers))
    assert planned.bands == tuple(band_counts(layer) for layer in layers)
    assert planned.bands[-1]["theta_h"] == 128  # a clear coat: the usual 64 would not do


def test_a_plan_that_comes_after_a_stop_does_not_undo_it(editor: Editor, client: FakeClient) -> None:
    editor.do(gold(editor.document))
    editor.tick(2.0)
    (asked,) = client.sent(PlanBands)
    editor.cancel_work()
    client.answer(asked, BandsPlanned(tuple(band_counts(layer) for layer in asked.layers)))
    for now in (2.1, 3.0, 4.0):
        editor.tick(now)
    assert client.sent(ComputeTransport) == [] and editor.status.stopped
    editor.resume_work()
    editor.tick(4.1)
    assert len(client.sent(ComputeTransport)) == 1 and not editor.status.stopped


def test_a_mode_that_is_left_and_come_back_to_finds_its_plans(editor: Editor, client: FakeClient) -> None:
    editor.do(SetParameter("pot.1", "alpha", 0.15))  # edited by hand, a layer keeps the bands that it came with
    bands = {key: dict(editor.controller.curves.bands(editor.document, key)) for key, _ in editor.document.layers()}
    editor.do(SetModel("pot.0", "cook_torrance"))
    editor.tick(2.0)
    (asked,) = client.sent(PlanBands)
    usual = usual_bands(editor.document.layer("pot.0").model)
    planned = {factor: 2 * n for factor, n in usual.items()}
    client.answer(asked, BandsPlanned((planned,)))
    editor.tick(2.1)
    for mode in ("orbit", "placement"):
        editor.do(SetView.of(mode=mode))
        editor.tick(3.0)
        editor.tick(4.0)
    assert client.sent(PlanBands) == [asked]
    found = {key: dict(editor.controller.curves.bands(editor.document, key)) for key, _ in editor.document.layers()}
    assert found == bands | {"pot.0": planned}
