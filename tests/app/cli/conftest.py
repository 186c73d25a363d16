"""A scene of one ball for the command line."""

from pathlib import Path

import pytest

from tests.app.cli.command_line import SCENE


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A file of it."""
    (tmp_path / "ball.toml").write_text(SCENE)
    return tmp_path / "ball.toml"
