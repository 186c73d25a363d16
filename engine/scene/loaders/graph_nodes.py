"""Networks of shading nodes as fields over texture coordinates: images, patterns, arithmetic and colour corrections.

Places in space are known where the mesh is, as on the balls of .mtlx files. What cannot be evaluated, such as noise in
space on a mesh of which only texture coordinates are known, counts as the middle of its values and is listed with its
effect.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, partial
from typing import Literal, NamedTuple, Protocol, cast

import numpy as np

from engine.core.colour import REC709, decode_srgb, to_rec709
from engine.core.errors import LoadError, printable_name
from engine.light.resampling import block_means, reduction
from engine.scene.loaders.graph_fields import (
    COORDINATES,
    AddressMode,
    Array,
    Field,
    ImageUse,
    PlainImage,
    combine,
    constant,
    image_field,
)
from engine.scene.loaders.graph_noise import MOST_OCTAVES, PATTERNS, pattern
from engine.scene.loaders.graph_operations import OPERATIONS, apply_operation, operation_inputs
from engine.scene.loaders.graph_relief import normals_of_heights
from engine.scene.loaders.model import UnshownProperty
from engine.scene.loaders.shader_graph import N_CHANNELS, ShaderInput, ShaderNode

MOST_TEXELS = 1 << 22  # of images in networks, and of what is made of them
_MOST_IMAGES = 4  # in memory
_MOST_NOISE = 128  # octaves of one network: a second each for a map
_SEPARATED = frozenset({"separate2", "separate3", "separate4"})
_ONE_INPUT = _SEPARATED | {"convert", "blur"}
_COORDINATES = frozenset({"texcoord", "geompropvalue", "geompropvalueuniform", "UsdPrimvarReader"})
_UV_NAMES = frozenset({"", "UV0", "UV", "uv", "st", "st0", "map1", "uvmap", "UVMap"})
EVALUATED = frozenset(
    {*OPERATIONS, *PATTERNS, *_SEPARATED, *_COORDINATES, "image", "hextiledimage", "convert", "blur", "position",
     "heighttonormal"}
)  # fmt: skip
"""Categories of nodes that become fields here."""
_MODES: dict[str, AddressMode] = {"periodic": "periodic", "clamp": "clamp", "mirror": "mirror", "constant": "constant",
                                  "black": "constant"}  # fmt: skip
_DISPLAY_P3 = (0.68, 0.32, 0.265, 0.69, 0.15, 0.06, 0.3127, 0.329)
_ADOBE_RGB = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.329)
_AP1 = (0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.32168, 0.33767)
_AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
_REC2020 = (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329)
# Colour spaces: the exponent that decodes them, 0 for sRGB's curve, and their primaries and white.
_SPACES: dict[str, tuple[float, tuple[float, ...]]] = {
    "": (1.0, REC709), "none": (1.0, REC709), "raw": (1.0, REC709), "lin_rec709": (1.0, REC709),
    "lin_rec709_scene": (1.0, REC709), "srgb_texture": (0.0, REC709), "srgb_rec709_scene": (0.0, REC709),
    "g22_rec709": (2.2, REC709), "g22_rec709_scene": (2.2, REC709), "g18_rec709": (1.8, REC709),
    "g18_rec709_scene": (1.8, REC709), "acescg": (1.0, _AP1), "lin_ap1": (1.0, _AP1), "lin_ap1_scene": (1.0, _AP1),
    "g22_ap1": (2.2, _AP1), "g22_ap1_scene": (2.2, _AP1), "lin_ap0_scene": (1.0, _AP0),
    "adobergb": (563 / 256, _ADOBE_RGB),
    "lin_adobergb": (1.0, _ADOBE_RGB), "g22_adobergb_scene": (563 / 256, _ADOBE_RGB),
    "lin_adobergb_scene": (1.0, _ADOBE_RGB), "srgb_displayp3": (0.0, _DISPLAY_P3),
    "srgb_p3d65_scene": (0.0, _DISPLAY_P3), "lin_displayp3": (1.0, _DISPLAY_P3), "lin_p3d65_scene": (1.0, _DISPLAY_P3),
    "lin_rec2020_scene": (1.0, _REC2020),
}  # fmt: skip
# What a node that is not evaluated counts as, and the effect.
_MIDDLE, _NO_PATTERN = 0.5, "its pattern is not shown: the middle of its values counts everywhere"
_IN_UNIT_SQUARE = "in the unit square of texture coordinates; beyond it goes on as at its edges"
_CENTRED = frozenset({"noise2d", "noise3d", "fractal2d", "fractal3d"})
_PLACES = frozenset({"Pobject", "Pworld"})
_UP = {"normal": (0.0, 0.0, 1.0), "tangent": (1.0, 0.0, 0.0), "bitangent": (0.0, 1.0, 0.0)}


class ImageValues(NamedTuple):
    """The values of an image as the file has them, decoded by nothing, (H, W, 1 to 4), row 0 on top; is_float: whether
    they are numbers of OpenEXR, which are linear."""

    texels: Array
    is_float: bool = False


class ImageSource(Protocol):
    """Images by the names that stand in a network; each method raises LoadError."""

    def size(self, name: str) -> tuple[int, int]:
        """(width, height), from the header; raises LoadError for what cannot be read."""

    def values(self, name: str) -> ImageValues:
        """The image."""

    def file(self, name: str) -> str:
        """Its name in layers; "" where it is in no file of its own."""


class NodeFields:
    """Fields of the nodes of one network. positions: places in object space, for a mesh whose texture coordinates are
    in the unit square; None for meshes that are not known. unshown: what was not evaluated."""

    def __init__(self, images: ImageSource, positions: Field | None = None) -> None:
        self._images, self._positions = images, positions
        self._texels = lru_cache(maxsize=_MOST_IMAGES)(self._read_texels)
        self._known: dict[tuple[int, str], Field] = {}
        self._listed: dict[tuple[str, str], set[int]] = {}
        self._n_octaves = 0

    @property
    def unshown(self) -> tuple[UnshownProperty, ...]:
        """What was not evaluated, with the number of nodes."""
        return tuple(UnshownProperty(name, len(where), effect) for (name, effect), where in self._listed.items())

    def of_input(self, given: ShaderInput, kind: str = "") -> Field:
        """The field of an input, with as many channels as its type has, or another."""
        n = N_CHANNELS.get(kind or given.kind, 1)
        found, have = self._given(given)
        return found if have == n else combine(partial(_with_channels, n=n), found)

    def _given(self, given: ShaderInput) -> tuple[Field, int]:
        """The field of an input, and the number of its channels."""
        if given.node is not None:
            return self.of_node(given.node, given.output), _n_channels(given.node)
        if given.geometry in _UV_NAMES and given.geometry:
            return COORDINATES, 2
        if isinstance(given.value, tuple):
            values = _linear(np.array([given.value], np.float32), given.space, given.kind)
            return constant(*values[0].tolist()), len(given.value)
        if given.geometry[:1] in ("N", "T"):  # Nworld, Tobject
            return constant(*_UP["normal" if given.geometry[0] == "N" else "tangent"]), 3
        if given.geometry in _PLACES:
            if self._positions is not None:
                return self._positions, 3
            self._listed.setdefault((f"nodes.{given.geometry}", "counts as the middle of the object"), set()).add(
                id(given)
            )
            return constant(0.0, 0.0, 0.0), 3
        return constant(0.0), 1

    def of_node(self, node: ShaderNode, output: str = "out") -> Field:
        """The field of a node's output."""
        key = id(node), output
        if key not in self._known:
            self._known[key] = self._read(node, output)
        return self._known[key]

    def _read(self, node: ShaderNode, output: str) -> Field:
        category = node.category
        if category in _ONE_INPUT and "in" not in node.inputs:
            return self._middle(node)
        if category == "image":
            return self._image(node)
        if category == "hextiledimage" and "tiling" in node.inputs:
            self._list(node, category, "its tiles repeat without turns and offsets")
            return self._image(node, self.of_input(node.inputs["tiling"], "vector2"))
        if category in _COORDINATES:
            return self._coordinates(node)
        if category == "convert":
            n = N_CHANNELS.get(node.kind, 1)
            return combine(partial(_converted, n=n), self.of_input(node.inputs["in"]))
        if category in _SEPARATED:
            k = max("rgba".find(output[-1:]), "xyzw".find(output[-1:]), 0)
            whole = self.of_input(node.inputs["in"])
            found = combine(lambda values: values[:, min(k, values.shape[1] - 1)][:, None], whole)
            return found if whole.plain is None else _channel(found, whole.plain, k)
        if category in PATTERNS and all(name in node.inputs for name in PATTERNS[category]):
            return self._pattern(node)
        if category == "position" and self._positions is not None:
            return self._positions
        if category == "heighttonormal" and {"in", "scale", "texcoord"} <= node.inputs.keys():
            return normals_of_heights(*(self.of_input(node.inputs[name]) for name in ("in", "scale", "texcoord")))
        if category == "blur":
            self._list(node, category, "the image is as sharp as its file")
            return self.of_input(node.inputs["in"], node.kind)
        names = operation_inputs(category, tuple(node.inputs)) if category in OPERATIONS else ()
        if category == "switch" and len(names) > 1 and (which := self.of_input(node.inputs["which"])).is_constant:
            k = min(max(int(which.value[0]), 0), len(names) - 2)
            return self.of_input(node.inputs[names[1 + k]], node.kind)
        if not names or names == ("which",) or any(name not in node.inputs for name in names):
            return self._middle(node)
        operation = partial(apply_operation, category, names)
        n = N_CHANNELS.get(node.kind, 1)
        try:
            tried = operation(*(np.zeros((1, N_CHANNELS.get(node.inputs[name].kind, 1)), np.float32) for name in names))
        except (ValueError, IndexError):  # inputs of other types than the node has
            return self._middle(node)
        fields = [self.of_input(node.inputs[name]) for name in names]
        found = combine(operation, *fields)
        if tried.shape[1] != n:
            found = combine(partial(_with_channels, n=n), found)
        if category in ("dot", "constant") and tried.shape[1] == n:
            return fields[0]
        if category == "extract" and fields[0].plain is not None and fields[1].is_constant:
            return _channel(found, fields[0].plain, int(fields[1].value[0]))
        return found

    def _pattern(self, node: ShaderNode) -> Field:
        """Noise or cells at coordinates; the middle of its values at places that are not known."""
        names, n = PATTERNS[node.category], N_CHANNELS.get(node.kind, 1)
        place = node.inputs[names[0]]
        if self._positions is None and place.node is None and place.geometry in _PLACES:
            return self._middle(node)
        inputs = [self.of_input(node.inputs[name]) for name in names]
        if names[0] == "position" and self._positions is None and inputs[0].is_constant:
            return self._middle(node)
        octaves = int(np.clip(inputs[names.index("octaves")].value[0], 0, 1 << 30)) if "octaves" in names else 1
        if octaves > MOST_OCTAVES:
            self._list(node, f"{node.category}.octaves", f"those after {MOST_OCTAVES} are left out")
        # Worley's distances are to points of 9 cells or of 27.
        self._n_octaves += min(octaves, MOST_OCTAVES) * (9 if node.category.startswith("worley") else 1)
        if self._n_octaves > _MOST_NOISE:
            return self._middle(node)
        if self._positions is None and not inputs[0].is_constant:
            self._list(node, node.category, _IN_UNIT_SQUARE)
        return combine(partial(pattern, node.category, n), *inputs)

    def _middle(self, node: ShaderNode) -> Field:
        """What a node counts as that is not evaluated."""
        n = _n_channels(node)
        if node.category in _UP:
            self._list(node, node.category, "counts as in the surface's own frame")
            return combine(partial(_with_channels, n=n), constant(*_UP[node.category]))
        self._list(node, node.category, _NO_PATTERN)
        if node.category in _CENTRED:
            pivot = node.inputs.get("pivot")
            value = 0.0 if pivot is None or not isinstance(pivot.value, tuple) else pivot.value[0]
            return constant(*(value,) * n)
        return constant(*(_MIDDLE,) * n)

    def _coordinates(self, node: ShaderNode) -> Field:
        """Texture coordinates; of other properties of the geometry the default."""
        name = next((node.inputs[key].text for key in ("geomprop", "varname") if key in node.inputs), "")
        index = node.inputs.get("index")
        is_first = index is None or not isinstance(index.value, tuple) or index.value[0] == 0.0
        if node.kind == "vector2" and is_first:
            if name not in _UV_NAMES:
                self._list(node, f"geomprop {printable_name(name, 40)}", "the mesh's first texture coordinates count")
            return COORDINATES
        if node.kind == "vector2":
            self._list(node, "texcoord.index", "the mesh's first texture coordinates count")
            return COORDINATES
        self._list(node, f"{node.category} {printable_name(name, 40)}".strip(), "its default counts everywhere")
        for key in ("default", "fallback"):
            if key in node.inputs:
                return self.of_input(node.inputs[key], node.kind)
        return constant(*(0.0,) * N_CHANNELS.get(node.kind, 1))

    def _image(self, node: ShaderNode, tiling: Field | None = None) -> Field:
        """An image in linear Rec. 709, so often along u and v; its default where it cannot be read."""
        n = N_CHANNELS.get(node.kind, 1)
        default = constant(*(0.0,) * n)
        if "default" in node.inputs:
            default = self.of_input(node.inputs["default"], node.kind)
        file = node.inputs.get("file")
        name = "" if file is None else file.text
        if file is None or not name:
            return default
        tile = _first_tile(name)
        try:
            size = self._images.size(tile)
        except LoadError as error:
            self._list(node, f"image {printable_name(name, 80)}", f"not shown: {error.reason}")
            return default
        if tile != name:
            self._list(node, f"image {printable_name(name, 80)}", "of its tiles the first is shown")
        self._check_space(node, file.space)
        coordinates = COORDINATES
        if "texcoord" in node.inputs:
            coordinates = self.of_input(node.inputs["texcoord"], "vector2")
        if tiling is not None:
            coordinates = combine(lambda uv, repeats: uv * repeats, coordinates, tiling)
        use = ImageUse(size, (self._mode(node, "uaddressmode"), self._mode(node, "vaddressmode")), coordinates)
        texels = partial(self._texels, tile, file.space, node.kind)
        return image_field(use, texels, default.value, self._plain(tile, file.space, node.kind))

    def _plain(self, name: str, space: str, kind: str) -> PlainImage | None:
        """The image as layers can have it."""
        file = self._images.file(name)
        if not file or kind not in ("color3", "float", "vector3"):
            return None
        if kind != "color3":
            return PlainImage(file, channel="r" if kind == "float" else "")
        exponent, primaries = _SPACES.get(space, _SPACES[""])
        if exponent not in (0.0, 1.0) or primaries != REC709:
            return None
        return PlainImage(file, "srgb" if exponent == 0.0 and not file.lower().endswith(".exr") else "linear")

    def _read_texels(self, name: str, space: str, kind: str) -> Array:
        """An image in linear Rec. 709, reduced to at most `MOST_TEXELS`."""
        found = self._images.values(name)
        space = "lin_rec709" if found.is_float and space == "srgb_texture" else space
        texels = _with_channels(_linear(found.texels, space, kind), N_CHANNELS.get(kind, 1))
        k = reduction(texels.shape[1], texels.shape[0], MOST_TEXELS)
        return texels if k == 1 else block_means(texels, k, lambda values: np.asarray(values, np.float32))

    def _check_space(self, node: ShaderNode, space: str) -> None:
        if space not in _SPACES and node.kind in ("color3", "color4"):
            self._list(node, f"colorspace {printable_name(space, 40)}", "taken as linear Rec. 709")

    def _mode(self, node: ShaderNode, key: str) -> AddressMode:
        given = node.inputs.get(key)
        return _MODES.get("" if given is None else given.text, "periodic")

    def _list(self, node: ShaderNode, name: str, effect: str) -> None:
        self._listed.setdefault((f"nodes.{name}", effect), set()).add(id(node))


def _n_channels(node: ShaderNode) -> int:
    """The number of channels of a node's outputs."""
    return 1 if node.category in _SEPARATED else N_CHANNELS.get(node.kind, 1)


def _linear(values: Array, space: str, kind: str) -> Array:
    """Colours (..., C) as linear Rec. 709; others are as they are."""
    if kind not in ("color3", "color4") or values.shape[-1] == 2:
        return values
    exponent, primaries = _SPACES.get(space, _SPACES[""])
    colours, alpha = values[..., :3], values[..., 3:]
    if exponent == 0.0:
        colours = decode_srgb(colours)
    elif exponent != 1.0:
        colours = np.maximum(colours, 0.0) ** np.float32(exponent)
    matrix = to_rec709(primaries)
    if matrix is not None and colours.shape[-1] == 3:
        colours = np.maximum(colours @ matrix.T.astype(np.float32), 0.0)
    return np.concatenate([colours, alpha], axis=-1) if alpha.shape[-1] else colours


def _converted(values: Array, n: int) -> Array:
    """Values with another number of channels: one counts for all, further ones are cut off, alpha is 1."""
    if values.shape[1] == 1:
        return np.concatenate(
            [np.repeat(values, min(n, 3), axis=1), np.ones((len(values), max(n - 3, 0)), np.float32)], axis=1
        )
    return _with_channels(values, n)


def _with_channels(values: Array, n: int) -> Array:
    """Values (..., C) with n channels: grey repeated, alpha 1, others 0 where there are none."""
    have = values.shape[-1]
    if have in (1, 2) and n >= 3:  # grey, with alpha
        values = np.concatenate([np.repeat(values[..., :1], 3, axis=-1), values[..., 1:]], axis=-1)
        have = values.shape[-1]
    if have >= n:
        return values[..., :n]
    filled = [values, np.zeros((*values.shape[:-1], max(min(n, 3) - have, 0)), np.float32)]
    return np.concatenate([*filled, np.ones((*values.shape[:-1], n - max(have, min(n, 3))), np.float32)], axis=-1)


def _channel(field: Field, image: PlainImage, k: int) -> Field:
    """The field of one channel of an image."""
    if image.channel or image.space != "linear" or not 0 <= k < 3:
        return field
    return replace(field, plain=PlainImage(image.file, "linear", cast(Literal["r", "g", "b"], "rgb"[k])))


def _first_tile(name: str) -> str:
    """The file of the first tile of an image in several."""
    return name.replace("<UDIM>", "1001").replace("<UVTILE>", "u1_v1")
