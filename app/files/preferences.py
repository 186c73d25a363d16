"""The user's preferences: how mouse and trackpad move the camera. They belong to the user, not to a session.

Stored in a small TOML file of the state folder. It is a convenience: one that is missing or damaged costs a choice in a
menu, and one that cannot be written is reported once.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from app.system.atomic import save_file
from engine.core.errors import InsituError
from engine.scene.toml_text import load_toml, toml_lines

Mouse = Literal["blender", "maya"]
Scroll = Literal["dolly", "orbit"]
MAX_BYTES = 64 * 1024


@dataclass(frozen=True)
class Preferences:
    """mouse: the program whose mouse buttons move the camera; scroll: what the wheel, or two fingers on a trackpad,
    do."""

    mouse: Mouse = "blender"
    scroll: Scroll = "dolly"


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore")

    mouse: Mouse = "blender"
    scroll: Scroll = "dolly"


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
    return Preferences(record.mouse, record.scroll)
