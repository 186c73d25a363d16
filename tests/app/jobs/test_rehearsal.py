"""What is wanted after the first picture is compiled before that: each part calls the kernels that it is for."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
# A fresh process: what other tests have called counts for nothing there.
PROGRAM = """
from app.machine.kernel_cache import use_kernel_cache

use_kernel_cache()
from app.jobs.kernels import LATER
from app.jobs.rehearsal import rehearse_later

called = {}
for part in rehearse_later():
    from engine.indirect._second_kernels import second_light
    from engine.orbit._sun_kernels import add_asked
    from engine.texture._stroke_kernels import cover
    from engine.transport._relight_kernels import fill_rows

    kernels = {"painting": cover, "indirect": second_light, "relighting": fill_rows, "orbit": add_asked}
    called[part] = {name for name, kernel in kernels.items() if kernel.signatures}
assert tuple(called) == LATER
for part, found in called.items():
    assert part in found or part == "estimate", (part, found)
"""


@pytest.mark.sweep
def test_each_part_calls_its_kernels() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
