"""All that the program writes for a person is whole or not there, on full disks and where nothing can be written."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.document import Document, ObjectState
from app.document.light_state import LightState
from app.document.view_state import ViewState
from app.export.mitsuba import export_scene
from app.files.materials import Material, save_material
from app.files.session import save_session
from app.project.project import open_project
from app.stills.stills import check_output, write_picture
from app.system import atomic
from app.system.atomic import replacing_folder, save_file, write_atomically
from benchmarks.sweep import SweepRow, write_csv, write_plots
from engine.core.errors import InsituError
from engine.material import MODELS, make_layer
from tests.app.limits import largest_file, small_disk
from tests.ui.small_scene import write_small_scene

NOISE = np.random.default_rng(5).uniform(0.0, 2.0, (37, 53, 3)).astype(np.float32)
LAYERS = tuple(make_layer(MODELS["rough_conductor"], {"alpha": 0.2}, f"coat {i}") for i in range(8))
ROWS = [
    SweepRow("precompute", lights, 16, 0, "half", "coherent", 1.0 / lights, 0.1, 10**6, 2.0) for lights in (400, 4000)
]
WRITERS: dict[str, Callable[[Path], Any]] = {
    "picture.exr": lambda path: write_picture(path, NOISE),
    "picture.png": lambda path: write_picture(path, NOISE),
    "a.insitu": lambda path: save_session(
        path, Document("shelf", (ObjectState("pot"),), LightState("sky.exr" * 200)), ViewState()
    ),
    "material.toml": lambda path: save_material(path, Material("gold", LAYERS)),
    "sweep.csv": lambda path: write_csv(path, ROWS * 20),
    "error_against_time.png": lambda path: write_plots(path.parent, ROWS, "tray"),
}


@pytest.fixture(params=WRITERS)
def writer(request: pytest.FixtureRequest) -> tuple[str, Callable[[Path], Any]]:
    return request.param, WRITERS[request.param]


def test_a_file_that_is_too_large_for_the_disk_leaves_the_old_one(tmp_path: Path, writer) -> None:
    name, write = writer
    path = tmp_path / name
    path.write_bytes(b"old")
    for limit in (0, 1, 500):
        with largest_file(limit), pytest.raises(InsituError) as caught:
            write(path)
        assert str(caught.value) == f"{path}: not written, File too large; what was there is untouched"
        assert path.read_bytes() == b"old" and os.listdir(tmp_path) == [name]
    write(path)
    assert len(path.read_bytes()) > 500


def test_a_full_disk_leaves_the_old_file(tmp_path: Path, writer) -> None:
    name, write = writer
    with small_disk(tmp_path / "disk", 1 << 16) as folder:
        path = folder / name
        path.write_bytes(b"old")
        (folder / "filling").write_bytes(bytes(os.statvfs(folder).f_bavail * 4096))
        with pytest.raises(InsituError, match=f"{name}: not written, No space left on device"):
            write(path)
        assert path.read_bytes() == b"old" and sorted(os.listdir(folder)) == sorted([name, "filling"])


def test_a_disk_that_cannot_be_written_is_named(writer) -> None:
    """As root too, which no permissions stop."""
    name, write = writer
    with pytest.raises(InsituError, match=f"^/proc/self/{name}: not written, "):
        write(Path("/proc/self") / name)


def test_a_file_where_a_folder_should_be_is_named_and_stays(tmp_path: Path, writer) -> None:
    name, write = writer
    (tmp_path / "file").write_bytes(b"old")
    with pytest.raises(InsituError, match=f"file/{name}: not written, Not a directory"):
        write(tmp_path / "file" / name)
    assert (tmp_path / "file").read_bytes() == b"old"


def test_a_folder_where_a_file_should_be_is_named_and_stays(tmp_path: Path, writer) -> None:
    name, write = writer
    (tmp_path / name).mkdir()
    (tmp_path / name / "inside").touch()
    with pytest.raises(InsituError, match=f"{name}: not written, Is a directory"):
        write(tmp_path / name)
    assert os.listdir(tmp_path) == [name] and os.listdir(tmp_path / name) == ["inside"]


def test_pictures_are_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InsituError, match="file: the folder cannot be made, "):
        check_output(tmp_path / "file" / "a.exr")


# ----------------------------------------------------------------------------------------------------------- folders


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory):
    scene = write_small_scene(tmp_path_factory.mktemp("scene"))
    return open_project(str(scene), (12, 8), [("ball.material", "Velvet, red")])  # which becomes a table


@pytest.fixture(autouse=True)
def small_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.export.materials.ROUND_SHAPE", (1, 8, 8, 4))


def write_scene(project, folder: Path) -> None:
    export_scene(project, folder, 1, lambda share, text: None)


def contents(folder: Path) -> dict[str, bytes]:
    return {file.relative_to(folder).as_posix(): file.read_bytes() for file in folder.rglob("*") if file.is_file()}


OLD = {"scene.xml": b"old", "meshes/01_ball.ply": b"old", "mine.txt": b"mine", "renders/first.exr": b"hours of work"}


def old_folder(folder: Path) -> Path:
    for name, data in OLD.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


def test_an_export_replaces_its_own_files_and_no_others(project, tmp_path: Path) -> None:
    write_scene(project, tmp_path / "new")
    write_scene(project, old_folder(tmp_path / "old"))
    fresh, mixed = contents(tmp_path / "new"), contents(tmp_path / "old")
    assert set(mixed) == set(fresh) | set(OLD)
    assert {name: mixed[name] for name in fresh} == fresh
    assert mixed["mine.txt"] == b"mine" and mixed["renders/first.exr"] == b"hours of work"


@pytest.mark.parametrize("exists", [False, True])
def test_an_export_that_fails_at_any_file_leaves_all_as_it_was(
    project, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, exists: bool
) -> None:
    folder = tmp_path / "out"
    if exists:
        old_folder(folder)
    written = 0

    def fail_at(last: int) -> Callable[..., None]:
        def write(path: Path, data: bytes) -> None:
            nonlocal written
            written += 1
            if written > last:
                path.write_bytes(data[: len(data) // 2])
                raise OSError(28, "No space left on device")
            write_atomically(path, data)

        return write

    failures = 0
    for last in range(20):
        written = 0
        for module in ("mitsuba", "materials"):
            monkeypatch.setattr(f"app.export.{module}.write_atomically", fail_at(last))
        try:
            write_scene(project, folder)
        except InsituError as error:
            failures += 1
            assert str(error) == f"{folder}: not written, No space left on device; what was there is untouched"
            assert os.listdir(tmp_path) == (["out"] if exists else [])
            assert not exists or contents(folder) == OLD
        else:
            break
    assert failures >= 5 and "scene.xml" in contents(folder)


@pytest.mark.parametrize("exists", [False, True])
def test_an_export_to_a_full_disk_leaves_all_as_it_was(project, tmp_path: Path, exists: bool) -> None:
    with small_disk(tmp_path / "disk", 1 << 16) as disk:
        if exists:
            old_folder(disk / "out")
        with pytest.raises(InsituError, match="out: not written, No space left on device; what was there is untouched"):
            write_scene(project, disk / "out")
        assert os.listdir(disk) == (["out"] if exists else [])
        assert not exists or contents(disk / "out") == OLD


def test_an_export_where_something_else_is_in_the_way_changes_nothing(project, tmp_path: Path) -> None:
    for name in ("meshes", "scene.xml", "meshes/00_ground.ply"):
        folder = tmp_path / name.replace("/", "-")
        (folder / "renders").mkdir(parents=True)
        if name == "meshes":
            (folder / name).write_bytes(b"mine")
        else:
            (folder / name / "inside").mkdir(parents=True)
        before = contents(folder)
        with pytest.raises(InsituError, match=f"not written, something else is at {folder / name}"):
            write_scene(project, folder)
        assert contents(folder) == before and not list(folder.glob(".*"))


def test_an_export_to_nowhere_is_named(project, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"old")
    for folder in (tmp_path / "file", tmp_path / "file" / "out", Path("/proc/self/out")):
        with pytest.raises(InsituError, match=f"^{folder}: not written, "):
            write_scene(project, folder)
    assert (tmp_path / "file").read_bytes() == b"old" and os.listdir(tmp_path) == ["file"]


def test_what_a_killed_writer_left_goes_with_the_next(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    left = [tmp_path / ".out.999999999-0.tmp", tmp_path / ".a.999999999-3.tmp"]
    (left[0] / "meshes").mkdir(parents=True)
    left[1].touch()
    with replacing_folder(tmp_path / "out") as folder:
        (folder / "a").touch()
    save_file(tmp_path / "a", b"new")
    assert sorted(os.listdir(tmp_path)) == ["a", "out"]


def test_names_are_flushed_to_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    flushed: list[Path] = []
    monkeypatch.setattr(atomic, "_flush_folder", flushed.append)
    save_file(tmp_path / "a", b"new")
    with replacing_folder(tmp_path / "out"):
        pass
    assert flushed == [tmp_path, tmp_path]
