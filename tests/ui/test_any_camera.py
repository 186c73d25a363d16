"""Whatever a hand does with camera, views, edits and scenes in any order: no fault, and a session comes back equal."""

from __future__ import annotations

from pathlib import Path
from random import Random

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.layers import SetParameter
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.files.bookmarks import without_thumbnails
from app.files.session import load_session
from engine.core.camera import camera_frame
from tests.ui.stand_in import StandInClient
from ui.headless import HeadlessWindow
from ui.panels.actions import MoveCameraTo, OpenFile, RunOperator, SetPreference
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl

Key = imgui.Key
MODIFIERS = ((), (Key.mod_shift,), (Key.mod_ctrl,), (Key.mod_alt,), (Key.mod_ctrl, Key.mod_alt))
KEYS = (
    Key.f, Key.home, Key.n, Key.o, Key.keypad1, Key.keypad3, Key.keypad7, Key.keypad4, Key.keypad8, Key.keypad_add,
    Key.keypad_subtract, Key.keypad0, Key._0, Key._1, Key.escape, Key.c, Key.space,
)  # fmt: skip
STEPS = 60


def something(window: HeadlessWindow, random: Random, folder: Path) -> str:
    """One thing that a hand may do, and what it was."""
    editor, shell = window.shell.editor, window.shell
    what = random.choice(
        ("drag", "drag", "drag", "cancelled", "wheel", "wheel", "key", "key", "undo view", "redo view", "undo", "redo",
         "edit", "keep", "go", "rename", "delete", "mouse", "size", "open", "save", "wait")
    )  # fmt: skip
    x, y = 480.0 + random.uniform(-200, 200), 280.0 + random.uniform(-150, 150)
    held, bookmarks = random.choice(MODIFIERS), editor.view.bookmarks
    match what:
        case "drag" | "cancelled" | "wheel":
            window.move(x, y)
            for key in held:
                window.hold(key, True)
            if what == "wheel":
                shell.events.wheel(random.uniform(-2, 2), random.uniform(-30, 30))
            else:
                button = random.randrange(3)
                window.press(button)
                window.move(x + random.uniform(-900, 900), y + random.uniform(-900, 900))
                if random.random() < 0.2:
                    shell.do(OpenFile("teatray"))  # another scene in mid-drag
                window.move(x + random.uniform(-900, 900), y + random.uniform(-900, 900))
                if what == "cancelled":
                    window.key(Key.escape)
                window.release(button)
            for key in held:
                window.hold(key, False)
        case "key":
            window.key(random.choice(KEYS))
        case "undo view":
            window.key(Key.z, Key.mod_alt)
        case "redo view":
            window.key(Key.z, Key.mod_shift, Key.mod_alt)
        case "undo":
            editor.undo()
        case "redo":
            editor.redo()
        case "edit":
            if editor.scene_is_open:
                editor.do(SetParameter("teapot.1", "alpha", random.uniform(0.1, 0.9)))
        case "keep":
            shell.do(RunOperator("save_view", random.choice((None, None, *(each.name for each in bookmarks)))))
        case "go" if bookmarks:
            chosen = random.choice(bookmarks)
            shell.do(MoveCameraTo(chosen.viewpoint, chosen.name))
        case "rename" if bookmarks:
            names = random.choice(bookmarks).name, random.choice(("", "View 1", "a" * 64, "Größe"))
            shell.do(RunOperator("rename_view", names))
        case "delete" if bookmarks:
            editor.do(SetView.of(bookmarks=bookmarks[1:]))
        case "mouse":
            shell.do(SetPreference({"mouse": random.choice(("blender", "maya"))}))
            shell.do(SetPreference({"scroll": random.choice(("dolly", "orbit"))}))
        case "size":
            editor.camera_history.resize(random.choice((None, (48, 32), (20, 60))))
        case "open":
            shell.do(OpenFile("teatray"))
        case "save":
            assert editor.save(folder / "any.insitu") is None
            saved = load_session(folder / "any.insitu").view
            assert (saved.viewpoint, saved.bookmarks) == (editor.view.viewpoint, editor.view.bookmarks)
    window.frames(random.choice((1, 2, 30)) if what == "wait" else 1)
    return what


@pytest.mark.parametrize("seed", [1, *[pytest.param(seed, marks=pytest.mark.sweep) for seed in range(2, 12)]])
def test_whatever_a_hand_does(context: moderngl.Context, tmp_path: Path, seed: int) -> None:
    editor = Editor(StandInClient(), "stand-in")
    window = HeadlessWindow(editor, size=(1100, 700), context=context)
    window.shell.source = feed = PictureFeed(context, editor.mode)
    assert window.run_until(lambda: editor.status.picture == "exact", 90.0)
    random, done = Random(seed), list[str]()
    for _ in range(STEPS):
        done.append(something(window, random, tmp_path))
        assert np.all(np.isfinite(camera_frame(editor.camera_history.camera))), done
        assert not editor.camera_history.history.dragging and window.shell.state.grip is None, done
    # Through the view's whole history and back: it stays where it was.
    look, document = editor.view.viewpoint, editor.document
    n = len(editor.camera_history.history.undo_steps)
    while editor.camera_history.undo() is not None:
        assert np.all(np.isfinite(camera_frame(editor.camera_history.camera)))
    for _ in range(n):
        editor.camera_history.redo()
    assert editor.view.viewpoint == look and editor.document is document
    editor.end_drag()
    assert editor.save(tmp_path / "end.insitu") is None and not editor.session.is_unsaved
    assert without_thumbnails(load_session(tmp_path / "end.insitu").view.bookmarks) == without_thumbnails(
        editor.view.bookmarks
    )
    feed.close()
    window.close()
    editor.close()
