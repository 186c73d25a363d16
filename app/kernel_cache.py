"""Where compiled kernels are kept: a folder named after their sources.

Numba looks at the file of a kernel to see whether its compiled form is out of date, but not at the kernels it has
inlined from other files, so after an update it may run old code. A folder for each state of all kernel sources cannot
be stale; and it lies in the user's cache, for the installed package may not be writable. A folder that cannot be
written costs time alone, see `app.kernel_files`.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from pathlib import Path

import platformdirs

from app.atomic import make_private_folder

NUMBA_VARIABLE = "NUMBA_CACHE_DIR"
_ENGINE = Path(__file__).resolve().parents[1] / "engine"


def kernel_digest() -> str:
    """A hash of all kernel sources and of what they take constants from."""
    digest = hashlib.blake2b(digest_size=8)
    constants = [_ENGINE / "material" / "kinds.py", _ENGINE / "curve" / "wavelet.py"]
    for path in sorted([*_ENGINE.rglob("_*kernels.py"), *constants]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def use_kernel_cache() -> None:
    """Tell numba where to keep compiled kernels; call it before the engine is imported. A set variable is kept."""
    os.environ["NUMBA_CACHE_LOCATOR_CLASSES"] = "app.kernel_files.KernelFiles"
    if NUMBA_VARIABLE not in os.environ:
        base = Path(platformdirs.user_cache_dir("insitu", appauthor=False))
        with contextlib.suppress(OSError):
            make_private_folder(base)  # what is read from it is run
        os.environ[NUMBA_VARIABLE] = str(base / "kernels" / kernel_digest())
