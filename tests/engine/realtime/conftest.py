"""A small scene: a metal ball on a diffuse floor under an even sky."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import trimesh

from engine.realtime.core.shading_points import ShadingPoints, shading_points
from engine.realtime.triple_product.visibility import Bits, trace_hemispheres
from engine.scene.description import parse_description
from engine.scene.raycaster import RayCaster
from engine.scene.scene_loader import Scene, build_scene
from tests.scene_text import camera, environment, facing_up, material, placed, scaled

VIEW = camera((0.0, 1.6, 4.0), 35.0, target=(0.0, 0.4, 0.0)) + environment()
FLOOR = placed("floor", "quad", facing_up(6), material('model = "lambert", albedo = [0.5, 0.4, 0.3]'))
HALF_UP, METAL = scaled(1, (0, 0.5, 0)), material('model = "rough_conductor", alpha = 0.3')
SCENE = VIEW + FLOOR + placed("ball", "sphere", HALF_UP, METAL)
# With a cube in the ball's place, whose mesh has a hundredth of the points.
BLOCK = VIEW + FLOOR + placed("block", "cube", HALF_UP, METAL)


def with_ball(folder: Path, n_subdivisions: int) -> str:
    """The scene with a ball of fewer triangles, whose mesh is written to the folder."""
    trimesh.creation.icosphere(n_subdivisions, radius=0.5).export(folder / "ball.ply")
    return VIEW + FLOOR + placed("ball", "ball.ply", HALF_UP, METAL)


def icosphere(
    folder: Path, diameter: float, centre: Sequence[float] = (0.0, 0.0, 0.0), name: str = "ball", more: str = ""
) -> str:
    """A ball of 1,280 triangles, a thirteenth of those of the primitive, whose mesh is written to the folder."""
    trimesh.creation.icosphere(3, radius=0.5).export(folder / f"{name}.ply")
    return placed(name, f"{name}.ply", scaled(diameter, centre), more)


@pytest.fixture(scope="session")
def ball_scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder = tmp_path_factory.mktemp("ball")
    text = with_ball(folder, 3)
    return build_scene(parse_description(tomllib.loads(text), "ball"), folder / "ball.toml", (48, 36))


@pytest.fixture(scope="session")
def ball(ball_scene: Scene) -> tuple[ShadingPoints, RayCaster, Bits]:
    """Its shading points, rays against it, and what the points see."""
    caster = RayCaster(ball_scene.vertices, ball_scene.triangles)
    points = shading_points(ball_scene, caster, 1500)
    bits = np.empty((len(points), 1280), np.uint8)
    trace_hemispheres(points, caster, np.arange(len(points)), bits)
    return points, caster, bits
