"""Scenes saved with all their files (`package`), and exported for other programs: a folder that Mitsuba 3 renders the
final frame from.

Where they are written is checked before one file is, and without importing what writes them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from app.system.atomic import require_folder, require_place
from engine.core.errors import InsituError

PACKAGE_ENDING = ".insitu.zip"


def is_archive_name(path: Path) -> bool:
    """Whether a scene that is saved there is one file."""
    return path.name.lower().endswith(PACKAGE_ENDING)


def require_package_place(path: Path, replaces: bool = False) -> None:
    """Raise InsituError where a scene cannot be saved: what is there stays, unless an archive is to be replaced."""
    if is_archive_name(path):
        require_place(path)
        if path.exists() and not replaces:
            raise InsituError(f"{path}: is there already, expected a new file; nothing was written")
        return
    if path.suffix.lower() == ".zip":
        raise InsituError(f"{path}: expected a new folder, or a name that ends in {PACKAGE_ENDING}")
    require_folder(path)
    if path.is_dir() and any(path.iterdir()):
        raise InsituError(f"{path}: is not empty, expected a new folder; nothing was written")


def written_names(objects: Sequence[str]) -> Iterator[str]:
    """The files that may be written of a scene with objects of these names, by their path in its folder."""
    yield from ("scene.xml", "render.py", "sky.exr")
    for index, name in enumerate(objects):
        stem = stem_of(index, name)
        yield from (f"meshes/{stem}.ply", f"materials/{stem}.npz", f"materials/{stem}.exr")


def stem_of(index: int, name: str) -> str:
    """The name of an object's files, without their suffixes."""
    return f"{index:02d}_{re.sub(r'[^A-Za-z0-9]+', '_', name)}"
