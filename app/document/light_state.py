"""The light of a document: the environment with its suns, and the mix of all lights.

The mix has a row for each light: each emitter, each sun, and the environment. A row multiplies what its light sends;
what that is (an emitter's radiance, a sun's irradiance, the environment's map) stands where it stood before. So a row
that is as at first is no edit, a light that is off keeps its strength, and pictures of single lights, weighted by the
gains of their rows, sum to the picture. As in Blender a light's exposure and temperature multiply its power. Rejected:
strength and colour as an emitter's radiance itself, which has no zero of its stops, and is lost where a light is black.

A row's *key* begins the paths of its values: ``"lamp"``, ``"light.Noon"`` (a sun), ``"light.environment"``, and
``"light.painted.Fill"`` (a painted light), and ``"light.groups.Key"`` for all lights whose group is "Key":
``"lamp.strength"``, ``"light.groups.Key.solo"``.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping as NameMap
from dataclasses import dataclass, replace
from functools import cached_property

from app.system.paths import is_file_name
from engine.core.blackbody import blackbody_colour
from engine.light.map_changes import MapChange
from engine.light.painted_lights import PaintedLight
from engine.light.probe_mappings import Mapping
from engine.light.sides import SIDES
from engine.light.suns import Sun

RGB = tuple[float, float, float]

SCENE_ENVIRONMENT = "scene"
CONSTANT_ENVIRONMENT = "constant"
ENVIRONMENT_KEY = "light.environment"
# What no sun is called: their keys begin as those of suns do.
NO_SUNS = ("environment", "groups", "painted", "sides")
MIX_FIELDS = ("on", "solo", "strength", "colour", "kelvin", "group", "excludes")


@dataclass(frozen=True)
class MixRow:
    """A light in the mix. strength: in stops; colour: linear Rec. 709; kelvin: the temperature of a black body, whose
    colour is used in place of `colour`; 0 for none. solo: lights that are not solo are off where any is. group: the
    name of its group, whose row multiplies it as well; a group's own row has none. excludes: the names of objects that
    it does not light, sorted, as Blender's light linking excludes receivers; their shadows stay."""

    on: bool = True
    solo: bool = False
    strength: float = 0.0
    colour: RGB = (1.0, 1.0, 1.0)
    kelvin: float = 0.0
    group: str = ""
    excludes: tuple[str, ...] = ()

    @cached_property
    def gain(self) -> RGB:
        """The factor of each channel, 0 for a light that is off."""
        if not self.on:
            return 0.0, 0.0, 0.0
        factor = 2.0**self.strength
        return scaled(self.tint, (factor, factor, factor))

    @property
    def tint(self) -> RGB:
        """Its colour, or that of its temperature."""
        return blackbody_colour(self.kelvin) if self.kelvin else self.colour


PLAIN_ROW = MixRow()
# The rows that are not as at first, by their keys, in their order.
Mix = tuple[tuple[str, MixRow], ...]


def sun_key(name: str) -> str:
    """The key of a sun's row."""
    return f"light.{name}"


def side_key(name: str) -> str:
    """The key of the row of one of the environment's sides (`engine.light.sides`)."""
    return f"light.sides.{name}"


def painted_key(name: str) -> str:
    """The key of a painted light's row."""
    return f"light.painted.{name}"


def group_key(name: str) -> str:
    """The key of a group's row."""
    return f"light.groups.{name}"


def group_of(key: str) -> str:
    """The name of the group whose row has this key; "" for the row of a light."""
    return key.removeprefix(group_key("")) if key.startswith(group_key("")) else ""


def scaled(colour: RGB, gain: RGB) -> RGB:
    """A colour times a gain, channel by channel."""
    return colour[0] * gain[0], colour[1] * gain[1], colour[2] * gain[2]


@dataclass(frozen=True)
class LightState:
    """The environment, its rotation and intensity, and the mix of all lights.

    ``environment`` is ``"scene"`` (that of the scene file, with its ``scale``), ``"constant"`` (``radiance`` from
    everywhere), a built-in environment's name or a file's path, read with ``mapping``. ``rotation`` in degrees rotates
    it counter-clockwise about +Y seen from above. ``intensity`` multiplies all light, emitters included: it is applied
    to the finished picture, so it costs nothing and transport does not depend on it. ``new_suns`` replace the
    ``own_suns`` of the scene's file; they turn with the environment. One that has the name of none of the file's was
    added, one of the file's whose name none has was deleted; one that was renamed is both.

    ``painted`` are lights that are painted onto the environment, the first one at the bottom. ``tilt`` in degrees
    raises what is in its middle, painted lights and suns with it, before it is rotated. ``hue`` (degrees),
    ``contrast`` and ``clamp`` (0: none) change the map alone (`engine.light.map_changes`). ``sides``: whether the map
    is split into six lights, which the environment's row multiplies like that of a group.
    """

    environment: str = SCENE_ENVIRONMENT
    mapping: Mapping = "latlong"
    rotation: float = 0.0
    intensity: float = 1.0
    radiance: RGB | None = None
    own_suns: tuple[Sun, ...] = ()
    new_suns: tuple[Sun, ...] | None = None
    mix: Mix = ()
    painted: tuple[PaintedLight, ...] = ()
    tilt: float = 0.0
    hue: float = 0.0
    contrast: float = 1.0
    clamp: float = 0.0
    sides: bool = False

    def has_sky(self, of_scene: bool) -> bool:
        """Whether an environment lights the scene. of_scene: whether its file has one."""
        return of_scene or self.environment != SCENE_ENVIRONMENT or bool(self.painted)

    @property
    def map_change(self) -> MapChange:
        """The changes of the map as a whole."""
        return MapChange(self.hue, self.contrast, self.clamp)

    @property
    def suns(self) -> tuple[Sun, ...]:
        """The suns that shine, whatever the environment is; their names differ."""
        return self.own_suns if self.new_suns is None else self.new_suns

    @property
    def added_suns(self) -> tuple[str, ...]:
        """The names of the suns that the scene's file does not have."""
        own = {each.name for each in self.own_suns}
        return tuple(each.name for each in self.suns if each.name not in own)

    @property
    def deleted_suns(self) -> tuple[str, ...]:
        """The names of the suns of the scene's file that it does not have."""
        there = {each.name for each in self.suns}
        return tuple(each.name for each in self.own_suns if each.name not in there)

    def with_suns(self, suns: Iterable[Sun]) -> LightState:
        """The light with these suns and no others."""
        found = tuple(suns)
        return replace(self, new_suns=None if found == self.own_suns else found)

    def with_own_suns(self, own: tuple[Sun, ...]) -> LightState:
        """The light for a scene whose file has other suns now. Those that were edited stay so where the file still has
        them, deleted ones stay away, added ones stay; new ones of the file come."""
        edited = {each.name: each for each in self.suns}
        before = {each.name for each in self.own_suns}
        found = [edited.get(each.name, each) for each in own if each.name in edited or each.name not in before]
        names = {each.name for each in own}
        added = [edited[name] for name in self.added_suns if name not in names]
        return replace(self, own_suns=own).with_suns((*found, *added))

    def with_renamed_sun(self, before: str, name: str) -> LightState:
        """The light with another name of a sun, whose row in the mix follows."""
        suns = (each._replace(name=name) if each.name == before else each for each in self.suns)
        return self.with_suns(suns).with_renamed_rows({sun_key(before): sun_key(name)})

    @property
    def is_file(self) -> bool:
        """Whether the environment is a file that was opened: built-in ones have names without a suffix."""
        return is_file_name(self.environment)

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of the rows of all lights: the environment or its sides, the suns and the painted lights."""
        suns, painted = (sun_key(each.name) for each in self.suns), (painted_key(each.name) for each in self.painted)
        return *self.environment_keys, *suns, *painted

    @property
    def environment_keys(self) -> tuple[str, ...]:
        """The keys of the environment's rows that are lights: its own, or those of its sides."""
        return tuple(map(side_key, SIDES)) if self.sides else (ENVIRONMENT_KEY,)

    def rows_over(self, key: str) -> tuple[MixRow, ...]:
        """The rows that multiply a light's: its group's, and of a side those of the environment and its group."""
        group = self.row(key).group
        found = (self.row(group_key(group)),) if group else ()
        is_side = self.sides and key in self.environment_keys
        return (*found, self.row(ENVIRONMENT_KEY), *self.rows_over(ENVIRONMENT_KEY)) if is_side else found

    @property
    def groups(self) -> tuple[str, ...]:
        """The names of the groups that lights are in, sorted."""
        return tuple(sorted({row.group for _, row in self.mix if row.group}))

    @property
    def exclusions(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """What rows exclude, by their keys."""
        return tuple((key, row.excludes) for key, row in self.mix if row.excludes)

    def row(self, key: str) -> MixRow:
        """The row of a light or group, as at first where it has not been edited."""
        return dict(self.mix).get(key, PLAIN_ROW)

    def with_row(self, key: str, row: MixRow) -> LightState:
        """The light with another row of this key."""
        return self.with_rows({**dict(self.mix), key: row})

    def with_rows(self, rows: NameMap[str, MixRow]) -> LightState:
        """The light with these rows, by key, and no others."""
        return replace(self, mix=tuple((key, rows[key]) for key in sorted(rows) if rows[key] != PLAIN_ROW))

    def with_renamed_group(self, before: str, name: str) -> LightState:
        """The light with another name of a group, whose lights join the group that has it; "" dissolves the group."""
        edited = dict(self.mix)
        rows = {
            key: replace(row, group=name) if row.group == before else row
            for key, row in edited.items() if key != group_key(before)
        }  # fmt: skip
        if name:
            rows.setdefault(group_key(name), edited.get(group_key(before), PLAIN_ROW))
        return self.with_rows(rows)

    def with_duplicate(self, name: str, of: str) -> LightState:
        """The light for a duplicate of an object: its row is like the object's, and lights exclude both or none."""
        rows = {
            key: replace(row, excludes=tuple(sorted({*row.excludes, name}))) if of in row.excludes else row
            for key, row in self.mix
        }  # fmt: skip
        return self.with_rows({**rows, name: rows.get(of, PLAIN_ROW)})

    def without_object(self, name: str) -> LightState:
        """The light without the row of an object or a sun, which no other row excludes."""
        return self.with_rows({
            key: replace(row, excludes=tuple(each for each in row.excludes if each != name))
            for key, row in self.mix if key != name
        })  # fmt: skip

    def with_renamed_rows(self, names: NameMap[str, str]) -> LightState:
        """The light with rows of objects that have other names now. names: those, by the names before."""

        def renamed(row: MixRow) -> MixRow:
            return replace(row, excludes=tuple(sorted(names.get(each, each) for each in row.excludes)))

        return self.with_rows({names.get(key, key): renamed(row) for key, row in self.mix})
