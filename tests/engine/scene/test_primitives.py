"""The shapes of revolution among the built-in ones: their volumes and surfaces in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from engine.scene import props
from engine.scene.mesh import Mesh
from engine.scene.primitives import PRIMITIVES

# Volume and surface of the true shapes: of height 1 and radius 1/2; the torus has the radii 0.35 and 0.15.
SLANT = math.sqrt(1.25)
EDGE, SIN, FOOT = props.PLINTH_EDGE, 0.5 * math.sin(math.radians(props.GROOVE)), props.FOOT_RADIUS
# What the rounded edge of the pedestal lacks of a cylinder: a square less a quarter of a disc, revolved (Pappus).
ROUNDED = 2.0 * math.pi * EDGE**2 * (
    (0.5 - EDGE / 2.0) - math.pi / 4.0 * (0.5 - EDGE + 4.0 * EDGE / (3.0 * math.pi))
)  # fmt: skip
RIM = 2.0 * (props.BASE_PLACE + props.BALL_HEIGHT)
DEPTH = RIM - props.BALL_HEIGHT + 0.5 + props.GAP  # of the bowl, a cap of a sphere
BASE_VOLUME = (
    math.pi * FOOT**2 * props.FOOT_HEIGHT
    + math.pi / 3.0 * (RIM - props.FOOT_HEIGHT) * (FOOT**2 + FOOT * props.RIM_RADIUS + props.RIM_RADIUS**2)
    - math.pi * DEPTH**2 * (0.5 + props.GAP - DEPTH / 3.0)
) / props.BASE_SCALE**3  # fmt: skip
# Of props: the ball is a sphere less what the groove takes, the integral of pi (r^2 - y^2 - g^2).
SOLID = {
    "pedestal": math.pi / 4.0 * props.PLINTH_HEIGHT - ROUNDED,
    "shader_ball": math.pi / 6.0 - 2.0 * math.pi * ((0.25 - props.GROOVE_RADIUS**2) * SIN - SIN**3 / 3.0),
    "shader_ball_base": BASE_VOLUME,
}
EXPECTED = {
    "cylinder": (math.pi / 4.0, 1.5 * math.pi),
    "cone": (math.pi / 12.0, math.pi / 4.0 + math.pi * 0.5 * SLANT),
    "torus": (2.0 * math.pi**2 * 0.35 * 0.15**2, 4.0 * math.pi**2 * 0.35 * 0.15),
}


@pytest.mark.parametrize("name", EXPECTED)
def test_volume_surface_and_size(name: str) -> None:
    mesh = PRIMITIVES[name]()
    corners = mesh.vertices[mesh.triangles]
    volume = np.einsum("ti,ti->t", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(doubled, axis=1) / 2.0
    # Inscribed polygons of 96 sides lack 0.07 % of a circle's area, tubes of 48 sides 0.3 % of theirs.
    assert volume == pytest.approx(EXPECTED[name][0], rel=5e-3)
    assert areas.sum() == pytest.approx(EXPECTED[name][1], rel=5e-3)
    height = 0.3 if name == "torus" else 1.0
    assert np.allclose(np.ptp(mesh.vertices, axis=0), [1.0, height, 1.0], atol=1e-3)
    assert mesh.normals is not None
    # Fronts are outside, and normals are those of the true surface: 4 degrees from a side of a polygon at most.
    faces = doubled / (2.0 * areas[:, None])
    assert (np.einsum("ti,tki->tk", faces, mesh.normals[mesh.triangles]) > math.cos(math.radians(6.0))).all()


def unpaired(mesh: Mesh) -> np.ndarray:
    """How often each edge is passed one way, less the other way: 0 for all of a closed surface."""
    _, index = np.unique(mesh.vertices.round(9), axis=0, return_inverse=True)
    corners = index.reshape(-1)[mesh.triangles].astype(np.int64)
    pairs = np.concatenate([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [2, 0]]])
    way = np.where(pairs[:, 0] < pairs[:, 1], 1, -1)
    _, which = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
    return np.bincount(which.reshape(-1), way)


@pytest.mark.parametrize("name", SOLID)
def test_props_are_closed_and_have_the_volume_of_their_outline(name: str) -> None:
    mesh = PRIMITIVES[name]()
    corners = mesh.vertices[mesh.triangles]
    volume = np.einsum("ti,ti->t", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    assert volume == pytest.approx(SOLID[name], rel=3e-3)
    assert not unpaired(mesh).any()
    assert mesh.uvs is not None and mesh.uvs.min() == 0.0 and mesh.uvs.max() == 1.0


def test_the_ball_stands_in_its_base_without_touching_it() -> None:
    base = PRIMITIVES["shader_ball_base"]().vertices * props.BASE_SCALE + (0.0, props.BASE_PLACE, 0.0)
    # The corners of the bowl are on its sphere, and the whole stands on the ground, BALL_HEIGHT below the middle.
    assert np.linalg.norm(base, axis=1).min() == pytest.approx(0.5 + props.GAP, abs=1e-9)
    assert base[:, 1].min() == pytest.approx(-props.BALL_HEIGHT, abs=1e-9)


def test_the_backdrop_is_a_floor_a_quarter_of_a_cylinder_and_a_wall() -> None:
    mesh, r = PRIMITIVES["backdrop"](), props.SWEEP_RADIUS
    corners = mesh.vertices[mesh.triangles]
    doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = (1.0 - r) + 0.5 * math.pi * r + (props.SWEEP_HEIGHT - r)
    assert np.linalg.norm(doubled, axis=1).sum() / 2.0 == pytest.approx(length, rel=1e-4)
    assert mesh.normals is not None and mesh.uvs is not None
    # The front is up on the floor and along +Z on the wall; between, normals point to the axis of the cylinder.
    y, z = mesh.vertices[:, 1] + props.SWEEP_HEIGHT / 2.0, mesh.vertices[:, 2] + 0.5
    is_arc = (y <= r) & (z <= r)
    towards = np.stack([np.zeros(is_arc.sum()), r - y[is_arc], r - z[is_arc]], axis=1) / r
    assert np.allclose(mesh.normals[is_arc], towards, atol=1e-9)
    assert np.allclose(mesh.normals[z > r], [0, 1, 0]) and np.allclose(mesh.normals[y > r], [0, 0, 1])
    # v is the way along the sweep.
    floor = mesh.uvs[(np.abs(corners[..., 1] + props.SWEEP_HEIGHT / 2.0) < 1e-9).all(axis=1)]
    assert floor[..., 1].max() == pytest.approx((1.0 - r) / length, abs=1e-3)
