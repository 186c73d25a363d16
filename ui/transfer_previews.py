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
        self._entries: dict[Measure, tuple[LibraryEntry, ...]] = {}

    def entries(self, measure: Measure) -> tuple[LibraryEntry, ...]:
        """One for each of the first objects, under its name; none where the edit cannot be transferred."""
        document, view = self._document(), self._view()
        selected = layer_shown(document, view.selected)
        if selected is None or selected.factor is None:
            return ()
        curve = f"{selected.key}.{selected.factor}"
        if self._of is None or self._of[0] is not document or self._of[1:] != (view.others, curve):
            self._of, self._entries = (document, view.others, curve), {}
        if measure not in self._entries:
            try:
                changed = TransferEdit(curve, view.others, measure).apply(document)
            except InsituError:
                self._entries[measure] = ()
            else:
                names = view.others[:MOST_SHOWN]
                layers = [changed.object(name).layers for name in names]
                # The path only names the thumbnail, so that as many are held as are shown.
                self._entries[measure] = tuple(
                    LibraryEntry(Path(f"transfer/{measure}/{i}"), Material(name, layers[i], OWN), True)
                    for i, name in enumerate(names)
                )
        return self._entries[measure]
