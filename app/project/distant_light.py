"""The distant light of a scene under a document's light, and the links of objects that some lights exclude."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.document.light_state import CONSTANT_ENVIRONMENT, ENVIRONMENT_KEY, SCENE_ENVIRONMENT, LightState, sun_key
from engine.scene.builtin import builtin_environments

if TYPE_CHECKING:
    from engine.light.environment import Environment
    from engine.precompute.direct.pipeline import SkyState
    from engine.scene.scene_loader import Scene


def sky_of(scene: Scene, light: LightState, load: Callable[[Path, str], Environment] | None = None) -> SkyState:
    """The distant light of a document's light, mixed (`mixed_light`): environment, suns, rotation and the scene's
    scale; and the links of objects that some lights exclude. `intensity` is left out: it multiplies the finished
    picture. load: reads a file's environment, None for the engine's own reader."""
    from engine.precompute.direct.pipeline import LightLink

    groups: dict[tuple[str, ...], list[int]] = {}
    for i, name in enumerate(scene.object_names):
        if keys := tuple(key for key, names in light.exclusions if name in names):
            groups.setdefault(keys, []).append(i)
    whole = _distant_light(scene, light, load)
    links = []
    for keys, objects in groups.items():
        dark = frozenset(i for i, name in enumerate(scene.object_names) if name in keys)
        is_distant = any(key in light.keys for key in keys)
        reaching = _distant_light(scene, _without(light, keys), load) if is_distant else whole
        links.append(LightLink(frozenset(objects), reaching, dark))
    return replace(whole, links=tuple(links))


def _without(light: LightState, keys: tuple[str, ...]) -> LightState:
    """A mixed light without the environment or the suns of these keys."""
    suns = tuple(sun for sun in light.suns if sun_key(sun.name) not in keys)
    row = light.row(ENVIRONMENT_KEY)
    without = replace(light, new_suns=suns)
    return without.with_row(ENVIRONMENT_KEY, replace(row, on=False)) if ENVIRONMENT_KEY in keys else without


def _distant_light(scene: Scene, light: LightState, load: Callable[[Path, str], Environment] | None) -> SkyState:
    """The distant light without links, as `sky_of` has it."""
    from engine.light.environment import constant_environment, load_environment, tinted
    from engine.light.suns import with_suns
    from engine.precompute.direct.pipeline import SkyState

    load = load or load_environment  # type: ignore[assignment]
    assert load is not None
    described, scale = scene.description.environment, 1.0
    if light.environment == CONSTANT_ENVIRONMENT:
        environment = constant_environment(light.radiance or (1.0, 1.0, 1.0))
    elif light.environment != SCENE_ENVIRONMENT:
        environment = load(builtin_environments().get(light.environment) or Path(light.environment), light.mapping)
    elif described is None:
        if not light.suns:
            return SkyState(None)
        environment = constant_environment(0.0)
    else:
        scale = described.scale
        if scene.sky is not None:
            environment = scene.sky
        elif scene.environment_path is None:
            environment = constant_environment(described.radiance or (0.0, 0.0, 0.0))
        else:
            environment = load(scene.environment_path, described.mapping)
    gain = light.row(ENVIRONMENT_KEY).gain
    brightest = max(gain)
    suns = tuple(each for each in light.suns if any(each.irradiance))
    if brightest == 0.0 or suns and scale == 0.0:
        environment, scale = constant_environment(0.0), 1.0
    else:
        red, green, blue = (each / brightest for each in gain)
        environment, scale = tinted(environment, (red, green, blue)), scale * brightest
    return SkyState(with_suns(environment, tuple(each.scaled(1.0 / scale) for each in suns)), light.rotation, scale)
