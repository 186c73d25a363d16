"""The command line: what it takes, what it says, and its exit status. Most tests start no process."""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

from app import cli, console
from app.__main__ import Desktop
from app.console import COMMANDS, guarded
from app.jobs.cache import Store
from app.precompute import precompute as fill_cache
from app.project import open_project
from app.script import Step
from engine.errors import InsituError
from engine.light.image_files import read_radiance_image
from tests.app.limits import largest_file, small_disk

ROOT = Path(__file__).resolve().parents[2]
SCENE = """
version = 1
name = "ball"
bounces = 1
[camera]
position = [0, 0, 4]
target = [0, 0, 0]
resolution = [24, 16]
[environment]
radiance = 0.5
[[object]]
name = "ball"
primitive = "sphere"
layer = [{ model = "lambert", name = "chalk", albedo = 1.0 }]
"""


class Recorder:
    """A window's side that notes what it was asked for."""

    def __init__(self, broken: bool = False) -> None:
        self.broken = broken
        self.opened: list[str] = []
        self.shots: list[tuple[Any, ...]] = []

    def open_window(self, source: str) -> int:
        self.opened.append(source)
        return 0

    def take_screenshot(
        self, source: str, output: Path, steps: Sequence[Step], size: tuple[int, int], scale: float,
        resolution: tuple[int, int] | None,
    ) -> None:  # fmt: skip
        self.shots.append((source, output, tuple(steps), size, scale, resolution))

    def describe_graphics(self) -> str:
        if self.broken:
            raise InsituError("OpenGL 4.1 core is needed, none could be opened")
        return "a renderer"

    def describe_display(self) -> str:
        raise InsituError("no display")


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    (tmp_path / "ball.toml").write_text(SCENE)
    return tmp_path / "ball.toml"


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("INSITU_STATE", str(tmp_path / "state"))


def run(*words: str | Path, frontend: Recorder | None = None) -> int:
    return guarded(lambda: cli.run([str(word) for word in words], frontend or Recorder()))


Captured = pytest.CaptureFixture[str]


# ---------------------------------------------------------------------------------------------------- the command line


def test_the_words_that_are_commands_are_those_that_exist() -> None:
    command = typer.main.get_command(cli.cli)
    assert set(COMMANDS) == set(command.commands)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name: str) -> None:
    result = CliRunner().invoke(cli.cli, [name, "--help"])
    assert result.exit_code == 0 and "Usage:" in result.output and "Traceback" not in result.output


def test_help_and_nothing_else_succeed(capsys: Captured) -> None:
    assert run("--help") == 0
    said = capsys.readouterr().out
    assert all(name in said for name in COMMANDS if name != "edit") and "teatray" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["render"], "Missing option"),
        (["render", "--nope"], "No such option"),
        (["render", "-o", "a.exr", "--lights", "3"], "--lights"),
        (["render", "-o", "a.exr", "--resolution", "0", "9"], "0 x 9"),
        (["render", "-o", "a.exr", "--resolution", "9"], "--resolution"),
        (["render", "-o", "a.exr", "--bounces", "0"], "--bounces"),
        (["render", "-o", "a.exr", "--reference", "--bounces", "17"], "less than or equal to 16"),
        (["render", "-o", "a.exr", "--reference", "--samples", "0"], "--samples"),
        (["render", "-o", "a.exr", "--reference", "--samples", "many"], "valid integer"),
        (["render", "-o", "a.exr", "--mode", "orbit", "--lights", "400"], "Orbit cuts no lights"),
        (["render", "-o", "a.exr", "--mode", "orbit", "--series", "64,1"], "Invalid value for --series"),
        (["screenshot", "-o", "a.png", "--size", "9", "9"], "9 x 9"),
        (["screenshot", "-o", "a.png", "--scale", "99"], "--scale"),
        (["teatray", "cornell"], "unexpected"),
    ],
)
def test_wrong_usage_is_status_2_and_one_line(words: list[str], said: str, capsys: Captured) -> None:
    assert run(*words) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere.toml"], "no such file"),
        (["render", "nowhere", "-o", "OUT/a.exr"], "built-in scenes are teatray"),
        (["render", "SCENE", "-o", "OUT/a.jpg"], "ends in .exr or .png"),
        (["render", "SCENE", "-o", "OUT"], "ends in"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--bounces", "3", "--samples", "9"], "expected --reference"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--bounces", "3", "--series", "64,1"], "as many bounces in both"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--series", "64,one"], "--series 64,one: expected numbers"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--series", "48,1"], "expected powers of two"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--series", "64,8,2"], "expected 1 at every bounce after the second"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--set", "ball"], "path=value"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--set", "ball.7.albedo=1"], "0 (chalk)"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--set", "ball.0.albedo=red"], "albedo"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--rotation", "nan"], "rotation"),
        (["render", "SCENE", "-o", "SCENE/a.exr"], "folder"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--resolution", "16384", "16384"], "smaller --resolution"),
        (["plan", "SCENE", "--overrule", "ball.0.theta_i=3"], "power of two"),
        (["screenshot", "SCENE", "-o", "OUT/a.exr"], "ends in .png"),
        (["screenshot", "SCENE", "-o", "OUT/a.png", "--script", "nowhere.toml"], "nowhere.toml"),
        (["precompute", "nowhere"], "no such file"),
    ],
)
def test_failed_work_is_status_1_and_one_line(
    words: list[str], said: str, scene: Path, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.memory.memory_bytes", lambda: (8 << 30, 16 << 30))
    assert run(*(word.replace("SCENE", str(scene)).replace("OUT", str(tmp_path)) for word in words)) == 1
    error = capsys.readouterr().err
    assert said in error and error.startswith("insitu: ") and error.count("\n") == 1
    assert not list(tmp_path.glob("a.*"))


# ---------------------------------------------------------------------------------------------------------- the editor


def test_a_scene_alone_opens_the_editor(scene: Path) -> None:
    frontend = Recorder()
    assert run(scene, frontend=frontend) == 0 and run("edit", "cornell", frontend=frontend) == 0
    assert frontend.opened == [str(scene), "cornell"]


def test_a_screenshot_carries_its_script(scene: Path, tmp_path: Path) -> None:
    (tmp_path / "script.toml").write_text('[[step]]\nrotate = 30.0\n[[step]]\ncapture = "half.png"\n')
    frontend = Recorder()
    output = tmp_path / "pictures" / "ui.png"
    words = ("screenshot", scene, "-o", output, "--script", tmp_path / "script.toml", "--size", "900", "700")
    assert run(*words, frontend=frontend) == 0
    ((source, to, steps, size, scale, resolution),) = frontend.shots
    assert (source, to, size, scale, resolution) == (str(scene), output, (900, 700), 1.0, None)
    # Pictures that the script takes go beside the last one, not beside the script.
    assert steps[1].path == output.resolve().parent / "half.png"


# -------------------------------------------------------------------------------------------------------------- render


def test_render_writes_linear_radiance(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    output = tmp_path / "new" / "a.exr"
    values = ("--set", "ball.chalk.albedo=[0.5, 1, 0]", "--set", "light.intensity=2")
    assert run("render", scene, "-o", output, "--resolution", "32", "20", *values) == 0
    image = read_radiance_image(output)
    assert image.shape == (20, 32, 3)
    # Sky 0.5, doubled; a convex thing of albedo (1/2, 1, 0) under it.
    assert image[10, 16] == pytest.approx([0.5, 1.0, 0.0], abs=0.01) and image[0, 0] == pytest.approx([1.0, 1.0, 1.0])
    assert "32 x 20" in capsys.readouterr().out
    assert [file.name for file in output.parent.iterdir()] == ["a.exr"]


def test_intensity_multiplies_lamps_as_well_as_the_sky(tmp_path: Path) -> None:
    scene = tmp_path / "lamp.toml"
    lamp = """
[[object]]
name = "lamp"
primitive = "quad"
transform = [1,0,0,0, 0,0,-1,1.2, 0,1,0,0.5, 0,0,0,1]
emission = [6, 5, 4]
"""
    scene.write_text(SCENE.replace("[environment]\nradiance = 0.5\n", "") + lamp)
    pictures = {}
    for intensity in (1, 3):
        output = tmp_path / f"{intensity}.exr"
        assert run("render", scene, "-o", output, "--set", f"light.intensity={intensity}") == 0
        pictures[intensity] = read_radiance_image(output)
    # Lit by the lamp alone; the ball's upper half is bright.
    assert pictures[1].max() > 0.2
    np.testing.assert_array_equal(pictures[3], np.float32(3) * pictures[1])


def test_reference_is_the_same_picture(scene: Path, tmp_path: Path) -> None:
    words = ("render", scene, "--resolution", "10", "8")
    assert run(*words, "-o", tmp_path / "a.exr") == 0 and run(*words, "-o", tmp_path / "b.exr", "--reference") == 0
    ours, truth = read_radiance_image(tmp_path / "a.exr"), read_radiance_image(tmp_path / "b.exr")
    assert np.abs(ours - truth).max() < 0.02 * truth.max()


def test_bounces_by_brute_force_change_nothing_about_a_convex_thing(
    scene: Path, tmp_path: Path, capsys: Captured
) -> None:
    words = ("--bounces", "3", "--reference", "--samples", "256", "--set", "light.intensity=2")
    assert run("render", scene, "-o", tmp_path / "a.exr", "--resolution", "12", "8", *words) == 0
    image = read_radiance_image(tmp_path / "a.exr")
    assert re.search(r"12 x 8, .* s, noise [0-3]\.\d\d%", capsys.readouterr().out)
    # White under a sky of 0.5, doubled: all of it is 1.
    assert image.shape == (8, 12, 3) and np.abs(image - 1.0).max() < 0.05 and abs(image.mean() - 1.0) < 0.003


def test_render_to_png_is_what_the_screen_shows(scene: Path, tmp_path: Path) -> None:
    assert run("render", scene, "-o", tmp_path / "a.png", "--lights", "200") == 0
    with Image.open(tmp_path / "a.png") as image:
        # Filmic of 0.5: 0.6425/1.0425 = 0.6163, in sRGB 0.806 of 255.
        assert image.size == (24, 16) and image.getpixel((0, 0)) == (206, 206, 206)


def test_a_view_is_chosen_by_name(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    words = ("render", scene, "--lights", "200", "--resolution", "6", "4", "-o")
    assert run(*words, tmp_path / "a.png", "--view", "standard") == 0
    with Image.open(tmp_path / "a.png") as image:
        assert image.getpixel((0, 0)) == (188, 188, 188)  # 0.5 in sRGB is 0.735 of 255
    assert run(*words, tmp_path / "a.png", "--view", "sepia") == 1
    assert "insitu: view: name = sepia, expected Filmic, AgX, ACES 2.0, ACES 1.3, Standard" in capsys.readouterr().err
    assert run(*words, tmp_path / "a.exr", "--view", "agx") == 1
    assert "holds light itself, expected a name that ends in .png" in capsys.readouterr().err


def test_an_old_picture_survives_a_failed_one(scene: Path, tmp_path: Path, capsys: Captured) -> None:
    output = tmp_path / "a.exr"
    output.write_bytes(b"old")
    with largest_file(100):
        assert run("render", scene, "-o", output, "--lights", "50") == 1
    assert f"insitu: {output}: not written, File too large; what was there is untouched" in capsys.readouterr().err
    assert output.read_bytes() == b"old" and len(list(tmp_path.glob("*a.exr*"))) == 1


# -------------------------------------------------------------------------------------------- plan, precompute, doctor


def test_plan_says_what_and_why_and_what_it_costs(scene: Path, capsys: Captured) -> None:
    assert run("plan", scene, "--overrule", "ball.0.theta_i=4") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["ball.0.theta_i", "4", "bands", "overruled"]
    assert any(line.startswith("sphere") and "5,120 directions" in line for line in lines)
    assert "MiB of main memory" in lines[-2] and "MiB on disk" in lines[-2] and "extrapolated" in lines[-1]


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
    said = "all light is reflected on and on: no number of bounces holds it, 3 are shown"
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
    assert run("precompute", scene) == 0
    assert "of transport" in capsys.readouterr().out
    entries = {file.name for file in (tmp_path / "cache").rglob("*.arrays")}
    assert len(entries) == 3  # visibility, the one layer's transport, and the unit it is in
    assert run("precompute", scene) == 0
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
        assert run("precompute", scene, "--resolution", "96", "64") == 1
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
    assert run("precompute", scene) == 1
    said = capsys.readouterr()
    assert f"the cache in {tmp_path / place} cannot be written (" in said.err and said.err.count("\n") == 1
    assert not said.out and (tmp_path / "file").read_bytes() == b"mine"


def test_precompute_into_a_cache_that_is_too_small_fails(scene: Path, tmp_path: Path) -> None:
    def fill(name: str, bound: int) -> Store:
        store = Store(tmp_path / name, bound)
        fill_cache(open_project(str(scene)), lambda progress: None, 4000, store)
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
    assert sum("to mend it:" in line for line in lines) >= 1 + broken


def test_doctor_names_a_folder_that_cannot_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path / "file" / "cache"))
    assert run("doctor") == 1
    said = capsys.readouterr().out
    assert f"BROKEN  cache: {tmp_path / 'file'}" in said and "INSITU_CACHE" in said


# ------------------------------------------------------------------------------------------------- whatever goes wrong


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (KeyboardInterrupt(), 130, ""),
        (InsituError("a line\nand another"), 1, "insitu: a line and another\n"),
        (PermissionError(13, "Permission denied", "/there"), 1, "insitu: /there: Permission denied\n"),
        (MemoryError(), 1, "insitu: there is not enough memory"),
        (ZeroDivisionError("of ours"), 1, "insitu: this failed: a defect of Insitu (for a report: /"),
    ],
)
def test_a_person_never_sees_a_traceback(error: BaseException, status: int, said: str, capsys: Captured) -> None:
    def work() -> int:
        raise error

    assert guarded(work) == status
    printed = capsys.readouterr().err
    assert printed.startswith(said) and "Traceback" not in printed and bool(printed) == bool(said)


def test_the_details_of_a_defect_are_kept(tmp_path: Path) -> None:
    def work() -> int:
        raise ZeroDivisionError("of ours")

    guarded(work)
    assert "ZeroDivisionError: of ours" in (tmp_path / "state" / console.ERROR_FILE).read_text()


def start(*words: str | Path, folder: Path, **variables: str) -> subprocess.Popen[str]:
    environment = {name: value for name, value in os.environ.items() if "DISPLAY" not in name} | variables
    command = [sys.executable, "-m", "app", *map(str, words)]
    # A program started in the background of a shell ignores Ctrl-C, and so would its children.
    heard = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731
    return subprocess.Popen(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, preexec_fn=heard
    )


def test_without_a_display_there_is_one_line_and_status_2(tmp_path: Path) -> None:
    process = start(folder=tmp_path)
    out, error = process.communicate(timeout=180)
    assert process.returncode == 2 and out == "" and error.count("\n") == 1
    assert "display" in error and "insitu render" in error and "insitu screenshot" in error


def wait_until_tracing(process: subprocess.Popen[str]) -> None:
    """Until the library that traces rays is there: past the command line and its imports."""
    maps = Path(f"/proc/{process.pid}/maps")
    deadline = time.monotonic() + 60.0
    while "embree" not in maps.read_text():
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="needs /proc")
def test_ctrl_c_is_quiet(scene: Path, tmp_path: Path) -> None:
    process = start("render", scene, "-o", tmp_path / "a.exr", "--reference", "--resolution", "512", "512",
                    folder=tmp_path)  # fmt: skip
    wait_until_tracing(process)  # an hour of work
    process.send_signal(signal.SIGINT)
    try:
        out, error = process.communicate(timeout=180)
    finally:
        process.kill()
    # 130, or ended by the signal itself, which a shell calls 130 too.
    assert process.returncode in (130, -signal.SIGINT) and (out, error) == ("", "")
    assert not (tmp_path / "a.exr").exists()


def test_the_way_to_the_window_imports_nothing_slow() -> None:
    slow = {"typer", "rich", "numba", "scipy", "trimesh"}
    program = f"import sys, app.__main__, app.console, app.project; print(*sorted({slow!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


@pytest.mark.gl
def test_the_desktop_describes_its_graphics() -> None:
    assert "OpenGL" in Desktop().describe_graphics()


def test_progress_is_for_terminals_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Callable[[float, str], None]] = []
    quiet = io.StringIO()
    monkeypatch.setattr(sys, "stderr", quiet)
    with cli._progress() as report:
        report(0.5, "half")
        shown.append(report)
    assert quiet.getvalue() == "" and len(shown) == 1
