"""Geometry, materials, cameras and lights of a USD file (.usd, .usda, .usdc, .usdz): every surface under the transforms
of its prims, in metres with Y up, sorted by material.

usd-core parses and composes the layers in a process of its own (`usd_stage`), which gets them as bytes (`usd_layers`);
what comes back is checked here like any file. The stage is shown at its start time, with its default variants, without
shapes for a proxy or a guide. Instances are placed by their prototypes, point instancers by their matrices, without a
copy of a surface for each before all is counted. If transforms are animated, each part has a rig (`usd_rig`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from engine.core.errors import LoadError, describe_value, list_names, printable_name
from engine.core.native_decoders import Arrays
from engine.scene.loaders.baked_maps import BakedMap, MapMaker
from engine.scene.loaders.gltf_materials import LONGEST_NAME
from engine.scene.loaders.model import ImportedModel, UnshownProperty, VariantSet
from engine.scene.loaders.usd_bindings import UsdBindings
from engine.scene.loaders.usd_cameras import read_cameras
from engine.scene.loaders.usd_domes import UsdDomes
from engine.scene.loaders.usd_layers import ArchiveFiles, UsdLayers, open_layers
from engine.scene.loaders.usd_lights import CONVERTED, LIGHTS, UsdLights
from engine.scene.loaders.usd_materials import UsdMaterials
from engine.scene.loaders.usd_parts import Look, Parts, Place, Placed
from engine.scene.loaders.usd_prims import MAX_DEPTH, Float64Array, UsdPrim, UsdScene, scene_of_tree
from engine.scene.loaders.usd_rig import Samples, UsdNodes, samples_of
from engine.scene.loaders.usd_shapes import SHAPES
from engine.scene.loaders.usd_textures import UsdTextures
from engine.scene.loaders.usd_unshown import unshown_properties
from engine.scene.variant_choice import choices_text

# Limit of what small files may cost: prims that are placed, plus one for every byte.
MOST_PLACED = 200_000
_GROUPS = frozenset({"", "Xform", "Scope", "SkelRoot", "GeomSubset", "PointInstancer"})
_Y_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
_SHADING = frozenset({"Material", "Shader", "NodeGraph"})
_PURPOSES = ("default", "render")


def read_usd(path: Path, variants: Mapping[str, str] = MappingProxyType({})) -> ImportedModel:
    """Read a USD file with these variants of its sets, by the names of the sets; raises LoadError naming the prim and
    what was expected there."""
    return _read(path, variants)[0]


def usd_image_reader(path: Path, variants: Mapping[str, str] = MappingProxyType({})) -> Callable[[int], bytes]:
    """A function from a number to the bytes of that file of a .usdz archive, or, from their number on, of a map that a
    network of MaterialX computes under these variants; both raise LoadError."""
    files = ArchiveFiles(path)
    computed: list[BakedMap] = []

    def read(number: int) -> bytes:
        if number < files.count:
            return files.read(number)
        if not computed:
            computed.extend(_read(path, variants)[1].maps)
        if number - files.count >= len(computed):
            raise LoadError(path, f"image {number}", "nothing", f"a number below {files.count + len(computed)}")
        return computed[number - files.count].exr()

    return read


def _read(path: Path, variants: Mapping[str, str]) -> tuple[ImportedModel, MapMaker]:
    """The model of a file, and the maps that its networks compute."""
    layers = open_layers(path)
    tree, arrays = layers.tree(variants)
    scene = scene_of_tree(path, tree, arrays)
    sets = _variant_sets(path, tree, variants)
    walk = _Walk(scene, MOST_PLACED + layers.n_bytes)
    walk.run()
    maps = MapMaker(layers.n_files, f"@{choices_text(variants)}" if variants else "")
    textures = UsdTextures(scene, layers)
    materials = UsdMaterials(scene, textures, maps)
    looks = _looks(path, tree, arrays, layers, maps)
    skins = UsdBindings(scene, walk.nodes, walk.skeletons)
    skins.add_joints()
    parts = Parts(scene, materials, looks, skins if skins.are_moving else None, layers.n_bytes)
    for placed in walk.surfaces.values():
        parts.add(placed)
    found = parts.join()
    if not found:
        why = f": {next(iter(scene.log.notes))}" if scene.log.notes else ""
        raise LoadError(path, "faces", 0, f"at least one surface in the stage{why}")
    if looks:
        _merge_reports(scene, looks)
    lights = UsdLights(scene.metres, UsdDomes(layers, scene), textures)
    for prim, matrix in walk.lights:
        lights.add(prim, matrix)
    dome = lights.domes.environment()
    low, high = (end([end(part.mesh.vertices, axis=0) for part in found], axis=0) for end in (np.min, np.max))
    cameras = read_cameras(walk.cameras, (low + high) / 2.0)
    notes = [*scene.log.notes, *([CONVERTED] if walk.lights else []), *_composition_notes(tree)]
    read = [prim for prim in scene.prims if prim.kind in _SHADING and id(prim.values) in scene.log.read]
    visited = walk.visited | _with_graphs(scene, read)
    listed = unshown_properties(scene, visited, skins.played - skins.resting)
    unshown = [*layers.list_unshown(), *_of_stage(tree), *listed]
    model = ImportedModel(
        tuple(found), tuple(notes), cameras, tuple(unshown), lights=tuple(lights.lights), lamps=tuple(lights.lamps),
        dome=dome, variant_sets=sets,
    )  # fmt: skip
    return model, maps


def _variant_sets(path: Path, tree: dict[str, Any], chosen: Mapping[str, str]) -> tuple[VariantSet, ...]:
    """The sets of variants of a decoder's tree. Raises LoadError where these are none, or lack one that is chosen."""
    try:
        rows = [(str(name), str(own), tuple(map(str, names))) for name, (own, names) in tree["sets"].items()]
    except (AttributeError, KeyError, TypeError, ValueError):
        raise LoadError(path, "USD", "makes the decoder answer nonsense", "a sound USD file") from None
    there = {name: names for name, _, names in rows}
    # Without those that differ in materials alone, which are variants of objects.
    offered = {name for prim in tree.get("prims", ()) for name in prim.get("variants", ())}
    for name, variant in chosen.items():
        if name not in there:
            known = f"one of {list_names(there)}" if there else "none: the stage has no sets of variants"
            raise LoadError(path, "set of variants", name, known)
        if variant not in there[name]:
            raise LoadError(path, f"variant of {printable_name(name, LONGEST_NAME)}", variant, list_names(there[name]))
    return tuple(VariantSet(name, names, own) for name, own, names in rows if name in offered)


def _looks(path: Path, tree: dict[str, Any], arrays: Arrays, layers: UsdLayers, maps: MapMaker) -> list[Look]:
    """The variants of a decoder's tree; raises LoadError where these are none."""
    found = []
    try:
        rows = [(str(each["name"]), each["prims"]) for each in tree.get("looks", [])]
    except (KeyError, TypeError):
        raise LoadError(path, "USD", "makes the decoder answer nonsense", "a sound USD file") from None
    for given, prims in rows:
        scene, name = scene_of_tree(path, {**tree, "prims": prims}, arrays), printable_name(given, LONGEST_NAME)
        found.append(Look(name, scene, UsdMaterials(scene, UsdTextures(scene, layers), maps)))
    return found


def _merge_reports(scene: UsdScene, looks: list[Look]) -> None:
    """Add what materials of variants read, note and do not show."""
    for look in looks:
        log = look.scene.log
        for prim in look.scene.prims:
            own = scene.by_path.get(prim.place)
            if own is not None and own.kind in _SHADING and id(prim.values) in log.read:
                own.mark_read(*log.read[id(prim.values)])
        for listed, count in log.unshown.items():
            scene.log.unshown.setdefault(listed, count)
        scene.log.notes.update(log.notes)


class _Walk:
    """The walk over a stage, from which follow all places: of surfaces, lights and cameras."""

    def __init__(self, scene: UsdScene, most: int) -> None:
        self._scene, self._left = scene, most
        self.nodes = UsdNodes()
        self.surfaces: dict[tuple[str, str], Placed] = {}
        self.lights: list[tuple[UsdPrim, Float64Array]] = []
        self.cameras: list[tuple[UsdPrim, Float64Array]] = []
        self.skeletons: dict[str, int] = {}
        self.visited: set[str] = set()
        self._hidden: dict[str, bool] = {}

    def run(self) -> None:
        """Visit the stage. Raises LoadError."""
        scene = self._scene
        root = (_Y_UP if scene.up == "Z" else np.eye(4)) @ np.diag([scene.metres] * 3 + [1.0])
        top = Place(self.nodes.add(-1, root), root)
        stack = [(prim, top) for prim in reversed(scene.children(scene.prims[0]))] if scene.prims else []
        while stack:
            prim, place = stack.pop()
            below = self._visit(prim, place, top)
            if below is not None:
                stack += [(child, below) for child in reversed(self._children(prim))]
                if prim.kind == "PointInstancer":
                    stack += self._instances(prim, below)

    def _children(self, prim: UsdPrim) -> list[UsdPrim]:
        """The prims below one, or below its prototype; not those of a point instancer, which are only its
        prototypes."""
        if prim.kind == "PointInstancer":
            return []
        prototype = prim.own.get("prototype")
        if prototype is None:
            return self._scene.children(prim)
        source = self._scene.by_path.get(str(prototype))
        return [] if source is None else self._scene.children(source)

    def _visit(self, prim: UsdPrim, place: Place, top: Place) -> Place | None:
        """Place a prim; returns where those below it are, None where these are not shown."""
        self._spend(prim, 1 if place.maps is None else len(place.maps))
        if place.depth > MAX_DEPTH:
            raise prim.error("depth", "too deep, or instances in themselves", f"at most {MAX_DEPTH} levels")
        if prim.is_off and not place.is_forced:
            if prim.own["off"] == "inactive" and prim.place not in self._hidden:
                prim.not_shown("active", "what is switched off in the file is not shown")
                self._hidden[prim.place] = True
            return None
        if prim.place not in self._hidden:
            self._hidden[prim.place] = self._meet(prim)
        if self._hidden[prim.place]:
            return None
        try:
            below = self._below(prim, place, top)
        except LoadError as error:
            prim.leave_out("xformOpOrder", f"what hangs from it has no place, and is not shown: {error.reason}")
            return None
        matrix = below.matrix if below.maps is None else below.matrix @ below.maps[0]
        if prim.kind in ("Mesh", *SHAPES):
            key = prim.place, below.material
            found = self.surfaces.setdefault(key, Placed(prim, below.material))
            found.places.append(below)
        elif prim.kind in LIGHTS:
            self.lights.append((prim, matrix))
        elif prim.kind == "Camera":
            self.cameras.append((prim, matrix))
        elif prim.kind == "Skeleton" and below.maps is None:
            self.skeletons.setdefault(prim.place, below.node)
            prim.log.left_out.add(id(prim.values))
        elif prim.kind not in _GROUPS:
            prim.log.left_out.add(id(prim.values))
        return below

    def _meet(self, prim: UsdPrim) -> bool:
        """Whether a prim that is met for the first time is hidden, or no part of the picture by itself; list what of it
        is not shown."""
        if prim.kind in _SHADING:
            return True
        if prim.word("visibility", "inherited") == "invisible":
            prim.not_shown("visibility", "what is hidden in the file is not shown")
            return True
        purpose = prim.word("purpose", "default")
        if purpose not in _PURPOSES:
            prim.not_shown("purpose", f"shapes for {describe_value(purpose)} are not shown")
            return True
        self.visited.add(prim.place)
        prim.mark_read(*(key for key in prim.values if key.startswith("xformOp")))
        self._list_once(prim)
        return False

    def _below(self, prim: UsdPrim, place: Place, top: Place) -> Place:
        """Where a prim's surface and those below it are."""
        own, material, depth = prim.own, prim.material or place.material, place.depth + 1
        if place.maps is not None:
            if "times" in own:
                prim.not_shown("xformOpOrder.timeSamples", "an animation that is not played: below a point instancer")
            maps = prim.affine_all(place.maps @ prim.matrix)
            return Place(place.node, place.matrix, maps, material, depth, place.is_forced)
        base = top if "resets" in own else place
        node, matrix = base.node, base.matrix
        if "matrix" in own or "times" in own:
            node, matrix = self.nodes.add(node, prim.matrix, self._samples(prim)), prim.affine(matrix @ prim.matrix)
        return Place(node, matrix, None, material, depth, place.is_forced)

    def _samples(self, prim: UsdPrim) -> Samples | None:
        """How a prim moves; what cannot be read is listed, and rests."""
        try:
            return samples_of(prim)
        except LoadError as error:
            prim.not_shown("xformOpOrder.timeSamples", f"an animation that is not played: {error.reason}")
            return None

    def _instances(self, prim: UsdPrim, below: Place) -> list[tuple[UsdPrim, Place]]:
        """The prototypes of a point instancer, each at the places of its instances."""
        prim.mark_read(*(key for key in prim.values if key in _OF_INSTANCES))
        matrices, which = prim.stored("instances", 16), prim.stored("which")
        targets = prim.paths("prototypes")
        if matrices is None or which is None or len(matrices) != len(which):
            prim.not_shown("protoIndices", "instances that are not shown: their lists have different lengths")
            return []
        try:
            local = prim.affine_all(matrices.reshape(-1, 4, 4))
        except LoadError as error:
            prim.not_shown("positions", f"instances that are not shown: {error.reason}")
            return []
        maps = local if below.maps is None else (below.maps[:, None] @ local[None]).reshape(-1, 4, 4)
        which = which if below.maps is None else np.tile(which, len(below.maps))
        self._spend(prim, len(maps))
        found: list[tuple[UsdPrim, Place]] = []
        for k, target in enumerate(targets):
            prototype = self._scene.by_path.get(target)
            own = maps[which == k]
            if prototype is None or not len(own):
                continue
            found.append((prototype, replace(below, maps=own, is_forced=True)))
        return found

    def _list_once(self, prim: UsdPrim) -> None:
        """List what of a prim is not shown by itself: materials that are not there, variants that are not chosen."""
        for key in prim.values:
            if key.startswith("material:binding") and not prim.material and key.count(":") == 1:
                prim.not_shown(key, "a material that is not in the stage: shown in grey")
        for name, (chosen, others) in dict(prim.own.get("variants", {})).items():
            more = [describe_value(other) for other in others if other != chosen]
            if more:
                shown = ", ".join(more[:6]) + (f" and {len(more) - 6} more" if len(more) > 6 else "")
                effect = f"shown as {describe_value(chosen or 'none')}; others, by --variant {name}=NAME: {shown}"
                listed = f"variantSets.{name}", effect
                prim.log.unshown[listed] = prim.log.unshown.get(listed, 0) + 1

    def _spend(self, prim: UsdPrim, count: int) -> None:
        self._left -= count
        if self._left < 0:
            raise prim.error("prims that are placed", "too many", "fewer instances in a file of this size")


# What the matrices of instances are made of.
_OF_INSTANCES = frozenset(
    {"positions", "orientations", "orientationsf", "scales", "protoIndices", "ids", "invisibleIds", "prototypes"}
)


def _with_graphs(scene: UsdScene, nodes: list[UsdPrim]) -> set[str]:
    """The paths of shading nodes and of the graphs that they are in."""
    found: set[str] = set()
    for prim in nodes:
        while prim.kind in _SHADING and prim.place not in found:
            found.add(prim.place)
            prim = scene.prims[max(prim.own["parent"], 0)]
    return found


def _of_stage(tree: dict[str, object]) -> list[UnshownProperty]:
    """What the decoder has left out."""
    n_clips = tree.get("n_clips", 0)
    if not isinstance(n_clips, int) or not n_clips:
        return []
    return [UnshownProperty("clips", n_clips, "animation in other files is not read")]


def _composition_notes(tree: dict[str, object]) -> list[str]:
    """The first errors of composition, such as references in a circle."""
    errors = tree.get("errors", [])
    lines = [describe_value(str(error)) for error in errors] if isinstance(errors, list) else []
    return [f"composition: {line}" for line in lines[:4]]
