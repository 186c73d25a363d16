"""Compiled kernels: their cache, the copy beside the installation, and numba's files of them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from filelock import FileLock

from app.system import kernel_cache
from app.system import kernel_cache as installed_kernels
from app.system.kernel_cache import NUMBA_VARIABLE, keep_installed, kernel_folders, take_installed, use_kernel_cache
from app.worker import kernels
from app.worker.kernels import LATER, PARTS, Kernels

FIRST, SECOND = kernel_folders()[:2]


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The installation's kernels, as one person's first start has left them."""
    folder = tmp_path / "site-packages" / "kernels"
    folder.parent.mkdir()
    monkeypatch.setattr(installed_kernels, "installed_folder", lambda: folder)
    monkeypatch.setenv(NUMBA_VARIABLE, str(tmp_path / "who installs"))
    for name in (FIRST, SECOND, "older_kernels-0123"):
        write(tmp_path / "who installs" / name / "kernel.nbc", "compiled")
    for what in ("", *LATER):
        kernels.note_compiled(what)
    keep_installed()
    return folder


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def go_home(home: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Be another person; the folder that kernels are then kept in."""
    for variable in ("XDG_CACHE_HOME", "HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(variable, str(home))
    monkeypatch.delenv(NUMBA_VARIABLE)
    use_kernel_cache()
    return Path(os.environ[NUMBA_VARIABLE])


def test_another_home_has_nothing_to_compile(installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[str] = []
    monkeypatch.setattr(kernels, "_start_compiler", started.append)
    assert sorted(path.name for path in installed.iterdir() if path.is_dir()) == sorted([FIRST, SECOND])
    cache = go_home(tmp_path / "home", monkeypatch)
    assert cache.is_relative_to(tmp_path / "home")
    assert not Kernels().first_time and started == []
    assert all(map(kernels.are_compiled, LATER))
    assert [(cache / name / "kernel.nbc").read_text() for name in (FIRST, SECOND)] == ["compiled"] * 2


def test_other_sources_are_compiled(installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[str] = []
    monkeypatch.setattr(kernels, "_start_compiler", started.append)
    for module in (kernels, installed_kernels):
        monkeypatch.setattr(module, "kernel_digest", lambda: "another")
    cache = go_home(tmp_path / "home", monkeypatch)
    assert Kernels().first_time and started == list(PARTS)
    assert (cache / FIRST).is_dir()  # the file that did not change


def test_what_was_begun_is_finished(installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file's kernels of which some are there already stay, and whether all are is then left to the compiler."""
    cache = go_home(tmp_path / "home", monkeypatch)
    write(cache / FIRST / "kernel.nbc", "begun")
    take_installed()
    assert [(cache / name / "kernel.nbc").read_text() for name in (FIRST, SECOND)] == ["begun", "compiled"]
    assert not kernels.are_compiled()


def test_a_folder_of_the_users_choice_is_left_empty(
    installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(NUMBA_VARIABLE, str(tmp_path / "chosen"))
    take_installed()
    assert not (tmp_path / "chosen").exists()


def test_an_installation_that_cannot_be_written_is_left_alone(
    installed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "file", "mine")
    monkeypatch.setattr(installed_kernels, "installed_folder", lambda: tmp_path / "file" / "kernels")
    keep_installed()
    go_home(tmp_path / "home", monkeypatch)
    take_installed()
    assert (tmp_path / "file").read_text() == "mine"


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


IMPATIENT = "import app.system.kernel_files as files; files._PATIENCE_SECONDS = 0.1"


def n_read(place: Path, folder: Path, largest: int = 1 << 30, program: str = PROGRAM) -> int:
    """How many kernels another process reads from its files, where it runs one."""
    (folder / "kernel.py").write_text(KERNEL)
    done = subprocess.run(
        [sys.executable, "-c", program, str(largest)],
        env=compiling(place, folder),
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0 and not done.stderr, done.stderr
    return int(done.stdout)


def compiling(place: Path, folder: Path) -> dict[str, str]:
    """The environment of a process that imports kernels from a folder and keeps them in a place."""
    path = f"{ROOT}{os.pathsep}{folder}"
    kept = {name: value for name, value in os.environ.items() if name != "NUMBA_DISABLE_JIT"}
    return {**kept, "NUMBA_CACHE_DIR": str(place), "PYTHONPATH": path}


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
    reached = ("direct_emitter", "direct_near", "direct_projection", "direct_relight", "indirect_gloss_row")
    assert moved == {f"{name}_kernels" for name in reached}
    with (copy / "engine/material/kinds.py").open("a") as file:
        file.write("# edited\n")
    assert not any(folder.startswith("material_kernels-") for folder in before & folders_now())


def test_what_is_imported_in_parentheses_counts() -> None:
    folder = ROOT / "engine" / "precompute" / "indirect"
    imported = kernel_cache.with_imported(folder / "_photon_kernels.py")
    # Photons are weighted by a function that is compiled into theirs, from a list of names in parentheses.
    assert folder / "_second_bounce_kernels.py" in imported


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
    environment = compiling(tmp_path / "kernels", tmp_path)
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr


def test_a_callback_for_c_is_compiled_and_stored(tmp_path: Path) -> None:
    program = """
from app.system.kernel_cache import use_kernel_cache
use_kernel_cache()
from callback import twice
assert twice.ctypes(21.0) == 42.0
print(twice.cache_hits)
"""
    text = 'from numba import cfunc\n\n@cfunc("float64(float64)", cache=True)\ndef twice(x):\n    return x + x\n'
    (tmp_path / "callback.py").write_text(text)
    command, environment = [sys.executable, "-c", program], compiling(tmp_path / "kernels", tmp_path)
    for n_read_again in ("0\n", "1\n"):
        done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
        assert (done.returncode, done.stdout) == (0, n_read_again), done.stderr


CALLING = """
from numba import njit

@njit(cache=True)
def inner(x):
    return x + x

@njit(cache=True)
def outer(x):
    return inner(x) * 2
"""
# Compiles slowly, and prints how many kernels it has compiled. The argument: for which types.
SLOW_PROGRAM = """
import sys, time
from app.system.kernel_cache import use_kernel_cache
use_kernel_cache()
from numba.core import dispatcher
from calling import inner, outer
compiler = dispatcher._FunctionCompiler
compile = compiler.compile
compiler.compile = lambda *of: (time.sleep(0.5), compile(*of))[1]
print("ready", flush=True)
sys.stdin.readline()
x = 21 if sys.argv[1] == "int" else 21.0
assert outer(x) == 84
print(sum(sum(kernel.stats.cache_misses.values()) for kernel in (inner, outer)))
"""


@pytest.mark.parametrize(("types", "n_compiled"), [(("int", "int"), 2), (("int", "float"), 4)])
def test_processes_compile_each_kernel_once(tmp_path: Path, types: tuple[str, ...], n_compiled: int) -> None:
    """Two that begin together share the work; what either has stored is there afterwards, of all types."""
    (tmp_path / "calling.py").write_text(CALLING)
    environment = compiling(tmp_path / "kernels", tmp_path)

    def start(kind: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", SLOW_PROGRAM, kind]
        return subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def finish(processes: list[subprocess.Popen[str]]) -> int:
        for process in processes:
            assert process.stdout is not None and process.stdout.readline() == "ready\n"
        for process in processes:
            assert process.stdin is not None
            process.stdin.write("\n")
            process.stdin.flush()
        return sum(int(process.communicate(timeout=120)[0]) for process in processes)

    assert finish([start(kind) for kind in types]) == n_compiled
    assert finish([start(kind) for kind in types]) == 0


def test_a_kernel_whose_lock_is_never_given_back_is_compiled_all_the_same(tmp_path: Path) -> None:
    assert n_read(tmp_path / "kernels", tmp_path) == 0
    (folder,) = {file.parent for file in (tmp_path / "kernels").rglob("*.nbi")}
    (lock,) = folder.glob("*.lock")
    for file in folder.glob("*.nb?"):
        file.unlink()
    impatient = PROGRAM.replace("from kernel", f"{IMPATIENT}\nfrom kernel")
    with FileLock(lock):
        assert n_read(tmp_path / "kernels", tmp_path, program=impatient) == 0
    assert n_read(tmp_path / "kernels", tmp_path) == 1
