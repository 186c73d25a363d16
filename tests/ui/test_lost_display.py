"""The display goes while edits are unsaved: Xlib ends the process at once, and nothing of Python runs any more."""

from __future__ import annotations

import time
from pathlib import Path

import psutil
import pytest

from app.files.journal import WRITE_SECONDS, recoverable_sessions
from tests.ui.real_window import opened


@pytest.mark.window
def test_edits_outlive_the_display(tmp_path: Path) -> None:
    with opened(tmp_path) as real:
        real.do("from app.document.commands.light import SetIntensity; editor.do(SetIntensity(7.0))")
        time.sleep(2.0 * WRITE_SECONDS)  # a second, for what the journal promises
        for server in psutil.Process().children():
            if server.name() == "Xvfb":
                server.kill()
        assert real.wait_for_end(20.0) != 0
        (recovery,) = recoverable_sessions(tmp_path / "state" / "journals")
        assert recovery.load().document.light.intensity == 7.0
