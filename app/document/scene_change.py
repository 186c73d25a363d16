"""Carries edits over to a scene whose files another program has saved again.

Three documents meet: the scene as its files had it (`base`), the user's, and the scene as its files have it now. Object
by object and layer by layer, by name, what the user has changed stays, and what they have not touched follows the
files. The same rule applies to every document of the history, so that undo goes on as before: reading files again is no
step of it, because the old files are gone.

An edited object that the files no longer have stays in `Document.absent`, and returns with its object; a program that
leaves out an object by mistake costs no edits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any

from app.document.document import Document, ObjectState
from app.document.light_state import LightState
from app.document.linked_layers import Layers, synchronize_layers
from app.document.looks import absent_of_looks, in_all_looks, in_look, objects_of_looks
from app.document.scene_objects import NONE_ADDED, AddedStates, in_scene_order, with_free_names
from engine.light.cones import Cone
from engine.material.layer import Layer
from engine.scene.composition import ObjectSource
from engine.scene.description import SceneDescription
from engine.scene.import_report import ImportReport

# Fields of an object that are the file's until the user changes them.
_SWITCHES = ("editable", "visible", "frozen", "shadow_catcher", "emission")
_PAIRS = ("parameters", "edits")  # of a layer: (name, value) each
Pairs = tuple[tuple[str, Any], ...]


class SceneChange:
    """Applies to documents what changed in a scene's files. names: for objects of `scene` that are parts of a mesh
    file, their names in `base` (parts are numbered, and found again by their material). Another object that has such a
    name now is a new one. had, added: the objects that the scene's file does not have, as they were read before and
    now; they follow their files as the others do."""

    def __init__(
        self, base: Document, scene: Document, names: Mapping[str, str] | None = None,
        had: AddedStates = NONE_ADDED, added: AddedStates = NONE_ADDED,
    ) -> None:  # fmt: skip
        self._base = {state.name: state for state in base.objects}
        self._scene, self._light, self._had, self._added = scene, base.light, had, added
        known = names or {}
        taken = set(known.values())
        own = {state.name: "" if state.name in taken else state.name for state in scene.objects}
        self._names = own | {name: known[name] for name in own.keys() & known.keys()}
        # Documents of a history share most objects. The objects are held, so that their numbers stay theirs.
        self._merged: dict[tuple[int, str], tuple[ObjectState, ObjectState]] = {}

    def __call__(self, document: Document) -> Document:
        """The document for the scene as it is now, in all its looks."""
        return in_all_looks(document, self._merged_look)

    def _merged_look(self, document: Document) -> Document:
        there = {state.name: state for state in (*document.absent, *document.objects)}
        known = {name: state for name, state in there.items() if state.is_of_file}
        stay = [own for own in self._scene.objects if self._names[own.name] not in document.deleted]
        others = [
            replace(self._object(state, own), name=state.name, original=own.name)
            for state in there.values() if state.original
            for own in self._scene.objects if self._names[own.name] == state.original
        ]  # fmt: skip
        others += [
            self._object(state, replace(self._added[state.added], name=state.name))
            for state in there.values() if state.added is not None and state.added in self._added
        ]  # fmt: skip
        merged = [self._object(known.get(self._names[own.name]), own) for own in stay]
        merged = with_free_names(merged, {state.name for state in others})
        objects = in_scene_order([*merged, *others], self._scene)
        taken = {state.name for state in objects}
        absent = tuple(there[name] for name in self.gone(document) if name not in taken)
        by_name = {state.name for state in merged if state.is_of_file}
        deleted = tuple(own.name for own in self._scene.objects if own.name not in by_name)
        light = document.light.with_renamed_rows({was: now for now, was in self._names.items() if was})
        light = _merge_light(light, self._light, self._scene.light)
        return replace(
            document, source=self._scene.source, objects=objects, absent=absent, light=light, deleted=deleted
        )

    def gone(self, document: Document) -> tuple[str, ...]:
        """The objects of the document that the scene no longer has, and that are edited in one of its looks."""
        found: set[ObjectSource] = {*self._names.values(), *self._added}
        edited = [
            state.name for state in (*absent_of_looks(document), *objects_of_looks(document))
            if state.source not in found and state != self._base.get(state.name)
        ]  # fmt: skip
        return tuple(dict.fromkeys(edited))

    def lost_parts(self, document: Document) -> tuple[str, ...]:
        """The edited suns that the files no longer have, and such layers of objects that they have: their edits cannot
        wait."""
        looks = [document, *(in_look(document, each.name) for each in document.looks if each.state is not None)]
        return tuple(dict.fromkeys(name for look in looks for name in self._lost_parts(look)))

    def _lost_parts(self, document: Document) -> list[str]:
        there = {state.name: state for state in document.objects}
        now = [sun.name for sun in self._scene.light.own_suns]
        before = {sun.name: sun for sun in self._light.own_suns}
        found = [
            sun.name for sun in document.light.suns
            if sun.name in before and sun != before[sun.name] and sun.name not in now
        ]  # fmt: skip
        for own in self._scene.objects:
            name = self._names[own.name]
            if name in there and name in self._base:
                lost = _lost_layers(there[name].layers, self._base[name].layers, own.layers)
                found += [f"{own.name} {layer}" for layer in lost]
        return found

    def name_now(self, name: str) -> str:
        """The name of an object that had this one; "" where the scene no longer has it."""
        return next((now for now, before in self._names.items() if before == name), "")

    def _object(self, edited: ObjectState | None, own: ObjectState) -> ObjectState:
        """An object as the user has edited it, on top of what its file says now."""
        if edited is None:
            return own
        key = id(edited), own.name
        if key not in self._merged:
            base = self._base.get(edited.original or edited.name) if own.added is None else self._had.get(own.added)
            self._merged[key] = edited, self._merge(edited, base, own)
        return self._merged[key][1]

    def _merge(self, edited: ObjectState, base: ObjectState | None, own: ObjectState) -> ObjectState:
        kept = {name: getattr(edited, name) for name in _SWITCHES if base is None or _differ(edited, base, name)}
        if not own.emits or kept.get("emission") is None:
            kept.pop("emission", None)
        clips = [each.name for each in own.animations]
        moment = edited.moment if edited.moment is not None and edited.moment.clip in clips else None
        bumps, opacity, surface = edited.new_bumps, edited.new_opacity, edited.new_surface
        merged = replace(
            own, **kept, layers=_merge_layers(edited.layers, None if base is None else base.layers, own.layers),
            deformations=edited.deformations, moment=moment, transform=edited.transform, in_group=edited.in_group,
            linked=edited.linked,
            new_cone=_kept_cone(edited.new_cone, own), target_distance=edited.target_distance,
            new_bumps=None if own.is_lamp or bumps == own.own_bumps else bumps,
            new_opacity=None if own.is_lamp or opacity == own.own_opacity else opacity,
            new_surface=None if own.is_lamp or surface == own.own_surface else surface,
        )  # fmt: skip
        return merged.in_variant(_chosen_variant(edited, base))


def _merge_light(edited: LightState, base: LightState, own: LightState) -> LightState:
    """The light field by field, and each sun as well, by its name; added ones stay, and deleted ones stay away."""
    before, theirs = ({sun.name: sun for sun in light.own_suns} for light in (base, own))
    suns = [
        theirs[sun.name]._replace(**{
            name: value for name, value in sun._asdict().items() if value != getattr(before[sun.name], name)
        })
        if sun.name in before and sun.name in theirs else sun
        for sun in edited.suns
    ]  # fmt: skip
    merged = replace(_merge_fields(edited, base, own), own_suns=base.own_suns).with_suns(suns)
    return merged.with_own_suns(own.own_suns)


def _kept_cone(cone: Cone | None, own: ObjectState) -> Cone | None:
    """An edited cone, where the lamp still has another one."""
    return None if own.cone is None or cone == own.cone else cone


def _differ(edited: Any, base: Any, name: str) -> bool:
    return bool(getattr(edited, name) != getattr(base, name))


def _chosen_variant(edited: ObjectState, base: ObjectState | None) -> str:
    """The variant that the user has chosen for an object, and not edited, so that it follows the file; "" for none."""
    if base is None or edited.layers == base.layers:
        return ""
    return next((each.name for each in base.variants if each.of(edited) == edited), "")


def _merge_layers(edited: Layers, base: Layers | None, own: Layers) -> Layers:
    """The layers of an object; the user's where they have replaced, added or removed one."""
    if not own or edited == base:
        return own
    if base is None or _kinds(edited) != _kinds(base):
        return edited
    before = dict(zip(_kinds(base), zip(edited, base, strict=True), strict=True))
    return synchronize_layers(
        tuple(
            _merge_layer(*before[kind], layer) if kind in before else layer
            for kind, layer in zip(_kinds(own), own, strict=True)
        )
    )


def _lost_layers(edited: Layers, base: Layers, own: Layers) -> list[str]:
    """The names of edited layers that the file no longer has."""
    if not own or _kinds(edited) != _kinds(base):
        return []
    there = set(_kinds(own))
    return [
        mine.name for kind, mine, before in zip(_kinds(base), edited, base, strict=True)
        if kind not in there and mine.replace(covers=()) != before.replace(covers=())
    ]  # fmt: skip


def _kinds(layers: Layers) -> list[tuple[str, str, bool]]:
    """What tells layers of an object apart: two with the same are different materials' (names differ in an object)."""
    return [(layer.name, layer.model.name, layer.rises) for layer in layers]


def _merge_layer(edited: Layer, base: Layer, own: Layer) -> Layer:
    """A layer field by field: parameters and curves one by one."""
    pairs = {name: _merge_pairs(*(getattr(each, name) for each in (edited, base, own))) for name in _PAIRS}
    return replace(_merge_fields(edited, base, own), **pairs)


def _merge_pairs(edited: Pairs, base: Pairs, own: Pairs) -> Pairs:
    """Named values: those that the user has changed, added or removed are theirs."""
    mine, before, found = dict(edited), dict(base), dict(own)
    for name in mine.keys() | before.keys():
        if mine.get(name) == before.get(name):
            continue
        if name in mine:
            found[name] = mine[name]
        else:
            found.pop(name, None)
    order = [*dict(own), *sorted(found.keys() - dict(own).keys())]
    return tuple((name, found[name]) for name in order if name in found)


def _merge_fields(edited: Any, base: Any, own: Any) -> Any:
    """A dataclass with the fields that the user has changed; all others are the file's."""
    return replace(
        own, **{f.name: getattr(edited, f.name) for f in fields(own) if f.init and _differ(edited, base, f.name)}
    )


def matching_parts(
    before: SceneDescription, old: ImportReport, now: SceneDescription, new: ImportReport
) -> dict[str, str]:
    """For objects that are parts of a mesh file and have other numbers than before, the names that they had: those of
    the part with the same material, where a single one has it."""
    had, have = _parts_by_material(before, old), _parts_by_material(now, new)
    return {name: had[part] for part, name in have.items() if part in had}


def _parts_by_material(description: SceneDescription, report: ImportReport) -> dict[tuple[str, str], str]:
    """The names of parts by file and material, without materials that several parts have."""
    materials = {item.name: item.material for item in report.objects}
    found: dict[tuple[str, str], list[str]] = {}
    for item in description.objects:
        if item.part is not None and item.mesh is not None and (material := materials.get(item.name)):
            found.setdefault((item.mesh, material), []).append(item.name)
    return {part: names[0] for part, names in found.items() if len(names) == 1}
