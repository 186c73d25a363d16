"""Scenes in folders and zip archives, and the axis of a mesh that points up."""

from __future__ import annotations

import io
import os
import stat
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.document.described import document_from_description
from app.document.named_files import files_of_document
from app.document.scene_files import (
    can_turn,
    renamed,
    scene_file,
    scene_in_folder,
    split_axis,
    unpacked_scene_file,
    variants_of,
    with_axis,
    with_variants,
)
from app.document.sources import find_source, source_of
from app.document.view_state import ViewState
from app.files.session import load_session, save_session
from app.project.project import open_project
from engine.core.errors import InsituError
from engine.core.safe_files import portable_name, record_files, redirect_files

CARD = b"mtllib a.mtl\nv 0 0 0\nv 2 0 0\nv 2 0 1\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl red\nf 1/1 2/2 3/3\n"


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def archive(tmp_path: Path) -> Callable[..., Path]:
    """archive(files, name) writes a zip archive."""

    def write(files: dict[str, bytes], name: str = "a.zip") -> Path:
        with zipfile.ZipFile(tmp_path / name, "w", zipfile.ZIP_DEFLATED) as found:
            for member, data in files.items():
                found.writestr(member, data)
        return tmp_path / name

    return write


def red_png() -> bytes:
    from PIL import Image

    data = io.BytesIO()
    Image.new("RGB", (2, 2), (255, 0, 0)).save(data, "PNG")
    return data.getvalue()


def files(folder: str = "") -> dict[str, bytes]:
    mtl = b"newmtl red\nmap_Kd tex/red.png\n"
    return {f"{folder}a.obj": CARD, f"{folder}a.mtl": mtl, f"{folder}tex/red.png": red_png(), "readme.txt": b"hello"}


def test_a_folder_opens_its_one_scene(tmp_path: Path) -> None:
    folder = tmp_path / "model"
    for name, data in files("deep/").items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    (folder / ".hidden").mkdir()
    (folder / ".hidden" / "b.obj").write_bytes(CARD)
    assert source_of(str(folder)).scene == str(folder / "deep" / "a.obj")
    assert find_source(str(folder)) == str(folder)
    (folder / "scene.toml").write_text("")  # a scene file comes before the meshes that it names
    assert scene_in_folder(folder) == folder / "scene.toml"
    (folder / "deep" / "other.toml").write_text("")
    with pytest.raises(
        InsituError, match=r"model: 2 scenes in it, expected one: deep/other\.toml, scene\.toml; open one"
    ):
        source_of(str(folder))


def test_materials_lie_beside_the_mesh_of_a_folder(tmp_path: Path) -> None:
    (tmp_path / "wood.mtlx").write_text("")
    assert scene_in_folder(tmp_path) == tmp_path / "wood.mtlx"
    (tmp_path / "table.obj").write_text("")
    assert scene_in_folder(tmp_path) == tmp_path / "table.obj"


def test_folders_without_a_scene_or_with_too_many_files(tmp_path: Path) -> None:
    with pytest.raises(InsituError, match="no scene in it, expected a scene"):
        source_of(str(tmp_path))
    (tmp_path / "out.obj").symlink_to("/etc/passwd")
    (tmp_path / "loop").symlink_to(tmp_path)
    with pytest.raises(InsituError, match="no scene in it"):
        source_of(str(tmp_path))
    for k in range(4097):
        (tmp_path / f"{k}").touch()
    with pytest.raises(InsituError, match="a folder of more than 4096 files"):
        source_of(str(tmp_path))


def test_an_archive_is_unpacked_once_with_what_scenes_name(archive: Callable[..., Path], cache: Path) -> None:
    path = archive(files("deep/") | {"__MACOSX/a.obj": CARD})
    assert source_of(str(path)).scene == str(path) and scene_file(str(path)) == path  # nothing is unpacked yet
    found = unpacked_scene_file(str(path))
    assert found.name == "a.obj" and found.is_relative_to(cache / "unpacked") and scene_file(str(path)) == found
    assert not list(cache.rglob("readme.txt"))
    before = found.stat().st_mtime_ns
    assert unpacked_scene_file(str(path)) == found and found.stat().st_mtime_ns == before
    archive({"b.obj": CARD})
    os.utime(path, ns=(1, 1))  # written again
    assert unpacked_scene_file(str(path)).name == "b.obj"
    assert stat.S_IMODE((cache / "unpacked").stat().st_mode) == 0o700


def test_all_files_of_an_archive_with_a_session_are_unpacked(archive: Callable[..., Path]) -> None:
    session = b'version = 2\nscene = "scene/a.obj"\n'
    path = archive({"a.insitu": session, "scene/a.obj": CARD, "scene/a.curves": b"of another kind"})
    found = unpacked_scene_file(str(path))
    assert found.name == "a.obj" and (found.parent / "a.curves").read_bytes() == b"of another kind"


def test_a_project_and_a_session_of_an_archive(archive: Callable[..., Path], tmp_path: Path) -> None:
    path = archive(files())
    project = open_project(str(path), (8, 8))
    (layer,) = project.document.object("a").layers
    assert layer.maps.texture == "tex/red.png" and project.document.source == str(path)
    found = files_of_document(project.document)
    assert {path, scene_file(str(path)), scene_file(str(path)).parent / "tex/red.png"} <= found
    session = save_session(tmp_path / "a.insitu", project.document, ViewState())
    assert 'scene = "a.zip"' in session.read_text()  # portable
    assert open_project(str(session), (8, 8)).document == project.document


def test_what_an_archive_may_not_have(archive: Callable[..., Path], tmp_path: Path) -> None:
    link = zipfile.ZipInfo("b.obj")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(tmp_path / "link.zip", "w") as found:
        found.writestr(link, "/etc/passwd")
    whole = archive(files(), "whole.zip").read_bytes()
    (tmp_path / "cut.zip").write_bytes(whole[:-30])
    locked = bytearray(whole)
    locked[whole.index(b"PK\1\2") + 8] |= 1  # the mark of an encrypted file
    (tmp_path / "locked.zip").write_bytes(locked)
    at = whole.rindex(b"PK\5\6")
    (tmp_path / "huge.zip").write_bytes(whole[: at + 12] + b"\xff" * 4 + whole[at + 16 :])
    damaged = bytearray(whole)
    damaged[40:60] = bytes(20)
    (tmp_path / "damaged.zip").write_bytes(bytes(damaged))
    for name, said in (
        (archive({"../a.obj": CARD}, "up.zip"), "name in the archive = ../a.obj, expected a name inside"),
        (archive({"a/../../b.obj": CARD}, "in.zip"), "a name inside the archive"),
        (archive({"/etc/a.obj": CARD}, "root.zip"), "a name inside the archive"),
        (archive({"..\\a.obj": CARD}, "dos.zip"), "a name inside the archive"),
        (archive({"C:\\a.obj": CARD}, "drive.zip"), "a name inside the archive"),
        (archive({f"{k}": b"" for k in range(4097)}, "many.zip"), "files in the archive = 4097, expected at most 4096"),
        (archive({"a.obj": bytes(80 << 20)}, "bomb.zip"), "size once unpacked = 83886080 bytes, expected at most"),
        (archive({"a.obj": CARD, "b/c.glb": b""}, "two.zip"), "2 scenes in it, expected one: a.obj, b/c.glb; open one"),
        (archive({"a.txt": b""}, "none.zip"), "no scene in it"),
        (tmp_path / "link.zip", "b.obj = a symbolic link, expected a regular file"),
        (tmp_path / "locked.zip", "encrypted, expected a file without a password"),
        (tmp_path / "cut.zip", "no directory at its end"),
        (tmp_path / "huge.zip", "of the form for huge archives"),
        (tmp_path / "damaged.zip", "expected a whole"),
    ):
        with pytest.raises(InsituError) as caught:
            unpacked_scene_file(str(name))
        assert said in str(caught.value), str(caught.value)
    assert not (tmp_path / "a.obj").exists() and not (tmp_path.parent / "b.obj").exists()


def test_names_keep_the_axis_that_points_up(tmp_path: Path) -> None:
    assert split_axis("part.stl#z-up") == ("part.stl", "z") and split_axis("part.stl") == ("part.stl", "y")
    assert with_axis("part.stl", "z") == "part.stl#z-up" and with_axis("part.stl#z-up", "y") == "part.stl"
    assert can_turn("part.STL#z-up") and can_turn("a.zip") and not can_turn("scene.toml") and not can_turn("teatray")
    (tmp_path / "a.obj").write_bytes(CARD.replace(b"mtllib a.mtl\n", b""))
    name = find_source(str(tmp_path / "a.obj"), "z")
    assert source_of(name).scene == str(tmp_path / "a.obj") + "#z-up"
    (tmp_path / "scene.toml").write_text("")
    for wrong in (tmp_path / "scene.toml", tmp_path, "teatray"):
        with pytest.raises(InsituError, match="Z is up, expected a mesh"):
            find_source(str(wrong), "z")


def test_names_of_stages_say_which_variants_are_chosen() -> None:
    name = with_variants("a.usd", {"shape": "tall"})
    assert name == "a.usd#shape=tall" and with_variants(name, {"size": "big"}) == "a.usd#shape=tall,size=big"
    assert with_axis(with_variants(name, {"shape": "low"}), "z") == "a.usd#shape=low#z-up"
    assert split_axis("a.usd#shape=low#z-up") == ("a.usd", "z") and variants_of("a.usd#shape=low#z-up") == {
        "shape": "low"
    }
    assert renamed("a.zip#shape=low", "/b/c.usda") == "/b/c.usda#shape=low"
    # Other names keep what looks alike.
    for other in ("a.obj#shape=tall", "a.usd#tall", "a.usd#a=b/c.usd", "a#b=c.usd", "teatray"):
        assert split_axis(other) == (other, "y") and variants_of(other) == {}


def test_a_mesh_with_z_up_stands_and_its_session_too(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_bytes(CARD.replace(b"mtllib a.mtl\n", b""))
    lying, standing = (open_project(str(tmp_path / "a.obj") + axis, (8, 8)) for axis in ("", "#z-up"))
    # (x, y, z) is (x, z, −y): what was one high along z is so along y, above the floor.
    low, high = standing.scene.bounds[0]
    np.testing.assert_allclose([low, high], [[0, 0, 0], [2, 1, 0]], atol=1e-6)
    np.testing.assert_allclose(lying.scene.bounds[0], [[0, 0, 0], [2, 0, 1]], atol=1e-6)
    floor = standing.scene.bounds[1]
    assert floor[0][1] == floor[1][1] and -1e-3 < floor[0][1] < 0.0
    session = save_session(tmp_path / "a.insitu", standing.document, ViewState())
    assert 'scene = "a.obj#z-up"' in session.read_text()
    assert load_session(session).document.source == str(tmp_path / "a.obj") + "#z-up"
    again = open_project(str(session), (8, 8))
    np.testing.assert_array_equal(again.scene.bounds, standing.scene.bounds)
    assert again.document == document_from_description(
        standing.document.source, standing.scene.description, standing.scene.animations
    )


def test_a_session_of_an_archive_opens_where_its_files_are_sent(
    archive: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on the machine of a cluster, which has the archive under another name, and a cache of its own."""
    library = b"newmtl red\nKd 1 0 0\nmap_Kd red.png\n"
    whole = archive({"a.obj": CARD, "a.mtl": library, "red.png": red_png()})
    project = open_project(str(whole))
    session = save_session(tmp_path / "mine.insitu", project.document, ViewState())
    with record_files() as files:
        open_project(str(session))
    sent = tmp_path / "sent"
    sent.mkdir()
    places = {}
    for k, path in enumerate(path for path in files if path.is_file()):
        places[portable_name(path)] = sent / f"{k}{path.suffix}"
        places[portable_name(path)].write_bytes(path.read_bytes())
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path / "other"))
    whole.unlink()
    with redirect_files(places):
        again = open_project(str(session))
    assert again.document.objects == project.document.objects
    assert again.scene.description.objects[0].layers[0].maps.texture == "red.png"
