"""The command line: what it takes, what it says, and its exit status. Most tests start no process."""

from __future__ import annotations

import importlib.metadata
import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from app.__main__ import Desktop
from app.cli import console, program
from app.cli.console import COMMANDS, run_guarded
from app.cli.options import progress
from engine.core.errors import InsituError
from tests.app.cli.command_line import Recorder, run

ROOT = Path(__file__).resolve().parents[3]
Captured = pytest.CaptureFixture[str]


def test_the_words_that_are_commands_are_those_that_exist() -> None:
    command = typer.main.get_command(program.cli)
    assert set(COMMANDS) == set(command.commands)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_explains_itself(name: str) -> None:
    result = CliRunner().invoke(program.cli, [name, "--help"])
    assert result.exit_code == 0 and "Usage:" in result.output and "Traceback" not in result.output


def test_help_and_nothing_else_succeed(capsys: Captured) -> None:
    assert run("--help") == 0
    said = capsys.readouterr().out
    assert all(name in said for name in COMMANDS if name != "edit") and "teatray" in said


def test_it_says_its_version(capsys: Captured) -> None:
    assert run("--version") == 0
    assert capsys.readouterr().out.strip() == f"insitu {importlib.metadata.version('insitu')}"


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
        (["render", "SCENE", "-o", "OUT/a.exr", "--series", "64,8,8,2"], "expected 1 at every bounce after the third"),
        (
            ["render", "SCENE", "-o", "OUT/a.exr", "--series", "8,16"],
            "no more bands at a bounce than at the one before",
        ),
        (["render", "SCENE", "-o", "OUT/a.exr", "--set", "ball"], "path=value"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--set", "ball.7.albedo=1"], "0 (chalk)"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--set", "ball.0.albedo=red"], "albedo"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--rotation", "nan"], "rotation"),
        (["render", "SCENE", "-o", "SCENE/a.exr"], "folder"),
        (["render", "SCENE", "-o", "OUT/a.exr", "--resolution", "16384", "16384"], "smaller --resolution"),
        (["plan", "SCENE", "--override", "ball.0.theta_i=3"], "power of two"),
        (["screenshot", "SCENE", "-o", "OUT/a.exr"], "ends in .png"),
        (["screenshot", "SCENE", "-o", "OUT/a.png", "--script", "nowhere.toml"], "nowhere.toml"),
        (["precompute", "nowhere"], "no such file"),
    ],
)
def test_failed_work_is_status_1_and_one_line(
    words: list[str], said: str, scene: Path, tmp_path: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.system.memory.memory_bytes", lambda: (8 << 30, 16 << 30))
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
    assert steps[1].value == output.resolve().parent / "half.png"


# ------------------------------------------------------------------------------------------------- whatever goes wrong


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (KeyboardInterrupt(), 130, ""),
        (InsituError("a line\nand another"), 1, "insitu: a line and another\n"),
        (PermissionError(13, "Permission denied", "/there"), 1, "insitu: /there: Permission denied\n"),
        (MemoryError(), 1, "insitu: there is not enough memory"),
        (ZeroDivisionError("of ours"), 1, "insitu: this failed: a bug in Insitu (for a report: /"),
    ],
)
def test_the_user_never_sees_a_traceback(error: BaseException, status: int, said: str, capsys: Captured) -> None:
    def work() -> int:
        raise error

    assert run_guarded(work) == status
    printed = capsys.readouterr().err
    assert printed.startswith(said) and "Traceback" not in printed and bool(printed) == bool(said)


def test_the_details_of_a_defect_are_kept(tmp_path: Path) -> None:
    def work() -> int:
        raise ZeroDivisionError("of ours")

    run_guarded(work)
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
    program = (
        f"import sys, app.__main__, app.cli.console, app.project.project; print(*sorted({slow!r} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


@pytest.mark.gl
def test_the_desktop_describes_its_graphics() -> None:
    assert "OpenGL" in Desktop().describe_graphics()


def test_progress_is_for_terminals_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Callable[[float, str], None]] = []
    quiet = io.StringIO()
    monkeypatch.setattr(sys, "stderr", quiet)
    with progress() as report:
        report(0.5, "half")
        shown.append(report)
    assert quiet.getvalue() == "" and len(shown) == 1
