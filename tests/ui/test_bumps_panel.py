"""Bumps in the window: loaded by the browser, edited by hand, taken away, undone."""

from __future__ import annotations

from pathlib import Path

import pytest

from engine.material.bumps import NO_BUMPS, Bumps
from ui.headless import HeadlessWindow
from ui.panels.file_dialog import answer
from ui.panels.window_state import PanelState

pytestmark = pytest.mark.gl


def test_load_edit_and_clear(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, actor = window.shell.editor, window.shell.actor
    editor.select("teapot.0")
    window.frames(3)

    def bumps() -> Bumps:
        return editor.document.object("teapot").bumps

    window.click_handle("material.images.0")
    window.click_handle("material.bump_map")
    window.frames(2)
    question = window.shell.state.question
    assert question is not None and (question.purpose, question.key) == ("open_bump_map", "teapot")
    (tmp_path / "dents.png").touch()
    actor.perform([answer(question, tmp_path / "dents.png")], window.shell.state, 0.0)
    assert bumps() == Bumps(bump_map=str(tmp_path / "dents.png"))
    window.shell.state = PanelState()
    window.frames(2)
    window.drag_handle("material.bump_strength", (1000, 0))
    assert bumps().bump_strength == 10.0
    window.drag_handle("material.bump_repeats.u", (50, 0))
    assert bumps().bump_repeats[0] > 1.0
    window.drag_handle("material.bump_height", (50, 0))
    assert bumps().bump_height > 0.01
    for _ in range(3):  # a drag is one step
        editor.undo()
    assert bumps() == Bumps(bump_map=str(tmp_path / "dents.png"))
    window.frames(2)
    window.click_handle("button.clear_bumps")
    assert not bumps().file
    editor.undo()
    editor.undo()
    assert bumps() == NO_BUMPS
