"""The status of Orbit's own picture."""

from __future__ import annotations

from dataclasses import dataclass

from app.messages.editor_status import Status


@dataclass(frozen=True)
class OrbitStatus(Status):
    """The status while Orbit's picture is shown: its resolution (width, height), and how long the worker took to draw
    it; (0, 0) before there is one. is_headlight: nothing was ready for it, and objects are lit from the camera."""

    drawn_resolution: tuple[int, int] = (0, 0)
    drawn_seconds: float = 0.0
    is_headlight: bool = False

    @property
    def draws_moving(self) -> bool:
        return True

    @property
    def follows_input(self) -> bool:
        """True: pictures follow the pointer from the first on."""
        return self.is_headlight or self.picture != "waiting"
