"""Deform's picture: Orbit's feed, whose moving pictures the graphics card draws of poses that the worker exports.

take: PoseExported ─► PosedPicture ─► canvas
"""

from __future__ import annotations

import moderngl

from app.editor.editor import Editor
from app.messages.picture_events import PictureEvent
from app.modes.deform.deform_controller import DeformController
from app.modes.deform.deform_events import PoseArrived
from ui.gl.context import GraphicsError
from ui.modes.deform.gl.posed_picture import PosedPicture
from ui.modes.orbit.orbit_feed import MovingRenderer, OrbitFeed


class DeformFeed(OrbitFeed):
    """Feeds a canvas, and Placement's renderer beside it."""

    def take(self, editor: Editor, event: PictureEvent) -> None:
        if isinstance(event, PoseArrived):
            self._take_pose(editor, event)
        else:
            super().take(editor, event)

    def _new_shaded(self) -> MovingRenderer:
        return PosedPicture(self._context)

    def _take_pose(self, editor: Editor, event: PoseArrived) -> None:
        shaded, controller = self.shaded, editor.controller
        if not isinstance(shaded, PosedPicture) or not isinstance(controller, DeformController):
            return  # disabled since
        if event.export.is_missing_parts(shaded.part_numbers):  # its base became void before it was drawn
            controller.resend_parts(shaded.part_numbers)
            return
        try:
            self.canvas.show(shaded.draw(event.export, event.camera, event.resolution, event.transparent))
        except (GraphicsError, moderngl.Error) as error:
            self._disable_shaders(editor, error)
        self._drawn, self._is_measure, self._are_caught = None, False, False
