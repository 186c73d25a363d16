"""An environment as an OpenEXR file: a lat-long map with what is painted on it.

It has the environment's tilt, changes of its map, painted lights, suns and their mix, in 32-bit floats, but neither its
rotation nor the intensity: opened in its own scene, turned as before, it gives the same light bit for bit. Emitters and
light linking are the scene's own.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from app.system.atomic import require_place, save_file
from engine.core.errors import InsituError, LoadError

if TYPE_CHECKING:
    from engine.precompute.direct.pipeline import SkyState

ENDING = ".exr"
# A map has a width of two heights; an even environment has a single texel.
_LEAST_ROWS = 4


def require_environment_file(path: Path) -> None:
    """Raise InsituError where an environment cannot be written to this file."""
    if path.suffix.lower() != ENDING:
        raise LoadError(path, "file name", path.name, f"a name that ends in {ENDING}")
    require_place(path)


def write_environment(path: Path, sky: SkyState) -> tuple[int, int]:
    """Write an environment, whole or not at all; returns its height and width in texels. Raises InsituError, also where
    there is none."""
    from engine.render.display import exr_bytes  # late: the window's process checks names alone

    require_environment_file(path)
    if sky.environment is None:
        raise InsituError(f"{path}: not written, the scene has no environment")
    image = sky.environment.radiance * np.float32(sky.scale)
    if image.shape[:2] == (1, 1):
        image = np.tile(image, (_LEAST_ROWS, 2 * _LEAST_ROWS, 1))
    save_file(path, exr_bytes(image))
    return image.shape[0], image.shape[1]
