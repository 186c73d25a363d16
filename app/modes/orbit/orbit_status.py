"""What is to be said of Orbit's own picture."""

from __future__ import annotations

from dataclasses import dataclass

from app.messages.editor_status import Status


@dataclass(frozen=True)
class OrbitStatus(Status):
    """The status while Orbit's picture is seen: in how many pixels (width, height) it was drawn, and how long that took
    in the worker; (0, 0) before there is one. is_plain: nothing was ready for it, and objects are lit from the eye."""

    drawn_resolution: tuple[int, int] = (0, 0)
    drawn_seconds: float = 0.0
    is_headlight: bool = False

    @property
    def draws_moving(self) -> bool:
        return True

    @property
    def follows_input(self) -> bool:
        """It is: pictures are drawn as the hand moves, from the first on."""
        return self.is_headlight or self.picture != "waiting"
