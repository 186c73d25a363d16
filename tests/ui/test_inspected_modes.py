"""In Orbit and Deform, too, what is on screen is the linear picture through the view's description, and what is read of
it is it: over any background, of any camera, by Placement's picture and the mode's own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.commands.light import SetBackground, SetBackgroundColour, SetIntensity
from app.document.view_state import PICTURE_CHANNELS, SetView
from app.worker.cache import ArrayCache
from app.worker.deform_worker import DeformWorker
from app.worker.orbit_worker import OrbitWorker
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.render.crop import Crop, cropped
from tests.naive.shown_view import shown_colours
from tests.ui.small_scene import opened_window, write_small_scene
from ui.gl.gpu_memory import read_texture
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl


@pytest.fixture(params=["orbit", "deform"])
def window(
    context: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> Iterator[HeadlessWindow]:
    """The small scene in a mode, on few points."""
    for worker in (OrbitWorker, DeformWorker):
        monkeypatch.setattr(worker, "n_points", 300)
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    scene = write_small_scene(tmp_path)
    with opened_window(
        context, scene, client, resolution=(48, 32), mode=request.param, n_lights=40, n_bounces=1
    ) as window:
        editor = window.shell.editor
        # Its own picture is there, and goes on to Placement's.
        assert window.run_until(lambda: editor.status.picture != "waiting", 120.0), editor.status
        window.frames(2)
        yield window


def hold_to_twin(window: HeadlessWindow, random: np.random.Generator) -> None:
    editor, feed = window.shell.editor, window.shell.source
    assert isinstance(feed, PictureFeed)
    picture = feed.shown(editor)
    assert picture is not None and feed.picture is not None
    light = read_texture(picture.linear, np.float32).astype(np.float64)
    light[..., :3] *= picture.intensity
    view, background = editor.view, editor.document.background
    expected = 255.0 * shown_colours(light, view, background, view.tone_mapping)
    shown = read_texture(feed.picture, np.uint8)[..., :3].astype(float)
    assert (np.abs(shown - expected).max(axis=2) <= 1.5).mean() > 0.98, view
    plain = 255.0 * shown_colours(light, view, background, view.tone_mapping, inspected=False)
    height, width = light.shape[:2]
    for _ in range(3):
        column, row = int(random.integers(width)), int(random.integers(height))
        values = feed.values_at(editor, column, row)
        assert values is not None and values.alpha == pytest.approx(light[row, column, 3], abs=1e-6)
        np.testing.assert_allclose(values.radiance, light[row, column, :3], rtol=1e-5, atol=1e-7)
        if view.tone_mapping != "false_colour":
            np.testing.assert_allclose(values.shown, plain[row, column], atol=1.5)
    found, part = feed.scopes(editor, view.crop), cropped(plain, view.crop)
    assert found is not None and found.counts[0].sum() == part.shape[0] * part.shape[1]
    if view.tone_mapping != "false_colour":
        levels = np.arange(256)
        for i in range(3):
            assert np.dot(found.counts[i], levels) / found.counts[i].sum() == pytest.approx(
                part[..., i].mean(), abs=1.0
            )


def test_the_screen_is_the_picture_through_the_view(window: HeadlessWindow) -> None:
    editor, random = window.shell.editor, np.random.default_rng(4)
    editor.select(None)
    window.leave()
    for i in range(24):
        changes = (
            SetView.of(exposure=random.uniform(-2.0, 2.0)),
            SetView.of(gamma=random.uniform(0.7, 1.8)),
            SetView.of(tone_mapping=("filmic", "linear", "false_colour")[random.integers(3)]),
            SetView.of(picture_channel=PICTURE_CHANNELS[random.integers(len(PICTURE_CHANNELS))]),
            SetView.of(crop=Crop(0.2, 0.1, 0.7, 0.8) if random.random() < 0.7 else None),
            SetIntensity(random.uniform(0.5, 2.0)),
            SetBackground(("transparent", "environment")[random.integers(2)]),
            SetBackgroundColour((0.2, 0.4, 0.8)),
        )
        editor.do(changes[random.integers(len(changes))])
        window.frames(3)
        if i % 3 == 2:
            assert window.run_until(lambda: editor.status.picture != "waiting", 60.0)
            window.frames(2)
            hold_to_twin(window, random)
