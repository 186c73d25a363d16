"""What is asked of the worker for layers and their curves, when, and which answers are shown."""

from dataclasses import replace

import numpy as np

from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetEditable, SetParameter
from app.document.commands.light import SetRotation
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import OpenScene, WorkerRestarted
from app.modes.placement.placement_events import LayerRadiance, TransportReady
from app.modes.placement.placement_messages import ContractTransport, LayerPicture
from app.modes.placement.placement_status import RenderReport
from engine.curve.bands import band_nodes
from engine.curve.operators import Operator
from tests.app.fake_worker import SCENE, FakeClient, computed, transport

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)
EXACT = RenderReport(128, 128, 0.0, True)


def test_stages_go_from_preview_to_exact(editor: Editor, client: FakeClient) -> None:
    client.finish_stage("coarse", exact=False)
    events = editor.tick(0.1)
    kinds = [type(event) for event in events]
    assert kinds.count(LayerRadiance) == 3 and kinds.count(TransportReady) == 1
    assert editor.status.picture == "preview"
    client.finish_stage("final", exact=True)
    editor.tick(0.2)
    assert editor.status.picture == "refining"  # the renderer has not yet said that it shows all coefficients
    editor.controller.rendered(EXACT)
    assert editor.status.picture == "exact"
    assert editor.status.precomputed_mb == 2.0
    assert client.sent(ContractTransport) == []  # all was delivered with the stage


def test_curve_edits_of_the_selected_layer_ask_for_nothing(settled: Editor, client: FakeClient) -> None:
    before = settled.controller.picture.wanted_coefficients("pot.1")["theta_h"]
    settled.controller.rendered(EXACT)
    settled.do(AddOperator("pot.1", "theta_h", LIFT))
    assert settled.status.picture == "refining"
    settled.tick(5.0)
    assert client.requests == []
    raised = settled.controller.picture.wanted_coefficients("pot.1")["theta_h"] - before
    # the bands within [b, c] rise by the magnitude, those well outside [a, d] not at all
    nodes = band_nodes(len(raised))
    full, outside = (nodes >= 0.2) & (nodes <= 0.3), nodes > 0.6
    assert full.any() and np.allclose(raised[full], 1.0, atol=0.01)
    assert outside.any() and np.abs(raised[outside]).max() < 1e-3


def test_switching_the_curve_contracts_the_other(settled: Editor, client: FakeClient) -> None:
    settled.select("pot.1.theta_d")
    settled.tick(1.1)
    (request,) = client.sent(ContractTransport)
    assert (request.layer.key, request.factor) == ("pot.1", "theta_d")
    assert request.layer.factors == ("theta_h", "theta_d")
    settled.controller.rendered(EXACT)
    assert settled.status.picture == "refining"
    client.contract("final")
    events = settled.tick(1.2)
    assert [type(event) for event in events] == [TransportReady]  # the picture is there: its curves are as they were
    settled.tick(1.3)
    settled.controller.rendered(EXACT)
    assert settled.status.picture == "exact"
    assert len(client.sent(ContractTransport)) == 1


def test_another_precision_is_asked_for_at_once(settled: Editor, client: FakeClient) -> None:
    settled.controller.rendered(replace(EXACT, precision="half"))
    assert settled.status.picture == "exact" and settled.status.transport_note == ""
    settled.do(SetView.of(precision="float"))
    settled.tick(1.1)
    (request,) = client.sent(ContractTransport)
    assert (request.layer.key, request.factor, request.precision) == ("pot.1", "theta_h", "float")
    settled.controller.rendered(replace(EXACT, precision="half"))  # the picture stays as it is meanwhile
    assert settled.status.picture == "refining"
    assert settled.status.transport_note == "shown with half floats until full floats are ready"
    client.contract("final")
    events = settled.tick(1.2)
    assert [type(event) for event in events] == [TransportReady]  # the picture is there: its curves are as they were
    settled.tick(1.3)
    settled.controller.rendered(replace(EXACT, precision="float"))
    assert settled.status.picture == "exact" and settled.status.transport_note == ""
    assert len(client.sent(ContractTransport)) == 1


def test_the_transport_that_follows_keeps_the_precision(settled: Editor, client: FakeClient) -> None:
    settled.do(SetView.of(precision="float"))
    settled.tick(1.1)
    client.contract("final")
    settled.do(SetRotation(50.0))
    settled.tick(1.2)
    settled.tick(1.5)
    assert computed(client)[-1].precision == "float"
    client.finish_stage("final", exact=True)
    settled.tick(1.6)
    settled.tick(1.7)
    assert len(client.sent(ContractTransport)) == 1


def test_the_other_curve_is_contracted_again_one_at_a_time(settled: Editor, client: FakeClient) -> None:
    for step in range(5):  # eta drives θ_d, while θ_h is selected
        settled.do(SetParameter("pot.1", "eta", 1.5 + 0.1 * step))
        settled.tick(1.1 + 0.01 * step)
    assert len(client.sent(ContractTransport)) == 1
    client.contract("final")
    settled.tick(1.2)
    requests = client.sent(ContractTransport)
    assert len(requests) == 2 and computed(client) == []
    assert requests[0].picture and requests[1].picture  # another curve makes another picture
    wanted = settled.controller.picture.wanted_coefficients("pot.1")["theta_d"]
    assert np.array_equal(requests[1].layer.coefficients[1], wanted)


def test_answers_for_what_is_no_longer_selected_are_not_shown(settled: Editor, client: FakeClient) -> None:
    settled.select("pot.1.theta_d")
    settled.tick(1.1)
    client.contract("final")
    settled.select("floor.0")
    events = settled.tick(1.2)
    assert TransportReady not in [type(event) for event in events]
    assert [(r.layer.key, r.factor) for r in client.sent(ContractTransport)] == [
        ("pot.1", "theta_d"),
        ("floor.0", "theta_i"),
    ]


def test_roughness_is_requested_when_idle(settled: Editor, client: FakeClient) -> None:
    settled.begin_drag()
    settled.do(SetParameter("pot.1", "alpha", 0.3))
    settled.tick(2.0)
    settled.tick(2.2)
    assert computed(client) == []
    assert "self-shadowing" in settled.status.material_note
    settled.tick(2.26)  # a quarter of a second without a change
    assert len(computed(client)) == 1
    settled.do(SetParameter("pot.1", "alpha", 0.4))
    settled.tick(2.3)
    assert len(computed(client)) == 1
    settled.end_drag()
    settled.tick(2.31)  # let go
    assert len(computed(client)) == 2
    assert settled.status.material_note == ""
    assert computed(client)[-1].scene.layers[1].quotient_parameters[1] == 0.4


def test_undo_of_another_layer_asks_for_its_picture_alone(settled: Editor, client: FakeClient) -> None:
    settled.do(AddOperator("pot.1", "theta_h", LIFT))
    settled.tick(1.05)
    settled.controller.rendered(EXACT)
    settled.select("floor.0")
    settled.tick(1.1)
    client.contract("final")
    settled.tick(1.2)
    client.contract("final")
    settled.tick(1.25)
    client.requests.clear()
    assert settled.undo() == "pot.1 theta_h Translate Y"
    settled.tick(1.3)
    (request,) = client.sent(ContractTransport)
    assert (request.layer.key, request.factor) == ("pot.1", None)  # no transport: nobody selects it
    assert np.array_equal(
        request.layer.coefficients[0], settled.controller.picture.wanted_coefficients("pot.1")["theta_h"]
    )
    client.contract("final")
    events = settled.tick(1.4)
    assert [type(event) for event in events] == [LayerRadiance]
    settled.tick(1.5)
    settled.controller.rendered(EXACT)
    assert settled.status.picture == "exact"
    assert len(client.requests) == 1  # the floor's transport is still there: it is not asked for again


def left(settled: Editor, client: FakeClient) -> list[tuple[str, str | None]]:
    """What is asked for of layers once an edited one, rendered exactly, is left for another."""
    settled.do(AddOperator("pot.1", "theta_h", LIFT))
    settled.tick(2.05)
    settled.controller.rendered(EXACT)
    client.requests.clear()
    settled.select("floor.0")
    for now in (2.1, 2.2, 2.3, 2.4):
        settled.tick(now)
        settled.controller.rendered(EXACT)
        client.contract("final")
    assert settled.status.picture == "exact"
    return [(request.layer.key, request.factor) for request in client.sent(ContractTransport)]


def test_a_layer_summed_in_half_floats_is_asked_for_when_left(settled: Editor, client: FakeClient) -> None:
    # Once: the worker's picture is not off by their rounding. The transport of the curve that is selected goes first.
    assert left(settled, client) == [("floor.0", "theta_i"), ("pot.1", None)]


def test_a_layer_summed_in_full_floats_is_not(settled: Editor, client: FakeClient) -> None:
    settled.do(SetView.of(precision="float"))
    settled.tick(1.1)
    client.contract("final")
    settled.tick(1.2)
    assert left(settled, client) == [("floor.0", "theta_i")]


def test_a_layer_left_in_mid_refinement_is_asked_for(settled: Editor, client: FakeClient) -> None:
    settled.do(AddOperator("pot.1", "theta_h", LIFT))
    settled.select("floor.0")
    settled.tick(1.1)
    client.contract("final")
    settled.tick(1.2)
    assert [request.layer.key for request in client.sent(ContractTransport)] == ["floor.0", "pot.1"]


def test_a_stage_without_the_selected_curve_is_asked_for_it_once(editor: Editor, client: FakeClient) -> None:
    client.finish_stage("coarse", exact=False)
    editor.tick(0.1)
    editor.select("pot.1.theta_d")
    editor.tick(0.2)
    client.contract("coarse")
    editor.tick(0.3)
    assert len(client.sent(ContractTransport)) == 1
    client.finish_stage("final", exact=True)  # brings θ_h, which is no longer selected
    editor.tick(0.4)
    editor.tick(0.5)
    assert [request.factor for request in client.sent(ContractTransport)] == ["theta_d", "theta_d"]
    client.contract("final")
    editor.tick(0.6)
    editor.controller.rendered(EXACT)
    assert editor.status.picture == "exact"


def test_a_stage_that_comes_in_pieces_is_not_asked_for(editor: Editor, client: FakeClient) -> None:
    client.finish_stage("coarse", exact=False)
    editor.tick(0.1)
    (work,) = computed(client)
    layer = work.scene.layers[1]
    client.answer(work, LayerPicture("pot.1", "final", np.zeros((4, 3)), layer.coefficients))
    editor.tick(0.2)  # the transport is still on its way
    client.answer(work, transport("pot.1", "theta_h", "final"))
    editor.tick(0.3)
    assert client.sent(ContractTransport) == []


def test_a_stage_made_with_older_curves_is_put_right(editor: Editor, client: FakeClient) -> None:
    editor.do(SetParameter("pot.1", "eta", 1.9))  # drives θ_d, while the stage is computed with the old one
    editor.tick(0.1)
    client.contract("none")  # the worker had nothing yet, and answers later
    client.finish_stage("final", exact=True)
    editor.tick(0.2)
    assert editor.status.picture == "refining"
    (_, request) = client.sent(ContractTransport)
    assert request.layer.key == "pot.1"
    client.contract("final")
    editor.tick(0.3)
    editor.controller.rendered(EXACT)
    assert editor.status.picture == "exact"


def test_a_new_worker_begins_with_a_preview(editor: Editor, client: FakeClient) -> None:
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    editor.controller.rendered(EXACT)
    assert editor.status.picture == "exact"
    client.answer(OpenScene("shelf"), WorkerRestarted("signal 9"))
    editor.tick(1.5)
    editor.controller.rendered(EXACT)
    assert editor.status.picture == "refining"  # what is on screen is still as it was
    client.finish_stage("coarse", exact=False)
    editor.tick(1.6)
    assert editor.status.picture == "preview"


def test_a_fixed_object_is_asked_for_without_bands(client: FakeClient) -> None:
    scene = {**SCENE, "object": [{**o, "editable": o["name"] != "floor"} for o in SCENE["object"]]}
    editor = Editor(client, "shelf")
    client.open_scene(scene)
    editor.tick(0.0)
    (work,) = computed(client)
    assert [layer.key for layer in work.scene.layers if layer.fixed] == ["floor.0"]
    editor.select("floor.0")
    client.finish_stage("final", exact=True)
    editor.tick(0.1)
    editor.tick(0.2)
    editor.controller.rendered(EXACT)
    assert editor.status.picture == "exact"
    assert client.sent(ContractTransport) == []  # its curves are shown, but there is nothing to bend


def test_making_an_object_editable_keeps_the_picture_and_asks_for_its_bands(
    settled: Editor, client: FakeClient
) -> None:
    settled.do(SetEditable("floor", False))
    settled.tick(1.1)
    settled.tick(1.4)
    client.finish_stage("final", exact=True)
    settled.tick(1.5)
    settled.controller.rendered(EXACT)
    assert settled.status.picture == "exact"
    settled.do(SetEditable("floor", True))
    settled.tick(1.6)
    settled.tick(1.9)
    assert [layer.fixed for layer in computed(client)[-1].scene.layers] == [False, False, False]
    settled.controller.rendered(EXACT)
    # All on screen is final and stays; only the floor's curves cannot be bent yet.
    assert settled.status.picture == "refining" and settled.status.material_note == ""
    assert settled.status.transport_note == "floor.0: shown as before until its bands are ready"
    client.finish_stage("final", exact=True)
    settled.tick(2.0)
    settled.controller.rendered(EXACT)
    assert settled.status.picture == "exact" and settled.status.transport_note == ""


def test_a_fixed_curve_that_changes_is_part_of_its_transport(settled: Editor, client: FakeClient) -> None:
    settled.do(SetEditable("floor", False))
    settled.tick(1.1)
    settled.tick(1.4)
    client.finish_stage("final", exact=True)
    settled.tick(1.5)
    n_before = len(computed(client))
    settled.do(AddOperator("floor.0", "theta_i", LIFT))
    settled.tick(1.6)
    assert settled.status.material_note == "the curve of a fixed object follows when idle"
    settled.tick(1.9)
    (work,) = computed(client)[n_before:]
    assert np.array_equal(
        work.scene.layers[2].coefficients[0], settled.controller.picture.wanted_coefficients("floor.0")["theta_i"]
    )
    assert settled.status.picture == "preview" and client.sent(ContractTransport) == []
