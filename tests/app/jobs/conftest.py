"""A worker with faulty tasks, and folders of its own."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.jobs.client import Client
from tests.app.jobs.faulty_tasks import HANDLERS


@pytest.fixture
def state_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The worker's log and cache are this test's own."""
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("INSITU_STATE", str(tmp_path / "state"))
    return tmp_path / "state"


@pytest.fixture
def client(state_folder: Path) -> Iterator[Client]:
    with Client(HANDLERS, heartbeat=0.05) as client:
        yield client
