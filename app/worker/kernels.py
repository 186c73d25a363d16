"""Loads compiled kernels while the scene is being opened; the first time on a machine two processes compile them.

    worker:  opens the scene ─► waits ─► coarse picture ─► ... indirect light ─► estimate ─► other light, cameras
      a thread of it:  waits ─► reads what is compiled
      two processes:   compile, a part each, where nothing is compiled yet
      then another:    compiles what is needed later (`app.worker.kernel_warm_up`)

Numba compiles under one lock and mostly in Python, so that threads would take turns; processes share what they have
compiled through the folder of `app.system.kernel_cache`, which begins with what the installation has
(`app.system.kernel_cache`). A file in it, written when all was ready, tells that no other process is needed; there
is one for each of `LATER` as well. Requests that need one of those meanwhile wait in steps (`Kernels.until_ready`), so
that others are answered; Orbit and Deform, which a scene may be opened in, have theirs compiled before the others. A
fault here costs only time: a kernel that is not ready is compiled when it is called.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import importlib.metadata
import logging
import os
import platform
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from app.system.kernel_cache import (
    NUMBA_VARIABLE,
    keep_installed,
    kernel_digest,
    kernel_folders,
    take_installed,
    use_kernel_cache,
)
from app.system.lazy_import import qualified
from app.system.system import end_with_parent
from app.worker.process import LAST, step_behind, yield_to_window

if TYPE_CHECKING:
    from app.worker.tasks import RequestDispatcher

# Compiling allocates many objects that stay; collecting garbage among them again and again takes a tenth of the time.
GC_THRESHOLD = 100_000
# About equally long to compile: 16 s of processor time each. The first begins with kernels that need nothing of the
# second, which has compiled the details of the first by the time they are needed.
PARTS = ("projection", "the rest")
# Kernels that a scene may need some time after its first picture, in the order in which they are compiled.
PAINTING, INDIRECT, ESTIMATE, RELIGHTING, ORBIT, DEFORM = LATER = (
    "painting", "indirect", "estimate", "relighting", "orbit", "deform",
)  # fmt: skip
LATER_PART = "later"
COMPILING = "compiling, first start only"
FIRST_TIME = "compiling for this computer, cached for later starts"
# The number of files of the compiled kernels of the first picture; each takes about equally long to make.
N_FILES = 64
_COMPILER_SECONDS = 300.0
# The length of one step of waiting for them.
_STEP_SECONDS = 0.05
_log = logging.getLogger("insitu.jobs")


class Kernels:
    """The kernels that the first picture needs. `first_time`: whether none was compiled when this began."""

    def __init__(self) -> None:
        """Start the other processes where there is something for them to do."""
        self._ready = threading.Event()
        if not are_compiled():
            take_installed()
        self.first_time = not are_compiled()
        started = [_start_compiler(part) for part in PARTS] if self.first_time else []
        self._compilers = [compiler for compiler in started if compiler is not None]
        self._later: subprocess.Popen[bytes] | None = None
        self._first = ""

    def prepare(self) -> None:
        """Begin to load all, in a thread; import the engine before."""
        threading.Thread(target=self.prepare_and_wait, name="kernels", daemon=True).start()

    @property
    def fraction(self) -> float:
        """The fraction that is compiled, by the files that are there; below 1 until all is."""
        folder = os.environ.get(NUMBA_VARIABLE)
        n_files = sum(1 for name in kernel_folders() for _ in Path(folder, name).glob("*.nbc")) if folder else 0
        return min(n_files / N_FILES, 0.99)

    def wait(self, timeout_s: float) -> bool:
        """Whether all is ready, after waiting at most this long."""
        return self._ready.wait(timeout_s)

    def is_ready(self, what: str) -> bool:
        """Whether there is nothing to wait for: one of `LATER` is compiled, or no process is compiling it."""
        return self._later is None or are_compiled(what)

    def until_ready(self, what: str, goes_first: bool = False) -> Iterator[None]:
        """Wait for one of `LATER`, a step each time, and before that for the first picture's kernels, because only then
        the process that compiles it is started. goes_first: whether it is Orbit or Deform, compiled before the
        others."""
        while not are_compiled(what) and not self.wait(_STEP_SECONDS):
            yield
        if goes_first and not self.is_ready(what):
            self._put_first(what)
        while self._later is not None and not self.is_ready(what):
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._later.wait(_STEP_SECONDS)
                self._later = None
            yield

    def _put_first(self, what: str) -> None:
        """Restart the process that compiles `LATER` with this as its first, unless it is compiling it already. It loses
        at most one kernel of what it has compiled."""
        if self._first != what and not all(map(are_compiled, LATER[: LATER.index(what)])):
            self.close()
            self._first, self._later = what, _start_compiler(LATER_PART, what)

    def close(self) -> None:
        """End the process that still compiles what is needed later; what it has compiled stays on disk."""
        if self._later is not None:
            self._later.kill()
            self._later.wait()
            self._later = None

    def prepare_and_wait(self, patience_s: float | None = _COMPILER_SECONDS) -> None:
        """Load all, and wait for it; for each of the other processes so long, None for as long as it takes."""
        try:
            for compiler in self._compilers:
                compiler.wait(patience_s)
            for part in PARTS:
                warm_up(part)
            note_compiled()
            if not all(map(are_compiled, LATER)):
                self._later = _start_compiler(LATER_PART)
        except Exception:
            _log.exception("the kernels could not be made ready")
        finally:
            self._ready.set()


def prepared_tasks() -> RequestDispatcher:
    """The worker's dispatcher, with its kernels being loaded."""
    gc.set_threshold(GC_THRESHOLD)
    kernels = Kernels()
    load_compiler()
    from app.worker.tasks import RequestDispatcher

    kernels.prepare()
    return RequestDispatcher(kernels=kernels)


def load_compiler() -> None:
    """Import numba without SciPy: it would take 0.2 s of imports to look for a BLAS that no kernel here calls."""
    hidden = "scipy" not in sys.modules
    if hidden:
        sys.modules["scipy"] = None  # type: ignore[assignment]  # importing it is an ImportError now
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        if hidden:
            del sys.modules["scipy"]


def are_compiled(what: str = "") -> bool:
    """Whether the kernels of the first picture, or one of `LATER`, were compiled before; True where none are cached."""
    mark = _marker_file(what)
    return mark is None or mark.exists()


def note_compiled(what: str = "") -> None:
    """Note that they are compiled now."""
    mark = _marker_file(what)
    if mark is not None:
        with contextlib.suppress(OSError):
            mark.touch()


def _marker_file(what: str) -> Path | None:
    """The file that marks it as compiled: by these sources, these compilers, this machine."""
    if NUMBA_VARIABLE not in os.environ:
        return None
    return Path(os.environ[NUMBA_VARIABLE]) / f"ready{what}-{kernel_digest()}-{_compiler()}"


@functools.cache
def _compiler() -> str:
    """The compiler's version, read from the installed packages, which takes milliseconds."""
    return "-".join((importlib.metadata.version("numba"), platform.python_version(), platform.node()))


def compile_all() -> None:
    """Compile all that the first picture needs, in two processes, then what is needed later, in three: Orbit and Deform
    have one each. One after the other, or the second behind the first, they would leave a processor idle, because few
    kernels are compiled at once by processes that need the same ones in the same order."""
    if are_compiled() and all(map(are_compiled, LATER)):
        return
    kernels = Kernels()
    kernels.prepare_and_wait(patience_s=None)
    of_modes = [_start_compiler(LATER_PART, mode) for mode in (ORBIT, DEFORM)]
    for what in LATER:
        for _ in kernels.until_ready(what):
            pass
    kernels.close()  # it has compiled all, but need not have ended
    for process in filter(None, of_modes):
        process.kill()
        process.wait()


def _start_compiler(part: str, first: str = "") -> subprocess.Popen[bytes] | None:
    command = [sys.executable, "-P", "-m", qualified("app.worker.kernels"), part, str(os.getpid())]
    command += [first] if first else []
    try:
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    except OSError:
        _log.exception("a compiling process could not be started")
        return None


def warm_up(part: str, first: str = "") -> None:
    """Compile or load one of `PARTS`, or all of `LATER`, of which Orbit or Deform may be the first."""
    from engine.precompute.direct import kernel_calls

    if part == LATER_PART:
        _warm_up_later(first)
    elif part == "projection":
        kernel_calls.warm_up_contraction()
        kernel_calls.warm_up_footprint()
        kernel_calls.warm_up_projection()
    else:
        kernel_calls.warm_up_edges()
        kernel_calls.warm_up_projection_details()
        kernel_calls.warm_up_light()


def _warm_up_later(first: str) -> None:
    if not all(map(are_compiled, LATER)):
        from app.worker.kernel_warm_up import warm_up_later

        for what in warm_up_later(first, are_compiled):
            note_compiled(what)
            if what == INDIRECT:
                step_behind(LAST)  # up to here the user may be waiting, for indirect light


def main() -> None:
    """Another process: compile one part for the process of a number and end; without either compile all, and store it
    with the installation, as `make setup` does."""
    yield_to_window(last=len(sys.argv) == 1)
    use_kernel_cache()
    if len(sys.argv) == 1:
        compile_all()
        keep_installed()
        return
    end_with_parent(int(sys.argv[2]))
    gc.set_threshold(GC_THRESHOLD if sys.argv[1] == LATER_PART else 0)  # the parts are too short for it
    load_compiler()
    warm_up(sys.argv[1], *sys.argv[3:])


if __name__ == "__main__":
    main()
