"""Pictures while a scene is prepared: none is worse than one before it."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from app.project.project import open_project
from app.stills.stills import layers_by_object
from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.triple_product import orbit_engine
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.scene.description import parse_description
from engine.scene.scene_loader import build_scene
from tests.scene_text import camera, placed, scaled

SIZE = 24, 24
GOLD = make_layer(MODELS["rough_conductor"], {"alpha": 0.1})
# A gilded box without a lid, seen from above: each side shows the others.
BOX = camera((0.3, 3.0, 0.4), 30, SIZE) + "".join(
    placed(name, "cube", transform)
    for name, transform in (
        ("left", scaled((0.1, 1, 1), (-0.5, 0, 0))),
        ("right", scaled((0.1, 1, 1), (0.5, 0, 0))),
        ("back", scaled((1, 1, 0.1), (0, 0, -0.5))),
        ("front", scaled((1, 1, 0.1), (0, 0, 0.5))),
        ("bottom", scaled((1, 0.1, 1), (0, -0.5, 0))),
    )
)


def gilded_box(monkeypatch: pytest.MonkeyPatch) -> Orbit:
    monkeypatch.setattr(orbit_engine, "_TRACED", 32)  # it has few points
    monkeypatch.setattr(orbit_engine, "_FINE", 32)
    scene = build_scene(parse_description(tomllib.loads(BOX), "box"), Path("box.toml"), SIZE)
    orbit = Orbit(scene, n_points=1500, n_coefficients=64)
    orbit.set_light(SkyState(constant_environment((1.0, 1.0, 1.0))))
    orbit.set_layers(dict.fromkeys(range(5), [GOLD]))
    return orbit


def gold_ring() -> Orbit:
    project = open_project("ring", SIZE)
    orbit = Orbit(project.scene, n_points=0, n_coefficients=64)
    orbit.set_light(project.sky)
    orbit.set_layers(layers_by_object(project))
    return orbit


@pytest.mark.parametrize("name", ["box", "ring"])
def test_no_picture_is_worse_than_one_before_it(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if name == "ring":
        orbit, gold_objects = gold_ring(), [0]
    else:
        orbit, gold_objects = gilded_box(monkeypatch), list(range(5))
    eye, version, pictures = orbit.scene.description.camera, -1, []
    for _ in orbit.work():
        if orbit.is_ready and orbit.version != version:
            pictures.append(orbit.draw(eye, SIZE, "moving"))
            version = orbit.version
    assert orbit.is_done and len(pictures) > 5
    samples = orbit.lit.mesh.sample_view(eye, SIZE).samples
    on_gold = np.isin(samples.i_object.reshape(SIZE[::-1]), gold_objects)
    last = pictures[-1]
    error = np.array([np.sqrt(np.mean((each - last) ** 2)) for each in pictures]) / last.mean()
    gold = np.array([each[on_gold].mean() for each in pictures])
    assert error[0] > 0.5  # there is something to be found out
    assert (error <= np.minimum.accumulate(error) + 0.02).all()
    assert (gold >= 0.8 * np.minimum(np.maximum.accumulate(gold), gold[-1])).all()
