"""Compiled kernels that lie beside the installed packages, for whoever uses the installation on this machine.

    make setup:                      compiles into the user's cache ─► keeps a copy with the installation
    first start with an empty cache: takes that copy ─► nothing to compile, which else takes minutes

What was compiled for other sources is in folders of other names (`app.system.kernel_cache`), and numba's own index
tells other processors and versions apart: a copy that does not suit is compiled anew. The caches stay those of each
user, since an installation may not be writable, and what one user writes no other should run.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sysconfig
from pathlib import Path

from app.system.kernel_cache import NUMBA_VARIABLE, default_folder, kernel_digest, kernel_folders


def installed_folder() -> Path:
    """Where they are, or would be."""
    return Path(sysconfig.get_path("purelib"), "insitu_kernels")


def keep_installed() -> None:
    """Put what this user's cache has in place of what the installation has; nothing where that cannot be written."""
    target = installed_folder()
    made = target.with_name(f"{target.name}.{os.getpid()}.tmp")
    try:
        made.mkdir()
        _copy_missing(Path(os.environ[NUMBA_VARIABLE]), made)
        shutil.rmtree(target, ignore_errors=True)
        made.rename(target)
    except OSError:
        shutil.rmtree(made, ignore_errors=True)


def take_installed() -> None:
    """Put into this user's cache what it lacks. Another folder that `NUMBA_CACHE_DIR` names stays as it is."""
    cache = default_folder()
    if os.environ.get(NUMBA_VARIABLE) == str(cache):
        with contextlib.suppress(OSError):
            cache.mkdir(parents=True, exist_ok=True)
            _copy_missing(installed_folder(), cache)


def _copy_missing(source: Path, target: Path) -> None:
    """The folders of these sources that `target` lacks, each whole or not at all. Then the marks that they are ready,
    unless one was there: it may be of a compilation that was cut off."""
    there = [name for name in kernel_folders() if (source / name).is_dir()]
    missing = [name for name in there if not (target / name).exists()]
    for name in missing:
        made = target / f"{name}.{os.getpid()}.tmp"
        shutil.copytree(source / name, made, copy_function=shutil.copyfile)
        made.rename(target / name)
    if missing == there:
        for mark in source.glob(f"ready*-{kernel_digest()}-*"):
            (target / mark.name).touch()
