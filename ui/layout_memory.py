"""The window's stored layout of its panels: their places in each of its forms, and which are folded away.

The file is imgui's own text for each form, under lines that name the version and scale it was made for; at another
scale, where its pixels would be wrong, the defaults are built again. It is only a convenience: whatever is wrong with
it, the window opens with the default layout.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import cast, get_args

from app.system.atomic import replacing
from ui.layout import Form

VERSION = 5
_FORM = re.compile(r"^; form (\w+) folded ?(.*)\n", re.MULTILINE)


@dataclass
class LayoutMemory:
    """`places` are imgui's texts by form, `folded` keys of the panels that are closed. `file` None: nothing is
    stored."""

    file: Path | None
    scale: float
    places: dict[Form, str] = field(default_factory=dict)
    folded: dict[Form, frozenset[str]] = field(default_factory=dict)

    @classmethod
    def read(cls, file: Path | None, scale: float) -> LayoutMemory:
        """The content of the file, empty where it is missing, damaged, or of another version or scale."""
        memory = cls(file, scale)
        try:
            text = "" if file is None else file.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            return memory
        first, _, body = text.partition("\n")
        if first != memory._first_line:
            return memory
        _, *parts = _FORM.split(body)
        for name, folded, places in zip(parts[::3], parts[1::3], parts[2::3], strict=True):
            if name in get_args(Form):
                memory.places[cast(Form, name)] = places
                memory.folded[cast(Form, name)] = frozenset(folded.split())
        return memory

    def keep(self, form: Form, places: str, folded: frozenset[str]) -> None:
        """Note the window's layout and write it; a folder that cannot be written to costs only the memory.

        It does not wait for the disk: this runs between two frames, and a lost layout is built again.
        """
        self.places[form], self.folded[form] = places, folded
        if self.file is None:
            return
        parts = (f"; form {name} folded {' '.join(sorted(self.folded[name]))}\n{text}"
                 for name, text in self.places.items())  # fmt: skip
        try:
            with replacing(self.file, durable=False, private=True) as file:
                file.write(f"{self._first_line}\n{''.join(parts)}".encode())
        except OSError:
            return

    def rescale(self, scale: float) -> None:
        """Forget places whose pixels are another screen's."""
        self.scale, self.places = scale, {}

    @property
    def _first_line(self) -> str:
        return f"; insitu layout {VERSION} scale {self.scale:.2f}"
