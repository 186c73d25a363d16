"""Transfer vectors of points: against what a cosine, a corner and its own reflections give in closed form; light
through a medium: the dipole's closed forms, a twin that adds point to point, thin bodies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from engine.core.frames import local_frames
from engine.core.generators import run_to_end
from engine.realtime.zonal_harmonics.transfer import (
    Medium,
    Sources,
    TransferPoints,
    cosine_directions,
    rotate_transfer,
    simulate,
    simulate_subsurface,
    subsurface,
    vertex_areas,
)
from engine.realtime.zonal_harmonics.zonal import unshadowed_lobes
from engine.scene.primitives import sphere
from engine.scene.raycaster import RayCaster, surface_points
from engine.sphere.harmonics import basis, clamped_cosine, rotate

FAR = 1000.0
CONSTANT = math.sqrt(4.0 * math.pi)  # light of radiance 1, in the constant band

MARBLE = Medium(2.62e3, 4.1, 1.5)  # green, of [Jensen01, figure 5]


def corner() -> tuple[TransferPoints, RayCaster, np.ndarray]:
    """A floor (z = 0) and a wall (x = 0) that meet along y, far larger than the points' distance to it; which points
    are 1 to 10 off it."""
    along = np.linspace(-50 * FAR, 50 * FAR, 5)
    away = np.concatenate([[0.0], np.geomspace(0.1, FAR, 25)])
    grid = np.stack(np.meshgrid(away, along, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(grid)).reshape(len(away), len(along))
    a, b, c, d = (each.ravel() for each in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    floor = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    none = np.zeros(len(grid))
    vertices = np.concatenate(
        [np.stack([grid[:, 0], grid[:, 1], none], 1), np.stack([none, grid[:, 1], grid[:, 0]], 1)]
    )
    triangles = np.concatenate([floor, floor[:, ::-1] + len(grid)]).astype(np.int32)
    normals = np.repeat([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]], len(grid), axis=0)
    frames = local_frames(np.tile([0.0, 1.0, 0.0], (len(vertices), 1)), normals)
    caster = RayCaster(vertices, triangles)
    near = (vertices[:, 1] == 0.0) & (vertices.max(axis=1) > 1.0) & (vertices.max(axis=1) < 10.0)
    return TransferPoints(surface_points(caster, vertices, normals), frames, triangles), caster, near


def walk_through_slab(medium: Medium, thickness: float, n: int = 40_000) -> tuple[float, float]:
    """Shares that leave a slab above and below, by random walks that begin at all directions by their cosine."""
    chance = np.random.default_rng(4)
    extinction = medium.scattering + medium.absorption
    depth, weight = np.zeros(n), np.ones(n)
    cosine = np.sqrt(1.0 - (1.0 - chance.random(n)) / medium.ior**2)  # refracted
    out, has_scattered = np.zeros(2), False
    while len(depth):
        depth = depth - np.log(chance.random(len(depth))) / extinction * cosine
        while True:  # reflected inside as often as needed
            side = np.where(depth < 0.0, 0, np.where(depth > thickness, 1, -1))
            leaves = (side >= 0) & (chance.random(len(depth)) >= fresnel(np.abs(cosine), medium.ior) * has_scattered)
            for k in range(2):
                out[k] += weight[leaves & (side == k)].sum()
            depth, cosine, weight, side = depth[~leaves], cosine[~leaves], weight[~leaves], side[~leaves]
            if not (side >= 0).any():
                break
            depth = np.where(side == 0, -depth, np.where(side == 1, 2.0 * thickness - depth, depth))
            cosine = np.where(side >= 0, -cosine, cosine)
        weight = weight * medium.albedo
        alive = chance.random(len(weight)) < np.where(weight < 0.1, 0.5, 1.0)
        weight = np.where(weight < 0.1, 2.0 * weight, weight)[alive]
        depth, cosine, has_scattered = depth[alive], chance.uniform(-1.0, 1.0, int(alive.sum())), True
    return float(out[0] / n), float(out[1] / n)


def fresnel(cosine: np.ndarray, ior: float) -> np.ndarray:
    """Reflectance from inside."""
    outside = np.sqrt(np.maximum(1.0 - ior**2 * (1.0 - cosine**2), 0.0))
    s = ((ior * cosine - outside) / (ior * cosine + outside)) ** 2
    p = ((cosine - ior * outside) / (cosine + ior * outside)) ** 2
    return np.where(outside > 0.0, 0.5 * (s + p), 1.0)


@pytest.mark.parametrize("ior", [1.0, 1.3])
@pytest.mark.parametrize(("thickness", "absorption"), [(0.1, 0.0), (0.5, 0.2), (1.0, 0.0), (3.0, 0.05), (10.0, 0.01)])
def test_a_slab_lets_through_what_random_walks_do(thickness: float, absorption: float, ior: float) -> None:
    """Lengths in mean free paths of scattering: from almost clear to ten of them."""
    medium = Medium(1.0, absorption, ior)
    found, walked = medium.slab_shares(thickness), walk_through_slab(medium, thickness)
    assert found == pytest.approx(walked, abs=0.05)


def test_a_slab_that_absorbs_nothing_sends_all_light_somewhere_and_a_thick_one_back() -> None:
    for thickness in (1e-6, 0.1, 1.0, 50.0):
        assert sum(Medium(20.0, 0.0).slab_shares(thickness)) == pytest.approx(1.0, abs=1e-3)
    assert Medium(20.0, 0.0).slab_shares(1e-6)[1] == pytest.approx(1.0, abs=1e-3)
    assert Medium(20.0, 0.0).slab_shares(1e3)[0] == pytest.approx(1.0, abs=1e-3)
    assert Medium(20.0, 5.0).slab_shares(1e5) == pytest.approx(Medium(20.0, 5.0).slab_shares(1e3), abs=1e-9)
    with pytest.raises(ValueError, match="0 thick, expected above 0"):
        Medium(20.0, 5.0).slab_shares(0.0)


def test_nothing_in_the_way_is_a_cosine() -> None:
    expected = np.zeros(36)
    expected[[l * l + l for l in range(6)]] = 1.0  # noqa: E741
    expected *= basis([0.0, 0.0, 1.0], 6) * (clamped_cosine(6) / math.pi)[np.repeat(np.arange(6), 2 * np.arange(6) + 1)]
    assert cosine_directions(5000, 6)[1].mean(axis=0) == pytest.approx(expected, abs=3e-4)
    assert unshadowed_lobes([0.0, 0.0, 1.0], 6).harmonics()[0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("albedo", "n_bounces", "radiance"),
    [(0.0, 0, 0.5), (0.5, 0, 0.5), (0.5, 1, 0.625), (0.5, 12, 2 / 3), (0.9, 1, 0.725)],
)
def test_a_corner_sees_half_and_reflects_half_of_itself(albedo: float, n_bounces: int, radiance: float) -> None:
    """Either plane fills half of what the other sees, so B = 1/2 + rho B / 2 under light of radiance 1."""
    mesh, caster, near = corner()
    vectors = run_to_end(simulate(mesh, caster, 3, albedo, n_bounces, n_rays=2000))
    assert CONSTANT * vectors[near, 0] == pytest.approx(radiance, rel=0.02)


def test_a_wall_takes_the_light_from_its_own_side() -> None:
    mesh, caster, near = corner()
    vectors = run_to_end(simulate(mesh, caster, 3, n_rays=2000))
    directions, values = cosine_directions(2000, 3)
    floor = np.flatnonzero(near)[0]
    open_half = (directions @ mesh.frames[floor])[:, 0] > 0.0
    assert vectors[floor] == pytest.approx((values * open_half[:, None]).mean(axis=0), abs=2e-3)


def test_vectors_turn_with_their_frames() -> None:
    vectors = np.random.default_rng(5).normal(size=(3, 36))
    turns = [Rotation.from_euler("zyx", angles) for angles in ([0.0, 0.0, 0.0], [1.0, 0.2, -2.0], [0.0, math.pi, 0.0])]
    frames = np.stack([turn.as_matrix().T for turn in turns])  # rows: the turned axes
    expected = [rotate(vector, turn.as_matrix().T) for vector, turn in zip(vectors, turns, strict=True)]
    assert rotate_transfer(vectors, frames) == pytest.approx(np.stack(expected), abs=1e-12)


def plane(spacing: float, reach: float) -> Sources:
    """Evenly lit."""
    steps = np.arange(-math.ceil(reach / spacing), math.ceil(reach / spacing) + 1) * spacing
    places = np.stack([*np.meshgrid(steps, steps), np.zeros((len(steps), len(steps)))], axis=2).reshape(-1, 3)
    return Sources(places, np.full(len(places), spacing**2), np.zeros(len(places), np.int32))


@pytest.mark.parametrize("medium", [MARBLE, Medium(1e3, 0.0), Medium(10.0, 90.0, 1.0)])
def test_the_integral_of_the_reflectance_is_its_closed_form(medium: Medium) -> None:
    near = medium.depths[0]
    found = quad(lambda r: 2.0 * math.pi * r * float(medium.reflectance(r)), 0.0, 3.0 * near, epsabs=1e-12)[0]
    assert found == pytest.approx(float(medium.integral_beyond(0.0) - medium.integral_beyond(3.0 * near)), rel=1e-8)
    assert float(medium.integral_beyond(medium.reach)) == pytest.approx(
        1e-3 * float(medium.integral_beyond(0.0)), rel=1e-3
    )


def test_the_whole_is_what_the_paper_says() -> None:
    """alpha' / 2 (1 + exp(-4/3 A s)) exp(-s), s = sqrt(3 (1 - alpha')) [Jensen01, 2.4]."""
    medium = Medium(80.0, 20.0, 1.3)
    inside = -1.440 / 1.3**2 + 0.710 / 1.3 + 0.668 + 0.0636 * 1.3
    s = math.sqrt(3.0 * 0.2)
    whole = 0.4 * (1.0 + math.exp(-4.0 / 3.0 * (1.0 + inside) / (1.0 - inside) * s)) * math.exp(-s)
    assert float(medium.integral_beyond(0.0)) == pytest.approx(whole)


@pytest.mark.parametrize("spacing", [0.5, 1.0, 3.0])
def test_a_plane_that_is_lit_evenly_sends_its_reflectance_back(spacing: float) -> None:
    """However coarse its points are beside the medium's depth."""
    medium = Medium(900.0, 100.0)
    ground = plane(spacing * medium.depths[0], medium.reach)
    found = run_to_end(subsurface([[1.0]], [[0.0, 0.0, 0.0]], ground, medium))
    assert found[0, 0] == pytest.approx(float(medium.integral_beyond(0.0)), rel=0.02)


def test_it_is_the_sum_over_all_that_is_near() -> None:
    """Places so far apart that each is a point to the others."""
    rng, medium = np.random.default_rng(1), Medium(5.0, 0.5)
    places, areas, entering = rng.uniform(0.0, 1.0, (60, 3)), np.full(60, 1e-6), rng.normal(size=(60, 9))
    found = run_to_end(subsurface(entering, places, Sources(places, areas, np.arange(60, dtype=np.int32)), medium))
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    share = np.where(apart > 0.0, medium.reflectance(apart) * 1e-6, 0.0)
    share[np.diag_indices(60)] = medium.integral_beyond(0.0) - medium.integral_beyond(math.sqrt(1e-6 / math.pi))
    share[apart > medium.reach] = 0.0
    assert found == pytest.approx(share @ entering, abs=1e-5 * np.abs(found).max())


def ball(radius: float) -> tuple[TransferPoints, RayCaster, np.ndarray]:
    mesh = sphere()
    vertices, normals = 2.0 * radius * mesh.vertices, np.asarray(mesh.normals)
    across = np.where(np.abs(normals[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    tangent = np.cross(across, normals)
    frames = local_frames(tangent / np.linalg.norm(tangent, axis=1, keepdims=True), normals)
    caster = RayCaster(vertices, mesh.triangles)
    return TransferPoints(surface_points(caster, vertices, normals), frames, mesh.triangles), caster, mesh.triangles


@pytest.fixture(scope="module")
def balls() -> dict[str, np.ndarray]:
    """The mean vector of a ball's points in their own axes: thick, thin, and as good as matt."""
    media = {"thick": Medium(400.0, 1.0), "thin": Medium(4.0, 0.01), "matt": Medium(1e6, 0.0)}
    found = {}
    for name, medium in media.items():
        mesh, caster, triangles = ball(0.05)
        found[name] = run_to_end(simulate_subsurface(mesh, caster, triangles, 4, medium, n_rays=200))[2000:6000].mean(
            axis=0
        )
    return found


def test_thin_bodies_let_light_through(balls: dict[str, np.ndarray]) -> None:
    """Light from straight behind against light from straight ahead."""
    behind, ahead = basis([0.0, 0.0, -1.0], 4), basis([0.0, 0.0, 1.0], 4)
    through = {name: (vector @ behind) / (vector @ ahead) for name, vector in balls.items()}
    assert through["thin"] > 0.8  # the same from all sides, but for less of it near where it enters
    assert through["thick"] < 0.2
    # of a cosine, whose bands pi, 2 pi / 3 and pi / 4 leave (1 - 2 + 5/4) / (1 + 2 + 5/4) below the horizon
    assert through["matt"] == pytest.approx(1.0 / 17.0, abs=5e-3)


def test_a_medium_without_depth_is_matt(balls: dict[str, np.ndarray]) -> None:
    """Of scattering alone all comes back, and where it went in."""
    assert CONSTANT * balls["matt"][0] == pytest.approx(1.0, rel=0.02)


def test_areas_of_vertices_are_the_surface() -> None:
    mesh = sphere()
    assert vertex_areas(mesh.vertices, mesh.triangles).sum() == pytest.approx(math.pi, rel=2e-3)


@pytest.mark.parametrize("odd", [(0.0, 1.0), (1.0, -1.0), (math.nan, 1.0), (1.0, math.inf), (1.0, 1.0, 0.9)])
def test_media_that_are_none_are_refused(odd: tuple) -> None:
    with pytest.raises(ValueError, match="expected above 0, at least 0"):
        Medium(*odd)
