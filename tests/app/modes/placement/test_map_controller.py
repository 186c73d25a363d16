"""What the editor asks of the worker about images, what the renderer is told, and what a refused image does."""

from typing import Any

import numpy as np
import pytest

from app.document.commands.maps import BlendByMap, Paint, SetMap
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import WorkerRestarted
from app.modes.placement.placement_events import ComparisonRefined, LayerMapsChanged
from app.modes.placement.placement_messages import ComputeTransport, MapsRefused, MapsSampled, SampleMaps
from engine.material.layer_maps import Images, MapMeans
from engine.material.strokes import make_stroke, pack_dabs
from tests.app.fake_worker import SCENE, FakeClient
from tests.app.modes.placement.test_comparison import EXACT, remember

OAK, ELM = SetMap("pot.0", "texture", "oak.png"), SetMap("pot.0", "texture", "elm.png")
MEANS = MapMeans((0.5, 0.25, 1.0), 1.0, (0.5, 0.25, 1.0))


@pytest.fixture
def editor(client: FakeClient) -> Editor:
    editor = Editor(client, "shelf")
    client.open_scene()
    ticks(editor)
    client.finish_stage("final", exact=True)
    ticks(editor)
    editor.controller.rendered(EXACT)
    return editor


def ticks(editor: Editor) -> list[LayerMapsChanged]:
    """What a tick tells of images."""
    return [event for event in editor.tick(0.1) if isinstance(event, LayerMapsChanged)]


def sample(editor: Editor, client: FakeClient, level: float = 0.5) -> list[LayerMapsChanged]:
    """The worker answers what was asked last; what is told then."""
    request: SampleMaps = client.sent(SampleMaps)[-1]
    for key, images in request.layers:
        client.answer(request, MapsSampled(key, images, np.full((4, 4), level, np.float16), MEANS, {}))
    return ticks(editor)


def test_a_scene_without_images_asks_for_none(editor: Editor, client: FakeClient) -> None:
    assert client.sent(SampleMaps) == [] and editor.status.picture == "exact"


def test_samples_come_once_for_a_file_and_numbers_need_none(editor: Editor, client: FakeClient) -> None:
    n_transports = len(client.sent(ComputeTransport))
    assert editor.do(OAK) is None
    assert ticks(editor) == [] and editor.status.picture != "exact"
    (request,) = client.sent(SampleMaps)
    assert request.layers == (("pot.0", Images("oak.png")),)
    (event,) = sample(editor, client)
    assert event.key == "pot.0" and (event.samples == 0.5).all() and not event.has_weight
    editor.controller.rendered(EXACT)
    assert editor.status.picture == "exact"
    editor.do(SetMap("pot.0", "texture_strength", 0.25))
    editor.do(SetMap("pot.0", "weight_invert", True))
    assert ticks(editor) == [] and len(client.sent(SampleMaps)) == 1
    assert len(client.sent(ComputeTransport)) == n_transports  # transport knows nothing of images


def test_the_old_image_stays_until_the_new_is_here_and_undo_needs_nobody(editor: Editor, client: FakeClient) -> None:
    editor.do(OAK)
    ticks(editor)
    sample(editor, client, 0.25)
    editor.do(ELM)
    assert ticks(editor) == []
    (event,) = sample(editor, client, 0.75)
    assert (event.samples == 0.75).all()
    editor.undo()
    (event,) = ticks(editor)
    assert (event.samples == 0.25).all() and len(client.sent(SampleMaps)) == 2
    editor.undo()
    (event,) = ticks(editor)
    assert event.samples is None


def test_the_mean_reaches_indirect_light(editor: Editor, client: FakeClient) -> None:
    editor.do(OAK)
    ticks(editor)
    plain = editor.controller.curves.outgoing_gain(editor.document, "pot.0")
    sample(editor, client)
    curves, document = editor.controller.curves, editor.document
    np.testing.assert_allclose(curves.outgoing_gain(document, "pot.0"), plain * [0.5, 0.25, 1.0])
    np.testing.assert_array_equal(curves.gain(document, "pot.0"), plain)  # to the eye the image itself counts
    editor.do(SetMap("pot.0", "texture_strength", 0.5))
    np.testing.assert_allclose(curves.outgoing_gain(editor.document, "pot.0"), plain * [0.75, 0.625, 1.0])


def refuse(editor: Editor, client: FakeClient) -> None:
    request: SampleMaps = client.sent(SampleMaps)[-1]
    (key, images) = request.layers[0]
    client.answer(request, MapsRefused(key, images, "oak.png: image size = 13000 x 13000; nothing was changed"))
    ticks(editor)


def test_an_image_that_cannot_be_used_leaves_the_document_again(editor: Editor, client: FakeClient) -> None:
    before = editor.document
    editor.do(OAK)
    ticks(editor)
    refuse(editor, client)
    assert editor.document == before and editor.history.undo_label is None
    assert editor.status.is_error and "13000" in editor.status.message
    assert ticks(editor) == []
    editor.controller.rendered(EXACT)
    assert editor.status.picture == "exact"


def test_one_that_was_edited_on_stays_and_is_reported(editor: Editor, client: FakeClient) -> None:
    editor.do(OAK)
    ticks(editor)
    editor.do(SetMap("pot.0", "texture_strength", 0.5))
    refuse(editor, client)
    maps = editor.document.layer("pot.0").maps
    assert maps.texture == "oak.png" and "13000" in str(editor.controller.maps.refusal("pot.0", maps))
    ticks(editor)
    assert len(client.sent(SampleMaps)) == 1 and editor.controller.maps.is_complete  # nobody asks for it again


def test_files_that_were_painted_on_are_sampled_again(editor: Editor, client: FakeClient) -> None:
    editor.do(OAK)
    ticks(editor)
    sample(editor, client, 0.25)
    editor.controller.rendered(EXACT)
    editor.reload_images("pot.0")
    assert ticks(editor) == [] and editor.status.picture != "exact"  # the old one is shown meanwhile
    assert [request.layers for request in client.sent(SampleMaps)] == 2 * [(("pot.0", Images("oak.png")),)]
    (event,) = sample(editor, client, 0.75)
    assert (event.samples == 0.75).all()


def test_layers_that_are_painted_together_change_together(editor: Editor, client: FakeClient) -> None:
    # The metal takes the base's place: while one of them alone has changed, there is neither, or both.
    editor.do(SetMap("pot.1", "weight_start", 0.0))
    editor.do(BlendByMap("pot.1", "pot.0"))
    editor.do(SetMap("pot.0", "texture", "oak.png"))
    for begins, x in ((True, 0.0), (False, 0.1)):
        stroke = make_stroke(0.1, 1.0, 1.0, 0.5, pack_dabs([[x, 0, 0]], [[0, 1, 0]]))
        editor.do(Paint("pot.1", stroke, begins))
        ticks(editor)
        request: SampleMaps = client.sent(SampleMaps)[-1]
        (first, its_images), (second, others) = request.layers
        assert {first, second} == {"pot.0", "pot.1"}
        client.answer(request, MapsSampled(first, its_images, np.ones((4, 4), np.float16), MEANS, {}))
        assert ticks(editor) == []
        client.answer(request, MapsSampled(second, others, np.ones((4, 4), np.float16), MEANS, {}))
        events = ticks(editor)
        assert {event.key for event in events} == {"pot.0", "pot.1"}
        assert [event.with_next for event in events] == [True, False]  # in one frame


def test_a_new_worker_is_not_asked_twice(editor: Editor, client: FakeClient) -> None:
    # The client itself gives a new worker what stands; the answer to that is as good.
    editor.do(OAK)
    ticks(editor)
    client.answer(client.sent(SampleMaps)[-1], WorkerRestarted("signal 9"))
    ticks(editor)
    assert len(client.sent(SampleMaps)) == 1
    assert len(sample(editor, client)) == 1


def test_a_scene_that_names_images_asks_for_them_at_once(client: FakeClient) -> None:
    pot, *others = SCENE["object"]
    base, metal = pot["layer"]
    textured: dict[str, Any] = {**pot, "layer": [{**base, "texture": "oak.png"}, {**metal, "weight": "mask.png"}]}
    editor = Editor(client, "shelf")
    client.open_scene({**SCENE, "object": [textured, *others]})
    ticks(editor)
    (request,) = client.sent(SampleMaps)
    assert request.layers == (("pot.0", Images("oak.png")), ("pot.1", Images(weight="mask.png")))
    assert [event.has_weight for event in sample(editor, client)] == [False, True]


def test_what_is_under_way_is_not_asked_for_again_when_a_part_of_it_has_come(client: FakeClient) -> None:
    pot, *others = SCENE["object"]
    base, metal = pot["layer"]
    textured: dict[str, Any] = {**pot, "layer": [{**base, "texture": "oak.png"}, {**metal, "weight": "mask.png"}]}
    editor = Editor(client, "shelf")
    client.open_scene({**SCENE, "object": [textured, *others]})
    ticks(editor)
    (request,) = client.sent(SampleMaps)
    for key, images in request.layers:
        assert not editor.controller.maps.is_complete
        client.answer(request, MapsSampled(key, images, np.full((4, 4), 0.5, np.float16), MEANS, {}))
        assert [event.key for event in ticks(editor)] == [key]
    assert client.sent(SampleMaps) == [request] and editor.controller.maps.is_complete


def test_side_a_is_drawn_with_its_own_image(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.do(SetView.of(n_bounces=1))
    ticks(editor)
    editor.do(OAK)
    ticks(editor)
    client.finish_stage("coarse", exact=False)
    sample(editor, client, 0.25)
    remember(editor, 0.2)
    editor.do(ELM)
    ticks(editor)
    sample(editor, client, 0.75)
    client.finish_stage("final", exact=True)
    ticks(editor)
    editor.controller.rendered(EXACT)
    (event,) = (e for e in editor.tick(0.5) if isinstance(e, ComparisonRefined))
    samples, strength, inverts = event.appearances["pot.0"].maps
    assert samples is not None and (samples == 0.25).all() and (strength, inverts) == (1.0, False)
    assert event.appearances["pot.1"].maps[0] is None
