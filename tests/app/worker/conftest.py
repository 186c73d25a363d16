"""A worker with faulty tasks, folders of its own, and a tiny scene."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.worker.cache import ArrayCache
from app.worker.client import Client
from tests.app.worker.ball_and_lamp import SCENE
from tests.app.worker.faulty_tasks import HANDLERS


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


@pytest.fixture
def source(tmp_path: Path) -> str:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return str(path)


@pytest.fixture
def store(tmp_path: Path) -> ArrayCache:
    return ArrayCache(tmp_path / "cache")
