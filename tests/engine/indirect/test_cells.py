"""How fine cells are."""

import numpy as np
import pytest

from engine.indirect._ray_kernels import EVEN, GLOSSY, MATT, SHARP
from engine.indirect.cells import Cells, Rays
from tests.engine.indirect.small_scenes import placed, placement_of

SIZE = 0.1
FLOOR = {"name": "floor", "primitive": "quad", "transform": [2, 0, 0, 0, 0, 0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 1]}
POST = {"name": "post", "primitive": "cube", "transform": placed(0.9, 0.5, 0.9, 0.1, 1.0, 0.1)}


@pytest.mark.parametrize(
    ("height", "mirrored", "size"),
    # A cell takes at most an eighth of a mirrored ray, but is between half and four times as large as others.
    # In the middle of a highlight it may be an eighth as large. It takes at most half of a matt point's ray.
    [
        (0.02, EVEN, SIZE),
        (9.0, MATT, SIZE),
        (0.11, MATT, SIZE / 2),
        (0.02, MATT, SIZE / 8),
        (0.1, GLOSSY, SIZE / 2),
        (1.0, GLOSSY, SIZE),
        (2.0, GLOSSY, 2 * SIZE),
        (9.0, GLOSSY, 4 * SIZE),
        (0.1, SHARP, SIZE / 8),
        (0.25, SHARP, SIZE / 4),
        (1.0, SHARP, SIZE),
    ],
)
def test_what_is_near_by_is_in_small_cells(height, mirrored, size):
    placement = placement_of([FLOOR, POST])
    cells = Cells(placement.scene, placement.caster, SIZE)
    x, z = np.meshgrid(np.linspace(-0.8, 0.8, 401), np.linspace(-0.8, 0.8, 401))
    origins = np.stack([x.ravel(), np.full(x.size, height), z.ravel()], axis=1).astype(np.float32)
    origins -= placement.scene.origin.astype(np.float32)
    down = np.tile(np.array([0.0, -1.0, 0.0], np.float32), (x.size, 1))
    seen, _ = cells.hit_by(Rays(origins, down, np.ones(x.size, bool)), mirrored=np.full(x.size, mirrored, np.uint8))
    assert (1.6 / size) ** 2 <= len(np.unique(seen)) <= (1.6 / size + 2) ** 2
