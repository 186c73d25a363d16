"""Materials of a glTF file: what its JSON says, read as a `PbrMaterial`, whose layers `pbr_layers` makes; emission,
normal map, and what is not shown of it.

KHR_materials_unlit replaces all of that by the colour, as radiance that the camera alone sees.

KHR_materials_pbrSpecularGlossiness is the dielectric whose F0 is the specular colour, as KHR_materials_specular
converts it. Textures of colours and of strengths multiply layers, those of metalness, of roughness, glossiness and of a
film's thickness are maps of parameters.

A part has those sets of texture coordinates that its textures use (`uv_sets`).
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from engine.core.errors import printable_name
from engine.material.bumps import BUMP_STRENGTH, NO_BUMPS, Bumps
from engine.material.layer_maps import IDENTITY_TRANSFORM, MAX_UV_SETS, ChannelImage, LayerMaps, TextureTransform
from engine.material.opacity import OPAQUE, Mode, Opacity
from engine.scene.description import MAX_RADIANCE, LayerDescription
from engine.scene.loaders.gltf_images import GltfImages, NumberTexture, uv_set_of_texture
from engine.scene.loaders.gltf_json import JsonObject
from engine.scene.loaders.model import NO_EMISSION, Emission
from engine.scene.loaders.pbr_layers import (
    LEAST_SHEEN,
    RGB,
    WHITE,
    Coat,
    Film,
    NumberImage,
    PbrMaterial,
    SheenCoat,
    pbr_layers,
    with_coat_frame,
)

# The material of objects without one.
GREY = (LayerDescription(model="lambert", parameters={"albedo": (0.5, 0.5, 0.5)}),)
# That of objects whose vertices have colours.
COLOURED = (
    LayerDescription(model="lambert", maps=LayerMaps(vertex_colours=True), parameters={"albedo": (1.0, 1.0, 1.0)}),
)
LONGEST_NAME = 120
_OF_UNLIT = ("pbrMetallicRoughness", "baseColorTexture", "extensions")
_ALPHA_MODES: dict[str, Mode] = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}
_MAPPED_EXTENSIONS = ("specular", "iridescence", "sheen", "clearcoat", "anisotropy")
_COLOURS = ("baseColorTexture", "diffuseTexture")
BLACK = (LayerDescription(model="lambert", parameters={"albedo": (0.0, 0.0, 0.0)}),)


@dataclass(frozen=True)
class PartMaterial:
    """Layers of a material (glTF's default, white with metal 1 and roughness 1, is replaced by plain grey), its
    emission, whether that lights nothing, what of it is not shown, its normal map, its opacity and its name."""

    layers: tuple[LayerDescription, ...] = GREY
    emission: Emission = NO_EMISSION
    notes: tuple[str, ...] = ()
    bumps: Bumps = NO_BUMPS
    opacity: Opacity = OPAQUE
    name: str = ""

    @property
    def has_images(self) -> bool:
        """Whether it has images, which need texture coordinates."""
        own = self.opacity.opacity_map or self.emission.texture.is_of_files
        shown = any(layer.maps.is_of_files or layer.parameter_maps for layer in self.layers)
        return bool(own or self.bumps.files) or shown

    def without_images(self) -> PartMaterial:
        """The material on a mesh without texture coordinates."""
        opacity, emission = replace(self.opacity, opacity_map=""), self.emission.without_images
        layers = without_images(self.layers)
        return replace(self, layers=layers, bumps=NO_BUMPS, opacity=opacity, emission=emission)


def read_material(fields: JsonObject, images: GltfImages, is_coloured: bool = False) -> PartMaterial:
    """Read a material as layers; values outside their range are clamped, with a note. is_coloured: whether meshes that
    have it have vertex colours, which multiply the base colour [glTF20, 3.9.2]."""
    notes: list[str] = []
    extensions, called = fields.child("extensions"), printable_name(fields.text("name") or "", LONGEST_NAME)
    if extensions.has("KHR_materials_unlit"):
        return replace(_unlit(fields, images, notes, is_coloured), notes=tuple(notes), name=called)
    if not fields.flag("doubleSided") and fields.has("doubleSided"):
        fields.not_shown("doubleSided", "backs of faces reflect as their fronts do")
    if extensions.has("KHR_materials_pbrSpecularGlossiness"):
        colours, name = extensions.child("KHR_materials_pbrSpecularGlossiness"), "diffuse"
        material = _specular_glossiness(colours, images, notes)
        _without_effect(fields.child("pbrMetallicRoughness"))  # for programs without the extension
    else:
        colours, name = fields.child("pbrMetallicRoughness"), "baseColor"
        material = _metallic_roughness(fields, images, notes)
    opacity = _opacity(fields, colours, name, images, is_coloured)
    film = _film(extensions.child("KHR_materials_iridescence"), images, notes)
    streak = _Streak() if film else _streak(extensions.child("KHR_materials_anisotropy"), images, notes)
    material = replace(
        material,
        anisotropy=streak.strength,
        anisotropy_image=streak.image,
        base_texture=replace(material.base_texture, vertex_colours=is_coloured),
        film=film,
        sheen=_sheen(extensions.child("KHR_materials_sheen"), images, notes),
        coat=_coat(extensions.child("KHR_materials_clearcoat"), images, notes),
    )
    emission = _emission(fields, images, notes)
    _list_partly_shown(material, extensions, emits=emission.radiance is not None)
    bumps = _bumps(fields, "normalTexture", images, notes)
    if material.coat is not None:
        coat = extensions.child("KHR_materials_clearcoat")
        bumps = bumps.with_coat(_bumps(coat, "clearcoatNormalTexture", images, notes))
    if streak.strength:
        bumps = replace(
            bumps, tangent_along_u=True, tangent_angle=streak.angle, tangent_map=streak.directions,
            tangent_vectors=bool(streak.directions),
        )  # fmt: skip
    layers = with_coat_frame(pbr_layers(material), bumps)
    return PartMaterial(layers, emission, tuple(notes), bumps, opacity, called)


def _metallic_roughness(fields: JsonObject, images: GltfImages, notes: list[str]) -> PbrMaterial:
    """The core material with KHR_materials_ior and KHR_materials_specular."""
    pbr = fields.child("pbrMetallicRoughness")
    red, green, blue, _ = (pbr.clamped(v, "baseColorFactor") for v in pbr.numbers("baseColorFactor", 4, (1.0,) * 4))
    metallic = pbr.clamped(pbr.number("metallicFactor", 1.0), "metallicFactor")
    roughness = pbr.clamped(pbr.number("roughnessFactor", 1.0), "roughnessFactor")
    rough, metal = images.numbers(pbr, "metallicRoughnessTexture", "gb", notes)
    specular = fields.child("extensions").child("KHR_materials_specular")
    texture = images.maps(specular, "specularColorTexture", notes)
    return PbrMaterial(
        base=(red, green, blue),
        metallic=metallic * metal.factor,
        metallic_image=metal.image,
        roughness=roughness * rough.factor,
        roughness_image=rough.image,
        base_texture=images.maps(pbr, "baseColorTexture", notes),
        facing=_facing_reflectance(fields.child("extensions"), specular),
        specular=specular.clamped(specular.number("specularFactor", 1.0), "specularFactor"),
        facing_texture=texture,
        facing_image=_largest(texture),
        specular_image=images.channel(specular, "specularTexture", "a", notes),
    )


def _facing_reflectance(extensions: JsonObject, specular: JsonObject) -> RGB:
    """F0 of a dielectric before its strength: ((n − 1)/(n + 1))² times the colour of its reflection, at most 1."""
    ior = extensions.child("KHR_materials_ior")
    index = ior.number("ior", 1.5)
    if index != 0.0:
        index = ior.clamped(index, "ior", 1.0, 20.0)
    facing = 1.0 if index == 0.0 else ((index - 1.0) / (index + 1.0)) ** 2
    given = specular.numbers("specularColorFactor", 3, WHITE)
    colour = [specular.clamped(v, "specularColorFactor", 0.0, math.inf) for v in given]
    return _rgb(tuple(min(facing * c, 1.0) for c in colour))


def _specular_glossiness(fields: JsonObject, images: GltfImages, notes: list[str]) -> PbrMaterial:
    """The archived material: a dielectric whose F0 is its specular colour, with roughness 1 − glossiness."""
    red, green, blue, _ = (fields.clamped(v, "diffuseFactor") for v in fields.numbers("diffuseFactor", 4, (1.0,) * 4))
    facing = _rgb(tuple(fields.clamped(v, "specularFactor") for v in fields.numbers("specularFactor", 3, WHITE)))
    glossiness = fields.clamped(fields.number("glossinessFactor", 1.0), "glossinessFactor")
    key = "specularGlossinessTexture"
    texture, (shares,) = images.maps(fields, key, notes), images.numbers(fields, key, "a", [])
    return PbrMaterial(
        (red, green, blue), 0.0, 1.0 - glossiness * shares.factor, images.maps(fields, "diffuseTexture", notes), facing,
        facing_texture=texture, facing_image=_largest(texture), roughness_image=shares.image, roughness_at_black=1.0,
    )  # fmt: skip


def _without_effect(fields: JsonObject) -> None:
    """Count all of an extension as read, because its factor of 0, or another extension, leaves nothing of it."""
    fields.mark_read(*fields.values)
    fields.log.left_out.update(id(value) for value in fields.values.values())


class _Streak(NamedTuple):
    """An anisotropic highlight: its strength and the image of that, its angle in degrees and the image of its
    directions."""

    strength: float = 0.0
    image: NumberImage | None = None
    angle: float = 0.0
    directions: str = ""


def _streak(fields: JsonObject, images: GltfImages, notes: list[str]) -> _Streak:
    """KHR_materials_anisotropy; under a thin film highlights stay round, which is listed as it is not read there."""
    strength = fields.clamped(fields.number("anisotropyStrength", 0.0), "anisotropyStrength")
    if not strength:
        _without_effect(fields)
        return _Streak()
    angle = math.degrees(math.fmod(fields.number("anisotropyRotation", 0.0), 2.0 * math.pi))
    found, directions = NumberTexture(), ""
    if fields.has("anisotropyTexture"):
        (found,) = images.numbers(fields, "anisotropyTexture", "b", notes)
        used = images.use(fields.child("anisotropyTexture"), notes)
        if used is not None:
            directions = f"#{used.image}"
            if used.scale != (1.0, 1.0) or used.transform != IDENTITY_TRANSFORM:
                fields.not_shown("anisotropyTexture", "directions are laid out without the transform, and repeated")
    return _Streak(strength * found.factor, found.image, angle, directions)


def _film(fields: JsonObject, images: GltfImages, notes: list[str]) -> Film | None:
    strength = fields.clamped(fields.number("iridescenceFactor", 0.0), "iridescenceFactor")
    if not strength:
        _without_effect(fields)
        return None
    thickness = fields.clamped(
        fields.number("iridescenceThicknessMaximum", 400.0), "iridescenceThicknessMaximum", 0.0, 5000.0
    )
    key, thinnest = "iridescenceThicknessMinimum", 0.0
    (shares,) = images.numbers(fields, "iridescenceThicknessTexture", "g", notes)
    fields.mark_read(key)  # without a texture there is no black of it
    if fields.has("iridescenceThicknessTexture"):
        thinnest = fields.clamped(fields.number(key, 100.0), key, 0.0, 5000.0)
        thickness = thinnest + shares.factor * (thickness - thinnest)
    ior = fields.clamped(fields.number("iridescenceIor", 1.3), "iridescenceIor", 1.0, 5.0)
    image = images.channel(fields, "iridescenceTexture", "r", notes)
    return Film(strength, ior, thickness, image, shares.image, thinnest)


def _sheen(fields: JsonObject, images: GltfImages, notes: list[str]) -> SheenCoat | None:
    given = fields.numbers("sheenColorFactor", 3, (0.0, 0.0, 0.0))
    colour = _rgb(tuple(fields.clamped(v, "sheenColorFactor") for v in given))
    if not any(colour):
        _without_effect(fields)
        return None
    roughness = fields.clamped(fields.number("sheenRoughnessFactor", 0.0), "sheenRoughnessFactor")
    (shares,) = images.numbers(fields, "sheenRoughnessTexture", "a", notes)
    roughness *= shares.factor
    least = math.sqrt(LEAST_SHEEN)
    if roughness < least:
        fields.note("sheenRoughnessFactor", roughness, f"taken as {least:g}")
        fields.not_shown("sheenRoughnessFactor", f"the sheen has a roughness of at least {least:g}")
    elif shares.image is not None and shares.low * roughness < least:
        fields.not_shown("sheenRoughnessTexture", f"the sheen has a roughness of at least {least:g}")
    texture = images.maps(fields, "sheenColorTexture", notes)
    return SheenCoat(colour, roughness, texture, _largest(texture), shares.image)


def _coat(fields: JsonObject, images: GltfImages, notes: list[str]) -> Coat | None:
    strength = fields.clamped(fields.number("clearcoatFactor", 0.0), "clearcoatFactor")
    if not strength:
        _without_effect(fields)
        return None
    roughness = fields.clamped(fields.number("clearcoatRoughnessFactor", 0.0), "clearcoatRoughnessFactor")
    (shares,) = images.numbers(fields, "clearcoatRoughnessTexture", "g", notes)
    image = images.channel(fields, "clearcoatTexture", "r", notes)
    return Coat(strength, roughness * shares.factor, image=image, roughness_image=shares.image)


def _largest(maps: LayerMaps) -> ChannelImage | None:
    """The largest channel of a colour texture as a share; None where there is none."""
    if not maps.texture:
        return None
    transform = TextureTransform(maps.texture_rotation, maps.texture_offset, maps.texture_wrap, maps.texture_uv_set)
    return ChannelImage(maps.texture, "max", maps.texture_scale, transform)


def _list_partly_shown(material: PbrMaterial, extensions: JsonObject, emits: bool) -> None:
    """List what the layers of a material cannot have together."""
    specular, coat = (extensions.child(f"KHR_materials_{name}") for name in ("specular", "clearcoat"))
    if material.film is not None:
        for key in ("specularTexture", "specularColorTexture"):
            if specular.has(key):
                specular.not_shown(key, "counts as white under iridescence")
    if material.coat is not None and emits:
        coat.not_shown("clearcoatFactor", "the coat does not dim what the surface emits")


def _opacity(fields: JsonObject, colours: JsonObject, name: str, images: GltfImages, is_coloured: bool) -> Opacity:
    """The opacity of a material [glTF20, 3.9.4]: that of the base colour, of its texture and of vertex colours; the
    first two are called `name` in colours."""
    given = fields.text("alphaMode") or "OPAQUE"
    mode = _ALPHA_MODES.get(given, "opaque")
    if given not in _ALPHA_MODES:
        fields.note("alphaMode", given, "taken as OPAQUE")
    if mode != "mask":
        fields.mark_read("alphaCutoff")  # without effect [glTF20, 3.9.4]
    if mode == "opaque":
        return OPAQUE
    key = f"{name}Factor"
    factor = colours.clamped(colours.numbers(key, 4, (1.0,) * 4)[3], key)
    cutoff = fields.clamped(fields.number("alphaCutoff", 0.5), "alphaCutoff") if mode == "mask" else 0.5
    opacity = Opacity(mode, cutoff, factor, opacity_vertices=is_coloured)
    key = f"{name}Texture"
    texture = images.use(colours.child(key), []) if colours.has(key) else None
    if texture is None or not images.has_alpha(texture.image):
        return opacity
    return replace(
        opacity, opacity_map=f"#{texture.image}", opacity_repeats=texture.scale,
        opacity_offset=texture.transform.offset, opacity_rotation=texture.transform.rotation,
        opacity_wrap=texture.transform.wrap, opacity_uv_set=texture.transform.uv_set,
    )  # fmt: skip


def without_images(
    layers: tuple[LayerDescription, ...], lost: Container[str] | None = None
) -> tuple[LayerDescription, ...]:
    """The layers with images as if they were white, None for all: what an inverted weight map leaves of white is
    nothing, parameters have their values at white; vertex colours remain."""

    def is_lost(name: object) -> bool:
        return lost is None or name in lost

    found = []
    for layer in layers:
        maps, tables = layer.maps, {k: each for k, each in layer.parameter_maps.items() if is_lost(each["map"])}
        inverted = [
            (maps.weight, maps.weight_invert),
            *((each.image.file, each.invert) for each in maps.further_weights),
        ]
        if any(inverts and is_lost(name) for name, inverts in inverted):
            continue
        further = tuple(each for each in maps.further_weights if not is_lost(each.image.file))
        maps = replace(maps, further_weights=further)
        if is_lost(maps.texture):
            maps = replace(
                maps, texture="", texture_space="", texture_scale=(1.0, 1.0), texture_offset=(0.0, 0.0),
                texture_rotation=0.0, texture_wrap=("repeat", "repeat"), texture_uv_set=0,
            )  # fmt: skip
        if is_lost(maps.weight):
            maps = replace(maps, weight="", weight_channel="grey", weight_invert=False)
        left = {name: each for name, each in layer.parameter_maps.items() if name not in tables}
        values = layer.parameters | {name: _at_white(each) for name, each in tables.items()}
        found.append(layer.model_copy(update={"maps": maps, "parameter_maps": left, "parameters": values}))
    return tuple(found)


def _at_white(table: Mapping[str, Any]) -> Any:
    high, least = table["range"][1], table.get("least", 0.0)
    return max(high, least) if isinstance(high, float) else high


def _emission(fields: JsonObject, images: GltfImages, notes: list[str]) -> Emission:
    """Emitted radiance: the factor, in [0, 1], times the strength of KHR_materials_emissive_strength and the texture.
    A texture that cannot be read leaves nothing of it: files mostly have a factor of 1 and a texture that is black but
    for a few lights."""
    factor = (fields.clamped(v, "emissiveFactor") for v in fields.numbers("emissiveFactor", 3, (0.0, 0.0, 0.0)))
    extension = fields.child("extensions").child("KHR_materials_emissive_strength")
    strength = extension.clamped(extension.number("emissiveStrength", 1.0), "emissiveStrength", 0.0, MAX_RADIANCE)
    radiance = _rgb(tuple(v * strength for v in factor))
    if not any(radiance):
        fields.log.left_out.add(id(fields.raw("emissiveTexture")))
        return NO_EMISSION
    if fields.flag("doubleSided"):
        fields.not_shown("doubleSided", "backs of faces reflect, but do not shine")
    texture = images.maps(fields, "emissiveTexture", notes)
    if fields.has("emissiveTexture") and not texture.texture:
        fields.not_shown("emissiveTexture", "the surface does not shine: its texture cannot be shown")
        return NO_EMISSION
    return Emission(radiance, texture)


def _unlit(fields: JsonObject, images: GltfImages, notes: list[str], is_coloured: bool) -> PartMaterial:
    """A surface that shows its colour, texture and vertex colours whatever the light [glTF20, KHR_materials_unlit]: as
    radiance that the camera alone sees. It reflects nothing, and casts shadows as all objects do."""
    pbr = fields.child("pbrMetallicRoughness")
    red, green, blue, _ = (pbr.clamped(v, "baseColorFactor") for v in pbr.numbers("baseColorFactor", 4, (1.0,) * 4))
    texture = replace(images.maps(pbr, "baseColorTexture", notes), vertex_colours=is_coloured)
    opacity = _opacity(fields, pbr, "baseColor", images, is_coloured)
    if fields.flag("doubleSided"):
        fields.not_shown("doubleSided", "backs of faces are black")
    # The extension replaces all of the material but its colour and its opacity.
    for owner in (fields, pbr, fields.child("extensions")):
        owner.mark_read(*owner.values)
        owner.log.left_out.update(id(value) for key, value in owner.values.items() if key not in _OF_UNLIT)
    if not any((red, green, blue)):
        return PartMaterial(BLACK, opacity=opacity)
    return PartMaterial((), Emission((red, green, blue), texture, unlit=True), opacity=opacity)


def _bumps(fields: JsonObject, key: str, images: GltfImages, notes: list[str]) -> Bumps:
    """The normal map of a normal texture, by the number of its image; none if that is unavailable."""
    if not fields.has(key):
        return NO_BUMPS
    info = fields.child(key)
    used = images.use(info, notes)
    if used is None:
        return NO_BUMPS
    scale = info.number("scale", 1.0)
    strength = min(max(scale, BUMP_STRENGTH.minimum), BUMP_STRENGTH.maximum)
    if strength != scale:
        notes.append(f"a normal map's scale of {scale:g} is taken as {strength:g}")
    if "directx" in images.name(used.image).lower():
        notes.append("a normal map is for DirectX by its name: if relief looks pressed in, flip its green channel")
    if used.transform.rotation != 0.0:
        info.not_shown("KHR_texture_transform.rotation", "relief runs along the image's own axes")
    return Bumps(
        f"#{used.image}", bump_strength=strength, bump_repeats=used.scale, bump_offset=used.transform.offset,
        bump_wrap=used.transform.wrap, bump_uv_set=used.transform.uv_set,
    )  # fmt: skip


def _rgb(values: tuple[float, ...]) -> RGB:
    return values[0], values[1], values[2]


def uv_sets(materials: list[JsonObject], used: Iterable[int]) -> tuple[int, ...]:
    """The sets of texture coordinates by which the images of these materials are shown, −1 for none, at most as many as
    a mesh has: first that of the first one's colour, or, without such a texture, of its first other one; (0,) without
    images."""
    found: dict[int, None] = {}
    for fields in (materials[k].aside() for k in used if k >= 0):
        extensions, pbr = fields.child("extensions"), fields.child("pbrMetallicRoughness")
        shown = (extensions.child(f"KHR_materials_{name}") for name in _MAPPED_EXTENSIONS)
        for owner in (extensions.child("KHR_materials_pbrSpecularGlossiness"), pbr, fields, *shown):
            keys = sorted((key for key in owner.values if key.endswith("Texture")), key=lambda key: key not in _COLOURS)
            found |= {uv_set_of_texture(owner.child(key)): None for key in keys if key != "occlusionTexture"}
    return tuple(found)[:MAX_UV_SETS] or (0,)
