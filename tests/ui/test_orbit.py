"""Orbit in the window: pictures from a camera that moves, and Placement's of one that rests."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.jobs.cache import Store
from app.jobs.in_process import InProcessClient
from app.jobs.orbit import OrbitWork
from app.jobs.tasks import Tasks
from app.view_state import SetView
from engine.scene.description import Camera
from tests.ui.small_scene import opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow
from ui.orbit_feed import OrbitFeed

pytestmark = pytest.mark.gl

ASIDE = Camera(position=(1.6, 1.0, 2.0), target=(0.0, 0.45, 0.0), fov_y=42.0)


@pytest.fixture
def window(context: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[HeadlessWindow]:
    """The small scene in Orbit, on fewer points than there would be."""
    monkeypatch.setattr(OrbitWork, "n_points", 1000)
    client = InProcessClient(Tasks(Store(tmp_path / "cache")))
    scene = write_small_scene(tmp_path)
    with opened_window(context, scene, client, resolution=(48, 32), mode="orbit", n_lights=40, n_bounces=1) as window:
        yield window


def feed_of(window: HeadlessWindow) -> OrbitFeed:
    source = window.shell.source
    assert source is not None and isinstance(source.source, OrbitFeed)
    return source.source


def wait_until_shown_by(window: HeadlessWindow, name: str) -> None:
    editor = window.shell.editor
    assert window.run_until(lambda: editor.status.shown_by == name and editor.status.picture != "waiting", 120.0)


def test_the_first_picture_has_light_everywhere(window: HeadlessWindow) -> None:
    # Not that of points whose light is still to be found, which would be black.
    wait_until_shown_by(window, "Orbit")
    picture = feed_of(window).canvas.linear_image()
    assert (picture.mean(axis=2) > 1e-3).all()


def test_the_picture_of_a_view_at_rest_is_placements(window: HeadlessWindow) -> None:
    wait_until_shown_by(window, "Orbit")
    assert window.run_until(lambda: window.shell.editor.status.picture == "refining", 120.0)
    first = feed_of(window).canvas.linear_image()
    wait_until_exact(window)
    assert window.shell.editor.status.shown_by == "Placement"
    then = feed_of(window).placement.renderer.linear_image()
    assert first.mean() == pytest.approx(then.mean(), rel=0.05)


def test_a_camera_that_moves_is_followed_by_orbit_at_once(window: HeadlessWindow) -> None:
    wait_until_exact(window)
    window.shell.editor.do(SetView.of(camera=ASIDE))
    wait_until_shown_by(window, "Orbit")
    before = feed_of(window).canvas.linear_image()
    wait_until_exact(window)
    after = feed_of(window).placement.renderer.linear_image()
    assert np.abs(before - after).mean() < 0.2 * after.mean()
