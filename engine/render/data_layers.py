"""Layers of a picture that hold no light: coverage of objects, albedo, normals, positions, depth.

Coverage and albedo are means over the pixel. Position, normal and depth are those of the surface, an emitter's as well,
that the ray through a pixel's centre meets: a mean of two surfaces would lie on neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.albedo import equivalent_albedo
from engine.render._layer_kernels import add_points
from engine.render.still import StillLayer
from engine.scene.primary_hits import PrimaryHits, centre_surfaces

# The depth of pixels that see no surface, as Blender writes it.
NO_DEPTH = 1e10

Float32Array = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class SurfaceLayers:
    """The surfaces at the pixels' centres: position and normal (H, W, 3) in the scene's frame, metres, 0 where there is
    none; depth (H, W): metres along the camera's axis, `NO_DEPTH` where there is none."""

    position: Float32Array
    normal: Float32Array
    depth: Float32Array


def surface_layers(placement: Placement) -> SurfaceLayers:
    """The surfaces that a placement's camera sees, with the shading normals of those that reflect."""
    scene, hits = placement.scene, placement.hits
    position, normal = centre_surfaces(scene, placement.caster, hits)
    there = hits.object_image >= 0
    camera = scene.description.camera
    axis = np.subtract(camera.target, camera.position)
    axis /= np.linalg.norm(axis)
    depth = np.where(there, (position - scene.camera_position) @ axis, NO_DEPTH)
    return SurfaceLayers(position.astype(np.float32), normal.astype(np.float32), depth.astype(np.float32))


def object_coverage(hits: PrimaryHits) -> Float32Array:
    """The share of each pixel that each object covers, (M, H, W) in [0, 1].

    What neither the background nor points of reflecting objects cover belongs to the emitter at the pixel's centre, or
    where there is none to that which sends most.
    """
    width, height = hits.resolution
    coverage = np.zeros((len(hits.object_ranges), height * width), np.float32)
    np.add.at(coverage, (hits.objects, hits.pixel), hits.share)
    only_emits = hits.object_ranges[:, 0] == hits.object_ranges[:, 1]
    emitter = np.full(height * width, -1)
    mine = np.flatnonzero(only_emits[hits.lamps.object])
    order = mine[np.argsort(hits.lamps.share[mine], kind="stable")]
    emitter[hits.lamps.pixel[order]] = hits.lamps.object[order]  # the last of a pixel stays
    centre = hits.object_image.ravel()
    there = np.flatnonzero(centre >= 0)
    there = there[only_emits[centre[there]]]
    emitter[there] = centre[there]
    left = np.clip(1.0 - hits.open_image.ravel() - coverage.sum(axis=0), 0.0, 1.0)
    pixels = np.flatnonzero(emitter >= 0)
    coverage[emitter[pixels], pixels] = left[pixels]
    return np.clip(coverage, 0.0, 1.0).reshape(-1, height, width)


def albedo_layer(hits: PrimaryHits, layers: Sequence[StillLayer]) -> Float32Array:
    """The share of light that surfaces reflect, over all directions, (H, W, 3); 0 for emitters and the background."""
    albedo = np.zeros((len(hits.pixel), 3))
    for each in layers:
        rows = np.arange(*hits.object_ranges[each.i_object])
        own, factor = equivalent_albedo(each.layer, each.bands), each.factor(hits, rows)
        albedo[rows] += own if factor is None else own * factor
    return point_picture(hits, albedo)


def point_picture(hits: PrimaryHits, values: NDArray[np.floating]) -> Float32Array:
    """Values (P, 3) of the points as a picture (H, W, 3), by their shares of their pixels; 0 elsewhere."""
    width, height = hits.resolution
    image = np.zeros((height * width, 3), np.float32)
    add_points(hits.pixel, hits.share, values, image)
    return image.reshape(height, width, 3)
