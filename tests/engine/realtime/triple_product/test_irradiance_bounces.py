import tomllib
from pathlib import Path

import numpy as np
import pytest
import trimesh

from app.project.project import open_project
from app.stills.stills import layers_by_object
from engine.core.generators import run_to_end
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.indirect.direction_patterns import cosine_tables
from engine.realtime.triple_product import irradiance_bounces
from engine.realtime.triple_product.irradiance_bounces import (
    _STIFF,
    Bounces,
    _following_slopes,
    trace_bounce_rays,
)
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.scene.description import parse_description
from engine.scene.scene_loader import build_scene
from tests.rooms import slit
from tests.scene_text import camera, facing_up, placed, scaled

SPHERE = (
    camera((0.6, 0.3, 0.0), 80.0, target=(-0.5, 0, 0))
    + placed("sphere", "ball.ply", scaled(2))
    + placed("lamp", "quad", facing_up(0.1), "emission = [100.0, 50.0, 25.0]\n")
)


@pytest.fixture(scope="module", params=["outwards", "inwards"])
def inside(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Orbit:
    """An integrating sphere of few triangles, seen from within: its winding faces away from its own camera, or towards
    it. Beside its corners the surface is hollow."""
    folder, ball = tmp_path_factory.mktemp("sphere"), trimesh.creation.icosphere(subdivisions=3, radius=0.5)
    if request.param == "inwards":
        ball.invert()
    ball.export(folder / "ball.ply")
    scene = build_scene(parse_description(tomllib.loads(SPHERE), "sphere"), folder / "sphere.toml", (16, 12))
    orbit = Orbit(scene, n_points=0, n_patches=4)
    orbit.set_layers({0: [make_layer(MODELS["lambert"], {"albedo": [0.8, 0.5, 0.0]})]})
    orbit.set_bounces(1)
    assert [*orbit.work()]
    return orbit


@pytest.mark.parametrize("n_bounces", [2, 4])
def test_an_integrating_sphere_is_as_bright_as_the_closed_form_says(inside, n_bounces: int) -> None:
    # Each bounce sends Φ ρ^k evenly over 4π, wherever the light before it was; a ray more or less meets the lamp.
    camera = inside.scene.description.camera
    inside.set_bounces(1)
    direct = inside.draw(camera, (16, 12))
    inside.set_bounces(n_bounces)
    assert [*inside.work()]
    found = inside.draw(camera, (16, 12)) - direct
    albedo = np.array([0.8, 0.5, 0.0])
    flux = np.pi * 0.01 * np.array([100.0, 50.0, 25.0])
    irradiance = flux / (4.0 * np.pi) * sum(albedo**k for k in range(1, n_bounces))
    walls = found[direct.max(axis=2) < 20.0]
    np.testing.assert_allclose(walls.mean(axis=0), albedo / np.pi * irradiance, rtol=0.02)
    assert walls[:, :2].std(axis=0).max() < 0.03 * walls[:, 0].mean()


def test_one_bounce_is_no_work_and_black_walls_send_nothing_on(inside) -> None:
    inside.set_bounces(1)
    assert inside.is_done and not [*inside.work()]


def test_more_points_gather_where_bounced_light_has_an_edge(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # On the floor of a dark room, before a slit: against rays of these points' own. As few gather as of more points.
    monkeypatch.setattr(irradiance_bounces, "N_GATHERING", 1536)
    monkeypatch.setattr(irradiance_bounces, "N_MORE", 512)
    project = open_project(str(slit(tmp_path, 0.3)), (32, 24))
    orbit = Orbit(project.scene, n_points=8000, n_coefficients=20, n_patches=64)
    orbit.set_layers(layers_by_object(project))
    orbit.set_bounces(2)
    assert [*orbit.work()] and orbit.is_done
    lit, points = orbit.lit, orbit.lit.points
    z = points.position[:, 2]
    floor = np.flatnonzero((points.i_object == 1) & ~points.buried & (z > -1.8) & (z < -0.5))
    assert len(floor) > 100
    ways = np.einsum("rk,nki->nri", cosine_tables(1024)[0], points.frames[floor][:, [0, 2, 1]]).astype(np.float32)
    met, _ = lit.mesh.trace(np.repeat(points.lifted[floor], 1024, axis=0), ways.reshape(-1, 3))
    albedo = orbit.reflections.albedos(orbit.scene)[points.i_object]
    sent = (lit.incident.irradiance * albedo)[met.corners]
    truth = np.einsum("nk,nki->ni", met.weights * (met.corners[:, :1] >= 0), sent).reshape(len(floor), 1024, 3)
    truth = truth.mean(axis=1)

    def error(bounces: Bounces) -> float:
        found = bounces.indirect(lit.incident.irradiance, albedo, 2)[0][floor]
        return float(np.sqrt(((found - truth) ** 2).mean()) / truth.mean())

    assert error(lit.bounces) < 0.85 * error(Bounces(run_to_end(trace_bounce_rays(points, lit.mesh), lambda _: None)))


def test_weights_between_gathering_points_are_those_of_a_fitted_plane() -> None:
    # The twin fits a + b x + c y to values by weighted least squares, with a ridge on the slopes; a is the value at 0.
    chance = np.random.default_rng(3)
    weights, offsets = chance.dirichlet(np.ones(9), 20), chance.normal(0.2, 0.5, (20, 9, 2))
    values = chance.normal(size=(20, 9))
    found = _following_slopes(weights, offsets)
    np.testing.assert_allclose(found.sum(axis=1), 1.0)
    for own, at, value, mine in zip(weights, offsets, values, found, strict=True):
        scaled = at / np.sqrt(own @ (at**2).sum(axis=1))
        rows = np.sqrt(own)[:, None] * np.column_stack([np.ones(9), scaled])
        ridge = np.sqrt(_STIFF) * np.eye(3)[1:]
        right = np.concatenate([np.sqrt(own) * value, np.zeros(2)])
        plane = np.linalg.lstsq(np.concatenate([rows, ridge]), right)[0]
        assert mine @ value == pytest.approx(plane[0])


@pytest.mark.parametrize("kept", [("lamp",), ()])
def test_where_nothing_gathers_there_is_no_light_between_surfaces(tmp_path: Path, kept: tuple[str, ...]) -> None:
    lamp = placed("lamp", "quad", facing_up(0.1), "emission = [100.0, 50.0, 25.0]\n") if kept else ""
    text = camera((0.6, 0.3, 0.0), 80.0, target=(-0.5, 0, 0)) + lamp
    scene = build_scene(parse_description(tomllib.loads(text), "bare"), tmp_path / "bare.toml", (16, 12))
    orbit = Orbit(scene, n_points=100, n_patches=4)
    orbit.set_layers({})
    orbit.set_bounces(1)
    assert [*orbit.work()]
    direct = orbit.draw(scene.description.camera, (16, 12))
    orbit.set_bounces(3)
    assert [*orbit.work()]
    np.testing.assert_array_equal(orbit.draw(scene.description.camera, (16, 12)), direct)
