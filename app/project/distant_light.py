"""The distant light of a scene under a document's light, and the links of objects that some lights exclude."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.document.light_state import (
    CONSTANT_ENVIRONMENT,
    ENVIRONMENT_KEY,
    SCENE_ENVIRONMENT,
    LightState,
    painted_key,
    side_key,
    sun_key,
)
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
    """A mixed light without the environment, the suns or the painted lights of these keys; what these cover stays
    dark."""
    suns = tuple(sun for sun in light.suns if sun_key(sun.name) not in keys)
    painted = tuple(each.dark() if painted_key(each.name) in keys else each for each in light.painted)
    without = replace(light, new_suns=suns, painted=painted)
    dark = {key: replace(light.row(key), on=False) for key in light.environment_keys if key in keys}
    return without.with_rows({**dict(light.mix), **dark})


def _distant_light(scene: Scene, light: LightState, load: Callable[[Path, str], Environment] | None) -> SkyState:
    """The distant light without links, as `sky_of` has it."""
    from engine.light.environment import constant_environment, load_environment, tinted
    from engine.light.map_changes import changed_map
    from engine.light.painted_lights import tilt_matrix
    from engine.light.painting import painted_environment
    from engine.light.sides import SIDES, with_side_gains
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
        if not (light.suns or light.painted):
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
    # Without names: a renamed sun is the same light.
    suns = tuple(each._replace(name="") for each in light.suns if any(each.irradiance))
    if brightest == 0.0 or (suns or light.painted) and scale == 0.0:
        environment, scale = constant_environment(0.0), 1.0
    else:
        red, green, blue = (each / brightest for each in gain)
        environment = tinted(changed_map(environment, light.map_change), (red, green, blue))
        if light.sides:
            environment = with_side_gains(environment, tuple(light.row(side_key(name)).gain for name in SIDES))
        scale *= brightest
    # The sky's scale multiplies what is added to the map as well.
    factor = 1.0 / scale if scale else 1.0
    environment = painted_environment(environment, tuple(each.scaled(factor) for each in light.painted), light.tilt)
    tilt = tilt_matrix(light.tilt)
    suns = tuple(each.scaled(factor) for each in suns)
    if light.tilt:
        suns = tuple(each._replace(direction=tuple((tilt @ each.direction).tolist())) for each in suns)
    return SkyState(with_suns(environment, suns), light.rotation, scale)
