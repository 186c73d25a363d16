"""Kernels are compiled wherever their files cannot be kept or read, and what is damaged is kept anew."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from app.system import kernel_cache
from app.system.kernel_cache import kernel_folders, use_kernel_cache

SWEPT = [("nbi", b""), ("nbc", b""), ("nbi", b"\x80\x05junk")]
ROOT = Path(__file__).resolve().parents[3]
KERNEL = """
from numba import njit

@njit(cache=True)
def twice(x):
    return x + x
"""
# The arguments: the largest file that may be written.
PROGRAM = """
import resource, sys
from app.system.kernel_cache import use_kernel_cache
use_kernel_cache()
from kernel import twice
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
assert twice(21) == 42
print(sum(twice.stats.cache_hits.values()))
"""


def n_read(place: Path, folder: Path, largest: int = 1 << 30) -> int:
    """How many kernels another process reads from its files, where it runs one."""
    (folder / "kernel.py").write_text(KERNEL)
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(place), "PYTHONPATH": f"{ROOT}{os.pathsep}{folder}"}
    environment.pop("NUMBA_DISABLE_JIT", None)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(largest)], env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0 and not done.stderr, done.stderr
    return int(done.stdout)


def test_a_full_disk_costs_time_alone(tmp_path: Path) -> None:
    place = tmp_path / "kernels"
    assert n_read(place, tmp_path, largest=200) == 0
    assert [n_read(place, tmp_path), n_read(place, tmp_path)] == [0, 1]


@pytest.mark.parametrize("place", ["file", pytest.param("/proc/self/kernels", marks=pytest.mark.sweep)])
def test_a_folder_that_cannot_be_costs_time_alone(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").write_bytes(b"mine")
    assert n_read(tmp_path / place, tmp_path) == 0
    assert (tmp_path / "file").read_bytes() == b"mine" and not (tmp_path / "__pycache__" / "kernel.nbi").exists()


@pytest.mark.parametrize(
    ("kind", "content"),
    [("nbc", b"\x80\x05junk"), *(pytest.param(*odd, marks=pytest.mark.sweep) for odd in SWEPT)],
)
def test_damaged_files_are_replaced(tmp_path: Path, kind: str, content: bytes) -> None:
    place = tmp_path / "kernels"
    n_read(place, tmp_path)
    (file,) = place.rglob(f"*.{kind}")
    file.write_bytes(content)
    assert [n_read(place, tmp_path), n_read(place, tmp_path)] == [0, 1]


def test_what_is_run_is_read_from_a_folder_of_ones_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setattr("platformdirs.user_cache_dir", lambda *_, **__: str(tmp_path / "cache" / "insitu"))
    use_kernel_cache()
    assert (tmp_path / "cache" / "insitu").stat().st_mode & 0o777 == 0o700


def test_only_what_a_change_reaches_is_compiled_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A copy of the sources elsewhere shares what they are compiled to; an edit moves the files that import it."""
    before = folders_now()
    copy = tmp_path / "copy"
    shutil.copytree(ROOT / "engine", copy / "engine", ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(kernel_cache, "_ROOT", copy)
    monkeypatch.setattr(kernel_cache, "_ENGINE", copy / "engine")
    assert folders_now() == before
    with (copy / "engine/precompute/direct/_emitter_kernels.py").open("a") as file:
        file.write("# edited\n")
    moved = {folder.partition("-")[0] for folder in before - folders_now()}
    assert moved == {"direct_emitter_kernels", "direct_near_kernels", "direct_projection_kernels"}
    with (copy / "engine/material/kinds.py").open("a") as file:
        file.write("# edited\n")
    assert not any(folder.startswith("material_kernels-") for folder in before & folders_now())


def folders_now() -> set[str]:
    """Those of the sources as they are, whatever was read before."""
    for read in (kernel_cache.kernel_folders, kernel_cache.with_imported, kernel_cache.read):
        read.cache_clear()
    return set(kernel_folders())


def test_no_wrapper_for_calls_from_c_is_compiled_where_nobody_asks_for_one(tmp_path: Path) -> None:
    program = """
from app.system.kernel_cache import use_kernel_cache
use_kernel_cache()
from kernel import twice
from numba import cfunc
assert twice(21) == 42
compiled, = twice.overloads.values()
assert "cfunc." not in compiled.library.get_llvm_str()
assert cfunc("float64(float64)")(lambda x: twice(x)).ctypes(21.0) == 42.0
"""
    (tmp_path / "kernel.py").write_text(KERNEL)
    path = f"{ROOT}{os.pathsep}{tmp_path}"
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels"), "PYTHONPATH": path}
    environment.pop("NUMBA_DISABLE_JIT", None)
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
