"""Changes of an environment's map as a whole: hue, contrast, a limit of its radiance, and tilt."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, on_threads
from engine.light.environment import LUMINANCE, Environment, texel_solid_angles
from engine.light.painted_lights import tilt_matrix

_LARGEST = np.float32(1e30)


class MapChange(NamedTuple):
    """hue: degrees by which colours turn; contrast: the exponent of luminance about the map's mean, 1 for none; clamp:
    the largest radiance, 0 for none."""

    hue: float = 0.0
    contrast: float = 1.0
    clamp: float = 0.0


UNCHANGED = MapChange()


@lru_cache(maxsize=2)  # the same object again, whose integrals are known
def changed_map(environment: Environment, change: MapChange) -> Environment:
    """The environment with another hue and contrast, and then limited. Luminance stays where colours are turned, as
    far as none becomes negative; brighter texels than the limit keep their colour."""
    if change == UNCHANGED:
        return environment
    image = environment.radiance
    if change.hue % 360.0:
        image = np.maximum(image @ hue_matrix(change.hue).T.astype(np.float32), np.float32(0.0))
    if change.contrast != 1.0:
        luminance = image @ LUMINANCE
        mean = float((luminance.mean(axis=1) * texel_solid_angles(len(image), 1)).sum() / (4.0 * math.pi))
        # L (Y / mean)^(contrast - 1), 0 where Y is.
        lit = np.maximum(luminance / max(mean, 1e-30), 1e-12)
        image = (image * (lit ** (change.contrast - 1.0))[..., None]).astype(np.float32)
    if change.clamp > 0.0:
        most = image.max(axis=2, keepdims=True)
        image = image * np.minimum(np.float32(change.clamp) / np.maximum(most, np.float32(1e-30)), np.float32(1.0))
    image = np.ascontiguousarray(np.minimum(image, _LARGEST), np.float32)
    image.flags.writeable = False
    return Environment(image, environment.source, environment.notes)


def hue_matrix(degrees: float) -> NDArray[np.float64]:
    """(3, 3): turns linear colours about grey, and adds as much grey as restores their luminance."""
    angle = math.radians(degrees)
    cosine, sine = math.cos(angle), math.sin(angle) / math.sqrt(3.0)
    third = (1.0 - cosine) / 3.0
    turn = np.array([
        [cosine + third, third - sine, third + sine],
        [third + sine, cosine + third, third - sine],
        [third - sine, third + sine, cosine + third],
    ])  # fmt: skip
    return np.asarray(turn + np.outer(np.ones(3), LUMINANCE - LUMINANCE @ turn))


def tilted_image(image: NDArray[np.float32], degrees: float) -> NDArray[np.float32]:
    """A lat-long image (H, W, 3) tilted about +X (`tilt_matrix`), of the same total light in each channel."""
    from engine.light import _painting_kernels as kernels

    tilted, inverse = np.empty_like(image), np.ascontiguousarray(tilt_matrix(degrees).T)
    on_threads(lambda start, stop: kernels.tilt_rows(start, stop, image, inverse, tilted), *even_parts(len(image)))
    before, after = (
        np.einsum("hwc,h->c", each, texel_solid_angles(*each.shape[:2]), dtype=np.float64) for each in (image, tilted)
    )
    tilted *= np.divide(before, after, out=np.ones(3), where=after > 0.0).astype(np.float32)
    return tilted
