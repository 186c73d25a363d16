"""What of a glTF file is not shown: every property that no reader asked for, by its name in the file.

`JsonObject` records the keys that are read. The walk over the whole JSON lists all others, whatever they are, with the
number of their places and what the picture lacks: `_EFFECTS` has words for those of the specification and of Khronos'
extensions, a general line serves the rest. Not listed are names, data of the program that wrote the file (`asset`,
`extras`), and what has no effect on a picture by rays (`_HARMLESS`). An object of the file that nothing in its scene
uses is listed as a whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any

from engine.core.errors import printable_name
from engine.scene.loaders.gltf_json import JsonObject
from engine.scene.loaders.model import UnshownProperty

MOST_LISTED = 500
LONGEST_NAME = 120
UNKNOWN = "not known to Insitu: the picture is as if it were not there"
_REQUIRED = "the file says that it cannot be shown without"
UNUSED = "nothing in the scene that is shown uses it"
# Extensions that change how the data of a file is read, and are read here.
READ_EXTENSIONS = frozenset(
    {
        "EXT_mesh_gpu_instancing", "EXT_meshopt_compression", "EXT_texture_webp", "KHR_draco_mesh_compression",
        "KHR_mesh_quantization", "KHR_meshopt_compression", "KHR_texture_basisu", "KHR_texture_transform",
    }
)  # fmt: skip
# Patterns of names that are not listed, each for a reason.
_HARMLESS = (
    "asset*", "*extras", "*KHR_xmp*", "name", "*.name",  # of the program that wrote the file
    "extensionsUsed", "extensionsRequired",  # listed by name where they are not known
    "accessors.min", "accessors.max", "bufferViews.target", "images.mimeType", "skins.skeleton",  # hints for speed
    "scene", "scenes", "samplers.minFilter",  # texels are always filtered over the pixel
    # Data: what reads them is listed.
    "accessors.bufferView", "accessors.byteOffset", "accessors.componentType", "accessors.count",
    "accessors.normalized", "accessors.type", "accessors.sparse", "bufferViews.buffer", "bufferViews.byteLength",
    "bufferViews.byteOffset", "bufferViews.byteStride", "buffers.byteLength", "buffers.uri", "buffers.*.fallback",
)  # fmt: skip
_EFFECTS = (
    ("animations*", "an animation that is not played"),
    ("cameras*", "a view that is not offered"),
    ("nodes.KHR_lights_punctual*", "a lamp that is not lit"),
    ("KHR_lights_punctual*", "lamps that are not lit"),
    ("nodes.EXT_lights_ies*", "a lamp that is not lit"),
    ("*EXT_lights_image_based*", "an environment that does not light the scene"),
    ("nodes.KHR_node_visibility*", "objects may be shown that are hidden"),
    ("nodes.MSFT_lod*", "the finest level of detail is shown"),
    ("nodes.skin", "a mesh that does not bend"),
    ("*.weights", "the shape without its morph targets"),
    ("meshes.primitives.targets*", "the shape without its morph targets"),
    ("meshes.primitives.attributes.COLOR_*", "colours of vertices do not tint the surface"),
    ("meshes.primitives.attributes.TEXCOORD_*", "coordinates that no shown texture uses"),
    ("meshes.primitives.attributes.TANGENT", "tangents are computed: the file's need normals and coordinates"),
    ("meshes.primitives.attributes.JOINTS_*", "a mesh that does not bend"),
    ("meshes.primitives.attributes.WEIGHTS_*", "a mesh that does not bend"),
    ("meshes.primitives.attributes._*", "data of an application"),
    ("meshes.primitives.KHR_materials_variants*", "the other looks of the file are not offered"),
    ("KHR_materials_variants*", "the other looks of the file are not offered"),
    ("materials.alpha*", "surfaces are opaque where the file has holes or glass"),
    ("materials.doubleSided", "the back of faces may look unlike the front"),
    ("materials.emissive*", "surfaces do not glow as they should"),
    ("materials.occlusionTexture*", "no effect: shadows are computed"),
    ("materials.normalTexture*", "relief of the surface is missing, or in part"),
    ("materials.pbrMetallicRoughness.metallicRoughnessTexture*", "gloss and metal do not vary over the surface"),
    ("materials.pbrMetallicRoughness*", "the surface's colour or gloss is unlike the file's"),
    ("materials.KHR_materials_anisotropy*", "highlights are round where they should be streaks"),
    ("materials.KHR_materials_clearcoat*", "no clear coat over the surface"),
    ("materials.KHR_materials_dispersion*", "glass does not spread colours"),
    ("materials.KHR_materials_diffuse_transmission*", "light does not shine through thin surfaces"),
    ("materials.KHR_materials_emissive_strength*", "surfaces do not glow as they should"),
    ("materials.KHR_materials_ior*", "the strength of reflection is that of index 1.5"),
    ("materials.KHR_materials_iridescence*", "no colours of a thin film"),
    ("materials.KHR_materials_pbrSpecularGlossiness*", "the surface's colour or gloss is unlike the file's"),
    ("materials.KHR_materials_sheen*", "no sheen of cloth at grazing angles"),
    ("materials.KHR_materials_specular*", "the strength or colour of reflection is unlike the file's"),
    ("materials.KHR_materials_transmission*", "surfaces are opaque that should let light through"),
    ("materials.KHR_materials_unlit*", "surfaces are shaded that should show their plain colour"),
    ("materials.KHR_materials_volume*", "bodies are not tinted or thick"),
    ("samplers.magFilter", "texels are blended that should show as squares"),
    ("textures*", "a texture that is not shown, or as another"),
    ("images*", "an image that is not shown"),
)  # fmt: skip
_LINEAR = 9729
# Lists whose items are data: one that is not used is no part of the scene, and not listed.
_DATA = frozenset({"accessors", "bufferViews", "buffers", "samplers", "scenes"})
_OBJECTS = frozenset({"images", "materials", "meshes", "nodes", "skins", "textures"})


def unshown_properties(root: JsonObject) -> tuple[UnshownProperty, ...]:
    """What no reader has asked for, and what readers list as not shown, by name."""
    required, used = unknown_requirements(root), _unknown(root, "extensionsUsed")
    unread: dict[str, int] = {}
    for name in _unread(root):
        unread[name] = unread.get(name, 0) + 1
    names = sorted(name for name in unread if not any(fnmatchcase(name, pattern) for pattern in _HARMLESS))
    found = [UnshownProperty(name, n, effect) for (name, effect), n in root.log.unshown.items()]
    found += [UnshownProperty(name, unread[name], _effect(name)) for name in names]
    words = {word for each in found for word in each.name.split(".")}
    found += [UnshownProperty(f"extensionsRequired.{name}", 1, _REQUIRED) for name in required]
    found += [
        UnshownProperty(f"extensionsUsed.{name}", 1, UNKNOWN)
        for name in used
        if name not in words and name not in required
    ]
    if len(found) > MOST_LISTED:
        n_more = sum(each.count for each in found[MOST_LISTED:])
        found = [*found[:MOST_LISTED], UnshownProperty("others", n_more, "too many properties to list")]
    return tuple(replace(each, name=printable_name(each.name, LONGEST_NAME)) for each in found)


def unknown_requirements(root: JsonObject) -> list[str]:
    """The extensions that the file requires and Insitu does not know."""
    return _unknown(root, "extensionsRequired")


def _unknown(root: JsonObject, key: str) -> list[str]:
    names = root.texts(key)
    return [name for name in dict.fromkeys(names) if name not in READ_EXTENSIONS and not _has_words(name)]


def _has_words(extension: str) -> bool:
    return any(extension in pattern for pattern, _ in _EFFECTS)


def _unread(root: JsonObject) -> Iterator[str]:
    """The name of each property that was not read, once for each of its places."""
    log = root.log
    stack: list[tuple[dict[str, Any], str, bool]] = [(root.values, "", False)]
    while stack:
        values, place, are_extensions = stack.pop()
        read = log.read.get(id(values), set())
        for key, value in values.items():
            if key in read and not isinstance(value, (dict, list)):
                continue
            name = f"{place}.{key}" if place else key
            if key == "extensions" and isinstance(value, dict):
                stack.append((value, place, True))
            elif isinstance(value, dict) and (key in read or (are_extensions and value)):
                stack += [(value, name, False)] if id(value) not in log.left_out else []
            elif key not in read:
                if (name, value) != ("samplers.magFilter", _LINEAR):
                    yield name
            else:
                for item in value:
                    if not item or not isinstance(item, dict) or (number := id(item)) in log.left_out:
                        continue
                    if place or number in log.read:
                        stack.append((item, name, False))
                    elif key not in _DATA:
                        yield key


def _effect(name: str) -> str:
    """What the picture lacks without a property."""
    if "." not in name and name in _OBJECTS:
        return UNUSED
    return next((effect for pattern, effect in _EFFECTS if fnmatchcase(name, pattern)), UNKNOWN)
