"""How far off a picture is, by its own judgement, from some hundred of its points.

Direct light is computed there six times more, from four times as many lights, sixteen times as many patches and twice
the bands, with random rays of its own to the sky. Light between surfaces is held against paths through the scene
(`path_tracer`), so that all that was left out of it counts: chance, interpolation, cells, series that end in albedos.
Either is noisy; but two looks at it, a and b, are so independently, and of what the picture has, v, and the truth, t,

    E (v - a) (v - b) = (v - t)^2,

so that their noise cancels instead of being taken for an error, and what is left of it falls with the square root of
the number of points. Paths for direct light as well were rejected: they are noisier than it is off, by far in a
stairwell with lamps close by.

Points are drawn where an error may be: some of every visible object, however small, for a mirror ball can have most of
the error of a picture, and many where neighbours differ, as along the edges of shadows.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from engine.light.lights import TriangleLights, cut_lights
from engine.material.layer import Layer
from engine.plan import MOST_BANDS_OVERRULED
from engine.render.path_tracer import trace_halves
from engine.render.picture_error import ErrorEstimate
from engine.render.still import StillLayer, StillProgress, layer_radiance, shape_of
from engine.scene.hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.transport.lighting import prepare_lighting
from engine.transport.near import near_leaves
from engine.transport.pipeline import Placement, Quality, SkyState
from engine.transport.projection import VisibleLight, project_points
from engine.visibility.points import Visibility, empty_visibility, evaluate_rows
from engine.visibility.targets import Targets

N_POINTS = 256
FINER, FINER_PATCHES = 4, 16  # times as many lights, and as many leaves of the tree of emitters
N_LOOKS = 6
# Paths in all: so many a pixel of the picture, within these bounds; a tenth of the time of a still of 512 × 512 pixels.
PATHS_A_PIXEL, FEWEST_PATHS, MOST_PATHS = 64, 1 << 15, 1 << 18
# What is brighter than all but a thousandth of the picture counts as that bright, as where pictures are compared.
CLAMP_PERCENTILE = 99.9
_SEED = 12
_ROWS_AT_ONCE = 32
WHAT = "estimating the error"

Floats = NDArray[np.float64]
Steps = Generator[StillProgress, None, Floats]


def estimate_error(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, n_bounces: int,
    radiance: NDArray[np.floating], indirect: NDArray[np.floating] | None = None, n_paths: int | None = None,
    seed: int = _SEED,
) -> Generator[StillProgress, None, ErrorEstimate]:  # fmt: skip
    """The error of what the points of a picture reflect, radiance (P, 3), of which `indirect` (P, 3) was reflected
    before, without what multiplies all of the light. The same seed gives the same number again.

    quality: how finely its direct light was computed; n_paths: None for as many as the picture is worth.
    """
    if not len(placement.hits.pixel):
        return ErrorEstimate(0.0, None if n_bounces == 1 else 0.0)
    rows, weights = _sample(placement.hits, radiance, np.random.default_rng(seed))
    top = float(np.percentile(radiance, CLAMP_PERCENTILE))
    shown = np.asarray(radiance[rows], np.float64)
    again = np.zeros_like(shown) if indirect is None else np.asarray(indirect[rows], np.float64)
    finer = yield from _direct(placement, layers, sky, quality, rows, seed)
    reflected = np.zeros_like(finer)
    if n_bounces > 1:
        wanted = n_paths or int(np.clip(PATHS_A_PIXEL * len(placement.hits.pixel), FEWEST_PATHS, MOST_PATHS))
        n_each = max(wanted // len(rows), 2)
        halves = yield from trace_halves(placement, _by_object(layers), sky, n_bounces, n_each, seed, rows)
        reflected = halves[:, :, 1] - halves[:, :, 0]
    light = finer.mean(axis=0) + reflected.mean(axis=0)
    top = max(top, float(np.percentile(light, CLAMP_PERCENTILE)))
    mean = float(weights @ np.minimum(light, top).mean(axis=1))
    direct = _relative(weights * _squares(shown - again, finer, top), mean)
    return ErrorEstimate(direct, None if n_bounces == 1 else _relative(weights * _squares(again, reflected, top), mean))


def _sample(
    hits: PrimaryHits, radiance: NDArray[np.floating], generator: np.random.Generator
) -> tuple[NDArray[np.int32], Floats]:
    """Rows (n,) of points, ascending, and their weights (n,): means of what they have, times these, are the picture's.

    A quarter is drawn evenly, a quarter evenly of each object, the others where the picture bends."""
    n_points = len(hits.pixel)
    sizes = np.diff(hits.object_ranges, axis=1)[:, 0]
    of_object = np.repeat(1.0 / np.maximum(sizes, 1), sizes) / max(int((sizes > 0).sum()), 1)
    bends = _contrast(hits, radiance) ** 2
    total = bends.sum()
    chance = 0.25 / n_points + 0.25 * of_object + (0.5 * bends / total if total > 0.0 else 0.5 / n_points)
    chance /= chance.sum()
    rows = np.sort(generator.choice(n_points, min(N_POINTS, n_points), p=chance)).astype(np.int32)
    weights = 1.0 / chance[rows]
    return rows, weights / weights.sum()


def _contrast(hits: PrimaryHits, radiance: NDArray[np.floating]) -> Floats:
    """How much each point (P,) differs from the mean of its neighbours above and below, or left and right, on its own
    object: edges of shadows, where few points have much of the error."""
    width, height = hits.resolution
    light, objects = np.zeros((height + 2, width + 2)), np.full((height + 2, width + 2), -1)
    objects[1:-1, 1:-1] = hits.object_image
    y, x = (place + 1 for place in np.divmod(hits.pixel, width))
    light[y, x] = radiance.mean(axis=1)
    found = np.zeros(len(hits.pixel))
    for dy, dx in ((0, 1), (1, 0)):
        sides = [(y + dy, x + dx), (y - dy, x - dx)]
        alike = np.all([objects[side] == objects[y, x] for side in sides], axis=0)
        step = np.max([abs(light[side] - light[y, x]) for side in sides], axis=0)
        found = np.maximum(found, np.where(alike, step, 0.0))
    return found


def _direct(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, rows: NDArray[np.int32],
    seed: int,
) -> Steps:  # fmt: skip
    """Direct light (R, n, 3) at some rows, more finely, so many times with rays of its own to the sky."""
    # Bits of all points would fill the memory, whose pages are larger than a point's.
    cut, hits, points = None, placement.hits, placement.hits.at(rows)
    if sky.environment is not None:
        cut = cut_lights(sky.environment, FINER * quality.n_lights, sky.rotation, quality.max_level)
    tree = placement.emitters(FINER_PATCHES * quality.n_patches)
    yield StillProgress(0.0, WHAT)
    lighting = prepare_lighting(cut, tree, 0.5 * quality.tolerance, own_rays=True, scale=sky.scale)
    emitters = yield from _seen(points, placement.caster, lighting.emitter_targets)
    near = near_leaves(points, placement.caster, lighting.emitters, emitters, _all_rows(points))
    sphere = empty_visibility(points, placement.sphere.targets)  # nobody asks for it: lights have their own rays
    found = np.zeros((N_LOOKS, len(rows), 3))
    for look, generator in zip(found, np.random.default_rng((seed, 1)).spawn(N_LOOKS), strict=True):
        fine = yield from _seen(points, placement.caster, _with_random_rays(lighting.fine_targets, cut, generator))
        light = VisibleLight(lighting, sphere, fine, emitters, near)
        for each in layers:
            mine = np.arange(*points.object_ranges[each.i_object], dtype=np.int32)
            if len(mine):
                finer = replace(each, bands=_twice(each.bands))
                tile = project_points(points, mine, light, shape_of(finer), 0)
                look[mine] += layer_radiance(hits, rows[mine], finer, tile, lighting.unit)
                yield StillProgress(0.0, WHAT)
        if cut is None:
            found[:] = look  # emitters are seen alike every time
            break
    return found


def _all_rows(hits: PrimaryHits) -> NDArray[np.int32]:
    return np.arange(len(hits.pixel), dtype=np.int32)


def _seen(points: PrimaryHits, caster: RayCaster, targets: Targets) -> Generator[StillProgress, None, Visibility]:
    visibility, rows = empty_visibility(points, targets), _all_rows(points)
    for i in range(0, len(rows) if len(targets.positions) else 0, _ROWS_AT_ONCE):
        evaluate_rows(points, caster, visibility, rows[i : i + _ROWS_AT_ONCE])
        yield StillProgress(0.0, WHAT)
    return visibility


def _with_random_rays(targets: Targets, cut: TriangleLights | None, generator: np.random.Generator) -> Targets:
    """Targets that are the lights of a cut, each at a random place of its triangle: where the sun is half hidden, its
    centre knows nothing of it. Leaves of emitters keep their places: those close by would be noise and nothing else."""
    if cut is None:
        return targets
    places = _within(cut.vertices[cut.corners], generator)
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    return replace(targets, positions=places.astype(np.float32))


def _within(triangles: NDArray[np.floating], generator: np.random.Generator) -> Floats:
    """A random point (M, 3) of each triangle (M, 3, 3)."""
    u, v = generator.random((2, len(triangles)))
    inner = np.minimum(u, v)
    shares = np.stack([inner, np.maximum(u, v) - inner, 1.0 - np.maximum(u, v)], axis=1)
    return np.asarray(np.einsum("mk,mki->mi", shares, triangles.astype(np.float64)))


def _twice(bands: tuple[int, int]) -> tuple[int, int]:
    """Twice as many of each curve that has any, as far as there can be."""
    most = MOST_BANDS_OVERRULED[0] if bands[1] == 1 else min(MOST_BANDS_OVERRULED)
    return min(2 * bands[0], most), 1 if bands[1] == 1 else min(2 * bands[1], most)


def _by_object(layers: Sequence[StillLayer]) -> dict[int, list[Layer]]:
    found: dict[int, list[Layer]] = {}
    for each in layers:
        found.setdefault(each.i_object, []).append(each.layer)
    return found


def _squares(shown: Floats, looks: Floats, top: float) -> Floats:
    """(v - t)^2 (n,), means over the colours, of light (n, 3) by R independent looks at the truth (R, n, 3): the mean
    of (v - a) (v - b) over all pairs of them."""
    off = np.minimum(shown, top) - np.minimum(looks, top)
    pairs = (off.sum(axis=0) ** 2 - (off**2).sum(axis=0)) / (len(looks) * (len(looks) - 1))
    return np.asarray(pairs.mean(axis=1))


def _relative(squares: Floats, mean: float) -> float:
    """The relative RMS error by weighted squares (n,). Chance can make their sum next to nothing, or less: half of what
    it may be by chance is taken for an error in any case."""
    square = max(float(squares.sum()), 0.5 * float(np.linalg.norm(squares)))
    return math.sqrt(square) / mean if mean > 0.0 else 0.0
