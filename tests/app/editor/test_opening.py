"""Opening scenes: what the worker is asked first, and what is open when one cannot be."""

from pathlib import Path

import pytest

from app.document.commands import EditCommand
from app.document.commands.light import SetRotation
from app.document.commands.maps import SetMap
from app.document.commands.plan import OverrideLine
from app.document.document import Selection
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.picture_events import SceneFrame
from app.messages.worker_messages import OpenScene, RequestFailed, SetCamera
from app.modes.placement.placement_messages import BouncesPlanned, ComputeTransport, FreezeIndirect, SampleMaps
from app.modes.placement.placement_status import RenderReport
from app.modes.placement.transport_controller import N_LIGHTS_PREVIEW
from engine.planner import band_counts
from engine.scene.description import Camera
from tests.app.fake_worker import FakeClient, computed

EXACT = RenderReport(128, 128, 0.0, True)


def test_opening_asks_for_all_layers_at_once(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    assert [type(request) for request in client.requests] == [OpenScene, SetCamera]
    assert editor.status.picture == "waiting"
    client.open_scene()
    events = editor.tick(0.0)
    assert [type(event) for event in events] == [SceneFrame]
    assert editor.view.selected == ("pot", 1, "theta_h")  # the topmost layer of the first editable object
    (work,) = computed(client)
    assert [layer.key for layer in work.scene.layers] == ["pot.0", "pot.1", "floor.0"]  # the lamp shines: no layers
    assert (work.selected, work.factor) == ("pot.1", "theta_h")
    assert (work.n_lights_preview, work.settings.n_lights) == (N_LIGHTS_PREVIEW, 4000)
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


def test_a_scene_that_fails_to_open_leaves_the_one_before(settled: Editor, client: FakeClient) -> None:
    before = settled.document
    settled.open("nowhere.toml")
    client.answer(client.sent(OpenScene)[-1], RequestFailed("nowhere.toml: file = No such file"))
    settled.tick(1.5)
    assert settled.document is before and "nowhere.toml" in settled.status.message
    settled.controller.rendered(EXACT)
    assert settled.status.picture == "exact"
    settled.do(SetRotation(5.0))
    settled.tick(1.6)
    settled.tick(2.0)
    assert len(computed(client)) == 1  # and editing goes on


@pytest.mark.parametrize("what", ["scene", "view"])
def test_what_was_given_up_for_a_scene_or_a_view_that_failed_is_requested_again(
    editor: Editor, client: FakeClient, what: str
) -> None:
    editor.do(SetView.of(n_bounces=3))
    editor.do(SetMap("pot.0", "texture", "oak.png"))
    for now in (1.0, 2.0):
        editor.tick(now)
    client.finish_stage("final", exact=True)
    editor.tick(2.1)
    client.requests.clear()
    if what == "scene":
        editor.open("nowhere.toml")
    else:
        editor.do(SetView.of(camera=Camera(position=(1.0, 1.0, 4.0), target=(0.0, 0.0, 0.0))))
        editor.tick(2.2)
        editor.tick(3.0)
    editor.do(SetMap("pot.1", "texture", "elm.png"))
    editor.do(SetView.of(selected=Selection("floor", 0, "theta_i")))
    for now in (3.1, 13.0):
        editor.tick(now)
    assert not client.sent(SampleMaps) and not client.sent(FreezeIndirect)  # the worker would drop them
    client.answer(client.sent(OpenScene if what == "scene" else SetCamera)[-1], RequestFailed("no"))
    editor.tick(13.1)
    (sampling,), (freezing,) = client.sent(SampleMaps), client.sent(FreezeIndirect)
    assert [key for key, _ in sampling.layers] == ["pot.0", "pot.1"] and freezing.key == "floor.0"
    editor.tick(13.2)
    assert len(client.sent(SampleMaps)) == len(client.sent(FreezeIndirect)) == 1


@pytest.mark.parametrize("command", [SetView.of(n_edge_rays=4), OverrideLine("edges", 4)], ids=["view", "override"])
def test_a_session_with_another_number_of_edge_rays_is_traced_once(
    client: FakeClient, tmp_path: Path, command: EditCommand | SetView
) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    editor.do(command)
    assert editor.save(tmp_path / "four.insitu") is None
    client = FakeClient()
    editor = Editor(client, str(tmp_path / "four.insitu"))
    client.open_scene()
    for now in (0.0, 1.0, 2.0):
        editor.tick(now)
    assert editor.scene_is_open and [request.n_edge_rays for request in client.sent(SetCamera)] == [4]


def test_where_a_scene_cannot_be_opened_the_default_one_is(client: FakeClient) -> None:
    editor = Editor(client, "/broken.toml")
    client.answer(client.sent(OpenScene)[-1], RequestFailed("/broken.toml: version = nothing, expected 1"))
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
        client.answer(client.sent(OpenScene)[-1], RequestFailed("out of memory"))
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
    client.answer(asked, RequestFailed("sky.exr: first bytes = nothing"))
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
    said = "4 bounces carry 34 % of the light, the rest is missing"
    assert [layer.key for layer in request.scene.visible] == ["pot.0", "pot.1", "floor.0"]
    client.answer(request, BouncesPlanned(4, "", said))
    editor.tick(3.1)
    assert editor.status.bounces_note == editor.status.message == said
    editor.do(SetView.of(n_bounces=1))
    assert editor.status.bounces_note == ""  # who asks for direct light alone knows what is missing
