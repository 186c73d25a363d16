"""The files of a scene, by their content: what is sent to a cluster, once; and a cluster machine's cache of them: in
Insitu's cache, at most 16 GiB.

The scheduler stores pieces and hands them out; a worker stores whole files. Content that does not match its digest is
never used.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from app.system.atomic import make_private_folder, replacing
from app.worker.cache import cache_folder
from engine.core.errors import InsituError
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


BOUND = 16 << 30


class FileCache:
    """Pieces and files in one folder; several processes may use it at a time."""

    def __init__(self, folder: Path | None = None, bound: int = BOUND) -> None:
        self._folder, self._bound = folder or cache_folder() / "sent", bound

    def piece(self, digest: str) -> bytes | None:
        """The piece of that digest, None where it is missing, or no longer what it was."""
        path = self._path(digest, ".piece")
        try:
            content = path.read_bytes()
        except OSError:
            return None
        if digest_of(content) != digest:
            return None
        _touch(path)
        return content

    def put(self, content: bytes) -> None:
        """Store a piece. Raises OSError."""
        self._write(self._path(digest_of(content), ".piece"), iter([content]))

    def file(self, sent: BundledFile, fetch: Callable[[str], bytes]) -> Path:
        """The file, whole, with its own suffix; `fetch` gets the pieces of one that is missing. Raises OSError."""
        path = self._path(sent.digest, "".join(Path(sent.name).suffixes[-1:]))
        if path.is_file() and tuple(map(digest_of, pieces_of(path))) == sent.pieces:
            _touch(path)
        else:
            self._write(path, map(fetch, sent.pieces))
        return path

    def places(self, bundle: SceneBundle, fetch: Callable[[str], bytes]) -> dict[str, Path]:
        """The local paths of a bundle's files, by the names that they have everywhere. Raises OSError."""
        return {sent.name: self.file(sent, fetch) for sent in bundle.files}

    def _write(self, path: Path, pieces: Iterator[bytes]) -> None:
        make_private_folder(self._folder)
        with replacing(path, durable=False, private=True) as file:
            for piece in pieces:
                file.write(piece)
        self._shrink(path)

    def _shrink(self, keep: Path) -> None:
        """Delete the least recently used entries until the limit is met."""
        with contextlib.suppress(OSError):
            there = [(entry.stat(), Path(entry.path)) for entry in os.scandir(self._folder) if entry.is_file()]
            total = sum(status.st_size for status, _ in there)
            for status, path in sorted(there, key=lambda each: each[0].st_mtime_ns):
                if total <= self._bound:
                    return
                if path != keep:
                    path.unlink(missing_ok=True)
                    total -= status.st_size

    def _path(self, digest: str, ending: str) -> Path:
        return self._folder / (digest + ending)


def missing_pieces(digests: Sequence[str]) -> list[str]:
    """On the scheduler: which of these pieces are missing."""
    cache = FileCache()
    return [digest for digest in digests if cache.piece(digest) is None]


def store_piece(content: bytes) -> None:
    """On the scheduler: store a piece. Raises OSError."""
    FileCache().put(content)


def read_piece(digest: str) -> bytes | None:
    """On the scheduler: a stored piece."""
    return FileCache().piece(digest)


def fetch_piece(digest: str) -> bytes:
    """On a worker: a piece, from the scheduler. Raises InsituError where it does not have it any more."""
    from distributed import get_client

    content: bytes | None = get_client().run_on_scheduler(read_piece, digest)
    if content is None or digest_of(content) != digest:
        raise InsituError("the scheduler does not have the scene any more; give the command again")
    return content


def _touch(path: Path) -> None:
    with contextlib.suppress(OSError):
        os.utime(path)
