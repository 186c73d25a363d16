"""The cache of compiled kernels: for each source file a folder named after all the sources that its kernels are made
of.

Numba checks the file of a kernel to decide whether its compiled form is out of date, but not the kernels it has inlined
from other files, so after an update it may run old code. A folder for each state of a file and of what it imports
cannot be stale; an update compiles only what it has changed, and two copies of the same sources share theirs. The
folders are in the user's cache, because the installed package may be read-only. A cache that cannot be written only
costs time, see `app.system.kernel_files`.

Compiled kernels also lie beside the installed packages, for all users of the installation on this machine:

    make setup:                      compiles into the user's cache ─► stores a copy with the installation
    first start with an empty cache: takes that copy ─► nothing to compile, which otherwise takes minutes

Kernels of other sources are in folders of other names, and numba's own index distinguishes processors and versions: a
copy that does not fit is compiled anew. Each user has a cache of their own, because an installation may be read-only,
and code that one user writes no other should run.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import re
import shutil
import sysconfig
from collections.abc import Iterator
from pathlib import Path

import platformdirs

from app.system.atomic import make_private_folder
from app.system.lazy_import import qualified

NUMBA_VARIABLE = "NUMBA_CACHE_DIR"
_ROOT = Path(__file__).resolve().parents[2]
_ENGINE = _ROOT / "engine"
_IMPORT = re.compile(
    rb"^\s*(?:from\s+(?:insitu\.)?(engine[\w.]*)\s+import\s+\(?\s*(\w+)|import\s+(?:insitu\.)?(engine[\w.]*))",
    re.MULTILINE,
)


def kernel_folder(path: Path) -> str:
    """The name of the folder for the compiled kernels of a source file."""
    digest = hashlib.blake2b(digest_size=10)
    for source in sorted(with_imported(path)):
        name = source.relative_to(_ROOT).as_posix() if source.is_relative_to(_ROOT) else source.name
        digest.update(name.encode() + b"\0" + read(source))
    return f"{path.parent.name}{path.stem}-{digest.hexdigest()}"


@functools.cache
def kernel_folders() -> tuple[str, ...]:
    """The folders of all the engine's files of kernels."""
    return tuple(kernel_folder(path) for path in sorted(_ENGINE.rglob("_*kernels.py")))


def kernel_digest() -> str:
    """A hash of all kernel sources and of what they import."""
    return hashlib.blake2b("".join(kernel_folders()).encode(), digest_size=8).hexdigest()


def use_kernel_cache() -> None:
    """Set where numba caches compiled kernels; call it before the engine is imported. A variable that is set stays."""
    os.environ["NUMBA_CACHE_LOCATOR_CLASSES"] = qualified("app.system.kernel_files.KernelFiles")
    if NUMBA_VARIABLE not in os.environ:
        folder = default_folder()
        with contextlib.suppress(OSError):
            make_private_folder(folder.parent)  # what is read from it is executed
        os.environ[NUMBA_VARIABLE] = str(folder)


def default_folder() -> Path:
    """The folder of a user's compiled kernels, unless the variable names another."""
    return Path(platformdirs.user_cache_dir("insitu", appauthor=False), "kernels")


@functools.cache
def with_imported(path: Path) -> frozenset[Path]:
    """The file and the engine's modules that it imports, directly or indirectly."""
    found, waiting = {path}, [path]
    while waiting:
        new = set(_imported(waiting.pop())) - found
        found |= new
        waiting += new
    return frozenset(found)


def _imported(path: Path) -> Iterator[Path]:
    """By the import lines alone: to parse the files would take longer than to read the compiled kernels."""
    for package, name, module in _IMPORT.findall(read(path)):
        for dotted in (package + b"." + name, package or module):
            source = _ROOT.joinpath(*dotted.decode().split(".")).with_suffix(".py")
            if source.is_file():
                yield source
                break


@functools.cache
def read(path: Path) -> bytes:
    return path.read_bytes()


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
