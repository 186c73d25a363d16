"""Variants that are chosen of the sets of a file, as text: `shape=tall,size=big`.

Names of scenes end with it (`kitchen.usd#shape=tall`, see `app.document.scene_files`), and so do names of images that
are computed of one choice (`kitchen.usd#7@shape=tall`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping

_NAME = r"[^#=,@/\\\s]+"
_CHOICES = re.compile(f"{_NAME}={_NAME}(?:,{_NAME}={_NAME})*")


def parse_choices(text: str) -> dict[str, str] | None:
    """The variants by the names of their sets; None where the text has another form."""
    if not _CHOICES.fullmatch(text):
        return None
    return dict(each.split("=", 1) for each in text.split(","))  # type: ignore[misc]


def choices_text(chosen: Mapping[str, str]) -> str:
    """The text of variants by the names of their sets, "" for none."""
    return ",".join(f"{group}={name}" for group, name in chosen.items())
