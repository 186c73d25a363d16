"""Path-traced pictures by another program, in the folder shared/reference beside the checkout where it is there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from app.measure.subject import Precomputed, Subject, reflected
from engine.light.radiance_files import read_radiance_image
from engine.render.picture_difference import Errors, errors
from engine.render.still import compose
from engine.scene.primary_hits import PrimaryHits

REFERENCES = ("teatray", "bunny", "cornell")
# Cosine between a shading normal and the direction to the camera.
EDGE_ON = 0.01

Float64Array = NDArray[np.float64]


def reference_folder() -> Path | None:
    """The folder of path-traced references beside the checkout, if it is there."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "reference"
    return folder if folder.is_dir() else None


def masked_reference(
    folder: Path, name: str, n_bounces: int, hits: PrimaryHits
) -> tuple[Float64Array, NDArray[np.bool_]]:
    """NAME_N.exr (H, W, 3) and which of its pixels count (H, W): what NAME_mask.png marks, but for points whose shading
    normal is seen edge-on.

    There an interpolated normal may lean away from the camera. It is bent to the camera's side here; the references
    turn it into the body, a dark dot. Two such pixels of the tea tray's 27,895 made 1.3 % of relRMSE.
    """
    mask = np.asarray(Image.open(folder / f"{name}_mask.png").convert("L")) > 127
    edge_on = np.einsum("pc,pc->p", hits.normal, hits.wo) < EDGE_ON
    mask.ravel()[hits.pixel[edge_on]] = False
    return np.asarray(read_radiance_image(folder / f"{name}_{n_bounces}.exr"), np.float64), mask


def reference_errors(subject: Subject, done: Precomputed, folder: Path, name: str) -> Errors:
    """A stage's picture against NAME_1.exr over the pixels that count."""
    truth, mask = masked_reference(folder, name, 1, done.placement.hits)
    ours = compose(done.placement, reflected(done), subject.sky)
    if ours.shape != truth.shape:
        raise ValueError(f"{name}: picture {ours.shape} and reference {truth.shape}, expected equal shapes")
    return errors(ours[mask], truth[mask])
