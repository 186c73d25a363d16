"""The texture of a node: texels times weights of texels, on one grid.

Texel by texel, because the mean of a product over a pixel is not the product of means: where a metal is rough, its
colour may be another. Images in one mapping are multiplied in it, at the size of the largest. Others are resampled over
the unit square of texture coordinates, which repeats: exact where each image does so as well, a whole number of times.
All are of one set of texture coordinates: those of another are a texture of their own (`Images.textures`).

Between texels it is the images that are interpolated, as at each hit of a path, and not what nodes reflect: where one
texel is rough and the next is not, the roughness between is one of a third node. So small images are weighted on a grid
that is up to four times finer, but has no more texels than one image of 1024 x 1024. A brushed metal whose streaks vary
by tiles of 5 to 10 pixels is 1.2 % off under a lamp, 2.9 on a grid of twice the size, 3.7 on the image's own
(`benchmarks/gltf_materials.py`, 48 x 48).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engine.material.layer_maps import IDENTITY_TRANSFORM, Images, Wrap
from engine.texture.pyramid import Pyramid, make_pyramid

Float32Array = NDArray[np.float32]
_MOST_TEXELS = 1 << 24
_MOST_FINER, _MOST_FINER_TEXELS = 4, 1 << 20


def blend_node_images(images: Images, texture: Pyramid | None, numbers: Sequence[Pyramid]) -> Pyramid:
    """The texture of a node times its weights, (H, W, 3) at the finest level. texture: the layer's own; numbers: the
    channel of each weight."""
    node = images.node
    assert node is not None
    sources = [*([texture] if texture else []), *numbers]
    mappings = [*([node.texture_mapping] if texture else []), *(each.image.mapping for each in node.weights)]
    shares_mapping = len(set(mappings)) == 1
    scales = [(1.0, 1.0) if shares_mapping else scale for scale, _ in mappings]
    width, height = (
        max(round(each.size[axis] * max(abs(scale[axis]), 1.0)) for each, scale in zip(sources, scales, strict=True))
        for axis in (0, 1)
    )
    finer = int(np.clip(np.sqrt(_MOST_FINER_TEXELS / (width * height)), 1, _MOST_FINER))
    shrink = max(np.sqrt(width * height / _MOST_TEXELS), 1.0)
    size = max(int(finer * width / shrink), 1), max(int(finer * height / shrink), 1)
    if shares_mapping:
        texels = [_resized(each.levels[0], size, mappings[0][1].wrap) for each in sources]
    else:
        placed = [each.with_transform(own) for each, (_, own) in zip(sources, mappings, strict=True)]
        texels = [_resampled(each, scale, size) for each, scale in zip(placed, scales, strict=True)]
    blended = np.ones((size[1], size[0], 3), np.float32)
    if texture:
        blended += np.float32(node.strength) * (texels.pop(0) - np.float32(1.0))
    for weight, image in zip(node.weights, texels, strict=True):
        curve = weight.hats if node.uses_hats else weight.weights
        blended *= np.interp(image, weight.knots, curve).astype(np.float32)
    return make_pyramid(blended).with_transform(images.texture_transform)


def _resized(image: Float32Array, size: tuple[int, int], wraps: tuple[Wrap, Wrap]) -> Float32Array:
    """An image (H, W, C) of another size (width, height), linear between texels."""
    for axis, n, wrap in ((0, size[1], wraps[1]), (1, size[0], wraps[0])):
        n_texels = image.shape[axis]
        if n == n_texels:
            continue
        place = (np.arange(n) + 0.5) * n_texels / n - 0.5
        before = np.floor(place).astype(int)
        share = np.expand_dims((place - before).astype(np.float32), (1, 2) if axis == 0 else (0, 2))
        near = np.stack([before, before + 1])
        near = (
            near % n_texels if wrap == "repeat" else near.clip(0, n_texels - 1)
        )  # a mirrored image has its edge twice
        first, second = (image.take(at, axis) for at in near)
        image = first + share * (second - first)
    return image


def _resampled(image: Pyramid, scale: tuple[float, float], size: tuple[int, int]) -> Float32Array:
    """The image (H, W, C) over the unit square, of this size (width, height), repeated by the scale."""
    if image.size == size and scale == (1.0, 1.0) and image.transform == IDENTITY_TRANSFORM:
        return image.levels[0]
    u = (np.arange(size[0]) + 0.5) / size[0] * scale[0]
    v = (1.0 - (np.arange(size[1]) + 0.5) / size[1]) * scale[1]
    return image.at(np.stack(np.meshgrid(u, v), axis=2).reshape(-1, 2)).reshape(size[1], size[0], -1)
