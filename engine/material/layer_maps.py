"""The images of a layer: a texture that multiplies it, and a weight map that blends it with others.

Both multiply the layer's radiance pixel by pixel, as f_q and f_o do, by

    factor(u, v) = (1 - s + s t(s_u u, s_v v)) w(u, v),     w = 1 - map if it is inverted,

where t is the texture's linear RGB, s its strength and (s_u, s_v) its repeats, after which it may be rotated and moved
and, beyond its edges, repeat, be mirrored, or continue its edge [docs/guides/materials.md]. The mesh's vertex colours
multiply t where the layer says so [glTF20, 3.9.2]. The map is an image or uniform, with the strokes that the user
painted on it (`engine.material.strokes`). No transport depends on it: the images are sampled once for each pixel, and
only the few numbers here change during a drag. For further bounces the factor's mean over the surface multiplies the
layer's albedo, and its mean over a part of the surface that of the irradiance cache record.

A layer may have further weight maps, each in a mapping of its own; they multiply the texture texel by texel. A node,
one of several layers that stand for a layer with a parameter that varies over the surface
(`engine.material.parameter_nodes`), has one more for each such parameter: a function of one channel of an image. Texels
are mapped to weights before they are filtered, because the blend is linear in weights and in nothing else.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from engine.material.parameters import Parameter
from engine.material.strokes import Strokes

Space = Literal["", "srgb", "linear"]
SPACES: tuple[Space, ...] = ("", "srgb", "linear")
Wrap = Literal["repeat", "mirror", "clamp"]
WRAPS: tuple[Wrap, ...] = get_args(Wrap)
Channel = Literal["grey", "r", "g", "b", "a", "max"]
CHANNELS: tuple[Channel, ...] = get_args(Channel)
MAX_REPEATS, LEAST_REPEATS = 1000.0, 1e-3
# Sets of texture coordinates that a mesh has at most: what glTF asks of every program [glTF20, 3.7.2.1].
MAX_UV_SETS = 2
_OF_SEVERAL = (".glb", ".gltf", ".3mf", ".mtlx", ".usd", ".usda", ".usdc", ".usdz")  # files that contain images
TEXTURE_STRENGTH = Parameter(
    "texture_strength", "scalar", 1.0, "Strength", "Strength of the texture: 1 is all of it, 0 the plain layer."
)
TEXTURE_SCALE = Parameter(
    "texture_scale",
    "pair",
    (1.0, 1.0),
    "Repeats",
    "How often the texture repeats along u, across, and v, upwards; below 0 it is mirrored.",
    minimum=-MAX_REPEATS,
    maximum=MAX_REPEATS,
    least=LEAST_REPEATS,
)
TEXTURE_SPACE = Parameter(
    "texture_space",
    "choice",
    "",
    "Colour space",
    "Colour space of the file: sRGB is meant for a screen, linear is proportional to reflectance. Auto: as files of "
    "this kind usually are, sRGB with 8 bits per channel, else linear.",
    choices=SPACES,
    titles=("Auto", "sRGB", "Linear"),
)
WEIGHT_CHANNEL = Parameter(
    "weight_channel",
    "choice",
    "grey",
    "Channel",
    "The channel of the image that says how much of the layer there is: its brightness, one of its colours, its "
    "opacity, or the largest of its colours, decoded as a texture's.",
    choices=CHANNELS,
    titles=("Grey", "Red", "Green", "Blue", "Alpha", "Largest"),
)
WEIGHT_START = Parameter("weight_start", "scalar", 1.0, "Start", "The share of the layer where nothing is painted.")


def split_image_name(name: str) -> tuple[str, str | None]:
    """The file of an image, and its number in a file of several: ("a.glb", "2") for "a.glb#2"."""
    file, mark, number = name.rpartition("#")
    return (file, number) if mark and file.lower().endswith(_OF_SEVERAL) else (name, None)


class TextureTransform(NamedTuple):
    """The mapping of coordinates to an image, after the multiplication by repeats: rotation, degrees, counter-clockwise
    about (0, 0); offset along u and v, in images; wrap: the continuation beyond the edges, along u and v; uv_set: which
    of the mesh's sets of texture coordinates these are, the first where it has no other."""

    rotation: float = 0.0
    offset: tuple[float, float] = (0.0, 0.0)
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    uv_set: int = 0

    @property
    def turn(self) -> tuple[float, float]:
        """Cosine and sine of the rotation, exact for multiples of 90°."""
        quarters = {0.0: (1.0, 0.0), 90.0: (0.0, 1.0), 180.0: (-1.0, 0.0), 270.0: (0.0, -1.0)}
        angle = math.radians(self.rotation)
        return quarters.get(self.rotation % 360.0) or (math.cos(angle), math.sin(angle))


IDENTITY_TRANSFORM = TextureTransform()


@dataclass(frozen=True)
class ChannelImage:
    """One channel of an image, read as that of a weight map, and its mapping to a surface. file: as in `LayerMaps`;
    repeats: along u and v, before the transform."""

    file: str
    channel: Channel = "grey"
    repeats: tuple[float, float] = (1.0, 1.0)
    transform: TextureTransform = IDENTITY_TRANSFORM

    @property
    def mapping(self) -> tuple[tuple[float, float], TextureTransform]:
        return self.repeats, self.transform


@dataclass(frozen=True)
class ChannelWeight:
    """A weight for each texel of an image: piecewise linear in its channel, and constant beyond the first and the last
    of the `knots`, which ascend. weights: at the knots, possibly below 0; hats: other weights, never below 0, which
    reflect as much in all; they serve further bounces."""

    image: ChannelImage
    knots: tuple[float, ...]
    weights: tuple[float, ...]
    hats: tuple[float, ...]


@dataclass(frozen=True)
class FurtherWeight:
    """A weight map besides the one that is painted, with a mapping of its own; invert: one minus it counts."""

    image: ChannelImage
    invert: bool = False

    @property
    def weight(self) -> ChannelWeight:
        ends = (1.0, 0.0) if self.invert else (0.0, 1.0)
        return ChannelWeight(self.image, (0.0, 1.0), ends, ends)


@dataclass(frozen=True)
class NodeImages:
    """The part of a node's images that other layers do not have: its weights, the product of which counts; and of its
    texture strength and mapping, which are in the samples."""

    weights: tuple[ChannelWeight, ...]
    strength: float = 1.0
    texture_mapping: tuple[tuple[float, float], TextureTransform] = ((1.0, 1.0), IDENTITY_TRANSFORM)
    uses_hats: bool = False


@dataclass(frozen=True)
class LayerMaps:
    """The images of one layer. Names are files: relative to the scene's folder, or full paths that the user chose.

    texture: empty for none. texture_space: its colour space; empty: sRGB for 8 bits, else linear. texture_scale: how
    often it repeats along u and v; texture_strength: 0 has no effect. vertex_colours: whether colours of the mesh's
    vertices multiply the texture, or are it where there is none. weight: an image whose `weight_channel` is the share
    of the layer, linear except for "max"; empty for none. weight_invert: one minus that share. weight_start: the share
    if there is no such image. strokes: painted on either, and inverted with it, so that inversion needs no new samples.
    texture_offset, texture_rotation, texture_wrap, texture_uv_set: see `TextureTransform`. further_weights: maps that
    multiply the layer as well; node_weights: of a node, never in a file. Both are sampled together with the texture at
    its strength, so that `factor` and shaders know only of a texture.
    """

    texture: str = ""
    texture_space: Space = ""
    texture_scale: tuple[float, float] = (1.0, 1.0)
    texture_strength: float = 1.0
    weight: str = ""
    weight_invert: bool = False
    weight_start: float = 1.0
    strokes: Strokes = Strokes()
    texture_offset: tuple[float, float] = (0.0, 0.0)
    texture_rotation: float = 0.0
    texture_wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    vertex_colours: bool = False
    weight_channel: Channel = "grey"
    further_weights: tuple[FurtherWeight, ...] = ()
    texture_uv_set: int = 0
    node_weights: tuple[ChannelWeight, ...] = ()

    @property
    def is_plain(self) -> bool:
        """Whether nothing multiplies the layer."""
        return not (self.is_tinted or self.has_weight or self.sampled_weights)

    @property
    def sampled_weights(self) -> tuple[ChannelWeight, ...]:
        """The weights that are sampled together with the texture."""
        return (*(each.weight for each in self.further_weights), *self.node_weights)

    @property
    def is_tinted(self) -> bool:
        """Whether there are colours that multiply the layer: a texture, or those of vertices."""
        return bool(self.texture or self.vertex_colours)

    @property
    def has_weight(self) -> bool:
        """Whether there is a weight map: an image, strokes, or a uniform share other than 1."""
        return bool(self.weight or self.strokes or self.weight_start != 1.0)

    @property
    def is_of_files(self) -> bool:
        """Whether there is an image, which needs texture coordinates."""
        return bool(self.texture or self.weight or self.sampled_weights)

    @property
    def sampled_strength(self) -> float:
        """The strength with which samples of the texture count: those with further weights include it."""
        return 1.0 if self.sampled_weights else self.texture_strength

    @property
    def inverts(self) -> bool:
        """Whether one minus the weight counts; without a map there is nothing to invert."""
        return self.weight_invert and self.has_weight

    @property
    def images(self) -> Images:
        """The part that determines samples: maps with equal images differ in numbers alone."""
        start = 1.0 if self.weight else self.weight_start
        channel = self.weight_channel if self.weight else "grey"
        images = Images(
            weight=self.weight, weight_channel=channel, weight_start=start, strokes=self.strokes,
            vertex_colours=self.vertex_colours,
        )  # fmt: skip
        if self.texture:
            transform = TextureTransform(
                self.texture_rotation, self.texture_offset, self.texture_wrap, self.texture_uv_set
            )
            own = {name: getattr(self, name) for name in ("texture", "texture_space", "texture_scale")}
            images = dataclasses.replace(images, texture_transform=transform, **own)
        weights = self.sampled_weights
        return images.with_node(weights, self.texture_strength) if weights else images

    def with_node_weight(self, weight: ChannelWeight) -> LayerMaps:
        """The maps of a node with one more weight."""
        return dataclasses.replace(self, node_weights=(*self.node_weights, weight))

    def with_files(self, renamed: Callable[[str], str]) -> LayerMaps:
        """The maps with other names of their images."""
        texture, weight = (name and renamed(name) for name in (self.texture, self.weight))
        further = tuple(
            dataclasses.replace(each, image=dataclasses.replace(each.image, file=renamed(each.image.file)))
            for each in self.further_weights
        )
        return dataclasses.replace(self, texture=texture, weight=weight, further_weights=further)

    @property
    def files(self) -> tuple[tuple[str, str], ...]:
        """What each image is, and its name."""
        named = [("texture", self.texture), ("weight", self.weight)]
        named += [("further_weights", each.image.file) for each in self.further_weights]
        return tuple((what, name) for what, name in named if name)

    def factor(self, texture: NDArray[np.floating], weight: NDArray[np.floating]) -> NDArray[np.floating]:
        """The factor (N, 3) for texels (N, 3) and weights (N,)."""
        tinted = 1.0 + self.sampled_strength * (texture - 1.0)
        return np.asarray(tinted * (1.0 - weight if self.inverts else weight)[..., None])


@dataclass(frozen=True)
class Images:
    """The part of `LayerMaps` that samples depend on."""

    texture: str = ""
    texture_space: Space = ""
    texture_scale: tuple[float, float] = (1.0, 1.0)
    weight: str = ""
    weight_start: float = 1.0
    strokes: Strokes = Strokes()
    texture_transform: TextureTransform = IDENTITY_TRANSFORM
    vertex_colours: bool = False
    weight_channel: Channel = "grey"
    node: NodeImages | None = None

    @property
    def is_of_files(self) -> bool:
        """Whether there is an image, which needs texture coordinates."""
        return bool(self.texture or self.weight or self.node)

    def with_node(self, weights: tuple[ChannelWeight, ...], strength: float) -> Images:
        """The images with a node's weights, in the mapping that they share with the texture; where mappings differ,
        with none: then all are resampled in texture coordinates, see `textures`."""
        own = self.texture_scale, self.texture_transform
        mappings = {each.image.mapping for each in weights} | ({own} if self.texture else set())
        uv_set = min((transform.uv_set for _, transform in mappings), default=0)
        plain = (1.0, 1.0), TextureTransform(uv_set=uv_set)
        scale, transform = mappings.pop() if len(mappings) == 1 else plain
        node = NodeImages(weights, strength, own)
        return dataclasses.replace(self, texture_scale=scale, texture_transform=transform, node=node)

    @property
    def textures(self) -> tuple[Images, ...]:
        """The images whose textures, multiplied, are the texture: these, or, where a node's images lie in several sets
        of texture coordinates, so that no grid of texels is theirs, those of each set."""
        if self.node is None:
            return (self,) if self.texture else ()
        plain = dataclasses.replace(self.without_node, texture="", texture_scale=(1.0, 1.0))
        in_sets = {self.node.texture_mapping[1].uv_set: self.without_node} if self.texture else {}
        weights: dict[int, tuple[ChannelWeight, ...]] = {}
        for each in self.node.weights:
            uv_set = each.image.transform.uv_set
            weights[uv_set] = (*weights.get(uv_set, ()), each)
        sets = sorted(in_sets.keys() | weights.keys())
        if len(sets) == 1:
            return (self,)
        made = [in_sets.get(k, plain).with_node(weights.get(k, ()), self.node.strength) for k in sets]
        return tuple(each.for_bounces if self.node.uses_hats else each for each in made)

    @property
    def without_node(self) -> Images:
        """The layer's own images."""
        if self.node is None:
            return self
        scale, transform = self.node.texture_mapping
        return dataclasses.replace(self, texture_scale=scale, texture_transform=transform, node=None)

    @property
    def for_bounces(self) -> Images:
        """The images for all but the camera: of a node with weights that are never below 0, as albedos are not."""
        if self.node is None:
            return self
        return dataclasses.replace(self, node=dataclasses.replace(self.node, uses_hats=True))

    @property
    def has_weight(self) -> bool:
        """Whether there is a weight map."""
        return bool(self.weight or self.strokes or self.weight_start != 1.0)

    @property
    def without_strokes(self) -> Images:
        """The images below the strokes."""
        return dataclasses.replace(self, strokes=Strokes())


@dataclass(frozen=True)
class MapMeans:
    """Means over a surface: of the texture, of the weight map, of their product (RGB each, the weight grey)."""

    texture: tuple[float, float, float] = (1.0, 1.0, 1.0)
    weight: float = 1.0
    both: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def factor(self, maps: LayerMaps) -> NDArray[np.float64]:
        """The mean of the factor, (3,)."""
        return factor_of_means(maps, np.asarray(self.texture), np.asarray(self.weight), np.asarray(self.both))


def factor_of_means(
    maps: LayerMaps, texture: NDArray[np.floating], weight: NDArray[np.floating], both: NDArray[np.floating]
) -> NDArray[np.float64]:
    """The mean of the factor (..., 3) from means of the texture (..., 3), the weight map (...) and their product."""
    if maps.inverts:
        weight, both = 1.0 - weight, texture - both
    strength = maps.sampled_strength
    return np.asarray((1.0 - strength) * weight[..., None] + strength * both, np.float64)
