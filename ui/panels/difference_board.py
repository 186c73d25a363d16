"""What panels show of the comparison with a stored picture; `ui.difference_feed` makes it."""

from __future__ import annotations

from dataclasses import dataclass

from ui.panels.pictures import Picture


@dataclass(frozen=True)
class DifferenceBoard:
    """stored: the stored picture through the view; colours: the difference in false colours; error: relRMSE of the
    present picture against the stored one; None while unknown. is_behind: whether they are of the picture before
    the last edit; refusal: why there is no difference, "" where there is."""

    stored: Picture | None = None
    colours: Picture | None = None
    error: float | None = None
    is_behind: bool = False
    refusal: str = ""
