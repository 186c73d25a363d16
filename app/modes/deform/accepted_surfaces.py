"""The surfaces of objects that the worker last made a picture with. The document returns to them when an image of a
surface cannot be read, as `app.modes.placement.accepted_light` does for light."""

from __future__ import annotations

from dataclasses import replace

from app.document.commands import SetSurface
from app.document.document import Document
from app.document.history import History
from engine.scene.surface_kinds import SurfacesByObject


class AcceptedSurfaces:
    """The surfaces of one scene that are known to work; at first those of its file."""

    def __init__(self) -> None:
        self._surfaces: SurfacesByObject = ()

    def accept(self, surfaces: SurfacesByObject) -> None:
        """Accept these surfaces: a picture was made with them."""
        self._surfaces = surfaces

    def revert(self, history: History[Document], refused: SurfacesByObject) -> bool:
        """Take images that were refused out of the document; returns whether there were any.

        If choosing one was the last step, that step disappears from the history; else the image is replaced.
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
    """Whether two documents differ only in the surfaces of these objects."""
    gone_back = after
    for name in names:
        surface = before.object(name).new_surface
        gone_back = gone_back.with_object(replace(gone_back.object(name), new_surface=surface))
    return gone_back == before != after
