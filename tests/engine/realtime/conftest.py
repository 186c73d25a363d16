"""A small scene: a metal ball on a matt floor under an even sky."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from engine.realtime.core.shading_points import ShadingPoints, shading_points
from engine.realtime.triple_product.visibility import Bits, trace_hemispheres
from engine.scene.description import parse_description
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, build_scene

SCENE = """
version = 1
[camera]
position = [0.0, 1.6, 4.0]
target = [0.0, 0.4, 0.0]
fov_y = 35.0
[environment]
radiance = [1.0, 1.0, 1.0]
[[objects]]
name = "floor"
primitive = "quad"
transform = [6, 0, 0, 0, 0, 0, 6, 0, 0, -6, 0, 0, 0, 0, 0, 1]
[[objects.layers]]
model = "lambert"
albedo = [0.5, 0.4, 0.3]
[[objects]]
name = "ball"
primitive = "sphere"
smooth = true
transform = [1, 0, 0, 0, 0, 1, 0, 0.5, 0, 0, 1, 0, 0, 0, 0, 1]
[[objects.layers]]
model = "rough_conductor"
alpha = 0.3
"""
# With a cube in the ball's place, whose mesh has a hundredth of the points.
BLOCK = SCENE.replace('primitive = "sphere"\nsmooth = true', 'primitive = "cube"').replace("ball", "block")


@pytest.fixture(scope="session")
def ball_scene() -> Scene:
    return build_scene(parse_description(tomllib.loads(SCENE), "ball"), Path("ball.toml"), (48, 36))


@pytest.fixture(scope="session")
def ball(ball_scene: Scene) -> tuple[ShadingPoints, RayCaster, Bits]:
    """Its shading points, rays against it, and what the points see."""
    caster = RayCaster(ball_scene.vertices, ball_scene.triangles)
    points = shading_points(ball_scene, caster, 1500)
    bits = np.empty((len(points), 1280), np.uint8)
    trace_hemispheres(points, caster, np.arange(len(points)), bits)
    return points, caster, bits
