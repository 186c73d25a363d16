"""Images on meshes without texture coordinates: each side of the box shows them once, upright, whatever the placing."""

from __future__ import annotations

import numpy as np
import pytest

from engine.scene.mesh import Mesh, place_copies
from engine.scene.primitives import cube
from engine.scene.surface_uvs import box_frame, box_uvs

# Of each side of the cube from 0 to 1, by its normal, the corner that is at its upper right as one looks at it. Up is
# +Y; on the top it is -Z, on the bottom +Z.
UPPER_RIGHT = {
    (1, 0, 0): (1, 1, 0), (-1, 0, 0): (0, 1, 1), (0, 0, 1): (1, 1, 1), (0, 0, -1): (0, 1, 0), (0, 1, 0): (1, 1, 0),
    (0, -1, 0): (1, 0, 1),
}  # fmt: skip
TURN = np.array([[0.0, -1.0, 0.0, 3.0], [1.0, 0.0, 0.0, -2.0], [0.0, 0.0, 1.0, 9.0], [0.0, 0.0, 0.0, 1.0]])
STRETCH, MIRROR = np.diag([2.0, 0.5, 7.0, 1.0]), np.diag([-1.0, 1.0, 1.0, 1.0])


def uvs_of(mesh: Mesh, transform: np.ndarray, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Of all corners of a placed mesh, as a scene finds them, in the order of the mesh's own corners."""
    placed = place_copies(mesh, transform[None])
    frame = box_frame(mesh, transform, np.array(origin))
    corners = placed.vertices[placed.triangles] - origin
    uvs = box_uvs(corners, np.repeat(frame[None], len(corners), axis=0))
    return uvs[:, ::-1] if np.linalg.det(transform[:3, :3]) < 0.0 else uvs


def test_each_side_shows_the_image_once_and_upright() -> None:
    mesh = cube()
    uvs, corners = uvs_of(mesh, np.eye(4)), mesh.vertices[mesh.triangles] + 0.5
    assert np.allclose(uvs.min(axis=(0, 1)), 0.0) and np.allclose(uvs.max(axis=(0, 1)), 1.0)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for normal, corner in UPPER_RIGHT.items():
        here = (normals @ normal > 0.9)[:, None] & np.isclose(corners, corner).all(axis=2)
        assert here.any() and np.allclose(uvs[here], (1.0, 1.0)), normal


@pytest.mark.parametrize("transform", [TURN, STRETCH, MIRROR, TURN @ STRETCH @ MIRROR])
def test_an_image_goes_with_its_object(transform: np.ndarray) -> None:
    assert np.allclose(uvs_of(cube(), transform), uvs_of(cube(), np.eye(4)))


def test_nothing_is_stretched_and_the_longest_edge_is_covered_once() -> None:
    slab = cube()
    slab = Mesh(slab.vertices * (4.0, 1.0, 2.0), slab.triangles)
    uvs, corners = uvs_of(slab, np.eye(4)), slab.vertices[slab.triangles]
    for i in range(3):
        lengths = [np.linalg.norm(each[:, i] - each[:, i - 1], axis=1) for each in (uvs, corners)]
        assert np.allclose(lengths[0], lengths[1] / 4.0)


def test_far_from_the_origin_it_is_the_same() -> None:
    far = np.eye(4)
    far[:3, 3] = (1e6, -2e6, 3.0)
    assert np.allclose(uvs_of(cube(), far, (1e6, -2e6, 3.0)), uvs_of(cube(), np.eye(4)))
