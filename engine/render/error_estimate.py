"""Estimates the error of a picture, without a reference, from some hundred of its points.

Direct light is recomputed there six times, from four times as many lights, sixteen times as many patches and four times
the bands, with independent random rays to the sky. Indirect light is compared with path tracing (`path_tracer`), so
that every approximation counts: noise, interpolation, the irradiance cache, series that end in albedos. Both are noisy;
but two independent estimates a and b of the truth t satisfy, for the picture's value v,

    E (v - a) (v - b) = (v - t)^2,

so that their noise cancels instead of counting as an error; what remains of it falls with the square root of the number
of points. For indirect light that is usually more than the error itself: the measurement is a mean of squares S with
standard error s, where errors of 1 % are to be detected. But the two halves of the hemisphere samples give the noise in
the picture (`IndirectLight.noise`), n, which is most of its error, and in expectation at most the error. So the mean
square error is estimated as

    max(S - s, n^2):

path tracing raises it where it is significant. Path tracing for direct light as well was rejected: its noise exceeds
the error, by far in a stairwell with lamps close by.

The total error is computed in the same way, of all light at once. It is neither the sum of the parts' errors, which
would assume errors of equal sign everywhere, nor the root of their squares, which would assume independence. A picture
of another mode has no such parts, and is compared with the same truth (`estimate_drawn_errors`).

In a map of errors each pixel has the weighted mean of the squares of the nearest points on its own object, the nearer
ones counting more, because at a single point noise exceeds the error. Objects that were not sampled stay transparent.

Points are sampled where errors are likely: some of every visible object, however small, because a mirror ball can have
most of a picture's error, and many where neighbours differ, as along the edges of shadows.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import StillProgress
from engine.light.triangle_lights import TriangleLights, cut_lights
from engine.precompute.direct.lighting import prepare_lighting
from engine.precompute.direct.linking import light_groups
from engine.precompute.direct.near_leaves import near_leaves
from engine.precompute.direct.pipeline import Placement, Quality, SkyState
from engine.precompute.direct.projection import VisibleLight, project_points
from engine.reference.path_tracer import trace_halves
from engine.render.display import error_to_radiance, false_colour
from engine.render.picture_error import ErrorEstimate
from engine.render.still import StillLayer, by_object, curves_of, layer_radiance, shape_of
from engine.scene.primary_hits import PrimaryHits
from engine.scene.raycaster import RayCaster
from engine.visibility.point_visibility import Targets, Visibility, empty_visibility, evaluate_rows

N_POINTS = 256
FINER, FINER_PATCHES = 4, 16  # times as many lights, and as many leaves of the tree of emitters
FINER_PEAK_LEVELS = 4  # levels below the sky's finest triangles to which peaks are split
# Factor of the tolerance, in bands, for angles that bend over a light: most of the error where light grazes a wall.
FINER_TOLERANCE = 0.05
# Factor for the bands of the sharpest curve: where 64 are too few for a highlight, 128 are as well.
FINER_BANDS, MOST_FINER_BANDS = 4, (1024, 128)
N_TRUTH_SAMPLES = 6
# For a map of errors: points, and estimates at each.
MAP_POINTS, MAP_TRUTH_SAMPLES = 1024, 2
# Number of paths: so many for each pixel of the picture, within these bounds; a tenth of the time of a still of 512 ×
# 512 pixels.
PATHS_A_PIXEL, FEWEST_PATHS, MOST_PATHS = 64, 1 << 15, 1 << 18
# The quality that a picture of another mode is compared with.
DRAWN = Quality("drawn", 1, 1000, 768, 7, 0.5, own_rays=True)
# Brighter values are clamped to this percentile, as where pictures are compared.
CLAMP_PERCENTILE = 99.9
_SEED = 12
_ROWS_AT_ONCE = 32
# In the map of errors: the points whose errors make a pixel's, and the opacity of its colours.
NEIGHBOURS = 12
OPACITY = 0.8
_PIXELS_AT_ONCE = 1 << 15
WHAT = "estimating the error"

Float64Array = NDArray[np.float64]
Colours = NDArray[np.uint8]
Steps = Generator[StillProgress, None, Float64Array]


@dataclass(frozen=True, eq=False)
class PointErrors:
    """A picture's error, and the relative squared errors (n,) at those of its pixels (n,) that were sampled; noise
    makes some of them negative, but cancels on average."""

    estimate: ErrorEstimate
    pixel: NDArray[np.int32]
    squares: Float64Array


@dataclass(frozen=True, eq=False)
class _TruthSamples:
    """Estimates of the light of some rows (n,) with weights (n,): direct (R, n, 3), indirect (2, n, 3)."""

    rows: NDArray[np.int32]
    weights: Float64Array
    direct: Float64Array
    reflected: Float64Array

    @property
    def independent_totals(self) -> Float64Array:
        """Two independent estimates of all light (2, n, 3)."""
        halves = np.array_split(self.direct, 2)
        return np.stack([half.mean(axis=0) for half in halves]) + self.reflected


def estimate_error(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, n_bounces: int,
    radiance: NDArray[np.floating], indirect: NDArray[np.floating] | None = None, n_paths: int | None = None,
    seed: int = _SEED, noise: float | None = None,
) -> Generator[StillProgress, None, ErrorEstimate]:  # fmt: skip
    """The error alone; arguments: see `estimate_point_errors`."""
    estimating = estimate_point_errors(
        placement, layers, sky, quality, n_bounces, radiance, indirect, n_paths, seed, noise=noise
    )
    return (yield from estimating).estimate


def estimate_point_errors(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, n_bounces: int,
    radiance: NDArray[np.floating], indirect: NDArray[np.floating] | None = None, n_paths: int | None = None,
    seed: int = _SEED, n_points: int = N_POINTS, noise: float | None = None,
) -> Generator[StillProgress, None, PointErrors]:  # fmt: skip
    """Estimate the error of the radiance (P, 3) that the points of a picture reflect, of which indirect (P, 3) is
    indirect light, without factors common to all light. The same seed gives the same number.

    quality: of its direct light; n_paths: None for a number that suits the picture; n_points: number of sampled points;
    noise: RMS radiance of the noise in `indirect`, None if unknown.
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
        # The noise is independent of the error of direct light: their squares add up.
        whole = _at_least(math.hypot(direct, noise / mean), weights, squares / mean**2)
    estimate = ErrorEstimate(direct, indirectly, whole)
    return PointErrors(estimate, hits.pixel[rows], _relative_squares(squares, mean))


def compare_errors(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, n_bounces: int,
    radiances: Sequence[NDArray[np.floating]], n_paths: int, n_points: int, seed: int = _SEED,
) -> Generator[StillProgress, None, tuple[float, ...]]:  # fmt: skip
    """Estimate the total errors of one picture that was computed in several ways, each (P, 3), with the same truth at
    the same points, so that their difference is more accurate than each; other arguments: see
    `estimate_point_errors`."""
    rows, weights = _sample(placement.hits, radiances[0], np.random.default_rng(seed), n_points)
    truth = yield from _sample_truth(placement, layers, sky, quality, n_bounces, rows, weights, n_paths, seed)
    top, mean = _scale(truth, float(np.percentile(radiances[0], CLAMP_PERCENTILE)))
    shown = (np.asarray(radiance[rows], np.float64) for radiance in radiances)
    return tuple(_relative_rms(weights * _squares(each, truth.independent_totals, top), mean) for each in shown)


def estimate_drawn_errors(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, n_bounces: int,
    pictures: Sequence[NDArray[np.floating]], n_paths: int | None = None, seed: int = _SEED, n_points: int = N_POINTS,
) -> Generator[StillProgress, None, tuple[PointErrors, ...]]:  # fmt: skip
    """Estimate the errors of pictures (h, w, 3), each of everything that the placement sees, in its own resolution or
    another; only inside objects, because at edges the placement does not have the light of the whole pixel."""
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
    """The object that has more than half of the sum of weighted squares (n,) at some rows; "" if none has."""
    of_object = np.bincount(placement.hits.objects[rows], squares)
    most = int(of_object.argmax())
    return placement.scene.object_names[most] if 2.0 * of_object[most] > squares.sum() > 0.0 else ""


def interior_points(hits: PrimaryHits) -> NDArray[np.bool_]:
    """Which points (P,) fill a pixel whose eight neighbours show the same object."""
    height, width = hits.object_image.shape
    framed = np.pad(hits.object_image, 1, constant_values=-1)
    shifts = [framed[dy : dy + height, dx : dx + width] for dy in range(3) for dx in range(3)]
    alike = np.all([shifted == hits.object_image for shifted in shifts], axis=0)
    return np.asarray(alike.ravel()[hits.pixel] & hits.is_centred & (hits.share == 1.0))


def _no_errors(direct: float | None, indirect: float | None) -> PointErrors:
    """The errors of a picture in which nothing reflects."""
    return PointErrors(ErrorEstimate(direct, indirect, 0.0), np.zeros(0, np.int32), np.zeros(0))


def _at_pixels(picture: NDArray[np.floating], pixel: NDArray[np.integer], resolution: tuple[int, int]) -> Float64Array:
    """Values of a picture (h, w, 3) at the centres of pixels (n,) of this resolution (width, height): (n, 3),
    interpolated as the picture is displayed."""
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
    """Estimate the true light of these rows."""
    n_estimates = N_TRUTH_SAMPLES if len(rows) <= N_POINTS else MAP_TRUTH_SAMPLES
    direct = yield from _direct(placement, layers, sky, quality, rows, seed, n_estimates)
    reflected = np.zeros((2, *direct.shape[1:]))
    if n_bounces > 1:
        wanted = n_paths or int(np.clip(PATHS_A_PIXEL * len(placement.hits.pixel), FEWEST_PATHS, MOST_PATHS))
        n_each = max(wanted // len(rows), 2)
        halves = yield from trace_halves(placement, by_object(layers), sky, n_bounces, n_each, seed, rows)
        reflected = halves[:, :, 1] - halves[:, :, 0]
    return _TruthSamples(rows, weights, direct, reflected)


def _scale(truth: _TruthSamples, top: float) -> tuple[float, float]:
    """The value at which brighter light is clamped, at least `top`, and the mean of the picture according to its
    truth."""
    light = truth.direct.mean(axis=0) + truth.reflected.mean(axis=0)
    top = max(top, float(np.percentile(light, CLAMP_PERCENTILE)))
    return top, float(truth.weights @ np.minimum(light, top).mean(axis=1))


def _sample(
    hits: PrimaryHits, radiance: NDArray[np.floating], generator: np.random.Generator, n: int,
    among: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.int32], Float64Array]:  # fmt: skip
    """Sample rows of n points, ascending, with weights (n,): weighted means over them estimate the picture's, in which
    each point counts by its share of a pixel. among: which points (P,) are eligible, None for all.

    A quarter is uniform over points, a quarter uniform over objects, the rest proportional to the picture's contrast.
    """
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
    """Contrast of each point (P,) to its neighbours above and below, or left and right, on its own object: at edges of
    shadows few points have much of the error. 0 for points off pixel centres."""
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
    seed: int, n_estimates: int,
) -> Steps:  # fmt: skip
    """Direct light (R, n, 3) at some rows, with finer settings, n_estimates times with independent rays to the sky."""
    found = np.zeros((n_estimates, len(rows), 3))
    for group in light_groups(placement, sky):
        mine = group.objects[placement.hits.objects[rows]]
        if mine.any():
            own = [each for each in layers if group.objects[each.i_object]]
            part = _direct_of_group(group.placement, own, group.sky, quality, rows[mine], seed, n_estimates)
            found[:, mine] = yield from part
    return found


def _direct_of_group(
    placement: Placement, layers: Sequence[StillLayer], sky: SkyState, quality: Quality, rows: NDArray[np.int32],
    seed: int, n_estimates: int,
) -> Steps:  # fmt: skip
    """The same of objects that the same lights reach."""
    # Bits of all points would fill the memory: a memory page is larger than a point's bits.
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
    sphere = empty_visibility(points, placement.sphere.targets)  # unused: lights have their own rays
    found = np.zeros((n_estimates, len(rows), 3))
    for one, generator in zip(found, np.random.default_rng((seed, 1)).spawn(n_estimates), strict=True):
        fine = yield from _trace_visibility(
            points, placement.caster, _with_random_rays(lighting.fine_targets, cut, generator)
        )
        light = VisibleLight(lighting, sphere, fine, emitters, near)
        for each in layers:
            mine = np.arange(*points.object_ranges[each.i_object], dtype=np.int32)
            if len(mine):
                finer = replace(each, bands=_finer(each.bands))
                tile = project_points(points, mine, light, shape_of(finer), 0)
                one[mine] += layer_radiance(hits, rows[mine], finer, tile, lighting.unit, curves_of(finer))
                yield StillProgress(0.0, WHAT)
        if cut is None:
            found[:] = one  # emitters are the same each time
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
    """Targets that are the lights of a cut, each at a random place of its triangle: where a peak is half hidden, its
    centre does not show this. Leaves of emitters keep their places: those close by would only add noise."""
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
    """Multiply the bands of each curve that has any, within the limits of transport."""
    most_a, most_b = MOST_FINER_BANDS
    return min(FINER_BANDS * bands[0], most_a), 1 if bands[1] == 1 else min(2 * bands[1], most_b)


def _squares(shown: Float64Array, estimates: Float64Array, top: float) -> Float64Array:
    """(v - t)^2 (n,), averaged over colours, for light (n, 3) and R independent estimates of the truth (R, n, 3): the
    mean of (v - a) (v - b) over all pairs of them."""
    off = np.minimum(shown, top) - np.minimum(estimates, top)
    pairs = (off.sum(axis=0) ** 2 - (off**2).sum(axis=0)) / (len(estimates) * (len(estimates) - 1))
    return np.asarray(pairs.mean(axis=1))


def _relative_squares(squares: Float64Array, mean: float) -> Float64Array:
    return squares / mean**2 if mean > 0.0 else np.zeros_like(squares)


def _relative_rms(squares: Float64Array, mean: float) -> float:
    """Relative RMS error from weighted squares (n,). Noise can make their sum almost 0, or negative: half of their
    standard error counts as an error in any case."""
    square = max(float(squares.sum()), 0.5 * float(np.linalg.norm(squares)))
    return math.sqrt(square) / mean if mean > 0.0 else 0.0


def _at_least(known: float, weights: Float64Array, squares: Float64Array) -> float:
    """Relative RMS error from relative squares (n,) with weights (n,) that sum to 1, where `known` is a lower bound:
    the root of the mean minus its standard error, if that is larger."""
    square = float(weights @ squares)
    standard_error = float(np.linalg.norm(weights * (squares - square)))
    return max(math.sqrt(max(square - standard_error, 0.0)), known)


def error_colours(hits: PrimaryHits, estimated: PointErrors) -> Generator[None, None, Colours]:
    """The picture's errors, relative to its mean, as colours (H, W, 4) with opacity; block by block."""
    errors = yield from error_map(hits, estimated)
    height, width = errors.shape
    image = np.zeros((height * width, 4), np.uint8)
    known = np.flatnonzero(np.isfinite(errors.ravel()))
    for i in range(0, len(known), _PIXELS_AT_ONCE):
        block = known[i : i + _PIXELS_AT_ONCE]
        light = np.repeat(error_to_radiance(errors.ravel()[block])[:, None], 3, axis=1)
        image[block, :3] = np.rint(255.0 * false_colour(light))
        image[block, 3] = round(255 * OPACITY)
        yield
    return image.reshape(height, width, 4)


def error_map(hits: PrimaryHits, estimated: PointErrors) -> Generator[None, None, NDArray[np.float32]]:
    """The errors themselves (H, W); NaN where unknown."""
    from scipy.spatial import KDTree

    width, height = hits.resolution
    objects = np.where(hits.row_image >= 0, hits.object_image, -1).ravel()  # emitters have no error
    errors = np.full(width * height, np.nan, np.float32)
    of_point = objects[estimated.pixel]
    for i in np.unique(of_point[of_point >= 0]):
        mine = np.flatnonzero(of_point == i)
        places = np.stack(np.divmod(estimated.pixel[mine], width), axis=1).astype(np.float64)
        tree, n = KDTree(places), min(NEIGHBOURS, len(mine))
        pixels = np.flatnonzero(objects == i)
        for j in range(0, len(pixels), _PIXELS_AT_ONCE):
            block = pixels[j : j + _PIXELS_AT_ONCE]
            distance, near = tree.query(np.stack(np.divmod(block, width), axis=1), k=np.arange(1, n + 1))
            weight = 1.0 / (1.0 + (distance / np.maximum(distance[:, -1:], 1.0)) ** 2)
            squares = (weight * estimated.squares[mine][near]).sum(axis=1) / weight.sum(axis=1)
            errors[block] = np.sqrt(np.maximum(squares, 0.0))
            yield
    return errors.reshape(height, width)
