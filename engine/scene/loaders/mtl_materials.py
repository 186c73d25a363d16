"""Materials of OBJ files as layers.

The format is older than any convention on its numbers, so that what programs write decides which of three kinds a
material is:

- **with Pr or Pm**, the extension for physically based materials: metallic-roughness as in glTF, with a sheen Ps and a
  coat Pc of roughness Pcr;
- **by Blender**, whose first line says so: metallic-roughness too, with the roughness 1 - sqrt(Ns / 1000), the
  metalness Ka where illum is 3, and the reflectance 0.08 Ks at normal incidence, as its exporter writes them; its
  map_Ns is an image of the roughness;
- **else** the format's own: diffuse Kd and a highlight. In light of strength 1 a surface shows
  Kd cos(theta_i) + Ks cos(theta_h)^Ns, where white shows 1. A Blinn-Phong layer with the scale 8 Ks / (Ns + 2) is equal
  to it at normal incidence. Where both together reflect more than they receive, both are scaled.

Colours are linear, and images of colours are sRGB, as Blender reads and writes them. Images multiply the numbers of
their materials; a number that is 0 or missing beside its image counts as 1, since programs write it for none. Images
are looked for in the OBJ file's folder and those inside (`engine.core.safe_files.find_inside`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from engine.core.errors import LoadError, describe_value
from engine.core.safe_files import find_inside, read_regular_file
from engine.material.bumps import BUMP_STRENGTH, DEFAULT_HEIGHT, NO_BUMPS, Bumps
from engine.material.layer_maps import LayerMaps, Wrap
from engine.material.opacity import OPAQUE, Opacity
from engine.scene.description import MAX_RADIANCE, LayerDescription
from engine.scene.loaders.image_files import FileImages
from engine.scene.loaders.model import NO_EMISSION, RGB, Emission, ImportedPart, UnshownProperty
from engine.scene.loaders.mtl import MtlImage, MtlMaterial, parse_library
from engine.scene.loaders.pbr_layers import Coat, NumberImage, PbrMaterial, SheenCoat, pbr_layers
from engine.scene.mesh import Mesh
from engine.texture.texture_files import MAX_IMAGE_BYTES, read_texture

MAX_LIBRARY_BYTES = 16 * 2**20
_MOST_LIBRARIES = 16
_SHARPEST = 1e6  # Ns
_MIRRORS = 3  # values of illum from here are of ray tracing
_SHOWN = frozenset("kd ks ke ns pr pm d tr illum".split())
_COATS = frozenset("ps pc pcr".split())  # of physically based materials
_SHEEN_ROUGHNESS = 0.5  # the format has no number for it
_ADDS_NOTHING = frozenset("ka map_ka ni sharpness map_aat".split())  # light of its own, and what others do with it
_EVEN, _FLAT = "the material is the same everywhere", "the surface stays flat"
# Of a key that is not shown: the value without effect, if there is one, and what the picture lacks.
_UNSHOWN: dict[str, tuple[float | None, str]] = {
    "tf": (1.0, "light that passes is not coloured"), "map_tr": (None, "the surface is equally opaque"),
    "ps": (0.0, "no sheen"), "map_ps": (None, _EVEN), "pc": (0.0, "no clear coat"), "pcr": (0.0, "no clear coat"),
    "map_pc": (None, _EVEN),
    "aniso": (0.0, "a round highlight"), "anisor": (0.0, "a round highlight"), "map_ns": (None, _EVEN),
    "disp": (None, _FLAT), "map_disp": (None, _FLAT), "decal": (None, "no decal"),
    "refl": (None, "the scene is reflected in place of an image"),
}  # fmt: skip


class Materials:
    """The materials of an OBJ file. notes: on the materials that parts have; unread: the names of libraries that are
    not read, and why, "" if all are."""

    def __init__(self, file: Path, libraries: Iterable[str]) -> None:
        self._root, self._images = file.parent, FileImages(file.parent)
        self._are_directions: dict[str, bool] = {}
        self._found: dict[str, MtlMaterial] = {}
        self._used: dict[str, MtlMaterial] = {}
        self._notes: dict[str, None] = {}
        names = [each for name in [*libraries][:_MOST_LIBRARIES] for each in self._library_names(name)]
        found = {describe_value(name): self._read_library(name) for name in names[:_MOST_LIBRARIES]}
        self.unread = ", ".join(f"{name} ({why})" for name, why in found.items() if why)

    @property
    def notes(self) -> tuple[str, ...]:
        """Each once, in order."""
        return tuple(self._notes)

    @property
    def unshown(self) -> tuple[UnshownProperty, ...]:
        """The keys that are not shown of the materials that parts have, and how many of these have each."""
        found = [_unshown_keys(material) for material in self._used.values()]
        effects = {key: effect for each in found for key, effect in each.items()}
        return tuple(
            UnshownProperty(f"mtl.{key}", sum(key in each for each in found), effect) for key, effect in effects.items()
        )

    def part(self, mesh: Mesh, name: str) -> ImportedPart:
        """The part of a mesh and of the material with that name, without layers where that is not known. Without
        texture coordinates it has no images."""
        material = self._found.get(name)
        if material is None:
            return ImportedPart(mesh, name=name)
        self._used[name] = material
        images = {
            key: shown
            for key, image in material.images.items()
            if mesh.uvs is not None and (shown := self._image(image, material.folder))
        }
        base_maps = replace(_maps(images.get("map_kd")), vertex_colours=mesh.colours is not None)
        layers = self._layers(name, material, base_maps, images)
        return ImportedPart(
            mesh, layers, _emission(images, material), bumps=self._bumps(images, material),
            opacity=self._opacity(name, images, material), name=name,
        )  # fmt: skip

    def _library_names(self, names: str) -> list[str]:
        """The libraries that a line names: several, if each word is such a name and they are not one with blanks."""
        words = names.split()
        are_names = all(word.lower().endswith(".mtl") for word in words)
        return words if are_names and len(words) > 1 and not find_inside(self._root, self._root, names) else [names]

    def _read_library(self, name: str) -> str:
        """Read a library of the file's folder; returns why that cannot be, else ""."""
        path = find_inside(self._root, self._root, name)
        if path is None:
            return "not in the OBJ file's folder"
        try:
            read = parse_library(read_regular_file(path, MAX_LIBRARY_BYTES), path)
        except LoadError as error:
            return error.reason
        self._found = read | self._found
        return ""

    def _image(self, image: MtlImage, folder: Path) -> MtlImage | None:
        """The image by its name from the OBJ file's folder; None, with a note, where it cannot be shown."""
        try:
            return replace(image, name=self._images.find(folder, image.name))
        except LoadError as error:
            self._note(f"image {describe_value(image.name)} is not shown: {error.reason}")
            return None

    def _bumps(self, images: dict[str, MtlImage], material: MtlMaterial) -> Bumps:
        """A normal map of `norm`, and of `bump` as well where Blender wrote it or its mean is that of directions; else
        heights, which have no unit in the file."""
        image = images.get("norm") or images.get("bump")
        if image is None:
            return NO_BUMPS
        strength = min(abs(image.strength), BUMP_STRENGTH.maximum)
        layout = Bumps(
            bump_strength=strength, bump_repeats=image.scale, bump_offset=image.offset, bump_wrap=_wrap(image)
        )
        if "norm" in images or material.by_blender or self._has_directions(image):
            return replace(layout, normal_map=image.name)
        self._note(f"heights of {describe_value(image.name)} have no unit: white is {DEFAULT_HEIGHT:g} m high")
        return replace(layout, bump_map=image.name)

    def _opacity(self, name: str, images: dict[str, MtlImage], material: MtlMaterial) -> Opacity:
        """The opacity d, or 1 - Tr, times that of an image. Of a material that would not be seen at all, Tr means the
        opposite, as some programs write it."""
        image, factor = images.get("map_d"), material.number("d", 1.0 - material.number("tr", 0.0))
        if factor == 0.0:
            self._note(f"{describe_value(name)} would not be seen: it is taken as opaque")
            factor = 1.0
        if image is None:
            return OPAQUE if factor == 1.0 else Opacity("blend", opacity_factor=factor)
        return Opacity(
            "blend", opacity_factor=factor, opacity_map=image.name, opacity_repeats=image.scale,
            opacity_offset=image.offset, opacity_wrap=_wrap(image),
        )  # fmt: skip

    def _has_directions(self, image: MtlImage) -> bool:
        """Whether an image's mean is near that of a normal map, (1/2, 1/2, 1)."""
        if image.name not in self._are_directions:
            path = self._root / image.name
            red, green, blue = read_texture(read_regular_file(path, MAX_IMAGE_BYTES), path, "linear").mean(axis=(0, 1))
            self._are_directions[image.name] = abs(red - 0.5) < 0.15 and abs(green - 0.5) < 0.15 and blue > 0.65
        return self._are_directions[image.name]

    def _note(self, line: str) -> None:
        self._notes[line] = None

    def _layers(
        self, name: str, material: MtlMaterial, base_maps: LayerMaps, images: dict[str, MtlImage]
    ) -> tuple[LayerDescription, ...]:
        base = material.colour("kd", 1.0 if base_maps.texture else 0.8)
        if base_maps.texture and (material.by_blender or not any(base)):
            base = (1.0, 1.0, 1.0)  # Blender writes a colour that it does not use; others 0, for none
        if material.by_blender or material.is_physical:
            return _metallic_roughness(material, base, base_maps, images)
        glossy = material.colour("ks") if material.number("illum", 2.0, 0.0, 10.0) >= 2.0 else (0.0, 0.0, 0.0)
        exponent = material.number("ns", 10.0, 0.0, _SHARPEST)
        share = 8.0 / (exponent + 2.0)
        total = max(d + share * s for d, s in zip(base, glossy, strict=True))
        if total > 1.0:
            self._note(f"{describe_value(name)} reflects {total:.3g} times the light it receives: scaled to 1")
        albedo, scale = (_scaled(colour, by / max(total, 1.0)) for colour, by in ((base, 1.0), (glossy, share)))
        diffuse = LayerDescription(model="lambert", maps=base_maps, parameters={"albedo": albedo})
        if not any(scale):
            return (diffuse,)
        parameters = {"exponent": exponent, "reflectance": 1.0, "scale": scale}
        glossy_maps = _maps(images.get("map_ks"))
        return diffuse, LayerDescription(model="blinn_phong", maps=glossy_maps, parameters=parameters)


def _emission(images: dict[str, MtlImage], material: MtlMaterial) -> Emission:
    """Ke times its image; without an image that the file names and that is not there, nothing of it."""
    radiance = material.colour("ke", most=MAX_RADIANCE)
    if "map_ke" not in material.images:
        return Emission(radiance) if any(radiance) else NO_EMISSION
    if "map_ke" not in images:
        return NO_EMISSION
    return Emission(radiance if any(radiance) else (1.0, 1.0, 1.0), _maps(images["map_ke"]))


def _metallic_roughness(
    material: MtlMaterial, base: RGB, maps: LayerMaps, images: dict[str, MtlImage]
) -> tuple[LayerDescription, ...]:
    """The layers of a physically based material, or of Blender's."""
    rough, metal = images.get("map_pr"), images.get("map_pm")
    if material.is_physical:
        metallic, roughness = material.number("pm", 0.0), material.number("pr", 0.5)
        index = material.number("ni", 1.5, 1.0, 20.0)
        facing = _scaled((1.0, 1.0, 1.0), ((index - 1.0) / (index + 1.0)) ** 2)
        roughness = (roughness if "pr" in material.values else 0.0) or 1.0 if rough else roughness
        metallic = metallic or 1.0 if metal else metallic
    else:
        metallic = material.number("ka", 0.0) if material.number("illum", 2.0, 0.0, 10.0) == _MIRRORS else 0.0
        roughness = 1.0 - math.sqrt(material.number("ns", 250.0, 0.0, 1000.0) / 1000.0)
        facing, rough = _scaled(material.colour("ks", 0.5), 0.08), images.get("map_ns")
        roughness = 1.0 if rough else roughness  # Blender writes a number that it does not use
    sheen, coat = material.number("ps", 0.0), Coat(material.number("pc", 0.0), material.number("pcr", 0.0))
    cloth = SheenCoat(_scaled((1.0, 1.0, 1.0), sheen), _SHEEN_ROUGHNESS)
    return pbr_layers(
        PbrMaterial(
            base, metallic, roughness, maps, facing, metallic_image=_numbers(metal),
            roughness_image=_numbers(rough), sheen=cloth, coat=coat,
        )
    )  # fmt: skip


def _numbers(image: MtlImage | None) -> NumberImage | None:
    """An image of numbers: its brightness, linear."""
    if image is None:
        return None
    return NumberImage(
        {"map": image.name, "repeats": image.scale, "offset": image.offset, "wrap": _wrap(image)},
    )


def _unshown_keys(material: MtlMaterial) -> dict[str, str]:
    """The keys of a material that are not shown, and what the picture lacks."""
    found = {}
    for key, values in material.values.items():
        neutral, effect = _UNSHOWN.get(key, (None, "not a key that is known"))
        shown = _SHOWN | _COATS if material.by_blender or material.is_physical else _SHOWN
        if key not in shown | _ADDS_NOTHING and any(v != neutral for v in values):
            found[key] = effect
    is_mirror = material.number("illum", 2.0, 0.0, 10.0) >= _MIRRORS and not material.by_blender
    if is_mirror and not material.is_physical:
        found["illum"] = "no mirror beside the highlight, and nothing shines through"
    if "map_ns" in material.images and (material.is_physical or not material.by_blender):
        found["map_ns"] = _UNSHOWN["map_ns"][1]
    for key in material.unread:
        if key not in _ADDS_NOTHING:
            found[key] = _UNSHOWN.get(key, (None, "not read in this form"))[1]
    return found


def _maps(image: MtlImage | None) -> LayerMaps:
    """The maps of a layer with this image of colours."""
    if image is None:
        return LayerMaps()
    return LayerMaps(image.name, "srgb", image.scale, texture_offset=image.offset, texture_wrap=_wrap(image))


def _wrap(image: MtlImage) -> tuple[Wrap, Wrap]:
    return ("clamp", "clamp") if image.is_clamped else ("repeat", "repeat")


def _scaled(colour: RGB, by: float) -> RGB:
    red, green, blue = colour
    return red * by, green * by, blue * by
