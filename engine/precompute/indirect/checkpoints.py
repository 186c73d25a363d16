"""Checkpoints of a long computation, so that an interrupted one resumes where it stopped.

Each part depends on its inputs and on the parts before it, so it is stored with a digest of all of them. A part with
another digest belongs to other materials or another grid; it and all later parts are computed anew.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from engine.core.stored_arrays import Arrays, UnsoundArrays
from engine.precompute.indirect.irradiance_cache import CacheFull

Made = TypeVar("Made")
_DIGEST = "digest"
_TOO_FINE = b"the grid is too fine"


class CheckpointStore(Protocol):
    """Stores parts by their index. `load` returns None if there is no valid part."""

    def load(self, index: int) -> Arrays | None: ...

    def store(self, index: int, arrays: Arrays) -> None: ...


class Checkpoints:
    """One run through the parts, in order: `begin` each part, and `store_part` if it had to be computed."""

    def __init__(self, keeper: CheckpointStore | None = None) -> None:
        """keeper: None to store nothing."""
        self._keeper = keeper
        self._index = 0
        self._finished = self._current = b""

    def begin(self, read: Callable[[Arrays], Made], *inputs: bytes) -> Made | None:
        """The result of `read` for the next stored part if its digest matches these inputs, else None.

        Raises CacheFull where an earlier run did.
        """
        stored, digest = self._stored()
        if digest is not None and digest == self._after(_TOO_FINE):
            raise CacheFull("as before")
        self._current = self._after(*inputs)
        if stored is None or digest != self._current:
            return None
        try:
            made = read(stored)
        except UnsoundArrays:
            return None
        self._end(self._current)
        return made

    def store_part(self, arrays: Arrays) -> None:
        """Stores the part that was begun."""
        self._store(self._current, arrays)

    def mark_too_fine(self) -> None:
        """Ends this grid: the next parts belong to a coarser one."""
        digest = self._after(_TOO_FINE)
        if self._stored()[1] == digest:
            self._end(digest)
        else:
            self._store(digest, {})

    def _store(self, digest: bytes, arrays: Arrays) -> None:
        """Stores a part with its digest, and ends it."""
        if self._keeper is not None:
            self._keeper.store(self._index, {_DIGEST: np.frombuffer(digest, np.uint8), **arrays})
        self._end(digest)

    def _stored(self) -> tuple[Arrays | None, bytes | None]:
        """The stored part at the current index, and its digest."""
        stored = None if self._keeper is None else self._keeper.load(self._index)
        digest = None if stored is None else stored.get(_DIGEST)
        return stored, None if digest is None else digest.tobytes()

    def _after(self, *inputs: bytes) -> bytes:
        """The digest of a part with these inputs after the finished parts."""
        digest = hashlib.blake2b(self._finished, digest_size=20)
        for each in inputs:
            digest.update(len(each).to_bytes(8, "little"))
            digest.update(each)
        return digest.digest()

    def _end(self, digest: bytes) -> None:
        self._index, self._finished = self._index + 1, digest
