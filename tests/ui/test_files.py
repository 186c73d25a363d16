"""Opening and saving from the window: dropped files, the browser."""

from __future__ import annotations

import struct
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pytest
from imgui_bundle import imgui

from app.document.commands.light import SetIntensity
from app.document.light_state import LightState
from app.document.sources import likely_mapping, probe_size
from app.editor.editor import Editor
from app.files.session import load_session
from app.modes.placement.placement_messages import ComputeTransport
from app.system.atomic import add_inputs
from app.system.paths import display_name
from tests.ui.stand_in import StandInClient
from ui.action_handler import ActionHandler, picture_name
from ui.headless import HeadlessWindow
from ui.panels.actions import (
    AskFile,
    ExportMeasured,
    ImportMaterial,
    ImportMeasured,
    OpenFile,
    SavePicture,
    SaveSession,
    SetPanel,
)
from ui.panels.file_dialog import answer, entries
from ui.panels.window_state import FileQuestion


def exr_head(width: int, height: int) -> bytes:
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    return b"\x76\x2f\x31\x01\x02\x00\x00\x00dataWindow\x00box2i\x00" + struct.pack("<i", 16) + window


@pytest.mark.parametrize(
    ("name", "content", "size", "mapping"),
    [
        ("probe.exr", exr_head(512, 512), (512, 512), "angular"),
        ("sky.exr", exr_head(1024, 512), (1024, 512), "latlong"),
        ("probe.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 900 +X 900\n", (900, 900), "angular"),
        ("sky.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 512 +X 1024\n", (1024, 512), "latlong"),
        ("cross.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n+X 768 -Y 1024\r\n", (768, 1024), "cube"),
        ("empty.hdr", b"", None, "latlong"),
    ],
)
def test_the_size_of_probes_tells_their_mapping(
    tmp_path: Path, name: str, content: bytes, size: tuple[int, int] | None, mapping: str
) -> None:
    file = tmp_path / name
    file.write_bytes(content)
    assert probe_size(file) == size
    assert likely_mapping(file) == mapping


def test_what_is_no_file_is_not_read(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "missing.exr"):
        assert probe_size(path) is None
        assert likely_mapping(path) == "latlong"


def test_the_browser_lists_folders_first_and_hides_the_rest(tmp_path: Path) -> None:
    for name in ("b.toml", "a.insitu", "note.txt", ".hidden.toml"):
        (tmp_path / name).touch()
    (tmp_path / "zebra").mkdir()
    names = [entry.path.name for entry in entries(tmp_path, (".toml", ".insitu"))]
    assert names == ["zebra", "a.insitu", "b.toml"]
    assert [entry.path.name for entry in entries(tmp_path, ())] == ["zebra"]
    (tmp_path / "cup.Insitu.zip").touch()
    assert [entry.path.name for entry in entries(tmp_path, (".insitu.zip",))] == ["zebra", "cup.Insitu.zip"]
    assert entries(tmp_path / "missing", (".toml",)) == []


def test_answers_become_actions(tmp_path: Path) -> None:
    save = answer(FileQuestion("save_session", tmp_path), tmp_path / "work")
    assert save.action == SaveSession(tmp_path / "work.insitu")
    opened = answer(FileQuestion("open_scene", tmp_path), tmp_path / "scene.toml")
    assert opened.action == OpenFile(str(tmp_path / "scene.toml"))
    imported = answer(FileQuestion("open_measured", tmp_path), tmp_path / "nickel.binary")
    assert imported.action == ImportMeasured(tmp_path / "nickel.binary")
    cloth = answer(FileQuestion("open_measured", tmp_path, cloth=True), tmp_path / "velvet.binary")
    assert cloth.action == ImportMeasured(tmp_path / "velvet.binary", cloth=True)
    exported = answer(FileQuestion("save_measured", tmp_path), tmp_path / "copper")
    assert exported.action == ExportMeasured(tmp_path / "copper.binary")


def test_names_are_suggested() -> None:
    assert display_name("teatray") == "teatray"
    assert display_name("/home/someone/kitchen/scene.toml") == "kitchen"
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
    assert editor.session.path == file
    assert window.shell.state.question is None
    file.unlink()
    window.key(imgui.Key.s, imgui.Key.mod_ctrl)
    # The second time it goes where it went before.
    assert window.shell.state.question is None
    assert file.is_file()


@pytest.mark.gl
@pytest.mark.parametrize("name", ["x" * 300, "~nobody-of-that-name/a.insitu", "y/" * 3000])
def test_a_name_that_no_system_takes_is_said(window: HeadlessWindow, tmp_path: Path, name: str) -> None:
    shell = window.shell
    shell.do(AskFile("save_session"))
    assert shell.state.question is not None
    shell.do(SetPanel({"question": replace(shell.state.question, folder=tmp_path, name=name)}))
    window.frames(3)  # each asks whether there is such a file
    window.click_handle("button.files.confirm")
    assert "not written" in shell.editor.status.message and not list(tmp_path.rglob("*.insitu"))
    shell.do(OpenFile(str(tmp_path / name)))
    assert shell.editor.status.is_error and "fault" not in shell.editor.status.message


@pytest.mark.gl
def test_a_measurement_is_imported_as_cloth(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, shell = window.shell.editor, window.shell
    before = editor.document
    (tmp_path / "velvet.binary").touch()
    shell.do(AskFile("open_measured"))
    assert shell.state.question is not None and not shell.state.question.cloth
    shell.do(SetPanel({"question": replace(shell.state.question, folder=tmp_path, name="velvet.binary")}))
    window.frames(3)
    window.click_handle("files.measured.1")
    assert shell.state.question.cloth
    window.click_handle("button.files.confirm")
    window.frames(2)
    assert shell.state.question is None
    assert [layer.model.name for layer in editor.document.object("teapot").layers] == ["measured_cloth"]
    editor.undo()
    assert editor.document.objects == before.objects
    shell.do(ImportMeasured(tmp_path / "missing.binary"))
    assert editor.status.is_error and "there is no such file" in editor.status.message


@pytest.mark.gl
def test_each_kind_of_file_is_asked_for_where_the_last_one_was(
    window: HeadlessWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shell = window.shell
    actor = shell.actor = ActionHandler(shell.editor)
    for name in ("skies", "brdf", "pictures"):
        (tmp_path / name).mkdir()
    (tmp_path / "skies/probe.exr").write_bytes(exr_head(64, 64))
    (tmp_path / "brdf/velvet.binary").touch()

    def folder_of(purpose: str) -> Path:
        shell.do(AskFile(purpose))
        question = shell.state.question
        assert question is not None
        return question.folder

    actor.files.open(str(tmp_path / "skies/probe.exr"))
    actor.files.open(str(tmp_path / "brdf/velvet.binary"))
    beside = shell.editor.session.path_to_reopen.resolve().parent if shell.editor.session.path_to_reopen else tmp_path
    assert folder_of("save_picture") == folder_of("open_texture") == folder_of("save_scene") == beside
    assert folder_of("open_environment") == tmp_path / "skies"
    assert folder_of("open_measured") == folder_of("save_measured") == tmp_path / "brdf"
    shell.do(SavePicture(tmp_path / "pictures/tea.png"))
    assert folder_of("save_picture") == tmp_path / "pictures"
    shell.do(SetPanel({"question": None}))
    shell.editor.undo()


@pytest.mark.gl
@pytest.mark.parametrize(("choice", "name"), [(0, "stand-in.insitu.zip"), (1, "stand-in")])
def test_a_scene_is_saved_as_one_file_or_as_a_folder(
    window: HeadlessWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, choice: int, name: str
) -> None:
    saved: list[Path] = []
    monkeypatch.setattr(window.shell.editor.exchange, "save_scene", saved.append)
    window.shell.actor.files.folders["package"] = tmp_path
    window.shell.do(AskFile("save_package"))
    window.frames(3)
    for k in (1 - choice, choice):
        window.click_handle(f"files.package.{k}")
        window.frames(3)
    window.key(imgui.Key.enter)
    window.frames(3)
    assert saved == [tmp_path / name] and window.shell.state.question is None


@pytest.mark.gl
def test_dropped_files_are_told_apart(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    probe = tmp_path / "probe.exr"
    probe.write_bytes(exr_head(64, 64))
    window.shell.actor.files.open(str(probe))
    assert editor.document.light.environment == str(probe)
    assert editor.document.light.mapping == "angular"
    before = editor.document
    window.shell.actor.files.open(str(tmp_path / "notes.txt"))
    assert editor.document == before
    assert editor.status.is_error and "notes.txt" in editor.status.message


@pytest.mark.gl
def test_a_dropped_measurement_is_the_selected_objects_material(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, file = window.shell.editor, tmp_path / "gloss.bsdf"
    file.touch()  # the stand-in worker reads anything
    editor.select("teapot")
    window.shell.actor.files.open(str(file))
    window.frames(2)
    assert [layer.model.name for layer in editor.document.object("teapot").layers] == ["measured_diffuse", "measured"]


@pytest.mark.gl
def test_a_dropped_material_is_the_selected_objects_and_else_a_scene(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, file = window.shell.editor, tmp_path / "wood.mtlx"
    file.touch()
    editor.select("teapot")
    assert window.shell.actor.files.open_dropped([str(file)]) == [ImportMaterial(file)]
    assert answer(FileQuestion("open_material", tmp_path), file).action == ImportMaterial(file)
    editor.select(None)
    assert window.shell.actor.files.open_dropped([str(file)]) == [OpenFile(str(file))]


@pytest.mark.gl
def test_the_mapping_of_a_probe_can_be_switched(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    with pytest.raises(KeyError):  # the scene's own environment has its mapping in the scene's file
        window.shell.handle_position("light.mapping")
    probe = tmp_path / "probe.exr"
    probe.write_bytes(exr_head(64, 64))
    window.shell.actor.files.open(str(probe))
    guessed = editor.document
    assert guessed.light.mapping == "angular"
    window.frames(2)
    window.click_handle("light.mapping")
    window.frames(2)
    window.click_handle("light.mapping.latlong")
    assert editor.document.light.mapping == "latlong"
    assert window.run_until(lambda: _asked_light(editor).mapping == "latlong", 90.0)
    window.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert editor.document == guessed
    assert window.run_until(lambda: _asked_light(editor).mapping == "angular", 90.0)


@pytest.mark.gl
def test_a_panorama_is_no_angular_map(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    sky = tmp_path / "sky.exr"
    sky.write_bytes(exr_head(128, 64))
    window.shell.actor.files.open(str(sky))
    window.frames(2)
    before, steps = editor.document, len(editor.history.undo_steps)
    assert before.light.mapping == "latlong"
    window.click_handle("light.mapping")
    window.frames(2)
    window.click_handle("light.mapping.angular")
    assert editor.document is before and len(editor.history.undo_steps) == steps
    notice = window.shell.state.message
    assert notice is not None and notice.is_error
    assert notice.text == "sky.exr has 128 x 64 pixels, expected a square angular map; nothing changed"


def _asked_light(editor: Editor) -> LightState:
    """The light in the newest transport that was asked for."""
    client = editor._client
    assert isinstance(client, StandInClient)
    return next(request.scene.light for request in reversed(client.requests) if isinstance(request, ComputeTransport))


def test_a_session_that_another_window_has_saved_is_asked_about(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, shell = window.shell.editor, window.shell
    session = tmp_path / "s.insitu"
    window.shell.do(SaveSession(session))
    editor.do(SetIntensity(2.0))
    before = session.read_bytes() + b"# of another window\n"
    session.write_bytes(before)
    window.shell.do(SaveSession())
    question = shell.state.question
    assert question is not None and question.purpose == "save_session" and question.folder / question.name == session
    assert "written elsewhere" in editor.status.message and editor.session.is_unsaved and session.read_bytes() == before
    window.frames(3)
    window.click_handle("button.files.confirm")  # it says "Replace"
    window.frames(3)
    assert shell.state.question is None and not editor.session.is_unsaved
    assert load_session(session).document.light.intensity == 2.0


def test_a_picture_replaces_nothing_that_was_read(window: HeadlessWindow, tmp_path: Path) -> None:
    sky = tmp_path / "sky.exr"
    sky.write_bytes(b"light")
    add_inputs([sky])
    window.shell.request(SavePicture(sky, False))
    window.frames(3)
    assert "the project reads this file" in window.shell.editor.status.message and sky.read_bytes() == b"light"


@pytest.mark.gl
def test_a_folder_opens_as_a_scene_from_the_dialog(window: HeadlessWindow, tmp_path: Path) -> None:
    shell, opened = window.shell, list[str]()
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "scene.toml").touch()
    window.shell.editor.open = opened.append  # type: ignore[method-assign, assignment]
    shell.do(AskFile("open_scene"))
    assert shell.state.question is not None
    shell.do(SetPanel({"question": replace(shell.state.question, folder=tmp_path / "one")}))
    window.frames(3)
    window.click_handle("button.files.folder_scene")
    assert opened == [str(tmp_path / "one")] and shell.state.question is None
