"""The editor without a window: document, history and view on one side, the worker on the other.

    commands ─► History ─► Document ─► mode controller ─► requests ─► worker ─► responses ─► picture events ─► renderer

The mode decides what makes the picture (`app.modes.mode`). The window calls ``do`` with the commands of panels and
``tick`` once a frame, and passes the events that ``tick`` returns to the renderer. Nothing here draws, waits, or raises
for what the user did: a refused command returns one line of text.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from app.document.commands import EditCommand
from app.document.commands.layers import SetMaterial
from app.document.commands.suns import AddSun
from app.document.document import Document
from app.document.effective_settings import effective_view
from app.document.history import History
from app.document.light_state import sun_key
from app.document.named_files import files_of_document
from app.document.selection import Path as SelectionPath
from app.document.selection import follow_in_view, select_in_view
from app.document.timeline import Player
from app.document.view_state import OpenPanel, SetView, ViewCommand, ViewState
from app.editor.camera_history import CameraHistory
from app.editor.catcher_controller import CatcherController
from app.editor.colour_controller import ColourController
from app.editor.exchange import FileExchange
from app.editor.light_paths import LightPaths
from app.editor.material_matching import MaterialMatching
from app.editor.node_controller import NodeController
from app.editor.opening import Opening
from app.editor.responses import take_response
from app.editor.scene_controller import SceneController
from app.editor.session_file import SessionFile
from app.editor.stored_pictures import StoredPictures
from app.editor.table_controller import TableController
from app.files.journal import Journal, Recovery, SessionStore
from app.messages.editor_status import Status, StatusMetrics
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import (
    CancelRequests,
    Request,
    RequestFailed,
    Response,
    WorkerClient,
)
from app.modes.mode import Mode, ModeController, Shared
from app.modes.registry import MODES
from app.system.barrier import Barrier
from app.system.lazy_import import import_named
from engine.core.errors import InsituError, plain_line
from engine.planner import planned_edge_rays

POLL_SECONDS = 0.004
STOPPED = "stopped; press Resume in the Accuracy panel to go on, or change the light or a roughness"


class Editor:
    """The controller of one window.

    client: the worker; source: the scene (or session) to open at once; resolution: (width, height) in place of the
    scene's own; journal: where unsaved edits are stored, None for nowhere (headless pictures); barrier: catches
    exceptions in a frame, None lets them through; modes: those to choose from.
    """

    def __init__(
        self,
        client: WorkerClient,
        source: str,
        *,
        resolution: tuple[int, int] | None = None,
        journal: Journal | None = None,
        barrier: Barrier | None = None,
        modes: Sequence[Mode] = MODES,
    ) -> None:
        self.barrier = barrier or Barrier()
        self.barrier.on_fault = partial(self.notify, is_error=True)
        self.history = History(Document(source, is_open=False))
        self.view = self._view_before_drag = ViewState()
        self.resolution = resolution
        self.metrics = StatusMetrics()
        self._client = client
        self.session = SessionFile(self, SessionStore(journal))
        self.exchange = FileExchange(self, client.send)
        self.tables = TableController(client.send)
        self.colours = ColourController(self, client.send)
        self.stored = StoredPictures(self, client.send)
        self.light_paths = LightPaths(self, client.send)
        self.material_matching = MaterialMatching(self)
        self.nodes = NodeController(self)
        self._receivers = (self.tables, self.colours, self.stored, self.light_paths)  # of failures
        self.scenes = SceneController(self, self.session.store)
        self.camera_history = CameraHistory(self, self.scenes.tracing)
        self.catchers = CatcherController(self, self.scenes.tracing)
        self.player = Player(self)
        self.cancelled_up_to = -1  # the number of the last request that was stopped
        self._shared: dict[type, Any] = {}
        self.modes = tuple(modes)
        self.mode = self.modes[0]
        self.controller: ModeController = import_named(self.mode.controller)(self)
        self.open(source)

    # --------------------------------------------------------------------------------------------------------- document

    @property
    def document(self) -> Document:
        """The document as it is now."""
        return self.history.document

    def with_nodes(self, document: Document) -> Document:
        """The document that pictures of a document are made of, see `app.document.node_layers`."""
        return self.nodes.with_nodes(document)

    @property
    def pictured(self) -> Document:
        """The document that pictures are made of now: with the objects of the traced scene, and with nodes."""
        return self.with_nodes(self.scenes.composing.drawn(self.document))

    @property
    def pictured_view(self) -> ViewState:
        """The view of that document: without the selection of what it does not have."""
        return self.scenes.composing.view_of(self.scenes.composing.drawn(self.document), self.view)

    @property
    def scene_is_open(self) -> bool:
        """Whether there is a scene to edit (the first one is still being loaded otherwise)."""
        return self.document.is_open

    def do(self, command: EditCommand | ViewCommand, merge_key: str | None = None) -> str | None:
        """Carry out an edit or a change of view; returns None, or one line that says why it was refused.

        Consecutive edits with the same ``merge_key`` are one step of the history.
        """
        before = self.document
        if isinstance(command, AddSun):
            command = command.seen_from(self.camera_history.camera)
        try:
            if isinstance(command, SetView | OpenPanel):
                self.view = command.apply(self.view)
            elif self.exchange.defer_command(command):
                return None
            elif self.history.do(command, merge_key):
                self.document_changed(before, command)
                if isinstance(command, SetMaterial) and self.view.selected is not None:
                    self.select(self.view.selected.object)  # the layers of the object have changed
        except (InsituError, ValueError) as error:
            return self._refuse(str(error))
        return None

    def begin_drag(self, label: str | None = None) -> None:
        """Begin a drag: all edits until ``end_drag`` are one step of the history."""
        if not self.history.dragging:
            self._view_before_drag = self.view
        self.history.begin_drag(label)

    def end_drag(self) -> None:
        """End the drag; the next tick requests what was deferred until then."""
        if self.history.dragging:
            self.history.end_drag()
            self.scenes.tracing.hand_released()
            self.controller.drag_ended()
            self.exchange.drag_ended()

    def cancel_drag(self) -> None:
        """Cancel the drag under way, the camera's too; the curve's handles belong again to the operator that they
        belonged to before it."""
        self.camera_history.cancel_drag()
        if self.history.dragging:
            self.history.cancel_drag()
            before = self._view_before_drag
            self.view = replace(self.view, operator=before.operator, regions=before.regions, crop=before.crop)
            self.controller.drag_ended()
            self.document_changed()
            self.exchange.drag_ended()

    def undo(self) -> str | None:
        """Undo one step; returns its label, None where there is none."""
        return self._describe_step(self.history.undo, "undone")

    def redo(self) -> str | None:
        """Redo one step; returns its label, None where there is none."""
        return self._describe_step(self.history.redo, "redone")

    @property
    def undo_label(self) -> str | None:
        """The label of the edit that undo would take back; None where there is none."""
        return self.history.undo_label

    @property
    def redo_label(self) -> str | None:
        return self.history.redo_label

    @property
    def camera_undo_label(self) -> str | None:
        """The label of the step of the view's own history that its undo would take back."""
        return self.camera_history.history.undo_label

    @property
    def camera_redo_label(self) -> str | None:
        return self.camera_history.history.redo_label

    def select(self, paths: SelectionPath | Sequence[SelectionPath] | None) -> str | None:
        """Select an object, layer or curve; of an object its last layer, of a layer its first curve; or several, the
        last of which is active; or a sun.

        Returns None, or one line that says why there is no such thing.
        """
        try:
            self._show(select_in_view(self.document, self.view, paths))
        except InsituError as error:
            return self._refuse(str(error))
        return None

    def _show(self, view: ViewState) -> None:
        """Take over a view with another selection."""
        has_changed, self.view = view.selected != self.view.selected, view
        if has_changed:
            self.controller.edited()

    def notify(self, text: str, is_error: bool = False) -> None:
        """Put one line into ``status.message``."""
        self.metrics.notify(text, is_error)

    def notify_once(self, note: str) -> None:
        """Show a note the first time it comes up in a scene."""
        if note and plain_line(note) not in self.metrics.notes:
            self.metrics.note(note)
            self.notify(note)

    # ------------------------------------------------------------------------------------------------------------ files

    @property
    def scene_document(self) -> Document:
        """The document as the scene's file describes it."""
        opened = self.scenes.opened
        return self.document if opened is None else opened.described

    def open(self, source: str) -> str | None:
        """Open a scene (built-in name or file) or a session; the present one stays until the new one is ready.

        Returns None, or one line that says why it cannot be opened.
        """
        try:
            opening = Opening.of(source)
        except InsituError as error:
            self.scenes.open_default(str(error))
            return self._refuse(str(error))
        self._open(opening)
        return None

    def save(self, path: Path | None = None) -> str | None:
        """Save the session, to ``path`` or where it was saved last; returns None, or one line that says why not."""
        try:
            path = self.session.save(path)
        except InsituError as error:
            return self._refuse(str(error))
        self.scenes.watch.forget(path)
        self.notify(f"saved {path}")
        return None

    def recover(self, recovery: Recovery) -> str | None:
        """Open the edits of an editor that ended early; returns None, or one line that says why they cannot be
        opened."""
        try:
            opening = Opening.of_recovery(recovery)
        except InsituError as error:
            return self._refuse(str(error))
        self._open(opening)
        return None

    def close(self) -> None:
        """End the worker; unsaved edits stay in the journal, which the next start offers to recover."""
        self._client.close()
        self.material_matching.close()
        self.scenes.watch.close()
        self.session.close()

    def cancel_work(self) -> None:
        """Stop the worker; delivered pictures stay on screen, until `resume_work` or an edit that requires new work."""
        self.cancelled_up_to = self._client.send(CancelRequests())
        self.controller.cancelled()
        self.catchers.cancelled()
        self.nodes.lose_request()
        self.exchange.cancel()
        self.scenes.give_up()
        self.metrics.progress = None
        self.metrics.stopped = not self.status.is_finished
        self.notify(STOPPED if self.metrics.stopped else "stopped")

    def resume_work(self) -> None:
        """Request again what was stopped or failed: the picture, or the scene where none is open yet."""
        self.metrics.stopped = False
        self.catchers.resume()
        if not self.scenes.reopen():
            self.controller.resume()

    # ---------------------------------------------------------------------------------------------------------- picture

    def tick(self, now: float | None = None) -> list[PictureEvent]:
        """Process the worker's responses and request what is missing; once a frame. ``now``: a steady clock,
        seconds."""
        now = time.monotonic() if now is None else now
        events = self._follow_mode()
        self.player.advance(now)
        self.barrier.run("The match of a material", self.material_matching.follow, False, ())
        none: list[PictureEvent] = []
        run, silence = self.barrier.run, list[Response]()
        for response in run("The connection to the worker", partial(self._client.poll, POLL_SECONDS), silence, ()):
            events = events + run("An answer of the worker", partial(take_response, self, response), none)
        if self.scene_is_open:
            view = effective_view(self.view, self.document)
            self.scenes.update(now, view)
            self.colours.follow()
            self.nodes.request_missing(*filter(None, (self.document, view.compare)))
            drawn = self.scenes.composing.drawn(self.document)
            made_of = self.with_nodes(drawn), self.scenes.composing.view_of(drawn, view)
            update = partial(self.controller.update, now, *made_of)
            events = events + run("The update after an edit", update, none, made_of)
            run("Shadow catchers", partial(self.catchers.update, now, *made_of), None, made_of)
            run("The journal", partial(self._autosave, now), None, made_of)
        self.metrics.stopped &= not (self.controller.is_running or self.status.is_finished)
        self.metrics.measure_memory(now, self._client.pid)
        return events

    def shared_state(self, kind: type[Shared]) -> Shared:
        """State that mode controllers share, see `app.modes.mode.EditorServices`."""
        found: Shared = self._shared.setdefault(kind, kind())
        return found

    def send(self, request: Request) -> int:
        """Send a request to the worker; returns its number."""
        return self._client.send(request)

    def reload_images(self, key: str) -> None:
        """Read the images of a layer again after another program has changed them."""
        self.controller.reload_images(key)
        self.nodes.reload(self.document, key)

    @property
    def response_arriving(self) -> bool:
        """Whether a response has arrived that the next `tick` processes: there is no need to wait."""
        return self._client.arriving

    @property
    def status(self) -> Status:
        """The status of what is on screen."""
        status = self.metrics.status(self._client.alive)
        opened = self.scenes.opened
        planned_edges = 0 if opened is None else planned_edge_rays(opened.description)
        status = replace(
            status, is_away=self.scenes.tracing.is_away, planned_edges=planned_edges,
            changed_files=self.scenes.watch.changed, map_nodes=self.nodes.counts(self.document),
            material_match=self.material_matching.progress,
            material_match_note=self.material_matching.note(self.document),
        )  # fmt: skip
        status = self.controller.status(status)
        status = self.catchers.status(status, self.document, self.view)
        if status.is_finished and not self.nodes.is_complete(self.document):
            return replace(status, picture="refining")
        return status

    def picture_voided(self, notes: tuple[str, ...]) -> None:
        """Note that the picture on screen is void: the worker has another scene or another view."""
        before = self.metrics
        self.metrics = StatusMetrics(message_number=before.message_number, memory_mb=before.memory_mb)
        self.metrics.note(*notes)
        self.tables.scene_opened()

    def _follow_mode(self) -> list[PictureEvent]:
        """Switch to the mode that the view names, if it is another: the new controller gets the scene as if just
        opened."""
        if self.view.mode == self.mode.name:
            return []
        chosen = next((mode for mode in self.modes if mode.name == self.view.mode), None)
        if chosen is None:  # the session of a version with more modes
            self.view = replace(self.view, mode=self.mode.name)
            return []
        self.player.pause()
        self.controller.deactivated()
        self.mode, self.controller = chosen, import_named(chosen.controller)(self)
        self.metrics.progress = None
        return self.scenes.announce_scene(self.controller)

    def take_failure(self, response: RequestFailed) -> None:
        """Note that a request failed: its response will not come."""
        self.metrics.progress = None
        if any(each.receive_failure(response) for each in self._receivers):
            return
        self.exchange.cancel(response.id)
        self.nodes.receive_failure(response.id, response.line)
        self.catchers.receive_failure(response.id)
        self.controller.receive(response)
        self.scenes.take_failure(response)
        self.notify(response.line, True)

    def _open(self, opening: Opening) -> None:
        self.exchange.cancel()
        self.scenes.open(opening)

    def _autosave(self, now: float) -> None:
        problem = self.session.autosave(now)
        if problem and problem != self.metrics.message:
            self.notify(problem, True)

    def playback_stopped(self, before: Document) -> None:
        """Note that an animation stopped, at another time than that of the document `before`."""
        self.session.store.rebase_saved(before, self.document)
        self.document_changed()

    def document_changed(self, before: Document | None = None, command: EditCommand | None = None) -> None:
        """Notify all controllers of a changed document. before: the document that it was, to follow the selected
        operator; command: the user's, None where it changed without one."""
        self.scenes.add_files(files_of_document(self.document, before))
        self.controller.edited(command)
        self._show(follow_in_view(before or self.document, self.document, self.view))
        if isinstance(command, AddSun):
            self.select(sun_key(self.document.light.suns[-1].name))

    def _describe_step(self, step: Callable[[], str | None], what: str) -> str | None:
        before, label = self.document, step()
        self.controller.drag_ended()
        if label is not None:
            self.document_changed(before)
            self.notify(f"{what}: {label}")
        self.exchange.drag_ended()
        return label

    def _refuse(self, line: str) -> str:
        self.notify(line, True)
        return line
