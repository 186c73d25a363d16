"""What compiled kernels may not take for granted, and where they run uncompiled or with their bounds checked."""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path

import numba
import pytest

ROOT = Path(__file__).resolve().parents[1]
FILES = [path for folder in ("engine", "benchmarks") for path in ROOT.glob(f"{folder}/**/_*kernels.py")]
MODULES = sorted(".".join(path.relative_to(ROOT).with_suffix("").parts) for path in FILES)


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize("name", MODULES)
def test_no_kernel_takes_every_number_for_finite(name: str) -> None:
    """Flags one by one; a kernel that looks for what is no number is not compiled as if there were none."""
    for kernel in vars(importlib.import_module(name)).values():
        if hasattr(kernel, "targetoptions"):
            flags = kernel.targetoptions.get("fastmath", False)
            assert flags is False or (isinstance(flags, set) and "fast" not in flags), f"{kernel}: {flags}"
            if flags and flags & {"nnan", "ninf"}:
                assert not re.search(r"isnan|isfinite|isinf|\binf\b", inspect.getsource(kernel.py_func)), kernel


def test_what_runs_checked_is_there() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8").replace("\\\n", " ")
    assert "NUMBA_BOUNDSCHECK=1" in text and "NUMBA_DISABLE_JIT=1" in text
    found = re.findall(r"^(?:BOUNDS_CHECKED|UNCOMPILED) := \$\(addprefix (.+),(.+)\)$", text, re.MULTILINE)
    assert len(found) == 2
    for folder, places in found:
        for place in places.split():
            assert (ROOT / folder / place).exists(), place
