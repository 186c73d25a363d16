"""The document that the user edits: materials, light and poses of one scene, as one immutable value.

A document is a tree of frozen dataclasses. An edit makes a new document that shares all it did not touch with the old
one, so undo, A/B comparison, autosave from a second thread and the worker's requests need no copies and no locks, and
undo restores bit by bit. Geometry and camera are not here: they are the scene's and the view's. Rejected: a mutable
model with change signals, which undo, the journal and the worker would each have to guard.

Names: a layer's *key* is ``"object.index"``; a *path* names anything that can be set, written with the layer's index or
its name: ``"teapot"``, ``"teapot.1"``, ``"teapot.coat.theta_h"``, ``"teapot.1.alpha"``, ``"teapot.1.alpha_map"``,
``"teapot.bend"``, ``"teapot.position"``, ``"bat.time"``, ``"bat.membrane.translucency"``, ``"lamp.emission"``,
``"light.rotation"``, ``"light.Noon.direction"``, ``"lamp.strength"`` (of its row in the mix,
`app.document.light_state`), ``"teapot.duplicate"``, ``"teapot.name"``, ``"teapot.deleted"``, ``"teapot.in_group"``,
``"teapot.linked"``, ``"groups.Tea.visible"``, ``"look"``.
"""

from __future__ import annotations

import difflib
import functools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from app.document.background import Background
from app.document.light_state import RGB, LightState
from app.document.linked_curves import (
    CurveLinks,
    curve_links,
    linked_layers_of,
    with_linked_curves,
    with_links_followed,
)
from app.document.linked_layers import linked_indices, with_covers, with_layer
from app.document.linked_objects import ObjectLinks, frozen_one, object_links, with_material_of
from app.document.looks import Look
from engine.core.errors import InsituError
from engine.light.cones import Cone
from engine.material.bumps import NO_BUMPS, Bumps, BumpsByObject
from engine.material.layer import Layer, object_of
from engine.material.layer_maps import LayerMaps
from engine.material.model import Factor, Model
from engine.material.opacity import OPAQUE, Opacity, OpacityByObject
from engine.realtime.zonal_harmonics.pose import Deformation, Moment, Motion, Poses, without_identity
from engine.scene.composition import Composition, ObjectSource, SceneObject
from engine.scene.description import (
    ObjectDescription,
)
from engine.scene.lamp_shape import LampShape
from engine.scene.rig import Animations
from engine.scene.surface_kinds import NO_SURFACE, DeformSurface, SurfacesByObject
from engine.scene.transform import Transform
from engine.settings import LineValue


@dataclass(frozen=True)
class Variant:
    """The material that a scene's file gives an object by the name of one of its variants; None: the object keeps what
    it has."""

    name: str
    layers: tuple[Layer, ...]
    bumps: Bumps | None = None
    opacity: Opacity | None = None
    emission: RGB | None = None

    def of(self, state: ObjectState) -> ObjectState:
        """The object with this material."""
        bumps = state.bumps if self.bumps is None else self.bumps
        opacity = state.opacity if self.opacity is None else self.opacity
        return replace(
            state, layers=self.layers, new_bumps=None if bumps == state.own_bumps else bumps,
            new_opacity=None if opacity == state.own_opacity else opacity,
            emission=state.emission if self.emission is None or not state.emits else self.emission,
        )  # fmt: skip


@dataclass(frozen=True)
class ObjectState:
    """One object of the scene: its layers, and what of it can be edited.

    One that is not ``visible`` is not there: it is not seen, shades and lights nothing. ``frozen`` objects and layers
    refuse edits of their material until they are unfrozen. ``editable`` False marks an object that the scene declares
    fixed. Its ``deformations`` apply one after another, to its pose by its file's animation at a ``moment``; None: to
    its rest pose; and its ``transform`` after these. ``animations`` are those of its file. ``new_bumps`` replace the
    ``own_bumps`` of the scene's file, ``new_opacity`` its ``own_opacity``, ``new_surface`` its ``own_surface``, which
    only Deform draws. ``emission_texture`` multiplies its emission. ``variants`` are the materials that its file gives
    it by the names of the scene's variants. ``former_name`` is its name in sessions of version 2, empty where that is
    the same. ``original`` is the object of the scene's file that it is a duplicate of, or was before it was renamed;
    empty where the file has it by its name. ``added``: what it is read from where the scene's file does not have it.
    ``in_group`` is the name of the group of objects that it is in, empty for none; ``linked`` that of the link of those
    that share its material (`app.document.linked_objects`). ``lamp`` is its shape, where it shines and has one by
    numbers, ``new_cone`` replaces the cone of that, and ``target_distance`` is how many metres away its target is;
    None: where its axis meets the ground.
    """

    name: str
    layers: tuple[Layer, ...] = ()
    emission: RGB | None = None
    editable: bool = True
    visible: bool = True
    frozen: bool = False
    deformations: tuple[Deformation, ...] = ()
    moment: Moment | None = None
    animations: Animations = ()
    transform: Transform = Transform()
    emission_texture: LayerMaps = LayerMaps()
    own_bumps: Bumps = NO_BUMPS
    new_bumps: Bumps | None = None
    own_opacity: Opacity = OPAQUE
    new_opacity: Opacity | None = None
    own_surface: DeformSurface = NO_SURFACE
    new_surface: DeformSurface | None = None
    variants: tuple[Variant, ...] = ()
    former_name: str = field(default="", compare=False)
    original: str = ""
    added: ObjectDescription | None = None
    shadow_catcher: bool = False
    in_group: str = ""
    linked: str = ""
    lamp: LampShape | None = field(default=None, compare=False)
    new_cone: Cone | None = None
    target_distance: float | None = None
    unlit: bool = field(default=False, compare=False)

    def in_variant(self, name: str) -> ObjectState:
        """The object in one of the scene's variants; as it is where it has none of that name."""
        variant = next((each for each in self.variants if each.name == name), None)
        return self if variant is None else variant.of(self)

    @property
    def is_of_file(self) -> bool:
        """Whether the scene's file has it, by its name."""
        return not self.original and self.added is None

    @property
    def source(self) -> ObjectSource:
        """The name of the object in the scene's file that it is, or is a duplicate of; or what it is read from."""
        return self.added or self.original or self.name

    @property
    def motion_stack(self) -> Motion:
        """Its animation, all its deformers, its new cone, and its transform where it was moved."""
        moment = () if self.moment is None else (self.moment,)
        return *moment, *self.deformations, *self.placement

    @property
    def placement(self) -> Motion:
        """Its new cone, and its transform where it was moved by hand."""
        cone = () if self.new_cone is None else (self.new_cone,)
        return cone if self.transform.is_identity else (*cone, self.transform)

    @property
    def cone(self) -> Cone | None:
        """The cone of a spot."""
        return self.new_cone or (None if self.lamp is None else self.lamp.cone)

    @property
    def bumps(self) -> Bumps:
        """The bumps that perturb its normals."""
        return self.own_bumps if self.new_bumps is None else self.new_bumps

    @property
    def opacity(self) -> Opacity:
        """How much of it is there."""
        return self.own_opacity if self.new_opacity is None else self.new_opacity

    @property
    def surface(self) -> DeformSurface:
        """Its surface settings for Deform, besides its material."""
        return self.own_surface if self.new_surface is None else self.new_surface

    @property
    def emits(self) -> bool:
        """Whether the scene makes it an emitter, even if it is black now; with layers it also reflects."""
        return self.emission is not None

    @property
    def is_lamp(self) -> bool:
        """Whether it only emits."""
        return self.emits and not self.layers

    @property
    def is_light(self) -> bool:
        """Whether it is a lamp that lights others, and not one that is unlit."""
        return self.is_lamp and not self.unlit


class Selection(NamedTuple):
    """The layer (and curve, when one is selected) that panels show; of a lamp, which has none, layer 0."""

    object: str
    layer: int
    factor: str | None = None

    @property
    def key(self) -> str:
        return layer_key(self.object, self.layer)

    @property
    def path(self) -> str:
        return self.key if self.factor is None else f"{self.key}.{self.factor}"


@dataclass(frozen=True)
class Document:
    """A scene's materials, light and poses. ``source`` is a built-in scene's name or the path of a scene file.

    ``first_bands``: J of the sharpest curves at the first bounce from the camera; None as many as are planned.
    ``overrides``: the lines of the plan that the user has set, by name, and their values. ``absent``: edited objects
    that the scene's files no longer have, for when they have them again (`app.document.scene_change`). ``deleted``: the
    names of objects of the file that it does not have. Duplicates stand behind their originals.
    ``background``: what is seen behind all. ``looks``: its variants, in their order (`app.document.looks`).
    ``is_open``: false while the scene is read for the first time.
    """

    source: str
    objects: tuple[ObjectState, ...] = ()
    light: LightState = LightState()
    first_bands: int | None = None
    overrides: tuple[tuple[str, LineValue], ...] = ()
    absent: tuple[ObjectState, ...] = ()
    deleted: tuple[str, ...] = ()
    background: Background = Background()
    looks: tuple[Look, ...] = ()
    is_open: bool = True

    @property
    def look(self) -> str:
        """The name of the current look, "" where there are none."""
        return next((each.name for each in self.looks if each.state is None), "")

    def object(self, name: str) -> ObjectState:
        """The object called ``name``; InsituError with the existing names when there is none."""
        for state in self.objects:
            if state.name == name:
                return state
        raise unknown("object", name, [state.name for state in self.objects])

    def layer(self, key: str) -> Layer:
        """The layer with this key (or path to a layer)."""
        found = self._layer_by_key.get(key)
        if found is None:
            name, index = split_key(self, key)
            found = self.object(name).layers[index]
        return found

    @functools.cached_property
    def _layer_by_key(self) -> dict[str, Layer]:
        """Controllers look layers up many times a frame."""
        return dict(self.layers())

    def layers(self) -> Iterator[tuple[str, Layer]]:
        """(key, layer) of all layers, in the scene's order."""
        for state in self.objects:
            for index, layer in enumerate(state.layers):
                yield layer_key(state.name, index), layer

    def with_object(self, changed: ObjectState) -> Document:
        """This document with the object of the same name replaced, and its material in those that share it."""
        self.object(changed.name)
        changed = replace(changed, layers=with_covers(changed.layers))
        linked = (with_material_of(o, changed) if o.linked and o.linked == changed.linked else o for o in self.objects)
        return replace(self, objects=tuple(changed if o.name == changed.name else o for o in linked))

    def with_layer(self, key: str, changed: Layer) -> Document:
        """This document with one layer replaced, and its curves in the layers that share them."""
        name, index = split_key(self, key)
        state = self.object(name)
        if changed.links and changed.model is not state.layers[index].model:
            changed = with_linked_curves(self, key, changed)
        found = self.with_object(replace(state, layers=with_layer(state.layers, index, changed)))
        if not self.curve_links:
            return found
        now = found.object(name).layers
        pairs = enumerate(zip(now, state.layers, strict=True))
        return with_links_followed(found, tuple(layer_key(name, i) for i, (one, two) in pairs if one is not two))

    @functools.cached_property
    def curve_links(self) -> CurveLinks:
        """The layers that share each curve that has a link (`app.document.linked_curves`). Panels ask in each frame."""
        return curve_links(self)

    @functools.cached_property
    def object_links(self) -> ObjectLinks:
        """The objects that share each material that has a link (`app.document.linked_objects`)."""
        return object_links(self)

    def is_frozen(self, key: str) -> bool:
        """Whether the layer, one that shares its curves, or an object that one of them belongs to, refuses edits."""
        name, index = split_key(self, key)
        own = [layer_key(name, i) for i in linked_indices(self.object(name).layers, index)]
        others = [other for each in own for other in linked_layers_of(self, each)] if self.curve_links else []
        return any(self.layer(each).frozen or frozen_one(self, object_of(each)) for each in (*own, *others))

    @functools.cached_property
    def variants(self) -> tuple[str, ...]:
        """The names of the scene's variants: materials of several objects that its file gives together."""
        return tuple(dict.fromkeys(each.name for state in self.objects for each in state.variants))

    @functools.cached_property
    def variant(self) -> str:
        """The variant whose materials all its objects have, "" for none. Panels ask in each frame."""
        names = self.variants
        for state in (each for each in self.objects if each.variants):
            names = tuple(name for name in names if state.in_variant(name) == state)
        return names[0] if names else ""

    @functools.cached_property
    def composition(self) -> Composition | None:
        """The objects of its scene; None where they are those of the scene's file, all of them shown. Controllers ask
        in each frame."""
        if not self.deleted and all(state.is_of_file and state.visible for state in self.objects):
            return None
        return tuple(SceneObject(state.name, state.source, not state.visible) for state in self.objects)

    @property
    def shown(self) -> tuple[ObjectState, ...]:
        """The objects that are not hidden: what is edited of others does not concern the picture."""
        return tuple(state for state in self.objects if state.visible)

    @functools.cached_property
    def groups(self) -> dict[str, tuple[str, ...]]:
        """The names of the objects in each group of objects, by its name. Panels ask in each frame."""
        found: dict[str, list[str]] = {}
        for state in self.objects:
            if state.in_group:
                found.setdefault(state.in_group, []).append(state.name)
        return {group: tuple(names) for group, names in found.items()}

    @property
    def shadow_catchers(self) -> tuple[str, ...]:
        """The names of the shown objects of which pictures show the shadows on them alone."""
        return tuple(state.name for state in self.shown if state.shadow_catcher)

    @property
    def hides_environment(self) -> bool:
        """Whether stills are drawn without the environment first, with alpha."""
        return self.background.hides_environment or bool(self.shadow_catchers)

    @property
    def added_sources(self) -> tuple[ObjectDescription, ...]:
        """What those of its objects are read from that the scene's file does not have, absent ones too, each once."""
        return tuple(dict.fromkeys(state.added for state in (*self.objects, *self.absent) if state.added is not None))

    @property
    def poses(self) -> Poses:
        """The poses of all shown objects that are not as the scene's file has them, by name."""
        return without_identity([(state.name, state.motion_stack) for state in self.shown])

    @property
    def new_bumps(self) -> BumpsByObject:
        """The bumps of all shown objects that are not as the scene's file has them, by name."""
        return tuple((state.name, state.new_bumps) for state in self.shown if state.new_bumps is not None)

    @property
    def new_opacities(self) -> OpacityByObject:
        """The opacities of all shown objects that are not as the scene's file has them, by name."""
        return tuple((state.name, state.new_opacity) for state in self.shown if state.new_opacity is not None)

    @property
    def new_surfaces(self) -> SurfacesByObject:
        """The surfaces for Deform of all shown objects that are not as the scene's file has them, by name."""
        return tuple((state.name, state.new_surface) for state in self.shown if state.new_surface is not None)

    def is_visible(self, key: str) -> bool:
        """Whether the layer takes part in the picture."""
        name, index = split_key(self, key)
        state = self.object(name)
        return state.visible and state.layers[index].visible


def layer_key(object_name: str, index: int) -> str:
    return f"{object_name}.{index}"


def split_key(document: Document, key: str) -> tuple[str, int]:
    """(object name, layer index) of a layer's key; the layer may be written by its name."""
    state, rest = split_object(document, key)
    if rest:
        index, tail = split_layer(state, rest)
        if not tail:
            return state.name, index
    raise InsituError(f"{key!r} is not a layer; layers of this scene: {', '.join(k for k, _ in document.layers())}")


def all_factors(model: Model) -> tuple[Factor, ...]:
    """The editable curves of a model: those of its transport, then the view's; shared ones once."""
    there = model.factors if model.view_factor is None else (*model.factors, model.view_factor)
    return tuple(factor for factor in there if factor.name not in model.shared)


def split_object(document: Document, path: str) -> tuple[ObjectState, str]:
    """The object that a path begins with, and the rest of the path."""
    name, _, rest = path.partition(".")
    return document.object(name), rest


def split_layer(state: ObjectState, rest: str) -> tuple[int, str]:
    """The index of the layer that ``rest`` begins with (number or name) and what follows."""
    names = [layer.name for layer in state.layers]
    head, _, tail = rest.partition(".")
    if head.isdecimal() and head.isascii() and len(head) < 6 and int(head) < len(names):
        return int(head), tail
    if head and head in names:
        return names.index(head), tail
    there = [f"{index}" + (f" ({name})" if name else "") for index, name in enumerate(names)]
    raise unknown(f"layer of {state.name}", head, there)


def unknown(what: str, name: str, there: Iterable[str]) -> InsituError:
    """The error for a name that is not there: it offers the closest, and lists all."""
    options = list(there)
    close = difflib.get_close_matches(name, options, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return InsituError(f"there is no {what} {name!r}; {hint}available: {', '.join(options) or 'none'}")


def reflecting_layers(document: Document) -> tuple[tuple[str, Layer], ...]:
    """The visible layers of all objects, by key."""
    return tuple((key, layer) for key, layer in document.layers() if document.is_visible(key))
