"""The library: materials that come with the program, and the user's own, as files of `app.files.material_file`.

Files are read one at a time, a few milliseconds each, between frames: the window opens before its library is there. A
faulty file stays in the list with its error, so that it can be found and repaired.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

from app.document.linked_layers import Layers
from app.files.material_file import MAX_NAME, SUFFIX, Material, load_material, save_material
from app.system.paths import material_directory
from engine.core.errors import InsituError
from engine.scene.builtin import builtin_materials

OWN = "Own"
MOST_FILES = 2000


@dataclass(frozen=True)
class LibraryEntry:
    """One material of the library. `problem`: the line that says why its file cannot be used; it has no layers then."""

    path: Path
    material: Material
    is_own: bool = False
    problem: str = ""

    @property
    def name(self) -> str:
        return self.material.name

    @property
    def category(self) -> str:
        return OWN if self.is_own else self.material.category

    def matches(self, search: str) -> bool:
        """Whether every word of the search is in its name, its category or the names of its layers and models."""
        layers = " ".join(f"{layer.name} {layer.model.label}" for layer in self.material.layers)
        text = f"{self.name} {self.category} {layers}".lower()
        return all(word in text for word in search.lower().split())


@dataclass
class Library:
    """All materials, built-in ones first, then by category and name. `folder`: that of the user's own."""

    folder: Path | None = None
    _entries: tuple[LibraryEntry, ...] = ()
    _unread: list[Path] | None = field(default=None)

    @property
    def entries(self) -> tuple[LibraryEntry, ...]:
        """Those read so far."""
        return self._entries

    def read_next(self) -> bool:
        """Read one more file; returns whether there is another left. The first call lists the folders."""
        if self._unread is None:
            self._unread = [*builtin_materials(), *_own_files(self._own_folder())]
        if self._unread:
            self._put(_read(self._unread.pop(0), self._own_folder()))
        return bool(self._unread)

    def read_all(self) -> None:
        """Read all that is left."""
        while self.read_next():
            pass

    def entry(self, name: str) -> LibraryEntry:
        """The material of that name; InsituError when there is none, or its file is wrong."""
        self.read_all()
        found = next((entry for entry in reversed(self._entries) if entry.name == name), None)
        if found is None:
            raise InsituError(f"there is no material {name!r} in the library")
        if found.problem:
            raise InsituError(found.problem)
        return found

    def save(self, name: str, layers: Layers) -> LibraryEntry:
        """Store a material under a name among the user's own, replacing one of the same name; returns its entry."""
        name = name.strip()
        if not 0 < len(name) <= MAX_NAME or not name.isprintable():
            raise InsituError(f"{name!r} is no name for a material, expected 1 to {MAX_NAME} characters")
        path = self._path_for(name)
        material = Material(name, layers, OWN)
        save_material(path, material, private=True)
        entry = LibraryEntry(path, material, is_own=True)
        self._put(entry)
        return entry

    def delete(self, path: Path) -> None:
        """Delete one of the user's own materials."""
        entry = next((entry for entry in self._entries if entry.path == path and entry.is_own), None)
        if entry is None:
            raise InsituError(f"{path}: only your own materials can be deleted")
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise InsituError(f"{path}: not deleted, {error.strerror or error}") from error
        self._entries = tuple(other for other in self._entries if other is not entry)

    def _own_folder(self) -> Path:
        if self.folder is None:
            self.folder = material_directory()
        return self.folder

    def _path_for(self, name: str) -> Path:
        """The file of the user's material of this name, or an unused one."""
        own = next((entry.path for entry in self._entries if entry.is_own and entry.name == name), None)
        if own is not None:
            return own
        stem = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "material"
        names = (self._own_folder() / f"{stem}{suffix}{SUFFIX}" for suffix in ("", *(f"_{n}" for n in range(2, 1000))))
        return next(path for path in names if not path.exists())

    def _put(self, entry: LibraryEntry) -> None:
        others = [other for other in self._entries if other.path != entry.path]
        self._entries = tuple(sorted([*others, entry], key=lambda e: (e.is_own, e.category, e.name.lower())))


def categories(entries: Iterable[LibraryEntry]) -> list[str]:
    """The categories in the order of the entries."""
    return list(dict.fromkeys(entry.category for entry in entries))


def _own_files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.glob(f"*{SUFFIX}") if not path.name.startswith("."))[:MOST_FILES]


def _read(path: Path, own: Path) -> LibraryEntry:
    is_own = path.parent == own
    try:
        return LibraryEntry(path, load_material(path), is_own)
    except InsituError as error:
        return LibraryEntry(path, Material(path.stem, (), "Cannot be read"), is_own, str(error))
