"""The pictures of looks beside the current one: which ones panels show in this frame, and what there is of them.

As `ui.panels.pictures.BrdfBoard`: panels note what they show, `ui.look_feed` has that drawn and nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ui.panels.pictures import Picture


@dataclass
class LookBoard:
    """shown: the looks on screen, and the size of the place of each, (width, height); pictures: those there are;
    states: what is still missing of each, in a word, "" for nothing; outdated: of which looks the picture is of
    something else by now; stand_in: a finished picture of the current look,
    until the one that is edited is as far after a switch; progress: what is being drawn, "" for nothing."""

    shown: dict[str, tuple[int, int]] = field(default_factory=dict)
    pictures: dict[str, Picture] = field(default_factory=dict)
    states: dict[str, str] = field(default_factory=dict)
    outdated: frozenset[str] = frozenset()
    stand_in: Picture | None = None
    progress: str = ""
    is_stopped: bool = False

    def begin_frame(self) -> None:
        """Clear the list of what is on screen, which panels fill again."""
        self.shown.clear()
