"""The editor without a window: document, history and view on one side, the worker on the other.

    commands ─► History ─► Document ─┬─► Curves ─► coefficients wanted ─► renderer
                                     └─► Negotiator ─► requests ─► worker ─► answers ─► picture events ─► renderer

The window calls ``do`` with what panels ask for, ``tick`` once a frame, and gives the events it returns to the
renderer; ``report_rendering`` says what the renderer reached. Nothing here draws, waits, or raises for what a person
did: a refused command comes back as one line of text.
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from app.commands import EditCommand
from app.document import Document, Selection, document_from_description, resolve
from app.history import History
from app.jobs.messages import (
    Cancel,
    Failed,
    Footprint,
    LayerPicture,
    LayerTransport,
    OpenScene,
    Progress,
    Request,
    Response,
    SceneOpened,
    StageDone,
    WorkerRestarted,
)
from app.negotiator import Negotiator
from app.picture import (
    Array,
    Curves,
    FootprintChanged,
    LayerRadiance,
    PictureEvent,
    SceneFrame,
    TransportReady,
)
from app.status import PictureState, RenderReport, Status, resident_megabytes
from app.view_state import OpenPanel, SetView, ViewCommand, ViewState
from engine.errors import InsituError
from engine.scene.description import SceneDescription

__all__ = ["Editor", "RenderReport", "Status", "WorkerClient"]

POLL_SECONDS = 0.004
MEMORY_SECONDS = 1.0


class WorkerClient(Protocol):
    """What the editor needs of ``app.jobs.client.Client``."""

    @property
    def alive(self) -> bool: ...

    @property
    def pid(self) -> int | None: ...

    def send(self, request: Request) -> int: ...

    def poll(self, budget_s: float = ...) -> list[Response]: ...

    def close(self) -> None: ...


@dataclass(frozen=True)
class Opening:
    """A scene that the worker was asked to open."""

    id: int
    source: str


class Editor:
    """The controller of one window.

    client: the worker; source: the scene (or session) to open at once; resolution: (width, height) in place of the
    scene's own.
    """

    def __init__(self, client: WorkerClient, source: str, *, resolution: tuple[int, int] | None = None) -> None:
        self.history = History(Document(source))
        self.view = ViewState()
        self.curves = Curves()
        self.resolution = resolution
        self._client = client
        self._negotiator = Negotiator(client.send, self.curves)
        self._opening: Opening | None = None
        self._progress: Progress | None = None
        self._report = RenderReport()
        self._has_picture = False
        self._notes: tuple[str, ...] = ()
        self._transport_mb = 0.0
        self._memory_mb = 0.0
        self._memory_at = float("-inf")
        self._message = ""
        self._is_error = False
        self.open(source)

    # ------------------------------------------------------------------------------------------------------- document

    @property
    def document(self) -> Document:
        """The document as it is now."""
        return self.history.document

    @property
    def scene_is_open(self) -> bool:
        """Whether there is a scene to edit (the first one is still being loaded otherwise)."""
        return bool(self.document.objects)

    def do(self, command: EditCommand | ViewCommand, merge_key: str | None = None) -> str | None:
        """Carry out an edit or a change of view; None, or one line that says why it was refused.

        Consecutive edits with the same ``merge_key`` are one step of the history.
        """
        try:
            if isinstance(command, SetView | OpenPanel):
                self.view = command.apply(self.view)
            elif self.history.do(command, merge_key):
                self._document_changed()
        except (InsituError, ValueError) as error:
            return self._refuse(str(error))
        return None

    def begin_drag(self, label: str | None = None) -> None:
        """A hand took hold: all edits until ``end_drag`` are one step of the history."""
        self.history.begin_drag(label)

    def end_drag(self) -> None:
        """The hand let go; what waited for it to rest is asked for at the next tick."""
        if self.history.dragging:
            self.history.end_drag()
            self._negotiator.hand_released()

    def cancel_drag(self) -> None:
        """Take back the drag under way."""
        if self.history.dragging:
            self.history.cancel_drag()
            self._negotiator.hand_released()
            self._document_changed()

    def undo(self) -> str | None:
        """One step back; the label of what was undone, None when there was nothing."""
        return self._stepped(self.history.undo(), "undone")

    def redo(self) -> str | None:
        """One step forward; the label of what was redone, None when there was nothing."""
        return self._stepped(self.history.redo(), "redone")

    def select(self, path: str | Selection | None) -> str | None:
        """Select an object, layer or curve; of an object its last layer, of a layer its first curve.

        None, or one line that says why there is no such thing.
        """
        try:
            selected = None if path is None else self._selection(path)
        except InsituError as error:
            return self._refuse(str(error))
        if selected != self.view.selected:
            self.view = replace(self.view, selected=selected, operator=None, curve_zoom=None)
            self._report = replace(self._report, exact=False)
        return None

    def notify(self, text: str, is_error: bool = False) -> None:
        """Put one line into ``status.message``."""
        self._message, self._is_error = text, is_error

    # ---------------------------------------------------------------------------------------------------------- files

    def open(self, source: str) -> str | None:
        """Open a scene (built-in name or file); what is open stays until the new one is there."""
        source = _full_path(source)
        self._negotiator.scene_closed()
        self._opening = Opening(self._client.send(OpenScene(source, self.resolution)), source)
        self._progress = None
        return None

    def cancel_work(self) -> None:
        """Stop the worker; what it has delivered stays on screen."""
        self._client.send(Cancel())
        self._negotiator.cancelled()
        if self._opening is not None:
            self._opening = None
            self._negotiator.scene_opened(is_new=False)
        self._progress = None
        self.notify("stopped; the picture stays a preview until the light or a roughness changes")

    def resume_work(self) -> None:
        """Ask again for what was stopped or failed."""
        self._negotiator.resume()

    def close(self) -> None:
        """End the worker."""
        self._client.close()

    # -------------------------------------------------------------------------------------------------------- picture

    def tick(self, now: float | None = None) -> list[PictureEvent]:
        """Take the worker's answers and ask for what is missing; once a frame. ``now``: a steady clock, seconds."""
        now = time.monotonic() if now is None else now
        events: list[PictureEvent] = []
        for response in self._client.poll(POLL_SECONDS):
            events += self._take(response)
        if self.scene_is_open:
            self._negotiator.update(now, self.document, self.view.selected, self.view.n_lights, self.history.dragging)
        if now - self._memory_at >= MEMORY_SECONDS:
            self._memory_at = now
            self._memory_mb = resident_megabytes(os.getpid(), self._client.pid)
        return events

    def wanted_coefficients(self, key: str) -> dict[str, Array]:
        """Band values (J,3) of each transport factor of a layer, as the document has them."""
        return self.curves.coefficients(self.document, key)

    def layer_gain(self, key: str) -> Array:
        """f_q of a layer, (3,)."""
        return self.curves.gain(self.document, key)

    def view_curve(self, key: str) -> Array:
        """f_o of a layer at 256 angles θ_o from 0 to π/2, (256,3)."""
        return self.curves.view_curve(self.document, key)

    def report_rendering(self, report: RenderReport) -> None:
        """What the renderer reached in the frame just drawn, for the present document and selection."""
        self._report = report
        selected = self.view.selected
        if report.exact and selected is not None and selected.factor is not None:
            wanted = self.wanted_coefficients(selected.key)
            if selected.factor in wanted:
                self._negotiator.rendered(selected.key, selected.factor, wanted[selected.factor])

    @property
    def status(self) -> Status:
        """The truth about what is on screen."""
        progress = self._progress or Progress("", 0.0)
        return Status(
            worker_alive=self._client.alive,
            stage=progress.stage,
            fraction=progress.fraction,
            seconds_left=progress.seconds_left,
            text=progress.text,
            picture=self._picture_state(),
            shown_coefficients=self._report.shown_coefficients,
            wanted_coefficients=self._report.wanted_coefficients,
            image_error=self._report.image_error,
            frame_ms=self._report.frame_ms,
            memory_mb=self._memory_mb,
            transport_mb=self._transport_mb,
            light_note=self._light_note(),
            material_note=self._material_note(),
            message=self._message,
            is_error=self._is_error,
            notes=self._notes,
        )

    # -------------------------------------------------------------------------------------------------------- answers

    def _take(self, response: Response) -> list[PictureEvent]:
        """Note an answer; what of it the renderer needs."""
        match response:
            case SceneOpened():
                return self._take_scene(response)
            case Progress():
                self._progress = response
            case Failed():
                self._take_failure(response)
            case WorkerRestarted():
                self.notify(f"the worker was started again ({response.reason}); your edits are untouched", True)
            case _ if response.revision == self._negotiator.revision and self._opening is None:
                return self._take_picture(response)
        return []

    def _take_picture(self, response: Response) -> list[PictureEvent]:
        match response:
            case Footprint():
                return [FootprintChanged(response.rows, response.weights, response.stage)]
            case LayerPicture():
                made_with = self._negotiator.took_picture(response, self.document)
                self._has_picture = True
                self._report = replace(self._report, exact=False)
                return [LayerRadiance(response.key, response.stage, response.radiance, made_with)]
            case LayerTransport() if self._negotiator.took_transport(response, self.view.selected):
                self._report = replace(self._report, exact=False)
                return [_transport_ready(response)]
            case StageDone():
                self._take_stage(response)
        return []

    def _take_scene(self, response: SceneOpened) -> list[PictureEvent]:
        opening = self._opening
        if opening is None or response.id != opening.id:
            return []
        description = SceneDescription.model_validate_json(response.description)
        try:
            document = document_from_description(opening.source, description)
        except InsituError as error:
            self.notify(str(error), True)
            return []
        self._opening, self._progress = None, None
        self.history = History(document)
        self.view = replace(self.view, selected=None, hovered=None, compare=None, operator=None, curve_zoom=None)
        self._notes = response.notes
        self._has_picture = False
        self._report = RenderReport()
        self._negotiator.scene_opened()
        self.select(_first_choice(document))
        self.notify(f"opened {description.name}")
        return [SceneFrame(opening.source, description, response.arrays, response.notes)]

    def _take_failure(self, response: Failed) -> None:
        self._progress = None
        self._negotiator.took_failure(response)
        if self._opening is not None and response.id == self._opening.id:
            self._opening = None
            if self.scene_is_open:
                self._negotiator.scene_opened(is_new=False)
        self.notify(response.line, True)

    def _take_stage(self, response: StageDone) -> None:
        self._negotiator.took_stage(response)
        if response.transport_bytes:
            self._transport_mb = response.transport_bytes / 1e6
        if response.exact:
            self._progress = None

    # ----------------------------------------------------------------------------------------------------------- parts

    def _document_changed(self) -> None:
        self._report = replace(self._report, exact=False)
        selected = self.view.selected
        if selected is not None and selected.factor is not None:
            model = self.document.layer(selected.key).model
            names = [f.name for f in (*model.factors, model.view_factor) if f is not None]
            if selected.factor not in names:
                self.select(selected.key)

    def _stepped(self, label: str | None, what: str) -> str | None:
        self._negotiator.hand_released()
        if label is not None:
            self._document_changed()
            self.notify(f"{what}: {label}")
        return label

    def _refuse(self, line: str) -> str:
        self.notify(line, True)
        return line

    def _selection(self, path: str | Selection) -> Selection | None:
        target = resolve(self.document, path.path if isinstance(path, Selection) else path)
        if target.kind == "light":
            raise InsituError("the light cannot be selected; name an object, a layer or a curve")
        layers = self.document.object(target.object).layers
        if not layers:
            raise InsituError(f"{target.object} has no layers to edit")
        index = len(layers) - 1 if target.layer is None else target.layer
        factor = target.name if target.kind == "factor" else layers[index].model.factors[0].name
        return Selection(target.object, index, factor)

    def _picture_state(self) -> PictureState:
        if not self._has_picture:
            return "waiting"
        if self._opening is not None or self._negotiator.running or not self._negotiator.transport_is_current:
            return "preview"
        if not self._negotiator.delivered_final:
            return "preview"
        return "exact" if self._negotiator.finished and self._report.exact else "refining"

    def _light_note(self) -> str:
        talk = self._negotiator
        if not self._has_picture or talk.asked_rotation is None:
            return ""
        asked = f"{talk.asked_rotation:.1f}°"
        if talk.drag_quality:
            return f"quick picture for {asked}; the exact one follows when you let go"
        if not talk.light_is_current:
            return f"shown for {asked}; the new light follows when the hand rests"
        return f"being refined for {asked}" if talk.running else f"exact for {asked}"

    def _material_note(self) -> str:
        if not self._has_picture or self._negotiator.quotient_is_current:
            return ""
        return "the curve is shown at once; self-shadowing follows when the hand rests"


def _transport_ready(response: LayerTransport) -> TransportReady:
    return TransportReady(
        response.key,
        response.factor,
        response.stage,
        response.coefficients_first,
        response.norms,
        response.scale,
    )


def _first_choice(document: Document) -> str | None:
    """What is selected in a scene just opened: the first editable object's topmost layer."""
    with_layers = [state for state in document.objects if state.layers and not state.emits]
    editable = [state for state in with_layers if state.editable]
    return next((state.name for state in editable or with_layers), None)


def _full_path(source: str) -> str:
    """A file's absolute path; the name of a built-in scene as it is."""
    path = Path(source)
    return str(path.resolve()) if path.suffix or path.exists() else source
