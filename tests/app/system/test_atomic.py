"""Files are old or new, never half."""

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from app.system.atomic import replacing, sweep_temporaries, write_atomically
from app.system.system import process_lives
from tests.app.limits import small_disk

# A writer is forked, writes version after version, and is killed at a random moment, 250 times. Each version is one
# letter, 64 KiB of it and then its length: half a file, or two versions in one, would show.
KILL_LOOP = """
import os, random, signal, sys, time
import psutil  # here once: no writer is to spend its short life on it
from app.system.atomic import write_atomically
path, n_kills = sys.argv[1], int(sys.argv[2])
def version(k):
    return bytes([65 + k % 26]) * 65536 + b"65536"
write_atomically(path, version(0))
random.seed(7)
seen, kill = set(), 0
while kill < n_kills or len(seen) <= 5:  # until writing did go on between kills, however slow the machine
    kill += 1
    pid = os.fork()
    if not pid:
        for k in range(1000):
            write_atomically(path, version(kill + k))
        os._exit(0)
    time.sleep(random.uniform(0, 0.004))
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    data = open(path, "rb").read()
    if data[65536:] != b"65536" or len(set(data[:65536])) != 1:
        sys.exit(f"half a file after kill {kill}: {len(data)} bytes")
    seen.add(data[0])
print(len(seen))
"""


def test_writer_killed_at_random_moments_leaves_the_old_file_or_the_new(tmp_path: Path) -> None:
    path = tmp_path / "session.insitu"
    done = subprocess.run(
        [sys.executable, "-c", KILL_LOOP, str(path), "250"], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 5  # the kills came at different versions
    write_atomically(path, b"last")
    assert os.listdir(tmp_path) == ["session.insitu"]  # the next write removes what the killed ones left


@pytest.mark.parametrize("stage", ["fsync", "replace"])
def test_error_on_the_way_leaves_the_old_file_and_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, stage: str
) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"old")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, stage, fail)
    with pytest.raises(OSError, match="No space left"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a"]


def test_full_disk_leaves_the_old_file_and_no_other(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 1 << 20) as folder:
        write_atomically(folder / "a", b"old")
        with pytest.raises(OSError, match="No space left"):
            write_atomically(folder / "a", bytes(2 << 20))
        assert (folder / "a").read_bytes() == b"old"
        assert os.listdir(folder) == ["a"]


def test_exception_in_the_block_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "a"
    write_atomically(path, b"old")
    with pytest.raises(KeyError), replacing(path) as file:
        file.write(b"half of the n")
        raise KeyError
    assert path.read_bytes() == b"old"


def test_link_and_permissions_stay(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_bytes(b"old")
    target.chmod(0o640)
    link.symlink_to(target)
    write_atomically(link, b"new")
    assert link.is_symlink()
    assert target.read_bytes() == b"new"
    assert stat.S_IMODE(target.stat().st_mode) == 0o640


def test_sweep_takes_only_what_dead_processes_left(tmp_path: Path) -> None:
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait()  # its number is free now
    dead, living, other = f".a.{child.pid}-0.tmp", f".a.{os.getpid()}-0.tmp", "a.tmp"
    for name in (dead, living, other):
        (tmp_path / name).touch()
    sweep_temporaries(tmp_path)
    assert sorted(os.listdir(tmp_path)) == sorted([living, other])
    assert not process_lives(child.pid)
    assert process_lives(1)  # not ours to signal, perhaps, but there


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="this system does not tell the state of a process")
def test_process_that_nobody_has_collected_lives_no_more() -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)  # ended, still to be collected
        assert not process_lives(child.pid)
