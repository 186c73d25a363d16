"""What pixels at rest find out about direct light by rays of their own, beyond what lies between their points."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.material.layer import Layer
from engine.realtime.triple_product.view_samples import Rows, ViewSamples
from engine.render.integrator import evaluate_layers
from engine.scene.primary_hits import LEAST_COSINE
from engine.scene.scene_loader import Scene

Floats = NDArray[np.float32]
_AT_ONCE = 65536  # rows


@dataclass(frozen=True, eq=False)
class PixelLight:
    """Where points are wrong about suns and patches of emitters. irradiance (R, 3): what is to be added at each sample;
    sample (N,), direction (N, 3) and power (N, 3): what is to be added of samples with gloss, of either sign."""

    irradiance: Floats
    sample: Rows
    direction: Floats
    power: Floats

    def reflected(self, seen: ViewSamples, scene: Scene, i_object: int, layers: Sequence[Layer]) -> Floats:
        """What is to be added of an object's layers to the radiance of its samples (N,), (N, 3)."""
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
            place = np.searchsorted(which, self.sample[some])  # an object's samples stand in their order
            found += np.stack([np.bincount(place, value[:, i], len(which)) for i in range(3)], axis=1)
        return found


@dataclass(frozen=True, eq=False)
class Wrong:
    """A few rows of it: sample (N,), direction (N, 3) and power (N, 3) of what shines, and what is to be added: the
    share (N,) of it, of either sign, and that times its cosine (N,)."""

    sample: Rows
    direction: Floats
    power: Floats
    share: Floats
    cosine: Floats


def added_up(seen: ViewSamples, parts: Iterable[Wrong], has_gloss: NDArray[np.bool_]) -> PixelLight:
    """Of all parts; has_gloss (R,): samples of which directions are kept."""
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
    """A number from 0 to 15 for each of some samples (N,), by which few rays of each are others than its neighbours':
    the sixteen of four pixels by four, and of an edge's rays, are all different."""
    row, column = np.divmod(seen.pixel[samples], seen.resolution[0])
    of_pixel = _BAYER[row & 3, column & 3]
    return np.asarray(np.where(seen.share[samples] < 1.0, 5 * samples, of_pixel) & 15)


# Dispersed dots [Bayer73]: of neighbours, numbers that are far apart.
_BAYER = np.array([[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]])
