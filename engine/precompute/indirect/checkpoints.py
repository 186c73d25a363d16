"""The parts of a long computation, kept so that one that was interrupted goes on where it was.

Parts follow from what goes into them and from the parts before, so each is kept with a digest of all of that: what has
another digest belongs to other materials or another grid, and is found anew, with all that comes after it.
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
    """Where parts are kept, by their index. `load` is None where there is none, or no sound one."""

    def load(self, index: int) -> Arrays | None: ...

    def store(self, index: int, arrays: Arrays) -> None: ...


class Checkpoints:
    """One run through the parts, in their order: `begin` each; where it has to be found, `store_part` it."""

    def __init__(self, keeper: CheckpointStore | None = None) -> None:
        """keeper: None to keep nothing."""
        self._keeper = keeper
        self._index = 0
        self._finished = self._current = b""

    def begin(self, read: Callable[[Arrays], Made], *inputs: bytes) -> Made | None:
        """What `read` makes of the next part if it was kept and is what it needs, else None.

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
        """What the part is that was begun."""
        self._store(self._current, arrays)

    def mark_too_fine(self) -> None:
        """It ends here: the next parts are those of a coarser grid."""
        digest = self._after(_TOO_FINE)
        if self._stored()[1] == digest:
            self._end(digest)
        else:
            self._store(digest, {})

    def _store(self, digest: bytes, arrays: Arrays) -> None:
        if self._keeper is not None:
            self._keeper.store(self._index, {_DIGEST: np.frombuffer(digest, np.uint8), **arrays})
        self._end(digest)

    def _stored(self) -> tuple[Arrays | None, bytes | None]:
        stored = None if self._keeper is None else self._keeper.load(self._index)
        digest = None if stored is None else stored.get(_DIGEST)
        return stored, None if digest is None else digest.tobytes()

    def _after(self, *inputs: bytes) -> bytes:
        """The digest of a part with these inputs after those that are done."""
        digest = hashlib.blake2b(self._finished, digest_size=20)
        for each in inputs:
            digest.update(len(each).to_bytes(8, "little"))
            digest.update(each)
        return digest.digest()

    def _end(self, digest: bytes) -> None:
        self._index, self._finished = self._index + 1, digest
