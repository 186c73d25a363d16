"""Numba's hooks for the files of compiled kernels: a folder that fails costs time, never the work, and processes that
share a folder compile each kernel once.

By default numba ends the program where a kernel cannot be stored (a full disk) or a file of an earlier one is damaged
(a power cut), and where no folder can be written it declines to compile. Two processes that store at the same time may
give two kernels the same file. An environment variable names this module, so that it is read with the first kernel, in
every process, and never before.
"""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from numba.core import caching, compiler
from numba.core.compiler_lock import global_compiler_lock
from numba.core.dispatcher import Dispatcher

from app.system.kernel_cache import NUMBA_VARIABLE, kernel_folder

# A kernel takes a few seconds, on a busy machine as many times longer as there are others.
_PATIENCE_SECONDS = 60.0
_log = logging.getLogger("insitu.kernels")


class KernelFiles(caching.UserProvidedCacheLocator):  # type: ignore[misc]
    """The folder in NUMBA_CACHE_DIR that is named after the sources, whether or not it can be written."""

    def __init__(self, function: Callable[..., object], source: str) -> None:
        super().__init__(function, source)
        self._folder = kernel_folder(Path(source).resolve())
        self._cache_path = str(Path(os.environ[NUMBA_VARIABLE], self._folder))

    @classmethod
    def from_function(cls, function: Callable[..., object], source: str) -> KernelFiles:
        return cls(function, source)

    def get_source_stamp(self) -> str:
        """A constant: the folder belongs to these very sources, so a file's own age does not matter."""
        return self._folder


@contextlib.contextmanager
def _whatever_happens(cache: caching.Cache) -> Iterator[None]:
    """Wraps reading and writing a kernel's files: where that fails it is compiled, and its files are written anew."""
    try:
        yield
    except Exception as error:
        _log.info("%r: %s: %s", cache, type(error).__name__, error)
        with contextlib.suppress(OSError):
            cache.flush()


# Numba's own hook for this, which it leaves empty except on Windows.
caching.Cache._guard_against_spurious_io_errors = _whatever_happens  # type: ignore[method-assign, assignment]

_load_files, _compile = caching.Cache.load_overload, Dispatcher.compile
# The lock of each kernel that is being compiled, those that it calls last. Under numba's own lock: one thread compiles.
_held: list[contextlib.ExitStack] = []


def _load_or_lock(cache: caching.Cache, *of: object) -> object:
    """The compiled kernel from its files. Where it is not in them, lock them until it is: another process that compiles
    it is waited for, and what that has stored is read."""
    found = _load_files(cache, *of)
    if found is None and _held and _lock(cache):  # a callback for C is compiled by no dispatcher, and stored unlocked
        found = _load_files(cache, *of)
    return found


def _lock(cache: caching.Cache) -> bool:
    """Lock a kernel's files for as long as it is being compiled; False where that cannot be, which costs time."""
    from filelock import FileLock, Timeout  # late: a process that compiles nothing does not need it

    try:
        folder = Path(cache.cache_path)
        folder.mkdir(parents=True, exist_ok=True)
        lock = FileLock(folder / f"{cache._impl.filename_base}.lock", timeout=_PATIENCE_SECONDS, is_singleton=True)
        _held[-1].enter_context(lock)
    except (OSError, Timeout) as error:
        _log.info("%r: %s: %s", cache, type(error).__name__, error)
        return False
    return True


def _compile_once(kernel: Dispatcher, types: Any) -> object:
    """Compile a kernel for these types, or load what it was compiled to."""
    with global_compiler_lock, contextlib.ExitStack() as held:
        _held.append(held)
        try:
            return _compile(kernel, types)
        finally:
            _held.pop()


# A kernel's lock is taken before those of the kernels it calls, in every process: none waits for one that waits for it.
caching.Cache.load_overload = _load_or_lock  # type: ignore[method-assign, assignment]
Dispatcher.compile = _compile_once  # type: ignore[method-assign, assignment]

# Kernels are called from Python and by one another. Numba would also make a wrapper of each for calls from C, which
# only `cfunc` uses, and requests itself.
compiler.Flags.options["no_cfunc_wrapper"]._default = True
