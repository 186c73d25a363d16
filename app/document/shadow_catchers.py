"""What a document is without the objects that throw shadows: its shadow catchers and what emits, alone."""

from __future__ import annotations

from dataclasses import replace

from app.document.background import Background
from app.document.document import Document


def catchers_alone(document: Document) -> Document | None:
    """The document of its catchers and what emits alone; None where no catcher is shown.

    Equal ones light their catchers equally: intensity and background, which act on the finished picture, are left out.
    """
    if not document.shadow_catchers:
        return None
    stay = tuple(state for state in document.objects if state.shadow_catcher or state.emits)
    gone = {state.name for state in document.objects if state.is_of_file and state not in stay}
    return replace(
        document, objects=stay, deleted=tuple(sorted({*document.deleted, *gone})), absent=(), looks=(),
        light=replace(document.light, intensity=1.0), background=Background(),
    )  # fmt: skip
