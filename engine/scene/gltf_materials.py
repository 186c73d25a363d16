"""glTF metallic-roughness as layers: a Lambert layer and a rough conductor.

The glossy layer's reflectance at normal incidence is F0 = 0.04 (1 − m) + m · base colour, its width α = roughness²
[glTF 2.0, appendix B]. A conductor's curve needs an index: η and k follow from F0 by [Gulbrandsen14],

    n_min = (1 − F0)/(1 + F0),  n_max = (1 + √F0)/(1 − √F0),  η = g n_min + (1 − g) n_max,
    k² = ((η + 1)² F0 − (η − 1)²)/(1 − F0),

with the edge tint g = metalness: a dielectric gets k = 0 and the true index 1.5, a metal one that stays bright.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from engine.scene.description import LayerDescription
from engine.scene.glb import Fields

_DIELECTRIC = 0.04
_SMOOTHEST = 0.01
_BRIGHTEST = 0.98


@dataclass(frozen=True)
class PartMaterial:
    """Layers of a material (glTF's default: white, metal 1, roughness 1, is replaced by plain grey), its emission."""

    layers: tuple[LayerDescription, ...] = (LayerDescription(model="lambert", parameters={"albedo": (0.5, 0.5, 0.5)}),)
    emission: tuple[float, float, float] | None = None
    textured: bool = False


def read_material(fields: Fields) -> PartMaterial:
    """A material's factors as layers; raises LoadError for values outside [0, 1]."""
    pbr = fields.child("pbrMetallicRoughness")
    red, green, blue, _ = (_unit(v, pbr, "baseColorFactor") for v in pbr.numbers("baseColorFactor", 4, (1.0,) * 4))
    metallic = _unit(pbr.number("metallicFactor", 1.0), pbr, "metallicFactor")
    roughness = _unit(pbr.number("roughnessFactor", 1.0), pbr, "roughnessFactor")
    emissive = fields.numbers("emissiveFactor", 3, (0.0, 0.0, 0.0))
    emission = (_unit(emissive[0], fields, "emissiveFactor"), _unit(emissive[1], fields, "emissiveFactor"),
                _unit(emissive[2], fields, "emissiveFactor"))
    textured = pbr.has("baseColorTexture") or pbr.has("metallicRoughnessTexture") or fields.has("emissiveTexture")
    shines = any(emission) and not fields.has("emissiveTexture")
    layers = metallic_roughness_layers((red, green, blue), metallic, roughness)
    return PartMaterial(layers, emission if shines else None, textured)


def metallic_roughness_layers(
    base: tuple[float, float, float], metallic: float, roughness: float
) -> tuple[LayerDescription, ...]:
    """Layers for a linear base colour, a metalness and a roughness in [0, 1]."""
    reflectance = [_DIELECTRIC * (1 - metallic) + c * metallic for c in base]
    indices = [conductor_index(f0, metallic) for f0 in reflectance]
    glossy = LayerDescription(model="rough_conductor", parameters={
        "distribution": "ggx",
        "alpha": max(roughness**2, _SMOOTHEST),
        "eta": tuple(eta for eta, _ in indices),
        "k": tuple(k for _, k in indices),
        "scale": 1.0,
    })
    diffuse = tuple((1 - metallic) * (1 - _DIELECTRIC) * c for c in base)
    if not any(diffuse):
        return (glossy,)
    return (LayerDescription(model="lambert", parameters={"albedo": diffuse}), glossy)


def conductor_index(f0: float, tint: float) -> tuple[float, float]:
    """(η, k) of a conductor with reflectance f0 at normal incidence [Gulbrandsen14, eq. 1-4]; f0 up to 0.98 counts."""
    f0 = min(max(f0, 0.0), _BRIGHTEST)
    root = math.sqrt(f0)
    eta = tint * (1 - f0) / (1 + f0) + (1 - tint) * (1 + root) / (1 - root)
    squared = ((eta + 1) ** 2 * f0 - (eta - 1) ** 2) / (1 - f0)
    return eta, math.sqrt(squared) if squared > 1e-12 else 0.0  # rounding leaves a dielectric about 1e-16


def _unit(value: float, fields: Fields, key: str) -> float:
    """The value if it is in [0, 1]."""
    if not 0.0 <= value <= 1.0:
        raise fields.error(key, value, "numbers from 0 to 1")
    return value
