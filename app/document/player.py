"""Plays a scene's animation: the view's own time runs, and when it stops the document takes that time over."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

from app.document.commands.poses import SetTime
from app.document.document import Document
from app.document.history import History
from app.document.timeline import advance_playback, timeline
from app.document.view_state import ViewState


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
