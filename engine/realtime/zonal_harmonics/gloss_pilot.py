"""Chooses, layer by layer, how Deform draws gloss: as one lobe (`engine.realtime.zonal_harmonics.shading`), or by how
many rows (`engine.realtime.zonal_harmonics.gloss_rows`).

A pilot draws both at some points of the object at rest, seen from eight sides, and compares them with a sum of the
reflection itself over all triangles of the sky that a point sees. It takes the mean of the eight errors, for from a
dark side the rings of what is bright elsewhere show most. Few rows lose to the lobe, as a reflection needs the more
functions the sharper it is; from about twelve on they have three quarters of its error or less. But where reflection or
light is sharp, what is cut off after n bands draws rings, black in their troughs, around highlights; the lobe has none.
So rows are taken where they draw hardly any point black that is not, and, as they cost memory and time in every frame,
where their error is less by `WORTH`. Suns do not count: the BRDF mirrors them, beside the lobe and beside rows. The
choice depends on the environment as its file has it, so it stays when the sky is rotated.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.generators import run_to_end
from engine.light.environment import Environment
from engine.material.layer import Layer, evaluate_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.zonal_harmonics.gloss_rows import (
    N_ROW_LOBES,
    GlossBasis,
    add_gloss_rows,
    gloss_basis,
    simulate_gloss_rows,
)
from engine.realtime.zonal_harmonics.shading import BandLight, Lobes, add_gloss, band_light, lobes, low_gloss, shade
from engine.realtime.zonal_harmonics.sun_lights import sky_light
from engine.realtime.zonal_harmonics.transfer import TransferPoints, simulate_shadows
from engine.realtime.zonal_harmonics.zonal import fit
from engine.render.error_estimate import CLAMP_PERCENTILE
from engine.scene.raycaster import RayCaster, SurfacePoints
from engine.sphere.geodesic import geodesic
from engine.sphere.haar import level_of
from engine.sphere.harmonics import project

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

LOBE = 0  # rows: none
CANDIDATES = (3, 6, 9, 12, 16)
WORTH = 1.1  # times the error of the rows, below which the lobe stays; and of the best, below which fewer rows do
MOST_BLACK = 0.01  # of the values, above which rows are taken to draw rings
_LIT = 0.02  # of the mean, above which a value is not black
N_POINTS, N_RAYS = 400, 1000
SIDES = np.array(list(product((-1.0, 1.0), repeat=3))) / math.sqrt(3.0)  # directions wo (8, 3), in world axes
_GRAZING = 0.1  # least cosine of wo
_N_LOBES = 4  # of diffuse transfer


class PilotResult(NamedTuple):
    """What a pilot finds of n_rows, `LOBE` for one lobe: the relRMSE, and the share of values, 0 to 1, that are drawn
    black and are not."""

    n_rows: int
    error: float
    black: float


@dataclass(frozen=True)
class GlossChoice:
    """How a layer's gloss is drawn: by n_rows, `LOBE` for one lobe, for a reason. found: by the pilot, empty if the
    number was given."""

    n_rows: int
    reason: str = "as is set"
    found: tuple[PilotResult, ...] = ()

    @property
    def value(self) -> str:
        """As the plan shows it."""
        return _in_words(self.n_rows)


def _in_words(n_rows: int) -> str:
    return f"{n_rows} rows" if n_rows else "one lobe"


def choose_gloss(
    mesh: TransferPoints, caster: RayCaster, layer: Layer, environment: Environment | None, order: int
) -> Generator[float, None, GlossChoice]:
    """The choice for a layer of an object under an environment, with light of some order. Yields the share that is
    done."""
    if environment is None:
        return GlossChoice(LOBE, "no sky")
    # Suns are mirrored by the BRDF, whatever is chosen. A triangle's four children follow one another.
    powers = sky_light(SkyState(environment), 1.0).dull_powers.reshape(-1, 4, 3).sum(axis=1)
    light = band_light(project(powers, order))
    return choice_of((yield from try_gloss(mesh, caster, layer, powers, light)))


def choice_of(found: tuple[PilotResult, ...]) -> GlossChoice:
    """The choice, given the lobe's result and then those of more and more rows."""
    lobe, *rows = found
    best = min(rows, key=lambda each: each.error)
    smooth = [each for each in rows if each.black <= MOST_BLACK]
    if smooth:
        least = min(each.error for each in smooth)
        enough = next(each for each in smooth if each.error <= WORTH * least)
        if lobe.error > WORTH * enough.error:
            reason = f"error {enough.error:.0%} at a pilot's points, where one lobe would have {lobe.error:.0%}"
            return GlossChoice(enough.n_rows, reason, found)
    reason = f"error {lobe.error:.0%} at a pilot's points, where {_in_words(best.n_rows)} would have {best.error:.0%}"
    if best.black > MOST_BLACK:
        reason += f" and black rings on {best.black:.0%} of them"
    return GlossChoice(LOBE, reason, found)


def try_gloss(
    mesh: TransferPoints, caster: RayCaster, layer: Layer, powers: Float64Array, light: BandLight
) -> Generator[float, None, tuple[PilotResult, ...]]:
    """What a pilot finds of a layer's direct gloss as one lobe and by each of `CANDIDATES`, under a sky of powers (T,
    3) on triangles and the same light in bands. Yields the share that is done."""
    mesh, side = _views(mesh, caster)
    wo, order = SIDES[side], light.table.shape[2]
    truth = yield from traced_gloss(mesh, caster, layer, powers, wo)
    found = [_result(LOBE, by_lobe(mesh, caster, layer, light, wo), truth, side)]
    basis = gloss_basis(layer, order, CANDIDATES[-1])
    vectors = run_to_end(simulate_gloss_rows(mesh, caster, basis, N_RAYS))
    yield 0.9
    fitted = lobes(run_to_end(fit(vectors.reshape(-1, order**2), N_ROW_LOBES, 0)))
    for n_rows in CANDIDATES:
        found.append(_result(n_rows, by_rows(mesh.frames, basis, fitted, n_rows, light, wo), truth, side))
    yield 1.0
    return tuple(found)


def _result(n_rows: int, ours: Float32Array, truth: Float64Array, side: NDArray[np.integer]) -> PilotResult:
    """Means over the sides (P,) that points are seen from."""
    parts = [side == k for k in np.unique(side)]
    errors = [relative_error(ours[part], truth[part]) for part in parts]
    black = [black_share(ours[part], truth[part]) for part in parts]
    return PilotResult(n_rows, float(np.mean(errors or [0.0])), float(np.mean(black or [0.0])))


def _views(mesh: TransferPoints, caster: RayCaster) -> tuple[TransferPoints, NDArray[np.integer]]:
    """Some of the points, and for each one of `SIDES` (P,) from which the object itself does not hide it."""
    random, n = np.random.default_rng(1), len(mesh.frames)
    chosen = np.sort(random.choice(n, min(N_POINTS, n), replace=False))
    origins = np.repeat(mesh.points.offset_position[chosen], len(SIDES), axis=0)
    is_free = ~caster.occluded(origins, np.tile(SIDES.astype(np.float32), (len(chosen), 1)))
    sees = is_free.reshape(len(chosen), -1) & (mesh.frames[chosen, 2] @ SIDES.T > _GRAZING)
    seen = sees.any(axis=1)
    side = np.where(sees, random.random(sees.shape), -1.0).argmax(axis=1)
    return some_of(mesh, chosen[seen]), side[seen]


def some_of(mesh: TransferPoints, which: NDArray[np.integer]) -> TransferPoints:
    """Some of a mesh's points."""
    of = mesh.points
    points = SurfacePoints(of.position[which], of.horizon[which], of.offset_position[which])
    return replace(mesh, points=points, frames=mesh.frames[which])


def traced_gloss(
    mesh: TransferPoints, caster: RayCaster, layer: Layer, powers: Float64Array, wo: Float64Array
) -> Generator[float, None, Float64Array]:
    """Radiance (P, 3) that points reflect along wo (P, 3), in world axes, of a sky of powers (T, 3): one ray through
    each triangle. Yields up to 0.7."""
    directions = geodesic(level_of(len(powers))).centres
    truth = np.empty((len(wo), 3))
    for p, frame in enumerate(mesh.frames):
        wi = directions @ frame.T
        above = wi[:, 2] > 0.0
        origins = np.repeat(mesh.points.offset_position[p : p + 1], int(above.sum()), axis=0)
        is_free = ~caster.occluded(origins, directions[above].astype(np.float32))
        local = np.tile(frame @ wo[p], (int(is_free.sum()), 1))
        truth[p] = (evaluate_layer(layer, wi[above][is_free], local) * powers[above][is_free]).sum(axis=0)
        if p % 20 == 19:
            yield 0.7 * p / len(wo)
    return truth


def by_lobe(mesh: TransferPoints, caster: RayCaster, layer: Layer, light: BandLight, wo: Float64Array) -> Float32Array:
    """Radiance (P, 3) along wo (P, 3) by one lobe, and the share of light that a diffuse surface gets."""
    vectors = run_to_end(simulate_shadows(mesh, caster, light.table.shape[2], N_RAYS))
    return lobe_radiance(layer, lobes(run_to_end(fit(vectors, _N_LOBES))), mesh.frames, light, wo)


def lobe_radiance(
    layer: Layer, diffuse: Lobes, frames: Float64Array, light: BandLight, wo: Float64Array
) -> Float32Array:
    """The same of points with given diffuse transfer, whose current axes are the rows of frames (P, 3, 3)."""
    white, sent = np.maximum(shade(diffuse, frames, light), np.float32(0.0)), np.zeros((len(wo), 3), np.float32)
    normals, which = np.ascontiguousarray(frames[:, 2], np.float32), np.arange(len(wo))
    gloss, places = low_gloss(layer, light.table.shape[2]), (-wo).astype(np.float32)
    add_gloss(gloss, np.ones(3), which, places, normals, np.zeros(3), light, white, sent)
    return sent


def by_rows(
    frames: Float64Array, basis: GlossBasis, fitted: Lobes, n_rows: int, light: BandLight, wo: Float64Array
) -> Float32Array:
    """Radiance (P, 3) along wo (P, 3), in world axes, of points whose axes are the rows of frames (P, 3, 3), by the
    first n_rows of a basis; fitted: lobes of all its rows (P K, ...)."""
    chosen = np.arange(len(wo) * basis.n_rows).reshape(-1, basis.n_rows)[:, :n_rows].ravel()
    rows = Lobes(fitted.low[chosen], fitted.axes[chosen], fitted.coefficients[chosen])
    views, sent = np.ascontiguousarray(basis.views[:, :, :n_rows]), np.zeros((len(wo), 3), np.float32)
    which, reached = np.arange(len(wo)), np.ones(len(wo), np.float32)
    places = (-wo).astype(np.float32)
    add_gloss_rows(rows, views, which, frames.astype(np.float32), places, np.zeros(3), light, reached, sent)
    return sent


def relative_error(ours: NDArray[np.floating], truth: Float64Array) -> float:
    """relRMSE, both clamped at the truth's `CLAMP_PERCENTILE`; 0 where that is black."""
    if not truth.any():
        return 0.0
    top = np.percentile(truth, CLAMP_PERCENTILE)
    a, b = np.minimum(ours, top), np.minimum(truth, top)
    mean = float(b.mean())
    return float(np.sqrt(np.mean((a - b) ** 2))) / mean if mean > 0.0 else 0.0


def black_share(ours: NDArray[np.floating], truth: Float64Array) -> float:
    """The share of values, 0 to 1, that are black and in truth are not."""
    return float(((ours <= 0.0) & (truth > _LIT * truth.mean())).mean())
