"""Scenes exported for other programs: a folder that Mitsuba 3 renders the final frame from.

The names of its files are known before one of them is written, and without importing what writes them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence


def written_names(objects: Sequence[str]) -> Iterator[str]:
    """The files that may be written of a scene with objects of these names, by their path in its folder."""
    yield from ("scene.xml", "render.py", "sky.exr")
    for index, name in enumerate(objects):
        stem = stem_of(index, name)
        yield from (f"meshes/{stem}.ply", f"materials/{stem}.npz", f"materials/{stem}.exr")


def stem_of(index: int, name: str) -> str:
    """The name of an object's files, without their suffixes."""
    return f"{index:02d}_{re.sub(r'[^A-Za-z0-9]+', '_', name)}"
