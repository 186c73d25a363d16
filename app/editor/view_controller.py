"""The requested and the traced view: camera, resolution, objects, poses, bumps, opacities, edge rays.

A view changes as soon as the user moves the camera, adds, deletes or poses an object, perturbs its normals or makes
holes in it; it is traced once all of these are idle. Until then the previous picture stays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from app.document.view_state import Viewpoint
from app.messages.worker_messages import Request, Response, SetCamera
from app.modes.reconciler import Reconciler
from engine.light.cones import Cone
from engine.material.bumps import BumpsByObject
from engine.material.opacity import OpacityByObject
from engine.realtime.zonal_harmonics.pose import Poses
from engine.scene.composition import Composition
from engine.scene.picture_frame import PictureFrame
from engine.scene.transform import Transform

REST_SECONDS = 0.25


class TracedView(NamedTuple):
    """A view: camera and resolution, the poses and bumps of objects in it, the rays through a pixel at an edge (None
    for as many as the scene requires), the number of the request that opened the scene, opacities of objects, and which
    objects there are."""

    viewpoint: Viewpoint = Viewpoint()
    poses: Poses = ()
    bumps: BumpsByObject = ()
    n_edge_rays: int | None = None
    scene: int = 0
    opacities: OpacityByObject = ()
    composition: Composition | None = None


class ViewController:
    """Requests traced views. ``send`` sends a request and returns its id.

    ``has_resized``: the traced view's resolution is not that of the view before. ``is_away``: the present view is not
    the traced one.
    """

    def __init__(self, send: Callable[[Request], int]) -> None:
        self._send = send
        self._reconciler = Reconciler[TracedView, int](REST_SECONDS)
        self.is_away = self.has_resized = False

    @property
    def _traced(self) -> TracedView:
        return self._reconciler.ready_for or TracedView()

    @property
    def traced(self) -> Viewpoint:
        """The view that the picture shows."""
        return self._traced.viewpoint

    @property
    def poses(self) -> Poses:
        """The poses of objects that the picture shows."""
        return self._traced.poses

    @property
    def requested_id(self) -> int:
        """The number of the newest request, 0 for none."""
        requested = self._reconciler.requested
        return 0 if requested is None else requested.id

    @property
    def scene(self) -> int:
        """The number of the request that opened its scene."""
        return self._traced.scene

    @property
    def composition(self) -> Composition | None:
        """The objects that the picture shows."""
        return self._traced.composition

    @property
    def requested_composition(self) -> Composition | None:
        """The objects of the view that was requested last."""
        requested = self._reconciler.requested
        return None if requested is None else requested.desired.composition

    @property
    def id(self) -> int:
        """The number of the request that it was traced by."""
        return self._reconciler.ready or 0

    def request_view(self, view: TracedView, now: float = 0.0) -> None:
        """Request a view, of the open scene or of one that is being opened."""
        look, poses, bumps, n_edge_rays, scene, opacities, composition = view
        request = SetCamera(scene, *look, poses, bumps, n_edge_rays, opacities, composition)
        self._reconciler.sent(now, self._send(request), view)

    def update(self, now: float, view: TracedView, follows_drag: bool = False) -> bool:
        """Request another view of the open scene once it is idle; once a frame. Returns whether `is_away` changed. now:
        seconds of a steady clock; follows_drag: whether objects are being dragged, and the picture follows them."""
        reconciler, view = self._reconciler, view._replace(scene=self.scene)
        reconciler.desire(now, view)
        # To trace it at each pause of the hand would keep the worker from following.
        waits = follows_drag and _without_transforms(view) == _without_transforms(self._traced)
        if reconciler.action(now, not waits) == "request":
            self.request_view(view, now)
        was_away, self.is_away = self.is_away, view != self._traced or reconciler.is_under_way
        return was_away != self.is_away

    def hand_released(self) -> None:
        """A drag ended: the view is requested without waiting for the idle time."""
        self._reconciler.skip_idle()

    def retry(self) -> None:
        """Request the view again whose trace was stopped."""
        self._reconciler.retry()

    def note_traced(self, response: Response) -> bool:
        """Note that a view was traced; returns whether it is the one that was requested."""
        if not self.is_pending(response.id):
            return False
        before = self.traced.resolution
        self._reconciler.receive(response.id, response.id)
        self.has_resized, self.is_away = self.traced.resolution != before, False
        return True

    def adopt_resolution(self, own: tuple[int, int]) -> Viewpoint:
        """The traced view, for a scene whose own resolution is known."""
        if self.traced.resolution == own:
            adopted = self._traced._replace(viewpoint=self.traced._replace(resolution=None))
            self._reconciler.accept(self.id, adopted)
        return self.traced

    def adopt_composition(self, composition: Composition | None) -> None:
        """Note that the traced view has these objects: others could not be read."""
        self._reconciler.accept(self.id, self._traced._replace(composition=composition))

    def is_pending(self, id: int) -> bool:
        """Whether the response to the request of that number is still to come."""
        requested = self._reconciler.requested
        return requested is not None and requested.id == id and self._reconciler.is_under_way

    def give_up(self) -> Viewpoint | None:
        """Note that the requested view will not come; returns it, None where there was none."""
        requested, self.is_away = self._reconciler.requested, False
        if requested is None or not self._reconciler.fail(requested.id):
            return None
        return requested.desired.viewpoint


def _without_transforms(view: TracedView) -> TracedView:
    """The view with objects where their deformers and animations have them, and spots with the cones of their files."""
    rows = ((name, tuple(each for each in row if not isinstance(each, Cone | Transform))) for name, row in view.poses)
    return view._replace(poses=tuple((name, row) for name, row in rows if row))


def describe_empty_frame(frame: PictureFrame) -> str:
    """The line to show for a picture in which there is nothing to edit; "" for any other."""
    if frame.n_points:
        return ""
    return f"the camera sees {'lamps alone' if (frame.object_image >= 0).any() else 'no surface, the background alone'}"
