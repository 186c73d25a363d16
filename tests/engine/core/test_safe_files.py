import os
import socket
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import pytest

from engine.core import safe_files
from engine.core.errors import LoadError
from engine.core.safe_files import (
    find_inside,
    local_path,
    named_in,
    read_regular_file,
    record_files,
    redirect_files,
    resolve_inside,
    temporary_file,
)


def test_reads_a_regular_file_up_to_its_cap(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert read_regular_file(path, 5) == b"12345"
    with pytest.raises(LoadError, match="size = 5 bytes, expected at most 4 bytes"):
        read_regular_file(path, 4)


def test_whatever_would_block_or_flood_is_refused_at_once(tmp_path):
    os.mkfifo(tmp_path / "pipe")  # opening it for reading would wait for a writer for ever
    with pytest.raises(LoadError, match="file = a named pipe, expected a regular file"):
        read_regular_file(tmp_path / "pipe", 10)
    with pytest.raises(LoadError, match="file = a folder, expected a regular file"):
        read_regular_file(tmp_path, 10)
    with pytest.raises(LoadError, match="file = a device, expected a regular file"):
        read_regular_file("/dev/zero", 10)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / "s"))
        with pytest.raises(LoadError, match="expected a readable file"):
            read_regular_file(tmp_path / "s", 10)
    with pytest.raises(LoadError, match="No such file"):
        read_regular_file(tmp_path / "absent", 10)
    with pytest.raises(LoadError, match="null byte"):
        read_regular_file(tmp_path / "a\0b", 10)


def test_paths_stay_inside_the_folder(tmp_path):
    (tmp_path / "scene" / "meshes").mkdir(parents=True)
    folder = tmp_path / "scene"
    inside = resolve_inside(folder, "meshes/../meshes/a.ply", folder / "s.toml", "mesh")
    assert inside == (folder / "meshes" / "a.ply").resolve()  # dots that stay inside are harmless


@pytest.mark.skipif(os.name == "nt", reason="a backslash is never part of a name")
def test_a_backslash_is_between_folders_unless_a_file_has_it_in_its_name(tmp_path):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "a.png").write_bytes(b"folder")
    scene = tmp_path / "s.toml"
    for literal, name in ((False, "maps\\a.png"), (True, "maps\\a.png"), (False, "MAPS\\A.PNG"), (True, "a: b.png")):
        if literal:
            (tmp_path / name).write_bytes(b"name")
        found = find_inside(tmp_path, tmp_path, name)
        assert found is not None and found.read_bytes() == (b"name" if literal else b"folder")
        if name.islower():
            assert resolve_inside(tmp_path, name, scene, "texture") == found == named_in(tmp_path, name)
    with pytest.raises(LoadError, match="expected a relative path"):
        resolve_inside(tmp_path, "http: b.png", scene, "texture")


@pytest.mark.parametrize(
    "name",
    [
        "../a.ply",
        "meshes/../../a.ply",
        "/etc/passwd",
        "http://x.org/a.ply",
        "file:a.ply",
        "C:/a.ply",
        "..\\a.ply",
        "\\a.ply",
        "",
    ],
)
def test_paths_out_of_the_folder_are_refused(tmp_path, name):
    with pytest.raises(LoadError, match="s.toml: mesh = .*expected a relative path to a file inside"):
        resolve_inside(tmp_path, name, tmp_path / "s.toml", "mesh")


def test_links_out_of_the_folder_and_loops_of_links_are_refused(tmp_path):
    folder = tmp_path / "scene"
    folder.mkdir()
    (tmp_path / "secret.ply").write_text("x")
    (folder / "link.ply").symlink_to(tmp_path / "secret.ply")
    (folder / "loop").symlink_to(folder / "loop")
    with pytest.raises(LoadError, match=r"link.ply \(outside the scene folder\)"):
        resolve_inside(folder, "link.ply", folder / "s.toml", "mesh")
    with pytest.raises(LoadError):
        read_regular_file(resolve_inside(folder, "loop", folder / "s.toml", "mesh"), 10)


def test_a_temporary_file_belongs_to_no_scene(tmp_path):
    path = tmp_path / "copy"
    path.write_bytes(b"x")
    with record_files() as recorded, redirect_files({}):
        with temporary_file(path):
            assert read_regular_file(path, 1) == b"x"
        with pytest.raises(LoadError, match="not among the files that were sent"):
            read_regular_file(path, 1)
    assert recorded == {path}  # by the second attempt alone


def test_threads_have_temporary_files_of_their_own(tmp_path, monkeypatch):
    """A change of the list that another thread overwrote would make a file one of the scene, or leave one in it."""

    class SlowSet(frozenset):
        """Lets other threads run between the reading of the list and the writing of its successor."""

        def __or__(self, other):
            time.sleep(1e-3)
            return SlowSet(frozenset.__or__(self, other))

        def __sub__(self, other):
            time.sleep(1e-3)
            return SlowSet(frozenset.__sub__(self, other))

    def read(path):
        with temporary_file(path):
            all_are_open.wait(60.0)
            assert local_path(path) == path

    monkeypatch.setattr(safe_files._access, "temporary", SlowSet())
    paths = [tmp_path / str(k) for k in range(8)]
    all_are_open = Barrier(len(paths))
    with redirect_files({}), ThreadPoolExecutor(len(paths)) as pool:
        assert list(pool.map(read, paths)) == [None] * len(paths)
    assert not safe_files._access.temporary
