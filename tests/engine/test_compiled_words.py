"""Kernels that copy rows do it number by number.

For whole rows of unknown length numba compiles the words of an error as well, some sixty functions on text, in each
process that compiles one such kernel: longer than the kernel itself takes.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# What is compiled on words while the call of each argument is made, a line each.
PROGRAM = """
import sys
import numpy as np
from numba.core import event
from engine.realtime.triple_product import _visibility_kernels as orbit
from engine.scene import _hit_kernels as relief
from engine.precompute.direct import _relight_kernels as relight

single = lambda *shape: np.ones(shape, np.float32)
double, whole = np.ones, np.zeros(1, np.int64)
for call in sys.argv[1:]:
    with event.install_recorder("numba:compile") as recorder:
        exec(call)
    modules = {each.data["dispatcher"].py_func.__module__ for _, each in recorder.buffer}
    assert any(module.startswith("engine.") for module in modules), modules
    print(*(module for module in modules if "unicode" in module))
"""
CALLS = {
    "first rays": "orbit.first_rays(whole, single(1, 3), single(1, 3, 3), single(4, 3), single(1, 3), single(1, 3))",
    "more rays": "orbit.more_rays(whole, np.ones((1, 1), bool), single(1, 3), single(1, 3, 3), single(4, 3), 1,"
    " single(1, 3), single(1, 3))",
    "bumps": "relief.fill_normal_offsets(whole, double(1), double(1), single(1, 2), double((1, 2, 3)),"
    " double((0, 3, 3)), double(1), 1.0, double(2), single(1, 3), double((1, 3)), double((1, 3)), double((1, 3)))",
    "wavelets": "relight._to_wavelets(single(32, 3), single(32, 3))",
}


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Modules of words that each call compiles, in a process that has compiled nothing before."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path_factory.mktemp("kernels"))}
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *CALLS.values()], cwd=ROOT, env=environment, capture_output=True, text=True,
        timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return dict(zip(CALLS, done.stdout.splitlines(), strict=True))


@pytest.mark.skipif(os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"), reason="nothing is compiled")
@pytest.mark.parametrize("call", CALLS)
def test_no_words_are_compiled(compiled: dict[str, str], call: str) -> None:
    assert compiled[call] == ""
