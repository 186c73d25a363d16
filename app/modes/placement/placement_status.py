"""The status of Placement's picture: its stage, what of it is still missing, and its noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.document.light_state import LightState
from app.messages.editor_status import Status
from app.modes.placement.placement_messages import BouncesPlanned, IndirectFound, LightPlanned, StageDone
from app.modes.placement.transport_controller import TransportController
from engine.precompute.indirect.frozen_light import FrozenGloss
from engine.render.picture_error import NONE, percent
from engine.settings import Precision

# Noise of the whole picture below which it counts as none.
NO_NOISE = NONE
FLOATS: dict[Precision, str] = {"half": "half floats", "float": "full floats"}


@dataclass(frozen=True)
class PlacementStatus(Status):
    """The status of Placement's picture.

    ``shown_coefficients`` of ``wanted_coefficients`` of the selected curve are in the picture; ``curve_error`` is what
    the rest would change, relative RMS, None while unknown. ``image_error`` is that and the noise of indirect light, or
    the whole of its error once that is estimated. ``bands`` are those of each layer's transport by key, as requested;
    none of a layer that is fixed. ``indirect_noise`` is the noise of the indirect light, RMS relative to its own mean;
    None while unknown. ``bounces_note`` says what light that many bounces leave out, empty where that is little;
    ``transport_note`` which bands or which precision of the transport are still to come. ``has_sky``: whether an
    environment lights the scene. ``mixed_lights``: how many can be mixed at once. Of the plan: ``planned_bands`` are
    those of each layer by key and factor,
    ``needed_lights`` and ``needed_patches`` what the worker found to be enough of those requested (0: it did not look),
    ``found_rays`` those of the hemisphere samples of the indirect light that is there (0: none is), ``plan_reasons``
    why, by line. ``spent_seconds`` of processor time the picture has taken since its last change, None while it is
    being computed. ``gloss_knots`` of the selected curve follow it at the second bounce, 0 where its light there is
    not stored. ``sample_sets`` of indirect light a gather point has, on average, since rays were added for edited
    materials, 0 before; ``sampling_reason`` why.
    """

    shown_coefficients: int = 0
    wanted_coefficients: int = 0
    curve_error: float | None = None
    bands: tuple[tuple[str, tuple[int, ...]], ...] = ()
    indirect_noise: float | None = None
    bounces_note: str = ""
    transport_note: str = ""
    has_sky: bool = True
    mixed_lights: int = 0
    planned_bands: tuple[tuple[str, Mapping[str, int]], ...] = ()
    needed_lights: int = 0
    needed_patches: int = 0
    found_rays: int = 0
    plan_reasons: Mapping[str, str] = field(default_factory=dict)
    spent_seconds: float | None = None
    gloss_knots: int = 0
    sample_sets: float = 0.0
    sampling_reason: str = ""


@dataclass(frozen=True)
class RenderReport:
    """The renderer's report after a frame on the selected curve ``key``, ``factor``.

    ``shown_coefficients`` of ``wanted_coefficients`` are in the picture, ``exact`` when all are; ``image_error`` is
    what the rest would still change, relative RMS. ``precision`` is that of the transport the picture is made with,
    None while there is none; ``gpu_mb`` the memory of all textures; ``mean_radiance`` that of the direct light.
    """

    shown_coefficients: int = 0
    wanted_coefficients: int = 0
    image_error: float | None = None
    exact: bool = False
    precision: Precision | None = None
    gpu_mb: float = 0.0
    mean_radiance: float = 0.0


class PlacementReport:
    """What renderer and worker have reported of the picture, for the status. render: the renderer's newest report."""

    def __init__(self) -> None:
        self.render = RenderReport()
        self._lights: LightPlanned | None = None
        self._bounces: BouncesPlanned | None = None
        self._done: StageDone | None = None
        self._transport_bytes = 0

    def picture_changed(self) -> None:
        """The picture has changed: until the renderer reports again, it is not exact."""
        self.render = replace(self.render, exact=False)

    def lights_planned(self, response: LightPlanned) -> None:
        self._lights = response

    def bounces_planned(self, response: BouncesPlanned) -> str:
        """Note how many bounces there are; returns the warning about them, empty where it is known."""
        before, self._bounces = self._bounces, response
        said = None if before is None else (before.n_bounces, before.warning)
        return "" if said == (response.n_bounces, response.warning) else response.warning

    def stage_done(self, response: StageDone) -> None:
        self.note_memory(response.transport_bytes)
        if response.exact:
            self._done = response

    def note_memory(self, transport_bytes: int) -> None:
        """Note the memory that is held for transport; 0 where a response does not tell."""
        self._transport_bytes = transport_bytes or self._transport_bytes

    def status(
        self, revision: int, n_bounces: int, fine: IndirectFound | None, gloss: Sequence[FrozenGloss]
    ) -> dict[str, object]:
        """The fields of the status that were reported. revision: of the transport requested last; n_bounces: those of
        the view; fine: the fine indirect light under that transport; gloss: what follows edited curves."""
        bounces, render = self._bounces, self.render
        lights = self._lights if self._lights is not None and self._lights.revision == revision else LightPlanned(0, 0)
        done = self._done if self._done is not None and self._done.revision == revision else None
        return {
            "gpu_mb": render.gpu_mb,
            "shown_coefficients": render.shown_coefficients,
            "wanted_coefficients": render.wanted_coefficients,
            "precomputed_mb": self._transport_bytes / 1e6,
            "bounces_note": bounces.warning if bounces is not None and bounces.n_bounces == n_bounces else "",
            "needed_lights": lights.n_lights,
            "needed_patches": lights.n_patches,
            "found_rays": 0 if fine is None else fine.n_rays,
            "plan_reasons": {
                **dict(lights.reasons),
                "bounces": "" if bounces is None else bounces.reason,
                "rays": "" if fine is None else fine.reason,
                "gloss": gloss_reason(gloss),
            },
            "gloss_knots": max((len(each.knots) for each in gloss if each.by_layer), default=0),
            "spent_seconds": None if done is None else done.spent_seconds,
        }


def gloss_reason(gloss: Sequence[FrozenGloss]) -> str:
    """Why so much is stored of the light that edited curves send on, for the plan; empty where they send none on."""
    if not gloss:
        return ""
    n_layers = len({layer for each in gloss for layer in each.by_layer})
    if not n_layers:
        return "the selected curve sends too little light on to follow it during a drag"
    megabytes = sum(each.n_bytes for each in gloss) / 1e6
    return f"light that the selected curve sends on to {n_layers} layers follows it during a drag, {megabytes:.1f} MB"


def error_note(curve_error: float | None, noise: float | None) -> str:
    """In words, the parts of the error that are coefficients and noise of indirect light, see `PlacementStatus`."""
    lines = []
    if curve_error is not None:
        lines.append(f"curve coefficients still missing: {percent(curve_error)}")
    if noise is not None:
        lines.append(f"noise left in indirect light, from its two halves: {percent(noise)}")
    return "\n".join(lines)


def light_note(controller: TransportController, shown: LightState) -> str:
    """In words, what light the picture shows; shown: that of the drawn document."""
    light = controller.requested_light
    if light is None or controller.requested_rotation is None:
        return ""
    requested = f"{light.rotation:.1f}°"
    if controller.running and not controller.drag_quality and replace(shown, intensity=light.intensity) != light:
        if shown.rotation == light.rotation:
            return "the previous light is shown until this one is ready"
        return f"shown for {shown.rotation:.1f}° until {requested} is ready"
    if controller.drag_quality:
        return f"preview for {requested}, final on release"
    if not controller.light_is_current:
        return f"shown for {requested} until idle"
    if controller.delivered_final:
        return ""
    return "the light is being refined" if controller.running else "a preview of the light"


def emitter_note(controller: TransportController) -> str:
    """In words, whose light the picture shows, where emitters were changed."""
    if controller.drag_quality:
        return "a preview of its light on the scene; final on release"
    if not controller.light_is_current:
        return "its light on the scene follows when idle"
    if controller.emitters_are_all:
        return "the scene's only light: it shows at once"
    return "" if controller.delivered_final else "its light on the scene is being refined"


def material_note(controller: TransportController) -> str:
    """In words, what of the materials the picture does not show yet."""
    if not controller.quotient_is_current:
        return "the curve is shown at once; self-shadowing follows when idle"
    return "" if controller.fixed_is_current else "the curve of a fixed object follows when idle"


def transport_note(controller: TransportController, shown: Precision | None, wanted: Precision) -> str:
    """In words, what of the transport is still to come: bands, or the precision of the selected curve's."""
    if controller.becoming_editable:
        return f"{', '.join(controller.becoming_editable)}: shown as before until its bands are ready"
    if shown is None or shown == wanted:
        return ""
    return f"shown with {FLOATS[shown]} until {FLOATS[wanted]} are ready"
