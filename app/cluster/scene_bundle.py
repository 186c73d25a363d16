"""The files of a scene, by their content: what is sent to a cluster, once."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from engine.core.safe_files import portable_name

PIECE = 16 << 20


@dataclass(frozen=True)
class BundledFile:
    """A file by the name that it has everywhere (`portable_name`), and the digests of its pieces."""

    name: str
    pieces: tuple[str, ...]

    @property
    def digest(self) -> str:
        """The digest of its content."""
        return digest_of("".join(self.pieces).encode())


@dataclass(frozen=True)
class SceneBundle:
    """All files of a scene."""

    files: tuple[BundledFile, ...]

    @property
    def digest(self) -> str:
        """The digest of all names and contents."""
        return digest_of(repr([(file.name, file.digest) for file in self.files]).encode())

    @property
    def pieces(self) -> tuple[str, ...]:
        """Digests of all their pieces, each once."""
        return tuple(dict.fromkeys(piece for file in self.files for piece in file.pieces))


def bundle_files(paths: Iterable[Path]) -> SceneBundle:
    """The bundle of these files. Raises OSError where one cannot be read."""
    named = {portable_name(path): path for path in paths}
    return SceneBundle(
        tuple(BundledFile(name, tuple(map(digest_of, pieces_of(named[name])))) for name in sorted(named))
    )


def pieces_of(path: Path) -> Iterator[bytes]:
    """The content of a file in pieces of 16 MiB; of an empty one there are none."""
    with open(path, "rb") as file:
        while piece := file.read(PIECE):
            yield piece


def digest_of(content: bytes) -> str:
    """BLAKE2b, 160 bits."""
    return hashlib.blake2b(content, digest_size=20).hexdigest()
