"""The animations of a scene's files on one timeline, and the document's time on it, or that of the playing view.

A time is a part of the document, so that undo, sessions and scripts have it. While it plays the view has one of its own
instead: playing is no edit, and when it stops the document takes the time over without a step of the history.
"""

from __future__ import annotations

from dataclasses import dataclass

from app.document.commands.poses import SetTime
from app.document.document import Document, ObjectState
from app.document.view_state import ViewState
from engine.realtime.zonal_harmonics.pose import Poses


@dataclass(frozen=True)
class Timeline:
    """The animation that is shown, its length and its time, seconds; None: as the file has it. clips: the names of all
    animations."""

    clip: str
    duration: float
    time: float | None
    clips: tuple[str, ...]


def timeline(document: Document, view: ViewState) -> Timeline | None:
    """The timeline; None where nothing is animated."""
    animated = [state for state in document.objects if state.animations]
    if not animated:
        return None
    lead = next((state for state in animated if state.moment is not None), animated[0])
    clip, seen = _clip_of(lead), None if lead.moment is None else lead.moment.time
    duration = next(each.duration for each in lead.animations if each.name == clip)
    time = seen if view.playing is None else view.playing
    if time is not None and duration > 0.0 and not 0.0 <= time <= duration:
        time %= duration
    clips = dict.fromkeys(each.name for state in animated for each in state.animations)
    return Timeline(clip, duration, time, tuple(clips))


def _clip_of(state: ObjectState) -> str:
    return state.animations[0].name if state.moment is None else state.moment.clip


def visible_poses(document: Document, view: ViewState) -> Poses:
    """The poses that are shown: the document's, or those of the playing animation."""
    return document.poses if view.playing is None else SetTime(view.playing).apply(document).poses


def advance_playback(line: Timeline, seconds: float, loops: bool) -> tuple[float, bool]:
    """The time so many seconds later, and whether it continues from there."""
    time = (line.time or 0.0) + seconds
    if time < line.duration:
        return time, True
    return (time % line.duration, True) if loops and line.duration > 0.0 else (line.duration, False)
