import numpy as np

from engine.scene.mesh import Mesh
from engine.scene.mesh_defects import count_defects
from engine.scene.primitives import PRIMITIVES


def test_sound_meshes_have_no_defects():
    for make in PRIMITIVES.values():
        defects = count_defects(make())
        assert defects.solid.all() and defects.notes() == []


def test_each_kind_is_counted_once():
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
    defects = count_defects(Mesh(vertices, triangles))
    assert (defects.zero_area, defects.sliver, defects.duplicate, defects.flipped) == (1, 1, 1, 2)
    assert defects.solid.tolist() == [True, True, True, False, True]
    assert len(defects.notes()) == 4


def test_three_faces_at_an_edge_are_no_fault_of_winding():
    vertices = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], float)
    triangles = np.array([[0, 1, 2], [1, 0, 3], [1, 0, 4]], np.int32)  # a Y: one one way, two the other
    assert count_defects(Mesh(vertices, triangles)).flipped == 0


def test_a_mesh_without_area_at_all():
    defects = count_defects(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]], np.int32)))
    assert defects.zero_area == 1 and not defects.solid.any()
