"""How far off a picture is, by its own judgement, from some hundred of its points.

Direct light is computed there once more, from four times as many lights and patches with rays of their own, and twice
the bands. Light between surfaces is held against paths through the scene (`path_tracer`), so that all that was left out
of it counts: chance, interpolation, cells, series that end in albedos. Paths are noisy; but two halves of them, a and
b, are so independently, and of what the picture has, v, and the truth, t,

    E (v - a) (v - b) = (v - t)^2,

so that their noise cancels instead of being taken for an error, and what is left of it falls with the square root of
the number of points. Paths alone were rejected for direct light: in a stairwell they are noisier than it is off.

Of each visible object the points are drawn evenly, some of every one, however small: a mirror ball can have most of the
error of a picture.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.light.lights import cut_lights
from engine.material.layer import Layer
from engine.plan import MOST_BANDS_OVERRULED
from engine.render.path_tracer import trace_halves
from engine.render.still import StillLayer, StillProgress, layer_radiance, shape_of
from engine.scene.hits import PrimaryHits
from engine.transport.lighting import prepare_lighting
from engine.transport.near import near_leaves
from engine.transport.pipeline import Placement, Quality, SkyState
from engine.transport.projection import VisibleLight, project_points
from engine.transport.visibility import empty_visibility, evaluate_rows

N_POINTS = 256
FINER = 4  # times as many lights and patches
# Paths in all: so many a pixel of the picture, within these bounds; a tenth of the time of a still of 512 × 512 pixels.
PATHS_A_PIXEL, FEWEST_PATHS, MOST_PATHS = 64, 1 << 15, 1 << 18
# What is brighter than all but a thousandth of the picture counts as that bright, as where pictures are compared.
CLAMP_PERCENTILE = 99.9
# An error that can be seen in places, and is worth a word.
POOR = 0.05
_SEED = 12
_ROWS_AT_ONCE = 32

Floats = NDArray[np.float64]
Steps = Generator[StillProgress, None, Floats]


@dataclass(frozen=True)
class ErrorEstimate:
    """Relative RMS errors of a picture: root of the mean square over its mean, linear, over what reflects.

    direct: of light that was reflected once; indirect: of light that was reflected before, None where the picture is to
    have none. doubt: an `indirect` below it is not told from none. Chance moves all of them: they are within a factor
    of two.
    """

    direct: float
    indirect: float | None = None
    doubt: float = 0.0

    @property
    def total(self) -> float:
        """Of all the light."""
        return float(np.hypot(self.direct, max(self.indirect, self.doubt) if self.indirect is not None else 0.0))

    @property
    def is_poor(self) -> bool:
        """Whether a person should hear of it."""
        return self.total > POOR

    @property
    def text(self) -> str:
        """In words, such as "error about 1.8 % (direct 0.6 %, indirect 1.7 %)"."""
        if self.indirect is None:
            return f"error about {_percent(self.total)}"
        unsure = self.indirect < self.doubt
        indirect = f"below {_percent(self.doubt)}" if unsure else _percent(self.indirect)
        word = "below" if unsure and self.doubt > self.direct else "about"
        return f"error {word} {_percent(self.total)} (direct {_percent(self.direct)}, indirect {indirect})"

    @property
    def advice(self) -> str:
        """What helps where it is poor, in one line; else ""."""
        if not self.is_poor:
            return ""
        if self.indirect is not None and self.indirect > self.direct:
            return "most of it is in light between surfaces: more pixels help, or more bands at the second bounce"
        return "most of it is in direct light: more lights, patches or bands help"


def estimate_error(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, n_bounces: int,
    radiance: NDArray[np.floating], indirect: NDArray[np.floating] | None = None, n_paths: int | None = None,
    seed: int = _SEED,
) -> Generator[StillProgress, None, ErrorEstimate]:  # fmt: skip
    """The error of what the points of a picture reflect, radiance (P, 3), of which `indirect` (P, 3) was reflected
    before, without what multiplies all of the light. The same seed gives the same number again.

    quality: how finely its direct light was computed; n_paths: None for as many as the picture is worth.
    """
    rows, weights = _sample(placement.hits, np.random.default_rng(seed))
    if not len(rows):
        return ErrorEstimate(0.0, None if n_bounces == 1 else 0.0)
    top = float(np.percentile(radiance, CLAMP_PERCENTILE))
    shown = np.asarray(radiance[rows], np.float64)
    again = np.zeros_like(shown) if indirect is None else np.asarray(indirect[rows], np.float64)
    finer = yield from _direct(placement, layers, sky, quality, rows)
    if n_bounces == 1:
        top, mean = _scale(top, finer, weights)
        return ErrorEstimate(_root(weights @ _products(shown, np.stack([finer, finer]), top), mean))
    wanted = n_paths or int(np.clip(PATHS_A_PIXEL * len(placement.hits.pixel), FEWEST_PATHS, MOST_PATHS))
    layers_of = _by_object(layers)
    halves = yield from trace_halves(placement, layers_of, sky, n_bounces, max(wanted // len(rows), 2), seed, rows)
    reflected = halves[:, :, 1] - halves[:, :, 0]
    top, mean = _scale(top, finer + reflected.mean(axis=0), weights)
    direct = _products(shown - again, np.stack([finer, finer]), top)
    off = weights * _products(again, reflected, top)
    return ErrorEstimate(_root(weights @ direct, mean), _root(off.sum(), mean), _root(np.linalg.norm(off), mean))


def _sample(hits: PrimaryHits, generator: np.random.Generator) -> tuple[NDArray[np.int32], Floats]:
    """Rows (n,) of points, ascending, and their weights (n,), 1 in all: half of them by the pixels of their object, the
    others as many of each object."""
    ranges = [(int(begin), int(end)) for begin, end in hits.object_ranges if end > begin]
    rows, weights = [np.zeros(0, np.int32)], [np.zeros(0)]
    for begin, end in ranges:
        share = (end - begin) / len(hits.pixel)
        n = min(round(N_POINTS * 0.5 * (share + 1.0 / len(ranges))) + 1, end - begin)
        rows.append(np.sort(begin + generator.choice(end - begin, n, replace=False)).astype(np.int32))
        weights.append(np.full(n, share / n))
    return np.concatenate(rows), np.concatenate(weights)


def _direct(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, rows: NDArray[np.int32]
) -> Steps:
    """Direct light (n, 3) at some rows, more finely."""
    light = yield from _finer_light(placement, sky, quality, rows)
    found = np.zeros((len(rows), 3))
    for each in layers:
        begin, end = placement.hits.object_ranges[each.i_object]
        mine = np.flatnonzero((rows >= begin) & (rows < end))
        if len(mine):
            bands = tuple(
                min(2 * n, most) if n > 1 else 1 for n, most in zip(each.bands, MOST_BANDS_OVERRULED, strict=True)
            )
            finer = replace(each, bands=bands)
            tile = project_points(placement.hits, rows[mine], light, shape_of(finer), 0)
            found[mine] += layer_radiance(placement.hits, rows[mine], finer, tile, light.lighting.unit)
            yield StillProgress(0.0, "estimating the error")
    return found


def _finer_light(
    placement: Placement, sky: SkyState, quality: Quality, rows: NDArray[np.int32]
) -> Generator[StillProgress, None, VisibleLight]:
    """Four times as many lights, each traced, as these rows see them."""
    hits, caster, cut = placement.hits, placement.caster, None
    if sky.environment is not None:
        cut = cut_lights(sky.environment, FINER * quality.n_lights, sky.rotation, quality.max_level)
    emitters = placement.emitters(FINER * quality.n_patches)
    yield StillProgress(0.0, "estimating the error")
    lighting = prepare_lighting(cut, emitters, 0.5 * quality.tolerance, own_rays=True, scale=sky.scale)
    seen = [empty_visibility(hits, each) for each in (lighting.fine_targets, lighting.emitter_targets)]
    for i in range(0, len(rows), _ROWS_AT_ONCE):
        for visibility in seen:
            evaluate_rows(hits, caster, visibility, rows[i : i + _ROWS_AT_ONCE])
        yield StillProgress(0.0, "estimating the error")
    near = near_leaves(hits, caster, lighting.emitters, seen[1], rows)
    return VisibleLight(lighting, placement.sphere, *seen, near)


def _by_object(layers: Sequence[StillLayer]) -> dict[int, list[Layer]]:
    found: dict[int, list[Layer]] = {}
    for each in layers:
        found.setdefault(each.i_object, []).append(each.layer)
    return found


def _scale(top: float, light: Floats, weights: Floats) -> tuple[float, float]:
    """Where light (n, 3) is cut off, and its mean below that; top: where the picture's is."""
    top = max(top, float(np.percentile(light, CLAMP_PERCENTILE)))
    return top, float(weights @ np.minimum(light, top).mean(axis=1))


def _products(shown: Floats, halves: Floats, top: float) -> Floats:
    """(v - a) (v - b), (n,), means over the colours of light (n, 3) and its halves (2, n, 3)."""
    off = np.minimum(shown, top) - np.minimum(halves, top)
    return np.asarray((off[0] * off[1]).mean(axis=1))


def _root(mean_square: float, mean: float) -> float:
    """The relative RMS error; chance can make a mean square of next to nothing negative."""
    return float(np.sqrt(max(mean_square, 0.0))) / mean if mean > 0.0 else 0.0


def _percent(error: float) -> str:
    return f"{100.0 * error:.1f} %"
