"""What a mode declares whose pictures the worker draws: what it desires, and how this is requested.

`orbit_controller` knows when to prepare, draw and hand over to Placement. A drawing knows of what, and by which
requests. Deform has another one (`app.modes.deform.deform_drawing`).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import count

from app.document.document import Document
from app.document.history import History
from app.document.light_state import LightState
from app.document.shadow_catchers import why_as_objects
from app.document.timeline import visible_poses
from app.document.view_state import ViewState
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import Request, Response
from app.modes.mode import StillMode
from app.modes.orbit.desired_state import DesiredOrbit, PictureContent, PictureRequest
from app.modes.orbit.orbit_events import OrbitPicture
from app.modes.orbit.orbit_messages import (
    DrawHeadlight,
    DrawOrbit,
    EstimateDrawn,
    EstimateOrbit,
    OrbitPictureDrawn,
    PrepareOrbit,
)
from app.modes.orbit.orbit_status import OrbitStatus
from app.modes.placement.accepted_light import AcceptedLight
from engine.scene.description import Camera

LACKS = (
    "Glossy surfaces reflect only lights here, blurred by about three degrees; other objects appear in them as an even "
    "glow."
)
_listeners = count(1)


class OrbitDrawing:
    """What Orbit draws. title: of the mode; limitations: what its pictures lack; follows_objects: whether
    what is prepared follows objects that are dragged; prepares, draws, estimates: the kinds
    of its requests."""

    title, limitations, follows_objects = "Orbit", LACKS, True
    still_mode: StillMode = "orbit"
    prepares: type[Request] = PrepareOrbit
    draws: type[Request] = DrawOrbit
    estimates: type[EstimateDrawn] = EstimateOrbit

    def __init__(self) -> None:
        self._listener = self._most_bytes = 0
        self.scene_opened()

    def scene_opened(self) -> None:
        """Another scene is open: which of its light works is unknown."""
        self._accepted_light = AcceptedLight()

    def draw_in_window(self, most_bytes: int) -> None:
        """From now on the window draws moving pictures itself, of arrays of at most so many bytes; 0: the worker
        does."""
        self._listener, self._most_bytes = next(_listeners) if most_bytes else 0, most_bytes

    @property
    def needs_no_request(self) -> bool:
        """Whether the window draws moving pictures of what the worker has exported, without a request for each."""
        return self._listener > 0

    # -------------------------------------------------------------------------------------------------- what is desired

    def desired_inputs(self, document: Document, view: ViewState) -> tuple[object, ...]:
        """All that the desired state is made of."""
        return document, view.solo, view.settings, view.playing, why_as_objects(document, view)

    def desired_state(self, document: Document, view: ViewState) -> DesiredOrbit:
        """The desired state: what pictures are to be drawn of."""
        return replace(DesiredOrbit.of(document, view), poses=visible_poses(document, view))

    def idle_state(
        self, desired: DesiredOrbit, content: PictureContent, camera: Camera, resolution: tuple[int, int], rests: bool
    ) -> DesiredOrbit:
        """The desired state with what is added to it once the view rests; resolution: of an idle picture."""
        return desired

    def content(self, document: Document, view: ViewState) -> PictureContent:
        """What a picture shows, except the desired state."""
        return PictureContent(view.viewpoint, transparent=document.background.hides_environment)

    @property
    def placement_can_show(self) -> bool:
        """Whether Placement can show what this mode does."""
        return True

    @property
    def can_be_estimated(self) -> bool:
        """Whether path tracing covers all that this mode shows."""
        return True

    def awaits_more(self, desired: DesiredOrbit | None, prepared: int) -> bool:
        """Whether more is still to come of an idle picture that is complete otherwise; prepared: the number of the
        newest preparation."""
        return False

    # --------------------------------------------------------------------------------------------------------- requests

    def preparation(self, desired: DesiredOrbit) -> Request:
        """The request to make ready what pictures are drawn of."""
        return PrepareOrbit(
            desired.scene, desired.n_bounces, self._listener, self._most_bytes, desired.n_points,
            desired.n_coefficients, desired.poses, desired.catchers,
        )  # fmt: skip

    def headlight_request(self, camera: Camera, wanted: PictureRequest, desired: DesiredOrbit) -> Request:
        """The request for a picture of nothing that is prepared."""
        return DrawHeadlight(camera, wanted.resolution, desired.scene, transparent=wanted.transparent)

    def draw_request(self, camera: Camera, wanted: PictureRequest, n_coefficients: int) -> Request:
        """The request for a picture of what is ready; n_coefficients: of light per point, while something moves."""
        if wanted.quality == "rest":
            return DrawOrbit(camera, wanted.resolution, "rest", transparent=wanted.transparent)
        return DrawOrbit(camera, wanted.resolution, wanted.quality, n_coefficients, wanted.transparent)

    # -------------------------------------------------------------------------------------------------------- responses

    def accept_light(self, light: LightState) -> None:
        """Note that the worker can draw in this light."""
        self._accepted_light.accept(light)

    def accept(self, desired: DesiredOrbit) -> None:
        """Note that the worker can draw this."""
        self.accept_light(desired.scene.light)

    def revert(self, history: History[Document], refused: DesiredOrbit) -> bool:
        """Take out of the document what the worker cannot draw; returns whether there was anything."""
        return self._accepted_light.revert(history, refused.scene.light)

    def receive(self, response: Response) -> bool:
        """Take a response that says something of pictures; returns whether it is one."""
        return False

    def picture_events(self, response: OrbitPictureDrawn, drawn: PictureRequest, camera: Camera) -> list[PictureEvent]:
        """The events for a picture that has come, drawn from this camera."""
        return [OrbitPicture(response.radiance, drawn.fit_error, response.are_caught)]

    def complete_status(self, status: OrbitStatus, prepared: int) -> OrbitStatus:
        """The status of a picture of this mode with what else it has to say."""
        return status
