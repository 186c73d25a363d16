"""The worker's answers on their way to the screen."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import moderngl
import numpy as np
import pytest

from app.document.commands.layers import SetMaterial, SetParameter, SetVisible, new_layer
from app.document.commands.light import SetEnvironment, SetIntensity, SetRotation
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import SkyImage
from app.modes.placement.placement_controller import PlacementController
from app.modes.placement.placement_events import LayerMapsChanged
from app.modes.placement.placement_messages import ComputeTransport
from app.modes.registry import MODES
from app.system.lazy_import import import_named
from engine.render.headlight import headlight_colour, headlight_radiance
from tests.app.fake_worker import FakeClient
from tests.ui.stand_in import HEIGHT, WIDTH, StandInClient, scene_frame, transport_of
from ui import picture_feed, scene_view
from ui.headless import HeadlessWindow
from ui.modes.placement import placement_feed
from ui.modes.placement.gl.renderer import PlacementRenderer
from ui.modes.placement.gl.transport import SAMPLES_PER_ROW, row_count
from ui.modes.placement.placement_feed import PlacementFeed
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl

# Transport is held in half floats: 11 bits a coefficient, sums of 128 of them.
HALF_FLOAT = 1e-3


def feed(window: HeadlessWindow) -> PictureFeed:
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    return source


def exact_picture(window: HeadlessWindow) -> np.ndarray:
    editor = window.shell.editor
    window.frames(2)
    assert window.run_until(lambda: editor.status.picture == "exact", 90.0), editor.status
    return feed(window).source.renderer.linear_image()


def expected_picture(window: HeadlessWindow) -> np.ndarray:
    """The sum over layers of f_q f_o Σ_j c_j T_j, straight from the stand-in's transport, and the lamp's emission."""
    editor, frame = window.shell.editor, scene_frame()
    image = np.array(frame.emission_image, dtype=np.float64)
    flat = image.reshape(-1, 3)
    names = [state.name for state in editor.document.objects]
    for key, layer in editor.document.layers():
        name = key.partition(".")[0]
        if name == "lamp" or not editor.document.is_visible(key):
            continue
        start, stop = frame.object_ranges[names.index(name)]
        curves = editor.controller.picture.wanted_coefficients(key)
        first = next(iter(curves.values()))
        radiance = np.einsum("jpc,jc->pc", transport_of(key, len(first)), first)
        angles = np.linspace(0.0, np.pi / 2, 256)
        view = editor.controller.picture.view_curve(key)
        view_value = np.stack([np.interp(0.4, angles, view[:, channel]) for channel in range(3)])
        flat[frame.pixel[start:stop]] += radiance * layer.scale() * view_value
    return image


def test_the_picture_is_the_sum_of_its_layers(window: HeadlessWindow) -> None:
    shown = exact_picture(window)
    assert shown.shape == (HEIGHT, WIDTH, 3)
    np.testing.assert_allclose(shown, expected_picture(window), rtol=HALF_FLOAT, atol=1e-5)


def test_what_is_not_to_be_seen_apart_comes_in_one_frame(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    exact_picture(window)
    editor, taken = window.shell.editor, []
    events = [LayerMapsChanged(str(i), None, with_next=i in (0, 1)) for i in range(4)]
    monkeypatch.setattr(picture_feed, "TAKING_SECONDS", -1.0)  # each event takes longer than a frame has
    monkeypatch.setattr(editor, "tick", lambda now: [events.pop() for _ in range(len(events))][::-1])
    monkeypatch.setattr(feed(window).source, "take", lambda editor, event: taken.append(event.key))
    feed(window).take(editor, 0.0)
    assert taken == ["0", "1", "2"]
    feed(window).take(editor, 0.0)
    assert taken == ["0", "1", "2", "3"]


def test_the_picture_follows_a_dragged_curve(window: HeadlessWindow) -> None:
    before = exact_picture(window)
    window.drag_handle("curve.magnitude", (0, -60))
    shown = exact_picture(window)
    assert np.abs(shown - before).max() > 1e-3
    np.testing.assert_allclose(shown, expected_picture(window), rtol=HALF_FLOAT, atol=1e-5)
    # An edit of the curve asks the worker for nothing: the transport on the graphics card answers.
    client = window.shell.editor._client
    assert isinstance(client, StandInClient)
    assert sum(isinstance(request, ComputeTransport) for request in client.requests) == 1


def test_a_new_material_is_first_seen_in_a_picture_of_its_own(window: HeadlessWindow) -> None:
    # What scales its curves is another number: times the picture before it would be far too bright.
    editor = window.shell.editor
    before = exact_picture(window)
    bright = new_layer("cook_torrance").with_parameter("scale", 4.0)
    editor.do(SetMaterial("teapot", (editor.document.layer("teapot.0"), bright)))
    n_pictures = 0
    while editor.controller.picture.is_held:
        np.testing.assert_array_equal(feed(window).source.renderer.linear_image(), before)
        window.frame()
        n_pictures += 1
    assert n_pictures > 0
    np.testing.assert_allclose(exact_picture(window), expected_picture(window), rtol=HALF_FLOAT, atol=1e-5)


def test_hidden_layers_leave_the_picture(window: HeadlessWindow) -> None:
    window.shell.editor.do(SetVisible("teapot.0", False))
    np.testing.assert_allclose(exact_picture(window), expected_picture(window), rtol=HALF_FLOAT, atol=1e-5)


def test_intensity_and_exposure_act_alike(window: HeadlessWindow) -> None:
    editor, renderer = window.shell.editor, feed(window).source.renderer
    editor.do(SetIntensity(4.0))
    window.frames(3)
    brighter = renderer.display_image()
    editor.do(SetIntensity(1.0))
    editor.do(SetView.of(exposure=2.0))
    window.frames(3)
    # Four times the light is two stops.
    np.testing.assert_array_equal(renderer.display_image(), brighter)


def test_objects_are_found_by_pixel(window: HeadlessWindow) -> None:
    found = [feed(window).object_at(column, 5) for column in (0, 13, 25, 47)]
    assert found == ["teapot", "tray", "wall", "lamp"]
    assert feed(window).object_at(-1, 0) is None
    assert feed(window).object_at(WIDTH, 0) is None


def test_the_camera_looks_along_minus_z(window: HeadlessWindow) -> None:
    # The stand-in's camera stands on +Z and looks at the origin: straight ahead is the thumbnail's middle.
    assert feed(window).heading == pytest.approx(0.0)


def test_a_new_sky_gets_a_thumbnail(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    old = feed(window).environment
    editor.do(SetEnvironment("constant", radiance=(1.0, 0.2, 0.1)))
    client = editor._client
    assert isinstance(client, StandInClient)
    assert window.run_until(lambda: len([r for r in client.requests if isinstance(r, ComputeTransport)]) > 1, 90.0)
    client.say(SkyImage(np.full((4, 8, 3), (1.0, 0.2, 0.1), np.float32), id=2))
    # The stand-in's own sky, which is bluish, may come first.
    assert window.run_until(lambda: colour(feed(window))[0] > colour(feed(window))[2], 90.0)
    assert feed(window).environment is not old and colour(feed(window))[3] == 255


def test_no_light_has_no_thumbnail(window: HeadlessWindow) -> None:
    # A scene that lamps light alone: the panel says so in place of a black picture.
    client = window.shell.editor._client
    assert isinstance(client, StandInClient)
    assert feed(window).environment is not None
    client.say(SkyImage(np.zeros((1, 2, 3), np.float32), id=2))
    window.frames(3)
    assert feed(window).environment is None


def colour(source: PictureFeed) -> bytes:
    """The first pixel of the thumbnail, RGBA."""
    assert source.environment is not None
    return source.environment.read()[:4]


def test_rotating_turns_the_background_at_once(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.do(SetRotation(90.0))
    window.frame()
    assert editor.document.light.rotation == 90.0
    window.frames(3)
    assert editor.status.frame_ms > 0.0


def test_another_precision_comes_at_once_and_the_picture_stays(window: HeadlessWindow) -> None:
    editor, renderer = window.shell.editor, feed(window).source.renderer
    before = exact_picture(window)
    assert renderer.transport_precision == "half"
    n_bytes = renderer.memory_bytes
    editor.do(SetView.of(precision="float"))
    window.frame()
    np.testing.assert_array_equal(renderer.linear_image(), before)
    after = exact_picture(window)
    assert renderer.transport_precision == "float" and editor.status.transport_note == ""
    np.testing.assert_allclose(after, before, rtol=HALF_FLOAT, atol=1e-5)
    # Six bytes more for each of the layer's coefficients and samples, whole rows of them; all else is as it was.
    n_samples = len(renderer.layer_radiance("teapot.1"))
    n_bands = len(editor.controller.picture.wanted_coefficients("teapot.1")["theta_h"])
    assert renderer.memory_bytes - n_bytes == 6 * n_bands * row_count(n_samples) * SAMPLES_PER_ROW
    assert editor.status.gpu_mb == renderer.memory_bytes / 1e6


class Opening:
    """A window's feed and editor on the stand-in scene, nothing taken yet; `calls` names what the renderer did."""

    def __init__(self, context: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> None:
        self.client = StandInClient()
        self.editor = Editor(self.client, "stand-in")
        self.renderer = PlacementRenderer(context)
        self.feed = PictureFeed(context, self.editor.mode, PlacementFeed(context, self.renderer))
        self.calls: list[str] = []
        monkeypatch.setattr(picture_feed, "TAKING_SECONDS", 10.0)
        taking = ("set_frame", "set_layer_radiance", "set_environment", "begin_transport")
        for name in (*taking, "composite"):
            monkeypatch.setattr(self.renderer, name, self._spied(name))

    def _spied(self, name: str) -> Callable[..., Any]:
        real = getattr(self.renderer, name)

        def spy(*arguments: Any, **named: Any) -> Any:
            self.calls.append(name)
            return real(*arguments, **named)

        return spy

    def step(self) -> tuple[bool, list[str]]:
        """One look between frames; whether there is something to draw, and what the renderer did."""
        self.calls.clear()
        return self.feed.take(self.editor, 0.0), list(self.calls)

    def draw(self) -> tuple[bool, list[str]]:
        self.calls.clear()
        return self.feed.draw(self.editor, 10.0), list(self.calls)


@pytest.fixture
def opening(context: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> Iterator[Opening]:
    made = Opening(context, monkeypatch)
    yield made
    made.feed.close()
    made.editor.close()
    assert context.error == "GL_NO_ERROR"


def test_a_scene_is_taken_and_drawn_in_different_blocks(opening: Opening) -> None:
    took, calls = opening.step()
    assert took and calls == ["set_frame", "set_environment"]
    _, calls = opening.draw()
    assert set(calls) == {"set_layer_radiance", "composite"} and calls[-1] == "composite"  # objects are shaded plainly


def test_a_scene_waits_when_its_description_took_the_time(opening: Opening, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(picture_feed, "TAKING_SECONDS", -1.0)  # reading it has used up all there was
    took, calls = opening.step()
    assert took and calls == []
    busy, calls = opening.draw()
    assert busy and calls == []  # nothing to draw yet, and more to come
    n_steps = next(n for n in range(1, 20) if opening.step()[1][:1] == ["set_frame"])  # no longer than that
    assert n_steps > 4  # its textures come one by one


def test_answers_are_taken_piece_by_piece_when_time_is_short(opening: Opening, monkeypatch: pytest.MonkeyPatch) -> None:
    opening.step()
    opening.draw()
    monkeypatch.setattr(picture_feed, "TAKING_SECONDS", 0.0)
    seen = []
    for _ in range(40):
        _, calls = opening.step()
        if calls and calls[0] == "set_layer_radiance":  # a picture comes as one piece
            assert calls == 4 * ["set_layer_radiance"] + ["begin_transport"]
        else:
            assert len(calls) <= 1
        seen += calls
        busy, _ = opening.draw()
        if opening.editor.status.picture == "exact":
            break
        assert busy  # also while answers wait that the editor has counted already
    assert seen.count("set_layer_radiance") == 4 and seen.count("set_environment") == 1
    assert opening.editor.status.picture == "exact"


def test_another_scene_replaces_what_is_shown_within_a_frame(opening: Opening) -> None:
    while opening.editor.status.picture != "exact":
        opening.step()
        opening.draw()
    shown = opening.feed.picture
    opening.editor.open("stand-in")
    _, calls = opening.step()
    assert calls == [] and opening.feed.picture is shown  # panels may still draw it
    _, calls = opening.draw()
    assert (calls[0], calls[-1]) == ("set_frame", "composite") and opening.feed.picture is not shown


def test_the_view_before_stays_until_another_is_lit(opening: Opening) -> None:
    while opening.editor.status.picture != "exact":
        opening.step()
        opening.draw()
    feed, editor = opening.feed, opening.editor
    before, n_frames = shown(feed), 0
    camera = editor.camera_history.camera.model_copy(update={"position": (1.0, 1.0, 4.0)})
    editor.do(SetView.of(camera=camera))
    for now in np.arange(1.0, 30.0, 0.1):
        feed.take(editor, float(now))
        feed.draw(editor, 10.0)
        if feed.shows_view_before:
            n_frames += 1
            own = feed.source.picture  # in which objects are lit from the eye
            assert shown(feed) == before and (own is None or own.read() != before)
            assert editor.status.picture == "waiting" and feed.heading == 0.0
        elif n_frames:
            break
    assert n_frames and feed.picture is feed.source.picture and feed.heading < 0.0
    assert editor.status.picture != "waiting"


def shown(feed: PictureFeed) -> bytes:
    """The display picture's texels."""
    assert feed.picture is not None
    return feed.picture.read()


def test_before_anything_is_computed_objects_are_lit_by_a_headlight(opening: Opening) -> None:
    opening.step()
    feed, editor = opening.feed.source, opening.editor
    for _ in editor.document.objects:  # each draws one of them at least
        opening.draw()
    assert isinstance(feed, PlacementFeed)
    shown, frame = feed.renderer.linear_image().reshape(-1, 3), scene_frame()
    for index, state in enumerate(editor.document.objects):
        pixels = frame.pixel[slice(*frame.object_ranges[index])]
        if len(pixels) and not state.emits:
            expected = headlight_radiance(
                headlight_colour(state.layers), frame.theta_o[slice(*frame.object_ranges[index])]
            )
            assert expected.min() > 0.0
            np.testing.assert_allclose(shown[pixels], expected, rtol=1e-3)
    assert editor.status.picture == "waiting"
    while editor.status.picture != "exact":
        opening.step()
        opening.draw()
    assert set(feed.renderer.layer_keys) == {key for key, _ in editor.document.layers() if not key.startswith("lamp")}


def test_the_first_picture_has_no_black_in_it(opening: Opening, monkeypatch: pytest.MonkeyPatch) -> None:
    """It waits until all objects are shaded plainly, and stands before grey until the sky has come."""
    monkeypatch.setattr(placement_feed, "HEADLIGHT_SECONDS", 1e-4)  # an object a frame
    opening.step()
    n_frames = 0
    while opening.feed.picture is None and n_frames < 100:
        busy, _ = opening.draw()
        n_frames += 1
        assert busy or opening.feed.picture is not None
    source = opening.feed.source
    assert isinstance(source, PlacementFeed) and n_frames > 2
    assert source.renderer.linear_image().reshape(-1, 3).max(axis=-1).min() > 0.05


def test_objects_lit_by_a_headlight_are_no_modes_picture(opening: Opening) -> None:
    opening.step()
    feed, editor = opening.feed, opening.editor
    while feed.picture is None:
        opening.draw()
    opening.draw()
    editor.do(SetView.of(mode="orbit"))
    feed.take(editor, 0.0)
    assert feed.picture is not None and feed.mode_before is None  # the status would say "Placement's picture"


def test_metal_stays_plain_until_light_bounces(opening: Opening, monkeypatch: pytest.MonkeyPatch) -> None:
    """In direct light alone metal is black where it shows its surroundings."""
    feed_of_all, feed, editor = opening.feed, opening.feed.source, opening.editor
    assert isinstance(feed, PlacementFeed)
    monkeypatch.setattr(PlacementController, "lacks_bounces", True)
    opening.step()
    for _ in editor.document.objects:  # each draws one of them at least
        opening.draw()
    for _ in range(20):
        opening.step()
        opening.draw()
    assert "tray.0" in feed.renderer.layer_keys and "teapot" not in feed.renderer.layer_keys
    frame, tray = scene_frame(), editor.document.object("tray")

    def shows_plain_metal() -> bool:
        rows = slice(*frame.object_ranges[[state.name for state in editor.document.objects].index("tray")])
        plain = headlight_radiance(headlight_colour(editor.document.object("tray").layers), frame.theta_o[rows])
        shown = feed.renderer.linear_image().reshape(-1, 3)[frame.pixel[rows]]
        return bool(np.allclose(shown, plain, rtol=1e-3))

    assert shows_plain_metal()
    editor.do(SetParameter("tray.0", "k", (1.0, 1.5, 2.0)))  # an edit is followed
    for now in np.arange(1.0, 30.0, 0.1):
        feed_of_all.take(editor, float(now))
        opening.draw()
        if editor.controller.picture.document is editor.document:
            break
    assert shows_plain_metal() and editor.controller.picture.document.object("tray") != tray
    editor.do(SetVisible("tray.0", False))
    opening.draw()
    assert not shows_plain_metal()
    editor.do(SetVisible("tray.0", True))
    monkeypatch.setattr(PlacementController, "lacks_bounces", False)
    opening.draw()
    assert not shows_plain_metal() and "tray" not in feed.renderer.layer_keys


def test_a_plain_colour_is_about_what_a_material_reflects() -> None:
    for albedo in (0.2, 0.7):
        layer = new_layer("lambert").with_parameter("albedo", albedo)
        np.testing.assert_allclose(headlight_colour([layer]), albedo, rtol=1e-6)
    # However narrow its lobe, gold reflects about as much as its Fresnel term lets it, of each of its hues.
    for alpha in (0.01, 0.03, 0.06, 0.2):
        gold = headlight_colour([new_layer("rough_conductor").with_parameter("alpha", alpha)])
        np.testing.assert_allclose(gold, (0.95, 0.62, 0.51), rtol=0.06)
    np.testing.assert_allclose(headlight_colour([layer, layer]), 1.0)  # more than all there is


def test_before_a_scene_the_feed_warms_up_and_leaves_nothing(context: moderngl.Context) -> None:
    editor = Editor(FakeClient(), "shelf")
    feed = PictureFeed(context, editor.mode)
    for _ in range(100):
        assert not feed.take(editor, 0.0)
    assert feed.source.renderer.frame is None and feed.picture is None
    feed.close()


def test_before_a_scene_the_feed_imports_what_other_modes_draw_with(
    context: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    imported = list[str]()
    monkeypatch.setattr(picture_feed, "import_named", lambda name: imported.append(name) or import_named(name))
    editor = Editor(FakeClient(), "shelf")
    feed = PictureFeed(context, editor.mode)
    before = len(imported)
    for _ in range(100):
        feed.take(editor, 0.0)
        assert len(imported) <= before + 1  # one a look, events being heard between them
        before = len(imported)
    assert {mode.picture for mode in MODES} | {mode.accuracy for mode in MODES} <= set(imported)
    feed.close()


def test_a_thumbnail_that_comes_late_asks_for_a_frame(opening: Opening, monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()
    real = scene_view._thumbnail

    def late(radiance: np.ndarray) -> np.ndarray:
        assert go_on.wait(60.0)
        return real(radiance)

    monkeypatch.setattr(scene_view, "_thumbnail", late)
    while opening.editor.status.picture != "exact":
        opening.step()
        opening.draw()
    assert not opening.step()[0] and opening.feed.environment is None
    go_on.set()
    end = time.monotonic() + 90.0
    while not opening.step()[0]:
        assert time.monotonic() < end
    assert opening.draw()[0]  # panels were drawn before it
    assert opening.feed.environment is not None and not opening.step()[0]
