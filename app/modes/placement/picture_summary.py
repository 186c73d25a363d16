"""What the parts of Placement's controller say of the picture, summed up: how far it is, its error and its noise."""

from __future__ import annotations

import math

from app.document.document import Document
from app.document.light_mix import mixed_light
from app.document.view_state import ViewState
from app.messages.editor_status import PictureState, Status
from app.modes.placement.comparison import Comparison
from app.modes.placement.curves import Curves
from app.modes.placement.drawn_picture import DrawnPicture
from app.modes.placement.idle_work import IdleWork
from app.modes.placement.indirect_controller import IndirectController
from app.modes.placement.map_controller import MapController
from app.modes.placement.picture_transition import PictureTransition
from app.modes.placement.placement_status import (
    NO_NOISE,
    PlacementReport,
    PlacementStatus,
    emitter_note,
    error_note,
    light_note,
    material_note,
    transport_note,
)
from app.modes.placement.transport_controller import TransportController


class PictureSummary:
    """Sums up the parts of a controller. report: what renderer and worker have reported of the picture."""

    def __init__(
        self, curves: Curves, transport: TransportController, indirect: IndirectController, maps: MapController,
        changeover: PictureTransition, picture: DrawnPicture, idle: IdleWork, comparison: Comparison,
    ) -> None:  # fmt: skip
        self.report = PlacementReport()
        self._curves, self._transport, self._indirect, self._maps = curves, transport, indirect, maps
        self._changeover, self._picture, self._idle, self._comparison = changeover, picture, idle, comparison

    def status(self, status: Status, document: Document, view: ViewState) -> PlacementStatus:
        """The status of the picture of this document."""
        controller, report = self._transport, self.report.render
        noise, picture = self._noise, self.state
        known, has_picture = picture not in ("waiting", "preview"), self._changeover.has_picture
        # That nothing is left to add does not imply a small error.
        says_error = known and self._other_parts_complete and picture != "exact"
        error = math.hypot(report.image_error or 0.0, noise) if says_error else None
        is_whole = picture in ("finished", "exact")
        estimated = self._idle.estimated(document, view) if is_whole else None
        estimate = None if estimated is None else estimated.estimate
        missing = transport_note(controller, report.precision, view.settings.precision)
        fine = self._indirect.found_under(controller.revision)
        said = {
            "picture": picture,
            "is_held": picture in ("preview", "refining") and self._picture.is_held,
            "image_error": error if estimate is None else estimate.overall,
            "estimate": estimate,
            "error_colours": None if estimated is None else estimated.colours,
            "light_note": light_note(controller, mixed_light(self._changeover.drawn)) if has_picture else "",
            "material_note": material_note(controller) if has_picture else "",
            "emitter_note": emitter_note(controller) if has_picture else "",
            "missing_note": missing or "Wavelet coefficients, or light of further bounces, are still being added.",
            "error_note": error_note(report.image_error if known else None, self._indirect.noise),
            "compared_exact": self._comparison.exact,
            "curve_error": report.image_error if known else None,
            "bands": tuple((shape.key, shape.bands_kept) for shape in controller.requested_layers),
            "indirect_noise": self._indirect.noise,
            "transport_note": missing,
            "has_sky": controller.has_sky,
            "mixed_lights": self._idle.relight.n_lights,
            "planned_bands": self._curves.all_planned(document),
            **self._idle.sampling_status(status),
            **self._indirect.status(status),
        }
        return PlacementStatus(
            **(
                vars(status)
                | said
                | self.report.status(controller.revision, view.settings.n_bounces, fine, self._indirect.sent_on)
            )
        )

    @property
    def _noise(self) -> float:
        """The noise of the whole picture."""
        return self._indirect.noise_of_picture(self.report.render.mean_radiance)

    @property
    def _other_parts_complete(self) -> bool:
        """Whether indirect light and images, all that makes the picture besides direct light, are complete."""
        return self._indirect.is_complete and self._maps.is_complete

    @property
    def state(self) -> PictureState:
        """How far the picture is."""
        controller = self._transport
        if not self._changeover.has_picture:
            return "waiting"
        if not (
            controller.is_open
            and (controller.shows_final or controller.transport_is_current and controller.delivered_final)
        ):
            return "preview"
        is_complete = controller.finished and self.report.render.exact and self._other_parts_complete
        if not is_complete or self._picture.is_held:
            return "refining"
        return "exact" if self._noise <= NO_NOISE else "finished"
