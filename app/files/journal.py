"""The autosave journal: unsaved edits, on disk within a second, found again after any end of the program; and which
edits are on disk, in the session's file, in the journal, or recovered.

Nothing here depends on the program ending normally: a lost X server ends it inside Xlib, where no exit handler runs.
Each editor has a journal file of its own, replaced as a whole (`app.system.atomic`) by a thread of its own, so that a
slow disk never stops a frame. A lock on a file beside it shows that its editor runs; the kernel releases the lock with
the process, so a journal that can be locked is one to recover. Rejected: process numbers, which are used again.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import operator
import os
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.document.document import Document
from app.document.view_state import ViewState
from app.files.bookmarks import Bookmarks, without_thumbnails
from app.files.known_file import KnownFile
from app.files.records import JournalRecord
from app.files.session import SUFFIX, Session, dump_checked, load_session, write_session
from app.system.atomic import PRIVATE_FILE, make_private_folder, write_atomically
from app.system.paths import full_path, journal_directory, written_path
from engine.core.errors import InsituError, LoadError, plain_line

if TYPE_CHECKING:
    from filelock import FileLock


DAMAGED = ".damaged"
NEVER_SAVED = KnownFile()
WRITE_SECONDS = 0.5
RETRY_SECONDS = 5.0
STALE_LOCK_SECONDS = 86400.0
_serial = itertools.count()


@dataclass(frozen=True)
class Recovery:
    """Unsaved edits that an editor left behind when it ended early. ``written_at`` in seconds since 1970."""

    path: Path
    scene: str
    written_at: float
    session_path: Path | None = None

    def load(self) -> Session:
        """The session in it; LoadError when the journal has gone meanwhile."""
        return load_session(self.path)

    def discard(self) -> None:
        """Delete the journal."""
        for path in (self.path, _lock_path(self.path)):
            with contextlib.suppress(OSError):
                path.unlink()


@dataclass(frozen=True)
class _Entry:
    """The desired content of the disk: a document with unsaved edits, or (None) no journal at all."""

    document: Document | None
    view: ViewState
    session: KnownFile


class Journal:
    """The journal of one running editor. ``problem`` is the last failure to write it, "" when there was none.

    ``warning`` is a line about journals of other editors that cannot be read.
    """

    def __init__(self, folder: Path | None = None) -> None:
        folder = journal_directory() if folder is None else folder
        self.path = folder / f"{os.getpid()}-{time.time_ns():x}-{next(_serial)}{SUFFIX}"
        self.problem = self.warning = ""
        self.written: Document | None = None
        self._lock: FileLock | None = None
        self._queued: tuple[Document, Bookmarks] | None = None
        self._queued_at = float("-inf")
        self._entries: queue.SimpleQueue[_Entry | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._write_all, name="journal", daemon=True)
        self._thread.start()

    def note(
        self, now: float, document: Document, view: ViewState, unsaved: bool, session: KnownFile = NEVER_SAVED
    ) -> None:
        """Request that the document is written when it, or a bookmark, has changed, twice a second at most; once a
        frame. Returns at once."""
        wanted = (document, view.bookmarks) if unsaved else None
        since = now - self._queued_at
        again = _is_same(wanted, self._queued) and not (self.problem and since >= RETRY_SECONDS)
        if again or (wanted is not None and since < WRITE_SECONDS):
            return
        self._queued, self._queued_at = wanted, now
        self._entries.put(_Entry(document if unsaved else None, view, session))

    def close(self, keep: bool = False) -> None:
        """End the thread after its last write; delete the journal unless ``keep``."""
        if self._thread.is_alive():
            self._entries.put(None)
            self._thread.join()
        if self._lock is not None:
            self._lock.release()
        if not keep:
            Recovery(self.path, "", 0.0).discard()

    def _write_all(self) -> None:
        """The thread: find damaged journals, then write the newest entry each time there is one."""
        try:
            self._take_lock()
        except OSError as error:
            self._failed(error)
        with contextlib.suppress(Exception):  # whatever is wrong with others, this journal has to be written
            self.warning = set_damaged_aside(self.path.parent)
        while (entry := self._newest()) is not None:
            try:
                self._write(entry)
                self.written, self.problem = entry.document, ""
            except OSError as error:
                self._failed(error)
            except Exception as error:  # the thread continues: the next document may be one that can be written
                self.problem = plain_line(f"autosave failed: {error}; the last good one stays")

    def _failed(self, error: OSError) -> None:
        self.problem = f"autosave failed: {self.path.parent}: {error.strerror or error}"

    def _take_lock(self) -> None:
        """Lock the journal: without it another editor would take the journal for one that was left behind. Raises
        OSError."""
        if self._lock is None:
            make_private_folder(self.path.parent)
            lock = _lock_on(self.path)
            lock.acquire()
            self._lock = lock

    def _newest(self) -> _Entry | None:
        entry = self._entries.get()
        with contextlib.suppress(queue.Empty):
            while entry is not None:
                later = self._entries.get_nowait()
                if later is None:  # the end: this entry is the last to write
                    self._entries.put(None)
                    break
                entry = later
        return entry

    def _write(self, entry: _Entry) -> None:
        self._take_lock()
        if entry.document is None:
            self.path.unlink(missing_ok=True)
            return
        path, digest = entry.session.path, entry.session.digest or None
        saved_as = None if path is None else written_path(str(path), None)
        record = JournalRecord(written_at=time.time(), session_path=saved_as, session_digest=digest)
        data = dump_checked(self.path, entry.document, entry.view, journal=record, known=self.written)
        write_atomically(self.path, data, private=True)


def _is_same(one: tuple[object, ...] | None, other: tuple[object, ...] | None) -> bool:
    """Whether they hold the identical values, not only equal ones: comparing whole documents would take too long."""
    return all(map(operator.is_, one or (), other or ())) and (one is None) == (other is None)


def recoverable_sessions(folder: Path | None = None) -> list[Recovery]:
    """The journals of editors that no longer run, newest first, without unreadable ones."""
    folder = journal_directory() if folder is None else folder
    _sweep_locks(folder)
    found = [recovery for path in folder.glob(f"*{SUFFIX}") if (recovery := _recovery(path)) is not None]
    return sorted(found, key=lambda recovery: recovery.written_at, reverse=True)


def set_damaged_aside(folder: Path) -> str:
    """Rename unreadable journals of editors that no longer run: they are preserved, and not found again.

    Returns one line about the first of them, "" where there is none. Those of a newer version stay for that.
    """
    lines = []
    for path in sorted(folder.glob(f"*{SUFFIX}")):
        if _owner_lives(path):
            continue
        try:
            load_session(path)
        except InsituError as error:
            if not (isinstance(error, LoadError) and error.what == "version"):
                lines.append(f"edits that were not saved cannot be read: {error}; the file is kept as {_aside(path)}")
    more = f", and {len(lines) - 1} more" if len(lines) > 1 else ""
    return lines[0] + more if lines else ""


def _aside(path: Path) -> Path:
    """Give a journal a name that is no journal's, if possible; returns its path."""
    with contextlib.suppress(OSError):
        return path.rename(path.with_suffix(DAMAGED))
    return path


def _recovery(path: Path) -> Recovery | None:
    if _owner_lives(path):
        return None
    try:
        session = load_session(path)
    except InsituError:
        return None
    journal = session.journal or JournalRecord(written_at=path.stat().st_mtime)
    saved_as = None
    with contextlib.suppress(InsituError):  # a circular link by now: the edits are what counts
        saved_as = None if journal.session_path is None else Path(full_path(journal.session_path))
    return Recovery(path, session.document.source, journal.written_at, saved_as)


def _sweep_locks(folder: Path) -> None:
    """Delete the locks of editors that ended early with nothing unsaved."""
    for lock in folder.glob("*.lock"):
        with contextlib.suppress(OSError):
            is_old = time.time() - lock.stat().st_mtime > STALE_LOCK_SECONDS
            if is_old and not lock.with_suffix(SUFFIX).exists() and not _owner_lives(lock.with_suffix(SUFFIX)):
                lock.unlink()


def _lock_path(path: Path) -> Path:
    return path.with_suffix(".lock")


def _lock_on(path: Path) -> FileLock:
    """The lock of a journal, which the system releases when its process ends; not taken yet."""
    from filelock import FileLock  # late: its import takes longer than all else here at a start

    return FileLock(_lock_path(path), mode=PRIVATE_FILE, thread_local=False)


def _owner_lives(journal: Path) -> bool:
    """Whether a process has the lock of a journal."""
    if not _lock_path(journal).exists():
        return False
    from filelock import Timeout

    lock = _lock_on(journal)
    try:
        lock.acquire(timeout=0)
    except (Timeout, OSError):
        return True
    lock.release()
    return False


class SessionStore:
    """``journal`` None writes no journal."""

    def __init__(self, journal: Journal | None = None) -> None:
        self._journal = journal
        self._saved: Document | None = None
        self._saved_bookmarks = without_thumbnails(())
        self._recovery: Recovery | None = None
        self._reported: set[str] = set()
        self._file = KnownFile()

    @property
    def path(self) -> Path | None:
        """The file that the session was saved to last, or opened from; None before."""
        return self._file.path

    @property
    def file_has_changed(self) -> bool:
        """Whether another program has written its file since it was opened or saved here."""
        return self._file.has_changed

    def leave_document(self, document: Document, view: ViewState) -> bool:
        """Leave the document for another scene: unsaved edits stay in a journal to recover; returns whether there were
        any."""
        if self._journal is None or not document.is_open or not self.unsaved(document, view):
            return False
        self._journal.note(math.inf, document, view, True, self._file)
        self._journal.close(keep=True)
        self._drop_recovered(self._journal)
        self._journal = Journal(self._journal.path.parent)
        return True

    def set_document(
        self, document: Document, view: ViewState, path: Path | None = None, recovery: Recovery | None = None,
        digest: str = "",
    ) -> None:  # fmt: skip
        """Another document was opened: a scene's, a session's (``path``, and the ``digest`` of what was read there), or
        a recovered one, which is in no file."""
        self._file, self._recovery = KnownFile(path, digest), recovery
        self._saved, self._saved_bookmarks = document if recovery is None else None, without_thumbnails(view.bookmarks)

    def unsaved(self, document: Document, view: ViewState) -> bool:
        """Whether there are edits, or bookmarks, that are in no session file."""
        is_edited = document is not self._saved and document != self._saved
        return is_edited or without_thumbnails(view.bookmarks) != self._saved_bookmarks

    def rebase_saved(self, before: Document, after: Document) -> None:
        """An animation moved from one document to another, which is no edit: what was saved counts as saved."""
        if before == self._saved:
            self._saved = after

    def map(self, change: Callable[[Document], Document]) -> None:
        """The scene that documents belong to was read again: what was saved counts as saved, but for the axis of a mesh
        that points up, which is part of the scene's name."""
        if self._saved is not None:
            self._saved = replace(change(self._saved), source=self._saved.source)

    def give_up(self, document: Document, view: ViewState) -> None:
        """Discard unsaved edits: no journal stores them."""
        self._saved, self._saved_bookmarks = document, without_thumbnails(view.bookmarks)

    def save(self, path: Path | None, document: Document, view: ViewState) -> Path:
        """Save to ``path``, replacing any file, or where it was saved last; returns the path. Raises InsituError that
        says why not, for the latter also where another window has saved there since."""
        last = self._file if path is None else None
        path = path or self.path
        if path is None:
            raise InsituError(f"a session needs a name that ends in {SUFFIX}")
        self._file = write_session(path, document, view, last)
        self._saved, self._saved_bookmarks = document, without_thumbnails(view.bookmarks)
        assert self._file.path is not None
        return self._file.path

    def autosave(self, now: float, document: Document, view: ViewState) -> str:
        """Write unsaved edits to the journal; once a frame. Returns "", or once a line on what is wrong there.

        The journal they were recovered from is deleted once the new one has them.
        """
        if self._journal is None:
            return ""
        self._journal.note(now, document, view, self.unsaved(document, view), self._file)
        self._drop_recovered(self._journal)
        lines = {self._journal.warning, self._journal.problem}
        news = next(iter(lines - self._reported - {""}), "")
        self._reported = (self._reported & lines) | {news}
        return news

    def close(self, document: Document, view: ViewState) -> None:
        """Write unsaved edits a last time; the next start offers them. Without any the journal is deleted."""
        if self._journal is not None:
            unsaved = bool(document.objects) and self.unsaved(document, view)
            self._journal.note(math.inf, document, view, unsaved, self._file)
            self._journal.close(keep=unsaved)
            self._drop_recovered(self._journal)

    def _drop_recovered(self, journal: Journal) -> None:
        if self._recovery is not None and (journal.written is not None or self._saved is not None):
            self._recovery.discard()
            self._recovery = None
