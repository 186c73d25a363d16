"""Opening a scene, alone or for a session or a journal: what the worker is asked, and the document that comes of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.document.document import Document, document_from_description
from app.document.measurements import document_with_measurements, layers_of_document, unread_files
from app.document.sources import source_of
from app.document.view_state import Viewpoint
from app.files.journal import Recovery
from app.files.session import Session, fit_session, load_session
from app.messages.worker_messages import OpenScene, SceneOpened
from engine.material.bumps import BumpsByObject
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.description import SceneDescription


@dataclass(frozen=True)
class Opening:
    """A scene that the worker was asked to open, by the request `id`; the session, the journal or the light for which
    it is opened; what the worker answered, before it is seen."""

    id: int
    source: str
    session: Session | None = None
    session_path: Path | None = None
    recovery: Recovery | None = None
    light: Path | None = None
    fallback_reason: str = ""
    opened: SceneOpened | None = None

    @classmethod
    def of(cls, name: str, instead_of: str = "") -> Opening:
        """Of a scene (built-in name, scene file or mesh), light or a session file. Raises InsituError for what is none
        of them, or wrong. instead_of: why this and not what the person named, in a line."""
        source = source_of(name)
        if source.session is None:
            return cls(0, source.scene, light=source.light, fallback_reason=instead_of)
        session = load_session(source.session)
        return cls(0, session.document.source, session, source.session)

    @classmethod
    def of_recovery(cls, recovery: Recovery) -> Opening:
        """Of what an editor that ended early left behind. Raises LoadError where that has gone."""
        session = recovery.load()
        return cls(0, session.document.source, session, recovery.session_path, recovery)

    def request(self) -> OpenScene:
        """What is asked of the worker."""
        layers = [] if self.session is None else layers_of_document(self.session.document)
        return OpenScene(self.source, unread_files(layers), tuple(layers))

    def initial_view(self, resolution: tuple[int, int] | None) -> Viewpoint:
        """From where it is seen first; resolution (width, height) in place of the scene's own and the session's."""
        look = Viewpoint() if self.session is None else self.session.view.viewpoint
        return look if resolution is None else look._replace(resolution=resolution)

    @property
    def bumps(self) -> BumpsByObject:
        """Under which bumps it is seen first, where they are not the scene's own."""
        return () if self.session is None else self.session.document.new_bumps

    @property
    def poses(self) -> Poses:
        """In which poses it is seen first."""
        return () if self.session is None else self.session.document.poses

    def document(self, description: SceneDescription, opened: SceneOpened) -> Document:
        """The scene's own document. Raises InsituError."""
        document = document_from_description(self.source, description, opened.animations)
        return document_with_measurements(document, opened.measurements)

    def restored(self, session: Session, scene: Document, opened: SceneOpened) -> Document:
        """The session's document in the scene as it is now. Raises InsituError where it does not fit."""
        return document_with_measurements(fit_session(session, scene, self.file), opened.measurements)

    @property
    def digest(self) -> str:
        """Of the session's file as this was read from it; "" where that is not known."""
        if self.session is None:
            return ""
        if self.recovery is None:
            return self.session.digest
        return "" if self.session.journal is None else self.session.journal.session_digest or ""

    @property
    def file(self) -> str:
        """What the person opened."""
        return str(self.session_path or self.light or self.source)
