"""What is seen behind all, chosen in the Light panel: a step of the history, saved, and free."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.document.background import Background
from app.document.view_state import OpenPanel
from app.files.session import load_session
from tests.ui.stand_in import StandInClient
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl


@pytest.fixture
def panel(window: HeadlessWindow) -> HeadlessWindow:
    for other in ("library", "brdf", "accuracy", "plan", "material"):  # room for all rows
        window.shell.editor.do(OpenPanel(other, False))
    window.frames(6)
    return window


def choose(window: HeadlessWindow, title: str) -> None:
    window.click_handle("light.background")
    window.frames(2)
    window.click_handle(f"light.background.{title}")
    window.frames(3)


def test_each_background_is_one_step_and_saved(panel: HeadlessWindow, tmp_path: Path) -> None:
    editor, before = panel.shell.editor, panel.shell.editor.document
    assert before.background == Background()
    choose(panel, "Transparent")
    assert editor.document.background.kind == "transparent" and editor.document.light == before.light
    choose(panel, "Colour")
    n_steps = len(editor.history.undo_steps)
    panel.drag_handle("light.background_colour.r", (-30.0, 0.0))
    red, green, _ = editor.document.background.colour
    assert red < green == 0.8 and len(editor.history.undo_steps) == n_steps + 1
    assert editor.save(tmp_path / "a.insitu") is None
    assert load_session(tmp_path / "a.insitu").document.background == editor.document.background
    for _ in range(3):
        editor.undo()
    assert editor.document == before


def test_nothing_is_computed_again(panel: HeadlessWindow) -> None:
    client = panel.shell.editor._client
    assert isinstance(client, StandInClient)
    n_requests = len(client.requests)
    for title in ("Transparent", "Colour", "Environment"):
        choose(panel, title)
    assert len(client.requests) == n_requests
