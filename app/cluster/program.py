"""Identifies the Insitu of a process.

This module imports nothing of the engine, and only text is sent: an older or newer Insitu on the other side has to be
recognized before it gets anything that it may not understand.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import platform
from pathlib import Path

from app.system.decoder_process import use_decoder_process
from app.system.kernel_cache import use_kernel_cache

_ROOT = Path(__file__).resolve().parents[2]
LIBRARIES = ("numpy", "scipy", "numba", "embreex")
# What a worker evaluates before its first task; an Insitu without this module answers that it has none.
QUESTION = f"__import__('{__name__}', fromlist=['program']).prepare_worker()"


def prepare_worker() -> str:
    """Make a worker find compiled kernels where they are cached, while nothing of the engine is imported yet; returns
    its program's digest. A Dask plugin was rejected: the scheduler would also send it to workers of another version,
    which end where they cannot read it."""
    use_kernel_cache()
    use_decoder_process()
    return program_digest()


@functools.cache
def program_digest() -> str:
    """A hash of all that results depend on besides their inputs: Insitu's sources, libraries, the kind of machine.
    Processors of one kind may still round differently."""
    digest = hashlib.blake2b(digest_size=10)
    for source in sorted(each for part in ("app", "engine") for each in (_ROOT / part).rglob("*.py")):
        digest.update(source.relative_to(_ROOT).as_posix().encode() + b"\0" + source.read_bytes())
    versions = [importlib.metadata.version(name) for name in LIBRARIES]
    digest.update(repr((versions, platform.python_version(), platform.system(), platform.machine())).encode())
    return digest.hexdigest()


def describe_mismatch(where: str) -> str:
    """The message about a machine with another Insitu."""
    libraries = ", ".join(LIBRARIES)
    return f"{where} has another Insitu, or other versions of {libraries}, than this computer; install the same on all"
