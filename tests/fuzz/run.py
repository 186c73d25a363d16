"""Read damaged files of every kind: `make fuzz`, or `python -m tests.fuzz.run [FORMAT ...] --count 100000`.

Each file is to be read, or refused in one plain line, in two seconds of processor time a megabyte: no other exception,
no end of the process, no hang, no memory that grows. A file that ends otherwise is kept in out/fuzz under its format
and number; with the same seed that number is the same file again.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from tests.fuzz.child import AT, BASE_SECONDS, SECONDS_A_MEGABYTE, Source
from tests.fuzz.formats import FORMATS
from tests.fuzz.text_files import ROOT

BLOCK = 10_000  # files a process reads
COMMAND = (sys.executable, "-m", "tests.fuzz.child")
STUCK_SECONDS = 20.0  # of processor time in a library, where no alarm is heard


@dataclass
class Result:
    """Of one format: how many files were read, refused, and ended otherwise, by number; -1: what is no file's fault."""

    n_read: int = 0
    n_refused: int = 0
    failures: dict[int, str] = field(default_factory=dict)

    @property
    def n_files(self) -> int:
        return self.n_read + self.n_refused + len(self.failures.keys() - {-1})


class Readers:
    """Processes that read damaged files, one after another: when one ends early, what it was at has failed."""

    def __init__(self, folder: Path, seed: int, command: Sequence[str] = COMMAND) -> None:
        self._folder, self._command = folder, (*command, str(folder), str(seed))
        self._process: subprocess.Popen[str] | None = None
        (folder / "at").write_bytes(AT.pack(-1, 0.0))

    def read(self, name: str, first: int, last: int) -> Result:
        """Files first to last of a format."""
        result = Result()
        while first < last:
            process = self._process = self._process or self._started()
            for message in self._told(process, f"{name} {first} {last}\n"):
                if "done" in message:
                    result.n_read += int(str(message["read"]))
                    result.n_refused += int(str(message["refused"]))
                    first = last
                    break
                result.failures[int(str(message["file"]))] = str(message["said"])
            else:
                number, _ = AT.unpack((self._folder / "at").read_bytes())
                if number < first:
                    raise RuntimeError(f"{name}: before the first file {self._last_words(process)}")
                # Those before it were read, or refused: it did not live to say.
                result.n_read += number - first - sum(first <= known < number for known in result.failures)
                result.failures[number] = self._last_words(process)
                first, self._process = number + 1, None
        return result

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()

    def _started(self) -> subprocess.Popen[str]:
        own = {name: str(self._folder) for name in ("INSITU_STATE", "INSITU_CACHE")}
        with open(self._folder / "words", "w") as words:  # a pipe that nobody empties would stop it
            process = subprocess.Popen(
                self._command, cwd=ROOT, env=os.environ | own, text=True,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=words,
            )  # fmt: skip
        threading.Thread(target=self._end_if_stuck, args=(process,), daemon=True).start()
        return process

    def _told(self, process: subprocess.Popen[str], job: str) -> Iterator[dict[str, object]]:
        assert process.stdin is not None and process.stdout is not None
        process.stdin.write(job)
        process.stdin.flush()
        yield from map(json.loads, process.stdout)

    def _end_if_stuck(self, process: subprocess.Popen[str]) -> None:
        """Where a library hangs no alarm is heard."""
        with contextlib.suppress(psutil.Error, OSError):
            watched = psutil.Process(process.pid)
            while process.poll() is None:
                time.sleep(0.5)
                number, begun = AT.unpack((self._folder / "at").read_bytes())
                used = watched.cpu_times()
                if number >= 0 and used.user + used.system - begun > STUCK_SECONDS:
                    process.kill()

    def _last_words(self, process: subprocess.Popen[str]) -> str:
        status = process.wait()
        words = (self._folder / "words").read_text(errors="replace").strip().splitlines()[-1:]
        process.communicate()
        why = signal.Signals(-status).name if status < 0 else f"status {status}"
        return f"the process ended: {why} {' '.join(words)}"


def keep(name: str, numbers: dict[int, str], seed: int, output: Path, scratch: Path) -> None:
    """Write the files that ended otherwise, and what was said of each."""
    source = Source(name, seed, scratch)
    output.mkdir(parents=True, exist_ok=True)
    for number, said in numbers.items():
        kept = output / f"{name}-{seed}-{number}-{source.format.name}"
        kept.write_bytes(source.file(number) if number >= 0 else b"")
        kept.with_name(kept.name + ".said").write_text(said + "\n", encoding="utf-8")


def fuzz(name: str, count: int, seed: int, jobs: int, output: Path) -> Result:
    """So many files of a format, in `jobs` processes at a time."""
    n_files, total = max(1, round(count * FORMATS[name].share)), Result()
    blocks = [(first, min(first + BLOCK, n_files)) for first in range(0, n_files, BLOCK)]
    started = time.monotonic()
    with tempfile.TemporaryDirectory(dir=_memory_folder()) as base, ThreadPoolExecutor(jobs) as pool:

        def block(ends: tuple[int, int]) -> Result:
            folder = Path(base) / str(ends[0])
            folder.mkdir()
            readers = Readers(folder, seed)
            try:
                return readers.read(name, *ends)
            finally:
                readers.close()
                shutil.rmtree(folder)

        for result in pool.map(block, blocks):
            total.n_read += result.n_read
            total.n_refused += result.n_refused
            total.failures |= result.failures
            rate = total.n_files / (time.monotonic() - started)
            print(f"{name:12} {total.n_files:8,} of {n_files:,}, {total.n_read:,} read, {len(total.failures)} failed, "
                  f"{rate:.0f}/s", flush=True)  # fmt: skip
        if total.failures:
            keep(name, total.failures, seed, output, Path(base) / "kept")
    return total


def _memory_folder() -> str | None:
    """Where files cost no disk."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("formats", nargs="*", metavar="FORMAT", help=", ".join(FORMATS))
    parser.add_argument("--count", type=int, default=100_000, help="damaged files of each format")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--output", type=Path, default=ROOT / "out" / "fuzz")
    given = parser.parse_args()
    if unknown := sorted(set(given.formats) - set(FORMATS)):
        parser.error(f"unknown format {unknown[0]}, expected some of {', '.join(FORMATS)}")
    found = {name: fuzz(name, given.count, given.seed, given.jobs, given.output) for name in given.formats or FORMATS}
    for name, result in found.items():
        for number, said in list(result.failures.items())[:10]:
            print(f"{name} {number}: {said}")
    n_failed = sum(len(result.failures) for result in found.values())
    kept = f"; {n_failed} ended otherwise, kept in {given.output}" if n_failed else ", all read or refused"
    n_files = sum(result.n_files for result in found.values())
    print(f"{n_files:,} files{kept} ({BASE_SECONDS:.0f} s and {SECONDS_A_MEGABYTE:.0f} s a megabyte each at most)")
    return 1 if n_failed else 0


if __name__ == "__main__":
    sys.exit(main())
