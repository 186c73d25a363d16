"""A still in Deform's way, from geometry at rest to pixels of a pose."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from engine.deform.live import N_POINTS, Deform, LayersOf
from engine.deform.pose import Poses
from engine.deform.transfer import N_RAYS
from engine.render.still import StillProgress
from engine.scene.load import Scene
from engine.transport.pipeline import SkyState


def render_deform(
    scene: Scene, poses: Poses, layers_of: LayersOf, sky: SkyState, n_bounces: int = 1, n_points: int = N_POINTS,
    n_rays: int = N_RAYS,
) -> Generator[StillProgress, None, NDArray[np.float32]]:  # fmt: skip
    """Radiance (H, W, 3) of a scene at rest seen in these poses, as Deform shows it when the hand rests; yields how far
    it is. layers_of: the layers of each object, by its index."""
    deform = Deform(scene, n_points, n_rays)
    deform.set_light(sky)
    deform.set_layers(layers_of)
    deform.set_bounces(n_bounces)
    deform.set_posed([name for name, _ in poses])
    yield from deform.work()
    return deform.draw(scene.description.camera, scene.resolution, poses, "rest")
