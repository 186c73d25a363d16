"""The distant light of a document's light state, in one place for the worker and for commands."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from app.document.document import CONSTANT_ENVIRONMENT, SCENE_ENVIRONMENT, LightState
from engine.light.environment import Environment, constant_environment, load_environment
from engine.precompute.direct.pipeline import SkyState
from engine.scene.builtin import builtin_environments
from engine.scene.scene_loader import Scene

Load = Callable[[Path, str], Environment]


def sky_of(scene: Scene, light: LightState, load: Load = load_environment) -> SkyState:  # type: ignore[assignment]
    """Environment, rotation and the scene's scale. `intensity` is left out: it multiplies the finished picture."""
    if light.environment == CONSTANT_ENVIRONMENT:
        return SkyState(constant_environment(light.radiance or (1.0, 1.0, 1.0)), light.rotation)
    if light.environment != SCENE_ENVIRONMENT:
        path = builtin_environments().get(light.environment) or Path(light.environment)
        return SkyState(load(path, light.mapping), light.rotation)
    described = scene.description.environment
    if described is None:
        return SkyState(None)
    if scene.environment_path is None:
        radiance = described.radiance or (0.0, 0.0, 0.0)
        return SkyState(constant_environment(radiance), light.rotation, described.scale)
    return SkyState(load(scene.environment_path, described.mapping), light.rotation, described.scale)
