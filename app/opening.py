"""Opening a scene, alone or for a session or a journal: what the worker is asked, and the document that comes of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.document import Document, document_from_description
from app.jobs.messages import OpenScene, SceneOpened
from app.journal import Recovery
from app.measurements import document_with_read, layers_of_document, unread_files
from app.paths import full_path
from app.session import SUFFIX, Session, fit_session, load_session
from engine.scene.description import SceneDescription


@dataclass(frozen=True)
class Opening:
    """A scene that the worker was asked to open, by the request `id`; the session or journal that asked for it."""

    id: int
    source: str
    session: Session | None = None
    session_path: Path | None = None
    recovery: Recovery | None = None

    @classmethod
    def of(cls, source: str) -> Opening:
        """Of a scene (built-in name or file) or a session file. Raises LoadError for a session that is wrong."""
        path = Path(source)
        if path.suffix != SUFFIX:
            return cls(0, full_path(source))
        session = load_session(path)
        return cls(0, session.document.source, session, path.resolve())

    @classmethod
    def of_recovery(cls, recovery: Recovery) -> Opening:
        """Of what an editor that ended early left behind. Raises LoadError where that has gone."""
        session = recovery.load()
        return cls(0, session.document.source, session, recovery.session_path, recovery)

    def request(self, resolution: tuple[int, int] | None) -> OpenScene:
        """What is asked of the worker; resolution (width, height) in place of the scene's own."""
        layers = [] if self.session is None else layers_of_document(self.session.document)
        return OpenScene(self.source, resolution, unread_files(layers), tuple(layers))

    def document(self, description: SceneDescription, opened: SceneOpened) -> Document:
        """The scene's own document. Raises InsituError."""
        return document_with_read(document_from_description(self.source, description), opened.measurements)

    def restored(self, session: Session, scene: Document, opened: SceneOpened) -> Document:
        """The session's document in the scene as it is now. Raises InsituError where it does not fit."""
        return document_with_read(fit_session(session, scene, self.file), opened.measurements)

    @property
    def file(self) -> str:
        """What the person opened."""
        return str(self.session_path or self.source)
