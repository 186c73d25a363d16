"""Objects that were added, deleted, renamed, hidden or shown, and that the worker has not traced yet.

A document with other objects than the picture closes the mode's scene until these are traced: what the mode computes is
of objects by their numbers. Meanwhile the mode is given the last document that has the objects of the picture. Undo
before the answer goes on with what is there.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

from app.document.described import added_state
from app.document.document import Document, ObjectState
from app.document.history import History
from app.document.scene_objects import AddedStates, with_objects_of, without_sources
from app.document.selection import selection_after_edit
from app.document.view_state import ViewState
from app.editor.view_controller import TracedView, ViewController
from app.modes.mode import ModeController, OpenedScene
from engine.scene.composition import Composition, ObjectSource
from engine.scene.description import ObjectDescription, SceneDescription

if TYPE_CHECKING:
    from engine.scene.added_objects import AddedObject


class FittedScene(NamedTuple):
    """A scene as its file describes it, as a description and as a document, and the document that it is opened with."""

    description: SceneDescription
    described: Document
    document: Document


class CompositionHost(Protocol):
    """What the composition controller needs of the editor."""

    view: ViewState
    controller: ModeController
    history: History[Document]

    @property
    def document(self) -> Document: ...

    def notify(self, text: str, is_error: bool = False) -> None: ...

    def with_nodes(self, document: Document) -> Document: ...


class CompositionController:
    """Compares the objects of the document with those of the picture. own: the open scene and its document as its file
    has them; added: objects that it does not have, as they were read; is_waiting: whether the document's objects are
    not traced yet."""

    def __init__(self, host: CompositionHost, tracing: ViewController) -> None:
        self._host, self._tracing = host, tracing
        self.own: tuple[SceneDescription, Document] | None = None
        self.added: dict[ObjectSource, ObjectState] = {}
        self._descriptions: dict[ObjectDescription, ObjectDescription] = {}
        self.is_waiting = False
        # The last documents with the objects of the picture and with those that were requested.
        self._drawn = self._requested = Document("")
        self._shown: Composition | None = None

    def open_scene(self, fitted: FittedScene, added: Iterable[AddedObject]) -> None:
        """Begin with a scene that was opened and traced, with the objects of its document where it has others than its
        file, some of them added."""
        self.own, self.added, self._descriptions = (fitted.description, fitted.described), {}, {}
        self._drawn = self._requested = fitted.document
        self.add(added)

    def add(self, objects: Iterable[AddedObject]) -> tuple[ObjectState, ...]:
        """Note objects that were read, and that the scene's file does not have; returns them. Raises LoadError."""
        self._descriptions |= {each.source: each.description for each in objects}
        states = added_states(objects)
        self.added |= states
        return tuple(states.values())

    @property
    def sources(self) -> tuple[ObjectDescription, ...]:
        """What these are read from."""
        return tuple(self._descriptions)

    def leave_out(self, missing: Collection[ObjectSource], is_of_view: bool) -> None:
        """Note that the objects that are read from these cannot be read any more: they are absent in all of the
        history. is_of_view: whether they are not in the view that was just traced."""
        assert self.own is not None
        described = self.own[1]
        self._host.history.map(lambda document: without_sources(document, missing, described))
        if is_of_view:
            self._requested = without_sources(self._requested, missing, described)
            self._tracing.adopt_composition(self._requested.composition)

    def update(self, now: float, view: TracedView) -> None:
        """Request that the view is traced once it is idle, and tell the mode whether it is; once a frame."""
        host, tracing, was_waiting = self._host, self._tracing, self.is_waiting
        composition = host.document.composition
        self.is_waiting = composition != tracing.composition
        if self.is_waiting and not was_waiting:
            self._close()
        number = tracing.requested_id
        has_moved = tracing.update(now, view, host.history.dragging and host.controller.follows_objects)
        if tracing.requested_id != number:
            host.controller.view_requested()
        if composition == tracing.requested_composition:
            self._requested = host.document
        if self.is_waiting:
            return
        if was_waiting:  # undone before it was traced
            host.controller.scene_open_failed()
        if has_moved or was_waiting:
            (host.controller.view_moved if tracing.is_away else host.controller.view_restored)()

    def drawn(self, document: Document) -> Document:
        """The document, or while its objects are not yet traced, the last one with those of the picture."""
        if document.composition == self._tracing.composition:
            self._drawn = document
        return self._drawn

    def view_of(self, drawn: Document, view: ViewState) -> ViewState:
        """The view of that document: without the selection of what it does not have."""
        selected = view.selected
        if drawn is self._host.document or selected is None or selection_after_edit(drawn, selected) == selected:
            return view
        return replace(view, selected=None)

    @property
    def has_new_objects(self) -> bool:
        """Whether the view that was just traced has other objects than the mode's scene, or this is closed until it has
        come."""
        return self.is_waiting or self._tracing.composition != self._shown

    def take_objects(self, opened: OpenedScene) -> OpenedScene:
        """The open scene with the objects that were just traced."""
        assert self.own is not None
        self._drawn, self._shown, self.is_waiting = self._requested, self._tracing.composition, False
        description, described = self.own
        document = self.drawn(self._host.document)
        if document.composition is not None:
            own = {each.name: each for each in description.objects}
            objects = tuple(
                (own[state.source] if isinstance(state.source, str) else self._descriptions[state.source]).model_copy(
                    update={"name": state.name}
                )
                for state in document.objects
            )
            description = description.model_copy(update={"objects": objects})
        described = with_objects_of(described, document, self.added)
        return replace(opened, description=description, described=described, document=self._host.with_nodes(document))

    def _close(self) -> None:
        """Close the mode's scene: the picture stays until the worker has traced other objects."""
        host = self._host
        host.controller.scene_closed()
        self._tracing.hand_released()
        if host.view.compare is not None and host.view.compare.composition != host.document.composition:
            host.view = replace(host.view, compare=None)
            host.notify("the comparison ended: its picture has other objects")


def added_states(objects: Iterable[AddedObject]) -> AddedStates:
    """Objects that were read, as their files describe them. Raises LoadError."""
    return {each.source: added_state(each.source, each.description, each.animations) for each in objects}
