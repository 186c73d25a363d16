"""References at a third of their size: one pixel of each nine, seen along the same ray."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.project.project import Project, open_project


def open_third(path: Path) -> Project:
    """A scene by a camera that sees `third` of its pixels."""
    described = tomllib.loads(path.read_text())["camera"]
    width, height = described["resolution"]
    project = open_project(str(path), (_kept(width), _kept(height)))
    description = project.scene.description
    half = np.tan(np.radians(description.camera.fov_y) / 2.0) * 3 * _kept(height) / height
    eye = description.camera.model_copy(update={"fov_y": float(2.0 * np.degrees(np.arctan(half)))})
    return replace(project, scene=replace(project.scene, description=description.model_copy(update={"camera": eye})))


def third(image: NDArray) -> NDArray:
    """Every third row and column of a picture (H, W, ...) of even size, alike on both sides of its middle."""
    for axis in (0, 1):
        kept = _kept(image.shape[axis])
        first = (image.shape[axis] - 3 * kept) // 2 + 1
        image = np.take(image, first + 3 * np.arange(kept), axis)
    return image


def _kept(length: int) -> int:
    """An even number: so the middles of pixels are those of the large picture."""
    return 2 * (length // 6)
