"""Pictures that are stored while the program runs, to compare the present one with: linear light, before any view.

The window stores what it shows; the worker reads files, which may be strangers', one after the other. Which of them is
compared, and how it is shown, is part of the view (`ViewState.stored`, `ViewState.difference`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from app.document.view_state import SetView, ViewCommand, ViewState
from app.files.bookmarks import MAX_NAME, is_name
from app.messages.file_messages import PictureRead, ReadPicture
from app.messages.worker_messages import Request, RequestFailed
from engine.core.errors import InsituError, list_names, printable_name
from engine.core.safe_files import resolved

MOST_PICTURES = 12


class StoredPicture(NamedTuple):
    """A stored picture: light (H, W, 4), linear, with the intensity of the scene's light, without exposure and view;
    the last channel is alpha, which is multiplied into the others; file: what it was read from, None for a picture of
    the scene."""

    name: str
    light: NDArray[np.float32]
    file: Path | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, pixels."""
        return self.light.shape[1], self.light.shape[0]


class StoredHost(Protocol):
    """What it needs of the editor."""

    view: ViewState

    def do(self, command: ViewCommand) -> str | None: ...

    def notify(self, text: str, is_error: bool = False) -> None: ...


class StoredPictures:
    """The stored pictures of one editor. ``send`` sends a request and returns its number."""

    def __init__(self, host: StoredHost, send: Callable[[Request], int]) -> None:
        self._host, self._send = host, send
        self._pictures: dict[str, StoredPicture] = {}
        self._waiting: list[tuple[Path, bool]] = []
        self._requested: int | None = None  # the request for the first of them

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all, in the order in which they were stored."""
        return tuple(self._pictures)

    def names_of(self, file: Path) -> tuple[str, ...]:
        """The names of those that were read from a file, in the order in which they were stored."""
        return tuple(name for name, picture in self._pictures.items() if picture.file == file)

    @property
    def is_reading(self) -> bool:
        """Whether a file is being read."""
        return bool(self._waiting)

    @property
    def compared(self) -> StoredPicture | None:
        """The one that the present picture is compared with."""
        return self._pictures.get(self._host.view.stored)

    def picture(self, name: str) -> StoredPicture:
        """The picture of this name. Raises InsituError that lists all."""
        if name not in self._pictures:
            known = f"available: {list_names(self.names)}" if self._pictures else "none is stored yet"
            raise InsituError(f"there is no stored picture {name!r}; {known}")
        return self._pictures[name]

    def store(self, light: NDArray[np.float32], name: str = "") -> None:
        """Store a picture and compare with it; one of the same name is replaced. name: "" for a new one. Raises
        InsituError."""
        self._store(StoredPicture(name or _free_name("Picture", self._pictures), light))

    def store_file(self, light: NDArray[np.float32], file: Path) -> None:
        """Store what a file shows and compare with it, in the place of what was read from it last. Raises
        InsituError."""
        name = next(reversed(self.names_of(file)), "") or self._free_name_of(file)
        self._store(StoredPicture(name, light, file))

    def _store(self, picture: StoredPicture, compares: bool = True) -> None:
        self.check_name(picture.name)
        self._pictures[picture.name] = picture
        if compares:
            self._host.do(SetView.of(stored=picture.name, compare=None))

    def _free_name_of(self, file: Path) -> str:
        return _free_name(printable_name(file.name, MAX_NAME - 4), self._pictures, first="")

    def check_name(self, name: str, n_coming: int = 0) -> None:
        """Raise InsituError where no picture can be stored under a name, "" for a new one; n_coming: how many are
        already to be stored before it."""
        if name and not is_name(name):
            raise InsituError(f"stored picture: name = {name!r}, expected 1 to {MAX_NAME} characters")
        if len(self._pictures) + n_coming >= MOST_PICTURES and name not in self._pictures:
            raise InsituError(f"{MOST_PICTURES} pictures are stored; remove one first")

    def load(self, file: Path, compares: bool = True) -> None:
        """Let the worker read a file, and compare with it when it has come, or only store it: then values that are
        not finite are black."""
        self._waiting.append((resolved(file), compares))
        self._request_next()

    def remove(self, name: str) -> None:
        """Forget a picture; the comparison with it ends. Raises InsituError."""
        del self._pictures[self.picture(name).name]
        if self._host.view.stored == name:
            self._host.do(SetView.of(stored=""))

    def compare_with(self, name: str) -> str | None:
        """Compare with a stored picture, "" for none. Raises InsituError."""
        return self._host.do(SetView.of(stored=name and self.picture(name).name, compare=None))

    def receive(self, response: PictureRead) -> None:
        """A file has come."""
        if self._requested is None or response.id != self._requested:
            return
        file, compares = self._end()
        try:
            self._store(StoredPicture(self._free_name_of(file), response.light, file), compares)
        except InsituError as error:
            self._host.notify(f"{file}: {error}", True)

    def receive_failure(self, response: RequestFailed) -> bool:
        """A request failed; returns whether it was for a picture."""
        if self._requested is None or response.id != self._requested:
            return False
        self._end()
        self._host.notify(response.line, True)
        return True

    def worker_restarted(self) -> None:
        """The file that was being read may be what ended the worker: it is given up, others are requested."""
        if self._requested is not None:
            self._end()

    def _end(self) -> tuple[Path, bool]:
        """End the request under way, and go on with the next file; returns the one that it was for, and whether that
        is to be compared with."""
        ended, self._requested = self._waiting.pop(0), None
        self._request_next()
        return ended

    def _request_next(self) -> None:
        if self._requested is None and self._waiting:
            file, compares = self._waiting[0]
            self._requested = self._send(ReadPicture(str(file), may_have_gaps=not compares))


def _free_name(stem: str, taken: Iterable[str], first: str = " 1") -> str:
    """A name that none has: the stem with a number."""
    names, number = set(taken), 2
    if (name := f"{stem}{first}") not in names:
        return name
    while f"{stem} {number}" in names:
        number += 1
    return f"{stem} {number}"
