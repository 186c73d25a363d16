"""Commands replace nothing that they have read, and print any name: by the command line and by the window's editor."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from app.editor.editor import Editor
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.scene.scene_loader import load_scene
from tests.app.cli.command_line import SCENE, run
from tests.pictures import write_exr
from tests.ui.small_scene import coloured_sky, write_small_scene

Captured = pytest.CaptureFixture[str]


@pytest.fixture
def lit(tmp_path: Path) -> Path:
    """A scene in a folder with its sky."""
    folder = tmp_path / "scene"
    folder.mkdir()
    write_small_scene(folder)
    write_exr(folder / "other.exr", coloured_sky())
    return folder / "small.toml"


def contents(folder: Path) -> dict[str, bytes]:
    return {file.relative_to(folder).as_posix(): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is refused is refused before a picture is made."""
    monkeypatch.setattr("app.stills.stills.render_project", lambda *_, **__: pytest.fail("the work was done"))


def refused(capsys: Captured, *words: str | Path) -> str:
    assert run(*words) == 1
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


@pytest.mark.usefixtures("no_work")
def test_no_command_replaces_what_it_has_read(lit: Path, capsys: Captured) -> None:
    before = contents(lit.parent)
    for words in (
        ("render", lit, "-o", lit.with_name("sky.exr")),
        ("render", lit, "--set", f"light.environment={lit.with_name('other.exr')}", "-o", lit.with_name("other.exr")),
        ("export", lit, "-o", lit.parent),
        ("export-brdf", lit, "ball", "-o", lit),
        ("import-brdf", lit, "-o", lit),
    ):
        assert "the project reads this file; expected another name" in refused(capsys, *words)
        assert contents(lit.parent) == before


@pytest.mark.usefixtures("no_work")
def test_frames_replace_nothing_that_was_read(lit: Path, capsys: Captured) -> None:
    frame = lit.with_name("turn-0001.exr")
    lit.with_name("sky.exr").rename(frame)
    lit.write_text(lit.read_text().replace("sky.exr", frame.name))
    before = contents(lit.parent)
    words = ("render", lit, "-o", lit.with_name("turn.exr"), "--turntable", "2")
    assert "turn-0001.exr: the project reads this file" in refused(capsys, *words)
    assert contents(lit.parent) == before


@pytest.mark.usefixtures("no_work")
def test_outputs_that_cannot_be_are_refused_before_the_work(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    pipe, loop = tmp_path / "pipe.png", tmp_path / "loop.png"
    os.mkfifo(pipe)
    loop.symlink_to(loop)
    for output in (pipe, loop, tmp_path / ("x" * 252 + ".png")):
        assert "not written, " in refused(capsys, "render", scene, "-o", output)
    assert pipe.is_fifo() and loop.is_symlink()
    for name in ("pipe.png", "loop.png", "a\0b.png"):
        escaped = name.replace("\0", "\\u0000")
        (tmp_path / "script.toml").write_text(f'[[step]]\ncapture = "{escaped}"\n')
        words = ("screenshot", scene, "-o", tmp_path / "a.png", "--script", tmp_path / "script.toml")
        assert "defect" not in refused(capsys, *words)


def test_a_name_of_255_bytes_is_taken(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    output = tmp_path / ("x" * 251 + ".png")
    assert run("render", scene, "-o", output, "--lights", "50", "--resolution", "6", "4") == 0
    assert output.is_file()


@pytest.mark.parametrize(
    "language",
    [{"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, pytest.param({}, marks=pytest.mark.sweep)],
)
def test_any_name_is_printed(tmp_path: Path, language: dict[str, str]) -> None:
    """In a language without its characters, and of bytes that are no UTF-8: the picture is there, and said to be."""
    names = [os.fsencode("sonne-☀"), b"caf\xe9"]
    for name in names:
        folder = os.path.join(os.fsencode(tmp_path), name)
        os.mkdir(folder)
        with open(os.path.join(folder, b"ball.toml"), "w") as file:
            file.write(SCENE.replace("radiance = 0.5", 'file = "sky.exr"'))
        write_exr(Path(os.fsdecode(folder)) / "sky.exr", coloured_sky())
        words = [os.path.join(folder, b"ball.toml"), b"-o", os.path.join(folder, b"p.png"), b"--resolution", b"6", b"4"]
        done = subprocess.run(
            [sys.executable, "-m", "app", "render", *words, "--lights", "50"], capture_output=True,
            env={**os.environ, **language}, cwd=Path(__file__).parents[3],
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert b"p.png: 6 x 4" in done.stdout and done.stderr == b""
        assert os.path.isfile(os.path.join(folder, b"p.png"))


def test_the_editor_replaces_nothing_that_it_has_read(lit: Path, merl_file: Path) -> None:
    """Also not what an undone edit has read."""
    editor = Editor(InProcessClient(RequestDispatcher()), str(lit), resolution=(8, 6))
    while not editor.scene_is_open:
        editor.tick()
    other = lit.parent / "meshes" / "00_ground.ply"
    other.parent.mkdir()
    other.hardlink_to(lit.with_name("other.exr"))
    before = contents(lit.parent)
    from app.document.commands.light import set_environment_file

    assert editor.do(set_environment_file(lit.with_name("other.exr"))) is None
    editor.undo()
    assert "the project reads this file" in str(editor.exchange.export_scene(lit.parent))
    lit.with_name("sky.exr").rename(lit.with_name("moved.exr"))
    assert "00_ground.ply: the project reads this file" in str(editor.exchange.export_scene(lit.parent))
    lit.with_name("moved.exr").rename(lit.with_name("sky.exr"))
    editor.select("ball.1")
    lit.with_name("a.binary").symlink_to(lit)
    assert "a.binary: the project reads this file" in str(editor.exchange.export_measured(lit.with_name("a.binary")))
    assert "the project reads this file" in str(editor.save(_linked(lit, "b.insitu")))
    lit.with_name("a.binary").unlink()
    lit.with_name("b.insitu").unlink()
    assert contents(lit.parent) == before
    editor.close()


def _linked(target: Path, name: str) -> Path:
    target.with_name(name).symlink_to(target)
    return target.with_name(name)


def test_a_scene_knows_all_that_it_was_read_from(tmp_path: Path) -> None:
    for name in ("wood.png", "heights.png"):
        Image.new("RGB", (2, 2)).save(tmp_path / name)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    write_exr(tmp_path / "sky.exr", coloured_sky())
    mesh = 'mesh = "a.obj"\nbump_map = { file = "heights.png", height = 0.1 }'
    scene = SCENE.replace('primitive = "sphere"', mesh).replace("radiance = 0.5", 'file = "sky.exr"')
    (tmp_path / "scene.toml").write_text(scene.replace("albedo = 1.0", 'albedo = 1.0, texture = "wood.png"'))
    files = {path.name for path in load_scene(tmp_path / "scene.toml").files}
    assert files == {"scene.toml", "a.obj", "sky.exr", "wood.png", "heights.png"}
    assert {path.name for path in load_scene(tmp_path / "a.obj").files} == {"a.obj", "studio.exr"}
