"""The surfaces of objects that the worker last made a picture with: where the document goes back to when an image that
one of them names cannot be read, as `app.modes.placement.accepted_light` does for light."""

from __future__ import annotations

from dataclasses import replace

from app.document.commands import SetSurface
from app.document.document import Document
from app.document.history import History
from engine.scene.surface_kinds import SurfacesByObject


class AcceptedSurfaces:
    """What of one scene's surfaces is known to work; to begin with what its file says."""

    def __init__(self) -> None:
        self._surfaces: SurfacesByObject = ()

    def accept(self, surfaces: SurfacesByObject) -> None:
        """A picture came of these."""
        self._surfaces = surfaces

    def revert(self, history: History[Document], refused: SurfacesByObject) -> bool:
        """Take images that were refused out of the document; whether there were any.

        Where choosing one was the last step, that step is gone as if it had never been; else it is replaced.
        """
        known, now = dict(self._surfaces), dict(history.document.new_surfaces)
        at_fault = [name for name, each in refused if each.files and each != known.get(name) and each == now.get(name)]
        if not at_fault:
            return False
        if not history.retract(lambda before: _only_changed(at_fault, before, history.document)):
            for name in at_fault:
                surface = known.get(name, history.document.object(name).own_surface)
                history.do(SetSurface(name, surface.kind, tuple(surface.values.items())))
        return True


def _only_changed(names: list[str], before: Document, after: Document) -> bool:
    """Whether all that happened between two documents is that the surfaces of these objects were set."""
    gone_back = after
    for name in names:
        surface = before.object(name).new_surface
        gone_back = gone_back.with_object(replace(gone_back.object(name), new_surface=surface))
    return gone_back == before != after
