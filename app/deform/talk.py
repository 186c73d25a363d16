"""Deform's talk with the worker: Orbit's, of a scene whose objects bend.

As in Orbit a picture is drawn in the worker for each frame in which something moves, and Placement takes over what
rests: the worker traces the scene in its new pose, as it traces a new view.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.deform.messages import DeformKnown, DrawDeform, PrepareDeform, Traced
from app.deform.status import DeformStatus
from app.document import Document
from app.messages import Request, Response
from app.mode import Desk, OpenedScene
from app.orbit.talk import REST_SECONDS, OrbitTalk
from app.orbit.wishes import Drawing, OrbitWish
from app.picture import PictureEvent
from app.status import Status
from app.timeline import shown_poses
from app.view_state import ViewState
from engine.deform.pose import Poses
from engine.scene.description import Camera


@dataclass(frozen=True)
class DeformWish(OrbitWish):
    """All that pictures are drawn of, but for camera and amounts; posed: the objects that bend; traced: what paths are
    to show beside them."""

    posed: tuple[str, ...] = ()
    traced: Traced | None = None


class DeformTalk(OrbitTalk):
    """The talk of Deform."""

    title = "Deform"
    prepares = PrepareDeform
    draws = DrawDeform

    def __init__(self, desk: Desk) -> None:
        self._lost: tuple[tuple[str, float], ...] = ()
        self._alone: tuple[str, ...] = ()
        super().__init__(desk)

    def scene_opened(self, scene: OpenedScene) -> None:
        self._alone = tuple(each.name for each in scene.description.objects if each.deform is not None)
        super().scene_opened(scene)

    def take(self, response: Response) -> list[PictureEvent]:
        if isinstance(response, DeformKnown):
            self._lost = response.lost
            return []
        return super().take(response)

    def status(self, status: Status) -> Status:
        told = super().status(status)
        own = {"lost": self._lost, "bends": bool(self._poses), "alone": self._alone}
        return DeformStatus(**(vars(told) | own)) if told.shown_by == self.title else told

    def _wish_of(self, document: Document, view: ViewState) -> OrbitWish:
        wish = OrbitWish.of(document, view)
        posed = tuple(state.name for state in document.objects if state.deformations or state.animations)
        return DeformWish(wish.scene, wish.n_bounces, posed)

    def _poses_of(self, document: Document, view: ViewState) -> Poses:
        return shown_poses(document, view)

    @property
    def _may_hand_over(self) -> bool:
        """Only Deform knows membranes, what light goes through, patches and wrinkles; and it alone is split."""
        return not self._alone and self._split is None

    def _follow(self, now: float, document: Document, view: ViewState) -> None:
        """Where the picture is split and rests, what paths are to show is a part of the wish."""
        super()._follow(now, document, view)
        self._split, wish = view.split, self._wish
        assert isinstance(wish, DeformWish) and self._own_camera is not None and self._look is not None
        if view.split is None:
            self._wish = replace(wish, traced=None)
        elif now - self._moved_at >= REST_SECONDS:
            traced = Traced(self._look.camera or self._own_camera, self._whole, self._poses)
            self._wish = replace(wish, traced=traced)

    def _preparation(self, wish: OrbitWish) -> Request:
        assert isinstance(wish, DeformWish)
        return PrepareDeform(wish.scene, wish.n_bounces, wish.posed, wish.traced)

    def _draw_request(self, camera: Camera, wanted: Drawing) -> Request:
        return DrawDeform(camera, wanted.resolution, wanted.quality, wanted.poses, wanted.split)
