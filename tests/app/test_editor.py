"""The editor's decisions: what it asks of the worker, when, what it tells the renderer, and what it says about it."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.commands.curves import AddOperator
from app.commands.layers import SetEditable, SetParameter, SetVisible
from app.commands.light import SetEnvironment, SetIntensity, SetRotation
from app.editor import Editor
from app.messages import Cancel, Failed, LookFrom, OpenScene, Progress, SkyImage, WorkerRestarted
from app.picture import SceneFrame, SkyChanged
from app.placement.events import LayerRadiance, TransportReady
from app.placement.messages import BouncesPlanned, ComputeTransport, Contract, LayerPicture
from app.placement.status import RenderReport
from app.placement.transport_talk import DRAG_QUALITY, N_LIGHTS_PREVIEW
from app.view_state import AS_PLANNED, SetView
from engine.curve.bands import band_nodes
from engine.curve.operators import Operator
from engine.plan import band_counts
from tests.app.fake_worker import SCENE, FakeClient, transport

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)
EXACT = RenderReport(128, 128, 0.0, True)
VIEW_ID = 2  # the number of the second request, by which the scene is seen


@pytest.fixture
def editor(client: FakeClient) -> Editor:
    """An editor at time 0 with its scene open and its first transport asked for."""
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    return editor


@pytest.fixture
def settled(editor: Editor, client: FakeClient) -> Editor:
    """The editor at time 1 with all of the final picture delivered."""
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    client.requests.clear()
    return editor


def computed(client: FakeClient) -> list[ComputeTransport]:
    return client.sent(ComputeTransport)


def test_opening_asks_for_all_layers_at_once(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    assert [type(request) for request in client.requests] == [OpenScene, LookFrom]
    assert editor.status.picture == "waiting"
    client.open_scene()
    events = editor.tick(0.0)
    assert [type(event) for event in events] == [SceneFrame]
    assert editor.view.selected == ("pot", 1, "theta_h")  # the topmost layer of the first editable object
    (work,) = computed(client)
    assert [layer.key for layer in work.scene.layers] == ["pot.0", "pot.1", "floor.0"]  # the lamp shines: no layers
    assert (work.selected, work.factor) == ("pot.1", "theta_h")
    assert (work.n_lights_preview, work.n_lights_final) == (N_LIGHTS_PREVIEW, 4000)
    assert work.scene.light.rotation == 30.0
    counts = tuple(band_counts(editor.document.layer("pot.1")).values())
    assert work.scene.layers[1].bands == counts
    assert [c.shape for c in work.scene.layers[1].coefficients] == [(n, 3) for n in counts]


def test_the_workers_plan_of_a_scene_is_taken_over(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene(bands={"pot.1": {"theta_h": 16, "theta_d": 4}})
    for now in (0.0, 0.1):
        editor.tick(now)
    (work,) = computed(client)
    assert [layer.bands for layer in work.scene.layers][1] == (16, 4)
    # Nobody planned it, and it was asked for apart.
    assert work.scene.layers[0].bands == tuple(band_counts(editor.document.layer("pot.0")).values())


def test_each_scene_is_planned_anew(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene(bands={"pot.1": {"theta_h": 16, "theta_d": 4}})
    editor.tick(0.0)
    editor.open("shelf")  # with the same objects and models
    client.open_scene()
    editor.tick(1.0)
    assert computed(client)[-1].scene.layers[1].bands == tuple(band_counts(editor.document.layer("pot.1")).values())


def test_stages_go_from_preview_to_exact(editor: Editor, client: FakeClient) -> None:
    client.finish_stage("coarse", exact=False)
    events = editor.tick(0.1)
    kinds = [type(event) for event in events]
    assert kinds.count(LayerRadiance) == 3 and kinds.count(TransportReady) == 1
    assert editor.status.picture == "preview"
    client.finish_stage("final", exact=True)
    editor.tick(0.2)
    assert editor.status.picture == "refining"  # the renderer has not yet said that it shows all coefficients
    editor.talk.rendered(EXACT)
    assert editor.status.picture == "exact"
    assert editor.status.precomputed_mb == 2.0
    assert client.sent(Contract) == []  # all was delivered with the stage


def test_curve_edits_of_the_selected_layer_ask_for_nothing(settled: Editor, client: FakeClient) -> None:
    before = settled.talk.wanted_coefficients("pot.1")["theta_h"]
    settled.talk.rendered(EXACT)
    settled.do(AddOperator("pot.1", "theta_h", LIFT))
    assert settled.status.picture == "refining"
    settled.tick(5.0)
    assert client.requests == []
    raised = settled.talk.wanted_coefficients("pot.1")["theta_h"] - before
    # the bands within [b, c] rise by the magnitude, those well outside [a, d] not at all
    nodes = band_nodes(len(raised))
    full, outside = (nodes >= 0.2) & (nodes <= 0.3), nodes > 0.6
    assert full.any() and np.allclose(raised[full], 1.0, atol=0.01)
    assert outside.any() and np.abs(raised[outside]).max() < 1e-3


def test_coefficients_are_computed_once(settled: Editor) -> None:
    first = settled.talk.wanted_coefficients("pot.1")
    settled.do(SetParameter("pot.1", "scale", 2.0))
    again = settled.talk.wanted_coefficients("pot.1")
    assert all(again[name] is first[name] for name in first)  # the scale is in no curve
    assert settled.talk.layer_gain("pot.1").tolist() == [2.0, 2.0, 2.0]
    assert not first["theta_h"].flags.writeable


def test_switching_the_curve_contracts_the_other(settled: Editor, client: FakeClient) -> None:
    settled.select("pot.1.theta_d")
    settled.tick(1.1)
    (request,) = client.sent(Contract)
    assert (request.layer.key, request.factor) == ("pot.1", "theta_d")
    assert request.layer.factors == ("theta_h", "theta_d")
    settled.talk.rendered(EXACT)
    assert settled.status.picture == "refining"
    client.contract("final")
    events = settled.tick(1.2)
    assert [type(event) for event in events] == [TransportReady]  # the picture is there: its curves are as they were
    settled.tick(1.3)
    settled.talk.rendered(EXACT)
    assert settled.status.picture == "exact"
    assert len(client.sent(Contract)) == 1


def test_another_precision_is_asked_for_at_once(settled: Editor, client: FakeClient) -> None:
    settled.talk.rendered(replace(EXACT, precision="half"))
    assert settled.status.picture == "exact" and settled.status.transport_note == ""
    settled.do(SetView.of(precision="float"))
    settled.tick(1.1)
    (request,) = client.sent(Contract)
    assert (request.layer.key, request.factor, request.precision) == ("pot.1", "theta_h", "float")
    settled.talk.rendered(replace(EXACT, precision="half"))  # the picture stays as it is meanwhile
    assert settled.status.picture == "refining"
    assert settled.status.transport_note == "made with half floats until full floats are here"
    client.contract("final")
    events = settled.tick(1.2)
    assert [type(event) for event in events] == [TransportReady]  # the picture is there: its curves are as they were
    settled.tick(1.3)
    settled.talk.rendered(replace(EXACT, precision="float"))
    assert settled.status.picture == "exact" and settled.status.transport_note == ""
    assert len(client.sent(Contract)) == 1


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
    assert len(client.sent(Contract)) == 1


def test_the_other_curve_is_contracted_again_one_at_a_time(settled: Editor, client: FakeClient) -> None:
    for step in range(5):  # eta drives θ_d, while θ_h is selected
        settled.do(SetParameter("pot.1", "eta", 1.5 + 0.1 * step))
        settled.tick(1.1 + 0.01 * step)
    assert len(client.sent(Contract)) == 1
    client.contract("final")
    settled.tick(1.2)
    requests = client.sent(Contract)
    assert len(requests) == 2 and computed(client) == []
    assert requests[0].picture and requests[1].picture  # another curve makes another picture
    wanted = settled.talk.wanted_coefficients("pot.1")["theta_d"]
    assert np.array_equal(requests[1].layer.coefficients[1], wanted)


def test_answers_for_what_is_no_longer_selected_are_not_shown(settled: Editor, client: FakeClient) -> None:
    settled.select("pot.1.theta_d")
    settled.tick(1.1)
    client.contract("final")
    settled.select("floor.0")
    events = settled.tick(1.2)
    assert TransportReady not in [type(event) for event in events]
    assert [(r.layer.key, r.factor) for r in client.sent(Contract)] == [("pot.1", "theta_d"), ("floor.0", "theta_i")]


def test_roughness_is_asked_for_when_the_hand_rests(settled: Editor, client: FakeClient) -> None:
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


def test_turning_asks_for_quick_pictures_one_at_a_time(settled: Editor, client: FakeClient) -> None:
    settled.begin_drag()
    for degrees in (31.0, 32.0, 33.0):
        settled.do(SetRotation(degrees))
        settled.tick(2.0 + 0.01 * degrees)
    (quick,) = computed(client)
    assert quick.n_lights_final == DRAG_QUALITY and quick.scene.light.rotation == 31.0
    assert settled.status.light_note == "quick picture for 31.0°, final on release"
    client.finish_stage("drag", exact=True)
    settled.tick(2.4)
    assert [request.scene.light.rotation for request in computed(client)] == [31.0, 33.0]
    assert settled.status.picture == "preview"
    client.finish_stage("drag", exact=True)
    settled.end_drag()
    settled.tick(2.5)
    assert computed(client)[-1].n_lights_final == 4000 and computed(client)[-1].scene.light.rotation == 33.0
    client.finish_stage("final", exact=True)
    settled.tick(3.0)
    settled.talk.rendered(EXACT)
    assert settled.status.picture == "exact" and settled.status.light_note == ""


def test_where_no_environment_lights_the_scene_nothing_is_said_of_its_rotation(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene({name: value for name, value in SCENE.items() if name != "environment"})
    editor.tick(0.0)
    editor.tick(0.5)
    client.finish_stage("coarse", exact=False)
    editor.tick(1.0)
    assert editor.status.picture == "preview" and editor.status.light_note == ""
    editor.do(SetEnvironment("studio"))
    editor.tick(2.0)
    editor.tick(2.5)
    assert editor.status.light_note == "being refined for 0.0°"


def test_answers_to_an_older_light_are_dropped(settled: Editor, client: FakeClient) -> None:
    settled.do(SetRotation(90.0))
    settled.tick(2.0)
    settled.tick(2.3)
    older = computed(client)[-1]
    settled.do(SetRotation(180.0))
    settled.tick(2.4)
    settled.tick(2.7)
    client.requests.append(older)  # the older request is answered after the newer was sent
    client.finish_stage("coarse", exact=False)
    assert settled.tick(2.8) == []


def test_bounces_are_as_planned_unless_a_person_chose_meanwhile(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene({key: value for key, value in SCENE.items() if key != "bounces"})
    editor.tick(0.0)
    (request,) = computed(client)
    assert request.n_bounces == AS_PLANNED
    client.answer(request, BouncesPlanned(3, "the last carries 2 %"))
    editor.tick(0.1)
    assert editor.view.n_bounces == 3 and len(computed(client)) == 1  # the worker goes on by itself
    editor.do(SetView.of(n_bounces=1))
    client.answer(request, BouncesPlanned(3, "the last carries 2 %"))
    editor.tick(0.11)
    assert editor.view.n_bounces == 1


def test_undo_of_another_layer_asks_for_its_picture_alone(settled: Editor, client: FakeClient) -> None:
    settled.do(AddOperator("pot.1", "theta_h", LIFT))
    settled.talk.rendered(EXACT)
    settled.select("floor.0")
    settled.tick(1.1)
    client.contract("final")
    settled.tick(1.2)
    client.requests.clear()
    assert settled.undo() == "pot.1 theta_h Translate Y"
    settled.tick(1.3)
    (request,) = client.sent(Contract)
    assert (request.layer.key, request.factor) == ("pot.1", None)  # no transport: nobody selects it
    assert np.array_equal(request.layer.coefficients[0], settled.talk.wanted_coefficients("pot.1")["theta_h"])
    client.contract("final")
    events = settled.tick(1.4)
    assert [type(event) for event in events] == [LayerRadiance]
    settled.tick(1.5)
    settled.talk.rendered(EXACT)
    assert settled.status.picture == "exact"
    assert len(client.requests) == 1  # the floor's transport is still there: it is not asked for again


def test_a_layer_rendered_exactly_is_not_asked_for_when_left(settled: Editor, client: FakeClient) -> None:
    settled.do(AddOperator("pot.1", "theta_h", LIFT))
    settled.talk.rendered(EXACT)
    settled.select("floor.0")
    settled.tick(1.1)
    client.contract("final")
    settled.tick(1.2)
    settled.tick(1.3)
    assert [request.layer.key for request in client.sent(Contract)] == ["floor.0"]


def test_a_layer_left_in_mid_refinement_is_asked_for(settled: Editor, client: FakeClient) -> None:
    settled.do(AddOperator("pot.1", "theta_h", LIFT))
    settled.select("floor.0")
    settled.tick(1.1)
    client.contract("final")
    settled.tick(1.2)
    assert [request.layer.key for request in client.sent(Contract)] == ["floor.0", "pot.1"]


def test_visibility_and_intensity_cost_nothing(settled: Editor, client: FakeClient) -> None:
    settled.do(SetVisible("pot.0", False))
    settled.do(SetIntensity(3.0))
    settled.tick(9.0)
    settled.tick(10.0)
    assert client.requests == []


def test_view_factors_are_applied_in_image_space(settled: Editor, client: FakeClient) -> None:
    settled.select("floor.0.theta_o")
    settled.do(AddOperator("floor.0", "theta_o", LIFT))
    settled.tick(1.1)
    assert client.requests == []
    curve = settled.talk.view_curve("floor.0")
    assert curve.shape == (256, 3) and curve[-1].tolist() == [1.0, 1.0, 1.0]
    angle = np.linspace(0.0, np.pi / 2, 256)
    assert np.allclose(curve[(angle > 0.2) & (angle < 0.3)], 2.0)  # 1 as generated, lifted by 1


def test_a_stage_without_the_selected_curve_is_asked_for_it_once(editor: Editor, client: FakeClient) -> None:
    client.finish_stage("coarse", exact=False)
    editor.tick(0.1)
    editor.select("pot.1.theta_d")
    editor.tick(0.2)
    client.contract("coarse")
    editor.tick(0.3)
    assert len(client.sent(Contract)) == 1
    client.finish_stage("final", exact=True)  # brings θ_h, which is no longer selected
    editor.tick(0.4)
    editor.tick(0.5)
    assert [request.factor for request in client.sent(Contract)] == ["theta_d", "theta_d"]
    client.contract("final")
    editor.tick(0.6)
    editor.talk.rendered(EXACT)
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
    assert client.sent(Contract) == []


def test_a_stage_made_with_older_curves_is_put_right(editor: Editor, client: FakeClient) -> None:
    editor.do(SetParameter("pot.1", "eta", 1.9))  # drives θ_d, while the stage is computed with the old one
    editor.tick(0.1)
    client.contract("none")  # the worker had nothing yet, and answers later
    client.finish_stage("final", exact=True)
    editor.tick(0.2)
    assert editor.status.picture == "refining"
    (_, request) = client.sent(Contract)
    assert request.layer.key == "pot.1"
    client.contract("final")
    editor.tick(0.3)
    editor.talk.rendered(EXACT)
    assert editor.status.picture == "exact"


def test_a_new_worker_begins_with_a_preview(editor: Editor, client: FakeClient) -> None:
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    editor.talk.rendered(EXACT)
    assert editor.status.picture == "exact"
    client.answer(OpenScene("shelf"), WorkerRestarted("signal 9"))
    editor.tick(1.5)
    editor.talk.rendered(EXACT)
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
    editor.talk.rendered(EXACT)
    assert editor.status.picture == "exact"
    assert client.sent(Contract) == []  # its curves are shown, but there is nothing to bend


def test_making_an_object_editable_keeps_the_picture_and_asks_for_its_bands(
    settled: Editor, client: FakeClient
) -> None:
    settled.do(SetEditable("floor", False))
    settled.tick(1.1)
    settled.tick(1.4)
    client.finish_stage("final", exact=True)
    settled.tick(1.5)
    settled.talk.rendered(EXACT)
    assert settled.status.picture == "exact"
    settled.do(SetEditable("floor", True))
    settled.tick(1.6)
    settled.tick(1.9)
    assert [layer.fixed for layer in computed(client)[-1].scene.layers] == [False, False, False]
    settled.talk.rendered(EXACT)
    # All on screen is final and stays; only the floor's curves cannot be bent yet.
    assert settled.status.picture == "refining" and settled.status.material_note == ""
    assert settled.status.transport_note == "floor.0: shown as it was until its bands are here"
    client.finish_stage("final", exact=True)
    settled.tick(2.0)
    settled.talk.rendered(EXACT)
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
    assert settled.status.material_note == "the curve of a fixed object follows when the hand rests"
    settled.tick(1.9)
    (work,) = computed(client)[n_before:]
    assert np.array_equal(work.scene.layers[2].coefficients[0], settled.talk.wanted_coefficients("floor.0")["theta_i"])
    assert settled.status.picture == "preview" and client.sent(Contract) == []


def test_the_sky_is_handed_on(editor: Editor, client: FakeClient) -> None:
    client.answer(computed(client)[0], SkyImage(np.ones((2, 4, 3)), ("3 negative pixels set to 0",), id=VIEW_ID))
    (event,) = editor.tick(0.1)
    assert isinstance(event, SkyChanged) and event.radiance.shape == (2, 4, 3)
    assert editor.status.notes == ("a note", "3 negative pixels set to 0")


def test_the_sky_is_handed_on_though_the_light_was_turned_meanwhile(settled: Editor, client: FakeClient) -> None:
    settled.do(SetEnvironment("studio"))
    settled.tick(1.1)
    settled.tick(1.4)
    (under_way,) = computed(client)
    settled.begin_drag()
    settled.do(SetRotation(50.0))
    settled.tick(1.5)
    assert len(computed(client)) == 2  # the worker says what sky it is once, under the first of both
    client.answer(under_way, SkyImage(np.ones((2, 4, 3)), id=VIEW_ID))
    assert [type(event) for event in settled.tick(1.6)] == [SkyChanged]


def test_a_crash_is_told_and_loses_nothing(settled: Editor, client: FakeClient) -> None:
    settled.do(SetParameter("pot.1", "scale", 2.0))
    before = settled.document
    client.answer(OpenScene("shelf"), WorkerRestarted("signal 9"))
    settled.tick(1.5)
    assert settled.document is before
    assert "signal 9" in settled.status.message and settled.status.is_error


def test_a_scene_that_fails_to_open_leaves_the_one_before(settled: Editor, client: FakeClient) -> None:
    before = settled.document
    settled.open("nowhere.toml")
    client.answer(client.sent(OpenScene)[-1], Failed("nowhere.toml: file = No such file"))
    settled.tick(1.5)
    assert settled.document is before and "nowhere.toml" in settled.status.message
    settled.talk.rendered(EXACT)
    assert settled.status.picture == "exact"
    settled.do(SetRotation(5.0))
    settled.tick(1.6)
    settled.tick(2.0)
    assert len(computed(client)) == 1  # and editing goes on


def test_work_can_be_stopped_and_resumed(editor: Editor, client: FakeClient) -> None:
    client.finish_stage("coarse", exact=False)
    editor.tick(0.1)
    editor.cancel_work()
    editor.tick(1.0)
    assert isinstance(client.requests[-1], Cancel) and editor.status.picture == "preview"
    (stopped,) = computed(client)
    client.answer(stopped, Progress("transport", 0.5))
    editor.tick(1.05)
    assert editor.status.stopped and not editor.status.stage  # it was on its way
    editor.resume_work()
    client.answer(stopped, LayerPicture("floor.0", "coarse", np.zeros((4, 3)), stopped.scene.layers[2].coefficients))
    assert editor.tick(1.1) == []  # it was on its way when the work was stopped
    assert isinstance(client.requests[-1], ComputeTransport) and not editor.status.stopped


def test_another_light_goes_on_where_work_was_stopped(editor: Editor, client: FakeClient) -> None:
    editor.cancel_work()
    editor.tick(0.1)
    assert editor.status.stopped and len(computed(client)) == 1
    editor.do(SetRotation(5.0))
    editor.tick(1.0)
    editor.tick(2.0)
    assert not editor.status.stopped and len(computed(client)) == 2


def test_more_bounces_go_on_where_work_was_stopped(editor: Editor, client: FakeClient) -> None:
    editor.cancel_work()
    editor.tick(0.1)
    editor.do(SetView.of(n_bounces=4))
    editor.tick(1.0)
    editor.tick(2.0)
    assert not editor.status.stopped and computed(client)[-1].n_bounces == 4


def test_stopping_what_the_picture_does_not_need_leaves_nothing_to_resume(settled: Editor, client: FakeClient) -> None:
    settled.talk.rendered(EXACT)
    settled.cancel_work()
    settled.tick(1.1)
    assert settled.status.picture == "exact" and not settled.status.stopped


def test_a_first_scene_that_was_stopped_is_opened_by_resuming(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    editor.cancel_work()
    editor.tick(0.0)
    assert editor.status.stopped and not editor.scene_is_open
    editor.resume_work()
    assert [request.source for request in client.sent(OpenScene)] == ["shelf", "shelf"]


def test_refusals_are_lines_and_change_nothing(settled: Editor) -> None:
    before = settled.document
    for command in (SetParameter("pot.1", "alpha", 7.0), SetParameter("pot.9", "alpha", 0.1), SetIntensity(np.nan)):
        line = settled.do(command)
        assert line and "\n" not in line and settled.status.message == line
    assert settled.select("pot.1.theta_x") is not None
    assert settled.document is before and settled.undo() is None


def test_a_drag_is_one_step(settled: Editor) -> None:
    before = settled.document
    settled.begin_drag()
    for degrees in range(31, 61):
        settled.do(SetRotation(float(degrees)))
    settled.end_drag()
    assert settled.document.light.rotation == 60.0
    assert settled.undo() == "rotate the environment"
    assert settled.document is before  # the very value: bit by bit
    assert settled.redo() == "rotate the environment"
    assert settled.document.light.rotation == 60.0


def test_where_a_scene_cannot_be_opened_the_default_one_is(client: FakeClient) -> None:
    editor = Editor(client, "/broken.toml")
    client.answer(client.sent(OpenScene)[-1], Failed("/broken.toml: version = nothing, expected 1"))
    editor.tick(0.0)
    assert editor.status.is_error and not editor.scene_is_open  # a script ends here, with these words
    assert [request.source for request in client.sent(OpenScene)] == ["/broken.toml", "teatray"]
    client.open_scene()
    editor.tick(0.1)
    assert editor.scene_is_open and editor.document.source == "teatray" and editor.status.is_error
    why = "/broken.toml: version = nothing, expected 1"
    assert editor.status.message.startswith(f"{why} - the built-in teatray is open instead")


def test_the_default_scene_is_not_tried_for_ever(client: FakeClient) -> None:
    editor = Editor(client, "/broken.toml")
    for now in (0.0, 0.1, 0.2):
        client.answer(client.sent(OpenScene)[-1], Failed("out of memory"))
        editor.tick(now)
    assert len(client.sent(OpenScene)) == 2
    assert editor.open("/other.toml") is None and len(client.sent(OpenScene)) == 3  # what a person opens is tried


def test_what_cannot_be_opened_leaves_the_open_scene(settled: Editor, client: FakeClient, tmp_path: Path) -> None:
    before = settled.document
    (tmp_path / "toy.fbx").write_bytes(b"")
    assert "no file that is known" in (settled.open(str(tmp_path / "toy.fbx")) or "")
    assert settled.document is before and client.sent(OpenScene) == []


def test_a_file_that_is_no_scene_opens_the_default_one(client: FakeClient, tmp_path: Path) -> None:
    (tmp_path / "toy.fbx").write_bytes(b"")
    editor = Editor(client, str(tmp_path / "toy.fbx"))
    assert editor.status.is_error and "toy.fbx: no file that is known" in editor.status.message
    assert [request.source for request in client.sent(OpenScene)] == ["teatray"]


def test_light_is_opened_with_the_default_scene(client: FakeClient, tmp_path: Path) -> None:
    editor = Editor(client, str(tmp_path / "sky.exr"))
    assert [request.source for request in client.sent(OpenScene)] == ["teatray"]
    client.open_scene()
    editor.tick(0.0)
    (asked,) = computed(client)  # the scene's own light is never computed
    assert asked.scene.light.environment == str(tmp_path / "sky.exr")
    client.answer(asked, Failed("sky.exr: first bytes = nothing"))
    editor.tick(0.1)
    assert editor.document.light.environment == "scene" and not editor.history.undo_steps
    assert editor.status.message == "sky.exr: first bytes = nothing"


def test_notes_on_a_scene_are_said_when_it_opens(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    assert editor.status.message == "opened shelf; a note"


def test_light_that_bounces_leave_out_is_said(editor: Editor, client: FakeClient) -> None:
    editor.do(SetView.of(n_bounces=4))
    for now in (2.0, 3.0):  # the choice, and that it stands
        editor.tick(now)
    request: ComputeTransport = computed(client)[-1]
    said = "4 bounces keep 34 % of the light, the rest is missing"
    assert [layer.key for layer in request.scene.visible] == ["pot.0", "pot.1", "floor.0"]
    client.answer(request, BouncesPlanned(4, "", said))
    editor.tick(3.1)
    assert editor.status.bounces_note == editor.status.message == said
    editor.do(SetView.of(n_bounces=1))
    assert editor.status.bounces_note == ""  # who asks for direct light alone knows what is missing
