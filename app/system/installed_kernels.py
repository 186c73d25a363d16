"""Compiled kernels beside the installed packages, for all users of the installation on this machine.

    make setup:                      compiles into the user's cache ─► stores a copy with the installation
    first start with an empty cache: takes that copy ─► nothing to compile, which otherwise takes minutes

Kernels of other sources are in folders of other names (`app.system.kernel_cache`), and numba's own index distinguishes
processors and versions: a copy that does not fit is compiled anew. Each user has a cache of their own, because an
installation may be read-only, and code that one user writes no other should run.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import sysconfig
from pathlib import Path

from app.system.kernel_cache import NUMBA_VARIABLE, default_folder, kernel_digest, kernel_folders


def installed_folder() -> Path:
    """The folder that they are in, or would be."""
    return Path(sysconfig.get_path("purelib"), "insitu_kernels")


def keep_installed() -> None:
    """Copy what this user's cache has to the installation; does nothing where that cannot be written."""
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
    """Copy what this user's cache lacks from the installation. Another folder that `NUMBA_CACHE_DIR` names does not
    change."""
    cache = default_folder()
    if os.environ.get(NUMBA_VARIABLE) == str(cache):
        with contextlib.suppress(OSError):
            cache.mkdir(parents=True, exist_ok=True)
            _copy_missing(installed_folder(), cache)


def _copy_missing(source: Path, target: Path) -> None:
    """Copy the folders of these sources that `target` lacks, each whole or not at all. Then the marks that they are
    ready, unless one was there: it may be of a compilation that was interrupted."""
    there = [name for name in kernel_folders() if (source / name).is_dir()]
    missing = [name for name in there if not (target / name).exists()]
    for name in missing:
        made = target / f"{name}.{os.getpid()}.tmp"
        shutil.copytree(source / name, made, copy_function=shutil.copyfile)
        made.rename(target / name)
    if missing == there:
        for mark in source.glob(f"ready*-{kernel_digest()}-*"):
            (target / mark.name).touch()
