"""The animations of a scene's files on one timeline, the document's time on it, and the player.

A time is a part of the document, so that undo, sessions and scripts have it. While it plays the view has one of its own
instead: playing is no edit, and when it stops the document takes the time over without a step of the history.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

from app.document.commands.poses import SetTime
from app.document.document import Document, ObjectState
from app.document.history import History
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


class PlayerHost(Protocol):
    """What the player needs of the editor."""

    view: ViewState
    history: History[Document]

    @property
    def document(self) -> Document: ...

    def playback_stopped(self, before: Document) -> None: ...


class Player:
    """Plays and stops the animation of `stage`. Its times are `now` of `advance`, a steady clock in seconds."""

    def __init__(self, stage: PlayerHost) -> None:
        self._host = stage
        self._advanced_at: float | None = None

    def play(self) -> None:
        """Continue the animation from its time, or from its start where it is at its end."""
        stage = self._host
        line = timeline(stage.document, stage.view)
        if line is not None and stage.view.playing is None:
            starts_anew = line.time is None or not stage.view.loops and line.time >= line.duration
            self._advanced_at = None
            stage.view = replace(stage.view, playing=0.0 if starts_anew else line.time)

    def pause(self) -> None:
        """Stop it; the document takes the shown time over, which is no step of the history."""
        stage = self._host
        time, stage.view = stage.view.playing, replace(stage.view, playing=None)
        if time is not None and timeline(stage.document, stage.view) is not None:
            before = stage.document
            stage.history.apply_unrecorded(SetTime(time))
            stage.playback_stopped(before)

    def advance(self, now: float) -> None:
        """Advance the shown time while playing; once a frame."""
        stage = self._host
        before, self._advanced_at = self._advanced_at, now
        if stage.view.playing is None:
            return
        line = timeline(stage.document, stage.view)
        if line is None:
            stage.view = replace(stage.view, playing=None)
            return
        time, goes_on = advance_playback(line, 0.0 if before is None else max(now - before, 0.0), stage.view.loops)
        stage.view = replace(stage.view, playing=time)
        if not goes_on:
            self.pause()
