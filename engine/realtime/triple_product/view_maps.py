"""The factors of textures and weight maps in a picture, filtered over each pixel as in Placement."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.material.layer import Layer
from engine.realtime.core.terms import MOVING_PROBES, map_factor
from engine.realtime.triple_product import _footprint_kernels as kernels
from engine.realtime.triple_product.view_samples import Rows, ViewSamples
from engine.scene.bump_normals import Footprints, gradients
from engine.scene.scene_loader import Scene
from engine.scene.surface_uvs import corner_uvs
from engine.texture.pyramid import MOST_PROBES, Pyramid

Float32Array = NDArray[np.float32]


def factors(
    seen: ViewSamples, which: Rows, scene: Scene, i_object: int, layers: Sequence[Layer], quality: str
) -> dict[int, Float32Array]:
    """Factors of an object's visible layers that have maps, by the layer's number: (N, 3) at samples (N,).

    In moving pictures, fewer look-ups cover an oblique pixel, each in one level of the image pyramid. Layers and
    pictures of one camera share what was sampled of an image.
    """
    is_quick, sampled = quality == "moving", seen.sampled
    most_probes = MOVING_PROBES if is_quick else MOST_PROBES

    def sample(image: Pyramid, scale: tuple[float, float]) -> Float32Array:
        key = i_object, image, scale
        if key not in sampled:
            footprints = footprints_of(seen, which, scene, i_object)
            sampled[key] = image.over(*footprints, most_probes, scale, is_quick)
        return sampled[key]

    visible = [layer for layer in layers if layer.visible]
    return {
        k: np.asarray(map_factor(scene, layer.maps, len(which), sample, lambda: seen.in_scene(which)), np.float32)
        for k, layer in enumerate(visible)
        if not layer.maps.is_plain
    }


def footprints_of(seen: ViewSamples, which: Rows, scene: Scene, i_object: int) -> Footprints:
    """Texture coordinates of an object's samples, and their differences over a pixel to the left and upwards, (N, 2);
    cached."""
    if i_object not in seen.footprints:
        seen.footprints[i_object] = _footprints(seen, which, scene, i_object)
    uv, left, up = seen.footprints[i_object]
    return uv, left, up


def _footprints(seen: ViewSamples, which: Rows, scene: Scene, i_object: int) -> tuple[NDArray[np.float64], ...]:
    if i_object not in seen.charts:
        seen.charts[i_object] = _charts(scene, i_object)
    out = tuple(np.empty((3, len(which), 2)))
    samples, eye = seen.samples, seen.camera_position.astype(np.float64)
    what = which, seen.found[0], seen.points.source, samples.wo, seen.share, seen.charts[i_object]

    def part(start: int, stop: int) -> None:
        kernels.footprints(start, stop, *what, eye, seen.axes, *out)

    on_threads(part, *even_parts(len(which)))
    return out


def _charts(scene: Scene, i_object: int) -> kernels.Charts:
    """How an object's triangles lie on its images."""
    own = np.arange(*scene.triangle_ranges[i_object])
    corners = scene.vertices[scene.triangles[own]].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    first = np.ascontiguousarray(corners[:, 0]), np.ascontiguousarray(corner_uvs(scene, own)[:, 0])
    return kernels.Charts(*first, normals, gradients(scene, own), int(own[0]))
