"""Lights without size, as files have them (KHR_lights_punctual), as emitters of a small size.

A light without size cannot be: its radiance is infinite. A point becomes a sphere of radius r with radiance

    L = I / (pi r²),

so that a surface above whose horizon it stands has exactly the irradiance I cos / d² of the point. A spot is such a
sphere with a cone (`engine.light.cones`). A directional light becomes a sun (`engine.light.suns`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from engine.light.suns import Sun
from engine.scene.description import MAX_RADIANCE, ConeDescription, ObjectDescription
from engine.scene.loaders.model import RGB, ImportedLight
from engine.scene.primitives import sphere

Float64Array = npt.NDArray[np.float64]

# The radius of a lamp relative to its distance from the middle of the model, which is at least the model's radius.
LAMP_RADIUS = 0.01
_SMALLEST, _FARTHEST = 1e-7, 1e8  # radius and coordinates of a lamp, in metres


def lamps_of(
    lights: Sequence[ImportedLight], matrix: Float64Array, middle: Float64Array, radius: float
) -> tuple[list[ObjectDescription], list[str]]:
    """The points and spots as objects under the matrix (4, 4) of their model, and the names of those that are too small
    or too far away for one; middle (3,) and radius: of the sphere about the model, before that. Names are those of the
    lights."""
    found: list[ObjectDescription] = []
    left_out: list[str] = []
    for light in lights:
        if light.kind == "directional":
            continue
        away = max(radius, float(np.linalg.norm(np.subtract(light.position, middle))))
        place = matrix @ (*light.position, 1.0)
        size = LAMP_RADIUS * away * abs(float(np.linalg.det(matrix[:3, :3]))) ** (1.0 / 3.0)
        if size < _SMALLEST or np.abs(place).max() > _FARTHEST:
            left_out.append(light.name)
        else:
            axes = _frame(matrix[:3, :3] @ light.direction) if light.kind == "spot" else np.eye(3)
            found.append(_lamp(light, place[:3], axes, size))
    return found, left_out


def _lamp(light: ImportedLight, place: Float64Array, axes: Float64Array, radius: float) -> ObjectDescription:
    """A sphere at a place (3,), with the columns of axes (3, 3) as its own."""
    diameter, cone = 2.0 * radius, None
    # The mean projected area of a convex body is a quarter of its surface.
    projected = diameter**2 * _area(sphere().vertices, sphere().triangles) / 4.0
    if light.kind == "spot":
        cone = ConeDescription(inner=math.degrees(light.inner), outer=math.degrees(light.outer))
    return ObjectDescription(
        name=light.name, primitive="sphere", emission=_radiance(light.intensity, projected), cone=cone,
        transform=_transform(axes * diameter, place),
    )  # fmt: skip


def _frame(axis: Float64Array) -> Float64Array:
    """Orthonormal columns (3, 3), of which the last is a direction (3,)."""
    axis = axis / np.linalg.norm(axis)
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(axis, across), axis], axis=1)


def suns_of(lights: Sequence[ImportedLight], matrix: Float64Array) -> tuple[Sun, ...]:
    """The directional lights under the matrix (4, 4) of their model."""
    directional = [light for light in lights if light.kind == "directional"]
    return tuple(
        Sun(_triple(-(matrix[:3, :3] @ each.direction)), each.intensity, _sun_diameter(each), each.name)
        for each in directional
    )


def _sun_diameter(light: ImportedLight) -> float:
    return min(max(light.diameter, 0.1), 90.0)


def _triple(vector: Float64Array) -> RGB:
    x, y, z = (vector / np.linalg.norm(vector)).tolist()
    return x, y, z


def _radiance(intensity: npt.ArrayLike, area: float) -> RGB:
    red, green, blue = np.minimum(np.divide(intensity, max(area, 1e-30)), MAX_RADIANCE).tolist()
    return red, green, blue


def _area(vertices: Float64Array, triangles: npt.NDArray[np.integer]) -> float:
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


def _transform(axes: Float64Array, place: Float64Array) -> tuple[float, ...]:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = axes, place
    return tuple(matrix.ravel().tolist())
