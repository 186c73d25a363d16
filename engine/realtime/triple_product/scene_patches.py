"""The patches of all that may emit light in a scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.light.emitters import EmitterPatches, emitter_patches, merged_by_object
from engine.scene.emission_textures import emitting_triangles_of
from engine.scene.scene_loader import Scene

# Patches, and the object of each.
ScenePatches = tuple[EmitterPatches, NDArray[np.intp]]


def scene_patches(scene: Scene, n_patches: int) -> ScenePatches | None:
    """Split everything that may ever emit into about n_patches patches, whose radiance is that of emission 1; also
    return each patch's object. None if nothing may emit."""
    if not scene.emitters.any():
        return None
    white = replace(scene, emission=np.ones_like(scene.emission))
    emitting = emitting_triangles_of(white)
    objects = scene.object_of_triangle[emitting.triangle]
    merged, owners = merged_by_object(emitting.corners, emitting.radiance, objects, n_patches)
    number = np.repeat(np.arange(1.0, len(owners) + 1.0)[:, None], 3, axis=1)  # carry the triangle's in the radiance
    patches = emitter_patches(merged.corners, number, n_patches, scene.cones[owners])
    root = np.rint(patches.radiance[:, 0]).astype(np.intp) - 1
    varying = emitting.radiance_of_parts(merged)
    radiance = merged.radiance[root] if varying is None else varying(patches.corners.astype(np.float64), root)
    return replace(patches, radiance=radiance.astype(np.float32)), owners[root].astype(np.intp)
