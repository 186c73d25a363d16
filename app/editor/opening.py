"""A scene that is being opened: alone, for a session or a journal, or again where its files were saved by others."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from app.document.described import document_from_description
from app.document.document import Document
from app.document.effective_settings import effective_view
from app.document.named_files import document_with_measurements, layers_of_document, unread_files
from app.document.scene_change import SceneChange
from app.document.scene_objects import AddedStates
from app.document.sources import source_of
from app.document.timeline import visible_poses
from app.document.view_state import Viewpoint, ViewState
from app.editor.composition_controller import FittedScene
from app.editor.view_controller import TracedView
from app.files.journal import Recovery
from app.files.session import Session, archived_session, load_session
from app.files.session_fitting import fit_session
from app.messages.worker_messages import OpenScene, SceneOpened
from engine.scene.description import ObjectDescription, SceneDescription


@dataclass(frozen=True)
class Opening:
    """A scene that is being opened by the request `id`; the session, the journal or the light that it is opened for;
    what is open, where its files are read again; the worker's response, before the scene is traced, and what it is
    opened with then, None where that does not fit."""

    id: int
    source: str
    session: Session | None = None
    session_path: Path | None = None
    recovery: Recovery | None = None
    light: Path | None = None
    fallback_reason: str = ""
    present: tuple[Document, ViewState] | None = None
    opened: SceneOpened | None = None
    fitted: FittedScene | None = None
    change: SceneChange | None = None

    @classmethod
    def of(cls, name: str, instead_of: str = "") -> Opening:
        """An opening of a scene (built-in name, scene file or mesh), a light or a session file. Raises InsituError
        where the source is none of these, or wrong. instead_of: one line that says why this opens in place of the
        user's choice."""
        source = source_of(name)
        if source.session is None:
            archived = archived_session(source.scene)
            named = source.scene if archived is None else archived.document.source
            return cls(0, named, archived, light=source.light, fallback_reason=instead_of)
        session = load_session(source.session)
        return cls(0, session.document.source, session, source.session)

    @classmethod
    def of_recovery(cls, recovery: Recovery) -> Opening:
        """An opening of the edits of an editor that ended early. Raises LoadError where the scene has gone."""
        session = recovery.load()
        return cls(0, session.document.source, session, recovery.session_path, recovery)

    @property
    def edited(self) -> tuple[Document, ViewState] | None:
        """The document and the view with which it is opened, of its session or the present ones; None for the scene as
        its file has it."""
        return self.present if self.session is None else (self.session.document, self.session.view)

    def request(self, added: Iterable[ObjectDescription] = ()) -> OpenScene:
        """The request to the worker. added: what its history has besides of objects that its file does not have."""
        if self.edited is None:
            return OpenScene(self.source)
        layers, sources = layers_of_document(self.edited[0]), dict.fromkeys((*self.edited[0].added_sources, *added))
        return OpenScene(self.source, unread_files(layers), tuple(layers), tuple(sources))

    def initial_view(self, resolution: tuple[int, int] | None) -> Viewpoint:
        """The first view; resolution (width, height) replaces the scene's and the session's."""
        if self.present is not None:
            return self.present[1].viewpoint
        look = Viewpoint() if self.session is None else self.session.view.viewpoint
        return look if resolution is None else look._replace(resolution=resolution)

    def first_view(self, id: int, resolution: tuple[int, int] | None, present: ViewState) -> TracedView:
        """The first view to trace, of the scene that the request of this number opens. resolution: as above; present:
        the view whose settings a scene keeps that is opened alone."""
        look = self.initial_view(resolution)
        if self.edited is None:
            return TracedView(look, n_edge_rays=present.settings.n_edge_rays, scene=id)
        document, view = self.edited
        poses = document.poses if self.present is None else visible_poses(document, view)
        n_edge_rays = effective_view(view, document).settings.n_edge_rays
        return TracedView(
            look, poses, document.new_bumps, n_edge_rays, id, document.new_opacities, document.composition
        )

    def document(self, description: SceneDescription, opened: SceneOpened) -> Document:
        """The scene's own document. Raises InsituError."""
        document = document_from_description(self.source, description, opened.animations)
        return document_with_measurements(document, opened.measurements)

    def restored(self, session: Session, scene: Document, opened: SceneOpened, added: AddedStates) -> Document:
        """The session's document, applied to the scene as it is now, with the objects that were read besides. Raises
        InsituError where it does not fit."""
        return document_with_measurements(fit_session(session, scene, self.file, added), opened.measurements)

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
