"""Numba's hook for the files of compiled kernels: a folder that fails costs time, never the work.

By default numba ends the program where a kernel cannot be stored (a full disk) or a file of an earlier one is damaged
(a power cut), and where no folder can be written it declines to compile. An environment variable names this module, so
that it is read with the first kernel, in every process, and never before.
"""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Callable, Iterator
from pathlib import Path

from numba.core import caching, compiler

from app.system.kernel_cache import NUMBA_VARIABLE, kernel_folder

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

# Kernels are called from Python and by one another. Numba would also make a wrapper of each for calls from C, which
# only `cfunc` uses, and requests itself.
compiler.Flags.options["no_cfunc_wrapper"]._default = True
