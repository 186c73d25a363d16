"""`insitu render --turntable`: frames all around a scene, each drawn once."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.cli.turntable import FrameFiles
from app.project.project import open_project
from app.stills import stills
from app.stills.frame_sequence import cameras
from app.stills.stills import render_project
from engine.core.errors import InsituError
from engine.light.radiance_files import read_radiance_image
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.scene.description import Camera
from tests.app.files.test_brdf_files import insitu
from tests.app.system.test_outputs import as_on_a_full_disk
from tests.engine.realtime.triple_product.conftest import BLOCK
from tests.engine.realtime.zonal_harmonics.test_animated_pose import write_bar


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A matt block on a floor under an even sky, in a folder of its own."""
    folder = tmp_path / "scene"
    folder.mkdir()
    (folder / "block.toml").write_text(BLOCK.replace('"rough_conductor"\nalpha = 0.3', '"lambert"'))
    return folder / "block.toml"


def turn(scene: Path, out: Path, *more: object) -> int:
    """The command's exit status."""
    lights = () if "orbit" in more else ("--lights", 40)
    return insitu("render", scene, "-o", out, "--resolution", 12, 9, *lights, "--patches", 20, "--bounces", 1, *more)


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Orbit on few points."""
    made = stills.Orbit
    monkeypatch.setattr(stills, "Orbit", lambda scene, **rest: made(scene, n_points=100, **rest))


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
    monkeypatch.setattr(stills, "DEFORM_RAYS", 16)
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
