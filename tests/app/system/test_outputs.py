"""Where outputs may go: never over what the project was read from, never over what is no file; found out before."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.system.atomic import (
    add_inputs,
    replacing_folder,
    require_folder,
    require_no_input,
    require_place,
    save_file,
    set_inputs,
)
from engine.core.errors import InsituError


@pytest.fixture
def source(tmp_path: Path) -> Iterator[Path]:
    """A file that a project was read from."""
    file = tmp_path / "scene" / "sky.exr"
    file.parent.mkdir()
    file.write_bytes(b"light")
    set_inputs([file])
    yield file
    set_inputs([])


def symbolic(source: Path, link: Path) -> Path:
    link.symlink_to(source)
    return link


def hard(source: Path, link: Path) -> Path:
    os.link(source, link)
    return link


NAMES: dict[str, Callable[[Path, Path], Path]] = {
    "itself": lambda source, other: source,
    "a symbolic link": symbolic,
    "a hard link": hard,
    "a way round": lambda source, other: source.parent / ".." / source.parent.name / source.name,
    "a folder's link": lambda source, other: symbolic(source.parent, other) / source.name,
    "from where we are": lambda source, other: Path(os.path.relpath(source)),
}


@pytest.mark.parametrize("name", NAMES)
def test_what_was_read_is_not_replaced_by_any_name(source: Path, tmp_path: Path, name: str) -> None:
    path = NAMES[name](source, tmp_path / "other")
    for write in (lambda: save_file(path, b"picture"), lambda: require_place(path)):
        with pytest.raises(InsituError, match=r"the project reads this file.*; expected another name"):
            write()
    assert source.read_bytes() == b"light"


def test_a_folder_that_holds_what_was_read_keeps_it_and_all_else(source: Path) -> None:
    with (
        pytest.raises(InsituError, match=r"sky\.exr: the project reads this file"),
        replacing_folder(source.parent) as folder,
    ):
        (folder / "new.ply").write_bytes(b"mesh")
        (folder / "sky.exr").write_bytes(b"light twice")
    assert source.read_bytes() == b"light" and os.listdir(source.parent) == ["sky.exr"]


def test_a_file_beside_it_is_free(source: Path) -> None:
    require_place(source.with_name("picture.exr"))
    save_file(source.with_name("picture.exr"), b"picture")
    assert sorted(os.listdir(source.parent)) == ["picture.exr", "sky.exr"]


def test_a_session_may_be_saved_where_it_was_read_and_over_nothing_else(source: Path, tmp_path: Path) -> None:
    session = tmp_path / "a.insitu"
    session.write_bytes(b"old")
    add_inputs([session])
    save_file(session, b"new", session=session)
    with pytest.raises(InsituError, match="the project reads this file"):
        require_no_input(session)
    session.unlink()
    session.symlink_to(source)
    with pytest.raises(InsituError, match="the project reads this file"):
        save_file(session, b"new", session=session)
    assert source.read_bytes() == b"light"


def test_another_project_has_other_files(source: Path) -> None:
    set_inputs([])
    save_file(source, b"free")
    assert source.read_bytes() == b"free"


def a_loop(path: Path) -> str:
    path.symlink_to(path)
    return "Too many levels of symbolic links"


def a_pipe(path: Path) -> str:
    os.mkfifo(path)
    return "it is a named pipe, expected a file or a new name"


def a_device(path: Path) -> str:
    path.symlink_to("/dev/null")
    return "it is a device, expected a file or a new name"


@pytest.mark.parametrize("make", [a_loop, a_pipe, a_device])
def test_what_is_no_file_stays(tmp_path: Path, make: Callable[[Path], str]) -> None:
    path = tmp_path / "a.png"
    why = make(path)
    mode = path.lstat().st_mode
    for write in (lambda: save_file(path, b"picture"), lambda: require_place(path)):
        with pytest.raises(InsituError) as caught:
            write()
        assert str(caught.value) == f"{path}: not written, {why}; what was there is untouched"
    with pytest.raises(InsituError, match=f"{path}: not written, "), replacing_folder(path):
        pass
    assert path.lstat().st_mode == mode and os.listdir(tmp_path) == ["a.png"]


def test_a_link_to_nowhere_is_followed(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "file")
    require_place(tmp_path / "link")
    save_file(tmp_path / "link", b"new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "file").read_bytes() == b"new"


@pytest.mark.parametrize("length", [100, 101, 230, 238, 255])
def test_names_as_long_as_the_system_takes_them(tmp_path: Path, length: int) -> None:
    path = tmp_path / ("é" * ((length - 4) // 2) + "x" * (length % 2) + ".exr")
    assert len(os.fsencode(path.name)) == length
    require_place(path)
    assert not os.listdir(tmp_path)
    save_file(path, b"picture")
    assert os.listdir(tmp_path) == [path.name] and path.read_bytes() == b"picture"


@pytest.mark.parametrize("name", ["x" * 256 + ".exr", "a\0b.exr"])
def test_names_that_no_system_takes_are_refused_before(tmp_path: Path, name: str) -> None:
    with pytest.raises(InsituError, match="(not written|cannot be made), (File name too long|embedded null)"):
        require_place(tmp_path / name)


def test_a_place_that_cannot_be_written_is_met_before(tmp_path: Path) -> None:
    with pytest.raises(InsituError, match="^/proc/self/a.exr: not written, "):
        require_place(Path("/proc/self/a.exr"))


@pytest.mark.parametrize("folder", ["/proc/self", "/proc/self/a/b"])
def test_a_folder_that_cannot_be_written_is_met_before(folder: str) -> None:
    with pytest.raises(InsituError, match=f"^{folder}: not written, "):
        require_folder(Path(folder))


@pytest.mark.parametrize("name", ["", "new", "new/deep"])
def test_a_full_disk_is_met_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    require_folder(tmp_path / name)
    require_place(tmp_path / "a.png")
    assert os.listdir(tmp_path) == []
    as_on_a_full_disk(tmp_path, monkeypatch)
    for call in (lambda: require_folder(tmp_path / name), lambda: require_place(tmp_path / "a.png")):
        with pytest.raises(InsituError, match="not written, No space left on device"):
            call()
    assert os.listdir(tmp_path) == []


def as_on_a_full_disk(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files can be made in a folder, and hold nothing."""

    def made(path: object, mode: str = "r", *rest: object, **more: object) -> object:
        file = open(path, mode, *rest, **more)  # type: ignore[call-overload]
        if "b" in mode and "r" not in mode and Path(str(path)).is_relative_to(folder):
            with open("/dev/full", "wb") as full:
                os.dup2(full.fileno(), file.fileno())
        return file

    monkeypatch.setattr("app.system.atomic.open", made, raising=False)
