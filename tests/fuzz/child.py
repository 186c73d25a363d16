"""Reads damaged files in a process of its own, which may die of them: `python -m tests.fuzz.child FOLDER SEED`.

Jobs come as lines on standard input, `FORMAT FIRST LAST`. On standard output there is a line of JSON for each file that
does not end as it should, and one for each job. Which file it is at stands in FOLDER/at, for who survives the process.
"""

from __future__ import annotations

import gc
import json
import mmap
import resource
import signal
import struct
import sys
import time
import traceback
from pathlib import Path

import numpy as np

from app.system.decoder_process import use_decoder_process
from app.system.kernel_cache import use_kernel_cache
from engine.core.errors import LONGEST_LINE, InsituError
from tests.fuzz.formats import FORMATS, Format
from tests.fuzz.mutations import damaged

BASE_SECONDS, SECONDS_A_MEGABYTE = 2.0, 2.0  # of processor time
COMPILING_SECONDS = 600.0
MEMORY = 2 << 30  # beyond what the process has before
WARM = 100  # files, after which memory may grow no more than by
GROWTH = 64 << 20
AT = struct.Struct("<qd")  # number of the file, processor seconds when it was begun
PAGE = resource.getpagesize()


class TooLong(BaseException):
    """Not an Exception, which a reader might take for a complaint of a library."""


class Source:
    """Damaged files of a format, by number."""

    def __init__(self, name: str, seed: int, folder: Path) -> None:
        self.format: Format = FORMATS[name]
        folder.mkdir(parents=True, exist_ok=True)
        self.seeds = list(self.format.seeds(folder))
        self._seed = [seed, *name.encode()]

    def file(self, number: int) -> bytes:
        random = np.random.default_rng([*self._seed, number])
        which = int(random.integers(len(self.seeds)))
        data = damaged(self.seeds[which], self.seeds, random, self.format.is_text)
        return self.format.repaired(data) if self.format.repaired and random.random() < 0.75 else data


def outcome(form: Format, path: Path, data: bytes, seconds: float) -> str:
    """How reading the file ends: "read", "refused", or what should not be."""
    path.write_bytes(data)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        form.read(path)
    except InsituError as error:
        line = str(error)
        is_plain = line.isprintable() and len(line) <= LONGEST_LINE
        return "refused" if is_plain else f"not one plain line: {line!r}"
    except TooLong:
        return f"more than {seconds:.1f} s of processor time: {_where()}"
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        return f"{type(error).__name__}: {error}"[:300] + _where()
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return "read"


def _where() -> str:
    frames = traceback.extract_tb(sys.exc_info()[2])[-3:]
    return "".join(f" | {Path(frame.filename).name}:{frame.lineno} {frame.name}" for frame in frames)


def resident() -> int:
    """Bytes."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def work(name: str, first: int, last: int, seed: int, folder: Path, at: mmap.mmap) -> None:
    source = Source(name, seed, folder / "seeds" / name)
    scratch = folder / "read" / name
    scratch.mkdir(parents=True, exist_ok=True)
    path, counts, before = scratch / source.format.name, {"read": 0, "refused": 0}, 0
    for data in source.seeds:  # kernels are read or compiled meanwhile, and libraries imported
        if (said := outcome(source.format, path, data, COMPILING_SECONDS)) != "read":
            tell({"format": name, "file": -1, "said": f"a seed is {said}"})
    limit_memory()
    at[:] = AT.pack(first, time.process_time())
    for number in range(first, last):
        at[:] = AT.pack(number, time.process_time())
        data = source.file(number)
        said = outcome(source.format, path, data, BASE_SECONDS + SECONDS_A_MEGABYTE * len(data) / 2**20)
        if said in counts:
            counts[said] += 1
        else:
            tell({"format": name, "file": number, "said": said})
        if number == first + WARM:
            before = resident()
    grown = resident() - before if before else 0
    if grown > GROWTH:
        tell({"format": name, "file": -1, "said": f"memory has grown by {grown >> 20} MiB since file {WARM}"})
    tell({"format": name, "done": last, **counts})


def limit_memory() -> None:
    """From what the process has by now on."""
    size = int(Path("/proc/self/statm").read_text().split()[0]) * PAGE
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, resource.RLIM_INFINITY))


def tell(what: dict[str, object]) -> None:
    print(json.dumps(what), flush=True)


def main() -> None:
    folder, seed = Path(sys.argv[1]), int(sys.argv[2])

    def ring(*_: object) -> None:
        raise TooLong

    signal.signal(signal.SIGPROF, ring)
    with open(folder / "at", "r+b") as file:
        at = mmap.mmap(file.fileno(), AT.size)
    at[:] = AT.pack(-1, 0.0)
    use_kernel_cache()
    use_decoder_process()
    for line in sys.stdin:
        name, first, last = line.split()
        resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        work(name, int(first), int(last), seed, folder, at)


if __name__ == "__main__":
    main()
