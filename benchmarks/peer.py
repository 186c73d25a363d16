"""Precomputation of indirect light held against one still by a path tracer of others, Mitsuba 3, at equal error.

The peer is used where `INSITU_PEER_PYTHON` names an interpreter that can import it. It renders several stills with
independent seeds. What one of them is wrong by needs no truth, since path tracing is right on average: it is the
deviation of a still from the others. Samples, and with them seconds, for another error e go by 1/e². Its stratified
samples gain a little more than that, so it is asked for about as many as the error needs: extrapolating from few of
them would ask too much of it.

Our error is measured against the same stills. With their means A and B over two independent halves,

    mean((ours − A)(ours − B))

is our mean squared error without the stills' noise in it, since the two noises are independent and 0 on average.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.project.project import Project, open_project
from app.stills.stills import render_picture
from benchmarks.figures import Figure, NotMeasured, not_measured
from benchmarks.launches import run_program
from benchmarks.references import reference_folder
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import parse_series
from engine.render.picture_difference import CLAMP_PERCENTILE, errors
from engine.scene.primary_hits import PrimaryHits

VARIABLE = "INSITU_PEER_PYTHON"
PROGRAM = Path(__file__).with_name("programs") / "mitsuba_stills.py"
FIGURE = "gi_precompute_ratio_peer"
# Little work that keeps to the target: 1.8 % off. As many rays as the plan chooses leave 1.2 %, for twice the time.
# With 64,1,1,1 the albedo of the glossy wall alone misses 2.9 %, whatever the number of rays.
SERIES, N_HEMISPHERE_RAYS = "64,8,8,1", 128
TARGET = 0.03
RESOLUTION = (450, 450)
SAMPLES, N_STILLS = 256, 2
MARGIN = 2
CREASE = 0.9

Pictures = NDArray[np.floating]


@dataclass(frozen=True, eq=False)
class Stills:
    """The peer's stills: pictures (n, H, W, 3), seconds (n,) with compiled kernels, samples each; cpu_seconds (n,): of
    processor time."""

    pictures: Pictures
    seconds: NDArray[np.floating]
    samples: int
    made_with: str
    cpu_seconds: NDArray[np.floating] | None = None

    def still_seconds(self, mask: NDArray[np.bool_], error: float) -> float:
        """What one still with this error would take."""
        return statistics.median(self.seconds.tolist()) * (self.noise(mask) / error) ** 2

    def noise(self, mask: NDArray[np.bool_]) -> float:
        """relRMSE of one still, from the spread of all; like every error, clamped at the mean's 99.9 percentile."""
        pictures, mean = self.pictures[:, mask].astype(np.float64), self.pictures[:, mask].mean(axis=0)
        pictures = np.minimum(pictures, np.percentile(mean, CLAMP_PERCENTILE))
        return float(np.sqrt(pictures.var(axis=0, ddof=1).mean()) / pictures.mean())

    def error_of(self, ours: Pictures, mask: NDArray[np.bool_]) -> float:
        """relRMSE of another picture without the stills' own noise, see above."""
        a, b = (self.pictures[i::2, mask].mean(axis=0, dtype=np.float64) for i in (0, 1))
        return cleared_error(ours[mask], a, b)


def cleared_error(picture: Pictures, a: Pictures, b: Pictures) -> float:
    """relRMSE against two halves of a truth, without their noise, see above; any equal shapes. Clamped at the 99.9
    percentile of the halves' mean."""
    top = np.percentile((a + b) / 2, CLAMP_PERCENTILE)
    mine, a, b = (np.minimum(np.asarray(each, np.float64), top) for each in (picture, a, b))
    return float(np.sqrt(max(float(np.mean((mine - a) * (mine - b))), 0.0)) / np.mean((a + b) / 2))


def peer_figure(repetitions: int, scratch: Path, timeout_s: float, report: Callable[[str], None]) -> Figure:
    """Seconds to 3 % error, everything but opening the scene, over those of one still of that error."""
    try:
        return _measure(repetitions, scratch / "peer", timeout_s)
    except NotMeasured as error:
        report(f"no path-traced still to hold the precomputation against: {error}")
        return not_measured(FIGURE, str(error))


def _measure(repetitions: int, scratch: Path, timeout_s: float) -> Figure:
    python = peer_python()
    folder = reference_folder()
    if folder is None:
        raise NotMeasured("../shared/reference is not beside this checkout")
    source = folder / "cornell.toml"
    project = open_project(str(source), RESOLUTION).with_settings(n_hemisphere_rays=N_HEMISPHERE_RAYS)
    mask = inner_pixels(Placement(project.scene).hits)
    ours, before = _timed(project)
    stills = render_stills(python, source, RESOLUTION, parse_series(SERIES).n_bounces, scratch, timeout_s)
    seconds = [before, *(_timed(project)[1] for _ in range(repetitions - 1))]
    error = stills.error_of(ours, mask)
    if error > TARGET:
        raise NotMeasured(f"relRMSE {error:.3f} of ours, the peer is asked for {TARGET:g}")
    theirs = stills.still_seconds(mask, TARGET)
    return Figure(
        FIGURE,
        tuple(each / theirs for each in seconds),
        f"../shared/reference/cornell.toml at {RESOLUTION[0]} × {RESOLUTION[1]}, series {SERIES} by "
        f"{N_HEMISPHERE_RAYS} rays with all direct light ÷ one still of relRMSE {TARGET:g} by {stills.made_with}, "
        f"both from an opened scene with compiled kernels "
        f"(a small still of the peer's before is not timed); its seconds scaled from {SAMPLES} samples by 1/error²; "
        f"pixels {MARGIN} off silhouettes and creases",
        {
            "seconds": seconds,
            "error": error,
            "error_with_noise_of_truth": errors(ours[mask], stills.pictures[:, mask].mean(axis=0)).rmse,
            "peer_seconds": theirs,
            "peer_still_seconds": stills.seconds.tolist(),
            "peer_still_error": stills.noise(mask),
        },
    )


def peer_python() -> str:
    """The interpreter that has the peer; raises NotMeasured where none is named."""
    python = os.environ.get(VARIABLE, "")
    if not python:
        raise NotMeasured(f"{VARIABLE} names no interpreter that has Mitsuba 3")
    return python


def render_stills(
    python: str, source: Path, resolution: tuple[int, int], n_bounces: int, scratch: Path, timeout_s: float,
    samples: int = SAMPLES, n_stills: int = N_STILLS, edit: Sequence[str] = (),
) -> Stills:  # fmt: skip
    """Have the peer render; edit: object, layer, parameter and JSON value that are not as the file has them. Raises
    NotMeasured with its last words."""
    output = scratch / "stills.npz"
    numbers = (*resolution, n_bounces, samples, n_stills)
    run_program([python, str(PROGRAM), str(source), str(output), *map(str, numbers), *edit], scratch, timeout_s)
    with np.load(output) as found:
        return Stills(found["pictures"], found["seconds"], samples, str(found["made_with"]), found["cpu_seconds"])


def inner_pixels(hits: PrimaryHits) -> NDArray[np.bool_]:
    """Pixels (H, W) that see the same reflecting object as all within 2 pixels, and no crease among them."""
    width, height = hits.resolution
    normals = np.zeros((height, width, 3), np.float32)
    normals.reshape(-1, 3)[hits.pixel] = hits.normal
    keep = np.zeros((height, width), bool)
    keep.ravel()[hits.pixel] = True
    for dy in range(-MARGIN, MARGIN + 1):
        for dx in range(-MARGIN, MARGIN + 1):
            keep &= np.roll(hits.object_image, (dy, dx), (0, 1)) == hits.object_image
            keep &= (np.roll(normals, (dy, dx), (0, 1)) * normals).sum(axis=2) > CREASE
    keep[:MARGIN] = keep[-MARGIN:] = False
    keep[:, :MARGIN] = keep[:, -MARGIN:] = False
    return keep


def _timed(project: Project) -> tuple[Pictures, float]:
    started = time.perf_counter()
    picture = render_picture(project, lambda step: None, series=parse_series(SERIES))
    return picture, time.perf_counter() - started
