"""What commands and the window show of names and values in somebody's files: plain lines, of a bounded number."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.cli.console import print_line
from app.cli.options import print_project_notes
from app.messages.editor_status import StatusMetrics
from engine.core.errors import LONGEST_LINE, MOST_NOTES
from engine.precompute.direct.pipeline import SkyState
from engine.scene.scene_loader import load_scene

HOSTILE = "\x1b]0;owned\x07\x1b[31mRED\nnote: all is well\r\u202e" + "A" * 100_000


def project_of(scene: object) -> Any:
    """What is told of: a scene without a sky."""
    return SimpleNamespace(scene=scene, sky=SkyState(None), notes=())


def test_lines_that_commands_print_are_plain(capsys: pytest.CaptureFixture[str]) -> None:
    print_line(f"{HOSTILE}: 48 x 36")
    print_project_notes(project_of(SimpleNamespace(notes=(HOSTILE, *map(str, range(1000))))))
    lines = capsys.readouterr().out.split("\n")
    assert lines.pop() == "" and len(lines) == 1 + MOST_NOTES + 1
    assert all(line.isprintable() and len(line) <= LONGEST_LINE + len("note: ") for line in lines)
    assert sum(line.startswith("note: all") for line in lines) == 0


def test_what_the_window_says_is_plain() -> None:
    gauges = StatusMetrics()
    gauges.note(HOSTILE, *map(str, range(1000)))
    gauges.note(HOSTILE)
    gauges.notify(HOSTILE, False)
    status = gauges.status(True)
    assert len(status.notes) == MOST_NOTES + 1 and status.notes[-1] == f"and {1001 - MOST_NOTES} more notes"
    assert all(line.isprintable() and len(line) <= LONGEST_LINE for line in (*status.notes, status.message))


def test_hostile_files_say_plain_lines(shared_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = sorted((shared_data / "cases" / "attacks").glob("*.glb"))
    assert files
    for file in files:
        print_project_notes(project_of(load_scene(file, (8, 6))))
        lines = capsys.readouterr().out.split("\n")[:-1]
        for line in lines:
            assert line.isprintable() and len(line) <= LONGEST_LINE + len("note: "), file.name
            assert line.startswith(f"note: {file.stem[:20]}"), line  # none is forged
