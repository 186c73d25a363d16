"""The light that a document's mix makes: what each light sends, times the gains of its row and of its group, and the
objects that it does not light: those that its row or its group excludes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

from app.document.document import Document
from app.document.light_state import (
    ENVIRONMENT_KEY,
    PLAIN_ROW,
    RGB,
    LightState,
    MixRow,
    group_key,
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
    edited = dict(light.mix)
    found = {}
    for key in lights_of(document):
        row = edited.get(key, PLAIN_ROW)
        of_group = edited.get(group_key(row.group), PLAIN_ROW).excludes if row.group else ()
        found[key] = tuple(sorted(names & {*row.excludes, *of_group}))
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
    than the environment's gain, as a colour, and what each light excludes, emitters too. Equal ones light equally. A
    painted light that is switched off covers nothing; one that is not solo does."""
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
    return mixed.with_rows(rows | {ENVIRONMENT_KEY: replace(rows[ENVIRONMENT_KEY], colour=gains[ENVIRONMENT_KEY])})


def _is_off(light: LightState, key: str) -> bool:
    """Whether a light or its group is switched off."""
    row = light.row(key)
    return not (row.on and (not row.group or light.row(group_key(row.group)).on))


def _emitters(document: Document) -> tuple[str, ...]:
    return tuple(state.name for state in document.objects if state.emission is not None)


@lru_cache(maxsize=16)  # asked several times a frame
def _gains(light: LightState, emitters: tuple[str, ...]) -> Mapping[str, RGB]:
    edited = dict(light.mix)
    rows = {key: edited.get(key, PLAIN_ROW) for key in (*light.keys, *emitters)}
    groups = {key: edited.get(group_key(row.group), PLAIN_ROW) if row.group else PLAIN_ROW for key, row in rows.items()}
    solo = {key for key, row in rows.items() if row.solo or groups[key].solo}
    return {key: scaled(row.gain, groups[key].gain) if key in solo or not solo else BLACK for key, row in rows.items()}
