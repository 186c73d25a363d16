"""The environment that the worker last made a picture with. The document returns to it when another one fails.

Whether a file holds light is known only once the worker has read all of it. Without this, a damaged file would stay in
the document, its picture would never come, and every later request would fail on it.
"""

from __future__ import annotations

from dataclasses import replace

from app.document.commands.light import SetEnvironment
from app.document.commands.painted import RemovePainted
from app.document.document import Document
from app.document.history import History
from app.document.light_state import LightState

Source = tuple[object, ...]


class AcceptedLight:
    """The environment of one scene that is known to work; None until there was a picture."""

    def __init__(self) -> None:
        self._light: LightState | None = None

    def accept(self, light: LightState) -> None:
        """Accept this light: a picture was made with it."""
        self._light = light

    def revert(self, history: History[Document], refused: LightState) -> bool:
        """Take the environment that was refused out of the document; returns whether it was there and could be taken
        out.

        If choosing it was the last step, that step disappears from the history; else the environment is replaced.
        """
        known, light = self._light, history.document.light
        if known is not None and source(refused) == source(known):
            return _revert_painted(history, _painted_files(refused) - _painted_files(known))
        if known is None or source(light) != source(refused):
            return False
        if not history.retract(lambda before: _only_changed_to(refused, before, history.document)):
            history.do(SetEnvironment(known.environment, known.mapping, known.radiance))
        return True


def source(light: LightState) -> Source:
    """The source that the worker reads an environment from."""
    return light.environment, light.mapping, light.radiance


def _painted_files(light: LightState) -> set[str]:
    return {each.file for each in light.painted if each.file}


def _revert_painted(history: History[Document], files: set[str]) -> bool:
    """Take painted images of these files out of a document; returns whether any was there. If painting them was the
    last step, that step disappears."""
    document = history.document
    names = [each.name for each in document.light.painted if each.file in files]
    if names and not history.retract(lambda before: _only_painted(files, before, document)):
        for name in names:
            history.do(RemovePainted(name))
    return bool(names)


def _only_painted(files: set[str], before: Document, after: Document) -> bool:
    """Whether two documents differ in painted lights alone, of which the first has none of these files."""
    painted = replace(after.light, painted=before.light.painted, mix=before.light.mix)
    return not files & _painted_files(before.light) and replace(after, light=painted) == before


def _only_changed_to(refused: LightState, before: Document, after: Document) -> bool:
    """Whether two documents differ only in that this environment was chosen."""
    chosen = replace(before.light, environment=refused.environment, mapping=refused.mapping, radiance=refused.radiance)
    return before.light != chosen and replace(before, light=chosen) == after
