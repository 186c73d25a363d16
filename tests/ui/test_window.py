"""The real GLFW window under Xvfb, and what is said where there is none."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from app.document.sources import EXPECTED
from engine.scene.mesh import MESH_ENDINGS
from tests.ui.test_files import exr_head

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = """
import sys, time
started = time.monotonic()
from tests.ui.stand_in import StandInClient
from ui import window

def on_frame(open_window):
    state = open_window.editor.status.picture
    if state == "exact":
        print(f"exact first_frame={open_window.first_frame_at - started:.3f}")
    return state == "exact" or time.monotonic() - started > 40.0

sys.exit(window.run("stand-in", client=StandInClient(), on_frame=on_frame, require=int(sys.argv[1])))
"""


# Drops files on the window as GLFW does: through the callback that is registered with it, C arguments and all.
DROPS = """
import ctypes, json, sys, time
import glfw
from tests.ui.stand_in import StandInClient
from ui import window
from ui.panels.actions import AnswerUnsaved

pending = json.loads(sys.argv[2])
client = StandInClient()

def dropped(open_window, names):
    raw = [name.encode("utf-8", "surrogateescape") for name in names]
    callback = window.glfw.set_drop_callback(open_window.handle, open_window._on_drop)
    callback(open_window.handle, len(raw), (ctypes.c_char_p * len(raw))(*raw))

def on_frame(open_window):
    editor = open_window.editor
    if open_window.shell.state.pending_action is not None:
        open_window.shell.request(AnswerUnsaved(is_saved=False))
        return False
    if editor.status.picture != "exact":
        return False
    if on_frame.said is not None:
        light = editor.document.light
        said = open_window.shell.state.message
        opened = [request.source for request in client.requests if hasattr(request, "source")]
        print(json.dumps([said.text, said.is_error, light.environment, light.mapping, opened[-1]]))
    if not pending:
        return True
    editor.notify("")
    names = pending.pop(0)
    if names == ["not UTF-8"]:
        open_window._take_events(lambda: dropped(open_window, ["/tmp/\\udcff.exr"]))
    else:
        dropped(open_window, names)
    on_frame.said = names
    return False

on_frame.said = None
sys.exit(window.run("stand-in", client=client, on_frame=on_frame, require=int(sys.argv[1])))
"""


def run(
    tmp_path: Path, *command: str, require: int = 410, program: str = PROGRAM, words: Sequence[str] = ()
) -> subprocess.CompletedProcess[str]:
    outside = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run(
        [*command, sys.executable, "-c", program, str(require), *words],
        cwd=ROOT,
        env=outside | {"INSITU_STATE": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=90,
    )


def under_xvfb() -> list[str]:
    runner = shutil.which("xvfb-run")
    if runner is None:
        pytest.skip("xvfb-run is not installed")
    return [runner, "-a", "-s", "-screen 0 1280x800x24"]


@pytest.mark.window
def test_the_real_window_shows_the_exact_picture(tmp_path: Path) -> None:
    done = run(tmp_path, *under_xvfb())
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("exact"), done.stdout + done.stderr
    assert (tmp_path / "layout.ini").read_text().startswith("; insitu layout")


@pytest.mark.window
def test_dropped_files_do_the_right_thing_or_say_why_not(tmp_path: Path) -> None:
    scene, probe, note = tmp_path / "kitchen.toml", tmp_path / "próbe.exr", tmp_path / "note.txt"
    scene.write_text("version = 1")  # the stand-in worker opens anything
    probe.write_bytes(exr_head(64, 64))
    note.touch()
    missing, lost, empty = tmp_path / "missing.hdr", tmp_path / "lost.toml", tmp_path / "empty"
    empty.mkdir()
    drops = [[probe], [note], [missing], [lost], [empty], [probe, scene], ["not UTF-8"], [scene]]
    words = json.dumps([[str(path) for path in paths] for paths in drops])
    done = run(tmp_path, *under_xvfb(), program=DROPS, words=[words])
    assert done.returncode == 0, done.stderr
    said = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(said) == len(drops), done.stdout + done.stderr
    lit = [str(probe.resolve()), "angular", "stand-in"]
    textures = "a texture (.png, .jpg, .jpeg, .webp, .ktx2)"
    expected = f"expected {EXPECTED}, a measured BRDF (.binary, .brdf, .bsdf), a table (.csv, .tsv) or {textures}"
    assert said[0] == ["", False, *lit]
    for words_said, line in zip(
        said[1:7],
        (
            f"{note}: {expected}",
            f"{missing}: there is no such file; nothing was changed",
            f"{lost}: there is no such file; nothing was changed",
            f"{empty}: no scene in it, expected a scene (.toml) or a mesh ({', '.join(MESH_ENDINGS)})",
            "2 files were dropped; drop one scene, session, environment or texture",
            "the dropped file's name is not UTF-8; rename it to open it here",
        ),
        strict=True,
    ):
        assert words_said == [line, True, *lit]
    # A scene is opened, with its own light, once it is said that the edits before it are not wanted.
    assert said[7][0] == "opened stand-in"
    assert said[7][1:] == [False, "scene", "latlong", str(scene.resolve())]


@pytest.mark.window
def test_a_gl_that_is_too_old_is_named(tmp_path: Path) -> None:
    done = run(tmp_path, *under_xvfb(), require=990)
    assert done.returncode == 1
    (line,) = done.stderr.strip().splitlines()
    assert "OpenGL 9.9 core is needed, found OpenGL" in line


def test_without_a_display_one_line_offers_the_commands(tmp_path: Path) -> None:
    done = run(tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert "no display" in line
    assert "insitu render" in line and "insitu screenshot" in line
