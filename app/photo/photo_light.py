"""Finds how the light of a photograph was turned, and how strong each light was, in a scene whose materials are known.

Both are judged by all that the photograph shows: objects as they reflect the light, and the environment itself.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import replace
from functools import partial

import numpy as np

from app.document.commands.light import SetRotation
from app.document.commands.mix import STRENGTH, SetMix
from app.document.document import Document
from app.document.light_mix import lights_of
from app.document.view_state import Viewpoint
from app.photo.compared_points import ComparedPoints
from app.project.project import Project
from engine.core.errors import InsituError
from engine.core.generators import StillProgress, map_steps
from engine.inverse.curve_fit import Float64Array, radiance_weights

# Rotations that are tried over the whole turn, then halvings of the step about the best; near one: the first step.
N_TURNED, N_HALVINGS, NEAR = 24, 8, 4.0
# By how much, relative to its error, another rotation must be nearer than the present one.
_LEAST_GAIN = 0.02
# A pixel that is off by more than this factor, as a logarithm, counts no more: it shows something else.
_OUTLYING = 1.0
MOST_LIGHTS = 16
# A light whose strength the picture does not show keeps it; one that is out is this weak, stops.
_LEAST_STOPS, _MOST_STOPS = -10.0, 10.0
_PRIOR = 1e-3


def found_rotation(project: Project, points: ComparedPoints, is_near: bool) -> Generator[StillProgress, None, float]:
    """The rotation of the environment in degrees that is nearest to the photograph, the present one where none is
    clearly nearer; is_near: searches near the present one alone. Raises InsituError where no environment shines."""
    environment = project.sky.environment
    if environment is None or not project.sky.scale or not environment.radiance.any():
        raise InsituError("the scene has no environment that shines, whose rotation could be found")
    few, start = points.fewer(), project.document.light.rotation
    known: dict[float, float] = {}
    step = NEAR if is_near else 360.0 / N_TURNED
    tried = [start + step * i for i in ((0, -2, -1, 1, 2) if is_near else range(N_TURNED))]
    n_trials = len(tried) + 2 * N_HALVINGS
    for angle in tried:
        known[angle] = yield from _rotation_error(project, few, angle)
        yield StillProgress(len(known) / n_trials, "turning the environment")
    for _ in range(N_HALVINGS):
        best, step = min(known, key=lambda angle: known[angle]), step / 2.0
        for angle in (best - step, best + step):
            known[angle] = yield from _rotation_error(project, few, angle)
            yield StillProgress(len(known) / n_trials, "turning the environment")
    best = min(known, key=lambda angle: known[angle])
    return (best if known[best] < (1.0 - _LEAST_GAIN) * known[start] else start) % 360.0


def _rotation_error(project: Project, points: ComparedPoints, degrees: float) -> Generator[StillProgress, None, float]:
    """How far the photograph is from the scene under a rotated environment: the mean logarithm of the factor, but for
    one common factor."""
    turned = project.edited(SetRotation(degrees).apply(project.document), Viewpoint(None, None))
    view, layers = yield from map_steps(points.coarse_view(turned), lambda step: StillProgress(0.0, step.text))
    pixels = points.pixels(turned)
    light = np.concatenate([view.direct(layers), pixels.known]).mean(axis=1)
    seen = np.concatenate([pixels.seen, pixels.beside]).mean(axis=1)
    least = 1e-3 * float(light.mean())
    ratio = np.log((seen + 1e-30) / np.maximum(light, least))[seen > 0.0]
    if not ratio.size or not least > 0.0:
        return math.inf
    return float(np.mean(np.minimum(np.abs(ratio - np.median(ratio)), _OUTLYING)))


def found_strengths(
    project: Project, points: ComparedPoints, n_bounces: int | None
) -> Generator[StillProgress, None, tuple[SetMix, ...]]:
    """The strengths of the lights that are on, as edits. The photograph has one more factor, its exposure, so that the
    strongest of them keeps its strength. Raises InsituError."""
    document = project.document
    keys = [key for key in lights_of(document) if document.light.row(key).on]
    if len(keys) > MOST_LIGHTS:
        raise InsituError(f"{len(keys)} lights, expected at most {MOST_LIGHTS} whose strengths are to be found")
    if len(keys) < 2:
        return ()
    few, pictures = points.fewer(), list[Float64Array]()
    for number, key in enumerate(keys):
        alone = project.edited(_alone(document, key), Viewpoint(None, None))
        done = StillProgress(number / len(keys), "each light alone")
        view, layers = yield from map_steps(few.coarse_view(alone, n_bounces or 2), partial(_as_step, done))
        pictures.append(np.concatenate([view.direct(layers) + view.indirect(layers), few.pixels(alone).known]).ravel())
    pixels = few.pixels(project)
    factors = _factors(np.stack(pictures, axis=1), np.concatenate([pixels.seen, pixels.beside]))
    brightest = int(np.argmax([float(each.sum()) * factor for each, factor in zip(pictures, factors, strict=True)]))
    if not factors[brightest] > 0.0:
        return ()
    edits = []
    for key, factor in zip(keys, factors / factors[brightest], strict=True):
        change = float(np.clip(math.log2(max(factor, 1e-6)), _LEAST_STOPS, _MOST_STOPS))
        if abs(change) > 1e-3:
            now = document.light.row(key).strength
            edits.append(SetMix(key, "strength", float(np.clip(now + change, STRENGTH.minimum, STRENGTH.maximum))))
    return tuple(edits)


def _as_step(done: StillProgress, step: StillProgress) -> StillProgress:
    return done


def _factors(pictures: Float64Array, seen: Float64Array) -> Float64Array:
    """The factor of each light (k,) with which their pictures (3 n, k) are nearest to what was seen (n, 3), both
    radiance up to one factor; one that lights nothing has that of all together."""
    from scipy.optimize import nnls

    root = np.sqrt(radiance_weights(seen)).ravel()
    matrix, vector = pictures * root[:, None], seen.ravel() * root
    whole = matrix.sum(axis=1)
    common = float(whole @ vector / max(whole @ whole, 1e-300))
    size = np.linalg.norm(matrix, axis=0)
    pull = _PRIOR * float(size.max())
    for _ in range(4):  # pixels that no light explains lose weight
        rows = np.vstack([matrix, pull * np.eye(matrix.shape[1])])
        found = nnls(rows, np.concatenate([vector, np.full(matrix.shape[1], pull * common)]))[0]
        off = np.abs(matrix @ found - vector)
        usual = 1.4826 * float(np.median(off))
        weight = np.minimum(1.0, 3.0 * usual / np.maximum(off, 1e-300)) ** 0.5 if usual > 0.0 else np.ones(len(off))
        matrix, vector = pictures * (root * weight)[:, None], seen.ravel() * root * weight
    return np.asarray(found)


def _alone(document: Document, key: str) -> Document:
    """A document with one of its lights on."""
    light = document.light
    rows = {each: replace(light.row(each), solo=each == key) for each in lights_of(document)}
    return replace(document, light=light.with_rows({**dict(light.mix), **rows}))
