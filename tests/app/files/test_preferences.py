"""The list of recent files: newest first, bounded, shared by windows, and never a reason to fail."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.files.preferences import MOST, RecentFiles


def names(recent: RecentFiles) -> list[str]:
    return [entry.path.name for entry in recent.entries()]


def test_the_newest_is_first_and_each_is_there_once(tmp_path: Path) -> None:
    recent = RecentFiles(tmp_path / "recent.txt")
    for name in ("a.toml", "b.toml", "a.toml", "c.insitu"):
        recent.add(tmp_path / name)
    assert names(recent) == names(RecentFiles(tmp_path / "recent.txt")) == ["c.insitu", "a.toml", "b.toml"]


def test_no_more_than_ten_are_kept(tmp_path: Path) -> None:
    recent = RecentFiles(tmp_path / "recent.txt")
    for number in range(25):
        recent.add(tmp_path / f"{number}.toml")
    assert names(recent) == [f"{number}.toml" for number in range(24, 14, -1)] and MOST == 10


def test_missing_files_are_reported(tmp_path: Path) -> None:
    recent = RecentFiles(tmp_path / "recent.txt")
    (tmp_path / "there.toml").touch()
    recent.add(tmp_path / "gone.toml")
    recent.add(tmp_path / "there.toml")
    assert [entry.exists for entry in recent.entries()] == [True, False]


def test_two_windows_share_one_list(tmp_path: Path) -> None:
    one, two = RecentFiles(tmp_path / "recent.txt"), RecentFiles(tmp_path / "recent.txt")
    one.add(tmp_path / "one.toml")
    two.add(tmp_path / "two.toml")
    assert names(two) == names(RecentFiles(tmp_path / "recent.txt")) == ["two.toml", "one.toml"]


@pytest.mark.parametrize("content", [b"", b"\xff\xfe\0\0\n", b"relative.toml\n", b"/x\0y.toml\n", b"\n" * 5000])
def test_a_damaged_list_is_an_empty_one(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "recent.txt").write_bytes(content)
    recent = RecentFiles(tmp_path / "recent.txt")
    assert recent.entries() == ()
    recent.add(tmp_path / "a.toml")
    assert names(RecentFiles(tmp_path / "recent.txt")) == ["a.toml"]


def test_a_folder_that_cannot_be_written_costs_only_the_memory(tmp_path: Path) -> None:
    recent = RecentFiles(tmp_path / "missing" / "recent.txt")
    recent.add(tmp_path / "a.toml")
    assert names(recent) == ["a.toml"]
    assert not (tmp_path / "missing").exists()


def test_names_that_no_system_takes_are_not_there(tmp_path: Path) -> None:
    (tmp_path / "recent.txt").write_text(f"/{'x' * 300}.toml\n/{'y/' * 3000}z.toml\n")
    assert [entry.exists for entry in RecentFiles(tmp_path / "recent.txt").entries()] == [False, False]


def test_names_of_any_bytes_are_kept(tmp_path: Path) -> None:
    odd = Path(str(tmp_path) + "/\udcff ü.toml")
    recent = RecentFiles(tmp_path / "recent.txt")
    recent.add(odd)
    assert [entry.path for entry in RecentFiles(tmp_path / "recent.txt").entries()] == [odd]
