"""The file of the session that an editor has open: where it is, and whether it has all edits."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from app.document.document import Document
from app.document.view_state import ViewState
from app.files.journal import SessionStore
from app.system.paths import display_name, is_file_name


class SessionHost(Protocol):
    """What the session's file needs of the editor."""

    view: ViewState

    @property
    def document(self) -> Document: ...

    @property
    def scene_is_open(self) -> bool: ...


class SessionFile:
    """The file of the document and the view of `host`, and the journal of what is not in it (`store`)."""

    def __init__(self, host: SessionHost, store: SessionStore) -> None:
        self._host, self.store = host, store

    @property
    def path(self) -> Path | None:
        """The file that the session was saved to last, or opened from."""
        return self.store.path

    @property
    def has_changed(self) -> bool:
        """Whether another program has written the session's file since it was opened or saved here."""
        return self.store.file_has_changed

    @property
    def is_unsaved(self) -> bool:
        """Whether there are edits that no session file contains."""
        return self._host.scene_is_open and self.store.unsaved(self._host.document, self._host.view)

    @property
    def path_to_reopen(self) -> Path | None:
        """The file to open to come back here, the session's or the scene's; None of a built-in scene."""
        source = self._host.document.source
        return self.path or (Path(source) if self._host.scene_is_open and is_file_name(source) else None)

    @property
    def name(self) -> str:
        """The name of what is open, as the window shows it."""
        return display_name(str(self.path or self._host.document.source))

    def save(self, path: Path | None) -> Path:
        """Save to ``path``, or where it was saved last; returns the path. Raises InsituError that says why not."""
        return self.store.save(path, self._host.document, self._host.view)

    def autosave(self, now: float) -> str:
        """Write unsaved edits to the journal, see `SessionStore.autosave`."""
        return self.store.autosave(now, self._host.document, self._host.view)

    def give_up_unsaved(self) -> None:
        """Discard unsaved edits from the journal as well; undo still has them."""
        self.store.give_up(self._host.document, self._host.view)

    def close(self) -> None:
        """Leave unsaved edits in the journal, which the next start offers to recover."""
        self.store.close(self._host.document, self._host.view)
