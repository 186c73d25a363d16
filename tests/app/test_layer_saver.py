"""Pictures with layers, drawn by a process of their own: they are those of the command line, and can be stopped."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from app.document.commands.light import SetBackground
from app.document.document import Document
from app.document.view_state import SetView, ViewState
from app.project.project import open_project
from app.stills.layer_saver import LayerSaver
from engine.core.errors import InsituError
from tests.scene_text import LAMBERT, camera, environment, facing_up, placed

SIZE = 12, 9
SCENE = (
    camera((0.0, 1.0, 3.0), 40, SIZE, (0, 0.3, 0), "bounces = 1\n") + environment((0.4, 0.5, 0.7))
    + placed("ground", "quad", facing_up(1), LAMBERT)
)  # fmt: skip
VIEW = SetView.of(n_bounces=1).apply(ViewState())
LARGE = VIEW.from_viewpoint(VIEW.viewpoint._replace(resolution=(400, 300)))  # takes seconds to draw


@pytest.fixture
def document(tmp_path: Path) -> Document:
    (tmp_path / "scene.toml").write_text(SCENE)
    return open_project(str(tmp_path / "scene.toml")).document


@pytest.fixture
def saver() -> Iterator[LayerSaver]:
    made = LayerSaver()
    yield made
    made.close()


def messages(saver: LayerSaver) -> list[tuple[str, bool]]:
    """What is told next; of it all is told at once."""
    until = time.monotonic() + 120.0
    while not (found := saver.finished_messages()):
        assert time.monotonic() < until
        time.sleep(0.02)
    return found


def channels(path: Path) -> dict[str, np.ndarray]:
    found = OpenEXR.File(str(path), separate_channels=True).channels()
    return {name: np.asarray(channel.pixels) for name, channel in found.items()}


def test_the_document_is_drawn_with_its_edits_and_the_next_picture_waits(
    saver: LayerSaver, document: Document, tmp_path: Path
) -> None:
    document = SetBackground("transparent").apply(document)
    saver.save(document, VIEW, tmp_path / "a.exr")
    with pytest.raises(InsituError, match="b.exr: a.exr is still being saved"):
        saver.save(document, VIEW, tmp_path / "b.exr")
    assert saver.progress.startswith("saving a.exr")
    ((line, failed),) = messages(saver)
    assert not failed and line.startswith(f"saved {tmp_path / 'a.exr'} with") and not saver.is_busy
    found = channels(tmp_path / "a.exr")
    assert {"R", "G", "B", "A", "direct.R", "light_environment.R", "mask_ground.A", "albedo.R", "Z"} <= found.keys()
    np.testing.assert_allclose(found["light_environment.R"], found["R"], atol=1e-4)
    assert found["A"].shape == SIZE[::-1] and found["A"].min() == 0.0 and found["A"].max() > 0.5


def started(saver: LayerSaver) -> subprocess.Popen[bytes]:
    """The process of the picture that is being drawn, once it tells how far it is."""
    until = time.monotonic() + 120.0
    while (task := saver._drawing.task) is None or task.process is None or task.fraction == 0.0:
        assert time.monotonic() < until
        time.sleep(0.001)
    return task.process


@pytest.mark.parametrize("begun", [False, True], ids=["at once", "while it draws"])
def test_a_stopped_picture_leaves_the_file_as_it_was(
    saver: LayerSaver, document: Document, tmp_path: Path, begun: bool
) -> None:
    (tmp_path / "a.exr").write_bytes(b"before")
    saver.save(document, LARGE, tmp_path / "a.exr")
    process = started(saver) if begun else None
    saver.stop()
    assert not saver.is_busy and not saver.progress
    assert messages(saver) == [("stopped saving a.exr", False)]
    assert (tmp_path / "a.exr").read_bytes() == b"before" and (process is None or process.poll() is not None)
    saver.stop()  # of nothing
    assert saver.finished_messages() == []


def test_the_message_of_a_stopped_picture_does_not_end_the_next(
    saver: LayerSaver, document: Document, tmp_path: Path
) -> None:
    saver.save(document, LARGE, tmp_path / "a.exr")
    started(saver)
    saver.stop()
    saver.save(document, VIEW, tmp_path / "b.exr")
    assert messages(saver) == [("stopped saving a.exr", False)] and saver.is_busy
    ((line, failed),) = messages(saver)
    assert line.startswith(f"saved {tmp_path / 'b.exr'}") and not failed and (tmp_path / "b.exr").is_file()


def test_temporary_files_go_with_a_stopped_picture(
    saver: LayerSaver, document: Document, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    saver.save(document, LARGE, tmp_path / "a.exr")
    process = started(saver)
    (tmp_path / f".a.exr.{process.pid}-0.tmp").write_bytes(b"half")  # as where it is killed while it writes
    assert not list((tmp_path / "tmp").iterdir())  # the session went once it was read
    saver.close()
    assert not list(tmp_path.glob(".*.tmp")) and not list((tmp_path / "tmp").iterdir())


def test_a_process_that_dies_or_cannot_start_is_told(
    saver: LayerSaver, document: Document, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    saver.save(document, LARGE, tmp_path / "a.exr")
    started(saver).kill()
    ((line, failed),) = messages(saver)
    assert failed and line.startswith("a.exr: it was not drawn") and not saver.is_busy
    monkeypatch.setattr(sys, "executable", str(tmp_path / "no python"))
    saver.save(document, VIEW, tmp_path / "a.exr")
    ((line, failed),) = messages(saver)
    assert failed and line.startswith("a.exr: it could not be drawn") and "no python" in line
    assert not saver.is_busy and not (tmp_path / "a.exr").exists()


def test_what_cannot_be_drawn_is_told_in_a_line(saver: LayerSaver, document: Document, tmp_path: Path) -> None:
    with pytest.raises(InsituError, match="nowhere"):
        saver.save(document, VIEW, tmp_path / "nowhere" / "a.exr")
    saver.save(document, VIEW, tmp_path / "a.exr")
    (tmp_path / "scene.toml").unlink()  # before the process reads it
    ((line, failed),) = messages(saver)
    assert failed and "scene.toml" in line and "\n" not in line and not (tmp_path / "a.exr").exists()
