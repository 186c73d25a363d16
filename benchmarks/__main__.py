"""`python -m benchmarks [SCENE] -o DIR [--quick] [--only PART]`: see the package."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from app.cli.console import run_guarded
from app.document.sources import find_source
from app.measure.study import ended_in_order
from app.system.kernel_cache import use_kernel_cache
from benchmarks import PARTS
from engine.scene.builtin import DEFAULT_SCENE


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description="Measure the project on this machine.")
    parser.add_argument("scene", nargs="?", default=DEFAULT_SCENE, help="a built-in scene or a file")
    parser.add_argument("-o", "--output", type=Path, required=True, help="the folder for figures, CSV and plots")
    parser.add_argument("--quick", action="store_true", help="tiny pictures, to see that all works")
    parser.add_argument("--only", action="append", choices=PARTS, metavar="PART", help=f"one of {', '.join(PARTS)}")
    given = parser.parse_args(arguments)
    use_kernel_cache()  # before the engine's kernels are imported

    def measure() -> int:
        from benchmarks.run import run

        with ended_in_order():
            run(find_source(given.scene), given.output, given.quick, only=given.only or PARTS)
        return 0

    return run_guarded(measure)


if __name__ == "__main__":
    sys.exit(main())
