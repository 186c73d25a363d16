"""The worker's answers on their way to the screen."""

from __future__ import annotations

import numpy as np
import pytest

from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetMaterial, SetVisible, new_layer
from app.document.commands.light import SetEnvironment, SetIntensity, SetRotation
from app.document.commands.links import LinkCurves
from app.document.view_state import SetView
from app.messages.worker_messages import SkyImage
from app.modes.placement.placement_events import LayerMapsChanged
from app.modes.placement.placement_messages import ComputeTransport
from engine.curve.operators import Operator
from tests.ui.stand_in import HEIGHT, WIDTH, StandInClient, scene_frame, transport_of
from ui import picture_feed
from ui.headless import HeadlessWindow
from ui.modes.placement.gl.transport import SAMPLES_PER_ROW, row_count
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
        view = editor.controller.picture.view_curves(key).prod(axis=0)
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


def test_curves_that_objects_share_follow_the_hand_together(window: HeadlessWindow) -> None:
    """While one is dragged, the picture is that of all of them edited: each has transport of its own."""
    editor = window.shell.editor
    assert editor.do(LinkCurves("teapot.1.theta_h", ("tray.0.theta_h",))) is None
    before = exact_picture(window)
    client = editor._client
    assert isinstance(client, StandInClient)
    n_requests = len(client.requests)
    editor.begin_drag()
    for magnitude in (0.3, 0.6, 0.9):
        lift = Operator("translate", "y", 0.1, 0.2, 0.5, 0.7, magnitude=magnitude)
        editor.do(SetOperators("tray.0", "theta_h", (lift,)))
        window.frames(4)
        shown = feed(window).source.renderer.linear_image()
        np.testing.assert_allclose(shown, expected_picture(window), rtol=HALF_FLOAT, atol=1e-5)
    column = WIDTH // 8, 3 * WIDTH // 8  # of the teapot, of the tray
    assert all(np.abs(shown[:, each] - before[:, each]).max() > 1e-3 for each in column)
    assert len(client.requests) == n_requests
    editor.end_drag()
    assert editor.undo() is not None
    np.testing.assert_allclose(exact_picture(window), before, rtol=HALF_FLOAT, atol=1e-5)


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
