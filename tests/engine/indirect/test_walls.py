"""A wall without thickness to speak of lets no light through, though what stands on both sides is of one piece."""

from engine.indirect.solver import STILL
from tests.engine.indirect.small_scenes import matt, placed, placement_of, solve

# Floor and back of a shed without a front, seen through it, and a wall of 2 mm between its halves, one with a lamp.
# What leaves through the front meets nothing.
FLOOR = {"name": "floor", "primitive": "quad", "transform": [2, 0, 0, 0, 0, 0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 1]}
BACK = {"name": "back", "primitive": "quad", "transform": placed(0, 0.5, -1, 2, 1, 1)}
WALL = {"name": "wall", "primitive": "cube", "transform": placed(0.013, 0.5, 0, 0.002, 1.02, 2.02)}
LAMP = {"name": "lamp", "primitive": "cube", "emission": [50.0] * 3, "transform": placed(0.4, 0.1, -0.4, 0.1)}
LAYERS = [matt(0, 0.7), matt(1, 0.7), matt(2, 0.7)]


def test_behind_a_thin_wall_it_is_dark():
    placement = placement_of([FLOOR, BACK, WALL, LAMP], eye=(0.0, 0.7, 2.6), target=(0.0, 0.3, -1.0))
    lit = solve(placement, LAYERS, 4, STILL).picture(LAYERS).max(axis=1)
    hits = placement.hits
    x = hits.position[:, 0] + placement.scene.origin[0]
    behind = x < 0.0
    assert behind.sum() > 50
    assert lit[x > 0.1].min() > 0.0
    assert lit[behind].max() <= 1e-6 * lit.max()
