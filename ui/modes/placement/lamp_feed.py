"""Lamps that are moved: shown where the document has them, until the view is traced with them there."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from app.document.document import Document, ObjectState
from app.document.light_mix import emission_of
from app.document.light_state import RGB
from app.messages.picture_events import SceneFrame
from engine.light.cones import ALL_ROUND, Cone
from engine.scene.description import Camera
from engine.scene.transform import Transform
from ui.modes.placement.gl.moved_lamps import ShownLamp
from ui.modes.placement.gl.renderer import PlacementRenderer


class LampFeed:
    """Feeds one renderer with the lamps of the scene that it shows."""

    def __init__(self, renderer: PlacementRenderer) -> None:
        self._renderer = renderer
        self._camera: Camera | None = None
        self._objects: dict[str, int] = {}
        self._followed: tuple[Document, list[ObjectState]] | None = None
        self._shown: frozenset[str] = frozenset()

    def scene_taken(self, event: SceneFrame) -> None:
        """Note which frame the renderer has: it has all lamps in their places."""
        self._camera = event.description.camera
        self._objects = {described.name: i for i, described in enumerate(event.description.objects)}
        self._followed, self._shown = None, frozenset()

    def shows(self, name: str) -> bool:
        """Whether a lamp is shown elsewhere than the frame has it."""
        return name in self._shown

    def follow(self, document: Document, elsewhere: list[ObjectState]) -> None:
        """Show the lamps that the document has elsewhere than the frame."""
        before, self._followed = self._followed, (document, elsewhere)
        if self._camera is None or before is not None and before[0] is document and before[1] == elsewhere:
            return
        emission = dict(emission_of(document)) if elsewhere else {}
        lamps = tuple(self._shown_lamps(elsewhere, emission))
        self._shown = frozenset(each.name for each in elsewhere if _has_shape(each))
        self._renderer.set_moved_lamps(self._camera, lamps)

    def _shown_lamps(self, states: list[ObjectState], emission: dict[str, RGB]) -> Iterable[ShownLamp]:
        frame = self._renderer.frame
        for state in states:
            index = self._objects.get(state.name)
            if index is None or state.lamp is None or frame is None or not _has_shape(state):
                continue
            matrix = state.transform.matrix(state.lamp.pivot) @ np.reshape(state.lamp.matrix, (4, 4))
            seen = frame.lamps.object == index
            # Of an image on it the mean.
            factor = frame.lamps.factor[seen].mean(axis=0) if seen.any() else np.ones(3)
            red, green, blue = (factor * emission.get(state.name, (0.0, 0.0, 0.0))).tolist()
            cone = ALL_ROUND if state.cone is None else tuple(state.cone.row(matrix[:3, 2]).tolist())
            yield ShownLamp(index, state.lamp.primitive, tuple(matrix.ravel().tolist()), (red, green, blue), cone)


def _has_shape(state: ObjectState) -> bool:
    """Whether a lamp has a simple shape, and nothing bends it."""
    return state.lamp is not None and all(isinstance(each, Cone | Transform) for each in state.motion_stack)
