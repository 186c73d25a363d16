"""Estimates the main memory that an editor holds beside the transport: of indirect light, of what is frozen of it while
an object is edited, of pictures of each light for its mix, and of a sky that may turn.

All but rows and pictures is made of the few blocks of a trial, by what the editor makes it with. Nearly all grows with
the number of gather points; what is stored of the irradiance cache records grows with these. Rows have as many terms as
there may be on average: making them for the trial took a fifth of a plan's time.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Sequence
from typing import NamedTuple

import numpy as np

from engine.core.generators import map_steps
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.direct.relight import MEAN_TERMS, MOST_ROW_BYTES, layer_reflection
from engine.precompute.indirect.frozen_light import SelectedCurve
from engine.precompute.indirect.gather import object_of_rows
from engine.precompute.indirect.gather_polynomial import GatherPolynomial
from engine.precompute.indirect.indirect_layers import IndirectLayer
from engine.precompute.indirect.indirect_light import IndirectLight
from engine.precompute.indirect.relighting import IndirectRelighting, SceneLight, SourceLighting

# Of a point of rows: its range and scale, and what its exact picture adds. A term has its number and its channels.
_POINT_BYTES, _REST_BYTES = 12, 12
# Of all pictures of single lights: none are made where they would take more.
MOST_PICTURE_BYTES = 512e6


class TrialScale(NamedTuple):
    """How many times as many gather points, records, photons and rays between records the whole picture has."""

    points: float
    records: float
    photons: float
    record_rays: float


def sky_row_bytes(placement: Placement, sky: SkyState, layers: Iterable[tuple[int, Layer]]) -> int:
    """Memory of the rows by which layers, each with its object, are relit under a sky that turns."""
    if sky.environment is None:
        return 0
    sizes = [(len(placement.rows_of(i)), layer_reflection(layer).curve_a.shape[1]) for i, layer in layers]
    rows = sum(_row_bytes(n, n_channels) for n, n_channels in sizes)
    return min(rows, round(MOST_ROW_BYTES)) + sum(n for n, _ in sizes) * _REST_BYTES


def mix_bytes(placement: Placement, objects: Iterable[int], n_lights: int) -> int:
    """Memory of the pictures by which so many lights are mixed, of layers by their objects; 0 where none are made."""
    wanted = light_picture_bytes(sum(len(placement.rows_of(i)) for i in objects), n_lights)
    return wanted if n_lights and wanted <= MOST_PICTURE_BYTES else 0


def light_picture_bytes(n_points: int, n_lights: int) -> int:
    """Memory of pictures of so many lights, each alone; of what the exact picture has besides, and of the two sums that
    a mix keeps. n_points: of all layers."""
    return 12 * n_points * (n_lights + 3)


def _row_bytes(n_points: int, n_channels: int = 3) -> int:
    return n_points * (_POINT_BYTES + MEAN_TERMS * 2 * (1 + n_channels))


def indirect_bytes(
    placement: Placement, sky: SkyState, found: IndirectLight, layers: Sequence[IndirectLayer],
    curves: Sequence[SelectedCurve], scale: TrialScale,
) -> Generator[None, None, float]:  # fmt: skip
    """Memory of indirect light, of which `found` is a trial, while the one of these curves is edited for which most is
    frozen. A generator of steps."""
    points, light = found.points, found.light
    of_photons, of_rays = sum(array.nbytes for array in points.photons), light.records_hit.nbytes
    fixed = found.n_bytes - points.n_bytes - light.n_bytes  # the table has room for the most records
    # What is frozen, for the curve of which it is most.
    polynomial, most = GatherPolynomial(found), 0
    for curve in curves:
        freezing = polynomial.freeze(layers, layers[curve.layer].i_object, (curve,))
        frozen = yield from map_steps(freezing, lambda early: None)
        most = max(most, frozen.n_bytes)
    # What each source gives, and what gloss mirrors of a sky that turns.
    lighting = SourceLighting(found, placement.scene, sky)
    resting = SceneLight(sky, placement.scene.emission)
    relighting = IndirectRelighting(
        lighting, resting, layers, lambda outgoing: polynomial.reflect(layers, outgoing)
    )  # fmt: skip
    of_points = points.n_bytes - of_photons + most + polynomial.n_bytes
    if (yield from relighting.reflect_sources()):
        objects = object_of_rows(points.hits, points.samples.points)
        of_points += sum(_row_bytes(int(np.count_nonzero(objects == each.i_object))) for each in layers)
    of_points += relighting.n_bytes - lighting.n_bytes
    of_records = light.n_bytes - of_rays + scale.record_rays * of_rays
    return (
        fixed + lighting.n_bytes + scale.points * of_points + scale.photons * of_photons + scale.records * of_records
    )  # fmt: skip
