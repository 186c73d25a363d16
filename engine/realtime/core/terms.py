"""The terms that objects' reflections are sums of: which layers are diffuse or isotropic, and the factor of a layer's
maps at pixels.

Directions on the geodesic sphere have the normal as +Y; layers take tangent, bitangent, normal.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer, evaluate_layer
from engine.material.layer_maps import LayerMaps
from engine.scene.map_sampler import paint_weights
from engine.scene.raycaster import Intersections
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import colours_at
from engine.texture.pyramid import Pyramid
from engine.texture.texture_store import sample_images

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]
LayersOf = Mapping[int, Sequence[Layer]]  # by the object's index
# Samples an image, with its repeats along u and v, at pixels (N,).
SampleImage = Callable[[Pyramid, tuple[float, float]], Float32Array]


@lru_cache(maxsize=256)
def diffuse_reflectance(layer: Layer) -> Float64Array | None:
    """ρ (3,) of a layer that reflects equally in all directions, for any incident direction; None for any other layer.
    Read-only."""
    wi, wo = _direction_pairs()
    brdf = evaluate_layer(layer, to_shading_frame(wi), to_shading_frame(wo)) / wi[:, 1:2]
    mean: Float64Array = brdf.mean(axis=0)
    mean.flags.writeable = False
    return mean if np.abs(brdf - mean).max() <= 1e-4 * mean.max() else None


def is_glossy(layer: Layer) -> bool:
    """Whether a layer reflects unequally in different directions."""
    return diffuse_reflectance(layer) is None


def diffuse_albedo(layer: Layer) -> Float64Array:
    """Albedo of a diffuse layer (3,), 0 for any other."""
    found = diffuse_reflectance(layer)
    return np.zeros(3) if found is None else found * np.pi


def has_isotropic_reflection(layer: Layer) -> bool:
    """Whether rotating both directions about the normal, and mirroring them, changes nothing, tested on 256 pairs."""
    wi, wo = _direction_pairs()
    turn, mirror = np.array([[0.6, 0, 0.8], [0, 1, 0], [-0.8, 0, 0.6]]), np.array([-1.0, 1.0, 1.0])
    before = evaluate_layer(layer, to_shading_frame(wi), to_shading_frame(wo))
    after = evaluate_layer(layer, to_shading_frame(wi @ turn.T * mirror), to_shading_frame(wo @ turn.T * mirror))
    return bool(np.allclose(before, after, rtol=1e-4, atol=1e-6 * before.max(initial=0.0)))


def spherical(polar: NDArray[np.floating], azimuth: NDArray[np.floating]) -> Float64Array:
    """Directions (N, 3) on the geodesic sphere: angle to +Y, azimuth from +Z to +X."""
    return np.stack([np.sin(polar) * np.sin(azimuth), np.cos(polar), np.sin(polar) * np.cos(azimuth)], axis=1)


def to_shading_frame(directions: NDArray[np.floating]) -> NDArray[np.floating]:
    """Convert directions on the sphere, whose +Y is the normal, to tangent, bitangent, normal, as layers take them."""
    # `sphere_frames` has tangent × normal for z, which is minus the bitangent.
    return directions[:, [0, 2, 1]] * np.array([1.0, -1.0, 1.0])


def _direction_pairs() -> Float64Array:
    """256 pairs of directions above the surface, (2, 256, 3)."""
    polar, azimuth = np.random.default_rng(1).random((2, 2, 256)) * np.array([1.5, 2.0 * np.pi])[:, None, None]
    return np.stack([spherical(polar[0], azimuth[0]), spherical(polar[1], azimuth[1])])


def map_factor(
    scene: Scene, maps: LayerMaps, n_pixels: int, sample: SampleImage, find_hits: Callable[[], Intersections]
) -> NDArray[np.floating]:
    """Factor (N, 3) of a layer's textures, weights and strokes at pixels (N,). find_hits: called where there are
    strokes or vertex colours, for the pixels' positions on the scene's meshes. Raises LoadError."""

    def vertex_colours() -> Float32Array:
        hits = find_hits()
        return colours_at(scene, hits.triangle, hits.u, hits.v)

    texture, weight = sample_images(maps.images, scene.textures, n_pixels, sample, vertex_colours)
    if maps.strokes:
        weight = paint_weights(scene, find_hits(), maps.strokes, weight)
    return maps.factor(texture, weight)
