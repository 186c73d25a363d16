"""Which Insitu a process is of.

Nothing of the engine is imported here, and nothing but text goes over the wire: an older or newer one on the other side
is to be told from ours before it is given anything that it may not understand.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import platform
from pathlib import Path

from app.system.kernel_cache import use_kernel_cache

_ROOT = Path(__file__).resolve().parents[2]
LIBRARIES = ("numpy", "scipy", "numba", "embreex")
# What a worker evaluates before its first task; an Insitu that does not have this yet says that it has no such module.
QUESTION = f"__import__('{__name__}', fromlist=['program']).prepare_worker()"


def prepare_worker() -> str:
    """Have a worker find compiled kernels where they are kept, while nothing of the engine is imported yet; its
    program's digest. No plugin of ours does it: the scheduler would hand that to workers of another version, too, which
    end where they cannot read it."""
    use_kernel_cache()
    return program_digest()


@functools.cache
def program_digest() -> str:
    """A hash of all that numbers depend on beside what they are computed of: Insitu's sources, libraries, the kind of
    machine. Processors of one kind may still round differently."""
    digest = hashlib.blake2b(digest_size=10)
    for source in sorted(each for part in ("app", "engine") for each in (_ROOT / part).rglob("*.py")):
        digest.update(source.relative_to(_ROOT).as_posix().encode() + b"\0" + source.read_bytes())
    versions = [importlib.metadata.version(name) for name in LIBRARIES]
    digest.update(repr((versions, platform.python_version(), platform.system(), platform.machine())).encode())
    return digest.hexdigest()


def describe_mismatch(where: str) -> str:
    """What a person is told of a machine with another one."""
    libraries = ", ".join(LIBRARIES)
    return f"{where} has another Insitu, or other versions of {libraries}, than this computer; install the same on all"
