"""Several edits that are one step of the history, such as the same edit of all selected objects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from app.document.document import Document
from app.document.history import Command


@dataclass(frozen=True)
class Several:
    """Edits one after the other; where one is refused, all are."""

    commands: tuple[Command[Document], ...]
    label: str

    def apply(self, document: Document) -> Document:
        for command in self.commands:
            document = command.apply(document)
        return document


def named_together(names: Sequence[str]) -> str:
    """What an edit of these objects is an edit of, in its label."""
    return names[0] if len(names) == 1 else f"{len(names)} objects"
