"""Compares the pictures of two checkouts, bit by bit: every built-in scene in every mode.

    python -m benchmarks.compare_checkouts OLD NEW [--scenes ring ...] [--modes orbit ...] [--bounces 1 2]

OLD and NEW are folders with a checkout each, set up by `make setup`. Each one renders in one process of its own, with
its own Python and an empty state folder, through the command line alone, so that renamed modules do not matter. A
change of structure or names must leave every picture as it is; the script ends with 1 where one differs.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR

MODES = ("placement", "orbit", "deform")

# Runs in a checkout: renders each picture that stdin names, as [[arguments of `insitu`, ...], ...].
_RENDER = """
import json, sys
from app.__main__ import main
for arguments in json.load(sys.stdin):
    sys.argv = ["insitu", *arguments]
    main()
"""


@dataclass(frozen=True)
class Comparison:
    """How the pictures of one scene and mode compare.

    n_different: pixels that differ; largest: the largest difference, in units of the mean radiance of the old picture.
    """

    name: str
    n_different: int
    n_pixels: int
    largest: float

    @property
    def same(self) -> bool:
        return self.n_different == 0


def render_all(checkout: Path, folder: Path, names: Sequence[tuple[str, str, int]], size: tuple[int, int]) -> None:
    """Renders each (scene, mode, bounces) with a checkout's own program into `folder`."""
    folder.mkdir(parents=True)
    tasks = [
        ["render", scene, "-o", str(folder / file_name(scene, mode, bounces)), "--mode", mode]
        + ["--resolution", *map(str, size)]
        + (["--bounces", str(bounces)] if mode == "placement" else [])
        for scene, mode, bounces in names
    ]
    with tempfile.TemporaryDirectory() as state:
        subprocess.run(
            [str(checkout / ".venv" / "bin" / "python"), "-c", _RENDER],
            input=json.dumps(tasks), text=True, cwd=checkout, check=True, env={**os.environ, "INSITU_STATE": state},
        )  # fmt: skip


def file_name(scene: str, mode: str, bounces: int) -> str:
    return f"{scene}-{mode}-{bounces}.exr"


def compare(name: str, old: Path, new: Path) -> Comparison:
    """Compares two pictures of (H, W, 3) float32 by their bits: -0 is not 0, and NaN equals itself."""
    first, second = read_picture(old), read_picture(new)
    if first.shape != second.shape:
        return Comparison(name, first[..., 0].size, first[..., 0].size, float("inf"))
    different = (first.view(np.uint32) != second.view(np.uint32)).any(axis=-1)
    mean = max(float(np.nanmean(np.abs(first))), 1e-20)
    largest = float(np.nanmax(np.abs(first.astype(np.float64) - second), initial=0.0)) / mean
    return Comparison(name, int(different.sum()), different.size, largest)


def read_picture(path: Path) -> np.ndarray:
    """The radiance in an EXR file, (H, W, 3) float32."""
    with OpenEXR.File(str(path)) as file:
        return np.ascontiguousarray(file.channels()["RGB"].pixels, dtype=np.float32)


def built_in_scenes(checkout: Path) -> list[str]:
    return sorted(path.name for path in (checkout / "assets" / "scenes").iterdir() if path.is_dir())


def main() -> int:
    parser = argparse.ArgumentParser(description="Compare the pictures of two checkouts bit by bit.")
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("--scenes", nargs="*")
    parser.add_argument("--modes", nargs="*", choices=MODES, default=MODES)
    parser.add_argument("--bounces", nargs="*", type=int, default=[1], help="of Placement's pictures")
    parser.add_argument("--resolution", nargs=2, type=int, default=(64, 48), metavar=("W", "H"))
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("out/comparison"), help="a folder that is not there yet"
    )
    given = parser.parse_args()
    names = [
        (scene, mode, bounces)
        for scene in given.scenes or built_in_scenes(given.old)
        for mode in given.modes
        for bounces in (given.bounces if mode == "placement" else given.bounces[:1])
    ]
    for side in ("old", "new"):
        render_all(getattr(given, side).resolve(), (given.output / side).resolve(), names, tuple(given.resolution))
    results = [
        compare(
            f"{scene}, {mode}, {bounces}",
            *(given.output / side / file_name(scene, mode, bounces) for side in ("old", "new")),
        )
        for scene, mode, bounces in names
    ]
    for result in results:
        words = (
            "same"
            if result.same
            else f"{result.n_different} of {result.n_pixels} pixels, {result.largest:.2g} of the mean"
        )
        print(f"{result.name:40} {words}")
    print(f"{sum(result.same for result in results)} of {len(results)} pictures are the same, bit by bit")
    return 0 if all(result.same for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
