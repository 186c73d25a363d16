"""What tests of the command line type, and a window's side that only notes what it was asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from app.cli import program
from app.cli.console import run_guarded
from app.operators.script import Step
from engine.core.colour import ConfigView
from engine.core.errors import InsituError
from tests.scene_text import camera, environment, material, placed

SCENE = (
    camera((0, 0, 4), resolution=(24, 16), head='name = "ball"\nbounces = 1\n')
    + environment(0.5)
    + placed("ball", "sphere", more=material('model = "lambert", name = "chalk", albedo = 1.0'))
)


class Recorder:
    """A window's side that notes what it was asked for."""

    def __init__(self, broken: bool = False) -> None:
        self.broken = broken
        self.opened: list[str] = []
        self.shots: list[tuple[Any, ...]] = []

    def open_window(self, source: str, view: ConfigView | None = None) -> int:
        self.opened.append(source)
        return 0

    def take_screenshot(
        self, source: str, output: Path, steps: Sequence[Step], size: tuple[int, int], scale: float,
        resolution: tuple[int, int] | None,
    ) -> None:  # fmt: skip
        self.shots.append((source, output, tuple(steps), size, scale, resolution))

    def describe_graphics(self) -> str:
        if self.broken:
            raise InsituError("OpenGL 4.1 core is needed, none could be opened")
        return "a renderer"

    def describe_display(self) -> str:
        raise InsituError("no display")


def run(*words: str | Path, frontend: Recorder | None = None) -> int:
    """The exit status of a command line."""
    return run_guarded(lambda: program.run([str(word) for word in words], frontend or Recorder()))
