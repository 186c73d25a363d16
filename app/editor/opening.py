"""Opening a scene, alone or for a session or a journal: the request to the worker and the document that results."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.document.document import Document, document_from_description
from app.document.named_files import document_with_measurements, layers_of_document, unread_files
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
    """A scene that is being opened by the request `id`; the session, the journal or the light that it is opened for;
    the worker's response, before the scene is traced."""

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
        """An opening of a scene (built-in name, scene file or mesh), a light or a session file. Raises InsituError
        where the source is none of these, or wrong. instead_of: one line that says why this opens in place of the
        user's choice."""
        source = source_of(name)
        if source.session is None:
            return cls(0, source.scene, light=source.light, fallback_reason=instead_of)
        session = load_session(source.session)
        return cls(0, session.document.source, session, source.session)

    @classmethod
    def of_recovery(cls, recovery: Recovery) -> Opening:
        """An opening of the edits of an editor that ended early. Raises LoadError where the scene has gone."""
        session = recovery.load()
        return cls(0, session.document.source, session, recovery.session_path, recovery)

    def request(self) -> OpenScene:
        """The request to the worker."""
        layers = [] if self.session is None else layers_of_document(self.session.document)
        return OpenScene(self.source, unread_files(layers), tuple(layers))

    def initial_view(self, resolution: tuple[int, int] | None) -> Viewpoint:
        """The first view; resolution (width, height) replaces the scene's and the session's."""
        look = Viewpoint() if self.session is None else self.session.view.viewpoint
        return look if resolution is None else look._replace(resolution=resolution)

    @property
    def bumps(self) -> BumpsByObject:
        """The bumps of the first view, where they are not the scene's own."""
        return () if self.session is None else self.session.document.new_bumps

    @property
    def poses(self) -> Poses:
        """The poses of the first view."""
        return () if self.session is None else self.session.document.poses

    def document(self, description: SceneDescription, opened: SceneOpened) -> Document:
        """The scene's own document. Raises InsituError."""
        document = document_from_description(self.source, description, opened.animations)
        return document_with_measurements(document, opened.measurements)

    def restored(self, session: Session, scene: Document, opened: SceneOpened) -> Document:
        """The session's document, applied to the scene as it is now. Raises InsituError where it does not fit."""
        return document_with_measurements(fit_session(session, scene, self.file), opened.measurements)

    @property
    def digest(self) -> str:
        """The digest of the session's file when it was read; "" where that is unknown."""
        if self.session is None:
            return ""
        if self.recovery is None:
            return self.session.digest
        return "" if self.session.journal is None else self.session.journal.session_digest or ""

    @property
    def file(self) -> str:
        """The file that the user opened."""
        return str(self.session_path or self.light or self.source)
