"""Frames of a turn and of an animation: their files, and the key of all that they depend on."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pydantic import BaseModel

from app.cli.turntable import FrameFiles, parts_of, picture_key
from app.project.project import Project, open_project
from app.stills import stills
from app.stills.frame_sequence import Frames, cameras
from app.stills.stills import render_project
from app.worker.cache import content_key
from engine.core.errors import InsituError
from engine.light.radiance_files import read_radiance_image
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.scene.builtin import builtin_scenes
from engine.scene.description import Camera
from engine.texture.texture_store import TextureStore
from tests.app.files.test_brdf_files import insitu
from tests.app.system.test_outputs import as_on_a_full_disk
from tests.engine.realtime.conftest import BLOCK
from tests.engine.realtime.zonal_harmonics.test_posed_scene import write_bar
from tests.scene_text import camera, environment, placed


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A matt block on a floor under an even sky, in a folder of its own."""
    folder = tmp_path / "scene"
    folder.mkdir()
    (folder / "block.toml").write_text(BLOCK.replace('"rough_conductor", alpha = 0.3', '"lambert"'))
    return folder / "block.toml"


def turn(scene: Path, out: Path, *more: object) -> int:
    """The command's exit status."""
    lights = () if "orbit" in more else ("--lights", 40)
    return insitu("render", scene, "-o", out, "--resolution", 12, 9, *lights, "--patches", 20, "--bounces", 1, *more)


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Orbit on few points."""
    monkeypatch.setattr(stills, "STILL_SETTINGS", replace(stills.STILL_SETTINGS, n_points=100))


def test_the_camera_goes_round_its_target_once() -> None:
    camera = Camera(position=(0.0, 1.0, 2.0), target=(0.0, 1.0, 0.0))
    found = [each.position for each in cameras(camera, 4)]
    assert np.allclose(found, [(0, 1, 2), (2, 1, 0), (0, 1, -2), (-2, 1, 0)], atol=1e-12)


def test_frames_are_named_by_the_folder_or_by_a_file_in_it(tmp_path: Path) -> None:
    assert FrameFiles.of(tmp_path / "a", 2).path(1) == tmp_path / "a" / "0001.png"
    assert FrameFiles.of(tmp_path / "a" / "turn.exr", 2).path(1) == tmp_path / "a" / "turn-0001.exr"


@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize("mode", ["orbit", "placement"])
def test_frames_that_are_there_are_kept_and_others_drawn(scene: Path, tmp_path: Path, mode: str, capsys) -> None:
    out, frames = tmp_path / "out", [tmp_path / "out" / f"000{i}.png" for i in range(3)]
    assert turn(scene, out, "--mode", mode, "--turntable", 3) == 0
    first = [frame.read_bytes() for frame in frames]
    assert "3 frames" in capsys.readouterr().out
    frames[1].unlink()
    frames[2].write_bytes(first[2][:-40])  # a disk that was full
    frames[0].touch()
    stamp = frames[0].stat().st_mtime_ns
    assert turn(scene, out, "--mode", mode, "--turntable", 3) == 0
    assert "2 frames, 1 were there" in capsys.readouterr().out
    assert [frame.read_bytes() for frame in frames] == first and frames[0].stat().st_mtime_ns == stamp
    assert turn(scene, out, "--mode", mode, "--turntable", 3, "--set", "block.0.albedo=[0.3, 0.2, 0.1]") == 0
    assert "3 frames" in capsys.readouterr().out
    assert frames[0].read_bytes() != first[0]


@pytest.mark.parametrize("mode", ["deform", pytest.param("placement", marks=pytest.mark.sweep)])
def test_an_animation_is_frames_of_it_and_a_time_one_of_them(
    tmp_path: Path, mode: str, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stills, "STILL_SETTINGS", replace(stills.STILL_SETTINGS, n_rays=16))
    monkeypatch.setattr("engine.realtime.zonal_harmonics.deform_engine.N_POINTS", 60)
    (tmp_path / "scene").mkdir()
    bar, out = write_bar(tmp_path / "scene"), tmp_path / "out"
    few = ("--resolution", 12, 9, "--bounces", 1, "--mode", mode)
    assert insitu("render", bar, "-o", out, *few, "--frames", 2) == 0
    told = capsys.readouterr().out
    assert ("note: frame 1: " in told and "casts coarse shadows" in told) == (mode == "deform")
    first = [(out / f"000{i}.png").read_bytes() for i in range(2)]
    assert first[0] != first[1]
    (out / "0001.png").unlink()
    assert insitu("render", bar, "-o", out, *few, "--frames", 2) == 0
    assert "1 frames, 1 were there" in capsys.readouterr().out and (out / "0001.png").read_bytes() == first[1]
    assert insitu("render", bar, "-o", tmp_path / "still.png", *few, "--time", 2.5) == 0  # which is 0.5
    assert re.search(r"still\.png: 12 x 9, .* s, error about \d+\.\d %", capsys.readouterr().out)
    still, *drawn = (
        np.asarray(Image.open(each), float) for each in (tmp_path / "still.png", out / "0000.png", out / "0001.png")
    )
    if mode == "placement":
        assert np.array_equal(still, drawn[1])
    else:  # a still's transfer is that of its pose, frames turn one of the mesh at rest
        off = [np.abs(still - each).mean() for each in drawn]
        assert off[1] < 0.6 * off[0] and off[1] < 0.5  # of 255


def test_what_does_not_go_with_an_animation_is_said(scene: Path, tmp_path: Path, capsys) -> None:
    for words, said in (
        ((), "the scene has no animation"),
        (("--time", 1), "--frames 2 --time 1"),
        (("--mode", "orbit"), "--mode orbit"),
        (("--turntable", 2), "--turntable 2"),
    ):
        assert insitu("render", scene, "-o", tmp_path / "out", "--frames", 2, *words) == 1
        assert said in capsys.readouterr().err
    assert insitu("render", scene, "-o", tmp_path / "still.png", "--time", 1) == 1
    assert "the scene has no animation" in capsys.readouterr().err


def test_somebodys_own_pictures_are_not_replaced(scene: Path, tmp_path: Path, capsys) -> None:
    own = tmp_path / "out" / "0001.png"
    own.parent.mkdir()
    own.write_bytes(b"a holiday")
    assert turn(scene, own.parent, "--turntable", 2) != 0
    assert capsys.readouterr().err.count("\n") == 1 and own.read_bytes() == b"a holiday"
    assert [*own.parent.iterdir()] == [own]


def test_the_first_frame_is_the_still(scene: Path, tmp_path: Path) -> None:
    assert turn(scene, tmp_path / "out" / "turn.exr", "--turntable", 1) == 0
    project = open_project(str(scene), (12, 9))
    still = render_project(project, lambda step: None, n_lights=40, n_patches=20, series=BounceSeries(1)).picture
    np.testing.assert_array_equal(read_radiance_image(tmp_path / "out" / "turn-0000.exr"), still)


@pytest.mark.usefixtures("coarse")
def test_other_files_in_the_folder_stay(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "0001.png").write_bytes(b"mine")
    (out / "notes.png").write_bytes(b"mine")
    assert turn(scene, out, "--mode", "orbit", "--turntable", 1) == 0
    assert (out / "notes.png").read_bytes() == b"mine" and (out / "0001.png").read_bytes() == b"mine"
    with Image.open(out / "0000.png") as frame:
        assert frame.size == (12, 9)


@pytest.mark.parametrize(
    "wrong", [("--reference",), ("--view", "AgX")], ids=lambda words: words[0],
)  # fmt: skip
def test_what_does_not_go_together_is_said(scene: Path, tmp_path: Path, wrong: tuple[str, ...], capsys) -> None:
    assert turn(scene, tmp_path / "out" / "turn.exr", "--turntable", 2, *wrong) == 1
    assert wrong[0] in capsys.readouterr().err


PICTURE = np.full((9, 12, 3), 0.5, np.float32)


def drawn(files: FrameFiles, key: str) -> list[int]:
    """Draw what is missing."""
    missing = files.missing(key, (12, 9))
    for i in missing:
        files.write(i, PICTURE, "filmic")
    return missing


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))


def test_frames_of_a_longer_turn_before_are_gone(tmp_path: Path) -> None:
    assert drawn(FrameFiles(tmp_path, 4), "four") == [0, 1, 2, 3]
    assert drawn(FrameFiles(tmp_path, 2), "two") == [0, 1]
    assert names(tmp_path) == ["0000.png", "0001.png"]


def test_no_file_goes_that_was_not_written_here(tmp_path: Path) -> None:
    drawn(FrameFiles(tmp_path, 4), "four")
    for name in ("0003.png", "0007.png", "notes.png"):
        (tmp_path / name).write_bytes(b"somebody's own")  # the first in the place of a frame
    assert drawn(FrameFiles(tmp_path, 2), "two") == [0, 1]
    assert names(tmp_path) == ["0000.png", "0001.png", "0003.png", "0007.png", "notes.png"]
    assert (tmp_path / "0003.png").read_bytes() == b"somebody's own"
    before = (tmp_path / "0000.png").read_bytes()
    with pytest.raises(InsituError, match=r"0003\.png: not a frame of an earlier turn"):
        drawn(FrameFiles(tmp_path, 4), "four again")
    (tmp_path / "0001.png").write_bytes(b"retouched")
    with pytest.raises(InsituError, match=r"0001\.png: changed since it was drawn"):
        drawn(FrameFiles(tmp_path, 2), "two again")
    assert (tmp_path / "0000.png").read_bytes() == before and (tmp_path / "0001.png").read_bytes() == b"retouched"


def test_a_turn_that_was_killed_before_a_frame_was_whole_goes_on(tmp_path: Path) -> None:
    files = FrameFiles(tmp_path, 3)
    drawn(files, "key")
    files.path(2).unlink()  # noted, and then not written
    assert drawn(files, "key") == [2] and drawn(files, "another") == [0, 1, 2]


@pytest.mark.parametrize("out", ["/proc/self/turn", "/proc/self/turn/a.exr"])
def test_a_folder_that_cannot_be_written_is_reported_before_the_scene_is_read(
    scene: Path, out: str, capsys, monkeypatch
):
    monkeypatch.setattr("app.project.project.ProjectSpec.open", lambda words: pytest.fail("the scene was read"))
    assert turn(scene, Path(out), "--turntable", 2) == 1
    assert turn(scene, Path(out), "--frames", 2) == 1
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2 and all(line.startswith("insitu: /proc/self/turn: not written, ") for line in told)


def test_a_full_disk_is_reported_before_a_frame_is_drawn(scene: Path, tmp_path: Path, capsys, monkeypatch) -> None:
    as_on_a_full_disk(tmp_path, monkeypatch)
    monkeypatch.setattr("app.cli.turntable.draw_here", lambda *_: pytest.fail("a frame was drawn"))
    assert turn(scene, tmp_path / "out", "--turntable", 2) == 1
    assert "No space left on device" in capsys.readouterr().err and not (tmp_path / "out").exists()


BUMP = 'bump_map = { file = "bump.png", height = 0.01 }\n'
DEFORM = "deform = { membrane = { translucency = 0.4 } }\n"
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"


@pytest.fixture
def detailed_scene(tmp_path: Path) -> Path:
    """A triangle with bumps and a membrane's surface, and a bar that an animation moves."""
    Image.new("L", (4, 4), 90).save(tmp_path / "bump.png")
    (tmp_path / "leaf.obj").write_text(OBJ)
    write_bar(tmp_path)
    path = tmp_path / "scene.toml"
    path.write_text(
        camera((0.0, 0.5, 3.0), 40, (8, 6))
        + environment()
        + placed("leaf", "leaf.obj", more=BUMP + DEFORM)
        + placed("bar", "bar.glb")
        + placed("block", "cube")
    )
    return path


def values_in(value: object) -> Iterator[tuple[object, str]]:
    """All fields of all values that a value is made of."""
    if isinstance(value, TextureStore):
        return
    if isinstance(value, BaseModel):
        names = list(type(value).model_fields)
    elif dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value)]
    else:
        inner = value.values() if isinstance(value, Mapping) else value if isinstance(value, (tuple, list)) else ()
        for each in inner:
            yield from values_in(each)
        return
    for name in names:
        yield value, name
        yield from values_in(getattr(value, name))


def test_every_field_counts(detailed_scene: Path) -> None:
    """Another value in any field of anything that a project and the frames of it have gives another key."""
    whole = (open_project(str(detailed_scene)), Frames(3))
    before, fields = content_key(parts_of(whole)), list(values_in(whole))
    assert len(fields) > 200
    uncounted = []
    for owner, name in fields:
        value = vars(owner)[name]
        if isinstance(value, TextureStore):
            continue
        vars(owner)[name] = "another"
        if content_key(parts_of(whole)) == before:
            uncounted.append(f"{type(owner).__name__}.{name}")
        vars(owner)[name] = value
    assert not uncounted and content_key(parts_of(whole)) == before


def test_a_new_field_counts() -> None:
    larger = dataclasses.make_dataclass("Frames", [("tint", float, 0.0)], bases=(Frames,), frozen=True)
    assert content_key(parts_of(larger(3))) != content_key(parts_of(larger(3, tint=0.5)))


def test_a_value_of_an_unknown_kind_is_an_error() -> None:
    with pytest.raises(TypeError, match="object in what a picture depends on"):
        parts_of((1, object()))


def replaced(name: str, old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))

    return change


def other_bump(folder: Path) -> None:
    Image.new("L", (4, 4), 91).save(folder / "bump.png")


def other_animation(folder: Path) -> None:
    path = folder / "bar.glb"
    content = bytearray(path.read_bytes())
    n = int.from_bytes(content[12:16], "little")
    head = json.loads(content[20 : 20 + n])
    sampler = head["animations"][0]["samplers"][0]
    view = head["bufferViews"][head["accessors"][sampler["output"]]["bufferView"]]
    at = 20 + n + 8 + view.get("byteOffset", 0) + view["byteLength"] - 4
    last = np.frombuffer(content[at : at + 4], np.float32)[0]
    content[at : at + 4] = np.float32(last * 0.5 + 0.125).tobytes()
    path.write_bytes(content)


@pytest.mark.parametrize(
    "change",
    [
        replaced("scene.toml", "height = 0.01", "height = 0.02"),
        other_bump,
        replaced("leaf.obj", "vt 1 0", "vt 2 0"),
        replaced("scene.toml", "translucency = 0.4", "translucency = 0.5"),
        other_animation,
    ],
    ids=["bump height", "bump file", "texture coordinates", "deform", "animation"],
)
def test_what_is_read_again_for_another_picture_gives_another_key(
    detailed_scene: Path, change: Callable[[Path], None]
) -> None:
    before = picture_key(open_project(str(detailed_scene)), Frames(2))
    assert picture_key(open_project(str(detailed_scene)), Frames(2)) == before
    change(detailed_scene.parent)
    assert picture_key(open_project(str(detailed_scene)), Frames(2)) != before


@pytest.mark.parametrize("name", list(builtin_scenes())[:3])
def test_built_in_scenes_have_one(name: str) -> None:
    project: Project = open_project(name, (8, 6))
    assert picture_key(project, Frames(2)) == picture_key(open_project(name, (8, 6)), Frames(2))
