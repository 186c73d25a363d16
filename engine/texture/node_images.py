"""The texture of a node: texels times weights of texels, on one grid.

Texel by texel, because the mean of a product over a pixel is not the product of means: where a metal is rough, its
colour may be another. Images in one mapping are multiplied in it, at the size of the largest. Others are resampled over
the unit square of texture coordinates, which repeats: exact where each image does so as well, a whole number of times.
All are of one set of texture coordinates: those of another are a texture of their own (`Images.textures`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from engine.material.layer_maps import IDENTITY_TRANSFORM, Images
from engine.texture.pyramid import Pyramid, make_pyramid

Float32Array = NDArray[np.float32]
_MOST_TEXELS = 1 << 24


def blend_node_images(images: Images, texture: Pyramid | None, numbers: Sequence[Pyramid]) -> Pyramid:
    """The texture of a node times its weights, (H, W, 3) at the finest level. texture: the layer's own; numbers: the
    channel of each weight."""
    node = images.node
    assert node is not None
    sources = [*([texture] if texture else []), *numbers]
    mappings = [*([node.texture_mapping] if texture else []), *(each.image.mapping for each in node.weights)]
    shares_mapping = len(set(mappings)) == 1
    if shares_mapping:
        sources = [each.with_transform(IDENTITY_TRANSFORM) for each in sources]
        scales = [(1.0, 1.0)] * len(sources)
    else:
        sources = [each.with_transform(own) for each, (_, own) in zip(sources, mappings, strict=True)]
        scales = [scale for scale, _ in mappings]
    width, height = (
        max(round(each.size[axis] * max(abs(scale[axis]), 1.0)) for each, scale in zip(sources, scales, strict=True))
        for axis in (0, 1)
    )
    shrink = max(np.sqrt(width * height / _MOST_TEXELS), 1.0)
    size = max(int(width / shrink), 1), max(int(height / shrink), 1)
    texels = [_resampled(each, scale, size) for each, scale in zip(sources, scales, strict=True)]
    blended = np.ones((size[1], size[0], 3), np.float32)
    if texture:
        blended += np.float32(node.strength) * (texels.pop(0) - np.float32(1.0))
    for weight, image in zip(node.weights, texels, strict=True):
        curve = weight.hats if node.uses_hats else weight.weights
        blended *= np.interp(image, weight.knots, curve).astype(np.float32)
    return make_pyramid(blended).with_transform(images.texture_transform)


def _resampled(image: Pyramid, scale: tuple[float, float], size: tuple[int, int]) -> Float32Array:
    """The image (H, W, C) over the unit square, of this size (width, height), repeated by the scale."""
    if image.size == size and scale == (1.0, 1.0) and image.transform == IDENTITY_TRANSFORM:
        return image.levels[0]
    u = (np.arange(size[0]) + 0.5) / size[0] * scale[0]
    v = (1.0 - (np.arange(size[1]) + 0.5) / size[1]) * scale[1]
    return image.at(np.stack(np.meshgrid(u, v), axis=2).reshape(-1, 2)).reshape(size[1], size[0], -1)
