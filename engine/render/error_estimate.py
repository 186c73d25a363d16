"""How far off a picture is, by its own judgement, from some hundred of its points.

Direct light is computed there six times more, from four times as many lights, sixteen times as many patches and four
times the bands, with random rays of its own to the sky. Light between surfaces is held against paths through the scene
(`path_tracer`), so that all that was left out of it counts: chance, interpolation, cells, series that end in albedos.
Either is noisy; but two looks at it, a and b, are so independently, and of what the picture has, v, and the truth, t,

    E (v - a) (v - b) = (v - t)^2,

so that their noise cancels instead of being taken for an error, and what is left of it falls with the square root of
the number of points. For indirect light that is mostly more than the error itself: a mean of squares S with standard
error s is measured where 1 % is to be told. But the two halves of the gather rays tell what chance is left in the
picture (`IndirectLight.noise`), n, which is most of its error, and in expectation not more than that. So the mean
square error is taken to be

    max(S - s, n^2):

paths say that it is more where they are sure of it. Paths for direct light as well were rejected: they are noisier than
it is off, by far in a stairwell with lamps close by.

The whole error is found in the same way, of all the light at once, and so is neither the sum of the parts' errors nor
the root of their squares: the one takes them to be off the same way everywhere, the other not to know of each other. A
picture that another mode drew has no such parts, and is held against the same truth (`estimate_drawn_errors`).

Points are drawn where an error may be: some of every visible object, however small, for a mirror ball can have most of
the error of a picture, and many where neighbours differ, as along the edges of shadows.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.light.triangle_lights import TriangleLights, cut_lights
from engine.precompute.direct.lighting import prepare_lighting
from engine.precompute.direct.near_leaves import near_leaves
from engine.precompute.direct.pipeline import Placement, Quality, SkyState
from engine.precompute.direct.projection import VisibleLight, project_points
from engine.render.path_tracer import trace_halves
from engine.render.picture_error import ErrorEstimate
from engine.render.still import StillLayer, StillProgress, by_object, layer_radiance, shape_of
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.visibility.point_visibility import Visibility, empty_visibility, evaluate_rows
from engine.visibility.targets import Targets

N_POINTS = 256
FINER, FINER_PATCHES = 4, 16  # times as many lights, and as many leaves of the tree of emitters
FINER_PEAK_LEVELS = 4  # how far below the sky's finest triangles suns are split
FINER_TOLERANCE = 0.05  # of the bands that may bend over a light, most of the error where light grazes a wall
# Times as many bands of the sharpest curve: where 64 are too few for a highlight, 128 are, too.
FINER_BANDS, MOST_FINER_BANDS = 4, (1024, 128)
N_TRUTH_SAMPLES = 6
# Of a map of errors: points, and looks at each.
MAP_POINTS, MAP_TRUTH_SAMPLES = 1024, 2
# Paths in all: so many a pixel of the picture, within these bounds; a tenth of the time of a still of 512 × 512 pixels.
PATHS_A_PIXEL, FEWEST_PATHS, MOST_PATHS = 64, 1 << 15, 1 << 18
# What else a picture that another mode drew is held against.
DRAWN = Quality("drawn", 1, 1000, 768, 7, 0.5, own_rays=True)
# What is brighter than all but a thousandth of the picture counts as that bright, as where pictures are compared.
CLAMP_PERCENTILE = 99.9
_SEED = 12
_ROWS_AT_ONCE = 32
WHAT = "estimating the error"

Float64Array = NDArray[np.float64]
Steps = Generator[StillProgress, None, Float64Array]


@dataclass(frozen=True, eq=False)
class PointErrors:
    """A picture's error, and the relative squares (n,) of it at those of its pixels (n,) that were looked at; chance
    makes some of them less than 0, and is none on average."""

    estimate: ErrorEstimate
    pixel: NDArray[np.int32]
    squares: Float64Array


@dataclass(frozen=True, eq=False)
class _TruthSamples:
    """Looks at the light of some rows (n,) with weights (n,): direct (R, n, 3), reflected before (2, n, 3)."""

    rows: NDArray[np.int32]
    weights: Float64Array
    direct: Float64Array
    reflected: Float64Array

    @property
    def independent_totals(self) -> Float64Array:
        """Two looks at all of it (2, n, 3), neither of which has anything of the other's chance."""
        halves = np.array_split(self.direct, 2)
        return np.stack([half.mean(axis=0) for half in halves]) + self.reflected


def estimate_error(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, n_bounces: int,
    radiance: NDArray[np.floating], indirect: NDArray[np.floating] | None = None, n_paths: int | None = None,
    seed: int = _SEED, noise: float | None = None,
) -> Generator[StillProgress, None, ErrorEstimate]:  # fmt: skip
    """The error alone; arguments: see `estimate_point_errors`."""
    judging = estimate_point_errors(
        placement, layers, sky, quality, n_bounces, radiance, indirect, n_paths, seed, noise=noise
    )
    return (yield from judging).estimate


def estimate_point_errors(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, n_bounces: int,
    radiance: NDArray[np.floating], indirect: NDArray[np.floating] | None = None, n_paths: int | None = None,
    seed: int = _SEED, n_points: int = N_POINTS, noise: float | None = None,
) -> Generator[StillProgress, None, PointErrors]:  # fmt: skip
    """The error of what the points of a picture reflect, radiance (P, 3), of which `still_indirect` (P, 3) was
    reflected before, without what multiplies all of the light. The same seed gives the same number again.

    quality: how finely its direct light was computed; n_paths: None for as many as the picture is worth; n_points:
    how many of its points are looked at; noise: RMS radiance of the chance in `still_indirect`, None where it is
    not known.
    """
    hits = placement.hits
    if not len(hits.pixel):
        return _no_errors(0.0, None if n_bounces == 1 else 0.0)
    rows, weights = _sample(hits, radiance, np.random.default_rng(seed), n_points)
    truth = yield from _sample_truth(placement, layers, sky, quality, n_bounces, rows, weights, n_paths, seed)
    shown = np.asarray(radiance[rows], np.float64)
    again = np.zeros_like(shown) if indirect is None else np.asarray(indirect[rows], np.float64)
    top, mean = _scale(truth, float(np.percentile(radiance, CLAMP_PERCENTILE)))
    squares = _squares(shown, truth.independent_totals, top)
    direct = _relative_rms(weights * _squares(shown - again, truth.direct, top), mean)
    if n_bounces == 1:
        return PointErrors(ErrorEstimate(direct), hits.pixel[rows], _relative_squares(squares, mean))
    again_squares = _squares(again, truth.reflected, top)
    if noise is None or mean <= 0.0:
        indirectly, whole = (_relative_rms(weights * each, mean) for each in (again_squares, squares))
    else:
        indirectly = _at_least(noise / mean, weights, again_squares / mean**2)
        # Chance knows nothing of what direct light is off by: their squares add up.
        whole = _at_least(math.hypot(direct, noise / mean), weights, squares / mean**2)
    estimate = ErrorEstimate(direct, indirectly, whole)
    return PointErrors(estimate, hits.pixel[rows], _relative_squares(squares, mean))


def compare_errors(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, n_bounces: int,
    radiances: Sequence[NDArray[np.floating]], n_paths: int, n_points: int, seed: int = _SEED,
) -> Generator[StillProgress, None, tuple[float, ...]]:  # fmt: skip
    """The whole errors of one picture that was computed in several ways, each (P, 3), by the same looks at the same
    points, so that their difference is known better than each; other arguments: see `estimate_point_errors`."""
    rows, weights = _sample(placement.hits, radiances[0], np.random.default_rng(seed), n_points)
    truth = yield from _sample_truth(placement, layers, sky, quality, n_bounces, rows, weights, n_paths, seed)
    top, mean = _scale(truth, float(np.percentile(radiances[0], CLAMP_PERCENTILE)))
    shown = (np.asarray(radiance[rows], np.float64) for radiance in radiances)
    return tuple(_relative_rms(weights * _squares(each, truth.independent_totals, top), mean) for each in shown)


def estimate_drawn_errors(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, n_bounces: int,
    pictures: Sequence[NDArray[np.floating]], n_paths: int | None = None, seed: int = _SEED, n_points: int = N_POINTS,
) -> Generator[StillProgress, None, tuple[PointErrors, ...]]:  # fmt: skip
    """The errors of pictures (h, w, 3), each of all that the placement sees, in its own resolution or one of their own;
    inside of objects, for where those meet the placement has not the light of the whole pixel."""
    hits = placement.hits
    inner = interior_points(hits)
    if not inner.any():
        return tuple(_no_errors(None, None) for _ in pictures)
    every = _at_pixels(pictures[0], hits.pixel, hits.resolution)
    rows, weights = _sample(hits, every, np.random.default_rng(seed), n_points, inner)
    truth = yield from _sample_truth(placement, layers, sky, DRAWN, n_bounces, rows, weights, n_paths, seed)
    top, mean = _scale(truth, float(np.percentile(every, CLAMP_PERCENTILE)))
    found = []
    for picture in pictures:
        squares = _squares(_at_pixels(picture, hits.pixel[rows], hits.resolution), truth.independent_totals, top)
        mostly = _worst_object(placement, rows, weights * squares)
        estimate = ErrorEstimate(None, None, _relative_rms(weights * squares, mean), mostly)
        found.append(PointErrors(estimate, hits.pixel[rows], _relative_squares(squares, mean)))
    return tuple(found)


def _worst_object(placement: Placement, rows: NDArray[np.int32], squares: Float64Array) -> str:
    """The object that has more than half of what weighted squares (n,) at some rows sum up to; "" where none has."""
    of_object = np.bincount(placement.hits.objects[rows], squares)
    most = int(of_object.argmax())
    return placement.scene.object_names[most] if 2.0 * of_object[most] > squares.sum() > 0.0 else ""


def interior_points(hits: PrimaryHits) -> NDArray[np.bool_]:
    """Which points (P,) are the whole of a pixel whose eight neighbours show the same object."""
    height, width = hits.object_image.shape
    framed = np.pad(hits.object_image, 1, constant_values=-1)
    shifts = [framed[dy : dy + height, dx : dx + width] for dy in range(3) for dx in range(3)]
    alike = np.all([shifted == hits.object_image for shifted in shifts], axis=0)
    return np.asarray(alike.ravel()[hits.pixel] & hits.is_centred & (hits.share == 1.0))


def _no_errors(direct: float | None, indirect: float | None) -> PointErrors:
    """Of a picture in which nothing reflects."""
    return PointErrors(ErrorEstimate(direct, indirect, 0.0), np.zeros(0, np.int32), np.zeros(0))


def _at_pixels(picture: NDArray[np.floating], pixel: NDArray[np.integer], resolution: tuple[int, int]) -> Float64Array:
    """What a picture (h, w, 3) shows at the centres of pixels (n,) of this resolution (width, height): (n, 3), between
    its own pixels as it is shown."""
    if (picture.shape[1], picture.shape[0]) == resolution:
        return np.asarray(picture.reshape(-1, 3)[pixel], np.float64)
    places = np.stack(np.divmod(pixel, resolution[0]), axis=1) + 0.5
    places = places / resolution[::-1] * picture.shape[:2] - 0.5
    places = np.clip(places, 0.0, np.array(picture.shape[:2]) - 1.0)
    low = np.floor(places).astype(int)
    high = np.minimum(low + 1, np.array(picture.shape[:2]) - 1)
    down, right = (places - low).T[:, :, None]
    above = picture[low[:, 0], low[:, 1]] * (1.0 - right) + picture[low[:, 0], high[:, 1]] * right
    below = picture[high[:, 0], low[:, 1]] * (1.0 - right) + picture[high[:, 0], high[:, 1]] * right
    return np.asarray(above * (1.0 - down) + below * down, np.float64)


def _sample_truth(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, n_bounces: int,
    rows: NDArray[np.int32], weights: Float64Array, n_paths: int | None, seed: int,
) -> Generator[StillProgress, None, _TruthSamples]:  # fmt: skip
    """The light of these rows, as it is."""
    n_looks = N_TRUTH_SAMPLES if len(rows) <= N_POINTS else MAP_TRUTH_SAMPLES
    direct = yield from _direct(placement, layers, sky, quality, rows, seed, n_looks)
    reflected = np.zeros((2, *direct.shape[1:]))
    if n_bounces > 1:
        wanted = n_paths or int(np.clip(PATHS_A_PIXEL * len(placement.hits.pixel), FEWEST_PATHS, MOST_PATHS))
        n_each = max(wanted // len(rows), 2)
        halves = yield from trace_halves(placement, by_object(layers), sky, n_bounces, n_each, seed, rows)
        reflected = halves[:, :, 1] - halves[:, :, 0]
    return _TruthSamples(rows, weights, direct, reflected)


def _scale(truth: _TruthSamples, top: float) -> tuple[float, float]:
    """How bright what is brighter counts as, at least `top`, and the mean of the picture by its truth."""
    light = truth.direct.mean(axis=0) + truth.reflected.mean(axis=0)
    top = max(top, float(np.percentile(light, CLAMP_PERCENTILE)))
    return top, float(truth.weights @ np.minimum(light, top).mean(axis=1))


def _sample(
    hits: PrimaryHits, radiance: NDArray[np.floating], generator: np.random.Generator, n: int,
    among: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.int32], Float64Array]:  # fmt: skip
    """Rows of n points, ascending, and their weights (n,): means of what they have, times these, are the picture's,
    in which each counts by its share of a pixel. among: which points (P,) count, None for all.

    A quarter is drawn evenly, a quarter evenly of each object, the others where the picture bends."""
    n_points = len(hits.pixel)
    sizes = np.diff(hits.object_ranges, axis=1)[:, 0]
    of_object = np.repeat(1.0 / np.maximum(sizes, 1), sizes) / max(int((sizes > 0).sum()), 1)
    bends = _contrast(hits, radiance) ** 2
    total = bends.sum()
    chance = 0.25 / n_points + 0.25 * of_object + (0.5 * bends / total if total > 0.0 else 0.5 / n_points)
    chance = chance if among is None else chance * among
    chance /= chance.sum()
    rows = np.sort(generator.choice(n_points, min(n, n_points), p=chance)).astype(np.int32)
    weights = hits.share[rows] / chance[rows]
    return rows, weights / weights.sum()


def _contrast(hits: PrimaryHits, radiance: NDArray[np.floating]) -> Float64Array:
    """How much each point (P,) differs from its neighbours above and below, or left and right, on its own object: edges
    of shadows, where few points have much of the error. 0 beside pixels' centres."""
    width, height = hits.resolution
    light, objects = np.zeros((height + 2, width + 2)), np.full((height + 2, width + 2), -1)
    objects[1:-1, 1:-1] = hits.object_image
    centres = np.flatnonzero(hits.is_centred)
    y, x = (place + 1 for place in np.divmod(hits.pixel[centres], width))
    light[y, x] = radiance[centres].mean(axis=1)
    found = np.zeros(len(hits.pixel))
    for dy, dx in ((0, 1), (1, 0)):
        sides = [(y + dy, x + dx), (y - dy, x - dx)]
        alike = np.all([objects[side] == objects[y, x] for side in sides], axis=0)
        step = np.max([abs(light[side] - light[y, x]) for side in sides], axis=0)
        found[centres] = np.maximum(found[centres], np.where(alike, step, 0.0))
    return found


def _direct(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, rows: NDArray[np.int32],
    seed: int, n_looks: int,
) -> Steps:  # fmt: skip
    """Direct light (R, n, 3) at some rows, more finely, so many times with rays of its own to the sky."""
    # Bits of all points would fill the memory, whose pages are larger than a point's.
    cut, hits, points = None, placement.hits, placement.hits.at(rows)
    if sky.environment is not None:
        sun_level = quality.max_level + FINER_PEAK_LEVELS
        cut = cut_lights(
            sky.environment, FINER * quality.n_lights, sky.rotation, quality.max_level, peak_level=sun_level
        )
    tree = placement.emitters(FINER_PATCHES * quality.n_patches)
    yield StillProgress(0.0, WHAT)
    lighting = prepare_lighting(cut, tree, FINER_TOLERANCE * quality.tolerance, own_rays=True, scale=sky.scale)
    emitters = yield from _trace_visibility(points, placement.caster, lighting.emitter_targets)
    near = near_leaves(points, placement.caster, lighting.emitters, emitters, _all_rows(points))
    sphere = empty_visibility(points, placement.sphere.targets)  # nobody asks for it: lights have their own rays
    found = np.zeros((n_looks, len(rows), 3))
    for look, generator in zip(found, np.random.default_rng((seed, 1)).spawn(n_looks), strict=True):
        fine = yield from _trace_visibility(
            points, placement.caster, _with_random_rays(lighting.fine_targets, cut, generator)
        )
        light = VisibleLight(lighting, sphere, fine, emitters, near)
        for each in layers:
            mine = np.arange(*points.object_ranges[each.i_object], dtype=np.int32)
            if len(mine):
                finer = replace(each, bands=_finer(each.bands))
                tile = project_points(points, mine, light, shape_of(finer), 0)
                look[mine] += layer_radiance(hits, rows[mine], finer, tile, lighting.unit)
                yield StillProgress(0.0, WHAT)
        if cut is None:
            found[:] = look  # emitters are seen alike every time
            break
    return found


def _all_rows(hits: PrimaryHits) -> NDArray[np.int32]:
    return np.arange(len(hits.pixel), dtype=np.int32)


def _trace_visibility(
    points: PrimaryHits, caster: RayCaster, targets: Targets
) -> Generator[StillProgress, None, Visibility]:
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
    places = _random_points(cut.vertices[cut.corners], generator)
    places /= np.linalg.norm(places, axis=1, keepdims=True)
    return replace(targets, positions=places.astype(np.float32))


def _random_points(triangles: NDArray[np.floating], generator: np.random.Generator) -> Float64Array:
    """A random point (M, 3) of each triangle (M, 3, 3)."""
    u, v = generator.random((2, len(triangles)))
    inner = np.minimum(u, v)
    shares = np.stack([inner, np.maximum(u, v) - inner, 1.0 - np.maximum(u, v)], axis=1)
    return np.asarray(np.einsum("mk,mki->mi", shares, triangles.astype(np.float64)))


def _finer(bands: tuple[int, int]) -> tuple[int, int]:
    """So many times as many of each curve that has any, as far as transport takes them."""
    most_a, most_b = MOST_FINER_BANDS
    return min(FINER_BANDS * bands[0], most_a), 1 if bands[1] == 1 else min(2 * bands[1], most_b)


def _squares(shown: Float64Array, looks: Float64Array, top: float) -> Float64Array:
    """(v - t)^2 (n,), means over the colours, of light (n, 3) by R independent looks at the truth (R, n, 3): the mean
    of (v - a) (v - b) over all pairs of them."""
    off = np.minimum(shown, top) - np.minimum(looks, top)
    pairs = (off.sum(axis=0) ** 2 - (off**2).sum(axis=0)) / (len(looks) * (len(looks) - 1))
    return np.asarray(pairs.mean(axis=1))


def _relative_squares(squares: Float64Array, mean: float) -> Float64Array:
    return squares / mean**2 if mean > 0.0 else np.zeros_like(squares)


def _relative_rms(squares: Float64Array, mean: float) -> float:
    """The relative RMS error by weighted squares (n,). Chance can make their sum next to nothing, or less: half of what
    it may be by chance is taken for an error in any case."""
    square = max(float(squares.sum()), 0.5 * float(np.linalg.norm(squares)))
    return math.sqrt(square) / mean if mean > 0.0 else 0.0


def _at_least(known: float, weights: Float64Array, squares: Float64Array) -> float:
    """The relative RMS error by relative squares (n,) with weights (n,) that sum up to 1, `known` being the least that
    it can be: the root of what their mean is more than its own standard error, where that is more."""
    square = float(weights @ squares)
    standard_error = float(np.linalg.norm(weights * (squares - square)))
    return max(math.sqrt(max(square - standard_error, 0.0)), known)
