"""Fixtures of the application's tests: a state folder of their own, a document, and a worker that only listens."""

from pathlib import Path

import pytest

from app.document.described import document_from_description
from app.document.document import Document
from app.editor.editor import Editor
from engine.scene.description import SceneDescription, parse_description
from tests.app.fake_worker import SCENE, FakeClient


@pytest.fixture(autouse=True)
def state_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Journals and layouts of a test: never the user's own."""
    folder = tmp_path / "state"
    monkeypatch.setenv("INSITU_STATE", str(folder))
    return folder


@pytest.fixture
def description() -> SceneDescription:
    return parse_description(SCENE, "scene.toml")


@pytest.fixture
def document(description: SceneDescription) -> Document:
    """Two objects: a pot of two layers, a floor of one; and a lamp."""
    return document_from_description("shelf", description)


@pytest.fixture
def client() -> FakeClient:
    return FakeClient()


@pytest.fixture
def editor(client: FakeClient) -> Editor:
    """An editor at time 0 with its scene open and its first transport asked for."""
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    return editor


@pytest.fixture
def settled(editor: Editor, client: FakeClient) -> Editor:
    """The editor at time 1 with all of the final picture delivered."""
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    client.requests.clear()
    return editor
