"""The command line of the programs here: `python -m benchmarks.programs.NAME ... OUT.json`."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from engine.core.errors import InsituError

Figures = dict[str, Any]
Pictures = dict[str, np.ndarray]


def command_line(name: str, words: str, *positional: str) -> argparse.ArgumentParser:
    """The arguments of a program: its own, then the file that it writes. words: the module's, of which the first line
    says what it does."""
    parser = argparse.ArgumentParser(prog=f"python -m benchmarks.programs.{name}", description=words.splitlines()[0])
    for argument in positional:
        parser.add_argument(argument)
    parser.add_argument("output", type=Path)
    return parser


def resolution_of(given: argparse.Namespace) -> tuple[int, int] | None:
    """--resolution WIDTH HEIGHT, where it is given."""
    return None if given.resolution is None else (given.resolution[0], given.resolution[1])


def write_found(output: Path, measure: Callable[[], Figures | tuple[Figures, Pictures]]) -> int:
    """Measure, and write figures to `output` and pictures to an .npz beside it; the exit status."""

    def write() -> None:
        found = measure()
        figures, pictures = found if isinstance(found, tuple) else (found, {})
        if pictures:
            np.savez(output.with_suffix(".npz"), **pictures)  # type: ignore[arg-type]
        output.write_text(json.dumps(figures))

    return exit_status(write)


def exit_status(work: Callable[[], None]) -> int:
    """0, or 1 with one line on standard error where what is done fails."""
    try:
        work()
    except InsituError as error:
        print(f"insitu: {error}", file=sys.stderr)
        return 1
    return 0
