"""The light that a document's mix makes: what each light sends, times the gains of its row and of its group, and the
objects that it does not light: those that its row or its group excludes."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

from app.document.document import Document
from app.document.light_state import (
    RGB,
    LightState,
    MixRow,
    painted_key,
    scaled,
    sun_key,
)

BLACK = (0.0, 0.0, 0.0)


def lights_of(document: Document) -> tuple[str, ...]:
    """The keys of all lights: the environment, which may be none, suns, and emitters."""
    return *document.light.keys, *_emitters(document)


def gains_of(document: Document) -> Mapping[str, RGB]:
    """The gain of each light, by its key: 0 where it or its group is off, or others are solo."""
    return _gains(document.light, _emitters(document))


def exclusions_of(document: Document) -> dict[str, tuple[str, ...]]:
    """The names of the objects that each light does not light, by its key; sorted."""
    light, names = document.light, {state.name for state in document.objects}
    found = {}
    for key in lights_of(document):
        rows = (light.row(key), *light.rows_over(key))
        found[key] = tuple(sorted(names & {name for row in rows for name in row.excludes}))
    return found


def emission_of(document: Document) -> tuple[tuple[str, RGB], ...]:
    """(name, radiance) of all emitters in the mix; hidden ones are black."""
    gains = gains_of(document)
    return tuple(
        (each.name, scaled(each.emission, gains[each.name]) if each.visible else BLACK)
        for each in document.objects if each.emission is not None
    )  # fmt: skip


def mixed_light(document: Document) -> LightState:
    """The distant light of the mix: suns have their irradiance in it, painted lights their gain, and the mix is no more
    than the gain of the environment or of each of its sides, as a colour, and what each light excludes, emitters too.
    Equal ones light equally. A painted light that is switched off covers nothing; one that is not solo does."""
    light = document.light
    if not light.mix:
        return light
    gains = gains_of(document)
    suns = tuple(sun._replace(irradiance=scaled(sun.irradiance, gains[sun_key(sun.name)])) for sun in light.suns)
    painted = tuple(
        each if (gain := gains[painted_key(each.name)]) == each.gain else replace(each, gain=gain)
        for each in light.painted if not (each.covers and _is_off(light, painted_key(each.name)))
    )  # fmt: skip
    mixed = replace(light, new_suns=None if suns == light.own_suns else suns, mix=(), painted=painted)
    there = (*mixed.keys, *_emitters(document))
    rows = {key: MixRow(excludes=names) for key, names in exclusions_of(document).items() if key in there}
    return mixed.with_rows(rows | {key: replace(rows[key], colour=gains[key]) for key in light.environment_keys})


def _is_off(light: LightState, key: str) -> bool:
    """Whether a light or its group is switched off."""
    return not all(row.on for row in (light.row(key), *light.rows_over(key)))


def _emitters(document: Document) -> tuple[str, ...]:
    return tuple(state.name for state in document.objects if state.emission is not None)


@lru_cache(maxsize=16)  # asked several times a frame
def _gains(light: LightState, emitters: tuple[str, ...]) -> Mapping[str, RGB]:
    rows = {key: (light.row(key), *light.rows_over(key)) for key in (*light.keys, *emitters)}
    solo = {key for key, of_key in rows.items() if any(row.solo for row in of_key)}
    # Of sides that are solo, the environment's own row does not bring in the others.
    sides = {key for key in light.environment_keys if light.row(key).solo}
    solo -= set(light.environment_keys) - sides if sides else set()
    return {
        key: functools.reduce(scaled, (row.gain for row in of_key)) if key in solo or not solo else BLACK
        for key, of_key in rows.items()
    }
