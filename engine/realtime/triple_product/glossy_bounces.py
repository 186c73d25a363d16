"""Glossy reflection in indirect light: what gloss sends to other surfaces, and what it reflects of them to the camera.

`irradiance_bounces` takes every reflection for an even one of equivalent albedo. Two corrections follow each surface's
own lobe, both by the rays that gathering points have traced already:

- **The second bounce.** Gloss reflects direct light towards each gathering point whose ray meets it: a caustic. The
  difference to an even reflection is added to the first bounce of light. An eighth of the rays is evaluated: after
  four bounces a Cornell box with a glossy wall is 0.29 of 255 off paths, by all rays 0.25 and by albedos alone 0.45.
  Parts that are stratified matter: every fourth ray of all leaves 0.39. Sharp gloss keeps its albedo, as few rays meet
  its highlights.
- **Towards the camera.** Blunt gloss reflects what the rays of a gathering point meet, each as a small light of its
  own; the reflected radiance is then interpolated as irradiance is. Rays of each pixel were rejected: four are noisier
  than the equivalent albedo is wrong (*room* changes by 2.78 of 255 when Placement's picture comes, by 2.61 with
  albedos), and sixteen take three times as long as the rest of the picture. Sharp gloss needs them (`view_radiance`).
"""

from __future__ import annotations

from collections.abc import Generator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.core.threads import even_parts, n_threads, on_threads
from engine.precompute.indirect.direction_patterns import cosine_tables
from engine.realtime.core.shading_points import ShadingPoints
from engine.realtime.triple_product import _glossy_bounce_kernels as kernels
from engine.realtime.triple_product._incident_kernels import child_at
from engine.realtime.triple_product._slice_kernels import Tables
from engine.realtime.triple_product.incident import Incident, hemisphere
from engine.realtime.triple_product.irradiance_bounces import Around, Bounces, Exchange, Gathering

Float32Array = NDArray[np.float32]
_N_PARTS = 8  # of a gathering point's rays, of which one is evaluated for what gloss sends there
_N_COEFFICIENTS = 32
_AT_ONCE = 1024  # gathering points a piece and thread: up to 30 ms


class GlossyTerm(NamedTuple):
    """A glossy term of an object's reflection: its slices, their equivalent albedo (3,) and the mean (3,) of its
    maps."""

    i_object: int
    tables: Tables
    albedo: Float32Array
    factor: Float32Array

    @property
    def key(self) -> tuple[object, ...]:
        """Differs for terms that reflect differently."""
        return self.i_object, self.tables.serial, self.factor.tobytes()


def second_bounce(
    bounces: Bounces, points: ShadingPoints, incident: Incident, term: GlossyTerm
) -> Generator[None, None, list[Float32Array]]:
    """Find, for each exchange of light, by how much the irradiance (G, 3) that gathering points receive of once
    reflected light changes if a term of gloss reflects by its own lobe, in pieces."""
    corrections = []
    for exchange in bounces.exchanges:
        found = np.empty((len(exchange.gathering.points), 3), np.float32)
        for start in range(0, len(found), _AT_ONCE * n_threads()):
            rows = range(start, min(start + _AT_ONCE * n_threads(), len(found)))
            _gather_gloss(exchange.gathering, rows, points, incident, term, found)
            yield
        corrections.append(found)
    return corrections


def _gather_gloss(
    gathering: Gathering, rows: range, points: ShadingPoints, incident: Incident, term: GlossyTerm, found: Float32Array
) -> None:  # fmt: skip
    """Find the corrections of one term in some rows of found (G, 3)."""
    albedo, starts, stops = term.albedo * term.factor, *even_parts(len(rows))

    def part(start: int, stop: int) -> None:
        kernels.gather_gloss(
            rows.start + start, rows.start + stop, gathering.points, gathering.ends, _N_PARTS, points.i_object,
            term.i_object, albedo, term.factor, _N_COEFFICIENTS, points.position, points.frames, incident.slot,
            incident.stored, term.tables, found,
        )  # fmt: skip

    on_threads(part, starts, stops)


def reflect_indirect(
    bounces: Bounces, points: ShadingPoints, which: NDArray[np.int64], camera_position: Float32Array,
    sent: Float32Array, tables: Tables,
) -> Float32Array:  # fmt: skip
    """Radiance (N, 3) that points (N,) reflect to the camera, by slices, of the radiance (S, 3) that all points send;
    interpolated between gathering points."""
    found = np.zeros((len(points), 3), np.float32)
    for exchange in bounces.exchanges:
        _reflect_exchanged(exchange, points, which, camera_position, sent, tables, found)
    return found[which]


def _reflect_exchanged(
    exchange: Exchange, points: ShadingPoints, which: NDArray[np.int64], camera_position: Float32Array,
    sent: Float32Array, tables: Tables, found: Float32Array,
) -> None:  # fmt: skip
    """Write to found (S, 3) what those points (N,) reflect that belong to an exchange."""
    is_requested = np.zeros(len(points), bool)
    is_requested[which] = True
    own = np.flatnonzero(is_requested[exchange.rows])
    gathering, around = exchange.gathering, exchange.around
    used, beside = np.unique(around.beside[own], return_inverse=True)
    # A gathering point of another object beside these reflects by these slices as well: its rays met the same light.
    radiance = np.empty((len(used), 3), np.float32)

    def part(start: int, stop: int) -> None:
        kernels.reflect_gathered(
            start, stop, used.astype(np.int64), gathering.points, gathering.ends, gathering.pattern,
            *_ray_triangles(gathering.ends.shape[1]), camera_position, points.position, points.frames, sent, tables,
            radiance,
        )  # fmt: skip

    on_threads(part, *even_parts(len(used)))
    numbers = np.asarray(beside.reshape(around.beside[own].shape), np.int32)
    found[exchange.rows[own]] = Around(numbers, around.share[own], around.error[own]).between(radiance)


@lru_cache(maxsize=2)
def _ray_triangles(n_rays: int) -> tuple[NDArray[np.int16], Float32Array]:
    """The upper triangle (64, R) of each ray of each pattern, and the solid angle (2560,) that a ray in an upper
    triangle represents: π / R over the cosine [its density is cos θ / π]."""
    half, directions = hemisphere(), cosine_tables(n_rays)
    places = np.empty(directions.shape[:2], np.int16)
    for k, pattern in enumerate(directions.astype(np.float64)):
        # The third axis of patterns is the normal, of frames the second.
        for r, (x, z, y) in enumerate(pattern.tolist()):
            places[k, r] = child_at(x, y, z, half.children) >> 2
    return places, (np.pi / n_rays / half.cosine).astype(np.float32)
