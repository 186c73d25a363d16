"""Networks of MaterialX in USD materials (`outputs:mtlx:surface`): the nodes of UsdShade in the form that the reader of
MaterialX shares (`engine.scene.loaders.mtlx.read_network`)."""

from __future__ import annotations

from engine.core.errors import LoadError
from engine.scene.loaders.baked_maps import MapMaker
from engine.scene.loaders.mtlx import NamedImages, read_network
from engine.scene.loaders.shader_graph import Link, NetworkNode
from engine.scene.loaders.surface_parts import SurfaceMaterial
from engine.scene.loaders.usd_prims import UsdPrim
from engine.scene.loaders.usd_textures import UsdTextures

_MOST_NODES = 2_000
# Colour spaces as USD names them, and as MaterialX does.
_SPACES = {"sRGB": "srgb_texture", "srgb_rec709_scene": "srgb_texture", "raw": "none", "lin_rec709_scene": "lin_rec709"}


def read_surface(surface: UsdPrim, textures: UsdTextures, maps: MapMaker) -> SurfaceMaterial:
    """The material whose surface is a shader of MaterialX. Raises LoadError."""
    nodes: list[NetworkNode] = []
    met = {surface.place}
    waiting = [surface]
    while waiting:
        prim = waiting.pop()
        if len(nodes) >= _MOST_NODES:
            raise prim.error("nodes", f"more than {_MOST_NODES}", f"at most {_MOST_NODES} in a material")
        inputs, spaces = dict[str, str | Link](), dict[str, str]()
        for key in prim.values:
            if not key.startswith("inputs:"):
                continue
            name = key.removeprefix("inputs:")
            source, output = textures.source(prim, key)
            if output.startswith("outputs:"):
                inputs[name] = Link(source.place, output.removeprefix("outputs:"))
                if source.place not in met:
                    met.add(source.place)
                    waiting.append(source)
                continue
            text = _text(source, output, textures)
            if text is not None:
                inputs[name] = text
                space = source.about(output, "space")
                spaces |= {name: _SPACES.get(space, space)} if space else {}
        nodes.append(NetworkNode(prim.place, prim.word("info:id", ""), inputs, spaces))
    return read_network(nodes, surface.place, NamedImages(textures.data_of, lambda name: name), maps, surface.file)


def _text(prim: UsdPrim, key: str, textures: UsdTextures) -> str | None:
    """A value as MaterialX writes it; an image by its name in parts. None, listed, for one that cannot be shown."""
    value = prim.raw(key)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return value
    if isinstance(value, list):
        return ", ".join(map(repr, value))
    if isinstance(value, dict) and "asset" in value:
        try:
            return textures.image(*prim.asset(key))
        except LoadError as error:
            prim.not_shown(key, f"an image that is not shown: {error.reason}")
            return ""
    return None
