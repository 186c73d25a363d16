"""A mesh with Z up is turned in the editor, and a zip archive is open like its scene; edits stay.

Scenes are read and traced by the worker's own code in this process; the picture is not computed.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from app.document.commands.layers import SetParameter
from app.document.commands.light import SetRotation
from app.editor.editor import Editor
from app.operators.registry import OPERATORS, run_operator
from app.worker.schedule import InProcessClient
from tests.app.editor.test_reload import TETRAHEDRON, ReadingWorker

HIGH = TETRAHEDRON.replace("v 0 0 1", "v 0 0 7")  # along Z


def settle(editor: Editor) -> None:
    for k in range(40):
        editor.tick(0.5 * k)


@pytest.fixture
def editor(tmp_path: Path) -> Editor:
    (tmp_path / "part.obj").write_text(HIGH)
    found = Editor(InProcessClient(ReadingWorker()), str(tmp_path / "part.obj"))
    settle(found)
    return found


def test_turning_keeps_edits_and_undo_and_is_kept_by_the_session(editor: Editor, tmp_path: Path) -> None:
    assert editor.do(SetParameter("part.0", "albedo", 0.25)) is None
    assert editor.do(SetRotation(30.0)) is None
    distance = editor.camera_history.camera.position
    for turned in (True, False, True):
        assert run_operator(editor, "z_up") is None
        settle(editor)
        assert editor.document.source == str(tmp_path / "part.obj") + ("#z-up" if turned else "")
        assert OPERATORS["z_up"].is_on is not None and OPERATORS["z_up"].is_on(editor) is turned
        assert editor.document.layer("part.0").values["albedo"] == (0.25,) * 3
        assert editor.document.light.rotation == 30.0
    assert editor.camera_history.camera.position != distance  # the scene's own camera fits the mesh as it stands
    assert editor.undo() is not None and editor.document.light.rotation == 0.0
    editor.save(tmp_path / "part.insitu")
    again = Editor(InProcessClient(ReadingWorker()), str(tmp_path / "part.insitu"))
    settle(again)
    assert again.document == editor.document and again.document.source.endswith("part.obj#z-up")
    assert not again.session.is_unsaved
    run_operator(again, "z_up")
    settle(again)
    assert again.session.is_unsaved  # the session in the file is that of the other axis


def test_turning_twice_at_once_is_turning_back_and_reading_again_keeps_it(editor: Editor, tmp_path: Path) -> None:
    for _ in range(2):
        run_operator(editor, "z_up")
    settle(editor)
    assert editor.document.source == str(tmp_path / "part.obj")
    run_operator(editor, "z_up")
    run_operator(editor, "reload")
    settle(editor)
    assert editor.document.source == str(tmp_path / "part.obj") + "#z-up"


def test_a_scene_file_is_not_turned(tmp_path: Path) -> None:
    editor = Editor(InProcessClient(ReadingWorker()), "cornell")
    settle(editor)
    assert run_operator(editor, "z_up") == "a scene file says where its objects are; open a mesh"


def test_an_archive_opens_turns_and_is_read_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path / "cache"))
    for text in (HIGH, HIGH.replace("v 0 1 0", "v 0 2 0")):
        with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
            archive.writestr("deep/part.obj", text)
        if text == HIGH:
            editor = Editor(InProcessClient(ReadingWorker()), str(tmp_path / "a.zip"))
        else:
            assert run_operator(editor, "reload") is None
        settle(editor)
        assert editor.document.source == str(tmp_path / "a.zip") and editor.document.object("part")
    assert editor.status.message.startswith("reloaded part")
    assert run_operator(editor, "z_up") is None
    settle(editor)
    assert editor.document.source == str(tmp_path / "a.zip") + "#z-up" and editor.session.name == "a"
