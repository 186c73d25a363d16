"""Which edits are safe on disk: the session's file, the journal of what is not saved, and what was recovered."""

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
    """``journal`` None keeps no journal."""

    def __init__(self, journal: Journal | None = None) -> None:
        self._journal = journal
        self._saved: Document | None = None
        self._saved_bookmarks = without_thumbnails(())
        self._recovery: Recovery | None = None
        self._reported: set[str] = set()
        self._file = KnownFile()

    @property
    def path(self) -> Path | None:
        """Where the session was saved last, or opened from; None before."""
        return self._file.path

    @property
    def file_has_changed(self) -> bool:
        """Whether its file has been written elsewhere since it was opened or saved here."""
        return self._file.has_changed

    def leave_document(self, document: Document, view: ViewState) -> bool:
        """Another scene takes the document's place: unsaved edits stay in a journal to recover; whether there were."""
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
        a recovered one, which no file has."""
        self._file, self._recovery = KnownFile(path, digest), recovery
        self._saved, self._saved_bookmarks = document if recovery is None else None, without_thumbnails(view.bookmarks)

    def unsaved(self, document: Document, view: ViewState) -> bool:
        """Whether there are edits, or kept views, that no session file has."""
        is_edited = document is not self._saved and document != self._saved
        return is_edited or without_thumbnails(view.bookmarks) != self._saved_bookmarks

    def rebase_saved(self, before: Document, after: Document) -> None:
        """An animation went on from one document to another, which is no edit: what was saved counts as saved."""
        if before == self._saved:
            self._saved = after

    def give_up(self, document: Document, view: ViewState) -> None:
        """The person does not want what is unsaved: no journal keeps it."""
        self._saved, self._saved_bookmarks = document, without_thumbnails(view.bookmarks)

    def save(self, path: Path | None, document: Document, view: ViewState) -> Path:
        """Save to ``path``, whatever is there, or where it was saved last; the path. Raises InsituError that says why
        not, of the latter also where another window has saved there since."""
        last = self._file if path is None else None
        path = path or self.path
        if path is None:
            raise InsituError(f"a session needs a name that ends in {SUFFIX}")
        self._file = write_session(path, document, view, last)
        self._saved, self._saved_bookmarks = document, without_thumbnails(view.bookmarks)
        assert self._file.path is not None
        return self._file.path

    def autosave(self, now: float, document: Document, view: ViewState) -> str:
        """Once a frame: have unsaved edits written to the journal; "", or once a line on what is wrong there.

        The journal they were recovered from goes once ours has them.
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
        """Write what is unsaved a last time; it is offered at the next start. Without such edits the journal goes."""
        if self._journal is not None:
            unsaved = bool(document.objects) and self.unsaved(document, view)
            self._journal.note(math.inf, document, view, unsaved, self._file)
            self._journal.close(keep=unsaved)
            self._drop_recovered(self._journal)

    def _drop_recovered(self, journal: Journal) -> None:
        if self._recovery is not None and (journal.written is not None or self._saved is not None):
            self._recovery.discard()
            self._recovery = None
