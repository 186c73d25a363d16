"""What Deform draws: a scene whose objects deform, beside path-traced parts where the picture is split."""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.document.document import Document
from app.document.history import History
from app.document.scene_state import moved_objects
from app.document.shadow_catchers import why_as_objects
from app.document.timeline import visible_poses
from app.document.view_state import ViewState
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import Request, Response
from app.modes.deform.accepted_surfaces import AcceptedSurfaces
from app.modes.deform.deform_events import PoseArrived
from app.modes.deform.deform_messages import (
    DeformLoss,
    DrawDeform,
    EstimateDeform,
    GlossDecided,
    GlossPlan,
    PathPreview,
    PathsTraced,
    PoseExported,
    PrepareDeform,
)
from app.modes.deform.deform_status import DeformStatus
from app.modes.orbit.desired_state import DesiredOrbit, PictureContent, PictureRequest
from app.modes.orbit.orbit_drawing import OrbitDrawing
from app.modes.orbit.orbit_messages import AnimationOffsets, DrawHeadlight, OrbitPictureDrawn
from app.modes.orbit.orbit_status import OrbitStatus
from engine.realtime.core.gpu_parts import NO_PARTS, Numbers
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.description import Camera
from engine.scene.surface_kinds import SurfacesByObject


@dataclass(frozen=True)
class DesiredDeform(DesiredOrbit):
    """All that pictures are drawn of, except camera and amounts; posed: the objects that deform or were moved;
    surfaces: what the document sets of surfaces; traced: what path tracing is to show beside them; moved: the objects
    that were moved; lamps: the placements of emitters where they have come to rest."""

    posed: tuple[str, ...] = ()
    surfaces: SurfacesByObject = ()
    traced: PathPreview | None = None
    n_rays: int = 1000
    n_lobes: int = 4
    n_gloss_rows: int | None = None
    moved: tuple[str, ...] = ()
    lamps: Poses = ()


class DeformDrawing(OrbitDrawing):
    """What Deform draws. Where the window draws moving pictures itself, each is still requested: it is drawn of the
    lobes and the pose that are exported for it."""

    follows_objects = False  # it poses them itself
    title, limitations = "Deform", "Sharp highlights are softer here; the Accuracy panel shows by how much."
    prepares, draws, estimates = PrepareDeform, DrawDeform, EstimateDeform

    def __init__(self) -> None:
        super().__init__()
        self._lost: tuple[tuple[str, float], ...] = ()
        self._gloss: tuple[GlossPlan, ...] = ()
        self._carried: AnimationOffsets = ()
        self._paths_traced = PathsTraced(0, 1)
        self._sent_parts: Numbers | None = None  # those that the window has, see `DrawDeform.sent_parts`

    def scene_opened(self) -> None:
        super().scene_opened()
        self._accepted_surfaces = AcceptedSurfaces()
        self._deform_only: tuple[str, ...] = ()
        self._content = PictureContent(ViewState().viewpoint)
        self._preview: PathPreview | None = None
        self._preview_of: DesiredOrbit | None = None
        self._catches = False
        self._resting_lamps: Poses | None = None

    def draw_in_window(self, most_bytes: int) -> None:
        self._sent_parts = NO_PARTS if most_bytes else None

    def resend_parts(self, known: Numbers) -> None:
        """Send all parts again but these, which the window has."""
        self._sent_parts = known

    # -------------------------------------------------------------------------------------------------- what is desired

    def desired_inputs(self, document: Document, view: ViewState) -> tuple[object, ...]:
        return document, view.solo, view.settings, view.playing is None, why_as_objects(document, view)

    def desired_state(self, document: Document, view: ViewState) -> DesiredOrbit:
        self._deform_only = tuple(state.name for state in document.shown if state.surface.kind)
        desired, plays = DesiredOrbit.of(document, view), view.playing is not None
        moved, lamps = moved_objects(document)
        posed = tuple(
            state.name for state in document.shown
            if not state.is_light and (
                state.deformations or state.moment is not None or plays and state.animations or state.name in moved
            )
        )  # fmt: skip
        catchers = desired.catchers
        # What others leave of the light around a posed object is one share: it would catch one even shadow.
        if catchers is not None:
            is_posed = any(name in posed for name in document.shadow_catchers)
            catchers = None if is_posed else catchers.with_posed_lamps()
        self._catches = catchers is not None
        return DesiredDeform(
            desired.scene, desired.n_bounces, posed=posed, surfaces=document.new_surfaces, n_rays=view.settings.n_rays,
            n_lobes=view.settings.n_lobes, n_gloss_rows=view.settings.n_gloss_rows,
            moved=moved, lamps=lamps, catchers=catchers,
        )  # fmt: skip

    def content(self, document: Document, view: ViewState) -> PictureContent:
        split = None if view.fit_error else view.split
        # Parts beside a path-traced one are opaque, as that is, and so is a measure.
        transparent = document.background.hides_environment and split is None and not view.fit_error
        return PictureContent(view.viewpoint, visible_poses(document, view), split, view.fit_error, transparent)

    def idle_state(
        self, desired: DesiredOrbit, content: PictureContent, camera: Camera, resolution: tuple[int, int], rests: bool
    ) -> DesiredOrbit:
        """Where the picture is split and idle, the desired state includes what path tracing is to show. Lamps are drawn
        where the poses of each picture have them; rays find their light once they rest."""
        assert isinstance(desired, DesiredDeform)
        if rests or self._resting_lamps is None:
            self._resting_lamps = desired.lamps
        self._content = content
        if desired is not self._preview_of or content.split is None:
            self._preview, self._preview_of = None, desired
        if content.split is not None and rests:
            self._preview = PathPreview(camera, resolution, content.poses)
        return replace(desired, traced=self._preview, lamps=self._resting_lamps)

    @property
    def placement_can_show(self) -> bool:
        """Only Deform draws membranes, transmitted light, patches and wrinkles; Placement shows light alone."""
        return not (self._deform_only or self._content.split is not None or self._content.fit_error)

    @property
    def can_be_estimated(self) -> bool:
        return not self._no_estimate_reason

    @property
    def _no_estimate_reason(self) -> str:
        """Why the error of the picture is not estimated; empty where it is."""
        if self._deform_only:
            return f"No error estimate: path tracing does not support the surface of {', '.join(self._deform_only)}"
        if self._content.split is not None:
            return "No error estimate beside path-traced parts"
        return "No error estimate while the fit error is shown" if self._content.fit_error else ""

    def awaits_more(self, desired: DesiredOrbit | None, prepared: int) -> bool:
        """Whether path tracing of a split picture goes on."""
        if self._content.split is None:
            return False
        is_traced = isinstance(desired, DesiredDeform) and desired.traced is not None
        return not (is_traced and self._share_traced(prepared) >= 1.0)

    def _share_traced(self, prepared: int) -> float:
        """The share of the path-traced part that has come, 0 to 1."""
        traced = self._paths_traced
        return traced.n_passes / traced.of if traced.id == prepared else 0.0

    # --------------------------------------------------------------------------------------------------------- requests

    def preparation(self, desired: DesiredOrbit) -> Request:
        assert isinstance(desired, DesiredDeform)
        effort = desired.n_rays, desired.n_lobes, desired.n_gloss_rows
        return PrepareDeform(
            desired.scene, desired.n_bounces, desired.posed, desired.surfaces, desired.traced, *effort,
            desired.moved, desired.lamps, desired.catchers,
        )  # fmt: skip

    def headlight_request(self, camera: Camera, wanted: PictureRequest, desired: DesiredOrbit) -> Request:
        return DrawHeadlight(camera, wanted.resolution, desired.scene, wanted.poses, wanted.transparent)

    def draw_request(self, camera: Camera, wanted: PictureRequest, n_coefficients: int) -> Request:
        shows_light = wanted.split is None and not wanted.fit_error
        known = self._sent_parts if shows_light and wanted.quality == "moving" and not self._catches else None
        return DrawDeform(
            camera, wanted.resolution, wanted.quality, wanted.poses, wanted.split, wanted.fit_error, known,
            wanted.transparent,
        )  # fmt: skip

    # -------------------------------------------------------------------------------------------------------- responses

    def accept(self, desired: DesiredOrbit) -> None:
        super().accept(desired)
        assert isinstance(desired, DesiredDeform)
        self._accepted_surfaces.accept(desired.surfaces)

    def revert(self, history: History[Document], refused: DesiredOrbit) -> bool:
        assert isinstance(refused, DesiredDeform)
        has_reverted_light = super().revert(history, refused)
        return self._accepted_surfaces.revert(history, refused.surfaces) or has_reverted_light

    def receive(self, response: Response) -> bool:
        match response:
            case DeformLoss():
                self._lost = response.lost
            case GlossDecided():
                self._gloss = response.plans
            case PathsTraced():
                self._paths_traced = response
            case _:
                return False
        return True

    def picture_events(self, response: OrbitPictureDrawn, drawn: PictureRequest, camera: Camera) -> list[PictureEvent]:
        self._carried = response.animation_offsets
        if isinstance(response, PoseExported):
            self._sent_parts = response.export.numbers
            return [PoseArrived(response.export, camera, drawn.resolution, drawn.transparent)]
        return super().picture_events(response, drawn, camera)

    def complete_status(self, status: OrbitStatus, prepared: int) -> OrbitStatus:
        own: dict[str, object] = {"lost": self._lost, "deform_only": self._deform_only, "carried": self._carried}
        own["gloss"] = self._gloss
        own["no_estimate_reason"] = self._no_estimate_reason
        if status.picture == "refining" and self._content.split is not None:
            share = self._share_traced(prepared)
            own["missing_note"] = f"The path-traced part is being refined: {share:.0%} done."
        return DeformStatus(**(vars(status) | own))
