"""What a plan costs when it is carried out: `insitu plan --check`.

Carrying it out is what `insitu precompute` does, in a process of its own and into an empty cache, until all is there
that the editor would look for; what the error's estimate takes afterwards is no part of the plan. Time is that of the
processors, by which a machine that others use as well can be measured.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from app.project.project import ProjectSpec
from app.system.lazy_import import qualified
from app.worker.cache import CACHE_VARIABLE, ArrayCache
from engine.core.errors import InsituError

MIB = 2.0**20


@dataclass(frozen=True)
class ActualCost:
    """Seconds of the processors, the peak of main memory and what is stored on disk, MiB."""

    seconds: float
    memory_mib: float
    disk_mib: float


def carry_out(words: ProjectSpec) -> ActualCost:
    """Fill an empty cache with what `words` open, in a process of its own. Raises InsituError."""
    import psutil

    with tempfile.TemporaryDirectory(prefix="insitu-measure-") as folder:
        environment = os.environ | {CACHE_VARIABLE: folder}
        command = [sys.executable, "-m", qualified("app.cli.plan_check"), json.dumps(asdict(words))]
        with psutil.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
        ) as process:
            peak = 0
            while process.poll() is None:
                with contextlib.suppress(psutil.Error):
                    peak = max(peak, process.memory_info().rss)
                time.sleep(0.02)
            said, complaint = process.communicate()
        if process.returncode:
            raise InsituError(complaint.strip().splitlines()[-1] if complaint.strip() else f"{words.name}: no result")
        seconds = json.loads(said.splitlines()[-1])["seconds"]
        kept = sum(file.stat().st_size for file in Path(folder).rglob("*") if file.is_file())
    return ActualCost(seconds, peak / MIB, kept / MIB)


def main(said: str) -> None:
    """Carry out and say, as one line of JSON, how long it took the processors; in a process of its own."""
    from app.cli.precompute import fill

    words = json.loads(said)
    words |= {name: tuple(map(tuple, words[name])) for name in ("values", "settings", "overrides")}
    words["resolution"] = words["resolution"] and tuple(words["resolution"])
    project = ProjectSpec(**words).open()
    started = time.process_time()
    fill(project, lambda progress: None, ArrayCache())
    print(json.dumps({"seconds": time.process_time() - started}))


if __name__ == "__main__":
    try:
        main(sys.argv[1])
    except InsituError as error:
        sys.exit(str(error))
