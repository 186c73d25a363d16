"""The lights of a USD stage [UsdLux], in the file's frame: spheres, discs and rectangles as lamps of their size,
distant lights as suns, domes as the environment (`usd_domes`).

The radiance of a light is intensity · 2^exposure · colour, and with `normalize` that divided by the light's area in the
units of the stage; it is taken as W/(m² sr) one to one, as that of domes and of emissive surfaces is, so that all keep
their ratios. A distant light of diameter δ has the irradiance L π sin²(δ/2). A lamp may have a cone (`shaping:cone`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from engine.core.errors import LoadError
from engine.scene.description import MAX_RADIANCE, check_transform, valid_name
from engine.scene.loaders.model import ImportedLamp, ImportedLight, LampShape, triple
from engine.scene.loaders.usd_domes import DOMES, UsdDomes
from engine.scene.loaders.usd_prims import Float64Array, UsdPrim
from engine.scene.loaders.usd_textures import UsdTextures

MOST_LIGHTS = 64
CONVERTED = "radiance of lights, in nits, counts as W/(m² sr)"
_AREAS: dict[str, LampShape] = {"SphereLight": "sphere", "DiskLight": "disc", "RectLight": "quad"}
_DISTANT = "DistantLight"
LIGHTS = (*_AREAS, *DOMES, _DISTANT)
_STRONGEST = 1e12
# Lamps shine along −Z, shapes along +Z.
_TURNED = np.diag([-1.0, 1.0, -1.0, 1.0])


@dataclass
class UsdLights:
    """What the lights of a stage become. metres: of one unit of the stage."""

    metres: float
    domes: UsdDomes
    textures: UsdTextures
    lamps: list[ImportedLamp] = field(default_factory=list)
    lights: list[ImportedLight] = field(default_factory=list)

    def add(self, prim: UsdPrim, matrix: Float64Array) -> None:
        """Take a light at its place (4, 4); one that cannot be shown is listed."""
        name = valid_name(prim.name, "light")
        try:
            if len(self.lamps) + len(self.lights) >= MOST_LIGHTS:
                raise prim.error("light", f"light {MOST_LIGHTS + 1}", f"at most {MOST_LIGHTS}")
            radiance = _radiance(prim)
            if prim.kind in DOMES:
                self.domes.add(prim, matrix, radiance)
            elif prim.kind == _DISTANT:
                self._add_sun(prim, matrix, radiance, name)
            else:
                self._add_lamp(prim, matrix, radiance, name)
        except LoadError as error:
            prim.not_shown("intensity", f"a light that is not lit: {error.reason}")

    def _add_sun(self, prim: UsdPrim, matrix: Float64Array, radiance: Float64Array, name: str) -> None:
        angle = prim.clamped(_number(prim, "angle", 0.53), "inputs:angle", 0.0, 180.0)
        size = math.pi * math.sin(math.radians(angle) / 2.0) ** 2
        is_normal = _flag(prim, "normalize") or size == 0.0
        length = float(np.linalg.norm(matrix[:3, 2]))
        if not length > 0.0:
            raise prim.error("xformOpOrder", "a flat transform", "an axis that has a length")
        direction = -matrix[:3, 2] / length
        irradiance = radiance if is_normal else radiance * size
        self.lights.append(
            ImportedLight(name, "directional", triple(irradiance), direction=triple(direction), diameter=angle)
        )

    def _add_lamp(self, prim: UsdPrim, matrix: Float64Array, radiance: Float64Array, name: str) -> None:
        shape = _AREAS[prim.kind]
        if shape == "quad":
            sides = [abs(_number(prim, key, 1.0)) for key in ("width", "height")]
        else:
            sides = [2.0 * abs(_number(prim, "radius", 0.5))] * 2
        depth = sides[0] if shape == "sphere" else 1.0
        axes = matrix[:3, :3] * (*sides, depth)
        area = _area(axes, shape)
        if _flag(prim, "treatAsPoint"):
            prim.not_shown("treatAsPoint", "a lamp of the size that the file gives")
        if not area > 0.0:
            raise prim.error("size", sides, "sizes above 0")
        if _flag(prim, "normalize"):
            radiance = radiance / (area / self.metres**2)
        cone = self._cone(prim)
        texture = self._texture(prim, cone is not None) if shape == "quad" else ""
        turned = np.eye(4) if shape == "sphere" and cone is None else _TURNED
        placed = matrix @ np.diag([*sides, depth, 1.0]) @ turned
        if problem := check_transform(placed.ravel().tolist()):
            raise prim.error("xformOpOrder", "a flat transform", problem)
        radiance = np.minimum(radiance, MAX_RADIANCE)
        self.lamps.append(ImportedLamp(name, shape, placed, triple(radiance), cone, texture))

    def _texture(self, prim: UsdPrim, has_cone: bool) -> str:
        """The image of a rectangle, upright as seen from its front; "", listed, where it cannot be shown."""
        key = prim.input("texture:file")
        name, layer = prim.asset(key)
        if not name:
            return ""
        try:
            if has_cone:
                raise prim.error(key, name, "none on a lamp with a cone")
            return self.textures.image(name, layer)
        except LoadError as error:
            prim.not_shown(key, f"the lamp has one radiance: {error.reason}")
            return ""

    def _cone(self, prim: UsdPrim) -> tuple[float, float] | None:
        """The half angles of a lamp's cone, radians; None where it has none."""
        angle = prim.clamped(_number(prim, "shaping:cone:angle", 90.0), "inputs:shaping:cone:angle", 0.1, 180.0)
        softness = prim.clamped(_number(prim, "shaping:cone:softness", 0.0), "inputs:shaping:cone:softness")
        if angle >= 90.0:
            return None
        if softness:
            effect = "the edge of the cone falls off by glTF's formula, with the power that the file gives"
            prim.not_shown("inputs:shaping:cone:softness", effect)
        outer = math.radians(angle)
        return _inner(outer, softness), outer


def _inner(outer: float, softness: float) -> float:
    """The half angle, radians, within which glTF's cone of a flat lamp is at its full radiance, so that its power is
    that of the cone of [UsdLux, ShapingAPI]: radiance times 1 − smoothstep from (1 − softness) outer to outer; 0 where
    even that leaves more. With F, the integral of the file's cone over sin θ cos θ dθ, and co = cos outer, the inner
    cosine ci solves F = (1 − ci²) / 2 + (ci − co)² / 4 + co (ci − co) / 3."""
    if not softness:
        return outer
    angles = (np.arange(2_000) + 0.5) / 2_000 * outer
    t = np.clip((angles / outer - 1.0 + softness) / softness, 0.0, 1.0)
    shape = 1.0 - t**2 * (3.0 - 2.0 * t)
    power, edge = float((shape * np.sin(angles) * np.cos(angles)).mean()) * outer, math.cos(outer)
    found = math.sqrt(max(2.0 - 4.0 * power - 2.0 / 9.0 * edge**2, 0.0)) - edge / 3.0
    return math.acos(min(max(found, edge), 1.0))


def _radiance(prim: UsdPrim) -> Float64Array:
    """The radiance (3,) of a light, before its size counts. Raises LoadError."""
    strength = _number(prim, "intensity", 50_000.0 if prim.kind == _DISTANT else 1.0)
    exposure = prim.clamped(_number(prim, "exposure", 0.0), "inputs:exposure", -100.0, 100.0)
    colour = np.array(prim.numbers(prim.input("color"), 3, (1.0, 1.0, 1.0)))
    key = prim.input("colorTemperature")
    if _flag(prim, "enableColorTemperature"):
        prim.number(key, 6500.0)
        colour = colour * prim.triple("temperature")
    else:
        prim.mark_read(key)
    radiance = np.maximum(strength * 2.0**exposure * colour, 0.0)
    if not (radiance <= _STRONGEST).all():
        raise prim.error("inputs:intensity", radiance.tolist(), f"radiance from 0 to {_STRONGEST:g}")
    for share in ("diffuse", "specular"):
        if _number(prim, share, 1.0) != 1.0:
            prim.not_shown(prim.input(share), "the light counts in full for diffuse and glossy reflection")
    return radiance


def _area(axes: Float64Array, shape: LampShape) -> float:
    """The area of a lamp whose diameters or sides are these axes (3, 3)."""
    flat = float(np.linalg.norm(np.cross(axes[:, 0], axes[:, 1])))
    if shape != "sphere":
        return flat if shape == "quad" else math.pi / 4.0 * flat
    # An ellipsoid of half axes a, b, c, by Thomsen's formula: exact for a sphere, else within 1.1 %.
    a, b, c = (np.linalg.norm(axes, axis=0) / 2.0) ** 1.6075
    return 4.0 * math.pi * float((a * b + a * c + b * c) / 3.0) ** (1.0 / 1.6075)


def _number(prim: UsdPrim, name: str, default: float) -> float:
    return prim.number(prim.input(name), default)


def _flag(prim: UsdPrim, name: str) -> bool:
    return prim.flag(prim.input(name))
