"""Tracks which edits are on disk: in the session's file, in the journal of unsaved edits, or recovered."""

from __future__ import annotations

import math
from pathlib import Path

from app.document.document import Document
from app.document.view_state import ViewState
from app.files.bookmarks import without_thumbnails
from app.files.journal import Journal, Recovery
from app.files.session import SUFFIX, KnownFile, write_session
from engine.core.errors import InsituError


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
        if self._journal is None or not document.objects or not self.unsaved(document, view):
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
