"""Notices that another program has written files that the open scene was read from.

Files are compared by size, time of change and identity, once a second and on a thread of its own: on a network drive
that can take longer than a frame. A file counts as changed once two looks have found the same new state, so that one
that is still being written is not read; one that is missing does not, because there is nothing to read.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable, Mapping

LOOK_SECONDS = 1.0
FileStamp = tuple[int, int, int] | None


def file_stamp(path: str | os.PathLike[str]) -> FileStamp:
    """What changes when a file is written: (nanoseconds of its change, bytes, number); None where there is no file."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


class FileWatch:
    """Watches files. `changed`: those that were written since they were read, sorted."""

    def __init__(self) -> None:
        self.changed: tuple[str, ...] = ()
        self._lock = threading.Lock()
        self._known: dict[str, FileStamp] = {}
        self._seen: dict[str, FileStamp] = {}
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Look once a second from now on."""
        self._thread = threading.Thread(target=self._look_on, name="file watch", daemon=True)
        self._thread.start()

    def watch(self, files: Mapping[str, FileStamp]) -> None:
        """Watch these files and no others; each with its stamp when it was read."""
        with self._lock:
            self._known, self._seen, self.changed = dict(files), {}, ()

    def add(self, files: Iterable[str | os.PathLike[str]]) -> None:
        """Watch further files, as the next look finds them."""
        with self._lock:
            for path in files:
                self._known.setdefault(os.fspath(path), None)

    def forget(self, path: str | os.PathLike[str]) -> None:
        """Take a file that this program has written as the next look finds it; a look that is under way counts for
        nothing, as it may have seen the file before."""
        with self._lock:
            name = os.fspath(path)
            self._known = {**self._known, name: None}
            self.changed = tuple(each for each in self.changed if each != name)

    def look(self) -> None:
        """Compare all files with what was read."""
        with self._lock:
            known = self._known
            names = list(known)
        now = {name: file_stamp(name) for name in names}
        with self._lock:
            if known is not self._known:
                return
            changed = []
            for name, stamp in now.items():
                if self._known[name] is None:
                    self._known[name] = stamp
                elif stamp is not None and stamp != self._known[name] and stamp == self._seen.get(name):
                    changed.append(name)
            self._seen, self.changed = now, tuple(sorted(changed))

    def close(self) -> None:
        """End the thread, unless a drive keeps it waiting."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(LOOK_SECONDS)

    def _look_on(self) -> None:
        while not self._ended.wait(LOOK_SECONDS):
            self.look()
