"""Faces that lie on others in one plane: which are lifted, by how much, and that pictures have no flecks."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from engine.precompute.direct.pipeline import Placement
from engine.scene.coplanar_faces import LIFT, lift_overlapping_faces
from engine.scene.mesh import Mesh
from engine.scene.scene_loader import load_scene
from tests.scene_text import camera, environment, material, placed

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)


def quad(
    where: tuple[float, float, float] = (0, 0, 0), side: float = 1.0, faces: object = ((0, 1, 2), (0, 2, 3))
) -> Mesh:
    return Mesh(side * CORNERS + where, np.array(faces, np.int32))


def heights(
    *meshes: Mesh, looks: tuple[int, ...] | None = None, moves: tuple[bool, ...] | None = None
) -> list[list[float]]:
    """Of each mesh, in lifts of a side of 1, by how much each face is lifted."""
    n = len(meshes)
    found = lift_overlapping_faces(meshes, moves or (True,) * n, looks or range(n))
    return [
        (np.round((new.vertices[new.triangles] - old.vertices[old.triangles])[..., 2].mean(axis=1) / LIFT, 6)).tolist()
        for new, old in zip(found, meshes, strict=True)
    ]


def test_the_later_face_lies_on_the_earlier_ones() -> None:
    other = quad(faces=((0, 1, 3), (1, 2, 3)))  # the other diagonal
    assert heights(quad(), other, quad((0.5, 0.5, 0))) == [[0, 0], [1, 1], [2, 2]]
    # Of another size: a ten-thousandth of its own.
    assert heights(quad(), quad((0.2, 0.2, 0), 0.5)) == [[0, 0], [0.5, 0.5]]
    assert heights(quad(), quad((0.2, 0.2, 1e-3))) == [[0, 0], [0, 0]]  # above, not in its plane
    assert heights(quad(), quad((1, 0, 0)), quad((0, 1, 0))) == [[0, 0]] * 3  # beside it
    one = Mesh(CORNERS, np.array([[0, 1, 2], [0, 1, 3]], np.int32))
    assert heights(one, looks=(-1,)) == [[0, 1]] and heights(one) == [[0, 0]]  # of one mesh, with images and without


def test_faces_that_may_not_move_or_look_alike_stay() -> None:
    two = quad(), quad((0.5, 0.5, 0))
    assert heights(*two, looks=(0, 0)) == [[0, 0], [0, 0]]
    assert heights(*two, looks=(-1, -1)) == [[0, 0], [1, 1]]  # with images
    assert heights(*two, moves=(True, False)) == [[0, 0], [0, 0]]


def test_faces_of_opposite_directions_are_lifted_where_both_are_seen() -> None:
    turned = quad(faces=((2, 1, 0), (3, 2, 0)))
    assert heights(quad(), turned) == [[0, 0], [1, 1]]  # towards the front of the first
    low, high = CORNERS, CORNERS + (0, 0, 1)
    sides = [[a, b, b + 4, a + 4] for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))]
    fours = [[3, 2, 1, 0], [4, 5, 6, 7], *sides]
    box = Mesh(
        np.concatenate([low, high]), np.array([f for a, b, c, d in fours for f in ((a, b, c), (a, c, d))], np.int32)
    )
    inward = Mesh(box.vertices, box.triangles[:, ::-1])
    floor = quad((-1, -1, 0), 3.0)
    for each in (box, inward):  # its bottom on a floor
        assert heights(floor, each) == [[0.0] * 2, [0.0] * 12] and heights(each, floor) == [[0.0] * 12, [0.0] * 2]


def test_many_faces_of_one_plane_are_told_apart() -> None:
    side = np.linspace(0.0, 1.0, 41)
    x, y = (each.ravel() for each in np.meshgrid(side, side))
    first = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    faces = np.concatenate([np.stack([first, first + 1, first + 42], 1), np.stack([first, first + 42, first + 41], 1)])
    rug = Mesh(np.stack([x, y, 0 * x], axis=1), faces.astype(np.int32))
    assert heights(rug) == [[0.0] * 3200]
    lifted = heights(rug, quad((0.525, 0.525, 0), 0.25), quad((-1, -1, 0), 3.0))
    assert lifted[1] == [0.25, 0.25] and lifted[2] == [6.0, 6.0]  # three metres wide, on two others
    above = np.array(heights(quad((-1, -1, 0), 3.0), rug)[1])
    assert (above == 1.0).all()


@pytest.mark.parametrize("kind", ["unlike", "turned"])
def test_a_card_in_a_wall_has_no_flecks(scene_file: Callable[..., Path], mesh_file: Callable, kind: str) -> None:
    faces = "f 1 2 4\nf 2 3 4\n" if kind == "unlike" else "f 4 2 1\nf 4 3 2\n"
    mesh_file("card.obj", "v -0.3 -0.2 0\nv 0.4 -0.3 0\nv 0.3 0.4 0\nv -0.4 0.3 0\n" + faces)
    turn = "0.8,0,0.6,0.1, 0,1,0,0.2, -0.6,0,0.8,0.3, 0,0,0,1"  # so that numbers are round nowhere
    red, blue = (material(f'model = "lambert", albedo = {each}') for each in ("[0.8, 0.1, 0.1]", "[0.1, 0.1, 0.8]"))
    view = camera((1.5, 0.3, 2.4), 30, (96, 96), (0.1, 0.2, 0.3)) + environment()
    path = scene_file(placed("wall", "quad", turn, red) + placed("card", "card.obj", turn, blue), view)
    seen = Placement(load_scene(path)).hits.object_image
    # The card's hits are one piece: each has at least two neighbours above, below or beside it.
    inside = seen == 1
    around = sum(np.roll(inside, step, axis) for step in (-1, 1) for axis in (0, 1))
    assert np.count_nonzero(inside) > 500 and not (inside & (around < 2)).any() and not (~inside & (around > 2)).any()
