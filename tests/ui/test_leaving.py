"""Leaving what is open with unsaved edits, bringing back what was left, and the names that tell where one is.

In the real window where a person would meet it: the cross of the window, Ctrl+Q, Ctrl+N, files that are dropped.
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.document.commands.light import SetRotation
from app.files.journal import Journal, recoverable_sessions
from app.files.session import load_session
from engine.curve.operators import Operator
from tests.ui.real_window import RealWindow, real_window_fixture
from ui.headless import HeadlessWindow
from ui.panels.actions import Action, AnswerUnsaved, OpenFile, Quit, Recover, RunOperator, SaveSession, SetPanel

real = real_window_fixture()


def edit(real: RealWindow) -> None:
    real.drag("curve.magnitude", by=(0, -40))
    assert real.ask("editor.session.is_unsaved")


def quit_is_asked_for(real: RealWindow) -> bool:
    """Whether the window is about to end; a test must not let it."""
    return real.ask("stage.quits")


@pytest.fixture
def kept(real: RealWindow) -> Iterator[RealWindow]:
    """A fresh window that notes that it would end, and stays."""
    real.fresh()
    real.do(
        "import dataclasses\n"
        "stage.quits = False\n"
        "frame = type(shell).frame\n"
        "def noted(*arguments):\n"
        "    result = frame(shell, *arguments)\n"
        "    stage.quits = stage.quits or result.quit\n"
        "    return dataclasses.replace(result, quit=False)\n"
        "shell.frame = noted\n"
    )
    yield real
    real.do("del shell.frame")


@pytest.mark.window
def test_the_title_names_the_scene_and_what_is_unsaved(kept: RealWindow, tmp_path: Path) -> None:
    assert kept.ask("window._shown_title") == "stand-in - Insitu"
    edit(kept)
    assert kept.ask("window._shown_title") == "stand-in* - Insitu"
    kept.key("ctrl+z")
    assert kept.ask("window._shown_title") == "stand-in - Insitu"
    kept.key("ctrl+y")
    kept.do(f"from pathlib import Path; editor.save(Path({str(tmp_path / 'blue.insitu')!r}))")
    assert kept.ask("window._shown_title") == "blue - Insitu"


@pytest.mark.window
def test_the_windows_cross_asks_once_and_then_leaves_it_to_the_journal(kept: RealWindow) -> None:
    edit(kept)
    kept.do("window._on_close(window.handle)")
    assert not quit_is_asked_for(kept) and kept.ask("type(state.pending_action).__name__") == "Quit"
    kept.key("escape")
    assert kept.ask("state.pending_action") is None and kept.ask("editor.session.is_unsaved")
    assert kept.ask("editor.view.selected is not None")  # Esc did one thing
    kept.do("window._on_close(window.handle)")
    kept.do("window._on_close(window.handle)")
    assert quit_is_asked_for(kept) and kept.ask("editor.session.is_unsaved")


@pytest.mark.window
def test_without_unsaved_edits_nothing_is_asked(kept: RealWindow) -> None:
    kept.key("ctrl+q")
    assert quit_is_asked_for(kept) and kept.ask("state.pending_action") is None


@pytest.mark.window
def test_quitting_saves_under_a_name_with_the_keyboard_alone(kept: RealWindow, tmp_path: Path) -> None:
    edit(kept)
    kept.do(f"from pathlib import Path; shell.actor.files.folders['scene'] = Path({str(tmp_path)!r})")
    kept.key("ctrl+q")
    assert not quit_is_asked_for(kept)
    kept.key("enter")  # Save: asks for a name, which stands there and is selected
    assert kept.ask("state.question.name") == "stand-in.insitu"
    kept.text("teal")
    assert kept.ask("state.question.name") == "teal" and not quit_is_asked_for(kept)
    kept.key("enter")
    assert (tmp_path / "teal.insitu").is_file()
    assert quit_is_asked_for(kept) and not kept.ask("editor.session.is_unsaved")


@pytest.mark.window
def test_a_new_scene_asks_what_becomes_of_the_edits(kept: RealWindow) -> None:
    edit(kept)
    before = kept.ask("sum(type(r).__name__ == 'OpenScene' for r in client.requests)")
    kept.key("ctrl+n")
    assert kept.ask("type(state.pending_action).__name__") == "OpenFile"
    kept.click("button.leave.cancel")
    assert kept.ask("state.pending_action") is None and kept.ask("editor.session.is_unsaved")
    kept.key("ctrl+n")
    kept.click("button.leave.discard")
    kept.wait_until(f"sum(type(r).__name__ == 'OpenScene' for r in client.requests) > {before}")
    kept.wait_until("not editor.session.is_unsaved and editor.status.picture == 'exact'")
    assert kept.ask("editor.document.source") == "empty"


@pytest.mark.window
def test_ctrl_s_asks_in_the_scenes_folder_with_the_name_to_be_typed(kept: RealWindow, tmp_path: Path) -> None:
    scene = tmp_path / "kitchen" / "scene.toml"
    scene.parent.mkdir()
    scene.touch()
    kept.restart(str(scene))
    kept.key("ctrl+s")
    assert kept.ask("(str(state.question.folder), state.question.name)") == (str(scene.parent), "kitchen.insitu")
    kept.text("x")
    assert kept.ask("state.question.name") == "x"
    kept.key("enter")
    assert (scene.parent / "x.insitu").is_file()
    # Both are in the menu now, the session first.
    assert kept.ask("[e.path.name for e in shell.actor.recent.entries()][:2]") == ["x.insitu", "scene.toml"]


@pytest.mark.gl
def test_no_sequence_loses_edits_that_nobody_gave_up(window: HeadlessWindow, tmp_path: Path) -> None:
    shell, editor = window.shell, window.shell.editor
    chance, saved = random.Random(7), tmp_path / "work.insitu"
    replaced = 0
    for _ in range(60):
        before, history, unsaved, waiting = (
            editor.document,
            editor.history,
            editor.session.is_unsaved,
            shell.state.pending_action,
        )
        action: Action = chance.choice(
            (
                SetRotation(chance.uniform(0.0, 90.0)), SetRotation(chance.uniform(0.0, 90.0)),
                RunOperator("undo"), Quit(),
                OpenFile("teatray"), AnswerUnsaved(is_saved=True), AnswerUnsaved(is_saved=False), SaveSession(saved),
                SaveSession(),
                SetPanel({"pending_action": None}), SetPanel({"question": None}),
            )
        )  # fmt: skip
        shell.do(action)
        window.frame()
        if editor.history is history:
            continue
        replaced += 1
        # Another document took its place: it was saved as it was, or given up by name, or had nothing unsaved.
        given_up = isinstance(action, AnswerUnsaved) and not action.is_saved and waiting is not None
        assert given_up or not unsaved or load_session(saved).document == before
        # Nothing waits any more for what has happened.
        assert shell.state.pending_action is None
    assert replaced > 3


@pytest.mark.gl
def test_saving_fails_and_nothing_is_left(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, shell = window.shell.editor, window.shell
    window.drag_handle("curve.magnitude", (0, -50))
    folder = tmp_path / "here"
    folder.mkdir()
    editor.save(folder / "work.insitu")
    window.drag_handle("curve.magnitude", (0, -20))
    (folder / "work.insitu").unlink()
    folder.rmdir()
    shell.do(OpenFile("teatray"), AnswerUnsaved(is_saved=True))
    assert isinstance(shell.state.pending_action, OpenFile) and editor.session.is_unsaved and editor.status.is_error


@pytest.mark.gl
def test_opening_what_is_not_there_asks_nothing(window: HeadlessWindow, tmp_path: Path) -> None:
    window.drag_handle("curve.magnitude", (0, -50))
    for name in ("gone.toml", "sky.exr", "notes.txt"):
        window.shell.do(OpenFile(str(tmp_path / name)))
        assert window.shell.state.pending_action is None and window.shell.editor.status.is_error
    window.shell.do(Quit())
    assert window.shell.state.pending_action == Quit()


@pytest.mark.gl
def test_all_that_was_left_is_listed_and_brought_back_one_by_one(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, shell = window.shell.editor, window.shell
    original, documents = editor.document, []
    for lift in (-50, -30, -70):
        window.drag_handle("curve.magnitude", (0, lift))
        documents.append(editor.document)
        editor.undo()
    assert editor.document == original
    for document in documents:
        journal = Journal(tmp_path)
        journal.note(0.0, document, editor.view, unsaved=True)
        journal.note(10.0, document, editor.view, unsaved=True)
        _abandon(journal)
    shell.actor.recoveries = tuple(recoverable_sessions(tmp_path))
    window.frames(3)
    assert [name for name in shell.handles.names() if name.startswith("button.recover.")] == [
        "button.recover.0", "button.recover.1", "button.recover.2",
    ]  # fmt: skip
    window.click_handle("button.discard.0")
    assert len(shell.actor.recoveries) == 2 == len(list(tmp_path.glob("*.insitu")))
    window.frames(2)
    expected = shell.actor.recoveries[0].load().document.layer("teapot.1").operators("theta_h")
    window.click_handle("button.recover.0")
    assert window.run_until(lambda: editor.document.layer("teapot.1").edits != (), 90.0)
    (made,) = editor.document.layer("teapot.1").operators("theta_h")
    assert isinstance(made, Operator) and (made,) == expected
    # The last is not thrown at the person, who works now: it waits in the File menu.
    window.frames(2)
    assert not shell.state.shows_recoveries and len(shell.actor.recoveries) == 1
    # Bringing it back would replace the edits on screen, so it asks.
    (last,) = shell.actor.recoveries
    shell.do(Recover(last, True))
    assert shell.state.pending_action == Recover(last, True)


def _abandon(journal: Journal) -> None:
    """What a sudden end leaves: the journal on disk, its lock dropped by the kernel."""
    journal._entries.put(None)
    journal._thread.join(10.0)
    journal._lock.release()
