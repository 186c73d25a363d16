"""Previews of a transferred edit: the selected objects as each measure would make them, as spheres of the library.

They are made while a menu asks for them, as the library's own thumbnails: a step a frame while the window has nothing
else to do. Those of a document and a selection stay until either changes.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from app.document.commands.transfer import TransferEdit
from app.document.document import Document
from app.document.selection import layer_shown
from app.document.view_state import ViewState
from app.files.materials import OWN, LibraryEntry, Material
from engine.core.errors import InsituError
from engine.inverse.transferred_edit import Measure

MOST_SHOWN = 6


class TransferPreviews:
    """The materials that the other selected objects would have. `document` and `view` are those of now."""

    def __init__(self, document: Callable[[], Document], view: Callable[[], ViewState]) -> None:
        self._document, self._view = document, view
        self._of: tuple[Document, tuple[str, ...], str] | None = None
        self._made: dict[tuple[Measure, str], LibraryEntry | None] = {}

    def entries(self, measure: Measure) -> tuple[LibraryEntry, ...]:
        """One for each of the first objects, under its name, one more at each call until all are there; none where the
        edit cannot be transferred."""
        document, view = self._document(), self._view()
        selected = layer_shown(document, view.selected)
        if selected is None or selected.factor is None:
            return ()
        curve = f"{selected.key}.{selected.factor}"
        if self._of is None or self._of[0] is not document or self._of[1:] != (view.others, curve):
            self._of, self._made = (document, view.others, curve), {}
        names = view.others[:MOST_SHOWN]
        missing = next(((i, name) for i, name in enumerate(names) if (measure, name) not in self._made), None)
        if missing is not None:  # one a call: each takes some milliseconds of a frame
            self._made[measure, missing[1]] = _entry(document, curve, measure, *missing)
        made = [self._made[measure, name] for name in names if (measure, name) in self._made]
        return () if None in made else tuple(each for each in made if each is not None)


def _entry(document: Document, curve: str, measure: Measure, i: int, name: str) -> LibraryEntry | None:
    """The material that an object would have, None where it can have none. The path only names the thumbnail, so that
    as many are held as are shown."""
    try:
        layers = TransferEdit(curve, (name,), measure).apply(document).object(name).layers
    except InsituError:
        return None
    return LibraryEntry(Path(f"transfer/{measure}/{i}"), Material(name, layers, OWN), True)
