"""`python -m benchmarks` that is ended in the middle leaves no process and no folder behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

pytestmark = [pytest.mark.slow, pytest.mark.window]

# The real command; what is measured within this process is left out, so that programs are started at once.
PROGRAM = """
import sys
import benchmarks.run as measuring
from benchmarks.__main__ import main
measuring.precompute = lambda *arguments: None
measuring.precompute_figures = measuring.visibility_figures = lambda *arguments: []
if sys.argv.pop(1) == "renderer":
    measuring.window_figures = lambda *arguments: []
sys.exit(main())
"""


def processes(mark: str) -> list[int]:
    """All living processes that were started with the mark in their environment."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            marked = mark.encode() in (folder / "environ").read_bytes().split(b"\0")
            if marked and (folder / "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z":
                found.append(int(folder.name))
        except OSError:
            continue
    return found


def wait_for(condition: Callable[[], bool], timeout_s: float) -> bool:
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.02)
    return True


@pytest.mark.parametrize(
    ("during", "n_started", "number", "status", "impatient"),  # started: Xvfb, the program, its worker
    [
        ("windows", 4, signal.SIGINT, 130, True),
        pytest.param("windows", 4, signal.SIGTERM, 143, False, marks=pytest.mark.sweep),
        pytest.param("renderer", 3, signal.SIGINT, 130, False, marks=pytest.mark.sweep),
        ("renderer", 3, signal.SIGTERM, 143, True),
    ],
)
def test_nothing_is_left(
    during: str, n_started: int, number: int, status: int, impatient: bool, tiny_scene: str, tmp_path: Path
) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    mark = f"INSITU_TEST_MARK={tmp_path}"
    environment = {**os.environ, "TMPDIR": str(scratch), mark.split("=")[0]: str(tmp_path)}
    command = [sys.executable, "-c", PROGRAM, during, tiny_scene, "--quick", "--only", "figures"]
    command += ["-o", str(tmp_path / "out")]
    measuring = subprocess.Popen(
        command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True
    )
    assert measuring.stderr is not None
    with measuring.stderr as words:
        try:
            assert wait_for(lambda: len(processes(mark)) >= n_started, 30.0)
            assert list(scratch.glob("insitu-measure-*"))
            os.killpg(measuring.pid, number)  # as a terminal does
            if impatient:
                time.sleep(0.01)
                measuring.send_signal(number)
            # A second signal may find the interpreter ending, where it is the system's: a shell tells the same number.
            assert measuring.wait(20.0) in (status, -number)
            assert processes(mark) == []
            assert list(scratch.iterdir()) == []
            assert words.read() == b""
        finally:
            for pid in processes(mark):
                os.kill(pid, signal.SIGKILL)
            measuring.wait(5.0)
