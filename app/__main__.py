"""`insitu` and `python -m app`: the composition root, the one place that knows both the program and its window.

`insitu` and `insitu SCENE` go straight to the window: importing the command line's library would cost a tenth of the
second and a half in which the window should be there. This module imports nothing of the program, so that Ctrl-C is
quiet from the first moment on.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from app.operators.script import Step
    from app.worker.process import StartedWorker
    from engine.core.colour import ConfigView

INTERRUPTED = 130


class Desktop:
    """The window's side; each part of it is imported when it is used."""

    def open_window(self, source: str, view: ConfigView | None = None) -> int:
        # First of all start the worker, which imports its libraries while this process imports the window's.
        started = _started_worker()
        from app.worker.client import Client

        with Client(started=started) as client:
            from ui.window import run

            return run(source, client=client, view=view)

    def take_screenshot(
        self, source: str, output: Path, steps: Sequence[Step], size: tuple[int, int], scale: float,
        resolution: tuple[int, int] | None,
    ) -> None:  # fmt: skip
        from ui.script_runner import take_screenshot

        take_screenshot(source, output, steps=steps, size=size, scale=scale, resolution=resolution)

    def describe_graphics(self) -> str:
        from ui.gl.context import create_headless_context, describe_context

        context = create_headless_context()
        try:
            return describe_context(context)
        finally:
            context.release()

    def describe_display(self) -> str:
        from ui.display import describe_display

        return describe_display()


def _started_worker() -> StartedWorker | None:
    from app.worker.process import start_worker

    try:
        return start_worker()
    except OSError:
        return None  # the client tries once more and reports why it fails


def main() -> int:
    """Run the program on its command line; returns the exit status: 0, 1 (the work failed), 2 (usage), 130 (Ctrl-C)."""
    try:
        from app.cli.console import escape_unprintable, run_guarded
        from app.system.kernel_cache import use_kernel_cache

        escape_unprintable()
        use_kernel_cache()
        return run_guarded(lambda: _run(sys.argv[1:]))
    except KeyboardInterrupt:
        return INTERRUPTED


def _run(arguments: list[str]) -> int:
    from app.cli.console import COMMANDS
    from app.document.sources import find_source

    if not arguments or (len(arguments) == 1 and arguments[0] not in COMMANDS and arguments[0][:1] != "-"):
        return Desktop().open_window(find_source(arguments[0] if arguments else None))
    from app.cli.program import run

    return run(arguments, Desktop())


if __name__ == "__main__":
    sys.exit(main())
