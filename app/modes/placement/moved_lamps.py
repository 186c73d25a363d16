"""Which lamps a document has elsewhere than the traced view."""

from __future__ import annotations

from app.document.document import Document, ObjectState
from engine.realtime.zonal_harmonics.pose import Poses


def moved_lamps(document: Document, traced: Poses) -> Poses:
    """The poses of the lamps that are elsewhere in a view with these poses; none where other objects are, too: their
    shadows need another view."""
    here, there = dict(document.poses), dict(traced)
    moved = [name for name in dict.fromkeys((*here, *there)) if here.get(name) != there.get(name)]
    lamps = {state.name for state in document.objects if state.is_lamp} if moved else set()
    return tuple((name, here.get(name, ())) for name in moved) if lamps.issuperset(moved) else ()


def lamps_elsewhere(document: Document, traced: Poses) -> list[ObjectState]:
    """The lamps that are elsewhere in a view with these poses, whatever else is."""
    here, there = dict(document.poses), dict(traced)
    return [each for each in document.objects if each.is_lamp and here.get(each.name) != there.get(each.name)]
