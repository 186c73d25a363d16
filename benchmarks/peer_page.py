"""docs/peers.md: an edit of a BRDF here and in Mitsuba 3, to equal error: `python -m benchmarks.peer_page [FOLDER]`.

`INSITU_PEER_PYTHON` names an interpreter that has Mitsuba 3; the scenes are those with path-traced references beside
the checkout, whose materials both have. FOLDER: where the page goes, docs/ unless named.
"""

from __future__ import annotations

import json
import os
import platform
import statistics
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from app.project.project import open_project
from benchmarks.figures import NotMeasured
from benchmarks.launches import run_program
from benchmarks.peer import Stills, inner_pixels, peer_python, render_stills
from benchmarks.references import reference_folder
from engine.precompute.direct.pipeline import Placement

LONGEST_SECONDS = 3000.0
REPETITIONS = 3
SAMPLES, N_STILLS = 64, 6
DOCS = Path(__file__).resolve().parents[1] / "docs"


@dataclass(frozen=True)
class Edit:
    """One parameter of a scene's layer, and what it becomes."""

    scene: str
    resolution: tuple[int, int]
    object: str
    layer: int
    parameter: str
    value: str

    @property
    def path(self) -> str:
        return f"{self.object}.{self.layer}.{self.parameter}"


EDITS = (
    Edit("teatray", (160, 120), "teapot", 1, "alpha", "0.22"),
    Edit("bunny", (128, 128), "bunny", 0, "albedo", "[0.6, 0.35, 0.2]"),
    Edit("cornell", (128, 128), "back", 1, "alpha", "0.25"),
)


@dataclass(frozen=True)
class Found:
    """What both sides took, and how far ours is off, after one edit."""

    edit: Edit
    n_bounces: int
    times: dict[str, list[float]]
    errors: dict[str, float]
    stills: Stills
    noise: float
    renderer: str

    def peer_seconds(self, error: float, cpu: bool) -> list[float]:
        """Of each still, for that error."""
        seconds = self.stills.cpu_seconds if cpu else self.stills.seconds
        assert seconds is not None
        return [each * (self.noise / error) ** 2 for each in seconds.tolist()]


def measure(edit: Edit, python: str, folder: Path, scratch: Path) -> Found:
    """Ours, then theirs. Raises NotMeasured."""
    source, output = folder / f"{edit.scene}.toml", scratch / "ours.json"
    size = [str(side) for side in edit.resolution]
    words = [str(source), f"{edit.path}={edit.value}", str(output), "--repetitions", str(REPETITIONS)]
    program = [sys.executable, "-m", "benchmarks.programs.edit", *words, "--resolution", *size]
    run_program(program, scratch / "ours", LONGEST_SECONDS)
    ours = json.loads(output.read_text())
    changed = (edit.object, str(edit.layer), edit.parameter, edit.value)
    rendered = (edit.resolution, ours["n_bounces"], scratch / "theirs", LONGEST_SECONDS, SAMPLES, N_STILLS, changed)
    stills = render_stills(python, source, *rendered)
    mask = inner_pixels(Placement(open_project(str(source), edit.resolution).scene).hits)
    with np.load(output.with_suffix(".npz")) as pictures:
        errors = {name: stills.error_of(pictures[name], mask) for name in ("before", "framed", "exact")}
    times = {name: value for name, value in ours.items() if name.endswith("_s")}
    return Found(edit, ours["n_bounces"], times, errors, stills, stills.noise(mask), ours["renderer"])


def page(found: Sequence[Found]) -> str:
    """The page, in Markdown."""
    edits = [_row(each, *which) for each in found for which in (("framed", "frame"), ("exact", "exact"))]
    numbers = {"samples": SAMPLES, "n_stills": N_STILLS, "repetitions": REPETITIONS}
    tables = {"edits": _table(EDIT_COLUMNS, edits), "stills": _table(STILL_COLUMNS, map(_still_row, found))}
    made_with, renderer = found[0].stills.made_with, found[0].renderer
    return PAGE.format(**tables, **numbers, made_with=made_with, renderer=renderer, machine=_machine())


def _table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _row(found: Found, picture: str, timed: str) -> Sequence[str]:
    edit, error = found.edit, found.errors[picture]
    ours, theirs = found.times[f"{timed}_cpu_s"], found.peer_seconds(error, cpu=True)
    ratio = min(theirs) / min(ours)
    name = f"{edit.scene}: `{edit.path}={edit.value}`" if picture == "framed" else ""
    what = "first frame" if picture == "framed" else "finished"
    return name, what, _spread(found.times[f"{timed}_s"]), _spread(ours), f"{error:.1%}", _spread(theirs), _short(ratio)


def _still_row(found: Found) -> Sequence[str]:
    used = found.stills.cpu_seconds
    assert used is not None
    width, height = found.edit.resolution
    return (
        found.edit.scene, f"{width} × {height}", str(found.n_bounces), f"{found.errors['before']:.1%}",
        f"{found.noise:.1%}", _spread(found.stills.seconds.tolist()), _spread(used.tolist()),
    )  # fmt: skip


def _spread(seconds: Sequence[float]) -> str:
    """Median and range, in a unit that reads well."""
    middle = statistics.median(seconds)
    factor, unit = (1e3, "ms") if middle < 0.5 else (1.0, "s")
    low, mid, high = (_short(factor * each) for each in (min(seconds), middle, max(seconds)))
    return f"{mid} {unit} ({low} to {high})"


def _short(value: float) -> str:
    """Two figures, or as many as stand before the point."""
    return f"{value:,.0f}" if value >= 10 else f"{value:.2g}"


def _machine() -> str:
    models = [line for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("model name")]
    name = models[0].partition(": ")[2] if models else platform.processor()
    load = psutil.getloadavg()[0]
    return f"{len(models) or os.cpu_count()} cores of an {name}, {platform.system()}, load {load:.1f} at the end"


EDIT_COLUMNS = (
    "scene and edit", "our picture", "seconds", "processor time", "its error", "Mitsuba's processor time to that error",
    "ratio",
)  # fmt: skip
STILL_COLUMNS = (
    "scene", "pixels", "bounces", "error of the picture before the edit", "noise of a still", "seconds of a still",
    "processor time",
)  # fmt: skip
PAGE = """# An edit here, and in a path tracer

Written by `python -m benchmarks.peer_page`, which makes it anew where `INSITU_PEER_PYTHON` names an interpreter that
has Mitsuba 3. It asks: one parameter of a BRDF changes; how long until a picture is there that is as near to the truth?

{edits}

Median and range of {repetitions} edits, each taken back before the next, after one that is not counted; of Mitsuba's,
of {n_stills} stills. *Ratio* is of processor time, the shortest of each side, which other programs disturb least: how
many of our pictures there are in the time of one of theirs. *First frame* is the one that the window draws in answer to
the edit, with as many increments as its budget allows; *finished* is the picture when nothing more comes: with bands
for the new roughness' shadowing term, and indirect light, where the edit changes these.

{stills}

The error of the picture before the edit says what doing nothing would cost: a frame is worth its time where the first
table's errors are below it.

## How it was measured

- {machine}; ours draws with {renderer}; theirs is {made_with}, with compiled kernels: a still before is not timed.
- What others do on the machine lengthens seconds by far more than processor time, which it lengthens as well, up to
  three times for a still of Mitsuba's: where the load was high, ranges are wide, and ratios no better than to a half.
- Both sides take turns, scene by scene. Processor time is of all threads; ours of window and worker together.
- Errors are relative RMS errors, linear, clamped at the 99.9 percentile, over pixels two off silhouettes and creases.
  The truth is the mean of Mitsuba's stills of the edited scene; ours is measured against two halves of them, whose
  noises are independent, so that they do not count (`benchmarks/peer.py`). Where a still is much noisier than ours is
  wrong, what is left of it blurs our error by some tenths of a percent.
- A still has {samples} samples a pixel. Its noise comes from the spread of all stills, its seconds for another error e
  go by 1/e².

## What is not equal

- Ours had precomputed, for this camera and this light, and keeps what it made; Mitsuba starts from nothing, and may
  turn the camera at no cost. What precomputation takes stands in [benchmarks](benchmarks.md).
- Ours is off by what its bands, lights and cells leave out, smoothly, and does not get better with time; theirs is
  noise, of which a denoiser takes most away, and no denoiser was used.
- Mitsuba averages each pixel over its area, ours looks through its centre but at edges, which are left out here.
- Its seconds are for rendering alone: changing a parameter, which takes it milliseconds, is not in them.
- Mitsuba reads rows of an environment half a texel off; it was given a map that it reads as it was meant.
- It runs on the processor here as ours does; on a graphics card both would be other numbers.
"""


def main() -> int:
    folder = reference_folder()
    output = Path(sys.argv[1]) if sys.argv[1:] else DOCS
    try:
        python = peer_python()
        if folder is None:
            raise NotMeasured("../shared/reference is not beside this checkout")
        with tempfile.TemporaryDirectory() as scratch:
            found = [measure(edit, python, folder, Path(scratch) / edit.scene) for edit in EDITS]
    except NotMeasured as error:
        print(f"peers: {error}", file=sys.stderr)
        return 1
    (output / "peers.md").write_text(page(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
