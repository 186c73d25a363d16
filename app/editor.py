"""The editor without a window: document, history and view on one side, the worker on the other.

    commands ─► History ─► Document ─┬─► Curves ─► coefficients wanted ─► renderer
                                     └─► TransportTalk ─► requests ─► worker ─► answers ─► picture events ─► renderer

The window calls ``do`` with what panels ask for, ``tick`` once a frame, and gives the events it returns to the
renderer; ``report_rendering`` says what the renderer reached. Nothing here draws, waits, or raises for what a person
did: a refused command comes back as one line of text.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Protocol

from app.barrier import Barrier
from app.commands import EditCommand
from app.document import Document, Selection, layer_key
from app.history import History
from app.jobs.messages import (
    BandsPlanned,
    BouncesPlanned,
    Cancel,
    Failed,
    FilesWritten,
    Frozen,
    IndirectFound,
    IndirectNoise,
    LayerPicture,
    LayerTransport,
    MapsRefused,
    MapsSampled,
    MeasurementsRead,
    Noted,
    Progress,
    Request,
    Response,
    SceneOpened,
    SkyImage,
    StageDone,
    StageFootprint,
    TableHandedOut,
    WorkerRestarted,
    WriteFiles,
)
from app.journal import Journal, Recovery
from app.light_commands import lit_by
from app.material_commands import SetMaterial
from app.measurements import measured_files
from app.memory import require_memory_for
from app.opening import Opening
from app.paths import is_file_name, spoken_name
from app.picture import PictureEvent, SceneFrame, SkyChanged
from app.placement.band_plans import BandTalk
from app.placement.comparison import Comparison
from app.placement.curves import Array, Curves, drawn_as
from app.placement.edited_curves import edited_layers
from app.placement.events import Footprint, LayerRadiance, TransportReady
from app.placement.indirect_talk import IndirectTalk
from app.placement.known_light import KnownLight
from app.placement.map_talk import MapTalk
from app.placement.transport_talk import TransportTalk
from app.reading import Reading, describe_reading, import_measured
from app.selecting import first_choice, next_choice, next_operator, seen_layer, selection_of
from app.session import Session
from app.session_keeper import SessionKeeper
from app.status import Gauges, RenderReport, Status
from app.table_talk import TableTalk
from app.view_state import AS_PLANNED, OpenPanel, SetView, ViewCommand, ViewState
from engine.errors import InsituError
from engine.indirect.beyond import TOO_BRIGHT
from engine.scene.builtin import DEFAULT_SCENE
from engine.scene.description import SceneDescription

__all__ = ["Editor", "RenderReport", "Status", "WorkerClient"]

POLL_SECONDS = 0.004
STOPPED = "stopped; Resume in the Accuracy panel goes on, and so does another light or roughness"


class WorkerClient(Protocol):
    """What the editor needs of ``app.jobs.client.Client``."""

    @property
    def alive(self) -> bool: ...

    @property
    def pid(self) -> int | None: ...

    @property
    def arriving(self) -> bool: ...

    def send(self, request: Request) -> int: ...

    def poll(self, budget_s: float = ...) -> list[Response]: ...

    def close(self) -> None: ...


class Editor:
    """The controller of one window.

    client: the worker; source: the scene (or session) to open at once; resolution: (width, height) in place of the
    scene's own; journal: where unsaved edits are kept, None for nowhere (pictures without a person);
    curves: how many bands each curve gets, None for as many as planned; barrier: what holds back faults in a frame,
    None for one that lets them through.
    """

    def __init__(
        self,
        client: WorkerClient,
        source: str,
        *,
        resolution: tuple[int, int] | None = None,
        journal: Journal | None = None,
        curves: Curves | None = None,
        barrier: Barrier | None = None,
    ) -> None:
        self.barrier = barrier or Barrier()
        self.barrier.tell = partial(self.notify, is_error=True)
        self.history = History(Document(source))
        self.view = self._view_before_drag = ViewState()
        self.curves = curves or Curves()
        self.resolution = resolution
        self.own_resolution = (0, 0)
        self._client = client
        self._keeper = SessionKeeper(journal)
        self._bands = BandTalk(client.send, self.curves.plans)
        self._negotiator = TransportTalk(client.send, self.curves)
        self._indirect = IndirectTalk(client.send, self.curves)
        self._told_beyond = False
        self._maps = MapTalk(client.send, self.curves)
        self._comparison = Comparison(client.send, self.curves, self._maps.samples)
        self._known_light = KnownLight()
        self._reading = Reading(client.send)
        self._tables = TableTalk(client.send)
        self._opening: Opening | None = None
        self._given_up: Opening | None = None
        self._cancelled = -1
        self._scene_id = 0
        self._footprints: dict[str, Footprint] = {}
        self._gauges = Gauges()
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
        before = self.document
        try:
            if isinstance(command, SetView | OpenPanel):
                self.view = command.apply(self.view)
            elif self._reading.postpones(command, self.document):
                return None
            elif self.history.do(command, merge_key):
                if isinstance(command, SetMaterial):
                    self.curves.plans.replan(layer_key(command.object, index) for index in range(len(command.layers)))
                self._document_changed(before)
                if isinstance(command, SetMaterial) and self.view.selected is not None:
                    self.select(self.view.selected.object)  # its layers are others
        except (InsituError, ValueError) as error:
            return self._refuse(str(error))
        return None

    def begin_drag(self, label: str | None = None) -> None:
        """A hand took hold: all edits until ``end_drag`` are one step of the history."""
        if not self.history.dragging:
            self._view_before_drag = self.view
        self.history.begin_drag(label)

    def end_drag(self) -> None:
        """The hand let go; what waited for it to rest is asked for at the next tick."""
        if self.history.dragging:
            self.history.end_drag()
            self._negotiator.hand_released()

    def cancel_drag(self) -> None:
        """Take back the drag under way; the curve's handles stand for the operator that they stood for before it."""
        if self.history.dragging:
            self.history.cancel_drag()
            before = self._view_before_drag
            self.view = replace(self.view, operator=before.operator, regions=before.regions)
            self._negotiator.hand_released()
            self._document_changed()

    def undo(self) -> str | None:
        """One step back; the label of what was undone, None when there was nothing."""
        return self._stepped(self.history.undo, "undone")

    def redo(self) -> str | None:
        """One step forward; the label of what was redone, None when there was nothing."""
        return self._stepped(self.history.redo, "redone")

    def select(self, path: str | Selection | None) -> str | None:
        """Select an object, layer or curve; of an object its last layer, of a layer its first curve.

        None, or one line that says why there is no such thing.
        """
        try:
            selected = None if path is None else selection_of(self.document, path)
        except InsituError as error:
            return self._refuse(str(error))
        if selected != self.view.selected:
            self.view = replace(self.view, selected=selected, operator=None, curve_zoom=None)
            self._gauges.picture_changed()
            self._negotiator.edited()
            self._indirect.edited()
        return None

    def notify(self, text: str, is_error: bool = False) -> None:
        """Put one line into ``status.message``."""
        self._gauges.notify(text, is_error)

    # ---------------------------------------------------------------------------------------------------------- files

    @property
    def unsaved(self) -> bool:
        """Whether there are edits that no session file has."""
        return self.scene_is_open and self._keeper.unsaved(self.document)

    @property
    def session_path(self) -> Path | None:
        """Where the session was saved last, or opened from."""
        return self._keeper.path

    def open(self, source: str) -> str | None:
        """Open a scene (built-in name or file) or a session; what is open stays until the new one is there.

        None, or one line that says why it cannot be opened.
        """
        try:
            opening = Opening.of(source)
        except InsituError as error:
            self._open_default(str(error))
            return self._refuse(str(error))
        self._open(opening)
        return None

    def save(self, path: Path | None = None) -> str | None:
        """Save the session, to ``path`` or where it was saved last; None, or one line that says why not."""
        try:
            path = self._keeper.save(path, self.document, self.view)
        except InsituError as error:
            return self._refuse(str(error))
        self.notify(f"saved {path}")
        return None

    @property
    def file(self) -> Path | None:
        """The session or the scene's file that a person would open to come back here; None of a built-in scene."""
        source = self.document.source
        return self.session_path or (Path(source) if self.scene_is_open and is_file_name(source) else None)

    @property
    def name(self) -> str:
        """What a person calls what is open."""
        return spoken_name(str(self.session_path or self.document.source))

    def give_up_unsaved(self) -> None:
        """Keep what is unsaved neither in a session nor in the journal; undo still has it."""
        self._keeper.give_up(self.document)

    def resize(self, resolution: tuple[int, int] | None) -> str | None:
        """Show the scene that is open at another resolution (None: its own), with all edits; None, or why not."""
        try:
            if resolution is not None:
                require_memory_for(resolution, "choose fewer")
        except InsituError as error:
            return self._refuse(str(error))
        view = replace(self.view, resolution=None if resolution == self.own_resolution else resolution)
        self._open(Opening.of_resolution(self.document, view))
        return None

    def recover(self, recovery: Recovery) -> str | None:
        """Open what an editor that ended early left behind; None, or one line that says why it cannot be."""
        try:
            opening = Opening.of_recovery(recovery)
        except InsituError as error:
            return self._refuse(str(error))
        self._open(opening)
        return None

    def close(self) -> None:
        """End the worker; what is unsaved stays in the journal, to be offered at the next start."""
        self._client.close()
        self._keeper.close(self.document, self.view)

    def cancel_work(self) -> None:
        """Stop the worker; what it has delivered stays on screen, until `resume_work` or another light or roughness."""
        self._cancelled = self._client.send(Cancel())
        self._negotiator.cancelled()
        self._reading.forget()
        self._given_up, self._opening = self._opening, None
        if self._given_up is not None:
            self._negotiator.scene_opened(is_new=False)
        self._gauges.progress = None
        self._gauges.stopped = not self.status.is_finished
        self.notify(STOPPED if self._gauges.stopped else "stopped")

    def import_measured(self, path: Path, cloth: bool = False) -> str | None:
        """Make the selected object of what a file measured, once the worker has read it, of two layers or as `cloth` of
        one; None, or why not."""
        if self.view.selected is None:
            return self._refuse(f"{path.name}: no object is selected to be made of it")
        return self.do(import_measured(self.view.selected.object, path, cloth))

    def export_measured(self, path: Path) -> str | None:
        """Have the selected object's material written as a MERL file; None, or one line that says why not."""
        if seen_layer(self.document, self.view.selected) is None or self.view.selected is None:
            return self._refuse(f"{path.name}: no object is selected whose material could be written")
        layers = self.document.object(self.view.selected.object).layers
        self._client.send(WriteFiles(str(path.resolve()), layers, measured_files(self.document)))
        return None

    def export_scene(self, folder: Path) -> str | None:
        """Have the scene written for Mitsuba 3, as it is now; None, or one line that says why not."""
        if not self.scene_is_open:
            return self._refuse(f"{folder.name}: no scene is open that could be written")
        bounces = max(self.view.n_bounces, 1)
        self._client.send(WriteFiles(str(folder.resolve()), (), measured_files(self.document), self.document, bounces))
        return None

    @property
    def is_reading(self) -> bool:
        """Whether an edit waits for a file that the worker reads."""
        return self._reading.is_under_way

    def resume_work(self) -> None:
        """Ask again for what was stopped or failed: the picture, or where none is open yet the scene."""
        self._gauges.stopped = False
        if self._given_up is not None and not self.scene_is_open:
            self._open(self._given_up)
        else:
            self._negotiator.resume()

    # -------------------------------------------------------------------------------------------------------- picture

    def tick(self, now: float | None = None) -> list[PictureEvent]:
        """Take the worker's answers and ask for what is missing; once a frame. ``now``: a steady clock, seconds."""
        now = time.monotonic() if now is None else now
        events: list[PictureEvent] = []
        run, none, silence = self.barrier.run, events, list[Response]()
        for response in run("The talk with the worker", partial(self._client.poll, POLL_SECONDS), silence, ()):
            events = events + run("An answer of the worker", partial(self._take, response), none)
        if self.scene_is_open:
            made_of = self.document, self.view
            events = events + run("What follows an edit", partial(self._ask, now), none, made_of)
            events = events + run("Side A", partial(self._compare, now), none, made_of)
            run("The journal", partial(self._keep, now), None, made_of)
        self._gauges.stopped &= not (self._negotiator.running or self.status.is_finished)
        self._gauges.measure_memory(now, self._client.pid)
        return events

    def _ask(self, now: float) -> list[PictureEvent]:
        """Ask for what is missing; how indirect light and images have changed."""
        view, talk, document = self.view, self._negotiator, self.document
        planned = self._bands.update(document)
        talk.update(
            now, document, view.selected, view.n_lights, self.history.dragging, view.precision, view.n_bounces, planned
        )
        events: list[PictureEvent] = [*self._maps.update(document)]
        if planned and not talk.drag_quality:
            events += self._indirect.update(
                now, document, view.selected, view.n_bounces, view.second_bands, talk.revision
            )
            if self._indirect.is_beyond and not self._told_beyond:
                self.notify(TOO_BRIGHT, True)
            self._told_beyond = self._indirect.is_beyond
        return events

    def _compare(self, now: float) -> list[PictureEvent]:
        """Side A as it is chosen, and brought up to date."""
        exact, view = self.status.is_finished, self.view
        if view.compare is not self._comparison.document:
            self._comparison.begin(view.compare, exact and view.compare is self.document)
        return self._comparison.update(
            now, self.document, self._negotiator, view.n_lights, exact, self._indirect.is_shown
        )

    @property
    def indirect_light(self) -> IndirectTalk:
        """What is known and shown of the indirect light."""
        return self._indirect

    @property
    def maps(self) -> MapTalk:
        """What is known and shown of textures and weight maps."""
        return self._maps

    @property
    def tables(self) -> TableTalk:
        """The samples of measurements, which the BRDF panel shows."""
        return self._tables

    def reload_images(self, key: str) -> None:
        """Read the images of a layer again, where they have been painted on in another program."""
        self._maps.reload(key, self.document.layer(key).maps)
        self._gauges.picture_changed()

    @property
    def awaits_curve(self) -> bool:
        """Whether a curve's transport, a layer's picture or frozen light is to come at any moment."""
        return self._negotiator.awaits_contraction or self._indirect.awaits_frozen

    @property
    def answer_arrives(self) -> bool:
        """Whether an answer is here but for a check that goes on with the next `tick`: there is no need to wait."""
        return self._client.arriving

    def wanted_coefficients(self, key: str) -> dict[str, Array]:
        """Band values (J,3) of each transport factor of a layer, as the document has them."""
        return self.curves.coefficients(self.document, key)

    @property
    def edited_layers(self) -> tuple[str, ...]:
        """Keys of the layers that follow the selected curve, the selected one first; none of a fixed object."""
        return edited_layers(self.document, self.view.selected)

    def drawn_as(self, key: str) -> tuple[object, ...]:
        """What f_q and the curves of a layer belong to: a picture of another one is not to be drawn with them."""
        layer = self.document.layer(key)
        return drawn_as(layer.model.name, layer.quotient_parameters().tolist())

    def layer_gain(self, key: str) -> Array:
        """What a layer's picture is multiplied by, (3,): f_q, and how much brighter the only light has become."""
        return self.curves.gain(self.document, key) * self._negotiator.light_gain

    def view_curve(self, key: str) -> Array:
        """f_o of a layer at 256 angles θ_o from 0 to π/2, (256,3)."""
        return self.curves.view_curve(self.document, key)

    def report_rendering(self, report: RenderReport) -> None:
        """What the renderer reached in the frame just drawn, for the present document and selection."""
        self._gauges.report = report
        factor = None if self.view.selected is None else self.view.selected.factor
        for key in self.edited_layers if report.exact else ():
            wanted = self.wanted_coefficients(key)
            if factor in wanted:
                self._negotiator.rendered(key, factor, wanted[factor])

    @property
    def status(self) -> Status:
        """The truth about what is on screen."""
        status = self._gauges.status(
            self._negotiator, self._client.alive, self._opening is not None, self.view.precision,
            self._indirect.is_complete and self._maps.is_complete,
            self._indirect.noise_of_picture(self._gauges.report.mean_radiance),
        )  # fmt: skip
        n_bounces, note = self._gauges.bounces
        return replace(
            status, compared_exact=self._comparison.exact, indirect_noise=self._indirect.noise,
            bounces_note=note if n_bounces == self.view.n_bounces else "",
        )  # fmt: skip

    # -------------------------------------------------------------------------------------------------------- answers

    def _take(self, response: Response) -> list[PictureEvent]:
        """Note an answer; what of it the renderer needs."""
        match response:
            case SceneOpened():
                return self._take_scene(response)
            case Progress():
                if response.id > self._cancelled:  # else it was on its way when the work was stopped
                    self._gauges.progress = response
            case Failed():
                self._take_failure(response)
            case MeasurementsRead():
                self._take_measurements(response)
            case BandsPlanned():
                self._bands.took(response)
            case TableHandedOut():
                self._gauges.progress = None
                self._tables.took(response)
            case FilesWritten():
                self._gauges.progress = None
                self.notify("; ".join((f"written {response.path}", *response.notes)))
            case MapsSampled() if self._opening is None:
                self._maps.took(response)
                self._say_once(response.note)
                self._indirect.means_changed()
                self._gauges.picture_changed()
            case MapsRefused() if self._opening is None:
                if self._maps.refuse(response, self.history):
                    self._document_changed()
                self.notify(response.line, True)
            case Noted():
                self._gauges.notes += response.lines
                self.notify("; ".join(response.lines), True)
            case SkyImage() if response.id == self._scene_id:
                self._gauges.notes += response.notes
                return [SkyChanged(response.radiance)]
            case StageFootprint() if response.id == self._scene_id:
                self._footprints.setdefault(response.stage, Footprint(response.rows, response.weights))
            case IndirectFound() if response.id == self._scene_id:
                self._indirect.took_found(response)
            case IndirectNoise() if response.id == self._scene_id:
                self._indirect.took_noise(response)
            case WorkerRestarted():
                self._negotiator.worker_restarted()
                self._indirect.worker_restarted()
                self._comparison.worker_restarted()
                self.notify(
                    f"computing stopped ({response.reason}) and was started again; your edits are untouched", True
                )
            case _ if response.revision == self._negotiator.revision and self._opening is None:
                return self._take_picture(response)
        return []

    def _take_picture(self, response: Response) -> list[PictureEvent]:
        match response:
            case BouncesPlanned() if self.view.n_bounces in (AS_PLANNED, response.n_bounces):
                self._take_bounces(response)  # else a person has chosen meanwhile
            case Frozen():
                self._indirect.took_frozen(response)
            case LayerPicture() if self._comparison.took(response):
                return []
            case LayerPicture():
                if self._negotiator.asked_light is not None:
                    self._known_light.worked(self._negotiator.asked_light)
                made_with = self._negotiator.took_picture(response)
                self._gauges.has_picture = True
                self._gauges.picture_changed()
                footprint = self._footprints.get(response.stage)
                look = self._negotiator.drawn_as(response.key)
                return [LayerRadiance(response.key, response.stage, response.radiance, made_with, footprint, look)]
            case LayerTransport() if self._negotiator.took_transport(response, self.document, self.view.selected):
                self._gauges.picture_changed()
                return [_transport_ready(response, self.edited_layers, self._footprints.get(response.stage))]
            case StageDone():
                self._take_stage(response)
        return []

    def _take_bounces(self, response: BouncesPlanned) -> None:
        if self.view.n_bounces == AS_PLANNED:
            self.view = replace(self.view, n_bounces=response.n_bounces)
            self._negotiator.took_bounces(response.n_bounces)
        if response.warning and response.warning != self.status.bounces_note:
            self.notify(response.warning)
        self._gauges.bounces = response.n_bounces, response.warning

    def _say_once(self, note: str) -> None:
        """What is worth a word when it first comes up in a scene."""
        if note and note not in self._gauges.notes:
            self._gauges.notes += (note,)
            self.notify(note)

    def _take_scene(self, response: SceneOpened) -> list[PictureEvent]:
        opening = self._opening
        if opening is None or response.id != opening.id:
            return []
        description = SceneDescription.model_validate_json(response.description)
        try:
            document = opening.document(description, response)
        except InsituError as error:
            self._take_failure(Failed(str(error), id=response.id))
            return []
        frame = SceneFrame(opening.source, description, response.arrays, response.notes)
        if opening.resizes:
            self._take_resolution(opening, description, document, response)
            return [frame]
        left_unsaved = self._keeper.leave(self.document, self.view)
        self._forget_scene(description, response)
        self._known_light = KnownLight()
        self.own_resolution = description.camera.resolution
        self.view = replace(
            self.view, selected=None, hovered=None, compare=None, operator=None, curve_zoom=None, solo=None,
            lobe_pixel=None, resolution=None,
            n_bounces=description.bounces or AS_PLANNED,
        )  # fmt: skip
        self.history = History(document)
        self.curves.opened(dict(document.layers()), response.bands)
        self._keeper.opened(document)
        self.select(first_choice(document))
        kept = "; the unsaved edits before it can be recovered at the next start" if left_unsaved else ""
        said = opening.instead_of or f"opened {description.name}{kept}"
        self.notify("; ".join((said, *response.notes)), bool(opening.instead_of))
        if opening.session is not None:
            self._restore(opening, opening.session, response)
        if opening.light is not None:
            self._known_light.worked(document.light)
            self.do(lit_by(opening.light))
        return [frame]

    def _forget_scene(self, description: SceneDescription, opened: SceneOpened) -> None:
        """What is known of the picture is void: the worker has opened another, or the same at another resolution."""
        self._opening, self._scene_id, self._footprints = None, opened.id, {}
        gauges = self._gauges
        self._gauges = Gauges(message_number=gauges.message_number, notes=opened.notes, memory_mb=gauges.memory_mb)
        self._negotiator.scene_opened(has_sky=description.environment is not None)
        self._indirect.scene_opened()
        self._maps.scene_opened()
        self._tables.scene_opened()

    def _take_resolution(
        self, opening: Opening, description: SceneDescription, scene: Document, opened: SceneOpened
    ) -> None:
        """The picture has another size: document, history and what is selected stay as they are."""
        assert opening.session is not None
        self._forget_scene(description, opened)
        self._learn_bands(scene, self.document, opened)
        resolution = opening.session.view.resolution
        self.view = replace(self.view, hovered=None, compare=None, lobe_pixel=None, resolution=resolution)
        self._document_changed()
        width, height = resolution or self.own_resolution
        self.notify(f"the picture has {width} x {height} pixels")

    def _learn_bands(self, scene: Document, document: Document, opened: SceneOpened) -> None:
        """What the worker has planned, of the scene's layers as far as the document has them and of the document's."""
        described = dict(scene.layers())
        unchanged = {key: layer for key, layer in document.layers() if layer == described.get(key)}
        self.curves.opened(unchanged, opened.bands)
        for layer, bands in opened.planned:
            self.curves.plans.learn(layer, bands)

    def _restore(self, opening: Opening, session: Session, opened: SceneOpened) -> None:
        """Put a session's document and view in the place of the scene's, where they fit."""
        try:
            document = opening.restored(session, self.document, opened)
        except InsituError as error:
            self.notify(f"opened the scene without its session: {error}", True)
            return
        self._learn_bands(self.document, document, opened)
        self.history = History(document)
        selected = session.view.selected or self.view.selected
        self.view = replace(session.view, selected=selected, panels=self.view.panels)
        self._keeper.opened(document, opening.session_path, opening.recovery)
        self.notify("recovered what was not saved" if opening.recovery else f"opened {opening.file}")

    def _take_measurements(self, response: MeasurementsRead) -> None:
        """Carry out the edit that waited for them."""
        self._gauges.progress = None
        command = self._reading.took(response)
        for layer, bands in zip(() if command is None else command.layers, response.bands, strict=False):
            self.curves.plans.learn(layer, bands)
        if command is not None and self.do(command) is None:
            self.select(command.object)
            self.notify(describe_reading(command.layers))

    def _take_failure(self, response: Failed) -> None:
        self._gauges.progress = None
        if self._tables.took_failure(response):
            return
        self._reading.forget(response.id)
        self._bands.took_failure(response)
        self._negotiator.took_failure(response)
        self._comparison.took_failure(response.id)
        self._maps.took_failure(response.id)
        refused = self._negotiator.asked_light if self._negotiator.is_transport(response.id) else None
        if refused is not None and self._known_light.go_back(self.history, refused):
            self._document_changed()
        opening = self._opening
        if opening is not None and response.id == opening.id:
            self._opening = None
            if self.scene_is_open:
                self._negotiator.scene_opened(is_new=False)
            elif opening.source != DEFAULT_SCENE:
                self._open_default(response.line)
        self.notify(response.line, True)

    def _take_stage(self, response: StageDone) -> None:
        self._negotiator.took_stage(response)
        self._comparison.stage_came()
        if response.transport_bytes:
            self._gauges.transport_mb = response.transport_bytes / 1e6
        if response.exact:
            self._gauges.progress = None

    # ----------------------------------------------------------------------------------------------------------- parts

    def _open(self, opening: Opening) -> None:
        self._negotiator.scene_closed()
        id = self._client.send(opening.request(self.resolution))
        self._reading.forget()
        self._opening = replace(opening, id=id)
        self._gauges.progress = None

    def _open_default(self, why: str) -> None:
        """Where nothing is open, so that the window is of use: the built-in scene, and why it is that one."""
        if not self.scene_is_open and self._opening is None:
            self._open(Opening.of(DEFAULT_SCENE, f"{why} - the built-in {DEFAULT_SCENE} is open instead"))

    def _keep(self, now: float) -> None:
        problem = self._keeper.keep(now, self.document, self.view)
        if problem and problem != self._gauges.message:
            self.notify(problem, True)

    def _document_changed(self, before: Document | None = None) -> None:
        """Whoever compares is told. before: what it was, where the selected operator is to be followed."""
        self._gauges.picture_changed()
        self._negotiator.edited()
        self._indirect.edited()
        self._maps.edited()
        selected = self.view.selected
        if selected is not None and (choice := next_choice(self.document, selected)) != selected:
            self.select(choice)
        elif before is not None:
            operator = next_operator(before, self.document, selected, self.view.operator)
            self.view = replace(self.view, operator=operator)

    def _stepped(self, step: Callable[[], str | None], what: str) -> str | None:
        before, label = self.document, step()
        self._negotiator.hand_released()
        if label is not None:
            self._document_changed(before)
            self.notify(f"{what}: {label}")
        return label

    def _refuse(self, line: str) -> str:
        self.notify(line, True)
        return line


def _transport_ready(response: LayerTransport, beside: tuple[str, ...], footprint: Footprint | None) -> TransportReady:
    return TransportReady(
        response.key,
        response.factor,
        response.stage,
        response.coefficients_first,
        response.norms,
        response.scale,
        beside,
        footprint,
    )
