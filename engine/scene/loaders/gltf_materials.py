"""Materials of a glTF file: what its JSON says, read as a `PbrMaterial`, whose layers `pbr_layers` makes; emission,
normal map, and what is not shown of it.

KHR_materials_pbrSpecularGlossiness is the dielectric whose F0 is the specular colour, as KHR_materials_specular
converts it. Textures of colours and of strengths multiply layers, those of metalness and of roughness are maps of
parameters; of other textures of roughness the mean is shown. Images are named `#N` here, the Nth of the file; the
caller, who knows the file's name, prepends it.

A part has one set of texture coordinates, that of its colour's texture (`uv_set`).

An image that is unavailable (in a format of an extension, mapped by another set of coordinates, too large relative to
the file together with those before it, or missing) is skipped with a note: the material's factors replace it. Images
with equal bytes are one. Mappings by KHR_texture_transform and samplers are preserved.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from engine.core.errors import LoadError, printable_name
from engine.material.bumps import BUMP_STRENGTH, NO_BUMPS, Bumps
from engine.material.layer_maps import IDENTITY_TRANSFORM, MAX_REPEATS, Channel, LayerMaps, TextureTransform, Wrap
from engine.material.opacity import OPAQUE, Mode, Opacity
from engine.scene.description import MAX_RADIANCE, LayerDescription
from engine.scene.loaders.gltf_buffers import GltfBuffers
from engine.scene.loaders.gltf_json import JsonObject
from engine.scene.loaders.pbr_layers import (
    RGB,
    WHITE,
    Coat,
    Film,
    NumberImage,
    PbrMaterial,
    SheenCoat,
    WeightImage,
    pbr_layers,
)
from engine.texture.texture_files import check_image, has_alpha, image_size, read_texture, read_weight, reduction

# The material of objects without one.
GREY = (LayerDescription(model="lambert", parameters={"albedo": (0.5, 0.5, 0.5)}),)
# That of objects whose vertices have colours.
COLOURED = (
    LayerDescription(model="lambert", maps=LayerMaps(vertex_colours=True), parameters={"albedo": (1.0, 1.0, 1.0)}),
)
LONGEST_NAME = 120
_ALPHA_MODES: dict[str, Mode] = {"OPAQUE": "opaque", "MASK": "mask", "BLEND": "blend"}
_NOT_SHOWN = {"emissiveTexture": "emissive textures"}
# Limit of pixels of all images of one file, plus more for every byte: a few kilobytes can claim millions of pixels.
# They are decoded when they are used, at 0.1 s a megapixel: at most 6 s for a small file, and never in the window's
# process.
MOST_PIXELS = 1 << 26
PIXELS_A_BYTE = 32
_REPEAT = 10497
_IMAGE_EXTENSIONS = ("KHR_texture_basisu", "EXT_texture_webp")
_LEAST_REPEAT = 1e-3


@dataclass(frozen=True)
class PartMaterial:
    """Layers of a material (glTF's default, white with metal 1 and roughness 1, is replaced by plain grey), its
    emission, what of it is not shown, its normal map, its opacity and its name."""

    layers: tuple[LayerDescription, ...] = GREY
    emission: RGB | None = None
    notes: tuple[str, ...] = ()
    bumps: Bumps = NO_BUMPS
    opacity: Opacity = OPAQUE
    name: str = ""

    @property
    def has_images(self) -> bool:
        """Whether it has images, which need texture coordinates."""
        own = self.bumps.file or self.opacity.opacity_map
        return bool(own) or any(layer.maps.is_of_files for layer in self.layers)


def read_material(fields: JsonObject, images: GltfImages, is_coloured: bool = False) -> PartMaterial:
    """Read a material as layers; values outside their range are clamped, with a note. is_coloured: whether meshes that
    have it have vertex colours, which multiply the base colour [glTF20, 3.9.2]."""
    notes: list[str] = []
    if not fields.flag("doubleSided") and fields.has("doubleSided"):
        fields.not_shown("doubleSided", "backs of faces reflect as their fronts do")
    extensions = fields.child("extensions")
    if extensions.has("KHR_materials_pbrSpecularGlossiness"):
        colours, name = extensions.child("KHR_materials_pbrSpecularGlossiness"), "diffuse"
        material = _specular_glossiness(colours, images, notes)
    else:
        colours, name = fields.child("pbrMetallicRoughness"), "baseColor"
        material = _metallic_roughness(fields, images, notes)
    opacity = _opacity(fields, colours, name, images, is_coloured)
    material = replace(
        material,
        base_texture=replace(material.base_texture, vertex_colours=is_coloured),
        film=_film(extensions.child("KHR_materials_iridescence"), images, notes),
        sheen=_sheen(extensions.child("KHR_materials_sheen"), images, notes),
        coat=_coat(extensions.child("KHR_materials_clearcoat"), images, notes),
    )
    emission = _emission(fields)
    _list_partly_shown(material, extensions, emits=any(emission))
    notes += [f"{words} are not shown" for key, words in _NOT_SHOWN.items() if fields.has(key)]
    emits = any(emission) and not fields.has("emissiveTexture")
    bumps = _bumps(fields.child("normalTexture"), images, notes) if fields.has("normalTexture") else NO_BUMPS
    shown = emission if emits else None
    called = printable_name(fields.text("name") or "", LONGEST_NAME)
    return PartMaterial(pbr_layers(material), shown, tuple(notes), bumps, opacity, called)


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
        specular_image=images.weight(specular, "specularTexture", "a", notes),
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
    texture = images.maps(fields, "specularGlossinessTexture", notes)
    if texture.texture:
        glossiness *= images.mean_alpha(fields.child("specularGlossinessTexture"), notes)
        fields.not_shown("specularGlossinessTexture", "the surface has its mean glossiness everywhere")
    return PbrMaterial(
        (red, green, blue), 0.0, 1.0 - glossiness, images.maps(fields, "diffuseTexture", notes), facing,
        facing_texture=texture, facing_image=_largest(texture),
    )  # fmt: skip


def _without_effect(fields: JsonObject) -> None:
    """Count all of an extension as read, because its factor of 0 leaves nothing of it."""
    fields.mark_read(*fields.values)
    fields.log.left_out.update(id(value) for value in fields.values.values())


def _film(fields: JsonObject, images: GltfImages, notes: list[str]) -> Film | None:
    strength = fields.clamped(fields.number("iridescenceFactor", 0.0), "iridescenceFactor")
    if not strength:
        _without_effect(fields)
        return None
    thickness = fields.clamped(
        fields.number("iridescenceThicknessMaximum", 400.0), "iridescenceThicknessMaximum", 0.0, 5000.0
    )
    if fields.has("iridescenceThicknessTexture"):
        key = "iridescenceThicknessMinimum"
        least = fields.clamped(fields.number(key, 100.0), key, 0.0, 5000.0)
        share = images.mean(fields.child("iridescenceThicknessTexture"), notes)[1]
        fields.not_shown("iridescenceThicknessTexture", "the film has its mean thickness everywhere")
        thickness = least + share * (thickness - least)
    ior = fields.clamped(fields.number("iridescenceIor", 1.3), "iridescenceIor", 1.0, 5.0)
    return Film(strength, ior, thickness, images.weight(fields, "iridescenceTexture", "r", notes))


def _sheen(fields: JsonObject, images: GltfImages, notes: list[str]) -> SheenCoat | None:
    given = fields.numbers("sheenColorFactor", 3, (0.0, 0.0, 0.0))
    colour = _rgb(tuple(fields.clamped(v, "sheenColorFactor") for v in given))
    if not any(colour):
        _without_effect(fields)
        return None
    roughness = fields.clamped(fields.number("sheenRoughnessFactor", 0.0), "sheenRoughnessFactor")
    if fields.has("sheenRoughnessTexture"):
        roughness *= images.mean_alpha(fields.child("sheenRoughnessTexture"), notes)
        fields.not_shown("sheenRoughnessTexture", "the sheen has its mean roughness everywhere")
    texture = images.maps(fields, "sheenColorTexture", notes)
    return SheenCoat(colour, roughness, texture, _largest(texture))


def _coat(fields: JsonObject, images: GltfImages, notes: list[str]) -> Coat | None:
    strength = fields.clamped(fields.number("clearcoatFactor", 0.0), "clearcoatFactor")
    if not strength:
        _without_effect(fields)
        return None
    roughness = fields.clamped(fields.number("clearcoatRoughnessFactor", 0.0), "clearcoatRoughnessFactor")
    if fields.has("clearcoatRoughnessTexture"):
        roughness *= images.mean(fields.child("clearcoatRoughnessTexture"), notes)[1]
        fields.not_shown("clearcoatRoughnessTexture", "the coat has its mean roughness everywhere")
    if fields.has("clearcoatNormalTexture"):
        fields.not_shown("clearcoatNormalTexture", "the coat has the normals of what lies under it")
    return Coat(strength, roughness, image=images.weight(fields, "clearcoatTexture", "r", notes))


def _largest(maps: LayerMaps) -> WeightImage | None:
    """The largest channel of a colour texture as a share; None where there is none, or where it does not lie in plain
    texture coordinates, as weight maps do: the share counts as 1 there."""
    is_plain = bool(maps.texture) and LayerMaps(maps.texture, maps.texture_space) == maps
    return WeightImage(maps.texture, "max") if is_plain else None


def _list_partly_shown(material: PbrMaterial, extensions: JsonObject, emits: bool) -> None:
    """List what the layers of a material cannot have together."""
    specular, sheen, coat = (
        extensions.child(f"KHR_materials_{name}") for name in ("specular", "sheen", "clearcoat")
    )  # fmt: skip
    has_share = material.specular_image is not None or material.facing_image is not None
    if material.film is not None:
        for key in ("specularTexture", "specularColorTexture"):
            if specular.has(key):
                specular.not_shown(key, "counts as white under iridescence")
        has_share = material.film.image is not None
    if material.sheen is not None and material.sheen.image is not None:
        if has_share:
            sheen.not_shown("sheenColorTexture", "sheen takes from layers with another map as if it were white")
        has_share = True
    if material.coat is not None:
        if material.coat.image is not None and has_share:
            coat.not_shown("clearcoatTexture", "the coat takes from layers with another map as if it were whole")
        if emits:
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
        opacity_wrap=texture.transform.wrap,
    )  # fmt: skip


def without_images(layers: tuple[LayerDescription, ...]) -> tuple[LayerDescription, ...]:
    """The layers on a mesh without texture coordinates, all images white: what an inverted weight map leaves of white
    is nothing; vertex colours remain."""
    return tuple(
        layer.model_copy(update={"maps": LayerMaps(vertex_colours=layer.maps.vertex_colours)})
        for layer in layers
        if not layer.maps.weight_invert
    )


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
    if "directx" in images.name(used.image).lower():
        notes.append("a normal map is for DirectX by its name: if relief looks pressed in, flip its green channel")
    if used.transform.rotation != 0.0:
        info.not_shown("KHR_texture_transform.rotation", "relief runs along the image's own axes")
    return Bumps(
        f"#{used.image}", bump_strength=strength, bump_repeats=used.scale, bump_offset=used.transform.offset,
        bump_wrap=used.transform.wrap,
    )  # fmt: skip


def _rgb(values: tuple[float, ...]) -> RGB:
    return values[0], values[1], values[2]


_WRAPS: dict[int, Wrap] = {_REPEAT: "repeat", 33648: "mirror", 33071: "clamp"}


@dataclass(frozen=True)
class TextureUse:
    """An image's number in its file, its repeats along u and v, and the rest of its mapping."""

    image: int
    scale: tuple[float, float]
    transform: TextureTransform


def uv_set(fields: JsonObject) -> int:
    """The set of texture coordinates by which a material's images are shown: that of its colour's texture, or, without,
    of its first other one."""
    extensions, pbr = fields.child("extensions"), fields.child("pbrMetallicRoughness")
    glossiness = extensions.child("KHR_materials_pbrSpecularGlossiness")
    for owner, key in (
        (glossiness, "diffuseTexture"), (pbr, "baseColorTexture"), (fields, "normalTexture"),
        (pbr, "metallicRoughnessTexture"), (fields, "emissiveTexture"),
    ):  # fmt: skip
        if owner.has(key):
            return _uv_set(owner.child(key))
    return 0


def _uv_set(info: JsonObject) -> int:
    """The set of texture coordinates of a texture; its transform may name another."""
    transform = info.child("extensions").child("KHR_texture_transform")
    return transform.integer("texCoord", 0, 64, info.integer("texCoord", 0, 64, 0))


class NumberTexture(NamedTuple):
    """A channel of a texture that multiplies a number: its factor where it is the same everywhere, else its image."""

    factor: float = 1.0
    image: NumberImage | None = None


class GltfImages:
    """The images of one file. uv_set: the set of texture coordinates of the meshes whose material is read."""

    uv_set = 0

    def __init__(self, root: JsonObject, buffers: GltfBuffers) -> None:
        self._root, self._buffers = root, buffers
        self._textures, self._images = root.children("textures"), root.children("images")
        self._samplers = root.children("samplers")
        self._means: dict[int, tuple[float, float, float]] = {}
        self._extremes: dict[int, tuple[list[float], list[float]]] = {}
        self._first_of: dict[str, int] = {}
        self._usable: dict[int, tuple[int | None, str]] = {}
        self._pixels_left = MOST_PIXELS + PIXELS_A_BYTE * buffers.n_bytes

    def use(self, info: JsonObject, notes: list[str]) -> TextureUse | None:
        """Read a material's texture, None if it cannot be shown; the reason becomes a note."""
        image = self._image(info, notes)
        if image is None:
            return None
        wrap = self._wrap(self._textures[info.integer("index", 0, len(self._textures) - 1)])
        scale, rotation, offset = _transform(info.child("extensions").child("KHR_texture_transform"))
        # Whole offsets of an image that repeats have no effect.
        shifts = [o - round(o) if w == "repeat" else o for o, w in zip(offset, wrap, strict=True)]
        along_u, along_v = (0.0 if abs(shift) < 1e-9 else shift for shift in shifts)
        return TextureUse(image, scale, TextureTransform(rotation, (along_u, along_v), wrap))

    def name(self, image: int) -> str:
        """An image's name, or its file's."""
        fields = self._images[image]
        return fields.text("name") or (fields.text("uri") or "")[:256]

    def has_alpha(self, image: int) -> bool:
        """Whether an image that can be read has alpha."""
        return has_alpha(self._buffers.image(image), f"{self._root.file}#{image}")

    def _wrap(self, texture: JsonObject) -> tuple[Wrap, Wrap]:
        """How a texture's sampler continues the image beyond its edges."""
        if not texture.has("sampler"):
            return "repeat", "repeat"
        sampler = self._samplers[texture.integer("sampler", 0, len(self._samplers) - 1)]
        found: list[Wrap] = []
        for key in ("wrapS", "wrapT"):
            number = sampler.raw(key, _REPEAT)
            wrap = _WRAPS.get(number) if isinstance(number, int) else None
            if wrap is None:
                sampler.note(key, number, "taken as repeating")
            found.append(wrap or "repeat")
        return found[0], found[1]

    def maps(self, fields: JsonObject, key: str, notes: list[str]) -> LayerMaps:
        """A colour texture, decoded by sRGB, as what multiplies a layer; nothing if it cannot be shown."""
        used = self.use(fields.child(key), notes) if fields.has(key) else None
        if used is None:
            return LayerMaps()
        own = used.transform
        return LayerMaps(
            f"#{used.image}", "srgb", used.scale, texture_offset=own.offset, texture_rotation=own.rotation,
            texture_wrap=own.wrap,
        )  # fmt: skip

    def weight(self, fields: JsonObject, key: str, channel: Channel, notes: list[str]) -> WeightImage | None:
        """A channel of a texture as a share; None if it cannot be shown."""
        used = self.use(fields.child(key), notes) if fields.has(key) else None
        if used is None:
            return None
        if used.scale != (1.0, 1.0) or used.transform != IDENTITY_TRANSFORM:
            fields.not_shown(key, "laid out without its transform, and repeated")
        return WeightImage(f"#{used.image}", channel)

    def numbers(self, fields: JsonObject, key: str, channels: str, notes: list[str]) -> list[NumberTexture]:
        """Channels of a texture of numbers; ones if it cannot be shown."""
        used = self.use(fields.child(key), notes) if fields.has(key) else None
        if used is None:
            return [NumberTexture() for _ in channels]
        if used.image not in self._extremes:
            pixels = read_texture(self._buffers.image(used.image), f"{self._root.file}#{used.image}", "linear")
            self._extremes[used.image] = pixels.min(axis=(0, 1)).tolist(), pixels.max(axis=(0, 1)).tolist()
        own, found = used.transform, []
        for channel in channels:
            low, high = (ends["rgb".index(channel)] for ends in self._extremes[used.image])
            keys = {
                "map": f"#{used.image}", "channel": channel, "repeats": used.scale, "offset": own.offset,
                "rotation": own.rotation, "wrap": own.wrap,
            }  # fmt: skip
            found.append(NumberTexture(low) if low == high else NumberTexture(1.0, NumberImage(keys)))
        return found

    def mean_alpha(self, info: JsonObject, notes: list[str]) -> float:
        """Mean of an image's opacity; 1 if it is unavailable."""
        image = self._image(info, notes)
        if image is None:
            return 1.0
        shares = read_weight(self._buffers.image(image), f"{self._root.file}#{image}", channel="a")
        return float(shares.mean(dtype=np.float64))

    def mean(self, info: JsonObject, notes: list[str]) -> tuple[float, float, float]:
        """Mean of an image of numbers, not of colours; 1 if it is unavailable."""
        image = self._image(info, notes)
        if image is None:
            return 1.0, 1.0, 1.0
        if image not in self._means:
            name = f"{self._root.file}#{image}"
            # A mean needs no mapping.
            pixels = read_texture(self._buffers.image(image), name, "linear")
            red, green, blue = pixels.reshape(-1, 3).mean(axis=0, dtype=np.float64).tolist()
            self._means[image] = red, green, blue
        notes.append("of a texture of numbers the means are shown")
        return self._means[image]

    def _image(self, info: JsonObject, notes: list[str]) -> int | None:
        """The number of an image that can be read."""
        texture = self._textures[info.integer("index", 0, len(self._textures) - 1)]
        if _uv_set(info) != self.uv_set:
            notes.append("a texture by a second set of coordinates is not shown")
            info.not_shown("texCoord", "a texture by another set of coordinates than the material's first is not shown")
            return None
        sources = [each for each in _sources(texture) if each.has("source")]
        if not sources:
            notes.append("a texture in a format of an extension is not shown")
            return None
        for k, source in enumerate(sources):
            image = source.integer("source", 0, len(self._images) - 1)
            if image not in self._usable:
                self._usable[image] = self._examined(image)
            usable, note = self._usable[image]
            if usable is not None:
                for other in sources[k:]:
                    other.mark_read("source")
                return usable
            notes.append(note)
        return None

    def _examined(self, image: int) -> tuple[int | None, str]:
        """The first image with these bytes, if it can be read; else None and the reason."""
        where = [self._images[image].raw(key) for key in ("bufferView", "uri")]
        first = self._first_of.setdefault(repr(where), image)
        if first != image:
            return self._usable[first]
        try:
            data, name = self._buffers.image(image), f"{self._root.file}#{image}"
            size = image_size(data, name)
            if size is None:
                return None, f"image {image} is no PNG, JPEG, WebP or KTX 2 and not shown"
            n_pixels, k = size[0] * size[1], reduction(*size)
            if k > 1:  # cost: the pixels shown, and an eighth for decoding the rest
                n_pixels = n_pixels // k**2 + n_pixels // 8
            if n_pixels > self._pixels_left:
                return None, "images are not shown that have, with those before them, too many pixels for such a file"
            check_image(data, name)
        except LoadError as error:
            return None, f"image {image} is not shown: {error.reason}"
        self._pixels_left -= n_pixels
        return image, ""


def _sources(texture: JsonObject) -> list[JsonObject]:
    """Where a texture names its image, the first choice first: extensions stand for a format that the image of the
    texture itself replaces where they are not known."""
    extensions = texture.child("extensions")
    return [*(extensions.child(name) for name in _IMAGE_EXTENSIONS), texture]


def _transform(transform: JsonObject) -> tuple[tuple[float, float], float, tuple[float, float]]:
    """Repeats (s_u, s_v), rotation in degrees and offset (o_u, o_v), v upwards.

    In glTF v grows downwards: u' = c s_u u + s s_v v + o_u and v' = −s s_u u + c s_v v + o_v with the cosine c and the
    sine s of the rotation (as in the extension's sample models). With 1 − v for v, before and after, this is a
    counter-clockwise rotation by the same angle and the offset (o_u + s s_v, 1 − o_v − c s_v).
    """
    given = transform.numbers("scale", 2, (1.0, 1.0))
    across, down = (_repeat(transform, number) for number in given)
    right, below = transform.numbers("offset", 2, (0.0, 0.0))
    angle = math.fmod(transform.number("rotation", 0.0), 2.0 * math.pi)
    cosine, sine = math.cos(angle), math.sin(angle)
    offset = right + sine * down, 1.0 - below - cosine * down
    along_u, along_v = (transform.clamped(o, "offset", -MAX_REPEATS, MAX_REPEATS) for o in offset)
    return (across, down), math.degrees(angle), (along_u, along_v)


def _repeat(transform: JsonObject, number: float) -> float:
    """The number, or one of a usable size: 0 would reduce an image to one colour."""
    size = min(max(abs(number), _LEAST_REPEAT), MAX_REPEATS)
    if size == abs(number):
        return number
    taken = math.copysign(size, number)
    transform.note("scale", number, f"taken as {taken:g}")
    return taken
