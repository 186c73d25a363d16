"""The lights of a scene, each alone and white: light adds up, so a mix of them is a weighted sum of pictures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

from app.document.light_state import (
    CONSTANT_ENVIRONMENT,
    RGB,
    LightState,
    MixRow,
    painted_key,
    sun_key,
)

BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
_DARK = LightState(CONSTANT_ENVIRONMENT, radiance=BLACK)


class SingleLight(NamedTuple):
    """A light alone: an environment of gain 1, a sun of irradiance 1, a painted light of radiance 1, or, by name, an
    emitter of radiance 1. Its row in `light` has no more than what it excludes; lights painted over it cover it."""

    light: LightState
    emitter: str = ""

    def emission(self, names: Iterable[str]) -> dict[str, RGB]:
        """The radiance of the emitters of these names."""
        return {name: WHITE if name == self.emitter else BLACK for name in names}


Emission = tuple[tuple[str, RGB], ...]
# What each light sends, as a multiple of what it sends alone.
Weights = Mapping[SingleLight, RGB]


def light_weights(light: LightState, emission: Emission) -> dict[SingleLight, RGB]:
    """The weights of a scene's lights, mixed: the gain of its environment, the irradiance of its suns, the radiance of
    painted lights and of its emitters by name; 0 for lights that are off."""

    def alone(key: str, own: LightState) -> LightState:
        return replace(own, mix=()).with_row(key, MixRow(excludes=light.row(key).excludes))

    covers = tuple(each.alone()[0].dark() if each.covers else None for each in light.painted)
    painted = {}
    for place, each in enumerate(light.painted):
        white, weight = each.alone()
        over = tuple(cover for cover in covers[place + 1 :] if cover is not None)
        only = replace(_DARK, rotation=light.rotation, tilt=light.tilt, painted=(white, *over))
        painted[SingleLight(alone(painted_key(each.name), only))] = weight
    over = tuple(cover for cover in covers if cover is not None)
    whole = replace(light, own_suns=(), new_suns=None, painted=over)
    environment = {}
    for key in light.environment_keys:
        only = alone(key, whole)
        others = (each for each in light.environment_keys if each != key)
        only = only.with_rows({**dict(only.mix), **{each: MixRow(on=False) for each in others}})
        environment[SingleLight(only)] = light.row(key).gain
    suns = {}
    for own in light.suns:
        sun = replace(_DARK, rotation=light.rotation, tilt=light.tilt, new_suns=(own._replace(irradiance=WHITE),))
        suns[SingleLight(alone(sun_key(own.name), sun))] = own.irradiance
    emitters = {SingleLight(alone(name, _DARK), name): radiance for name, radiance in emission}
    return {**environment, **suns, **painted, **emitters}
