"""Orbit in the real window, over a worker that draws: the picture goes with the hand, the view's undo takes it back."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.ui.real_window import RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture(small_scene=True)
LOOK, UNDO = "editor.camera_history.camera.position", "editor.camera_history.history.undo_label"
IS_WHOLE = "editor.controller.is_placement_active"  # all that Orbit can show is shown, and Placement is at it
MOVED = 3.0  # of 255: by how much a picture differs on average that is seen from elsewhere
PATIENCE = 60.0


def picture(real: RealWindow, folder: Path) -> np.ndarray:
    """The middle of the picture as it is on screen, under no mouse: (h, w, 3), 0 to 255."""
    x, y = real.at("viewport.centre")
    return np.asarray(Image.open(real.shot(folder / "seen.png")), int)[
        int(y) - 110 : int(y) + 110, int(x) - 140 : int(x) + 140
    ]


def difference(one: np.ndarray, other: np.ndarray) -> float:
    """Between two pictures, on average."""
    return float(np.abs(one - other).mean())


def until_it_differs(real: RealWindow, before: np.ndarray, folder: Path) -> np.ndarray:
    """Wait for a picture from elsewhere than the one before."""
    end = time.monotonic() + PATIENCE
    while difference(seen := picture(real, folder), before) < MOVED:
        assert time.monotonic() < end, "the picture does not follow"
        time.sleep(0.1)  # a picture of the whole window takes as long
    return seen


def test_the_picture_goes_with_the_hand_and_back(real: RealWindow, tmp_path: Path) -> None:
    own, (x, y) = real.ask(LOOK), real.at("viewport.centre")
    real.do("editor.select('ball.0')")
    real.key("o")
    assert real.ask("editor.view.mode") == "orbit"
    real.wait_until(IS_WHOLE)
    before = picture(real, tmp_path)
    real.drag((x, y), by=(90, 20), button=2, let_go=False)
    real.wait_until("editor.status.shown_by == 'Orbit'")  # while the hand still holds the camera
    turned = until_it_differs(real, before, tmp_path)
    real.release(2)
    assert real.ask(UNDO) == "orbit"
    real.wheel(1.0, (x, y), times=6)
    nearer = until_it_differs(real, turned, tmp_path)
    real.key("f")
    assert real.ask(UNDO) == "frame ball" and real.n_steps() == 0
    assert real.ask("len(editor.camera_history.history.undo_steps)") == 3
    real.key("alt+z", "alt+z", "alt+z")
    assert real.ask(LOOK) == own and real.ask(UNDO) is None
    until_it_differs(real, nearer, tmp_path)


def test_esc_in_mid_drag_restores_and_the_key_leads_back_to_placement(real: RealWindow) -> None:
    own, (x, y) = real.ask(LOOK), real.at("viewport.centre")
    assert real.ask("editor.view.mode") == "orbit"
    real.drag((x, y), by=(90, 20), button=2, let_go=False)
    assert real.ask(LOOK) != own and real.ask("editor.camera_history.history.dragging")
    real.key("escape")
    real.release(2)
    assert real.ask(LOOK) == own and real.ask(UNDO) is None
    real.key("o")
    assert real.ask("editor.view.mode") == "placement"
    real.wait_until("editor.status.shown_by == '' and editor.status.picture != 'waiting'")
