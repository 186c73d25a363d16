"""Scenes saved with everything they need: elsewhere they open to the same picture, bit for bit."""

from __future__ import annotations

import errno
import os
import pickle
import shutil
import zipfile
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import insitu
from app.cli.exchange import save_scene
from app.document.commands.light import SetBackground
from app.document.scene_files import scene_file
from app.editor.editor import Editor
from app.export.package import packed
from app.files.session import Session
from app.messages.worker_messages import Request
from app.system.atomic import set_inputs
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.core.errors import InsituError
from engine.scene.toml_text import toml_value
from tests.pictures import write_exr
from tests.scene_text import camera, facing_up, material, placed, scaled
from tests.usd_text import CARD
from tests.usd_text import write as write_usd

SIZE = 16, 12


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A scene with a mesh, a texture and a sky in its folder, and files elsewhere that edits may name."""
    folder = tmp_path / "work" / "shot 1"
    (folder / "maps").mkdir(parents=True)
    rng = np.random.default_rng(1)
    for path in (folder / "maps" / "wood.png", tmp_path / "work" / "wood.png"):
        Image.fromarray(rng.integers(0, 255, (8, 8, 3), np.uint8)).save(path)
    for path in (folder / "sky.exr", tmp_path / "other sky.exr"):
        write_exr(path, rng.uniform(0.1, 1.0, (8, 16, 3)).astype(np.float32))
    (folder / "tent.obj").write_text("v -1 0 -1\nv 1 0 -1\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 2 3 4\nf 4 3 1\n")
    text = camera((0.0, 1.2, 3.0), 40, SIZE, (0, 0.3, 0), "bounces = 1\n")
    text += '[environment]\nfile = "sky.exr"\n'
    text += placed("ground", "quad", facing_up(3), material('model = "lambert", texture = "maps/wood.png"'))
    text += placed("tent", "tent.obj", scaled(0.6), material('model = "lambert", name = "cloth"'))
    (folder / "scene.toml").write_text(text)
    return folder / "scene.toml"


@pytest.fixture
def chair(tmp_path: Path) -> Path:
    """A mesh in another folder, with a library of materials that has a texture."""
    folder = tmp_path / "props" / "chair"
    (folder / "maps").mkdir(parents=True)
    Image.new("RGB", (4, 4), (40, 90, 200)).save(folder / "maps" / "cloth.png")
    (folder / "chair.mtl").write_text("newmtl cloth\nKd 1 1 1\nmap_Kd maps/cloth.png\n")
    faces = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl cloth\nf 1/1 2/2 3/3\n"
    (folder / "chair.obj").write_text("mtllib chair.mtl\n" + faces)
    (folder / "unused.obj").write_text(faces)
    return folder / "chair.obj"


@pytest.fixture
def scene(file: Path, tmp_path: Path) -> insitu.Scene:
    """The scene with edits that name files from elsewhere."""
    made = insitu.open(file)
    made["tent"]["cloth"].texture = str(tmp_path / "work" / "wood.png")
    made["tent"]["cloth"]["theta_i"].amplify(y=1.5)
    made.light.environment = str(tmp_path / "other sky.exr")
    made.light.rotation = 40.0
    made.camera.orbit(20)
    return made


def moved(path: Path, tmp_path: Path) -> Path:
    """What was saved, in another place; where it came from is gone."""
    (tmp_path / "far").mkdir(exist_ok=True)
    shutil.move(path, tmp_path / "far")
    shutil.rmtree(tmp_path / "work")
    (tmp_path / "other sky.exr").unlink()
    return tmp_path / "far" / path.name


@pytest.mark.parametrize("name", ["tent", "tent.insitu.zip"])
def test_elsewhere_the_picture_is_the_same_bit_for_bit(scene: insitu.Scene, tmp_path: Path, name: str) -> None:
    expected = scene.image()
    there = moved(scene.save_scene(tmp_path / name), tmp_path)
    again = insitu.open(there)
    assert np.array_equal(again.image(), expected) and again.camera.position == scene.camera.position
    again["tent"]["cloth"].albedo = 0.1
    assert not np.array_equal(again.image(), expected)


def test_meshes_that_were_added_take_what_they_name_along(scene: insitu.Scene, chair: Path, tmp_path: Path) -> None:
    scene.add(chair)
    for name, place in (("linked_duplicate", (0.5, 0.0, 0.0)), ("duplicate", (-0.5, 0.0, 0.0))):
        setattr(scene["chair"], name, name)
        scene[name].position = place
    scene["linked_duplicate"][0].albedo = 0.3
    assert scene["chair"][0].albedo == (0.3, 0.3, 0.3) != scene["duplicate"][0].albedo
    expected = scene.image()
    there = moved(scene.save_scene(tmp_path / "a"), tmp_path)
    shutil.rmtree(chair.parent)
    assert np.array_equal(insitu.open(there).image(), expected)
    found = {each.relative_to(there / "scene" / "files" / "chair").as_posix()
             for each in (there / "scene" / "files" / "chair").rglob("*") if each.is_file()}  # fmt: skip
    assert found == {"chair.obj", "chair.mtl", "maps/cloth.png"}


ODD_NAMES = [
    "wo\\od.png",
    "maps\\wo\\od.png",
    "wo#1.png",
    "wo: od.png",
    "wo\"od'.png",
    "wöod 100%.png",
    "[wo]*?.png",
    " wood .png",
]


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such names")
@pytest.mark.parametrize("name", ODD_NAMES)
def test_images_with_odd_names_are_opened_saved_and_read_again(
    scene: insitu.Scene, file: Path, tmp_path: Path, name: str
) -> None:
    """In the folder of the scene, named by its file and by an edit, and elsewhere, named by an edit."""
    wood = tmp_path / "work" / "wood.png"
    shutil.copy(wood, tmp_path / "work" / name.rpartition("/")[2])
    (file.parent / name).parent.mkdir(exist_ok=True)
    shutil.copy(wood, file.parent / name)
    text = file.read_text()
    file.write_text(text.replace('"maps/wood.png"', toml_value(name)))
    for where in (file.parent, tmp_path / "work"):
        made = insitu.open(file)
        made["tent"]["cloth"].texture = str(where / name)
        expected = made.image()
        session = made.save(tmp_path / "work" / "a.insitu")
        assert np.array_equal(insitu.open(session).image(), expected)
        for target in (tmp_path / "folder", tmp_path / "b.insitu.zip"):
            if ":" in name and target.suffix == ".zip":
                with pytest.raises(InsituError, match="no archive can be opened with this.*save a folder"):
                    made.save_scene(target)
                continue
            there = made.save_scene(target)
            hidden = tmp_path / "hidden"
            (tmp_path / "work").rename(hidden)
            assert np.array_equal(insitu.open(there).image(), expected)
            hidden.rename(tmp_path / "work")
            there.unlink() if there.is_file() else shutil.rmtree(there)


def test_a_scene_of_windows_is_opened_saved_and_read_again(scene: insitu.Scene, file: Path, tmp_path: Path) -> None:
    expected = insitu.open(file).image()
    file.write_text(file.read_text().replace("maps/wood.png", r"maps\\wood.png"))
    made = insitu.open(file)
    assert np.array_equal(made.image(), expected)
    for name in ("a", "a.insitu.zip"):
        there = made.save_scene(tmp_path / name)
        (tmp_path / "work").rename(tmp_path / "hidden")
        again = insitu.open(there)
        assert np.array_equal(again.image(), expected)
        assert again.document.objects[0].layers == made.document.objects[0].layers
        (tmp_path / "hidden").rename(tmp_path / "work")


def test_images_of_lamps_that_were_added_come_along(file: Path, tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="usd-core, the extra insitu[usd], is not installed")
    props = tmp_path / "props"
    props.mkdir()
    Image.fromarray(np.array([[[255, 0, 0], [0, 255, 0]]], np.uint8)).save(props / "two.png")
    lamp = 'def RectLight "Panel" { asset inputs:texture:file = @two.png@\n float inputs:intensity = 3 }'
    scene = insitu.open(file)
    scene.add(write_usd(props / "lamp.usda", f"{CARD}\n{lamp}"), at=(0.0, 0.5, 0.0))
    texture = scene.document.object("Panel").emission_texture
    assert texture.texture == str(props / "two.png")
    expected = scene.image()
    # Both colours of the image light the scene.
    dark = insitu.open(file)
    dark.add(props / "lamp.usda", at=(0.0, 0.5, 0.0))
    dark["Panel"].emission = 0.0
    gain = (expected - dark.image()).reshape(-1, 3).max(axis=0)
    assert gain[0] > 1e-3 and gain[1] > 1e-3 and gain[2] < 0.02 * gain[0]
    # A session names the image from its folder; a saved scene has it.
    session = scene.save(tmp_path / "a.insitu")
    assert 'texture = "props/two.png"' in session.read_text()
    again = insitu.open(session)
    assert again.document.object("Panel").emission_texture == texture
    assert np.array_equal(again.image(), expected)
    for name in ("a", "a.insitu.zip"):
        there = scene.save_scene(tmp_path / name)
        props.rename(tmp_path / "hidden")
        assert np.array_equal(insitu.open(there).image(), expected)
        (tmp_path / "hidden").rename(props)


def test_what_is_in_it(scene: insitu.Scene, tmp_path: Path) -> None:
    scene.save_scene(tmp_path / "a.insitu.zip")
    with zipfile.ZipFile(tmp_path / "a.insitu.zip") as archive:
        names = set(archive.namelist())
    own = {"scene.toml", "tent.obj", "sky.exr", "maps/wood.png", "files/wood.png", "files/other sky.exr"}
    assert names == {"a.insitu", *(f"scene/{name}" for name in own)}


def test_a_session_saved_from_an_archive_outlives_the_cache(scene: insitu.Scene, tmp_path: Path, cache: Path) -> None:
    there = moved(scene.save_scene(tmp_path / "a.insitu.zip"), tmp_path)
    again = insitu.open(there)
    again.light.rotation = 90.0
    expected = again.image()
    again.save(tmp_path / "far" / "later.insitu")
    assert "a.insitu.zip!/" in (tmp_path / "far" / "later.insitu").read_text()
    shutil.rmtree(cache)
    assert np.array_equal(insitu.open(tmp_path / "far" / "later.insitu").image(), expected)


def test_nothing_is_overwritten_unasked(scene: insitu.Scene, tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    (tmp_path / "a.insitu.zip").write_bytes(b"mine")
    for name in ("full", "a.insitu.zip", "b.zip"):
        with pytest.raises(InsituError, match=f"{name}: .*expected"):
            scene.save_scene(tmp_path / name)
    assert (tmp_path / "a.insitu.zip").read_bytes() == b"mine" and len(list((tmp_path / "full").iterdir())) == 1
    scene.save_scene(tmp_path / "a.insitu.zip", replaces=True)
    assert zipfile.is_zipfile(tmp_path / "a.insitu.zip")


def test_a_file_that_is_missing_is_told_and_nothing_written(scene: insitu.Scene, tmp_path: Path) -> None:
    scene.image()
    (tmp_path / "work" / "wood.png").unlink()
    with pytest.raises(InsituError, match="wood.png: no such file"):
        scene.save_scene(tmp_path / "a")
    assert not (tmp_path / "a").exists()


def test_files_of_the_same_names_do_not_replace_each_other(scene: insitu.Scene, chair: Path, tmp_path: Path) -> None:
    """The second time, what was added first is in the folder that names of new files are sought in."""
    scene.add(chair)
    again = insitu.open(scene.save_scene(tmp_path / "a"))
    other = tmp_path / "props" / "other" / "chair.obj"
    other.parent.mkdir()
    other.write_text("v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n")
    again.add(other)
    expected = again.image()
    third = insitu.open(again.save_scene(tmp_path / "b"))
    assert np.array_equal(third.image(), expected)
    assert {path.name for path in (tmp_path / "b" / "scene" / "files").iterdir()} >= {"chair", "chair-2"}


def test_a_file_may_have_the_name_of_the_folder_for_others(scene: insitu.Scene, file: Path, tmp_path: Path) -> None:
    shutil.copy(tmp_path / "work" / "wood.png", file.parent / "files")
    scene["ground"][0].texture = str(file.parent / "files")
    expected = scene.image()
    assert np.array_equal(insitu.open(scene.save_scene(tmp_path / "a")).image(), expected)
    assert (tmp_path / "a" / "scene" / "files-2" / "other sky.exr").is_file()


@pytest.mark.parametrize("name", [".backup", "a\nb", "a:b", ".insitu.zip", "a\nb.insitu.zip", "a:b.insitu.zip"])
def test_any_name_opens_with_its_edits(scene: insitu.Scene, tmp_path: Path, name: str) -> None:
    again = insitu.open(scene.save_scene(tmp_path / name))
    assert again.light.rotation == 40.0 and again["tent"]["cloth"].texture is not None


def test_names_that_no_archive_can_have(scene: insitu.Scene, file: Path, tmp_path: Path) -> None:
    name = "wood:1.png"
    shutil.copy(tmp_path / "work" / "wood.png", file.parent / name)
    scene["tent"]["cloth"].texture = str(file.parent / name)
    with pytest.raises(InsituError, match="a.insitu.zip: .*name in the archive.*; save a folder"):
        scene.save_scene(tmp_path / "a.insitu.zip")
    assert not list(tmp_path.glob("*a.insitu*"))
    assert np.array_equal(insitu.open(scene.save_scene(tmp_path / "a")).image(), scene.image())


def test_edits_of_absent_objects_whose_files_are_gone_are_left_out(
    scene: insitu.Scene, file: Path, tmp_path: Path
) -> None:
    document = scene.document
    absent = replace(document.object("tent"), name="flag")
    document = replace(document, absent=(absent, replace(document.object("ground"), name="floor")))
    (tmp_path / "work" / "wood.png").rename(tmp_path / "work" / "moved.png")
    scene["tent"]["cloth"].texture = str(tmp_path / "work" / "moved.png")
    document = replace(document, objects=scene.document.objects)
    package = packed(document, [file, file.parent / "tent.obj"], tmp_path / "a")
    assert [each.name for each in package.document.absent] == ["floor"]
    (note,) = package.notes
    assert note.startswith("the edits of flag, which the scene does not have now, are left out") and "wood.png" in note


def test_a_full_disk_is_told(scene: insitu.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene.image()
    (tmp_path / "a.insitu.zip").write_bytes(b"before")

    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(zipfile.ZipFile, "writestr", full)
    with pytest.raises(InsituError, match="a.insitu.zip: not written, No space left"):
        scene.save_scene(tmp_path / "a.insitu.zip", replaces=True)
    assert (tmp_path / "a.insitu.zip").read_bytes() == b"before" and not list(tmp_path.glob(".*"))


def test_an_archive_does_not_replace_itself(scene: insitu.Scene, tmp_path: Path) -> None:
    path = scene.save_scene(tmp_path / "a.insitu.zip")
    before = path.read_bytes()
    set_inputs([])
    with pytest.raises(InsituError, match="a.insitu.zip: the project reads this file"):
        save_scene(str(path), path, replace_=True)
    assert path.read_bytes() == before


def test_built_in_scenes_are_copied_too(tmp_path: Path) -> None:
    scene = insitu.open("shapes", resolution=(12, 8))
    Image.new("RGB", (4, 4), (200, 100, 50)).save(tmp_path / "paint.png")
    scene["cube"]["paint"].texture = str(tmp_path / "paint.png")
    expected = scene.image()
    shutil.move(scene.save_scene(tmp_path / "a"), tmp_path / "b")
    (tmp_path / "paint.png").unlink()
    assert np.array_equal(insitu.open(tmp_path / "b").image(), expected)


@pytest.fixture
def editor(file: Path, tmp_path: Path) -> Iterator[Editor]:
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "arrays")))
    with closing(Editor(client, str(file), resolution=(6, 4))) as made:
        wait(made, lambda: made.scene_is_open)
        yield made


def wait(editor: Editor, done: Callable[[], bool]) -> None:
    for now in range(100_000):
        editor.tick(0.01 * now)
        if done():
            return
    raise AssertionError(editor.status)


@pytest.mark.parametrize("name", ["tent", "tent.insitu.zip"])
def test_the_editor_saves_and_opens_it(
    editor: Editor, tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    editor.do(SetBackground("transparent"))
    sent, send = list[Request](), editor.exchange._send
    monkeypatch.setattr(editor.exchange, "_send", lambda request: sent.append(request) or send(request))
    assert editor.exchange.save_scene(tmp_path / name) is None
    assert pickle.loads(pickle.dumps(sent)) == sent  # as it is sent to another process
    wait(editor, lambda: editor.status.message.startswith("written"))
    there = moved(tmp_path / name, tmp_path)
    assert editor.open(str(there)) is None
    wait(editor, lambda: editor.status.message.startswith("opened"))
    assert (
        editor.session.name == "tent"
        and editor.document.background.kind == "transparent"
        and not editor.status.is_error
    )
    assert editor.session.path == (there / "tent.insitu" if name == "tent" else None)


def test_an_archive_with_a_session_that_cannot_be_read_is_refused(editor: Editor, file: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "bad.insitu.zip", "w") as archive:
        archive.write(file.parent / "tent.obj", "scene/tent.obj")
        archive.writestr("bad.insitu", 'version = 99\nscene = "scene/tent.obj"\n')
    for _ in range(2):  # the second time it is unpacked
        editor.open(str(tmp_path / "bad.insitu.zip"))
        wait(editor, lambda: editor.status.is_error)
        assert "version = 99" in editor.status.message and editor.document.source == str(file)
        editor.notify("")
        editor.do(SetBackground("transparent"))
        wait(editor, lambda: editor.status.picture == "refining")  # what was open is drawn again
        editor.history.undo()


def test_an_archive_whose_session_goes_meanwhile_opens_without_it(
    editor: Editor, scene: insitu.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = scene.save_scene(tmp_path / "a.insitu.zip")

    def archived(source: str) -> Session | None:
        if scene_file(source) == path:  # not unpacked yet
            return None
        raise InsituError("a.insitu: gone")

    monkeypatch.setattr("app.editor.opening.archived_session", archived)
    editor.open(str(path))
    wait(editor, lambda: editor.document.source == str(path))
    assert "opened the scene without its session: a.insitu: gone" in editor.status.message and editor.status.is_error
