"""Materials of a USD stage: UsdPreviewSurface networks as a `PbrMaterial`, whose layers `pbr_layers` makes; emission,
normal map, opacity, and what is not shown of them.

The preview surface is the metallic-roughness material of glTF with a free index of refraction, or, with
`useSpecularWorkflow`, a dielectric whose F0 is its specular colour. Both have F90 = 1 and a clear coat of F0 = 0.04.

A part has the sets of texture coordinates that its textures use, at most two, and the vertex colours that its material
reads.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from engine.core.errors import LoadError, describe_value, printable_name
from engine.material.bumps import BUMP_STRENGTH, NO_BUMPS, Bumps
from engine.material.layer_maps import MAX_UV_SETS, Channel, ChannelImage, LayerMaps
from engine.material.opacity import OPAQUE, Opacity
from engine.scene.description import MAX_RADIANCE
from engine.scene.loaders.baked_maps import MapMaker
from engine.scene.loaders.gltf_materials import LONGEST_NAME, PartMaterial
from engine.scene.loaders.model import NO_EMISSION, RGB, Emission
from engine.scene.loaders.pbr_layers import Coat, NumberImage, PbrMaterial, pbr_layers
from engine.scene.loaders.usd_prims import UsdPrim, UsdScene
from engine.scene.loaders.usd_textures import UsdPrimvar, UsdTexture, UsdTextures

PREVIEW = "UsdPreviewSurface"
DEFINITIONS = "ND_"  # identifiers of MaterialX' nodes begin with it
_NUMBERS = {"roughness": 0.5, "metallic": 0.0, "clearcoat": 0.0, "clearcoatRoughness": 0.01, "opacity": 1.0}
_COLOURS = {"diffuseColor": 0.18, "specularColor": 0.0, "emissiveColor": 0.0}
# In the order in which their texture decides on the coordinates of a part.
_TEXTURED = (
    "diffuseColor", "specularColor", "normal", "roughness", "metallic", "opacity", "emissiveColor", "clearcoat",
    "clearcoatRoughness",
)  # fmt: skip
_HARMLESS = {"occlusion": "no effect: shadows are computed", "opacityMode": "opacity is coverage"}


@dataclass(frozen=True)
class UsdMaterial:
    """A material as layers; the primvars of its sets of texture coordinates, and of its vertex colours, "" for none."""

    part: PartMaterial
    coordinates: tuple[str, ...] = ()
    colours: str = ""


class UsdMaterials:
    """The materials of one stage, each read once. maps: those that networks compute."""

    def __init__(self, scene: UsdScene, textures: UsdTextures, maps: MapMaker) -> None:
        self._scene, self._textures, self.maps = scene, textures, maps
        self._read: dict[str, UsdMaterial] = {}

    def material(self, path: str) -> UsdMaterial | None:
        """The material of a path; None where there is none that can be shown."""
        if not path:
            return None
        if path not in self._read:
            prim = self._scene.by_path.get(path)
            found = UsdMaterial(PartMaterial(())) if prim is None else self._surface(prim)
            name = printable_name(path.rpartition("/")[2], LONGEST_NAME)
            self._read[path] = replace(found, part=replace(found.part, name=name))
        return self._read[path]

    def _surface(self, material: UsdPrim) -> UsdMaterial:
        """The material of a surface that is read, that of MaterialX first; without layers, listed, where there is
        none."""
        for key in ("outputs:mtlx:surface", "outputs:surface"):
            found = self._scene.connected(material, key)
            if found is None:
                continue
            shader, _ = found
            kind = shader.word("info:id", "")
            if kind == PREVIEW:
                return self._preview(shader)
            if kind.startswith(DEFINITIONS) and (read := self._network(shader)) is not None:
                return read
            if not kind.startswith(DEFINITIONS):
                shader.not_shown("info:id", f"a surface {describe_value(kind)} that is not known: shown in grey")
        return UsdMaterial(PartMaterial(()))

    def _network(self, shader: UsdPrim) -> UsdMaterial | None:
        """The material of a network of MaterialX; None, listed, where it cannot be read."""
        from engine.scene.loaders.usd_networks import read_surface  # late: few files need it

        try:
            found = read_surface(shader, self._textures, self.maps)
        except LoadError as error:
            shader.not_shown("info:id", f"a network of MaterialX that is not shown: {error.reason}")
            return None
        for each in found.unshown:
            listed = each.name, each.effect
            self._scene.log.unshown[listed] = self._scene.log.unshown.get(listed, 0) + each.count
        return UsdMaterial(PartMaterial(found.layers, found.emission, (), found.bumps, found.opacity))

    def _preview(self, shader: UsdPrim) -> UsdMaterial:
        found = {key: self._textures.read(shader, f"inputs:{key}") for key in _TEXTURED}
        textures = {key: each for key, each in found.items() if isinstance(each, UsdTexture)}
        coordinates = tuple(dict.fromkeys(each.primvar for each in textures.values()))[:MAX_UV_SETS]
        for key, each in list(textures.items()):
            if each.primvar in coordinates:
                transform = each.transform._replace(uv_set=coordinates.index(each.primvar))
                textures[key] = replace(each, transform=transform)
            else:
                effect = f"a texture by other coordinates than the material's first {MAX_UV_SETS} is not shown"
                each.prim.not_shown("inputs:st", effect)
                del textures[key]
        own = _Inputs(shader, self._textures, textures)
        material, colours = own.pbr(), found["diffuseColor"]
        painted = colours.name if isinstance(colours, UsdPrimvar) else ""
        if painted:
            material = replace(material, base=(1.0, 1.0, 1.0), base_texture=LayerMaps(vertex_colours=True))
        emission, glow = own.painted("emissiveColor", MAX_RADIANCE)
        for key, effect in _HARMLESS.items():
            if shader.has(f"inputs:{key}") or shader.source(f"inputs:{key}"):
                shader.not_shown(f"inputs:{key}", effect)
        if shader.source("inputs:displacement") or shader.number("inputs:displacement", 0.0):
            shader.not_shown("inputs:displacement", "the surface keeps the shape of its mesh")
        shines = Emission(emission, glow) if any(emission) else NO_EMISSION
        part = PartMaterial(pbr_layers(material), shines, (), own.bumps(), own.opacity(found["opacity"]))
        if any(emission) and material.coat is not None:
            shader.not_shown("inputs:clearcoat", "the coat does not dim what the surface emits")
        return UsdMaterial(part, coordinates, painted)


class _Inputs:
    """The inputs of a preview surface: numbers and colours, with their textures."""

    def __init__(self, shader: UsdPrim, source: UsdTextures, textures: dict[str, UsdTexture]) -> None:
        self._shader, self._source, self._textures = shader, source, textures

    def pbr(self) -> PbrMaterial:
        """The layers' numbers and images."""
        base, base_maps = self.painted("diffuseColor")
        at_black, roughness, rough = self._ends("roughness")
        material = PbrMaterial(
            base, 0.0, roughness, base_maps, roughness_image=rough, roughness_at_black=at_black, coat=self._coat()
        )
        is_specular = bool(self._source.value_of(self._shader, "inputs:useSpecularWorkflow", 0))
        unused = ("metallic", "ior") if is_specular else ("specularColor",)
        self._shader.mark_read(*(f"inputs:{key}" for key in unused))
        if is_specular:
            facing, maps = self.painted("specularColor")
            largest = self._weight("specularColor", "max")
            return replace(material, facing=facing, facing_texture=maps, facing_image=largest)
        at_black, metallic, metal = self._ends("metallic")
        if at_black and metal is not None:
            self._textures["metallic"].prim.not_shown("inputs:bias", "metalness is scaled alone")
        index = self._shader.clamped(self._number("ior", 1.5), "inputs:ior", 1.0, 20.0)
        f0 = ((index - 1.0) / (index + 1.0)) ** 2
        return replace(material, metallic=metallic, metallic_image=metal, facing=(f0, f0, f0))

    def _coat(self) -> Coat | None:
        strength = self.number("clearcoat")
        if not strength:
            self._shader.mark_read("inputs:clearcoatRoughness")
            return None
        at_black, roughness, image = self._ends("clearcoatRoughness")
        if at_black and image is not None:
            self._textures["clearcoatRoughness"].prim.not_shown("inputs:bias", "roughness is scaled alone")
        own = self._textures.get("clearcoat")
        weight = None if own is None else self._weight("clearcoat", own.single)
        return Coat(strength, roughness, image=weight, roughness_image=image)

    def number(self, key: str) -> float:
        """A number from 0 to 1, or what multiplies its texture."""
        texture = self._textures.get(key)
        value = self._number(key, _NUMBERS[key]) if texture is None else texture.gain
        return self._shader.clamped(value, f"inputs:{key}")

    def colour(self, key: str, most: float = 1.0) -> RGB:
        """A colour, or what multiplies its texture."""
        texture = self._textures.get(key)
        values = texture.scale[:3] if texture is not None else self._triple(key, _COLOURS[key])
        red, green, blue = (self._shader.clamped(v, f"inputs:{key}", 0.0, most) for v in values)
        return red, green, blue

    def bumps(self) -> Bumps:
        """The normal map; texels c are directions scale · c + bias."""
        texture = self._textures.get("normal")
        if texture is None:
            if self._shader.has("inputs:normal") and not self._shader.source("inputs:normal"):
                self._shader.mark_read("inputs:normal")  # one direction for all is that of the surface
            return NO_BUMPS
        prim, (across, up, _, _) = texture.prim, texture.scale
        if not (math.isclose(texture.bias[0], -0.5 * across, abs_tol=0.01) and across > 0.0):
            prim.not_shown("inputs:bias", "the normal map counts as one of scale 2 and bias -1")
            across, up = 2.0, math.copysign(2.0, up)
        if texture.transform.rotation:
            prim.not_shown("inputs:st", "relief runs along the image's own axes")
        return Bumps(
            texture.image, bump_strength=min(abs(across) / 2.0, BUMP_STRENGTH.maximum), bump_repeats=texture.repeats,
            bump_offset=texture.transform.offset, bump_wrap=texture.transform.wrap, flip_green=up < 0.0,
            bump_uv_set=texture.transform.uv_set,
        )  # fmt: skip

    def opacity(self, source: UsdTexture | UsdPrimvar | None) -> Opacity:
        """Coverage: cut out at `opacityThreshold` where that is above 0, else a share."""
        threshold = self._shader.clamped(self._number("opacityThreshold", 0.0), "inputs:opacityThreshold")
        opacity = Opacity("mask" if threshold > 0.0 else "blend", threshold or 0.5)
        if isinstance(source, UsdPrimvar):
            return replace(opacity, opacity_vertices=True)
        texture = self._textures.get("opacity")
        if texture is None:
            factor = self.number("opacity")
            return OPAQUE if factor == 1.0 else replace(opacity, opacity_factor=factor)
        has_alpha = self._source.has_alpha(texture)
        if texture.channel == "a" and not has_alpha:
            return OPAQUE
        if texture.channel != "a" and has_alpha:
            texture.prim.not_shown("outputs:" + texture.channel, "the image's alpha counts as opacity")
        if any(texture.bias):
            texture.prim.not_shown("inputs:bias", "opacity is scaled alone")
        return replace(
            opacity, opacity_factor=min(max(texture.gain, 0.0), 1.0), opacity_map=texture.image,
            opacity_repeats=texture.repeats, opacity_offset=texture.transform.offset,
            opacity_rotation=texture.transform.rotation, opacity_wrap=texture.transform.wrap,
            opacity_uv_set=texture.transform.uv_set,
        )  # fmt: skip

    def painted(self, key: str, most: float = 1.0) -> tuple[RGB, LayerMaps]:
        """A colour, and the texture that it multiplies."""
        texture = self._textures.get(key)
        if texture is None:
            return self.colour(key, most), LayerMaps()
        if any(texture.bias[:3]):
            texture.prim.not_shown("inputs:bias", "a colour is scaled alone")
        if texture.channel != "rgb":
            texture.prim.not_shown("outputs:" + texture.channel, "all colours of the image count")
        return self.colour(key, most), texture.maps

    def _ends(self, key: str) -> tuple[float, float, NumberImage | None]:
        """What black and white of the image of a number become, and the image; without one, or where that is the same
        everywhere, twice the number."""
        texture = self._textures.get(key)
        if texture is None:
            return self.number(key), self.number(key), None
        k = "rgba".index(texture.single)
        if texture.space == "srgb":
            texture.prim.not_shown("inputs:sourceColorSpace", "numbers are taken as the image has them")
        low, high = self._source.extremes(texture)
        if low == high:
            value = self._shader.clamped(texture.scale[k] * low + texture.bias[k], f"inputs:{key}")
            return value, value, None
        at_black = self._shader.clamped(texture.bias[k], f"inputs:{key}")
        return at_black, self.number(key), texture.numbers

    def _weight(self, key: str, channel: Channel) -> ChannelImage | None:
        texture = self._textures.get(key)
        return None if texture is None else texture.weight(channel)

    def _number(self, key: str, default: float) -> float:
        value = self._source.value_of(self._shader, f"inputs:{key}", default)
        if isinstance(value, list) and value:  # the fallback of a texture's colour
            value = value[0]
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            self._shader.note(f"inputs:{key}", value, f"taken as {default:g}")
            return default
        return float(value)

    def _triple(self, key: str, default: float) -> RGB:
        value = self._source.value_of(self._shader, f"inputs:{key}", [default] * 3)
        is_triple = isinstance(value, list) and len(value) == 3
        if not isinstance(value, list) or not is_triple or not all(math.isfinite(float(v)) for v in value):
            self._shader.note(f"inputs:{key}", value, f"taken as {default:g}")
            return default, default, default
        red, green, blue = map(float, value)
        return red, green, blue
