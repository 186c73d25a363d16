"""Lights without size, as files have them (KHR_lights_punctual), as emitters of a small size.

A light without size cannot be: its radiance is infinite. A point becomes a sphere of radius r with radiance

    L = I / (pi r²),

so that a surface above whose horizon it stands has exactly the irradiance I cos / d² of the point. A spot becomes a
disc at the bottom of a black tube: where the tube's opening hides none of the disc, it has its whole intensity, and the
more of it is hidden, the less. The radii of both and the tube's length are those whose intensity is nearest, by least
squares over the sphere, to that of the extension,

    I(theta) = I a²,  a = (cos theta - cos outer) / (cos inner - cos outer), from 0 to 1.

An emission with an angular profile would be exact; but light is emitted evenly here, and every mode, the path tracer
and exported scenes know what a tube does. A directional light becomes a sun (`engine.light.suns`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from engine.light.suns import Sun
from engine.scene.description import MAX_RADIANCE, LayerDescription, ObjectDescription
from engine.scene.loaders.model import RGB, ImportedLight
from engine.scene.primitives import disc, sphere

Float64Array = npt.NDArray[np.float64]

# The radius of a lamp relative to its distance from the middle of the model, which is at least the model's radius.
LAMP_RADIUS = 0.01
BLACK = LayerDescription(model="lambert", parameters={"albedo": (0.0, 0.0, 0.0)})
# Of the cones that tubes make: half angles; and the least width of their edge relative to the outer angle, and radius
# of the disc relative to the opening's, because a sharp edge needs a point.
_LEAST_OUTER, _WIDEST_INNER, _WIDEST_OUTER = math.radians(0.5), math.radians(70.0), math.radians(80.0)
_SHARPEST, _LEAST_SOURCE = 0.12, 0.05
_SMALLEST, _FARTHEST = 1e-7, 1e8  # radius and coordinates of a lamp, in metres


class Shade(NamedTuple):
    """A disc in a tube of length 1: radii of the disc and of the opening, what the disc's intensity along the axis is
    relative to that of the light, and the relative RMS error of the intensity over the sphere."""

    source: float
    opening: float
    gain: float
    error: float


@lru_cache(maxsize=64)
def shade_of_cone(inner: float, outer: float) -> Shade:
    """The disc and tube whose intensity is nearest to that of a spot, `inner` and `outer` half angles in radians.

    Toward theta the opening is shifted by tan theta against the disc, and what both cover is seen. Of a disc of radius
    a in an opening of b all is seen up to tan theta = b - a, nothing from b + a on. Both angles are searched; the total
    flux is that of the spot.
    """
    widest = max(outer, _LEAST_OUTER)
    theta = np.linspace(0.0, min(math.pi / 2.0, 1.5 * widest), 800, endpoint=False)
    wanted = np.clip((np.cos(theta) - math.cos(outer)) / max(math.cos(inner) - math.cos(outer), 1e-3), 0.0, 1.0) ** 2
    weight = np.sin(theta)
    edge = max(outer - inner, _SHARPEST * outer)
    low, high = outer - edge + edge * np.mgrid[0.0:1.0:26j, 0.0:1.2:31j].reshape(2, -1)
    low, high = np.tan(np.minimum(low, _WIDEST_INNER)), np.tan(np.clip(high, _LEAST_OUTER, _WIDEST_OUTER))
    source, opening = (high - low) / 2.0, (high + low) / 2.0
    is_cone = source >= _LEAST_SOURCE * opening
    source, opening = source[is_cone], opening[is_cone]
    found = np.cos(theta) * _seen_share(source[:, None], opening[:, None], np.tan(theta))
    gain = (wanted * weight).sum() / (found * weight).sum(axis=1)
    error = ((gain[:, None] * found - wanted) ** 2 * weight).sum(axis=1) / (wanted**2 * weight).sum()
    best = int(np.argmin(error))
    return Shade(float(source[best]), float(opening[best]), float(gain[best]), math.sqrt(error[best]))


def _seen_share(a: Float64Array, b: Float64Array, shift: Float64Array) -> Float64Array:
    """The share of a disc of radius a that an opening of radius b >= a, shifted against it, does not hide: the area
    that two circles have in common."""
    d = np.maximum(shift, 1e-12)
    x = np.clip((d**2 + a**2 - b**2) / (2.0 * d * a), -1.0, 1.0)
    y = np.clip((d**2 + b**2 - a**2) / (2.0 * d * b), -1.0, 1.0)
    kite = np.sqrt(np.maximum((a + b - d) * (d + a - b) * (d - a + b) * (d + a + b), 0.0))
    common = a**2 * np.arccos(x) + b**2 * np.arccos(y) - 0.5 * kite
    return np.where(d >= a + b, 0.0, np.where(d <= b - a, 1.0, common / (math.pi * a**2)))


def lamps_of(
    lights: Sequence[ImportedLight], matrix: Float64Array, middle: Float64Array, radius: float
) -> tuple[list[ObjectDescription], list[str]]:
    """The points and spots as objects under the matrix (4, 4) of their model, and the names of those that are too small
    or too far away for one; middle (3,) and radius: of the sphere about the model, before that. Names are those of the
    lights; a spot's tube is named after it."""
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
        elif light.kind == "point":
            found.append(_sphere_lamp(light, place[:3], size))
        else:
            axis = matrix[:3, :3] @ light.direction
            found += _shaded_lamp(light, place[:3], axis / np.linalg.norm(axis), size)
    return found, left_out


def _sphere_lamp(light: ImportedLight, place: Float64Array, radius: float) -> ObjectDescription:
    # The mean projected area of a convex body is a quarter of its surface.
    projected = (2.0 * radius) ** 2 * _area(sphere().vertices, sphere().triangles) / 4.0
    return ObjectDescription(
        name=light.name, primitive="sphere", emission=_radiance(light.intensity, projected),
        transform=_transform(np.eye(3) * 2.0 * radius, place),
    )  # fmt: skip


def _shaded_lamp(
    light: ImportedLight, place: Float64Array, axis: Float64Array, radius: float
) -> list[ObjectDescription]:
    """A disc and its tube, whose opening has the radius."""
    shade = shade_of_cone(light.inner, light.outer)
    length = radius / shade.opening
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    frame = np.stack([across, np.cross(axis, across), axis], axis=1)
    diameter = 2.0 * shade.source * length
    area = diameter**2 * _area(disc().vertices, disc().triangles)
    return [
        ObjectDescription(
            name=light.name, primitive="disc", emission=_radiance(np.multiply(light.intensity, shade.gain), area),
            transform=_transform(frame * diameter, place),
        ),
        ObjectDescription(
            name=f"{light.name[:56]} shade", primitive="tube", editable=False, layer=(BLACK,),
            transform=_transform(frame * (2.0 * radius, 2.0 * radius, length), place + 0.5 * length * axis),
        ),
    ]  # fmt: skip


def suns_of(lights: Sequence[ImportedLight], matrix: Float64Array) -> tuple[Sun, ...]:
    """The directional lights under the matrix (4, 4) of their model."""
    towards = [-(matrix[:3, :3] @ light.direction) for light in lights if light.kind == "directional"]
    strengths = [light.intensity for light in lights if light.kind == "directional"]
    return tuple(Sun(_triple(each), strength) for each, strength in zip(towards, strengths, strict=True))


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
