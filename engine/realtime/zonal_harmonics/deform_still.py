"""Renders a still with Deform's method, of the meshes in their current poses."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from engine.realtime.zonal_harmonics.deform_engine import Deform
from engine.render.still import StillProgress


def render_deform(deform: Deform, resolution: tuple[int, int]) -> Generator[StillProgress, None, NDArray[np.float32]]:
    """Render radiance (H, W, 3) of a scene as Deform shows it at rest; yields the progress."""
    yield from deform.work()
    return deform.draw(deform.scene.description.camera, resolution, (), "rest")
