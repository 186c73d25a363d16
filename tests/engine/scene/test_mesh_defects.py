"""Defects of meshes: what is left out, what is counted, and holes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from engine.scene.mesh import Mesh
from engine.scene.mesh_defects import describe_holes, find_defects
from engine.scene.primitives import PRIMITIVES, cube, sphere

TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


def test_sound_meshes_have_no_defects() -> None:
    for make in PRIMITIVES.values():
        defects = find_defects(make())
        assert defects.sound.all() and defects.notes() == []


def test_each_kind_is_counted_once() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0.5, 1e-7, 0]])
    triangles = np.array(
        [
            [0, 1, 2],  # sound
            [1, 3, 2],  # sound: its edge with the first runs the other way
            [1, 2, 0],  # the first one again
            [1, 1, 3],  # a doubled corner: no area
            [0, 1, 4],  # a sliver, 1e-7 high; it runs along 0→1 as the first does: one of them is flipped
        ],
        np.int32,
    )
    defects = find_defects(Mesh(vertices, triangles))
    assert (defects.zero_area, defects.sliver, defects.repeated, defects.flipped) == (1, 1, 1, 2)
    assert defects.sound.tolist() == [True, True, False, False, True]
    assert len(defects.notes()) == 4


def test_faces_repeat_by_position_and_both_ways_only_where_that_makes_no_difference() -> None:
    vertices = np.concatenate([TRIANGLE, TRIANGLE])
    same, turned = np.array([[0, 1, 2], [4, 5, 3]], np.int32), np.array([[0, 1, 2], [3, 5, 4]], np.int32)
    assert find_defects(Mesh(vertices, same)).sound.tolist() == [True, False]
    assert find_defects(Mesh(vertices, turned)).sound.tolist() == [True, False]
    assert find_defects(Mesh(vertices, turned), has_two_sides=False).sound.all()
    normals = np.repeat([[0.0, 0, 1], [0, 0, -1]], 3, axis=0)
    assert find_defects(Mesh(vertices, turned, normals)).sound.all()
    uvs = np.zeros((2, 3, 2), np.float32)
    assert find_defects(Mesh(vertices, turned, None, uvs)).sound.all()  # another image may be on the back
    assert find_defects(Mesh(vertices, same, normals, uvs)).sound.tolist() == [True, False]


def test_three_faces_at_an_edge_are_no_fault_of_winding() -> None:
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], float)
    triangles = np.array([[0, 1, 2], [1, 0, 3], [1, 0, 4]], np.int32)  # a Y: one one way, two the other
    assert find_defects(Mesh(vertices, triangles)).flipped == 0


def test_a_mesh_without_area_at_all() -> None:
    defects = find_defects(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32)))
    assert defects.zero_area == 1 and not defects.sound.any()


def test_holes_are_loops_of_open_edges() -> None:
    assert describe_holes(sphere()) == []  # its seam is one of textures alone
    whole = cube()
    assert describe_holes(whole) == []  # the sides have vertices of their own, at equal positions
    front_and_back = [0, 1, 6, 7]
    open_twice = replace(whole, triangles=np.delete(whole.triangles, front_and_back, axis=0), uvs=None)
    assert describe_holes(open_twice) == ["the surface is not closed: 2 holes, 8 open edges"]
    assert describe_holes(Mesh(TRIANGLE, np.array([[0, 1, 2]], np.int32))) == [
        "the surface is not closed: 1 hole, 3 open edges"
    ]
