"""What the program keeps for itself is for its owner's eyes alone, and where it cannot be kept, nothing stops."""

import os
import stat
from pathlib import Path

import numpy as np
import pytest

from app.cli.console import run_guarded
from app.document.view_state import ViewState
from app.files.journal import Journal
from app.files.materials import Library
from app.system.barrier import Barrier
from app.system.paths import journal_directory, layout_file, material_directory, state_problem
from app.worker.cache import ArrayCache
from app.worker.worker import log_to_file
from engine.core.errors import InsituError
from engine.material import MODELS, make_layer
from ui.layout import LayoutMemory

LAYERS = (make_layer(MODELS["lambert"], {}, "chalk"),)


def modes(folder: Path) -> dict[str, int]:
    return {path.relative_to(folder).as_posix(): stat.S_IMODE(path.stat().st_mode) for path in folder.rglob("*")}


@pytest.fixture
def open_umask():
    before = os.umask(0)
    yield
    os.umask(before)


def fall(*_: object) -> int:
    raise ZeroDivisionError


def keep_everything(document) -> None:
    """One file of each kind."""
    journal = Journal()
    journal.note(10.0, document, ViewState(), True)
    journal.close(keep=True)
    LayoutMemory(layout_file(), 1.0).keep("wide", "[Window]", frozenset())
    run_guarded(fall)
    Barrier(holds=True).run("A part", fall, 0)


def test_files_of_ours_are_nobody_elses(
    document, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, open_umask: None
) -> None:
    monkeypatch.setenv("INSITU_STATE", str(tmp_path / "new" / "state"))
    keep_everything(document)
    Library().save("Chalk", LAYERS)
    stderr = os.dup(2)
    try:
        assert "worker.log" in log_to_file()
    finally:
        os.dup2(stderr, 2)
    store = ArrayCache(tmp_path / "new" / "cache")
    store.put("a", {"a": np.ones(3)})
    with store.open_tiles("b", 2) as tiles:
        tiles.append_tile(0, {"a": np.ones(3)})
    found = modes(tmp_path / "new")
    folders = {"state", "state/journals", "state/log", "state/materials", "cache"}
    assert {name for name, mode in found.items() if mode == 0o700} == folders
    files = {name for name, mode in found.items() if mode == 0o600}
    assert files == found.keys() - folders and len(files) == 9


def test_a_file_that_others_could_read_is_closed_to_them(document, tmp_path: Path, open_umask: None) -> None:
    """Written by a version that left it open."""
    (tmp_path / "a.arrays").touch()
    ArrayCache(tmp_path).put("a", {"a": np.ones(3)})
    assert modes(tmp_path) == {"a.arrays": 0o600}


@pytest.mark.parametrize("place", ["file", "file/state", "/proc/self/state"])
def test_without_a_folder_for_state_nothing_stops(
    document, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], place: str
) -> None:
    (tmp_path / "file").write_bytes(b"mine")
    monkeypatch.setenv("INSITU_STATE", str(tmp_path / place))
    assert journal_directory() == tmp_path / place / "journals" and material_directory().name == "materials"
    assert state_problem().startswith(f"{tmp_path / place}: cannot be written")
    keep_everything(document)
    library = Library()
    library.read_all()
    assert library.entries  # those that come with the program
    with pytest.raises(InsituError, match=f"^{tmp_path / place / 'materials' / 'chalk.toml'}: not written, "):
        library.save("Chalk", LAYERS)
    assert log_to_file() == "" and "a bug in Insitu (for a report: ZeroDivisionError: " in capsys.readouterr().err
    assert (tmp_path / "file").read_bytes() == b"mine"


def test_a_folder_for_state_that_is_there_is_no_problem(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("INSITU_STATE", str(tmp_path / "state"))
    assert state_problem() == ""
