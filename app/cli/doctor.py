"""`insitu doctor`: checks this machine, and says how to fix what does not work.

Each check finds something or fails with a line; none stops the others. Rays are tested in a separate process, because a
library built for another processor ends its process without a message.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from app.cli.console import Frontend
from app.system.lazy_import import IMPORT_FOLDER, qualified
from app.system.memory import gib, memory_bytes
from app.system.paths import state_directory
from app.system.system import HAS_ANONYMOUS_FILES, anonymous_file, reserve
from app.worker.cache import cache_folder
from engine.core.errors import InsituError
from engine.core.threads import n_cores

State = Literal["ok", "without", "broken"]

NEEDED_MEMORY = 2 << 30
NEEDED_DISK = 1 << 30
NEEDED_SHARED = 256 << 20
RAY_SECONDS = 60.0
_RAY_PROGRAM = f"from {qualified('app.cli.doctor')} import trace_test_ray; trace_test_ray()"


@dataclass(frozen=True)
class Finding:
    """One check: what was found, and how to fix it where it is not right.

    state: "ok"; "without": something does not work that the rest can do without; "broken".
    """

    name: str
    state: State
    found: str
    mend: str = ""


def examine(frontend: Frontend) -> Iterator[Finding]:
    """All checks, one after the other."""
    yield _graphics(frontend)
    yield _display(frontend)
    yield _rays()
    yield _memory()
    yield _folder("cache", cache_folder, "INSITU_CACHE")
    yield _folder("state", state_directory, "INSITU_STATE")
    yield _shared_memory()


def trace_test_ray() -> None:
    """One ray against one triangle, a hit and a miss; AssertionError when the answers are wrong."""
    import numpy as np

    from engine.scene.raycaster import RayCaster

    corners = np.array([[-1.0, 0.0, -1.0], [1.0, 0.0, -1.0], [0.0, 0.0, 1.0]], np.float32)
    caster = RayCaster(corners, np.array([[0, 1, 2]], np.int32))
    origins = np.array([[0.0, 1.0, 0.0], [5.0, 1.0, 0.0]], np.float32)
    down = np.array([[0.0, -1.0, 0.0], [0.0, -1.0, 0.0]], np.float32)
    found = caster.intersect(origins, down)
    assert list(found.triangle) == [0, -1] and abs(float(found.distance[0]) - 1.0) < 1e-5


def _graphics(frontend: Frontend) -> Finding:
    try:
        return Finding("OpenGL", "ok", frontend.describe_graphics())
    except (InsituError, ImportError) as error:
        mend = "apt-get install libegl1 libgl1 libgl1-mesa-dri, or a graphics driver; `insitu render` works without"
        return Finding("OpenGL", "broken", str(error), mend)


def _display(frontend: Frontend) -> Finding:
    try:
        return Finding("display", "ok", frontend.describe_display())
    except (InsituError, ImportError) as error:
        mend = "start from a desktop session, or use `insitu screenshot` and `insitu render`, which need none"
        return Finding("display", "without", str(error), mend)


def _rays() -> Finding:
    mend = "reinstall embreex for this processor: pip install --force-reinstall embreex"
    try:
        done = subprocess.run(
            [sys.executable, "-c", _RAY_PROGRAM], cwd=IMPORT_FOLDER, capture_output=True, text=True, timeout=RAY_SECONDS
        )
    except subprocess.TimeoutExpired:
        return Finding("Embree", "broken", f"no answer to one ray in {RAY_SECONDS:.0f} s", mend)
    if done.returncode == 0:
        return Finding("Embree", "ok", "a ray hits what it should")
    if done.returncode < 0:
        return Finding("Embree", "broken", f"the test ray ended with signal {-done.returncode}", mend)
    said = done.stderr.strip().splitlines()
    return Finding("Embree", "broken", said[-1] if said else f"exit status {done.returncode}", mend)


def _memory() -> Finding:
    free, total = memory_bytes()
    found = f"{gib(free)} free of {gib(total)}, {n_cores()} processors"
    if free < NEEDED_MEMORY:
        mend = f"close something, or give a smaller --resolution; {gib(NEEDED_MEMORY)} serve"
        return Finding("memory", "without", found, mend)
    return Finding("memory", "ok", found)


def _folder(name: str, find: Callable[[], Path], variable: str) -> Finding:
    """Whether one of Insitu's folders can be written and has room."""
    mend = f"free some room or set {variable} to a folder that can be written"
    try:
        folder = find()
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"insitu")
            file.flush()
        free = shutil.disk_usage(folder).free
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return Finding(name, "broken", f"{where}{error.strerror or error}", mend)
    found = f"{folder}, {gib(free)} free"
    return Finding(name, "ok", found) if free >= NEEDED_DISK else Finding(name, "without", found, mend)


def _shared_memory() -> Finding:
    """Memory that the window and the worker share: anonymous files on Linux, named blocks elsewhere."""
    if not HAS_ANONYMOUS_FILES:
        return Finding("shared memory", "ok", "named blocks")
    mend = "give the container more: docker run --shm-size=1g, or mount -o remount,size=1g /dev/shm"
    try:
        descriptor = anonymous_file()
        try:
            reserve(descriptor, NEEDED_SHARED)
        finally:
            os.close(descriptor)
    except OSError as error:
        return Finding("shared memory", "broken", f"{gib(NEEDED_SHARED)}: {error.strerror or error}", mend)
    return Finding("shared memory", "ok", f"anonymous files, {gib(NEEDED_SHARED)} at a time")
