"""Gloss in indirect light: what it reflects of other surfaces, and what it sends to them, by its own lobe."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from app.project.project import open_project
from app.stills.stills import layers_by_object
from engine.core.generators import run_to_end
from engine.light.radiance_files import read_radiance_image
from engine.material import MODELS
from engine.material.layer import evaluate_layers, make_layer
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.realtime.core.terms import to_shading_frame
from engine.realtime.triple_product import glossy_bounces
from engine.realtime.triple_product.glossy_bounces import reflect_indirect, second_bounce
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.render.display import display_picture
from engine.scene.description import parse_description
from engine.scene.scene_loader import build_scene
from engine.sphere.geodesic import geodesic
from tests.scene_text import camera, facing_up, placed, scaled

METAL = make_layer(MODELS["rough_conductor"], {"alpha": 0.35})
PLASTER = make_layer(MODELS["lambert"], {"albedo": [0.7, 0.7, 0.7]})
JUDGES = Path(__file__).resolve().parents[3] / "golden" / "rooms"


def made(text: str, layers: list, n_points: int, n_bounces: int = 2) -> Orbit:
    scene = build_scene(parse_description(tomllib.loads(text), "scene"), Path("scene.toml"), (32, 24))
    orbit = Orbit(scene, n_points=n_points)
    orbit.set_light(SkyState(None))
    orbit.set_layers({i: [layer] for i, layer in enumerate(layers)})
    orbit.set_bounces(n_bounces)
    assert [*orbit.work()] and orbit.is_done
    return orbit


@pytest.fixture(scope="module")
def closed() -> Orbit:
    """A closed box of rough metal with a lamp in it."""
    lamp = placed("lamp", "quad", facing_up(0.2, (0, -0.9, 0)), "emission = [9.0, 9.0, 9.0]\n")
    return made(camera((0.5, 0.2, 0.6), 60) + placed("box", "cube", scaled(2.0)) + lamp, [METAL], 300)


def test_blunt_gloss_reflects_even_light_as_its_directional_albedo_says(closed: Orbit) -> None:
    # Where all surfaces send radiance 1, a point reflects the integral of BRDF times cosine, from wherever it is seen:
    # 0.66 from above, 0.74 at 70 degrees. Its equivalent albedo is the same number for all.
    lit, sphere = closed.lit, geodesic(4)
    points, above = lit.points, sphere.centres[:, 2] > 0.0
    inside = np.flatnonzero(np.einsum("ni,ni->n", points.normal, -points.position) > 0.0)[::7]
    (term,) = closed.reflections.blunt_terms(closed.scene)
    eye = np.float32([0.5, 0.2, 0.6])
    found = reflect_indirect(lit.bounces, points, inside, eye, np.ones((len(points), 3), np.float32), term.tables)
    wi, expected = sphere.centres[above], []
    for p in inside:
        wo = to_shading_frame((points.frames[p] @ (eye - points.position[p]))[None])[0]
        value = evaluate_layers([METAL], wi, np.tile(wo / np.linalg.norm(wo), (len(wi), 1)))
        expected.append(sphere.solid_angles[above] @ value)
    error = found / np.array(expected) - 1.0  # some rays meet the lamp, which sends nothing on
    assert np.abs(error.mean()) < 0.02 and np.sqrt((error**2).mean()) < 0.08
    assert np.std(expected) > 0.01


def test_gloss_sends_direct_light_to_gathering_points_by_its_lobe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(glossy_bounces, "_N_PARTS", 1)
    # A plate of metal under a small lamp, and a wall. The twin reflects the lamp's light by the formula, ray by ray.
    lamp = "0.1,0,0,-0.8, 0,0,-1,1, 0,0.1,0,0, 0,0,0,1"  # looks down
    text = (
        camera((0.0, 1.0, 2.0), 60)
        + placed("plate", "quad", facing_up(1.0))
        + placed("wall", "cube", scaled((0.1, 1.5, 1.5), (0.6, 0.75, 0.0)))
        + placed("lamp", "quad", lamp, "emission = [100.0, 100.0, 100.0]\n")
    )
    orbit = made(text, [METAL, PLASTER], 400)
    lit, (term,) = orbit.lit, orbit.reflections.blunt_terms(orbit.scene)
    points, gathering = lit.points, lit.bounces.between.gathering
    found = run_to_end(second_bounce(lit.bounces, points, lit.incident, term))[0]
    on_wall = np.flatnonzero((points.i_object[gathering.points] == 1) & (points.normal[gathering.points, 0] < -0.9))
    by_lobe, evenly = np.zeros((2, len(on_wall), 3))
    for k, g in enumerate(on_wall):
        ends = gathering.ends[g]
        ends = ends[(ends >= 0) & (points.i_object[np.maximum(ends, 0)] == 0)]
        at, frames = points.position[ends], points.frames[ends]
        to_lamp, to_wall = np.float32([-0.8, 1.0, 0.0]) - at, points.position[gathering.points[g]] - at
        wi, wo = (
            to_shading_frame(np.einsum("nij,nj->ni", frames, way)) / np.linalg.norm(way, axis=1, keepdims=True)
            for way in (to_lamp, to_wall)
        )
        squared = (to_lamp**2).sum(axis=1)
        power = 100.0 * 0.01 * to_lamp[:, 1] / np.sqrt(squared) / squared  # radiance times solid angle
        n_rays = gathering.ends.shape[1]
        by_lobe[k] = (np.pi * evaluate_layers([METAL], wi, wo) * power[:, None]).sum(axis=0) / n_rays
        evenly[k] = (term.albedo * (power * wi[:, 2])[:, None]).sum(axis=0) / n_rays
    error = np.sqrt(((found[on_wall] - (by_lobe - evenly)) ** 2).mean())
    assert len(on_wall) > 50 and error < 0.06 * np.sqrt((by_lobe**2).mean())
    assert np.sqrt(((by_lobe - evenly) ** 2).mean()) > 0.3 * np.sqrt((by_lobe**2).mean())


def test_light_between_glossy_walls_is_that_of_paths() -> None:
    # The kept picture of paths; by equivalent albedos alone it is 0.45 of 255 off, by lobes 0.29.
    truth = np.asarray(read_radiance_image(JUDGES / "cornell_4.exr"))
    height, width = truth.shape[:2]
    project = open_project("cornell", (width, height)).with_settings(n_edge_rays=0)
    orbit, layers = Orbit(project.scene, n_points=16_000), layers_by_object(project)
    orbit.set_light(project.sky)
    orbit.set_layers(layers)
    orbit.set_bounces(4)
    assert [*orbit.work()]
    ids = Placement(project.scene).hits.object_image
    inner = (minimum_filter(ids, 3) == ids) & (maximum_filter(ids, 3) == ids)

    def change() -> float:
        picture = orbit.draw(project.scene.description.camera, (width, height))
        shown = [display_picture(each).astype(float) for each in (picture, truth)]
        return float(np.abs(shown[0] - shown[1]).mean(axis=2)[inner].mean())

    with_gloss = change()
    orbit.lit.bounce(orbit.reflections.albedos(orbit.scene), 4)  # by albedos alone
    evenly = change()
    assert with_gloss < 0.32 and with_gloss < 0.75 * evenly
