"""Projects light and visibility onto the bands of a layer's curves, tile by tile [BenArtzi07, ch. 4]."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from engine.core.threads import map_ahead, n_threads, pool
from engine.material import MODELS
from engine.material.layer import frame_of
from engine.precompute.direct import _projection_kernels as kernels
from engine.precompute.direct._band_kernels import PackedTile
from engine.precompute.direct.bandstore import BandTile
from engine.precompute.direct.lighting import Lighting
from engine.precompute.direct.near_leaves import NearLeaves
from engine.scene.primary_hits import PrimaryHits
from engine.visibility.point_visibility import Visibility

TILE = 256
TRIM = 4e-3


@dataclass(frozen=True)
class LayerShape:
    """What the transport of a layer depends on: model, parameters of the quotient, bands (J, K); K = 1 for a single
    curve."""

    model: str
    quotient_parameters: tuple[float, ...]
    bands: tuple[int, int]


@dataclass(frozen=True)
class VisibleLight:
    """A lighting with the visibility of its lights: sphere bits, fine sky lights, emitters' leaves."""

    lighting: Lighting
    sphere: Visibility
    fine: Visibility
    emitters: Visibility
    near: NearLeaves


def project_layer(
    hits: PrimaryHits, rows: np.ndarray, light: VisibleLight, layer: LayerShape, skip: frozenset[int] = frozenset()
) -> Iterator[BandTile]:
    """Transport of one layer at the given rows of `hits`. Yields tiles of 256 points in order; threads compute one tile
    each at a time.

    skip: indices of tiles that the caller already has.
    """
    tiles = [(begin, rows[begin : begin + TILE]) for i, begin in enumerate(range(0, len(rows), TILE)) if i not in skip]

    def project(tile: tuple[int, np.ndarray]) -> BandTile:
        begin, covered = tile
        return project_points(hits, covered, light, layer, begin)

    with pool() as threads:
        yield from map_ahead(threads, project, tiles, 2 * n_threads())


def project_points(hits: PrimaryHits, rows: np.ndarray, light: VisibleLight, layer: LayerShape, begin: int) -> BandTile:
    """Transport of one tile; `begin` is the index of its first point among the layer's points."""
    n_a, n_b = layer.bands
    rows = np.asarray(rows, np.int32)  # the kernel is compiled for int32
    n_points = len(rows)
    model = MODELS[layer.model]
    kind_a = model.factors[0].gamma
    kind_b = model.factors[1].gamma if len(model.factors) > 1 else kind_a
    encoded = PackedTile(
        np.empty(n_points, np.float32),
        np.zeros((n_points, n_a if n_b > 1 else 0), np.uint8),
        np.zeros((n_points, n_a if n_b > 1 else 0), np.uint8),
        np.empty(n_points, np.int64),
        np.empty(n_points * n_a * n_b, np.uint32),
    )
    q = np.array(model.bind_parameters(np.asarray(layer.quotient_parameters, np.float64)))
    tolerance = np.float32(light.lighting.tolerance)
    optics = kernels.Optics(model.number, q, kind_a, kind_b, n_a, n_b, tolerance, model.colours_number(q))
    hits = hits.in_frame(frame_of(layer.quotient_parameters))
    surface = kernels.ViewedPoints(hits.position, hits.tangent, hits.normal, hits.wo)
    near = light.near
    bits = kernels.Bits(light.sphere.bits, light.fine.bits, light.emitters.bits, near.start, near.node, near.delta)
    n_values = kernels.project_tile(
        rows, surface, light.lighting.sky, light.lighting.emitters, bits, optics, np.float32(TRIM), encoded
    )
    return BandTile(begin, *encoded[:-1], encoded.values[:n_values].copy())
