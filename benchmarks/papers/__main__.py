"""`python -m benchmarks.papers [--docs DIR] [--only PAGE[/ENTRY]] [--quick]`: see the package."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from app.cli.console import run_guarded
from app.measure.study import ended_in_order, machine_facts
from app.system.kernel_cache import use_kernel_cache


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.papers", description="Measure beside the papers.")
    parser.add_argument(
        "--docs", type=Path, default=Path("docs"), help="the folder whose papers/ and images/ are written"
    )
    parser.add_argument("--kept", type=Path, default=Path("out/papers"), help="where texts of entries are kept")
    parser.add_argument(
        "--only", action="append", default=[], metavar="NAME", help="a page, or an entry of one, such as ma06/table-3"
    )
    parser.add_argument("--quick", action="store_true", help="tiny pictures, to see that all works")
    given = parser.parse_args(arguments)
    use_kernel_cache()  # before the engine's kernels are imported

    def measure() -> int:
        from benchmarks.papers.entries import Work
        from benchmarks.papers.pages import Kept, carry_out, chosen, conditions_of

        if given.only and not list(chosen(given.only)):
            parser.error(f"no entry {given.only[0]}, expected a page such as ma06 or an entry such as ma06/table-3")
        with ended_in_order():
            work = Work(given.docs, given.quick, print)
            carry_out(work, Kept(given.kept), given.only, conditions_of(machine_facts()))
        return 0

    return run_guarded(measure)


if __name__ == "__main__":
    sys.exit(main())
