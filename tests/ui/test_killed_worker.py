"""The worker is killed in mid-work under the hand of a person: said, survived, and made good."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.worker.client import Client
from engine.curve.operators import Operator
from tests.ui.quick_worker import HANDLERS
from tests.ui.small_scene import linear_picture, opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow
from ui.panels.status_bar import picture_state

pytestmark = [pytest.mark.gl, pytest.mark.slow]

RESOLUTION, N_LIGHTS = (96, 64), 2000
CURVE = "ball.1.theta_h"


def session(context: moderngl.Context, scene: Path, *, kill: bool) -> np.ndarray:
    """The exact picture after two edits, the second made while the final lights are computed."""
    client = Client(HANDLERS)
    with opened_window(context, scene, client, resolution=RESOLUTION, n_lights=N_LIGHTS) as window:
        editor = window.shell.editor
        editor.select(CURVE)
        window.drag_handle("curve.magnitude", (0, -30))
        first = editor.document
        assert window.run_until(lambda: in_mid_work(window), 600.0), (
            editor.status
        )  # kernels may have to be compiled first
        shown = linear_picture(window)
        if kill:
            _kill(window, client)
            # What was shown stays, and is not called exact.
            assert linear_picture(window).mean() == pytest.approx(shown.mean(), rel=0.5)
            assert picture_state(editor.status)[1] == "preview"
        window.drag_handle("curve.b", (25, 0))
        assert isinstance(_operator(window), Operator)
        assert editor.document != first
        assert editor.status.picture != "exact"
        edited = editor.document
        wait_until_exact(window)
        # Neither the kill nor the new worker has touched the document or its history.
        assert editor.document == edited
        picture = linear_picture(window)
        editor.undo()
        assert editor.document == first
        return picture


def in_mid_work(window: HeadlessWindow) -> bool:
    status = window.shell.editor.status
    return status.stage == "final" and 0.1 < status.fraction < 0.9


def _operator(window: HeadlessWindow) -> object:
    (made,) = window.shell.editor.document.layer("ball.1").operators("theta_h")
    return made


def _kill(window: HeadlessWindow, client: Client) -> None:
    """End the worker as the system does when memory runs out, and look at what the window says."""
    victim = client.pid
    assert victim is not None
    os.kill(victim, signal.SIGKILL)
    assert window.run_until(lambda: client.pid not in (None, victim), 90.0)
    window.frame()
    notice = window.shell.state.message
    assert notice is not None and notice.is_error
    assert "started again" in notice.text and "SIGKILL" in notice.text and "edits are untouched" in notice.text
    # It stands in the bar itself, in the colour of errors, right of the middle.
    bar = window.pixels()[-28:, 500:].astype(int)
    assert ((bar[..., 0] - bar[..., 2]) > 60).sum() > 100


def test_a_killed_worker_is_replaced_under_the_hand(
    context: moderngl.Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = write_small_scene(tmp_path)
    pictures = []
    for kill in (False, True):
        # A cache of its own: nothing of the one run helps the other.
        monkeypatch.setenv("INSITU_CACHE", str(tmp_path / f"cache-{kill}"))
        pictures.append(session(context, scene, kill=kill))
    expected, found = pictures
    # Transport reaches the GPU in half floats; how many steps led to the curve depends on when it came. Mostly equal.
    relative = np.sqrt(np.mean((found - expected) ** 2)) / expected.mean()
    assert relative < 2e-4, relative
