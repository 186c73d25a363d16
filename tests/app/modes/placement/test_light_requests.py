"""What is asked of the worker when the light changes, and which answers count."""

import numpy as np

from app.document.commands.light import SetEnvironment, SetRotation
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.picture_events import SkyChanged
from app.messages.worker_messages import SkyImage
from app.modes.placement.placement_events import LayerRadiance, TransportReady
from app.modes.placement.placement_messages import BouncesPlanned
from app.modes.placement.placement_status import RenderReport
from engine.settings import AS_PLANNED
from tests.app.fake_worker import SCENE, FakeClient, computed

EXACT = RenderReport(128, 128, 0.0, True)
VIEW_ID = 2  # the number of the second request, by which the scene is seen


def test_turning_asks_for_quick_pictures_one_at_a_time(settled: Editor, client: FakeClient) -> None:
    settled.begin_drag()
    for degrees in (31.0, 32.0, 33.0):
        settled.do(SetRotation(degrees))
        settled.tick(2.0 + 0.01 * degrees)
    (quick,) = computed(client)
    assert quick.is_drag and quick.scene.light.rotation == 31.0
    assert settled.status.light_note == "preview for 31.0°, final on release"
    client.finish_stage("drag", exact=True)
    settled.tick(2.4)
    assert [request.scene.light.rotation for request in computed(client)] == [31.0, 33.0]
    assert settled.status.picture == "preview"
    client.finish_stage("drag", exact=True)
    settled.end_drag()
    settled.tick(2.5)
    assert not computed(client)[-1].is_drag and computed(client)[-1].scene.light.rotation == 33.0
    client.finish_stage("final", exact=True)
    settled.tick(3.0)
    settled.controller.rendered(EXACT)
    assert settled.status.picture == "exact" and settled.status.light_note == ""


def test_a_light_that_is_held_still_has_its_quick_picture_before_the_last(settled: Editor, client: FakeClient) -> None:
    """The stages of the last picture take long, and void what is under way: the quick picture of the light as it is
    comes first, and is waited for half a second at most."""
    settled.begin_drag()
    settled.do(SetRotation(31.0))
    settled.tick(2.0)
    settled.do(SetRotation(33.0))
    for now in (2.05, 2.2, 2.35):  # idle for long enough, but the first quick picture is under way
        settled.tick(now)
    assert [request.is_drag for request in computed(client)] == [True]
    client.finish_stage("drag", exact=True)
    for now in (2.4, 2.8):
        settled.tick(now)
    asked = computed(client)
    assert [(request.is_drag, request.scene.light.rotation) for request in asked] == [(True, 31.0), (True, 33.0)]
    settled.tick(2.95)  # the second one has not come
    assert not computed(client)[-1].is_drag and computed(client)[-1].scene.light.rotation == 33.0


def test_while_the_picture_waits_for_the_light_it_is_said_what_it_is_lit_by(
    settled: Editor, client: FakeClient
) -> None:
    settled.do(SetRotation(90.0))
    settled.tick(2.0)
    settled.tick(2.3)
    assert computed(client)[-1].scene.light.rotation == 90.0
    client.finish_stage("coarse", exact=False)  # not as good as what is on screen
    settled.tick(2.4)
    assert settled.status.light_note == "shown for 30.0° until 90.0° is ready"
    client.finish_stage("preview", exact=False)
    settled.tick(2.5)
    assert settled.status.light_note == "the light is being refined"


def test_another_environment_at_the_same_rotation_is_not_refined_before_it_is_shown(
    settled: Editor, client: FakeClient
) -> None:
    settled.do(SetEnvironment("studio"))
    settled.tick(2.0)
    settled.tick(2.3)
    client.finish_stage("coarse", exact=False)  # not as good as what is on screen
    settled.tick(2.4)
    assert settled.controller.picture.document.light.environment == "scene"
    assert settled.status.light_note == "the previous light is shown until this one is ready"
    client.finish_stage("preview", exact=False)
    settled.tick(2.5)
    assert settled.controller.picture.document.light.environment == "studio"
    assert settled.status.light_note == "the light is being refined"


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
    assert editor.status.light_note == "the previous light is shown until this one is ready"


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


def test_bounces_are_as_planned_unless_the_user_chose_meanwhile(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene({key: value for key, value in SCENE.items() if key != "bounces"})
    editor.tick(0.0)
    (request,) = computed(client)
    assert request.settings.n_bounces == AS_PLANNED
    client.answer(request, BouncesPlanned(3, "the last carries 2 %"))
    editor.tick(0.1)
    assert editor.view.settings.n_bounces == 3 and len(computed(client)) == 1  # the worker goes on by itself
    editor.do(SetView.of(n_bounces=1))
    client.answer(request, BouncesPlanned(3, "the last carries 2 %"))
    editor.tick(0.11)
    assert editor.view.settings.n_bounces == 1


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
    assert (
        settled.tick(1.6) == [] and settled.controller.picture.document.light.environment == "scene"
    )  # its pictures are not there yet
    client.finish_stage("drag", exact=True)
    sky, *layers = settled.tick(1.7)
    assert isinstance(sky, SkyChanged) and {type(event) for event in layers} == {LayerRadiance, TransportReady}
    assert (
        all(event.with_next for event in (sky, *layers[:-1]))
        and settled.controller.picture.document is settled.document
    )
