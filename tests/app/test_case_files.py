"""Files of public bug reports, kept beside the checkout: each is opened and described, none ends in a traceback."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.document.sources import LIGHT_ENDINGS, SCENE_ENDINGS
from tests.app.cli.command_line import run

Captured = pytest.CaptureFixture[str]
OPENED = (*SCENE_ENDINGS, *LIGHT_ENDINGS)


def test_every_case_is_described(shared_data: Path, capsys: Captured) -> None:
    """None is refused, and what is said of each is there for people and for programs."""
    cases = shared_data / "cases"
    files = [file for file in sorted(cases.rglob("*.*")) if file.suffix in OPENED and file.parent.name != "attacks"]
    assert len(files) > 50
    refused = []
    for file in files:
        status = run("info", file, "--json")
        out, error = capsys.readouterr()
        if status:
            refused.append(error.strip())
            continue
        found = json.loads(out)
        assert found["kind"] == "environment" or (found["n_triangles"] > 0 and found["objects"]), file
        for each in found.get("unshown", []):
            assert each["name"] and each["count"] > 0 and each["effect"], file
    assert not refused


def test_every_attack_is_described_or_refused_in_one_line(shared_data: Path, capsys: Captured) -> None:
    files = sorted((shared_data / "cases" / "attacks").glob("*.*"))
    assert files
    for file in files:
        status = run("info", file)
        out, error = capsys.readouterr()
        assert (status, error) == (0, "") or (status == 1 and error.count("\n") == 1), file
        assert all(line.isprintable() for line in (out + error).splitlines()), file
        assert "bug" not in error, error
