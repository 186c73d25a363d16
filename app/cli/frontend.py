"""The interface of commands to the window, passed in by the composition root: `app` itself never imports `ui`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from app.operators.script import Step


class Frontend(Protocol):
    """The window, with a display and without one."""

    def open_window(self, source: str) -> int:
        """Open the editor and run until it is closed; returns the exit status."""

    def take_screenshot(
        self, source: str, output: Path, steps: Sequence[Step], size: tuple[int, int], scale: float,
        resolution: tuple[int, int] | None,
    ) -> None:  # fmt: skip
        """Save a picture of the whole editor window after the steps, without a display. Raises InsituError."""

    def describe_graphics(self) -> str:
        """Renderer and version of OpenGL without a display. Raises InsituError that says what to install."""

    def describe_display(self) -> str:
        """The display and the OpenGL that a window would get. Raises InsituError where there is none."""
