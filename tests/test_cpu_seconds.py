"""Processor seconds are counted with those of other processes, and not the seconds that a test sleeps."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TESTS = """
import subprocess, sys, time
BURN = "import time\\nwhile time.process_time() < 0.5: pass"

def test_works():
    subprocess.run([sys.executable, "-c", BURN], check=True)

def test_sleeps():
    time.sleep(0.5)
"""


def test_what_a_test_starts_counts_and_sleep_does_not(tmp_path: Path) -> None:
    (tmp_path / "test_it.py").write_text(TESTS)
    words = ["-q", "-p", "tests.cpu_seconds", "-p", "no:cacheprovider", "-c", "/dev/null", "--rootdir", str(tmp_path)]
    command = [sys.executable, "-m", "pytest", *words, str(tmp_path / "test_it.py")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout
    lines = [line.split() for line in done.stdout.splitlines() if "test_it.py" in line]
    found = {name.partition("::")[2]: float(seconds) for seconds, name in lines}
    assert found["test_works"] >= 0.5 > 0.3 > found["test_sleeps"]
    assert found[""] >= found["test_works"]  # the file's
