"""What the window shows while a scene opens: answers are taken piece by piece, objects lit by a headlight first."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import moderngl
import numpy as np
import pytest

from app.document.commands.layers import SetParameter, SetVisible, new_layer
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.modes.placement.placement_controller import PlacementController
from app.modes.registry import MODES
from app.system.lazy_import import import_named
from engine.render.headlight import headlight_colour, headlight_radiance
from tests.app.fake_worker import FakeClient
from tests.ui.stand_in import StandInClient, scene_frame
from ui import picture_feed, scene_view
from ui.modes.placement import placement_feed
from ui.modes.placement.gl.renderer import PlacementRenderer
from ui.modes.placement.placement_feed import PlacementFeed
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl


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
    for _ in range(150):
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
    for _ in range(150):
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
