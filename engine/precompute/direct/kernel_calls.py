"""Warms up kernels before they are needed, by running the steps of the first picture with a few pixels.

Loading a compiled kernel from disk takes milliseconds, compiling it the first time seconds, and both delay the first
caller. These functions call every kernel that the first picture of any scene calls, through the public functions of the
engine, so that a kernel is compiled for exactly the types it will be called with. They do not depend on one another:
two processes that share a folder of compiled kernels may each compile a part.
"""

from functools import lru_cache
from pathlib import Path

import numpy as np

from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.precompute.direct import _projection_kernels as kernels
from engine.precompute.direct._band_kernels import PackedTile
from engine.precompute.direct.bandstore import BandTile, curve_planes, join_tiles
from engine.precompute.direct.lighting import prepare_lighting
from engine.precompute.direct.near_leaves import no_near_leaves
from engine.precompute.direct.pipeline import COARSE, Placement, Quality, SkyState
from engine.precompute.direct.projection import LayerShape, VisibleLight, project_layer
from engine.scene.description import parse_description
from engine.scene.edges import nearest_centres
from engine.scene.scene_loader import build_scene
from engine.sphere.geodesic import geodesic
from engine.visibility.point_visibility import empty_visibility

_SCENE = {
    "version": 1,
    "name": "warm-up",
    "camera": {"position": [0, 0, 2], "target": [0, 0, 0], "fov_y": 40, "resolution": [8, 8]},
    "object": [
        {"name": "quad", "primitive": "quad"},
        {
            "name": "lamp",
            "primitive": "quad",
            "transform": [0.1, 0, 0, 0, 0, 0.1, 0, 3, 0, 0, 0.1, 1, 0, 0, 0, 1],
            "emission": [1, 1, 1],
        },
    ],
}
_QUALITY = Quality("warm-up", COARSE.stride, 20, COARSE.n_patches, max_level=1)
_LAYER = LayerShape("lambert", (0.0,) * 8, (2, 2))


def warm_up_edges() -> None:
    """Traces a view with several points in some pixels."""
    hits = Placement(_placement().scene, _placement().caster, n_edge_rays=4).hits
    nearest_centres(hits, hits.horizon, np.ones(len(hits.object_ranges), np.float32))


def warm_up_light() -> None:
    """Cuts the light and traces its visibility; builds the sphere's tables as well."""
    placement = _placement()
    sky = SkyState(constant_environment((1.0, 1.0, 1.0)))
    for _ in placement.light(sky, _QUALITY):
        pass
    finest = geodesic(COARSE.max_level)
    assert len(finest.edges) and len(finest.triangle_edges)  # built on first access


def warm_up_footprint() -> None:
    """Computes the footprint of a coarse picture."""
    _placement().footprint(_QUALITY.stride)


def warm_up_projection() -> None:
    """Projects light onto bands, the longest kernel to compile; without light, so that it waits for no other kernel."""
    placement = _placement()
    dark = prepare_lighting(None, None, _QUALITY.tolerance)
    fine, emitters = (empty_visibility(placement.hits, t) for t in (dark.fine_targets, dark.emitter_targets))
    light = VisibleLight(dark, placement.sphere, fine, emitters, no_near_leaves(len(placement.hits.pixel)))
    for _ in project_layer(placement.hits, placement.rows(_QUALITY.stride), light, _LAYER):
        pass


def warm_up_projection_details() -> None:
    """Calls parts of the projection on their own, so that another process need not compile them: a third of it."""
    n_a, n_b = _LAYER.bands
    scratch = kernels._make_scratch(1, 1)
    bands, one = np.zeros((n_a + 2, n_b + 2, 3), np.float32), np.float32(1.0)
    model = MODELS[_LAYER.model]
    kind = model.factors[0].gamma
    optics = kernels.Optics(model.number, np.array(_LAYER.quotient_parameters), kind, kind, n_a, n_b, one, 0)
    corners, frame = np.zeros((1, 3), np.int32), np.eye(3, dtype=np.float32)
    rows, tree = np.zeros(1, np.int64), np.zeros((0, 6), np.float32)
    kernels._split_curved(corners, rows, tree, 0, one, one, optics, frame, one, one, one, scratch)
    kernels.share_out(bands, scratch.colours, 0, scratch.spots, one, one)
    encoded = PackedTile(*_empty_tile(n_a))
    cells, maxima = np.zeros((n_a, n_b), np.float32), np.zeros(n_a, np.float32)
    kernels.encode_bands(bands[:n_a, :n_b], one, cells, maxima, encoded, 0, 0)


def _empty_tile(n_a: int) -> tuple[np.ndarray, ...]:
    """The arrays of an encoded tile of one unlit point."""
    runs = np.zeros((1, n_a), np.uint8)
    return np.zeros(1, np.float32), runs, runs.copy(), np.zeros(1, np.int64), np.zeros(2 * n_a, np.uint32)


def warm_up_contraction() -> None:
    """Contracts empty bands to a picture and to the transport of one curve."""
    n_a, _ = _LAYER.bands
    store = join_tiles(_LAYER.bands, [BandTile(0, *_empty_tile(n_a))])
    curves = np.ones((n_a, 3)), np.ones((n_a, 3))
    store.radiance(*curves)
    curve_planes(store, 0, curves, 1.0, "half")


@lru_cache(maxsize=1)
def _placement() -> Placement:
    return Placement(build_scene(parse_description(_SCENE, "warm-up"), Path("warm-up")))
