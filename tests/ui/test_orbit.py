"""Orbit in the window: pictures from a camera that moves, and Placement's of one that rests."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import moderngl
import numpy as np
import pytest

from app.document.view_state import Bookmark, SetView, Viewpoint
from app.modes.orbit.orbit_messages import DrawOrbit
from app.worker.cache import ArrayCache
from app.worker.orbit_worker import OrbitWorker
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.scene.description import Camera
from tests.ui.small_scene import CountingClient, is_drawn, opened_window, wait_until_exact, write_small_scene
from ui.gl.context import MOVING_VARIABLE, GraphicsError
from ui.gl.gpu_memory import read_texture
from ui.headless import HeadlessWindow
from ui.modes.orbit import orbit_feed
from ui.modes.orbit.gl.shaded_picture import ShadedPicture
from ui.modes.orbit.orbit_feed import FADE_SECONDS, OrbitFeed
from ui.script_runner import wait_for_picture

pytestmark = pytest.mark.gl

ASIDE = Camera(position=(1.6, 1.0, 2.0), target=(0.0, 0.45, 0.0), fov_y=42.0)


@pytest.fixture
def window(context: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[HeadlessWindow]:
    """The small scene in Orbit, on fewer points than there would be."""
    monkeypatch.setattr(OrbitWorker, "n_points", 1000)
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    scene = write_small_scene(tmp_path)
    with opened_window(context, scene, client, resolution=(48, 32), mode="orbit", n_lights=40, n_bounces=1) as window:
        yield window


@pytest.fixture
def drawing_window(
    context: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[HeadlessWindow]:
    """One that draws moving pictures itself, as with a graphics card."""
    monkeypatch.setattr(OrbitWorker, "n_points", 200)
    monkeypatch.setenv(MOVING_VARIABLE, "shader")
    client = CountingClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    scene = write_small_scene(tmp_path)
    with opened_window(context, scene, client, resolution=(48, 32), mode="orbit", n_lights=40, n_bounces=1) as window:
        yield window


def feed_of(window: HeadlessWindow) -> OrbitFeed:
    source = window.shell.source
    assert source is not None and isinstance(source.source, OrbitFeed)
    return source.source


def test_a_script_waits_until_the_exact_picture_has_faded_in(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(orbit_feed, "FADE_SECONDS", 1.0)
    wait_for_picture(window, window.shell.editor, "exact")
    assert feed_of(window).picture is feed_of(window).placement.picture


def wait_until_shown_by(window: HeadlessWindow, name: str) -> None:
    editor = window.shell.editor
    assert window.run_until(
        lambda: editor.status.shown_by == name and editor.status.picture != "waiting" and is_drawn(window), 120.0
    )


def test_before_the_first_picture_objects_are_lit_by_a_headlight(window: HeadlessWindow) -> None:
    source, editor = window.shell.source, window.shell.editor
    assert source is not None

    def is_shown() -> bool:
        return source.picture is not None and read_texture(source.picture, np.uint8)[..., :3].mean() > 40.0

    assert window.run_until(lambda: is_shown() or editor.status.picture != "waiting", 120.0)
    assert is_shown() and editor.status.picture == "waiting" and feed_of(window).canvas.is_empty


def test_the_first_picture_has_light_everywhere(window: HeadlessWindow) -> None:
    # Not that of points whose light is still to be found, which would be black.
    wait_until_shown_by(window, "Orbit")
    picture = feed_of(window).canvas.linear_image()
    assert (picture.mean(axis=2) > 1e-3).all()


def test_the_picture_of_a_view_at_rest_is_placements(window: HeadlessWindow) -> None:
    wait_until_shown_by(window, "Orbit")
    assert window.run_until(lambda: window.shell.editor.status.picture == "refining" and is_drawn(window), 120.0)
    first = feed_of(window).canvas.linear_image()
    wait_until_exact(window)
    assert window.shell.editor.status.shown_by == "Placement"
    then = feed_of(window).placement.renderer.linear_image()
    assert first.mean() == pytest.approx(then.mean(), rel=0.05)


def test_a_finished_picture_stays_through_changes_of_mode(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Placement's, which all modes end with: none begins with a picture of its own that is worse."""
    ticks = itertools.count()
    monkeypatch.setattr(orbit_feed, "time", SimpleNamespace(monotonic=lambda: next(ticks) * FADE_SECONDS / 5.0))
    editor, source = window.shell.editor, window.shell.source
    assert source is not None

    def shown() -> np.ndarray:
        assert source.picture is not None
        return read_texture(source.picture, np.uint8)[..., :3].astype(int)

    def is_finished() -> bool:
        seen.append(shown())
        return editor.status.picture == "exact" and is_drawn(window)

    seen: list[np.ndarray] = []
    wait_until_exact(window)
    window.frames(10)  # Placement's picture fades in
    finished = shown()
    for mode in ("placement", "orbit", "placement", "orbit"):
        editor.do(SetView.of(mode=mode))
        window.frames(1)
        assert window.run_until(is_finished, 120.0)
        for _ in range(10):
            window.frames(1)
            seen.append(shown())
    assert max(np.abs(each - finished).max() for each in seen) <= 2


def test_a_camera_that_moves_is_followed_by_orbit_at_once(window: HeadlessWindow) -> None:
    wait_until_exact(window)
    window.shell.editor.do(SetView.of(camera=ASIDE))
    wait_until_shown_by(window, "Orbit")
    before = feed_of(window).canvas.linear_image()
    wait_until_exact(window)
    after = feed_of(window).placement.renderer.linear_image()
    assert np.abs(before - after).mean() < 0.2 * after.mean()


def test_a_view_that_is_kept_has_orbits_picture_before_placements_is_there(window: HeadlessWindow) -> None:
    wait_until_shown_by(window, "Orbit")
    editor = window.shell.editor
    editor.do(SetView.of(camera=ASIDE, bookmarks=(Bookmark("Aside", Viewpoint(ASIDE, (48, 32))),)))
    assert window.run_until(lambda: bool(editor.view.bookmarks[0].thumbnail), 120.0)
    assert editor.status.shown_by == "Orbit" and not editor.status.is_finished


def n_moving(window: HeadlessWindow) -> int:
    """Moving pictures that the worker was asked for."""
    client = window.shell.editor._client
    assert isinstance(client, CountingClient)
    return sum(isinstance(each, DrawOrbit) and each.quality == "moving" for each in client.requests)


def look_aside(window: HeadlessWindow) -> np.ndarray:
    """The picture of a camera that has just moved."""
    window.shell.editor.do(SetView.of(camera=ASIDE))
    window.frames(2)
    return feed_of(window).canvas.linear_image()


def test_shaders_draw_the_picture_that_the_worker_does_at_rest(drawing_window: HeadlessWindow) -> None:
    window, editor = drawing_window, drawing_window.shell.editor
    assert window.run_until(lambda: editor.status.picture == "refining", 120.0)
    before = n_moving(window)
    moving = look_aside(window)
    assert editor.controller.drawn_in_window is not None  # type: ignore[attr-defined]
    assert window.run_until(lambda: editor.controller.drawn_in_window is None and is_drawn(window), 120.0)  # type: ignore[attr-defined]
    at_rest = feed_of(window).canvas.linear_image()
    assert n_moving(window) == before
    # On software few coefficients, and a quarter of the pixels' rows and columns, enlarged.
    assert np.abs(moving - at_rest).mean() < 0.2 * at_rest.mean()
    wait_until_exact(window)
    editor.do(SetView.of(mode="placement"))
    shaded = feed_of(window).shaded
    # A later scene is taken in as there is time: how many frames that is depends on the machine.
    assert shaded is not None and window.run_until(lambda: shaded.memory_bytes == 0, 30.0)


def test_where_shaders_fail_the_worker_draws_and_a_line_says_so(
    drawing_window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    window, editor = drawing_window, drawing_window.shell.editor

    def lost(*_: object) -> None:
        raise GraphicsError("the context is lost")

    monkeypatch.setattr(ShadedPicture, "draw", lost)
    assert window.run_until(lambda: editor.status.message.startswith("Orbit is drawn"), 120.0)
    assert editor.status.message == "Orbit is drawn by the processor: the context is lost"
    assert feed_of(window).shaded is None and n_moving(window) == 0
    assert window.run_until(lambda: n_moving(window) > 0 and not feed_of(window).canvas.is_empty, 120.0)
    assert feed_of(window).canvas.linear_image().mean() > 0.1
