"""Opening, saving and recovering from the window: dropped files, the browser, the strip over the picture."""

from __future__ import annotations

import struct
from datetime import datetime
from pathlib import Path

import pytest
from imgui_bundle import imgui

from app.journal import Journal, recoverable_sessions
from engine.curve.operators import Operator
from ui.actor import picture_name, suggested_name
from ui.headless import HeadlessWindow
from ui.panels.actions import OpenFile, SaveSession
from ui.panels.dialogs import answer, entries
from ui.panels.state import FileQuestion
from ui.probe_file import looks_angular


def exr_head(width: int, height: int) -> bytes:
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    return b"\x76\x2f\x31\x01\x02\x00\x00\x00dataWindow\x00box2i\x00" + struct.pack("<i", 16) + window


@pytest.mark.parametrize(
    ("name", "content", "angular"),
    [
        ("probe.exr", exr_head(512, 512), True),
        ("sky.exr", exr_head(1024, 512), False),
        ("probe.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 900 +X 900\n", True),
        ("sky.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 512 +X 1024\n", False),
        ("empty.hdr", b"", False),
    ],
)
def test_square_probes_are_angular(tmp_path: Path, name: str, content: bytes, angular: bool) -> None:
    file = tmp_path / name
    file.write_bytes(content)
    assert looks_angular(file) is angular


def test_what_is_no_file_is_not_read(tmp_path: Path) -> None:
    assert not looks_angular(tmp_path)
    assert not looks_angular(tmp_path / "missing.exr")


def test_the_browser_lists_folders_first_and_hides_the_rest(tmp_path: Path) -> None:
    for name in ("b.toml", "a.insitu", "note.txt", ".hidden.toml"):
        (tmp_path / name).touch()
    (tmp_path / "zebra").mkdir()
    names = [entry.path.name for entry in entries(tmp_path, (".toml", ".insitu"))]
    assert names == ["zebra", "a.insitu", "b.toml"]
    assert entries(tmp_path / "missing", (".toml",)) == []


def test_answers_become_actions(tmp_path: Path) -> None:
    save, _ = answer(FileQuestion("save_session", tmp_path), tmp_path / "work")
    assert save == SaveSession(tmp_path / "work.insitu")
    opened, _ = answer(FileQuestion("open_scene", tmp_path), tmp_path / "scene.toml")
    assert opened == OpenFile(str(tmp_path / "scene.toml"))


def test_names_are_suggested() -> None:
    assert suggested_name("teatray") == "teatray.insitu"
    assert suggested_name("/home/someone/kitchen/scene.toml") == "kitchen.insitu"
    assert picture_name(Path("/p"), datetime(2030, 1, 2, 3, 4, 5)) == Path("/p/insitu-2030-01-02-030405.png")


@pytest.mark.gl
def test_saving_asks_for_a_name_once(window: HeadlessWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    editor = window.shell.editor
    window.drag_handle("material.alpha", (-40, 0))
    window.key(imgui.Key.s, imgui.Key.mod_ctrl)
    assert window.shell.state.question is not None
    window.frames(3)
    window.click_handle("button.files.confirm")
    (file,) = tmp_path.glob("*.insitu")
    assert editor.session_path == file
    assert window.shell.state.question is None
    file.unlink()
    window.key(imgui.Key.s, imgui.Key.mod_ctrl)
    # The second time it goes where it went before.
    assert window.shell.state.question is None
    assert file.is_file()


@pytest.mark.gl
def test_dropped_files_are_told_apart(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    probe = tmp_path / "probe.exr"
    probe.write_bytes(exr_head(64, 64))
    window.shell.actor.open(str(probe))
    assert editor.document.light.environment == str(probe)
    assert editor.document.light.mapping == "angular"
    before = editor.document
    window.shell.actor.open(str(tmp_path / "notes.txt"))
    assert editor.document == before
    assert editor.status.is_error and "notes.txt" in editor.status.message


@pytest.mark.gl
def test_what_a_journal_kept_is_offered_and_brought_back(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    original = editor.document
    window.drag_handle("curve.magnitude", (0, -50))
    edited = editor.document
    window.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert editor.document == original
    journal = Journal(tmp_path)
    journal.note(0.0, edited, editor.view, unsaved=True)
    journal.note(10.0, edited, editor.view, unsaved=True)
    _abandon(journal)
    (recovery,) = recoverable_sessions(tmp_path)
    window.shell.offer_recovery(recovery)
    window.frames(3)
    window.click_handle("button.recover")
    assert window.run_until(lambda: editor.document.layer("teapot.1").edits != (), 10.0)
    (made,) = editor.document.layer("teapot.1").operators("theta_h")
    assert isinstance(made, Operator)
    assert made == edited.layer("teapot.1").operators("theta_h")[0]
    assert window.shell.state.journal is None


def _abandon(journal: Journal) -> None:
    """What a sudden end leaves: the journal on disk, its lock dropped by the kernel."""
    journal._entries.put(None)
    journal._thread.join(10.0)
    journal._lock.close()
