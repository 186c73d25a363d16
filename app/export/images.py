"""What multiplies layers point by point, for Mitsuba 3: the images of textures, of weight maps and of nodes of
parameters that vary over the surface, in their mappings; and the image of an object's opacity."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from engine.material.layer_maps import IDENTITY_TRANSFORM, LayerMaps, TextureTransform
from engine.material.opacity import Opacity
from engine.scene.scene_loader import Scene
from engine.texture.pyramid import Pyramid

Float64Array = NDArray[np.float64]
# A mask's edge is interpolated between texels before the cutoff: its image is written so much finer, up to a size.
FINER, MOST_TEXELS = 4, 1 << 22


@dataclass(frozen=True, eq=False)
class FactorImage:
    """An image (H, W, 3), row 0 on top; matrix (2, 3): of texture coordinates (u, v, 1) to places in it, v upwards;
    wrap: 0 repeats, 1 mirrors, 2 extends its edge, along u and v."""

    texels: NDArray[np.float32]
    matrix: Float64Array
    wrap: tuple[int, int]


def factor_images(scene: Scene, maps: LayerMaps) -> list[FactorImage]:
    """The images whose product, times vertex colours where they count, is the factor of a layer's maps without
    strokes."""
    images, found = maps.images.without_strokes, list[FactorImage]()
    for each in images.textures:
        if (texture := scene.textures.texture(each)) is not None:
            texels = 1.0 + np.float32(maps.sampled_strength) * (texture.levels[0] - np.float32(1.0))
            found.append(_placed(texels, each.texture_scale, texture.transform))
    weight = scene.textures.weight(images)
    if weight is not None:
        shares = 1.0 - weight.levels[0] if maps.inverts else weight.levels[0]
        found.append(_placed(shares.repeat(3, axis=2), (1.0, 1.0), IDENTITY_TRANSFORM))
    elif maps.has_weight:
        share = 1.0 - maps.weight_start if maps.inverts else maps.weight_start
        found.append(_placed(np.full((1, 1, 3), share, np.float32), (1.0, 1.0), IDENTITY_TRANSFORM))
    return found


def add_opacity(mask: Element, opacity: Opacity, image: Pyramid | None, file: str) -> NDArray[np.float32] | None:
    """Give a `mask` of Mitsuba the opacity of an object, without that of vertices; returns the image (H, W, 3) that
    belongs to the file's name, if there is one. Of a masked surface all is there or nothing."""
    if image is None:
        SubElement(mask, "float", name="opacity", value=f"{opacity.opacity_factor:.9g}")
        return None
    width, height = image.size
    finer = FINER if opacity.opacity_mode == "mask" and FINER**2 * width * height <= MOST_TEXELS else 1
    u, v = ((np.arange(finer * n) + 0.5) / (finer * n) for n in (width, height))
    places = np.stack(np.meshgrid(u, 1.0 - v), axis=2).reshape(-1, 2)
    alpha = image.with_transform(TextureTransform(wrap=opacity.opacity_wrap)).at(places) * opacity.opacity_factor
    if opacity.opacity_mode == "mask":
        alpha = (alpha >= opacity.opacity_cutoff).astype(np.float32)
    placed = _placed(alpha.reshape(len(v), len(u), 1), opacity.opacity_repeats, opacity.transform)
    texture = SubElement(mask, "texture", name="opacity", type="bitmap")
    SubElement(texture, "string", name="filename", value=file)
    SubElement(texture, "boolean", name="raw", value="true")
    SubElement(texture, "string", name="wrap_mode", value=opacity.opacity_wrap[0])
    # Mitsuba's v grows downwards.
    a, b, c = placed.matrix[0]
    d, e, f = np.array([0.0, 0.0, 1.0]) - placed.matrix[1]
    rows = ((a, b, 0.0, c), (d, e, 0.0, f), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))
    to_uv = SubElement(texture, "transform", name="to_uv")
    SubElement(to_uv, "matrix", value=" ".join(f"{value:.9g}" for row in rows for value in row))
    return placed.texels.repeat(3, axis=2)


def _placed(texels: NDArray[np.float32], repeats: tuple[float, float], transform: TextureTransform) -> FactorImage:
    cosine, sine = transform.turn
    (across, up), (along_u, along_v) = repeats, transform.offset
    matrix = np.array([[cosine * across, -sine * up, along_u], [sine * across, cosine * up, along_v]])
    wraps = {"repeat": 0, "mirror": 1, "clamp": 2}
    return FactorImage(texels, matrix, (wraps[transform.wrap[0]], wraps[transform.wrap[1]]))
