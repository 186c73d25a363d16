"""The albedos with which an object's points reflect light onto the object itself, images and strokes included;
quantized so coarsely that most edits of a material do not invalidate the transfer that depends on them.

Light between points is colourless, like all transfer: an albedo is its luminance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.light.environment import LUMINANCE
from engine.material.layer import Layer
from engine.realtime.zonal_harmonics.bending_points import BendingPoints
from engine.realtime.zonal_harmonics.gloss import low_gloss
from engine.realtime.zonal_harmonics.shading_state import albedo, is_glossy
from engine.render.map_sampler import paint_weights, sample_images
from engine.scene.scene_loader import Scene
from engine.texture.pyramid import Pyramid

Float64Array = NDArray[np.float64]
Float32Array = NDArray[np.float32]

ALBEDO_STEPS = 8  # for the brightest point
SHARE_STEPS = 15  # for the others, relative to it


@dataclass(frozen=True)
class Reflectance:
    """brightest: the largest albedo of an object's points, in `ALBEDO_STEPS`; shares: each point's share of it, in
    `SHARE_STEPS`; empty if all are equal."""

    brightest: int = 0
    shares: bytes = b""

    @property
    def albedo(self) -> Float64Array:
        """Albedo of the points (P,), or of all of them ()."""
        shares = np.frombuffer(self.shares, np.uint8) / SHARE_STEPS if self.shares else np.ones(())
        return np.asarray(self.brightest / ALBEDO_STEPS * shares)


def reflectance(albedo: Float64Array) -> Reflectance:
    """Quantize the albedos of points (P,), which are below 1."""
    most = float(albedo.max(initial=0.0))
    brightest = min(round(most * ALBEDO_STEPS), ALBEDO_STEPS - 1)
    if not brightest:
        return Reflectance()
    shares = np.rint(albedo / most * SHARE_STEPS).astype(np.uint8)
    return Reflectance(brightest, b"" if (shares == SHARE_STEPS).all() else shares.tobytes())


def albedos(scene: Scene, points: BendingPoints, i_object: int, layers: Sequence[Layer], order: int) -> Float64Array:
    """Albedos of an object's points (P,), gloss taken as diffuse: the mean over the triangles around each, because an
    image may be finer than the points. order: of the approximation of gloss. Raises LoadError."""
    middles, uvs, sides = points.middles(i_object)
    none, total = np.zeros_like(sides), np.zeros(len(sides))
    across, down = np.stack([sides, none], axis=1), np.stack([none, sides], axis=1)

    def sample(image: Pyramid, repeats: tuple[float, float]) -> Float32Array:
        return image.over(uvs, across, down, repeats=repeats)

    for layer in layers:
        texture, weight = sample_images(layer.maps.images, scene.textures, len(sides), sample)
        factor = layer.maps.factor(texture, paint_weights(scene, middles, layer.maps.strokes, weight))
        own = low_gloss(layer, order).albedo if is_glossy(layer) else albedo(layer)
        total += factor @ (own * LUMINANCE)
    return points.means_around(i_object, total)
