"""The real GLFW window under Xvfb, and what is said where there is none."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

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


def run(tmp_path: Path, *command: str, require: int = 410, **environment: str) -> subprocess.CompletedProcess[str]:
    outside = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run(
        [*command, sys.executable, "-c", PROGRAM, str(require)],
        cwd=ROOT,
        env=outside | {"INSITU_STATE": str(tmp_path)} | environment,
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
