"""Tells whether a session's file was written elsewhere since it was read or written here."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file

MAX_SESSION_BYTES = 64 * 2**20


@dataclass(frozen=True)
class KnownFile:
    """A session's file as it was read or written here last; None before."""

    path: Path | None = None
    digest: str = ""

    @property
    def has_changed(self) -> bool:
        """Whether another window or program has written it since. A file that was deleted is no loss."""
        if self.path is None or not self.digest or not os.path.exists(self.path):
            return False
        try:
            return digest_of(read_regular_file(self.path, MAX_SESSION_BYTES)) != self.digest
        except LoadError:
            return True


def digest_of(data: bytes) -> str:
    """Distinguishes two contents of a session file."""
    return hashlib.blake2b(data, digest_size=20).hexdigest()
