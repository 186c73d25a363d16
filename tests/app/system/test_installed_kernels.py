"""What was compiled when Insitu was installed, others need not compile; what is not of these sources nobody takes."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from app.system import kernel_cache as installed_kernels
from app.system.kernel_cache import NUMBA_VARIABLE, keep_installed, kernel_folders, take_installed, use_kernel_cache
from app.worker import kernels
from app.worker.kernels import LATER, PARTS, Kernels

FIRST, SECOND = kernel_folders()[:2]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The installation's kernels, as one person's first start has left them."""
    folder = tmp_path / "site-packages" / "kernels"
    folder.parent.mkdir()
    monkeypatch.setattr(installed_kernels, "installed_folder", lambda: folder)
    monkeypatch.setenv(NUMBA_VARIABLE, str(tmp_path / "who installs"))
    for name in (FIRST, SECOND, "older_kernels-0123"):
        write(tmp_path / "who installs" / name / "kernel.nbc", "compiled")
    for what in ("", *LATER):
        kernels.note_compiled(what)
    keep_installed()
    return folder


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def go_home(home: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Be another person; the folder that kernels are then kept in."""
    for variable in ("XDG_CACHE_HOME", "HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(variable, str(home))
    monkeypatch.delenv(NUMBA_VARIABLE)
    use_kernel_cache()
    return Path(os.environ[NUMBA_VARIABLE])


def test_another_home_has_nothing_to_compile(installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[str] = []
    monkeypatch.setattr(kernels, "_start_compiler", started.append)
    assert sorted(path.name for path in installed.iterdir() if path.is_dir()) == sorted([FIRST, SECOND])
    cache = go_home(tmp_path / "home", monkeypatch)
    assert cache.is_relative_to(tmp_path / "home")
    assert not Kernels().first_time and started == []
    assert all(map(kernels.are_compiled, LATER))
    assert [(cache / name / "kernel.nbc").read_text() for name in (FIRST, SECOND)] == ["compiled"] * 2


def test_other_sources_are_compiled(installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[str] = []
    monkeypatch.setattr(kernels, "_start_compiler", started.append)
    for module in (kernels, installed_kernels):
        monkeypatch.setattr(module, "kernel_digest", lambda: "another")
    cache = go_home(tmp_path / "home", monkeypatch)
    assert Kernels().first_time and started == list(PARTS)
    assert (cache / FIRST).is_dir()  # the file that did not change


def test_what_was_begun_is_finished(installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file's kernels of which some are there already stay, and whether all are is then left to the compiler."""
    cache = go_home(tmp_path / "home", monkeypatch)
    write(cache / FIRST / "kernel.nbc", "begun")
    take_installed()
    assert [(cache / name / "kernel.nbc").read_text() for name in (FIRST, SECOND)] == ["begun", "compiled"]
    assert not kernels.are_compiled()


def test_a_folder_of_the_users_choice_is_left_empty(
    installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(NUMBA_VARIABLE, str(tmp_path / "chosen"))
    take_installed()
    assert not (tmp_path / "chosen").exists()


def test_an_installation_that_cannot_be_written_is_left_alone(
    installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "file", "mine")
    monkeypatch.setattr(installed_kernels, "installed_folder", lambda: tmp_path / "file" / "kernels")
    keep_installed()
    go_home(tmp_path / "home", monkeypatch)
    take_installed()
    assert (tmp_path / "file").read_text() == "mine"
