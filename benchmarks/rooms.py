"""Built-in interiors that nothing was tuned for, against paths of our own through them.

Paths are traced anew each time, by `engine.reference.path_tracer`, at the pixels that see what reflects; what shines
itself is left out, being the same in both. Their own noise stands beside each error: it is part of it. Where light has
come so far that it stays noisy, blocks of 8 × 8 pixels are compared.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.project.project import Project, open_project
from app.stills.stills import render_picture
from benchmarks.figures import Figure, not_measured
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.render.picture_difference import Errors, errors

BLOCK = 8
# Of the picture's mean: in what is darker, a blotch is seen against this.
_DARK = 0.1
# Room -> the side in pixels of the blocks that are compared, once light has been reflected more than once.
ROOMS: Mapping[str, int] = {"stairwell": 1, "ajar": BLOCK, "storeroom": 1}
N_BOUNCES = 4
KINDS = {1: ("direct_error", "direct_mean"), N_BOUNCES: ("error", "mean")}  # by bounces


@dataclass(frozen=True)
class RoomEffort:
    """Pixels of the pictures, and paths a pixel of the judge."""

    resolution: tuple[int, int] = (128, 96)
    n_samples: int = 4096


def room_figures(effort: RoomEffort | None, report: Callable[[str], None]) -> list[Figure]:
    """Error and difference of means of each room, in direct light and with all bounces; None: left out."""
    figures: list[Figure] = []
    for name, block in ROOMS.items():
        report(f"paths through {name}")
        for n_bounces, kinds in KINDS.items():
            names = [f"room_{kind}_{name}" for kind in kinds]
            if effort is None:
                figures += [not_measured(each, "left out of a quick run") for each in names]
            else:
                figures += _figures_of(names, name, effort, n_bounces, block if n_bounces > 1 else 1)
    return figures


def _figures_of(names: Sequence[str], room: str, effort: RoomEffort, n_bounces: int, block: int) -> list[Figure]:
    found, noise, blotch = room_errors(room, effort, n_bounces, block)
    size = "{} × {}".format(*effort.resolution)
    how = f"`insitu render {room} --bounces {n_bounces}` at {size} against --reference --samples {effort.n_samples}"
    how += f", in blocks of {block} × {block} pixels" * (block > 1)
    parts = {"signed_mean": found.mean, "noise_of_judge": noise, "largest_blotch": blotch}
    values = (found.rmse, abs(found.mean))
    return [Figure(name, (value,), how, parts) for name, value in zip(names, values, strict=True)]


def room_errors(name: str, effort: RoomEffort, n_bounces: int, block: int = 1) -> tuple[Errors, float, float]:
    """A room's still against paths through it, the noise (relative RMS, a pixel) of those paths, and the largest
    blotch."""
    project, noise = open_project(name, effort.resolution).with_settings(n_edge_rays=0), 0.0

    def listen(step: object) -> None:
        nonlocal noise
        noise = getattr(step, "noise", None) or noise

    series = BounceSeries(n_bounces)
    truth = render_picture(project, listen, reference=True, series=series, n_samples=effort.n_samples)
    ours = render_picture(project, lambda step: None, series=series)
    return compared(project, ours, truth, block), noise, largest_blotch(project, ours, truth)


def compared(project: Project, ours: NDArray[np.floating], truth: NDArray[np.floating], block: int = 1) -> Errors:
    """Errors over the pixels of (H, W, 3) pictures that see what reflects, or over blocks of them."""
    seen = Placement(project.scene).hits.pixel
    return errors(*(block_means(picture, seen, block) for picture in (ours, truth)))


def largest_blotch(project: Project, ours: NDArray[np.floating], truth: NDArray[np.floating]) -> float:
    """By how much a block of 8 × 8 pixels is off at most, relative to itself and a tenth of the picture's mean."""
    seen = Placement(project.scene).hits.pixel
    mine, theirs = (block_means(picture, seen, BLOCK).mean(axis=1) for picture in (ours, truth))
    return float(np.max(abs(mine - theirs) / (theirs + _DARK * theirs.mean())))


def block_means(picture: NDArray[np.floating], pixels: NDArray[np.integer], block: int) -> NDArray[np.float64]:
    """Means (B, 3) of (H, W, 3) over blocks of so many pixels in height and width, of the given pixels (P,) alone.

    Blocks that hold none are left out.
    """
    width = picture.shape[1]
    y, x = np.divmod(pixels, width)
    _, places, counts = np.unique(y // block * width + x // block, return_inverse=True, return_counts=True)
    sums = np.zeros((len(counts), 3))
    np.add.at(sums, places.ravel(), picture.reshape(-1, 3)[pixels])
    return sums / counts[:, None]
