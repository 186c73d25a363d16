"""Whether a window can be opened is found out in a process of its own."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from ui.display import describe_display
from ui.window import NoDisplay

ROOT = Path(__file__).resolve().parents[2]


def test_no_display_is_an_error_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(NoDisplay, match="DISPLAY"):
        describe_display()


@pytest.mark.window
def test_a_display_tells_its_size_and_renderer() -> None:
    runner = shutil.which("xvfb-run")
    if runner is None:
        pytest.skip("xvfb-run is not installed")
    command = [runner, "-a", "-s", "-screen 0 1280x800x24", sys.executable, "-m", "ui.display"]
    outside = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(command, cwd=ROOT, env=outside, capture_output=True, text=True, timeout=90)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("1280 x 800, ") and "OpenGL" in done.stdout
