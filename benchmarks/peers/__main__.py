"""`python -m benchmarks.peers [FOLDER]`: measure all programs, keep their pictures in FOLDER, write docs/peers.md.

`INSITU_PEER_PYTHON` names an interpreter with mitsuba and pyoidn, which also makes the truths; `INSITU_CYCLES_PYTHON`
one with bpy, pyoidn and OpenEXR. What FOLDER has from a run before is not measured again.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from app.cli.console import run_guarded
from app.system.kernel_cache import use_kernel_cache

PAGE = Path(__file__).resolve().parents[2] / "docs" / "peers.md"


def main(arguments: list[str] | None = None) -> int:
    """The command line; its exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers", description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=Path("out/peers"))
    parser.add_argument("--page", type=Path, default=PAGE)
    given = parser.parse_args(arguments)
    use_kernel_cache()  # before the engine's kernels are imported

    def measure() -> int:
        from benchmarks.peers.measurement import measure_case
        from benchmarks.peers.page import page
        from benchmarks.peers.scenes import CASES

        found = [measure_case(case, given.folder.resolve() / case.name) for case in CASES]
        given.page.write_text(page(found), encoding="utf-8")
        return 0

    return run_guarded(measure)


if __name__ == "__main__":
    sys.exit(main())
