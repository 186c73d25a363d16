"""A picture from anywhere: rays to the surface, and light from the shading points around each hit.

While something moves, the points that are seen are shaded, each towards the eye, and colours are interpolated; at rest
every pixel takes the light of its three points and reflects it towards its own eye [Ma06, 3.3: functions, not colours].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.light.environment import Environment
from engine.material.layer import Layer
from engine.orbit.incident import Incident, suns_seen
from engine.orbit.shading_points import ShadingPoints
from engine.orbit.sky import Sky
from engine.orbit.slices import Slices, to_shading
from engine.orbit.visibility import Bits
from engine.render.integrator import evaluate_layers
from engine.scene.camera import centre_directions
from engine.scene.description import CameraDescription
from engine.scene.hits import LEAST_COSINE, emission_towards
from engine.scene.load import Scene
from engine.scene.raycaster import Intersections, RayCaster
from engine.threads import on_threads

Floats = NDArray[np.float32]
_PIXELS = 1024  # at a time: up to 130,000 pairs of pixel and sun


@dataclass(frozen=True, eq=False)
class Seen:
    """What the pixels (H·W) of a picture see: the shading points `corners` (P, 3) around what the pixels `pixel` (P,)
    hit, and their weights (P, 3); wo (P, 3) to the eye; directions (H, W, 3); emitted (H, W, 3); covered (H, W): where
    there is any surface; found: where on the scene's triangles all pixels' rays end, objects (H·W,): of which object,
    −1 for none; from_behind: objects that are seen where they have no points."""

    pixel: NDArray[np.intp]
    corners: NDArray[np.int32]
    weights: Floats
    wo: Floats
    directions: Floats
    emitted: Floats
    covered: NDArray[np.bool_]
    found: Intersections
    objects: NDArray[np.int32]
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
        hit.reshape(directions.shape[:2]), of_scene, ids,
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


def sunlit(points: ShadingPoints, bits: Bits, seen: Seen, sky: Sky, layers_of: Mapping[int, Sequence[Layer]]) -> Floats:
    """Radiance (P, 3) that layers reflect of the sky's suns, each in its own direction: a highlight as sharp as the
    layers are, where slices know it to a triangle's 2.8 degrees. What a pixel sees of a sun is what its points see."""
    radiance = np.zeros((len(seen.corners), 3), np.float32)
    of_pixel = points.i_object[seen.corners[:, 0]]
    for i_object, layers in layers_of.items():
        mine = np.flatnonzero(of_pixel == i_object)

        def part(start: int, layers: Sequence[Layer] = layers, mine: NDArray[np.intp] = mine) -> None:
            some = mine[start : start + _PIXELS]
            radiance[some] = _of_suns(points, bits, seen, sky, some, layers)

        on_threads(part, range(0, len(mine), _PIXELS))
    return radiance


def _of_suns(
    points: ShadingPoints, bits: Bits, seen: Seen, sky: Sky, pixels: NDArray[np.intp], layers: Sequence[Layer]
) -> NDArray[np.float64]:
    """`sunlit` of some pixels (N,) of one object, (N, 3)."""
    corners, weights = seen.corners[pixels], seen.weights[pixels].astype(np.float64)
    once, back = np.unique(corners, return_inverse=True)
    share = np.einsum("nk,nks->ns", weights, suns_seen(points, bits, sky, once)[back.reshape(corners.shape)])
    frames = np.einsum("nk,nkij->nij", weights, points.frames[corners])
    frames[:, 1] /= np.linalg.norm(frames[:, 1], axis=1, keepdims=True)
    frames[:, 0] -= np.einsum("ni,ni->n", frames[:, 0], frames[:, 1])[:, None] * frames[:, 1]
    frames[:, 0] /= np.linalg.norm(frames[:, 0], axis=1, keepdims=True)
    frames[:, 2] = np.cross(frames[:, 0], frames[:, 1])
    n, s = np.nonzero(share > 0.0)
    wi = np.einsum("nij,nj->ni", frames[n], sky.sun_direction[s].astype(np.float64))
    wo = np.einsum("nij,nj->ni", frames, seen.wo[pixels].astype(np.float64))
    wo[:, 1] = np.maximum(wo[:, 1], LEAST_COSINE)
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    lit = share[n, s, None] * sky.sun_power[s] * evaluate_layers(layers, to_shading(wi), to_shading(wo[n]))
    lit[wi[:, 1] <= 0.0] = 0.0
    return np.stack([np.bincount(n, lit[:, c], len(pixels)) for c in range(3)], axis=1)


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
