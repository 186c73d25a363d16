"""A picture from anywhere: rays to the surface, and light from the shading points around each hit.

While something moves, the points that are seen are shaded, each towards the eye, and colours are interpolated; at rest
every pixel takes the light of its three points and reflects it towards its own eye [Ma06, 3.3: functions, not colours].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.light.environment import Environment
from engine.orbit.incident import Incident
from engine.orbit.shading_points import ShadingPoints
from engine.orbit.slices import Slices
from engine.scene.camera import centre_directions
from engine.scene.description import CameraDescription
from engine.scene.hits import emission_towards
from engine.scene.load import Scene
from engine.scene.raycaster import Intersections, RayCaster

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Seen:
    """What the pixels (H·W) of a picture see: the shading points `corners` (P, 3) around what the pixels `pixel` (P,)
    hit, and their weights (P, 3); wo (P, 3) to the eye; directions (H, W, 3); emitted (H, W, 3); covered (H, W): where
    there is any surface; from_behind: objects that are seen where they have no points."""

    pixel: NDArray[np.intp]
    corners: NDArray[np.int32]
    weights: Floats
    wo: Floats
    directions: Floats
    emitted: Floats
    covered: NDArray[np.bool_]
    from_behind: tuple[int, ...]


def look(
    scene: Scene, points: ShadingPoints, caster: RayCaster, camera: CameraDescription, resolution: tuple[int, int]
) -> Seen:
    """Trace a ray through each pixel's centre; caster: of the points' triangles; resolution (width, height)."""
    directions = centre_directions(camera, resolution)
    flat = directions.reshape(-1, 3)
    eye = np.subtract(camera.position, scene.origin).astype(np.float32)
    found = caster.intersect(np.tile(eye, (len(flat), 1)), flat)
    hit = found.triangle >= 0
    source = np.where(hit, points.source[found.triangle], -1)
    of_scene = Intersections(source, found.u, found.v, found.distance)
    ids = np.where(hit, scene.object_of_triangle[source], -1).astype(np.int32)
    emitted = emission_towards(scene, of_scene, ids, flat).reshape(directions.shape)
    back = (scene.geometric_normals[source] * flat).sum(axis=1) > 0.0
    corners = points.triangles[found.triangle, back.astype(np.intp)]
    has_points = corners[:, 0] >= 0
    pixel = np.flatnonzero(hit & has_points)
    u, v = found.u[pixel], found.v[pixel]
    return Seen(
        pixel, corners[pixel], np.stack([1.0 - u - v, u, v], axis=1), -flat[pixel], directions, emitted,
        hit.reshape(directions.shape[:2]),
        tuple(int(i) for i in np.unique(ids[hit & back & ~has_points]) if not scene.emitters[i]),
    )  # fmt: skip


def reflected(
    points: ShadingPoints, seen: Seen, incident: Incident, slices: Mapping[int, Slices], at_rest: bool = True
) -> Floats:
    """Radiance (P, 3) towards the eye at what the pixels see, of objects that have slices; others are black."""
    corners = seen.corners
    radiance = np.zeros((len(corners), 3), np.float32)
    of_pixel = points.i_object[corners[:, 0]]
    for i_object, own in slices.items():
        mine = np.flatnonzero(of_pixel == i_object)
        if not len(mine):
            continue
        at, towards = corners[mine].ravel(), np.repeat(seen.wo[mine], 3, axis=0)
        if at_rest:
            colours = own.shade(incident, at, _local(points, at, towards))
        else:
            once, back = np.unique(at, return_inverse=True)
            nearest = np.empty((len(once), 3), np.float32)
            nearest[back.ravel()] = towards
            colours = own.shade(incident, once, _local(points, once, nearest))[back.ravel()]
        radiance[mine] = np.einsum("pk,pki->pi", seen.weights[mine], colours.reshape(-1, 3, 3))
    return radiance


def picture(seen: Seen, radiance: Floats, environment: Environment | None, rotation: float) -> Floats:
    """Radiance (H, W, 3): what is reflected, what shines, and the sky behind it all."""
    whole = seen.emitted.copy()
    flat = whole.reshape(-1, 3)
    flat[seen.pixel] += radiance
    if environment is not None:
        beyond = ~seen.covered
        whole[beyond] = environment.evaluate(seen.directions[beyond], rotation)
    return whole


def _local(points: ShadingPoints, at: NDArray[np.integer], towards: Floats) -> Floats:
    """Directions (N, 3) of the world in the frames of points (N,)."""
    return np.ascontiguousarray(np.einsum("pij,pj->pi", points.frames[at], towards), dtype=np.float32)
