"""Corrections of direct light that pixels at rest find with rays of their own, beyond what their points know."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer, evaluate_layers
from engine.realtime.triple_product.view_samples import Rows, ViewSamples
from engine.scene.primary_hits import LEAST_COSINE
from engine.scene.scene_loader import Scene

Floats = NDArray[np.float32]
_AT_ONCE = 65536  # rows


@dataclass(frozen=True, eq=False)
class PixelLight:
    """Corrections where points are wrong about peaks and emitters' patches. irradiance (R, 3): to be added at each
    sample; sample (N,), direction (N, 3) and power (N, 3): to be added at glossy samples, of either sign."""

    irradiance: Floats
    sample: Rows
    direction: Floats
    power: Floats

    def reflected(self, seen: ViewSamples, scene: Scene, i_object: int, layers: Sequence[Layer]) -> Floats:
        """Radiance (N, 3) to be added to an object's samples, reflected by its layers."""
        which = seen.of(i_object)
        found = np.zeros((len(which), 3), np.float32)
        mine = np.flatnonzero(seen.samples.i_object[self.sample] == i_object)
        for start in range(0, len(mine), _AT_ONCE):
            some = mine[start : start + _AT_ONCE]
            rows, at = np.unique(self.sample[some], return_inverse=True)
            frames = seen.frames(rows, scene, i_object)[at]
            wo = np.einsum("nij,nj->ni", frames, seen.samples.wo[self.sample[some]])
            wo[:, 2] = np.maximum(wo[:, 2], LEAST_COSINE)
            wi = np.einsum("nij,nj->ni", frames, self.direction[some])
            value = evaluate_layers(layers, wi, wo / np.linalg.norm(wo, axis=1, keepdims=True)) * self.power[some]
            place = np.searchsorted(which, self.sample[some])  # an object's samples are in ascending order
            found += np.stack([np.bincount(place, value[:, i], len(which)) for i in range(3)], axis=1)
        return found


@dataclass(frozen=True, eq=False)
class Wrong:
    """Some corrections: sample (N,), direction (N, 3) and power (N, 3) of the light; share (N,) of it to be added, of
    either sign, and cosine (N,), the same times the cosine."""

    sample: Rows
    direction: Floats
    power: Floats
    share: Floats
    cosine: Floats


def added_up(seen: ViewSamples, parts: Iterable[Wrong], has_gloss: NDArray[np.bool_]) -> PixelLight:
    """Sum all parts; has_gloss (R,): samples whose directions are stored."""
    irradiance = np.zeros((len(seen.pixel), 3))
    none = np.zeros((0, 3), np.float32)
    stored = [(np.zeros(0, np.int64), none, none)]
    for part in parts:
        if not len(part.sample):
            continue
        weighed, first = part.cosine[:, None] * part.power, part.sample.min()
        at = part.sample - first
        for i in range(3):
            found = np.bincount(at, weighed[:, i])
            irradiance[first : first + len(found), i] += found
        own = has_gloss[part.sample]
        stored.append((part.sample[own], part.direction[own], part.power[own] * part.share[own, None]))
    sample, direction, power = (np.concatenate(each) for each in zip(*stored, strict=True))
    return PixelLight(irradiance.astype(np.float32), sample, direction, power)


def phases(seen: ViewSamples, samples: Rows) -> NDArray[np.int64]:
    """Assign a number from 0 to 15 to each of some samples (N,), which selects its few rays differently from its
    neighbours'. The sixteen numbers of 4 × 4 pixels, and of an edge's rays, are all different."""
    row, column = np.divmod(seen.pixel[samples], seen.resolution[0])
    of_pixel = _BAYER[row & 3, column & 3]
    return np.asarray(np.where(seen.share[samples] < 1.0, 5 * samples, of_pixel) & 15)


# Ordered dither matrix [Bayer73]: the numbers of neighbours are far apart.
_BAYER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])
