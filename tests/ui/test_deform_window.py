"""Deform in the window: a deformer is dragged, the picture bends with it, and Placement takes the pose over."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands import AddDeformer, SetDeformer
from app.worker.cache import ArrayCache
from app.worker.deform_worker import DeformWorker
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.realtime.core.gpu_parts import PictureExport
from engine.realtime.zonal_harmonics.pose import Deformation
from tests.engine.realtime.zonal_harmonics.test_posed_scene import write_bar
from tests.engine.scene.loaders.test_gltf_rig import Bar
from tests.ui.small_scene import is_drawn, opened_window, wait_until_exact, write_small_scene
from ui.gl.context import MOVING_VARIABLE, GraphicsError
from ui.headless import HeadlessWindow
from ui.modes.deform.deform_feed import DeformFeed
from ui.modes.deform.gl.posed_picture import PosedPicture
from ui.modes.orbit.orbit_feed import OrbitFeed

pytestmark = pytest.mark.gl
Opened = Callable[[Path], HeadlessWindow]


@pytest.fixture
def opened(context: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Opened]:
    """A scene in Deform, by few rays and points."""
    monkeypatch.setattr(DeformWorker, "n_rays", 16)
    monkeypatch.setattr("engine.realtime.zonal_harmonics.deform_engine.N_POINTS", 60)
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    with ExitStack() as stack:
        way = {"resolution": (48, 32), "mode": "deform", "n_lights": 40, "n_bounces": 1, "n_lobes": 1}
        yield lambda scene: stack.enter_context(opened_window(context, scene, client, **way))


@pytest.fixture
def window(opened: Opened, tmp_path: Path) -> HeadlessWindow:
    """The small scene."""
    return opened(write_small_scene(tmp_path))


def shown(window: HeadlessWindow) -> np.ndarray:
    source = window.shell.source
    assert source is not None and isinstance(source.source, OrbitFeed)
    return source.source.canvas.linear_image()


def test_morph_targets_play(opened: Opened, tmp_path: Path) -> None:
    """The bar swells to three times its width within its second; at its end it begins anew."""
    bar = Bar()
    bar.tree["animations"][0] |= {"channels": [], "samplers": [], "name": "swell"}
    bar.morph(np.array([[-1, 0, 0], [1, 0, 0], [-1, 0, 0], [1, 0, 0], [0, 0, 0]]))
    bar.move(0, "weights", [0, 1], [[0.0], [1.0]])
    window = opened(write_bar(tmp_path, bar))
    editor = window.shell.editor
    assert window.run_until(
        lambda: editor.status.shown_by == "Deform" and editor.status.picture == "refining" and is_drawn(window), 60.0
    )

    def width() -> int:
        """Of all that is seen, in pixels."""
        picture = shown(window)
        return int((np.abs(picture - picture[0, 0]).max(axis=(0, 2)) > 1e-3).sum())

    slim = width()
    window.key(imgui.Key.space)
    assert editor.view.playing is not None
    assert window.run_until(lambda: width() > 1.5 * slim, 60.0)
    window.key(imgui.Key.space)
    moment = editor.document.object("bar").moment
    assert moment is not None and moment.clip == "swell" and 0.25 < moment.time <= 1.0
    assert not editor.history.undo_steps


@pytest.fixture
def drawing_window(opened: Opened, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> HeadlessWindow:
    """One that draws moving pictures itself, as with a graphics card."""
    monkeypatch.setenv(MOVING_VARIABLE, "shader")
    return opened(write_small_scene(tmp_path))


def test_a_graphics_card_draws_what_moves_and_where_it_fails_the_worker_does(
    drawing_window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    window, editor = drawing_window, drawing_window.shell.editor
    assert window.run_until(
        lambda: editor.status.shown_by == "Deform" and editor.status.picture != "waiting" and is_drawn(window), 120.0
    )
    feed = window.shell.source.source
    drawn: list[tuple[int, int]] = []
    draw = PosedPicture.draw

    def counted(self: PosedPicture, told: PictureExport, *more: Any) -> moderngl.Texture:
        drawn.append((int(told.shape is not None), int(told.appearance is not None)))
        return draw(self, told, *more)

    monkeypatch.setattr(PosedPicture, "draw", counted)
    at_rest = shown(window)
    editor.do(AddDeformer("ball", "bend"))
    window.frames(3)
    assert window.run_until(lambda: editor.status.picture in ("refining", "exact"), 60.0)  # its lobes are there
    drawn.clear()
    for amount in (20.0, 40.0):
        editor.do(SetDeformer("ball", 0, amount=amount))
        seen, before = len(drawn), shown(window)
        assert window.run_until(lambda n=seen: len(drawn) > n, 60.0)
        window.frames(2)
        assert np.abs(shown(window) - before).max() > 0.02
    assert np.isfinite(shown(window)).all() and np.abs(shown(window) - at_rest).max() > 0.02
    assert drawn[1:] and not any(map(any, drawn[1:]))  # a pose brings no mesh with it, and no light

    def fails(*_: Any) -> moderngl.Texture:
        raise GraphicsError("no room")

    monkeypatch.setattr(PosedPicture, "draw", fails)
    before = shown(window)
    editor.do(SetDeformer("ball", 0, amount=-40.0))
    assert window.run_until(lambda: "drawn by the processor" in editor.status.message, 60.0)
    assert editor.status.message == "Deform is drawn by the processor: no room"
    editor.do(SetDeformer("ball", 0, amount=-60.0))
    assert window.run_until(lambda: np.abs(shown(window) - before).max() > 0.02, 60.0)
    assert isinstance(feed, DeformFeed) and feed.shaded is None


@pytest.mark.sweep
def test_a_deformer_is_dragged_and_placement_takes_the_pose_over(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    assert window.run_until(
        lambda: editor.status.shown_by == "Deform" and editor.status.picture != "waiting" and is_drawn(window), 120.0
    )
    editor.select("ball")
    window.frames(2)
    before = shown(window)
    window.click_handle("button.pose.add.0")
    window.frames(3)
    assert editor.document.object("ball").deformations == (Deformation("bend", 0.0),)
    steps = len(editor.history.undo_steps)
    window.drag_handle("pose.0", (60.0, 0.0))
    (bent,) = editor.document.object("ball").deformations
    assert bent.amount == pytest.approx(27.5, abs=2.0) and len(editor.history.undo_steps) == steps + 1
    wait_until_exact(window)
    assert editor.status.shown_by == "Placement"
    assert np.abs(shown(window) - before).max() > 0.05
    editor.undo()
    assert editor.document.object("ball").deformations == (Deformation("bend", 0.0),)
