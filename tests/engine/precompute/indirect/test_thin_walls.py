"""A wall without thickness to speak of lets no light through, though what stands on both sides is of one piece."""

import numpy as np
import pytest

from engine.material import MODELS, make_layer
from engine.precompute.indirect.indirect_layers import indirect_layer
from engine.precompute.indirect.sampling_settings import STILL
from tests.engine.precompute.indirect.small_scenes import matt, placed, placement_of, solve

# Floor and back of a shed without a front, seen through it, and a wall of 2 mm between its halves, one with a lamp.
# What leaves through the front meets nothing.
FLOOR = {"name": "floor", "primitive": "quad", "transform": [2, 0, 0, 0, 0, 0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 1]}
BACK = {"name": "back", "primitive": "quad", "transform": placed(0, 0.5, -1, 2, 1, 1)}
WALL = {"name": "wall", "primitive": "cube", "transform": placed(0.013, 0.5, 0, 0.002, 1.02, 2.02)}
LAMP = {"name": "lamp", "primitive": "cube", "emission": [50.0] * 3, "transform": placed(0.4, 0.1, -0.4, 0.1)}
# In the lamp's half: what it throws lands on the floor up to the wall.
BALL = {"name": "ball", "primitive": "sphere", "smooth": True, "transform": placed(0.2, 0.15, -0.1, 0.2)}
LAYERS = [matt(0, 0.7), matt(1, 0.7), matt(2, 0.7)]
MIRROR = indirect_layer(3, make_layer(MODELS["rough_conductor"], {"alpha": 0.2}), (64, 16))


@pytest.mark.parametrize("throws", [False, True])
def test_behind_a_thin_wall_it_is_dark(throws):
    objects, layers = (
        ([FLOOR, BACK, WALL, BALL, LAMP], [*LAYERS, MIRROR]) if throws else ([FLOOR, BACK, WALL, LAMP], LAYERS)
    )
    placement = placement_of(objects, eye=(0.0, 0.7, 2.6), target=(0.0, 0.3, -1.0))
    found = solve(placement, layers, 4, STILL)
    lit = found.picture(layers).max(axis=1)
    hits = placement.hits
    x = hits.position[:, 0] + placement.scene.origin[0]
    behind = x < 0.0
    assert behind.sum() > 50
    assert lit[x > 0.1].min() > 0.0
    assert lit[behind].max() <= 4e-6 * lit.max()  # 1.5e-3 of it where photons count through the wall
    if throws:  # photons come down on the other side of the wall within the reach of points on this side
        photons = found.points.photons
        beside = (photons.positions[:, 0] + placement.scene.origin[0] < 0.05) & (photons.objects == 0)
        assert np.count_nonzero(beside) > 100
