"""The file dialog of the real window: what is typed into it, also quickly, and what it says of a wrong path."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.ui.real_window import RealWindow, chord_events, real_window_fixture
from ui import theme as look

pytestmark = pytest.mark.window

real = real_window_fixture()


@pytest.mark.parametrize(
    ("typed", "refusal"),
    [("nosuch.toml", "there is no such file"), ("nosuch", "there is no such file"), ("notes.txt", "expected a scene")],
)
def test_a_wrong_path_is_said_where_it_was_typed(real: RealWindow, tmp_path: Path, typed: str, refusal: str) -> None:
    real.fresh()
    (tmp_path / "notes.txt").touch()
    real.do("stage.before = editor.document, editor.view")
    real.key("ctrl+o")
    real.text(str(tmp_path / typed))
    real.key("enter")
    assert refusal in real.ask("state.question.refusal")
    real.shot(tmp_path / "refused.png")
    assert n_red(tmp_path / "refused.png") > 50
    assert refusal not in real.notice()  # it is said once
    # What is typed next goes into the field, which has the keyboard still, and not to the editor's shortcuts.
    real.text("q1m")
    assert real.ask("state.question.name") == "q1m" and real.ask("state.question.refusal") == ""
    assert real.ask("(editor.document, editor.view) == stage.before")
    real.key("escape")
    assert real.ask("state.question") is None


def n_red(file: Path) -> int:
    """Pixels of the colour in which the window says what is wrong."""
    pixels = np.asarray(Image.open(file).convert("RGB")).astype(int)
    return int(np.sum(np.abs(pixels - np.round(255.0 * np.asarray(look.BAD[:3]))).max(axis=-1) < 12))


def test_a_wrong_folder_is_said_where_it_was_typed(real: RealWindow, tmp_path: Path) -> None:
    real.fresh()
    real.key("ctrl+o")
    real.click("files.folder")
    real.text(str(tmp_path / "none"))
    real.key("enter")
    assert real.ask("state.question.refusal") == "there is no such folder"
    real.text(str(tmp_path))  # in the place of what was wrong
    real.key("enter")
    assert real.ask("(str(state.question.folder), state.question.refusal)") == (str(tmp_path), "")
    real.key("escape")


def test_a_file_that_cannot_be_written_is_said_in_the_dialog(real: RealWindow, tmp_path: Path) -> None:
    real.fresh()
    real.key("ctrl+shift+s")
    real.text(str(tmp_path / "none" / "a.insitu"))
    real.key("enter")
    assert "No such file or directory" in real.ask("state.question.refusal")
    real.text(str(tmp_path / "a.insitu"))
    real.key("enter")
    assert real.ask("state.question") is None and (tmp_path / "a.insitu").is_file()


def test_what_is_typed_quickly_arrives_in_one_frame(real: RealWindow, tmp_path: Path) -> None:
    """All of it, though a frame takes long: from the key that opens the dialog to the one that answers it."""
    real.fresh()
    folder = tmp_path / "A folder, all letters double: aabbccdd"
    folder.mkdir()
    real.slow(150)
    real.do("stage.before = editor.document, editor.view")
    before = real.ask("stage._frames")
    real.events(
        *chord_events("ctrl+o"),
        *[event for key in str(folder) for event in chord_events("space" if key == " " else key)],
        *chord_events("enter"),
        *[event for key in "xxyy" for event in chord_events(key)],
        *chord_events("backspace"),
        frames=2,
    )
    assert real.ask("(str(state.question.folder), state.question.name)") == (str(folder), "xxy")
    assert real.ask("stage._frames") - before < len(str(folder)) / 4  # a key may wait for the frame after
    assert real.ask("(editor.document, editor.view) == stage.before")
    real.key("escape")
