"""The scenes and sessions that were opened or saved last, for the menu; stored in a file of the state folder.

One absolute path a line, the newest first. It is a convenience: a file that is missing, damaged or cannot be written
costs only the memory.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path

from app.system.atomic import replacing

MOST = 10
MOST_BYTES = 64 * 1024
# The existence of files is checked again after this long: a folder on the network may be slow to answer.
FRESH_SECONDS = 2.0


@dataclass(frozen=True)
class Recent:
    """A file of the list; `exists`: whether it still exists."""

    path: Path
    exists: bool


class RecentFiles:
    """The list of one window; several may share a `file`. None stores it only in memory."""

    def __init__(self, file: Path | None = None) -> None:
        self._file = file
        self._paths = self._read()
        self._checked: tuple[Recent, ...] = ()
        self._checked_at = float("-inf")

    def entries(self) -> tuple[Recent, ...]:
        """The newest first."""
        now = time.monotonic()
        if now - self._checked_at > FRESH_SECONDS:
            self._checked = tuple(Recent(path, os.path.isfile(path)) for path in self._paths)
            self._checked_at = now
        return self._checked

    def add(self, path: Path) -> None:
        """Put a file first, with what other windows have added meanwhile after it.

        It does not wait for the disk, because this runs between two frames.
        """
        known = [*self._read(), *self._paths] if self._file is not None else self._paths
        self._paths = list(dict.fromkeys([path, *known]))[:MOST]
        self._checked_at = float("-inf")
        if self._file is None or any("\n" in str(each) for each in self._paths):
            return
        try:
            with replacing(self._file, durable=False) as file:
                file.write("".join(f"{each}\n" for each in self._paths).encode(errors="surrogateescape"))
        except OSError:
            return

    def _read(self) -> list[Path]:
        if self._file is None:
            return []
        try:
            with open(self._file, "rb") as file:
                lines = file.read(MOST_BYTES).decode(errors="surrogateescape").splitlines()
        except OSError:
            return []
        return [Path(line) for line in lines if Path(line).is_absolute() and "\0" not in line][:MOST]
