"""`insitu plan`, `precompute` and `doctor`: what they say and leave behind."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from app.cli.precompute import precompute as fill_cache
from app.project.project import open_project
from app.worker.cache import ArrayCache
from engine.core.errors import InsituError
from engine.light.radiance_files import read_radiance_image
from tests.app.cli.command_line import SCENE, Recorder, run
from tests.app.limits import small_disk

Captured = pytest.CaptureFixture[str]


def test_plan_says_what_and_why_and_what_it_costs(scene: Path, capsys: Captured) -> None:
    assert run("plan", scene, "--override", "ball.0.theta_i=4") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["ball.0.theta_i", "4", "bands", "overridden"]
    assert any(line.startswith("sphere") and "5,120 directions" in line for line in lines)
    assert "MiB of main memory" in lines[-2] and "MiB on disk" in lines[-2] and "within about" in lines[-1]


@pytest.mark.parametrize(
    ("line", "same"),
    [("lights=40", ("--lights", 40)), ("bounces=2", ("--bounces", 2)), ("edges=off", ("--edges", 0))],
)
def test_an_overridden_line_is_what_its_option_is(
    scene: Path, tmp_path: Path, line: str, same: tuple[object, ...]
) -> None:
    small = ("--resolution", 12, 9, *(() if "lights" in line else ("--lights", 40)))
    assert run("render", scene, "-o", tmp_path / "a.exr", *small, "--override", line) == 0
    assert run("render", scene, "-o", tmp_path / "b.exr", *small, *same) == 0
    one, other = (read_radiance_image(tmp_path / name) for name in ("a.exr", "b.exr"))
    np.testing.assert_array_equal(one, other)


def test_overridden_bands_are_those_of_the_picture(scene: Path, tmp_path: Path) -> None:
    for name, n_bands in (("a.exr", 1), ("b.exr", 32)):
        small = ("--resolution", 12, 9, "--lights", 40)
        assert run("render", scene, "-o", tmp_path / name, *small, "--override", f"ball.0.theta_i={n_bands}") == 0
    one, other = (read_radiance_image(tmp_path / name) for name in ("a.exr", "b.exr"))
    assert not np.array_equal(one, other) and one.mean() == pytest.approx(other.mean(), rel=0.2)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("render", "-o", "OUT", "--override", "ball.9.theta_i=4"), "the plan has no line 'ball.9.theta_i'"),
        (("render", "-o", "OUT", "--override", "precision=float"), "a still is made in single floats"),
        (
            ("render", "-o", "OUT", "--mode", "orbit", "--override", "lights=40"),
            "bounces, nodes, points, coefficients",
        ),
        (
            ("render", "-o", "OUT", "--mode", "deform", "--override", "points=40"),
            "bounces, nodes, transfer_rays, lobes",
        ),
        (("render", "-o", "OUT", "--override", "points=40"), "expected --mode orbit as well"),
        (("render", "-o", "OUT", "--reference", "--override", "lights=40"), "--reference: expected one of them"),
        (("precompute", "--override", "lights=3"), "20 to 80,000"),
    ],
)
def test_lines_that_cannot_be_overridden_are_reported(
    scene: Path, tmp_path: Path, arguments: tuple[str, ...], said: str, capsys: Captured
) -> None:
    command, *options = (str(tmp_path / "a.exr") if each == "OUT" else each for each in arguments)
    assert run(command, scene, *options) != 0
    (line,) = capsys.readouterr().err.splitlines()
    assert said in line


def test_notes_on_a_scene_are_printed(tmp_path: Path, capsys: Captured) -> None:
    bare = tmp_path / "bare.toml"
    bare.write_text("\n".join(line for line in SCENE.splitlines() if not line.startswith("layer")))
    assert run("render", bare, "-o", tmp_path / "a.png", "--lights", "20") == 0
    assert "note: ball: without a material, shown in a grey that can be edited" in capsys.readouterr().out.splitlines()


def test_what_bounces_leave_out_stands_in_the_plan(tmp_path: Path, capsys: Captured) -> None:
    closed = tmp_path / "closed.toml"
    closed.write_text(SCENE.replace("bounces = 1", "bounces = 3").replace("[0, 0, 4]", "[0, 0, 0.3]"))
    assert run("plan", closed) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("bounces"))
    said = "the scene absorbs too little light: no number of bounces is enough, 3 are shown"
    assert line.endswith(f"as the scene says; {said}")
    for how in ((), ("--reference", "--samples", 1)):
        small = ("--lights", 20, "--resolution", 12, 9)
        assert run("render", closed, "-o", tmp_path / "a.png", *small, *how) == 0
        assert f"note: {said}" in capsys.readouterr().out.splitlines()


def test_a_picture_without_an_object_has_a_plan_and_is_rendered(tmp_path: Path, capsys: Captured) -> None:
    away = tmp_path / "away.toml"
    away.write_text(SCENE.replace("bounces = 1", "bounces = 3").replace("target = [0, 0, 0]", "target = [0, 0, 9]"))
    assert run("plan", away) == 0
    assert run("render", away, "-o", tmp_path / "a.png") == 0
    assert "failed" not in capsys.readouterr().err


def test_precompute_fills_the_cache_that_the_editor_reads(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path / "cache"))
    assert run("precompute", scene, "--lights", 1000) == 0
    assert "of transport" in capsys.readouterr().out
    entries = {file.name for file in (tmp_path / "cache").rglob("*.arrays")}
    assert len(entries) == 3  # visibility, the one layer's transport, and the unit it is in
    assert run("precompute", scene, "--lights", 1000) == 0
    # The second time nothing is added: all was found.
    assert {file.name for file in (tmp_path / "cache").rglob("*.arrays")} == entries


FULL = "the cache in {} cannot be written (No space left on device)"


@pytest.mark.parametrize("free", [0, 1, 40])
def test_precompute_on_a_full_disk_fails(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured, free: int
) -> None:
    """free: pages left; the last are too few for all that there is to keep."""
    with small_disk(tmp_path / "disk", 1 << 20) as disk:
        monkeypatch.setenv("INSITU_CACHE", str(disk / "cache"))
        (disk / "filling").write_bytes(bytes(max(os.statvfs(disk).f_bavail - free, 0) * 4096))
        assert run("precompute", scene, "--resolution", "96", "64", "--lights", 1000) == 1
        assert not list(disk.rglob("*.arrays")) or free
    said = capsys.readouterr()
    assert said.err.startswith("insitu: " + FULL.format(disk / "cache")) and said.err.count("\n") == 1
    assert "set INSITU_CACHE" in said.err and not said.out


@pytest.mark.parametrize("place", ["file", "file/cache", "/proc/self/cache"])
def test_precompute_without_a_folder_to_write_fails(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured, place: str
) -> None:
    (tmp_path / "file").write_bytes(b"mine")
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path / place))
    assert run("precompute", scene, "--lights", 1000) == 1
    said = capsys.readouterr()
    assert f"the cache in {tmp_path / place} cannot be written (" in said.err and said.err.count("\n") == 1
    assert not said.out and (tmp_path / "file").read_bytes() == b"mine"


def test_precompute_into_a_cache_that_is_too_small_fails(scene: Path, tmp_path: Path) -> None:
    def fill(name: str, bound: int) -> ArrayCache:
        store = ArrayCache(tmp_path / name, bound)
        fill_cache(open_project(str(scene)).with_settings(n_lights=500), lambda progress: None, store)
        return store

    all_of_it = fill("enough", 1 << 24).size()
    for name, bound in (("each fits, not both", all_of_it - 1), ("none fits", 1000)):
        with pytest.raises(InsituError, match=f"{name} may hold 0 MiB, too few for all of this .*; fewer --lights"):
            fill(name, bound)
    fill("room for parts that are being made as well", 2 * all_of_it)


@pytest.mark.parametrize(("broken", "status"), [(False, 0), (True, 1)])
def test_doctor_tells_what_works_and_how_to_mend_the_rest(broken: bool, status: int, capsys: Captured) -> None:
    assert run("doctor", frontend=Recorder(broken)) == status
    lines = capsys.readouterr().out.splitlines()
    found = {line.split(":")[0].split(maxsplit=1)[1]: line.split()[0] for line in lines if line[0] != " "}
    assert found.keys() == {"OpenGL", "display", "Embree", "memory", "cache", "state", "shared memory"}
    assert found["OpenGL"] == ("BROKEN" if broken else "ok") and found["display"] == "without"
    assert found["Embree"] == "ok"
    assert sum("to fix it:" in line for line in lines) >= 1 + broken


def test_doctor_names_a_folder_that_cannot_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path / "file" / "cache"))
    assert run("doctor") == 1
    said = capsys.readouterr().out
    assert f"BROKEN  cache: {tmp_path / 'file'}" in said and "INSITU_CACHE" in said
