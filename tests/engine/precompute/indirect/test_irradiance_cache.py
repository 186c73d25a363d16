"""How fine cells are."""

import numpy as np
import pytest

from engine.precompute.indirect._ray_kernels import DIFFUSE, EVEN, GLOSSY, SHARP
from engine.precompute.indirect.irradiance_cache import IrradianceCache, Rays
from tests.engine.precompute.indirect.small_scenes import placed, placement_of

SIZE = 0.1
FLOOR = {"name": "floor", "primitive": "quad", "transform": [2, 0, 0, 0, 0, 0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 1]}
POST = {"name": "post", "primitive": "cube", "transform": placed(0.9, 0.5, 0.9, 0.1, 1.0, 0.1)}


@pytest.mark.parametrize(
    ("height", "mirrored", "size"),
    # A cell takes at most an eighth of a mirrored ray, but is between half and four times as large as others.
    # In the middle of a highlight it may be an eighth as large. It takes at most half of a matt point's ray.
    [
        (0.02, EVEN, SIZE),
        (9.0, DIFFUSE, SIZE),
        (0.11, DIFFUSE, SIZE / 2),
        (0.02, DIFFUSE, SIZE / 8),
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
    cells = IrradianceCache(placement.scene, placement.caster, SIZE)
    x, z = np.meshgrid(np.linspace(-0.8, 0.8, 401), np.linspace(-0.8, 0.8, 401))
    origins = np.stack([x.ravel(), np.full(x.size, height), z.ravel()], axis=1).astype(np.float32)
    origins -= placement.scene.origin.astype(np.float32)
    down = np.tile(np.array([0.0, -1.0, 0.0], np.float32), (x.size, 1))
    seen, _ = cells.records_and_hits(
        Rays(origins, down, np.ones(x.size, bool)), mirrored=np.full(x.size, mirrored, np.uint8)
    )
    assert (1.6 / size) ** 2 <= len(np.unique(seen)) <= (1.6 / size + 2) ** 2


def straight_down(placement, size: float, height: float = 2.0, reach: float = 0.3, n: int = 401):
    """The cell (R,) and the place (R, 3) that each of n² rays hits."""
    cells = IrradianceCache(placement.scene, placement.caster, size)
    x, z = np.meshgrid(np.linspace(-reach, reach, n), np.linspace(-reach, reach, n))
    places = np.stack([x.ravel(), np.full(x.size, height), z.ravel()], axis=1)
    down = np.tile(np.array([0.0, -1.0, 0.0], np.float32), (len(places), 1))
    origins = (places - placement.scene.origin).astype(np.float32)
    seen, found = cells.records_and_hits(Rays(origins, down, np.ones(len(places), bool)))
    places[:, 1] -= found.distance
    return seen, places


@pytest.mark.parametrize(("angle", "middle", "thickness"), [(0, 0, 0.002), (0, 0.013, 0.04), (35, -0.02, 0.002)])
def test_no_cell_lies_on_both_sides_of_a_wall(angle, middle, thickness):
    # A wall 0.2 m high stands on the floor, which is one object; the cells are wider than it is thick.
    cosine, sine = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    wall = [cosine * thickness, 0, sine * 3, middle * cosine, 0, 0.2, 0, 0.1]
    wall += [-sine * thickness, 0, cosine * 3, -middle * sine, 0, 0, 0, 1]
    seen, places = straight_down(
        placement_of([FLOOR, {"name": "wall", "primitive": "cube", "transform": wall}, POST]), SIZE
    )
    away = places[:, 0] * cosine - places[:, 2] * sine - middle
    on_floor = places[:, 1] < 0.01
    left, right = (np.unique(seen[on_floor & side]) for side in (away < 0.0, away > 0.0))
    assert len(left) > 20 and len(right) > 20
    assert not len(np.intersect1d(left, right))


def test_boards_of_a_shelf_do_not_share_cells(tmp_path):
    # Two boards of one mesh face up, the upper half as large, as far apart as half a cell is wide.
    board = "v {0} {1} {0}\nv {0} {1} -{0}\nv -{0} {1} -{0}\nv -{0} {1} {0}\n"
    faces = "f 1 2 3\nf 1 3 4\nf 5 6 7\nf 5 7 8\n"
    (tmp_path / "shelf.obj").write_text(board.format(0.4, 0.0) + board.format(0.2, SIZE / 2) + faces)
    seen, places = straight_down(placement_of([{"name": "shelf", "mesh": "shelf.obj"}, POST], folder=tmp_path), SIZE)
    above = places[:, 1] > SIZE / 4
    assert above.any() and not above.all()
    assert not len(np.intersect1d(seen[above], seen[~above]))
