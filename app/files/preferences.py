"""What belongs to the user and not to a session: how mouse and trackpad move the camera, which keys arrange objects,
and the files opened last.

Each is stored in a small file of the state folder: preferences as TOML; the scenes and sessions that were opened or
saved last, for the menu, as one absolute path a line, the newest first. They are conveniences: a file that is missing
or damaged costs a choice in a menu, and preferences that cannot be written are reported once.
"""

from __future__ import annotations

import os
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from app.document.scene_files import split_axis
from app.system.atomic import replacing, save_file
from engine.core.errors import InsituError
from engine.scene.toml_text import load_toml, toml_lines

Mouse = Literal["blender", "maya"]
Scroll = Literal["dolly", "orbit"]
Keys = Literal["blender", "maya", "insitu"]
MAX_BYTES = 64 * 1024


@dataclass(frozen=True)
class Preferences:
    """mouse: the program whose mouse buttons move the camera; scroll: what the wheel, or two fingers on a trackpad, do;
    keys: the program whose keys arrange objects."""

    mouse: Mouse = "blender"
    scroll: Scroll = "dolly"
    keys: Keys = "blender"


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")

    mouse: Mouse = "blender"
    scroll: Scroll = "dolly"
    keys: Keys = "blender"


class PreferenceFile:
    """The preferences of one window; file None stores them only in memory."""

    def __init__(self, file: Path | None = None) -> None:
        self._file = file
        self.current = Preferences() if file is None else _read(file)

    def choose(self, **changes: str) -> None:
        """Change some of them, for the next start also. Raises InsituError where they cannot be written."""
        self.current = replace(self.current, **changes)  # type: ignore[arg-type]
        if self._file is not None:
            save_file(self._file, ("\n".join(toml_lines(asdict(self.current))) + "\n").encode())


def _read(file: Path) -> Preferences:
    try:
        record = _Record.model_validate(load_toml(file, MAX_BYTES))
    except (InsituError, ValidationError):
        return Preferences()
    return Preferences(**record.model_dump())


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
            self._checked = tuple(Recent(path, os.path.isfile(split_axis(str(path))[0])) for path in self._paths)
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
