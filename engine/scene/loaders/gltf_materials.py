"""glTF metallic-roughness as layers: a Lambert layer and a rough conductor.

The glossy layer's reflectance at normal incidence is F0 = 0.04 (1 − m) + m · base colour, its width α = roughness²
[glTF20, B]. A conductor's curve needs an index: η and k follow from F0 by [Gulbrandsen14],

    n_min = (1 − F0)/(1 + F0),  n_max = (1 + √F0)/(1 − √F0),  η = g n_min + (1 − g) n_max,
    k² = ((η + 1)² F0 − (η − 1)²)/(1 − F0),

with the edge tint g = metalness: a dielectric gets k = 0 and the true index 1.5, a metal one that stays bright. The
value 0.04 belongs to index 1.5; KHR_materials_ior and KHR_materials_specular change it.

A texture of the base colour multiplies the layers that have it. A partial metal becomes the mixture that glTF defines,
(1 − m) times the dielectric and m times the metal, because only the metal has the texture's colours. A
metallic-roughness texture is replaced by its means: a layer has the same curve everywhere. Images are named `#N` here,
the Nth of the file; the caller, who knows the file's name, prepends it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from engine.material.bumps import BUMP_STRENGTH, NO_BUMPS, Bumps
from engine.material.layer_maps import LayerMaps
from engine.scene.description import MAX_RADIANCE, LayerDescription
from engine.scene.loaders.glb import JsonObject
from engine.scene.loaders.gltf_textures import GltfImages, TextureUse

_DIELECTRIC = 0.04
_SMOOTHEST = 0.01
_BRIGHTEST = 0.98
_MIXED = 0.02  # metalness this close to 0 or 1 counts as that
RGB = tuple[float, float, float]
GREY = (LayerDescription(model="lambert", parameters={"albedo": (0.5, 0.5, 0.5)}),)
"""What has no material at all."""


@dataclass(frozen=True)
class PartMaterial:
    """Layers of a material (glTF's default, white with metal 1 and roughness 1, is replaced by plain grey), its
    emission, what of it is not shown, and its normal map."""

    layers: tuple[LayerDescription, ...] = GREY
    emission: RGB | None = None
    notes: tuple[str, ...] = ()
    bumps: Bumps = NO_BUMPS


def read_material(fields: JsonObject, images: GltfImages) -> PartMaterial:
    """Read a material as layers; values outside their range are clamped, with a note."""
    notes: list[str] = []
    pbr = fields.child("pbrMetallicRoughness")
    base_colour = pbr.numbers("baseColorFactor", 4, (1.0,) * 4)
    red, green, blue, _ = (pbr.clamped(v, "baseColorFactor") for v in base_colour)
    metallic = pbr.clamped(pbr.number("metallicFactor", 1.0), "metallicFactor")
    roughness = pbr.clamped(pbr.number("roughnessFactor", 1.0), "roughnessFactor")
    if pbr.has("metallicRoughnessTexture"):
        _, rough_mean, metal_mean = images.mean(pbr.child("metallicRoughnessTexture"), notes)
        metallic, roughness = metallic * metal_mean, roughness * rough_mean
    texture = images.use(pbr.child("baseColorTexture"), notes) if pbr.has("baseColorTexture") else None
    emission = _emission(fields)
    notes += [f"{words} are not shown" for key, words in _NOT_SHOWN.items() if fields.has(key)]
    if fields.text("alphaMode") not in (None, "OPAQUE"):
        notes.append("transparency is not shown")
    emits = any(emission) and not fields.has("emissiveTexture")
    base, facing = (red, green, blue), _facing_reflectance(fields.child("extensions"))
    layers = metallic_roughness_layers(base, metallic, roughness, facing, texture)
    bumps = _bumps(fields.child("normalTexture"), images, notes) if fields.has("normalTexture") else NO_BUMPS
    return PartMaterial(layers, emission if emits else None, tuple(notes), bumps)


_NOT_SHOWN = {"emissiveTexture": "emissive textures"}


def _emission(fields: JsonObject) -> RGB:
    """Emitted radiance: the factor, in [0, 1], times the strength of KHR_materials_emissive_strength."""
    factor = (fields.clamped(v, "emissiveFactor") for v in fields.numbers("emissiveFactor", 3, (0.0, 0.0, 0.0)))
    extension = fields.child("extensions").child("KHR_materials_emissive_strength")
    strength = extension.clamped(extension.number("emissiveStrength", 1.0), "emissiveStrength", 0.0, MAX_RADIANCE)
    return _rgb(tuple(v * strength for v in factor))


def _bumps(info: JsonObject, images: GltfImages, notes: list[str]) -> Bumps:
    """The normal map of a normal texture, by the number of its image; none if that is unavailable."""
    used = images.use(info, notes)
    if used is None:
        return NO_BUMPS
    scale = info.number("scale", 1.0)
    strength = min(max(scale, BUMP_STRENGTH.minimum), BUMP_STRENGTH.maximum)
    if strength != scale:
        notes.append(f"a normal map's scale of {scale:g} is taken as {strength:g}")
    if used.transform.rotation != 0.0:
        notes.append("the rotation of a normal map is not shown")
    return Bumps(
        f"#{used.image}", bump_strength=strength, bump_repeats=used.scale, bump_offset=used.transform.offset,
        bump_wrap=used.transform.wrap,
    )  # fmt: skip


def metallic_roughness_layers(
    base: RGB, metallic: float, roughness: float, facing: RGB = (_DIELECTRIC,) * 3, texture: TextureUse | None = None
) -> tuple[LayerDescription, ...]:
    """Layers for a linear base colour, a metalness and a roughness in [0, 1]; facing: F0 of the dielectric part."""
    if texture is None:
        reflectance = _rgb(tuple(f * (1 - metallic) + c * metallic for f, c in zip(facing, base, strict=True)))
        glossy: list[LayerDescription] = [_glossy(reflectance, metallic, roughness)]
    else:
        glossy = []
        metallic = 0.0 if metallic < _MIXED else 1.0 if metallic > 1.0 - _MIXED else metallic
        mixed = 0.0 < metallic < 1.0
        if metallic < 1.0:
            glossy.append(_glossy(facing, 0.0, roughness, 1.0 - metallic, "coat" if mixed else None))
        if metallic > 0.0:
            glossy.append(_glossy(base, 1.0, roughness, metallic, "metal" if mixed else None, texture))
    diffuse = _rgb(tuple((1 - metallic) * (1 - max(facing)) * c for c in base))
    if not any(diffuse):
        return tuple(glossy)
    maps = _maps(texture)
    return (LayerDescription(model="lambert", maps=maps, parameters={"albedo": diffuse}), *glossy)


def _glossy(
    reflectance: RGB, tint: float, roughness: float, scale: float = 1.0, name: str | None = None,
    texture: TextureUse | None = None,
) -> LayerDescription:  # fmt: skip
    """A rough conductor with this reflectance at normal incidence."""
    indices = [conductor_index(f0, tint) for f0 in reflectance]
    parameters = {
        "distribution": "ggx",
        "alpha": max(roughness**2, _SMOOTHEST),
        "eta": tuple(eta for eta, _ in indices),
        "k": tuple(k for _, k in indices),
        "scale": scale,
    }
    return LayerDescription(model="rough_conductor", name=name, maps=_maps(texture), parameters=parameters)


def _maps(texture: TextureUse | None) -> LayerMaps:
    if texture is None:
        return LayerMaps()
    own = texture.transform
    return LayerMaps(
        f"#{texture.image}", "srgb", texture.scale, texture_offset=own.offset, texture_rotation=own.rotation,
        texture_wrap=own.wrap,
    )  # fmt: skip


def _facing_reflectance(extensions: JsonObject) -> RGB:
    """F0 of a dielectric: ((n − 1)/(n + 1))² times the colour and the strength of its reflection."""
    ior, specular = extensions.child("KHR_materials_ior"), extensions.child("KHR_materials_specular")
    index = ior.number("ior", 1.5)
    if index != 0.0:
        index = ior.clamped(index, "ior", 1.0, 20.0)
    facing = 1.0 if index == 0.0 else ((index - 1.0) / (index + 1.0)) ** 2
    strength = specular.clamped(specular.number("specularFactor", 1.0), "specularFactor")
    given = specular.numbers("specularColorFactor", 3, (1.0, 1.0, 1.0))
    colour = [specular.clamped(v, "specularColorFactor", 0.0, math.inf) for v in given]
    return _rgb(tuple(min(facing * c, 1.0) * strength for c in colour))


def conductor_index(f0: float, tint: float) -> tuple[float, float]:
    """(η, k) of a conductor with reflectance f0 at normal incidence [Gulbrandsen14, eq. 1-4]; f0 is clamped to 0.98."""
    f0 = min(max(f0, 0.0), _BRIGHTEST)
    root = math.sqrt(f0)
    eta = tint * (1 - f0) / (1 + f0) + (1 - tint) * (1 + root) / (1 - root)
    squared = ((eta + 1) ** 2 * f0 - (eta - 1) ** 2) / (1 - f0)
    return eta, math.sqrt(squared) if squared > 1e-12 else 0.0  # for a dielectric, rounding leaves about 1e-16


def _rgb(values: tuple[float, ...]) -> RGB:
    return values[0], values[1], values[2]
