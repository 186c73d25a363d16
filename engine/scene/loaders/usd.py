"""Geometry, materials, cameras and lights of a USD file (.usd, .usda, .usdc, .usdz): every surface under the transforms
of its prims, in metres with Y up, sorted by material.

usd-core parses and composes the layers in a process of its own (`usd_stage`), which gets them as bytes (`usd_layers`);
what comes back is checked here like any file. The stage is shown at its start time, with its default variants, without
shapes for a proxy or a guide. Instances are placed by their prototypes, point instancers by their matrices, without a
copy of a surface for each before all is counted. If transforms are animated, each part has a rig (`usd_rig`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from posixpath import commonpath

import numpy as np

from engine.core.errors import LoadError, describe_value, printable_name
from engine.scene.loaders.baked_maps import BakedMap, MapMaker
from engine.scene.loaders.gltf_materials import LONGEST_NAME, PartMaterial
from engine.scene.loaders.gltf_nodes import MeshNode, are_flat
from engine.scene.loaders.gltf_rig import place_copies_at_nodes
from engine.scene.loaders.model import ImportedModel, ImportedPart, UnshownProperty
from engine.scene.loaders.usd_cameras import read_cameras
from engine.scene.loaders.usd_layers import ArchiveFiles, open_layers
from engine.scene.loaders.usd_lights import CONVERTED, LIGHTS, UsdLights
from engine.scene.loaders.usd_materials import UsdMaterials
from engine.scene.loaders.usd_meshes import Surface, read_mesh
from engine.scene.loaders.usd_prims import MAX_DEPTH, Float64Array, UsdPrim, UsdScene, scene_of_tree
from engine.scene.loaders.usd_rig import UsdNodes
from engine.scene.loaders.usd_shapes import SHAPES, read_shape
from engine.scene.loaders.usd_textures import UsdTextures
from engine.scene.loaders.usd_unshown import unshown_properties
from engine.scene.mesh import Mesh, face_normals, join_meshes, place_copies, with_flat_normals
from engine.scene.rig import Binding, Rig, join_bindings

# Limits of what small files may cost: vertices and faces of all copies, and prims that are placed, plus one for every
# byte.
MOST_COPIED, MOST_PLACED = 2_000_000, 200_000
_GROUPS = frozenset({"", "Xform", "Scope", "SkelRoot", "GeomSubset", "PointInstancer"})
_Y_UP = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
_SHADING = frozenset({"Material", "Shader", "NodeGraph"})
_PURPOSES = ("default", "render")
Bound = tuple[Mesh, Binding | None]


def read_usd(path: Path) -> ImportedModel:
    """Read a USD file; raises LoadError naming the prim and what was expected there."""
    return _read(path)[0]


def usd_image_reader(path: Path) -> Callable[[int], bytes]:
    """A function from a number to the bytes of that file of a .usdz archive, or, from their number on, of a map that a
    network of MaterialX computes; both raise LoadError."""
    files = ArchiveFiles(path)
    computed: list[BakedMap] = []

    def read(number: int) -> bytes:
        if number < files.count:
            return files.read(number)
        if not computed:
            computed.extend(_read(path)[1].maps)
        if number - files.count >= len(computed):
            raise LoadError(path, f"image {number}", "nothing", f"a number below {files.count + len(computed)}")
        return computed[number - files.count].exr()

    return read


def _read(path: Path) -> tuple[ImportedModel, MapMaker]:
    """The model of a file, and the maps that its networks compute."""
    layers = open_layers(path)
    tree, arrays = layers.tree()
    scene = scene_of_tree(path, tree, arrays)
    walk = _Walk(scene, MOST_PLACED + layers.n_bytes)
    walk.run()
    materials = UsdMaterials(scene, UsdTextures(scene, layers), layers.n_files)
    parts = _Parts(scene, materials, walk.nodes if walk.nodes.are_moving else None, layers.n_bytes)
    for placed in walk.surfaces.values():
        parts.add(placed)
    found = parts.join()
    if not found:
        why = f": {next(iter(scene.log.notes))}" if scene.log.notes else ""
        raise LoadError(path, "faces", 0, f"at least one surface in the stage{why}")
    lights = UsdLights(layers, scene.metres)
    for prim, matrix in walk.lights:
        lights.add(prim, matrix)
    low, high = (end([end(part.mesh.vertices, axis=0) for part in found], axis=0) for end in (np.min, np.max))
    cameras = read_cameras(walk.cameras, (low + high) / 2.0)
    notes = [*scene.log.notes, *([CONVERTED] if walk.lights else []), *_composition_notes(tree)]
    read = [prim for prim in scene.prims if prim.kind in _SHADING and id(prim.values) in scene.log.read]
    visited = walk.visited | _with_graphs(scene, read)
    unshown = [*layers.list_unshown(), *_of_stage(tree), *unshown_properties(scene, visited)]
    model = ImportedModel(
        tuple(found), tuple(notes), cameras, tuple(unshown), lights=tuple(lights.lights), lamps=tuple(lights.lamps),
        dome=lights.dome,
    )  # fmt: skip
    return model, materials.maps


@dataclass(frozen=True)
class _Place:
    """Where the walk is: the node of the prims above, its matrix to the file's frame (4, 4), and, below a point
    instancer, the matrices (K, 4, 4) to that node; the material of a prim above, for what has none; how deep."""

    node: int
    matrix: Float64Array
    maps: Float64Array | None = None
    material: str = ""
    depth: int = 0
    is_forced: bool = False


@dataclass
class _Placed:
    """A surface's prim, the material that it has where none is bound to it, and its places."""

    prim: UsdPrim
    material: str
    places: list[_Place] = field(default_factory=list)

    def nodes(self) -> list[MeshNode]:
        """A node for each copy."""
        found: list[MeshNode] = []
        rigid = [place for place in self.places if place.maps is None]
        if rigid:
            world = np.stack([place.matrix for place in rigid])
            found += map(MeshNode, [place.node for place in rigid], world, are_flat(world).tolist())
        for place in self.places:
            if place.maps is not None:
                world = place.matrix @ place.maps
                found += map(MeshNode, [place.node] * len(world), world, are_flat(world).tolist(), place.maps)
        return found


class _Walk:
    """The walk over a stage, from which follow all places: of surfaces, lights and cameras."""

    def __init__(self, scene: UsdScene, most: int) -> None:
        self._scene, self._left = scene, most
        self.nodes = UsdNodes()
        self.surfaces: dict[tuple[str, str], _Placed] = {}
        self.lights: list[tuple[UsdPrim, Float64Array]] = []
        self.cameras: list[tuple[UsdPrim, Float64Array]] = []
        self.visited: set[str] = set()
        self._hidden: dict[str, bool] = {}

    def run(self) -> None:
        """Visit the stage. Raises LoadError."""
        scene = self._scene
        root = (_Y_UP if scene.up == "Z" else np.eye(4)) @ np.diag([scene.metres] * 3 + [1.0])
        top = _Place(self.nodes.add(None, -1, root), root)
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

    def _visit(self, prim: UsdPrim, place: _Place, top: _Place) -> _Place | None:
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
            found = self.surfaces.setdefault(key, _Placed(prim, below.material))
            found.places.append(below)
        elif prim.kind in LIGHTS:
            self.lights.append((prim, matrix))
        elif prim.kind == "Camera":
            self.cameras.append((prim, matrix))
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

    def _below(self, prim: UsdPrim, place: _Place, top: _Place) -> _Place:
        """Where a prim's surface and those below it are."""
        own, material, depth = prim.own, prim.material or place.material, place.depth + 1
        if place.maps is not None:
            if "times" in own:
                prim.not_shown("xformOpOrder.timeSamples", "an animation that is not played: below a point instancer")
            maps = prim.affine_all(place.maps @ prim.matrix)
            return _Place(place.node, place.matrix, maps, material, depth, place.is_forced)
        base = top if "resets" in own else place
        node, matrix = base.node, base.matrix
        if "matrix" in own or "times" in own:
            node, matrix = self.nodes.add(prim, node, prim.matrix), prim.affine(matrix @ prim.matrix)
        return _Place(node, matrix, None, material, depth, place.is_forced)

    def _instances(self, prim: UsdPrim, below: _Place) -> list[tuple[UsdPrim, _Place]]:
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
        found: list[tuple[UsdPrim, _Place]] = []
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
                listed = f"variantSets.{name}", f"shown as {describe_value(chosen or 'none')}; others: {shown}"
                prim.log.unshown[listed] = prim.log.unshown.get(listed, 0) + 1

    def _spend(self, prim: UsdPrim, count: int) -> None:
        self._left -= count
        if self._left < 0:
            raise prim.error("prims that are placed", "too many", "fewer instances in a file of this size")


# What the matrices of instances are made of.
_OF_INSTANCES = frozenset(
    {"positions", "orientations", "orientationsf", "scales", "protoIndices", "ids", "invisibleIds", "prototypes"}
)


class _Parts:
    """The parts of a stage: the surfaces of each material, placed. nodes: where something moves, else None."""

    def __init__(self, scene: UsdScene, materials: UsdMaterials, nodes: UsdNodes | None, n_bytes: int) -> None:
        self._scene, self._materials, self._nodes, self._n_bytes = scene, materials, nodes, n_bytes
        self._left = MOST_COPIED + n_bytes
        self._read: dict[str, Surface | None] = {}
        self._bound: dict[tuple[str, bool], list[Bound]] = {}
        self._paths: dict[tuple[str, bool], dict[str, None]] = {}

    def add(self, placed: _Placed) -> None:
        """Add a surface at all of its places; one that cannot be read is listed."""
        prim = placed.prim
        if prim.place not in self._read:
            self._read[prim.place] = self._surface(prim)
        surface = self._read[prim.place]
        every = placed.nodes()
        nodes = [node for node in every if not node.is_flat]
        if len(nodes) < len(every):
            prim.note("transform", "flat, as two scales of 0", "its surface is not shown")
        if surface is None or not nodes:
            return
        self._left -= (len(surface.mesh.vertices) + len(surface.mesh.triangles)) * len(nodes)
        if self._left < 0:
            raise prim.error("vertices and faces of all copies", "too many", "fewer in a file of this size")
        for own, chosen in surface.pieces(self._scene):
            path = own or placed.material
            material = self._materials.material(path)
            is_bare = material is None or not material.part.layers
            if material is not None and material.part.emission.radiance is not None and prim.flag("doubleSided"):
                prim.not_shown("doubleSided", "backs of faces reflect, but do not shine")
            colours = None
            if is_bare or (material is not None and material.colours):
                colours = surface.colours(self._scene)
            names = (material.coordinates if material is not None else ()) or ("st",)
            mesh = surface.select(chosen, surface.coordinates(self._scene, names), colours)
            copies = place_copies(mesh, np.stack([node.matrix for node in nodes]))
            binding = None if self._nodes is None else place_copies_at_nodes(mesh, nodes)
            key = path, colours is not None
            self._bound.setdefault(key, []).append((copies, binding))
            self._paths.setdefault(key, {})[prim.place] = None

    def join(self) -> list[ImportedPart]:
        """The parts, one for each material; what has no face with an area is left out where anything has one."""
        solid = {key: bound for key, bound in self._bound.items() if any(map(_has_area, bound))}
        skeleton = None
        if self._nodes is not None:
            every = [binding for bound in solid.values() for _, binding in bound if binding is not None]
            skeleton = self._nodes.skeleton(self._scene, every)
        parts, names = [], self._names()
        for (path, is_coloured), bound in (solid or self._bound).items():
            material = self._materials.material(path)
            own = material.part if material is not None else PartMaterial(())
            if any(mesh.normals is not None for mesh, _ in bound):
                bound = [each if each[0].normals is not None else _with_flat_normals(*each) for each in bound]
            mesh = join_meshes([mesh for mesh, _ in bound])
            rig = None
            if skeleton is not None:
                bindings = [binding for _, binding in bound if binding is not None]
                rig = Rig(skeleton, join_bindings(bindings), np.eye(4))
            if mesh.uvs is None:
                if own.has_images:
                    self._scene.log.notes[f"{path}: textures on meshes without their coordinates, not shown"] = None
                own = own.without_images()
            parts.append(
                ImportedPart(
                    mesh, own.layers, own.emission, rig, own.bumps, own.opacity, mesh.normals is not None, own.name,
                    object_name=names[path, is_coloured],
                )
            )  # fmt: skip
        return parts

    def _names(self) -> dict[tuple[str, bool], str]:
        """What the parts are called: the name of the prim whose surface is all of a part, and all that the part has;
        else the material's name, else that of the nearest prim above all of them."""
        n_parts = Counter(place for places in self._paths.values() for place in places)
        found = {}
        for (path, is_coloured), places in self._paths.items():
            only = next(iter(places)) if len(places) == 1 else ""
            owner = only if n_parts[only] == 1 or not path else path
            if not owner:
                owner = commonpath(places).lstrip("/")
            found[path, is_coloured] = printable_name(owner.rpartition("/")[2], LONGEST_NAME)
        return found

    def _surface(self, prim: UsdPrim) -> Surface | None:
        read: Callable[[], Surface | None]
        read = (lambda: read_mesh(prim, self._n_bytes)) if prim.kind == "Mesh" else (lambda: read_shape(prim))
        try:
            surface = read()
        except LoadError as error:
            prim.leave_out("points" if prim.kind == "Mesh" else "size", f"a surface that is not shown: {error.reason}")
            prim.note(prim.kind, error.reason, "left out")
            return None
        if prim.has("doubleSided") and not prim.flag("doubleSided"):
            prim.not_shown("doubleSided", "backs of faces reflect as their fronts do")
        return surface


def _has_area(bound: Bound) -> bool:
    mesh = bound[0]
    return any(face_normals(mesh.vertices, faces)[1].any() for faces in (mesh.triangles[:100], mesh.triangles))


def _with_flat_normals(mesh: Mesh, binding: Binding | None) -> Bound:
    facets, vertices = with_flat_normals(mesh)
    return facets, None if binding is None else binding.select_vertices(vertices)


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
