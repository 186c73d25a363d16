"""Placement in the window's process: its controllers joined to one.

    document ─┬─► Curves ─► desired coefficients ─► renderer
              └─► transport, indirect light, images, side A ─► requests ─► worker ─► responses ─► picture events

Each of them compares what the document and the view desire with what was requested and has come (see
`transport_controller`); this joins them, and `picture_summary` sums them up in the status.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial

from app.document.commands import EditCommand
from app.document.commands.layers import SetMaterial, SetVariant
from app.document.document import Document, ObjectState
from app.document.effective_settings import effective_view
from app.document.view_state import SetView, ViewState
from app.messages.editor_status import Status
from app.messages.picture_events import PictureEvent, SkyChanged
from app.messages.worker_messages import CancelRequests, RequestFailed, Response
from app.modes.mode import EditorServices, ModeController, OpenedScene
from app.modes.placement.accepted_light import AcceptedLight
from app.modes.placement.band_plans import BandController, BandPlans
from app.modes.placement.comparison import Comparison
from app.modes.placement.curves import Curves
from app.modes.placement.drawn_picture import DrawnPicture
from app.modes.placement.highlight_controller import HighlightController
from app.modes.placement.idle_work import IdleWork
from app.modes.placement.indirect_controller import IndirectController
from app.modes.placement.inverse_messages import CurvesFitted
from app.modes.placement.map_controller import MapController
from app.modes.placement.moved_lamps import lamps_elsewhere, moved_lamps
from app.modes.placement.picture_summary import PictureSummary
from app.modes.placement.picture_transition import PictureTransition, RequestedTransport
from app.modes.placement.placement_events import (
    DocumentDrawn,
    Footprint,
    LayerRadiance,
    TransportReady,
    group_events,
)
from app.modes.placement.placement_messages import (
    BandsPlanned,
    BouncesPlanned,
    ComputeTransport,
    EditedSampled,
    ErrorEstimated,
    FreezingProgress,
    IndirectFound,
    IndirectFrozen,
    IndirectImproved,
    IndirectNoise,
    IndirectRelit,
    LayerPicture,
    LayerTransport,
    LightPlanned,
    LightsReady,
    MapsRefused,
    MapsSampled,
    PlanBands,
    RelightingPrepared,
    SampleMaps,
    SamplingProgress,
    StageDone,
    StageFootprint,
)
from app.modes.placement.placement_status import PlacementReport, PlacementStatus, RenderReport
from app.modes.placement.transport_controller import TransportController
from engine.core.clamping import TOO_BRIGHT
from engine.material.layer import Layer, object_of
from engine.realtime.zonal_harmonics.pose import Poses
from engine.settings import AS_PLANNED


class PlacementController(ModeController):
    """The controller of Placement. curves: how many bands each curve gets, None for as many as planned. picture: what
    the renderer draws."""

    def __init__(self, services: EditorServices, curves: Curves | None = None) -> None:
        self.curves = curves or Curves(plans=services.shared_state(BandPlans))
        self._services = services
        self._bands = BandController(services.send, self.curves.plans)
        self._transport = TransportController(services.send, self.curves)
        self.indirect = IndirectController(services.send, self.curves)
        self.maps = MapController(services.send, self.curves)
        self._comparison = Comparison(services.send, self.curves, self.maps.samples)
        self.idle = IdleWork(services.send, self.curves)
        self._highlights = HighlightController(services, self.curves)
        self._changeover = PictureTransition(self.curves)
        self.picture = DrawnPicture(services, self.curves, self._changeover, self.indirect, self.maps)
        self._summary = PictureSummary(
            self.curves,
            self._transport,
            self.indirect,
            self.maps,
            self._changeover,
            self.picture,
            self.idle,
            self._comparison,
        )
        self._warned_clamped = False
        self._forget()

    def _forget(self) -> None:
        """Forget the picture."""
        self._view_id = 0
        self._highlights.forget()
        self._footprints: dict[str, Footprint] = {}
        self._accepted_light = AcceptedLight()
        self._summary.report = PlacementReport()
        self._was_held = False
        self._poses: Poses = ()

    # --------------------------------------------------------------------------------------------- events of the editor

    def scene_closed(self) -> None:
        self._transport.scene_closed()
        self.idle.scene_closed()

    def scene_open_failed(self) -> None:
        self._transport.scene_opened(is_new=False)
        self.indirect.lose_request()
        self.maps.lose_request()

    def view_moved(self) -> None:
        # The light of lamps that a hand has follows in the view before.
        if not (self._services.history.dragging and moved_lamps(self._document, self._poses)):
            self.scene_closed()

    def view_requested(self) -> None:
        self.scene_closed()

    def view_restored(self) -> None:
        self.scene_open_failed()

    def view_traced(self, scene: OpenedScene) -> None:
        self.scene_opened(scene)

    def scene_opened(self, scene: OpenedScene) -> None:
        self._forget()
        self._view_id, self._poses = scene.view_id, scene.poses
        self._transport.scene_opened(has_sky=scene.description.environment is not None)
        self.indirect.scene_opened()
        self.maps.scene_opened()
        self.idle.scene_opened()
        self._accepted_light.accept(scene.described.light)
        self.curves.scene_opened(scene.description)
        self._changeover.scene_opened(scene.document, scene.description.environment is not None)
        self.add_band_plans(scene.planned)

    def deactivated(self) -> None:
        self._services.send(CancelRequests(of=(ComputeTransport, SampleMaps, PlanBands)))

    def add_band_plans(self, planned: Iterable[tuple[Layer, Mapping[str, int]]]) -> None:
        for layer, bands in planned:
            self.curves.plans.add_plan(layer, bands)

    def edited(self, command: EditCommand | None = None) -> None:
        self._highlights.edited(command)
        if isinstance(command, SetMaterial | SetVariant):
            changed = command.objects(self._document) if isinstance(command, SetVariant) else (command.object,)
            self.curves.plans.replan(key for key, _ in self._document.layers() if object_of(key) in changed)
            self._transport.hand_released()  # chosen, and not on its way to something else
        self._summary.report.picture_changed()
        self._transport.edited()
        self.indirect.edited()
        self.maps.edited()

    def drag_ended(self) -> None:
        self._transport.hand_released()

    def reload_images(self, key: str) -> None:
        chosen = self._document.layer(key)
        for each, layer in self._document.layers():
            if each == key or (object_of(each) == object_of(key) and layer.node_of == chosen.name):
                self.maps.reload(each, layer.maps)
        self._summary.report.picture_changed()
        self.idle.images_changed()

    def cancelled(self) -> None:
        self._transport.cancelled()
        self.indirect.cancelled()
        self.idle.cancelled()

    def resume(self) -> None:
        self._transport.resume()

    def worker_restarted(self) -> None:
        self._transport.worker_restarted()
        self.indirect.worker_restarted()
        self.idle.worker_restarted()
        self._highlights.forget()
        self._comparison.worker_restarted()

    @property
    def _document(self) -> Document:
        return self._services.pictured

    @property
    def _view(self) -> ViewState:
        """The view with the document's overrides in place of its own settings."""
        return effective_view(self._services.pictured_view, self._document)

    # ------------------------------------------------------------------------------------------------------- requesting

    def update(self, now: float, document: Document, view: ViewState) -> list[PictureEvent]:
        compare = partial(self._compare, now, document, view)
        none: list[PictureEvent] = []
        events: list[PictureEvent] = []
        if self._transport.drag_quality:  # what has come is shown before the next request makes it void
            events += self._advance_transition(document, view, True)
        planned = self._request_missing(now, document, view)
        events += self._advance_transition(document, view, planned)
        state = self._summary.state
        # Errors, rays and other skies are those of light in place.
        rests = state in ("finished", "exact") and not self._services.history.dragging
        rests &= view.settings.lighting == "scene"
        lacks_rays = self.indirect.lacks_rays and state != "exact"
        self.idle.update(now, document, view, self._transport.revision, rests, lacks_rays)
        self._highlights.update(self._transport.revision)
        return events + self._services.barrier.run("Side A", compare, none, (document, view))

    def _request_missing(self, now: float, document: Document, view: ViewState) -> bool:
        """Request what is missing; returns whether the bands of all layers are known."""
        controller, revision = self._transport, self._transport.revision
        planned = self._bands.update(document)
        settings = view.settings.of_light
        # A light that the worker is prepared for is mixed at once, dragged or not.
        dragging = self._services.history.dragging or self.idle.relight.mixes(document)
        is_fine = self._changeover.is_fine
        lamps = moved_lamps(document, self._poses)
        controller.update(
            now, document, view.selected, settings, dragging, view.settings.precision, planned, is_fine, lamps
        )
        if controller.revision != revision:
            self._changeover.transport_requested(controller.received)
        self.maps.request_missing(document, controller.is_open)
        if planned and not controller.drag_quality:
            n_bounces, second_bands = view.settings.n_bounces, view.settings.second_bands
            self.indirect.request_missing(
                now, document, view.selected, n_bounces, second_bands, controller.revision, controller.is_open
            )
        return planned

    def _advance_transition(self, document: Document, view: ViewState, planned: bool) -> list[PictureEvent]:
        """Replace what can be replaced in the picture now, all of it in one frame; returns the events."""
        controller, change, was_held = self._transport, self._changeover, self._was_held
        requested, dragging = self._requested_transport() if planned else None, self._services.history.dragging
        changes = change.update(document, requested, dragging, self.picture.edited_layers, self.picture.factor)
        if changes:
            self._summary.report.picture_changed()
        self._was_held = change.drawn is not document
        if not change.waits if controller.drag_quality else self._was_held and changes:
            changes += self.indirect.follow_light(change.drawn, controller.revision)
        if self._was_held:
            return group_events(changes)
        events = self.maps.follow(document)
        if planned and not controller.drag_quality:
            changes += self.indirect.follow(document, controller.revision if controller.light_is_current else None)
            if self.indirect.picture.is_clamped and not self._warned_clamped:
                self._services.notify(TOO_BRIGHT, True)
            self._warned_clamped = self.indirect.picture.is_clamped
        if was_held and not (changes or events):
            changes.append(DocumentDrawn())
        return group_events([*changes, *events]) if changes else [*events]

    def _requested_transport(self) -> RequestedTransport | None:
        """The transport requested last, and what else has come of the document."""
        controller = self._transport
        if controller.requested is None or not controller.is_open:
            return None
        desired, document = controller.requested
        if controller.drag_quality:  # direct and indirect light of one angle appear together
            has_rest = not (controller.running and self.indirect.awaits_relit(controller.revision))
            return RequestedTransport(desired, document, True, False, has_rest, controller.finished)
        has_rest = self.maps.is_complete and not self.indirect.is_outdated(
            controller.revision if controller.running else None
        )
        if controller.running and not self._changeover.has_picture and self._view.settings.n_bounces != 1:
            # A first picture without indirect light would have black metal.
            has_rest = has_rest and controller.has_stage and not self.indirect.is_pending
        return RequestedTransport(desired, document, False, controller.delivered_final, has_rest, controller.finished)

    def _compare(self, now: float, document: Document, view: ViewState) -> list[PictureEvent]:
        """Follow the choice of side A, and refine its picture; returns the events."""
        exact = self._summary.state in ("finished", "exact")
        compared = None if view.compare is None else self._services.with_nodes(view.compare)
        if compared is not self._comparison.document:
            self._comparison.begin(compared, exact and compared is document)
        settings = view.settings.of_light
        return self._comparison.update(now, document, self._transport, settings, exact, self.indirect.picture.is_shown)

    @property
    def follows_objects(self) -> bool:
        # Of lamps alone, whose light follows in the view before; other objects need another view at each pause.
        return self._changeover.has_picture and bool(moved_lamps(self._document, self._poses))

    @property
    def highlights(self) -> HighlightController:
        """The strokes that are painted over the picture."""
        return self._highlights

    @property
    def lacks_bounces(self) -> bool:
        """Whether the picture shows direct light alone, and the first indirect light is still to come."""
        return self._transport.running and self._view.settings.n_bounces != 1 and not self.indirect.picture.is_on_screen

    @property
    def awaits_response(self) -> bool:
        """Whether a curve's transport, a layer's picture or frozen light is due at any moment."""
        return self._transport.contractions.is_under_way or self.indirect.awaits_frozen

    @property
    def is_running(self) -> bool:
        return self._transport.running

    @property
    def lamps_elsewhere(self) -> list[ObjectState]:
        """The lamps that the document has elsewhere than the picture."""
        return lamps_elsewhere(self._document, self._poses)

    # -------------------------------------------------------------------------------------------------------- rendering

    def rendered(self, report: RenderReport) -> None:
        """Take the renderer's report on the frame just drawn, for the present document and selection."""
        waits = self.picture.is_held or self._changeover.waits
        self._summary.report.render = report = replace(report, exact=report.exact and not waits)
        factor = self.picture.factor
        for key in self.picture.edited_layers if report.exact else ():
            wanted = self.picture.coefficients(key)
            if factor in wanted:
                self._transport.contractions.rendered(key, factor, wanted[factor])
                self._changeover.rendered(key, factor, wanted[factor])

    def status(self, status: Status) -> PlacementStatus:
        return self._summary.status(status, self._document, self._view)

    # -------------------------------------------------------------------------------------------------------- responses

    def receive(self, response: Response) -> list[PictureEvent]:
        is_open, is_of_view = self._transport.is_open, response.id == self._view_id
        match response:
            case BandsPlanned():
                self._bands.receive(response)
            case RequestFailed():
                self._take_failure(response)
            case CurvesFitted():
                self._highlights.receive(response)
            case MapsSampled() if is_open:
                self.maps.receive(response)
                self._services.notify_once(response.note)
                self.indirect.means_changed()
                self._summary.report.picture_changed()
                self.idle.images_changed()
            case MapsRefused() if is_open:
                if self.maps.refuse(response, self._services.history):
                    self._services.document_changed()
                self._services.notify(response.line, True)
            case StageFootprint() if is_of_view:
                self._footprints.setdefault(response.stage, Footprint(response.rows, response.weights))
            case IndirectFound() if is_of_view:
                self.indirect.receive_samples(response)
                self.idle.receive(response)
            case IndirectNoise() if is_of_view:
                self.indirect.receive_noise(response)
            case IndirectImproved() if is_of_view:
                self.indirect.receive_improved(response)
                self.idle.receive(response)
            case SamplingProgress() if is_of_view:
                self.idle.receive(response)
            case _ if response.revision == self._transport.revision and is_open:
                return self._take_picture(response)
        return []

    def sky_changed(self, event: SkyChanged) -> list[PictureEvent]:
        if not self._changeover.has_picture:
            return [event]
        self._changeover.receive_sky(event)
        return []

    def _take_picture(self, response: Response) -> list[PictureEvent]:
        match response:
            case LightPlanned():
                self._summary.report.lights_planned(response)
            case BouncesPlanned() if self._view.settings.n_bounces in (AS_PLANNED, response.n_bounces):
                self._take_bounces(response)  # else the user has chosen meanwhile
            case ErrorEstimated():
                self.idle.receive(response)
            case LightsReady() | RelightingPrepared() | EditedSampled():
                self.idle.receive(response)
                self._summary.report.note_memory(response.transport_bytes)
            case IndirectFrozen():
                self.indirect.receive_frozen(response)
            case FreezingProgress():
                self.indirect.receive_progress(response)
            case IndirectRelit():
                self.indirect.receive_relit(response)
            case LayerPicture() if self._comparison.receive(response):
                return []
            case LayerPicture():
                self._changeover.receive_radiance(self._take_radiance(response))
            case LayerTransport() if self._transport.contractions.receive_transport(
                response, self._document, self._services.pictured_view.selected
            ):
                self._summary.report.picture_changed()
                footprint = self._footprints.get(response.stage)
                self._changeover.receive_transport(TransportReady.of(response, self.picture.edited_layers, footprint))
            case StageDone():
                self._take_stage(response)
        return []

    def _take_radiance(self, response: LayerPicture) -> LayerRadiance:
        controller = self._transport
        if controller.requested_light is not None:
            self._accepted_light.accept(controller.requested_light)
        made_with = controller.contractions.receive_picture(response)
        self._summary.report.picture_changed()
        footprint, look = self._footprints.get(response.stage), controller.picture_identity(response.key)
        return LayerRadiance(response.key, response.stage, response.radiance, made_with, footprint, look)

    def _take_bounces(self, response: BouncesPlanned) -> None:
        if self._view.settings.n_bounces == AS_PLANNED:
            self._services.view = SetView.of(n_bounces=response.n_bounces).apply(self._services.view)
            self._transport.receive_bounces(response.n_bounces)
        if warning := self._summary.report.bounces_planned(response):
            self._services.notify(warning)

    def _take_failure(self, response: RequestFailed) -> None:
        self._bands.receive_failure(response)
        self._transport.receive_failure(response)
        self._comparison.receive_failure(response.id)
        self.idle.receive_failure(response.id)
        self._highlights.receive_failure(response.id)
        self.maps.receive_failure(response.id)
        self.indirect.receive_failure(response.id)
        refused = self._transport.requested_light if self._transport.is_transport(response.id) else None
        if refused is not None and self._accepted_light.revert(self._services.history, refused):
            self._services.document_changed()

    def _take_stage(self, response: StageDone) -> None:
        self._transport.receive_stage(response)
        self._comparison.stage_finished()
        self._summary.report.stage_done(response)
        if response.exact:
            self._services.metrics.progress = None
