"""Light linking: objects that not all lights of a scene reach, as receivers that Blender's light linking excludes.

A light that does not reach an object still throws that object's shadow on others. Direct light is linear in the lights
and separate for each object, so objects fall into groups that the same lights reach, and each group has its own cut of
the sky and its own tree of emitters: as exact as without links, and as much work for each group as for all objects
without. Rejected: a bit for each light and object in the kernels of projection, whose trees merge lights that reach an
object with others that do not.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engine.precompute.direct.pipeline import Placement, SkyState
from engine.precompute.direct.relight import is_same_sky

BLACK = (0.0, 0.0, 0.0)


class LightGroup(NamedTuple):
    """Objects that the same lights reach. number: its place among the groups; objects (M,): which they are; placement:
    with the other emitters dark; sky: the distant light that reaches them."""

    number: int
    objects: NDArray[np.bool_]
    placement: Placement
    sky: SkyState


def light_groups(placement: Placement, sky: SkyState) -> tuple[LightGroup, ...]:
    """The groups of a scene's objects, see `object_groups`, with what lights them."""
    names, groups = placement.scene.object_names, list[LightGroup]()
    for number, (objects, reaching, emitters) in enumerate(object_groups(sky, len(names))):
        dark = {names[i]: BLACK for i in np.flatnonzero(~emitters)}
        lit = placement.with_emission(dark) if dark else placement
        groups.append(LightGroup(number, objects, lit, reaching))
    return tuple(groups)


def object_groups(sky: SkyState, n_objects: int) -> list[tuple[NDArray[np.bool_], SkyState, NDArray[np.bool_]]]:
    """Groups of objects (M,), each object in one of them; the distant light that reaches them, without links; and which
    objects (M,) reach them where these emit. Those that all light reaches are first, if there are any."""
    everything = np.ones(n_objects, bool)
    numbers, whole = sky_numbers(sky, n_objects), replace(sky, links=()) if sky.links else sky
    groups = [(numbers == 0, whole, everything)] if not numbers.all() or not n_objects else []
    for i, link in enumerate(sky.links):
        emitters = everything.copy()
        emitters[sorted(link.dark)] = False
        groups.append((numbers == i + 1, link.sky, emitters))
    return groups


def emitter_reach(sky: SkyState, n_objects: int) -> NDArray[np.bool_]:
    """Which objects each object lights where it emits, (M, M): [emitter, object]."""
    reach = np.ones((n_objects, n_objects), bool)
    for link in sky.links:
        reach[np.ix_(sorted(link.dark), sorted(link.objects))] = False
    return reach


def reaching_skies(sky: SkyState, n_objects: int) -> list[SkyState]:
    """The distant light that reaches each object, without links."""
    skies = replace(sky, links=()), *(link.sky for link in sky.links)
    return [skies[number] for number in sky_numbers(sky, n_objects)]


def has_one_sky(sky: SkyState) -> bool:
    """Whether the whole sky reaches all objects: its links are of emitters alone."""
    return all(is_same_sky(link.sky, replace(sky, links=())) for link in sky.links)


def sky_numbers(sky: SkyState, n_objects: int) -> NDArray[np.int32]:
    """The distant light that reaches each object, (M,): 0 for all of it, l + 1 for that of link l."""
    numbers = np.zeros(n_objects, np.int32)
    for i, link in enumerate(sky.links):
        numbers[sorted(link.objects)] = i + 1
    return numbers
