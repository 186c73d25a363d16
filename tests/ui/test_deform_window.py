"""Deform in the window: a deformer is dragged, the picture bends with it, and Placement takes the pose over."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.jobs.cache import Store
from app.jobs.deform import DeformWork
from app.jobs.in_process import InProcessClient
from app.jobs.tasks import Tasks
from engine.deform.pose import Deformation
from tests.ui.small_scene import opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow
from ui.orbit_feed import OrbitFeed

pytestmark = [pytest.mark.gl, pytest.mark.sweep]  # a minute


@pytest.fixture
def window(context: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[HeadlessWindow]:
    """The small scene in Deform, by few rays and points."""
    monkeypatch.setattr(DeformWork, "n_rays", 16)
    monkeypatch.setattr("engine.deform.live.N_POINTS", 60)
    client = InProcessClient(Tasks(Store(tmp_path / "cache")))
    scene = write_small_scene(tmp_path)
    with opened_window(context, scene, client, resolution=(48, 32), mode="deform", n_lights=40, n_bounces=1) as window:
        yield window


def shown(window: HeadlessWindow) -> np.ndarray:
    source = window.shell.source
    assert source is not None and isinstance(source.source, OrbitFeed)
    return source.source.canvas.linear_image()


def test_a_deformer_is_dragged_and_placement_takes_the_pose_over(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    assert window.run_until(lambda: editor.status.shown_by == "Deform" and editor.status.picture != "waiting", 120.0)
    editor.select("ball")
    window.frames(2)
    before = shown(window)
    window.click_handle("button.pose.add.0")
    window.frames(3)
    assert editor.document.object("ball").deformations == (Deformation("bend", 0.0),)
    steps = len(editor.history.undo_steps)
    window.drag_handle("pose.0", (60.0, 0.0))
    (bent,) = editor.document.object("ball").deformations
    assert bent.amount == pytest.approx(30.0, abs=2.0) and len(editor.history.undo_steps) == steps + 1
    wait_until_exact(window)
    assert editor.status.shown_by == "Placement"
    assert np.abs(shown(window) - before).max() > 0.05
    editor.undo()
    assert editor.document.object("ball").deformations == (Deformation("bend", 0.0),)
