"""Lamps of many triangles: as bright as the closed form says, and no dearer than those of two."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from engine.material import MODELS
from engine.material.layer import make_layer
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.scene.description import parse_description
from engine.scene.scene_loader import build_scene
from tests.scene_text import camera, facing_down, facing_up, placed

ROOM = camera((0.3, 0.4, 1.0), 1.0, target=(0.2, 0, 0)) + placed("floor", "quad", facing_up(1.2))


def lit_by(primitive: str) -> Orbit:
    lamp = placed("lamp", primitive, facing_down(0.1, (0, 0.5, 0)), "emission = [100.0, 50.0, 25.0]\n")
    scene = build_scene(parse_description(tomllib.loads(ROOM + lamp), "lamp"), Path("lamp.toml"))
    orbit = Orbit(scene, n_points=1500)
    orbit.set_layers({0: [make_layer(MODELS["lambert"], {"albedo": [0.8, 0.5, 0.2]})]})
    orbit.set_bounces(1)
    assert [*orbit.work()]
    return orbit


def test_a_bulb_is_as_bright_as_it_is_and_costs_no_more_than_a_panel() -> None:
    orbit = lit_by("sphere")
    assert len(orbit.scene.triangles) > 10_000
    # Of a sphere's radiance L a floor has the irradiance π L (r / d)² cos.
    squared = 0.2**2 + 0.5**2
    expected = np.array([80.0, 25.0, 5.0]) * 0.05**2 / squared * 0.5 / np.sqrt(squared)
    for quality in ("moving", "rest", "still"):
        found = orbit.draw(orbit.scene.description.camera, (4, 4), quality).mean(axis=(0, 1))
        assert found == pytest.approx(expected, rel=0.01), quality
    assert orbit.n_bytes <= lit_by("quad").n_bytes
