"""Objects under a light at the camera (`headlight_shading`), from any camera: shown while the camera moves before
anything is computed."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.precompute.direct.pipeline import SkyState
from engine.render.headlight_shading import headlight_colour, headlight_radiance
from engine.scene.picture_frame import picture_frame
from engine.scene.primary_hits import trace_primary_steps
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene


def headlight_picture(
    scene: Scene, caster: RayCaster, layers: Mapping[int, Sequence[Layer]], sky: SkyState, resolution: tuple[int, int]
) -> Generator[None, None, NDArray[np.float32]]:
    """Radiance (H, W, 3) of a scene as its camera sees it, in resolution (width, height): its objects with these
    layers, by index, under a light at the camera, its emitters and the sky. In steps."""
    hits = yield from trace_primary_steps(scene, caster, resolution)
    frame = picture_frame(hits, scene.camera_position)
    picture = np.array(frame.emission_image, np.float32)
    behind = frame.open_image > 0.0
    if sky.environment is not None:
        picture[behind] = sky.scale * sky.environment.evaluate(frame.ray_directions[behind], sky.rotation)
    yield
    points = picture.reshape(-1, 3)
    for index, own in layers.items():
        rows = slice(*frame.object_ranges[index])
        points[frame.pixel[rows]] = headlight_radiance(headlight_colour(own), frame.theta_o[rows])
    return picture
