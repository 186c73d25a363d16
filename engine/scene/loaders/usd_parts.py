"""The parts of a USD stage: surfaces joined by material, at all of their places, with their names and rigs, and their
materials in variants that differ in these alone.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from posixpath import commonpath

import numpy as np
import numpy.typing as npt

from engine.core.errors import LoadError, printable_name
from engine.scene.loaders.gltf_materials import COLOURED, GREY, LONGEST_NAME, PartMaterial
from engine.scene.loaders.gltf_nodes import MeshNode, are_flat
from engine.scene.loaders.gltf_rig import place_copies_at_nodes
from engine.scene.loaders.model import ImportedPart, ImportedVariant
from engine.scene.loaders.usd_bindings import UsdBindings
from engine.scene.loaders.usd_materials import UsdMaterial, UsdMaterials
from engine.scene.loaders.usd_meshes import Surface, read_mesh
from engine.scene.loaders.usd_prims import Float64Array, UsdPrim, UsdScene
from engine.scene.loaders.usd_shapes import read_shape
from engine.scene.mesh import Mesh, face_normals, join_meshes, place_copies, with_flat_normals
from engine.scene.rig import Binding, Rig, join_bindings

# Limit of what small files may cost: vertices and faces of all copies, plus one for every byte.
MOST_COPIED = 2_000_000
Bound = tuple[Mesh, Binding | None]
# The material of a surface, those that it has in the variants, empty where it is the same, and whether it has colours.
Use = tuple[str, tuple[str, ...], bool]


@dataclass(frozen=True)
class Place:
    """Where the walk is: the node of the prims above, its matrix to the file's frame (4, 4), and, below a point
    instancer, the matrices (K, 4, 4) to that node; the material of a prim above, for what has none; how deep."""

    node: int
    matrix: Float64Array
    maps: Float64Array | None = None
    material: str = ""
    depth: int = 0
    is_forced: bool = False


@dataclass
class Placed:
    """A surface's prim, the material that it has where none is bound to it, and its places."""

    prim: UsdPrim
    material: str
    places: list[Place] = field(default_factory=list)

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


@dataclass(frozen=True)
class Look:
    """A variant of the stage that differs in materials alone."""

    name: str
    scene: UsdScene
    materials: UsdMaterials

    def material_of(self, prim: UsdPrim) -> str:
        """The path of the material that a prim has in it, "" for none."""
        own = self.scene.by_path.get(prim.place)
        return "" if own is None else own.material


class Parts:
    """The parts of a stage: the surfaces of each material, placed. skins: where something moves, else None."""

    def __init__(
        self, scene: UsdScene, materials: UsdMaterials, looks: list[Look], skins: UsdBindings | None, n_bytes: int
    ) -> None:
        self._scene, self._materials, self._skins, self._n_bytes = scene, materials, skins, n_bytes
        self._looks = looks
        self._left = MOST_COPIED + n_bytes
        self._read: dict[str, Surface | None] = {}
        self._bound: dict[Use, list[Bound]] = {}
        self._paths: dict[Use, dict[str, None]] = {}

    def add(self, placed: Placed) -> None:
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
        for owner, chosen in surface.pieces(self._scene):
            path = owner.material or placed.material
            others = self._in_looks(owner, path)
            material = self._materials.material(path)
            every_one = [material, *(found for _, found in self._other_materials(others))]
            if prim.flag("doubleSided") and any(m is not None and m.part.emission.radiance for m in every_one):
                prim.not_shown("doubleSided", "backs of faces reflect, but do not shine")
            colours = None
            if any(m is None or not m.part.layers or m.colours for m in every_one):
                colours = surface.colours(self._scene)
            names = (material.coordinates if material is not None else ()) or ("st",)
            mesh = surface.select(chosen, surface.coordinates(self._scene, names), colours)
            copies = place_copies(mesh, np.stack([node.matrix for node in nodes]))
            binding = self._binding(surface, chosen, mesh, copies, nodes)
            key = path, others, colours is not None
            self._bound.setdefault(key, []).append((copies, binding))
            self._paths.setdefault(key, {})[prim.place] = None

    def join(self) -> list[ImportedPart]:
        """The parts, one for each material; what has no face with an area is left out where anything has one."""
        solid = {key: bound for key, bound in self._bound.items() if any(map(_has_area, bound))}
        skeleton = None
        if self._skins is not None:
            every = [binding for bound in solid.values() for _, binding in bound if binding is not None]
            skeleton = self._skins.nodes.skeleton(self._scene, every)
        parts, names = [], self._names()
        for use, bound in (solid or self._bound).items():
            path, others, is_coloured = use
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
            plain = COLOURED if is_coloured else GREY
            variants = [(name, self._fitting(found, material, mesh)) for name, found in self._other_materials(others)]
            layers = own.layers or (plain if variants else ())
            parts.append(
                ImportedPart(
                    mesh, layers, own.emission, rig, own.bumps, own.opacity, mesh.normals is not None, own.name,
                    tuple(
                        ImportedVariant(
                            name, each.layers or plain,
                            each.emission.radiance if each.emission.is_like(own.emission) else None,
                            each.bumps, each.opacity,
                        )
                        for name, each in variants
                    ),
                    names[use],
                )
            )  # fmt: skip
        return parts

    def _binding(
        self, surface: Surface, chosen: npt.NDArray[np.bool_], mesh: Mesh, copies: Mesh, nodes: list[MeshNode]
    ) -> Binding | None:
        """What moves the copies of a part of a surface: its skin, else the nodes; None where nothing moves."""
        if self._skins is None:
            return None
        used = np.arange(len(surface.mesh.vertices))
        if not chosen.all():
            used = np.unique(surface.mesh.triangles[chosen]).astype(np.int64)
        return self._skins.binding(surface, used, copies, len(nodes)) or place_copies_at_nodes(mesh, nodes)

    def _in_looks(self, owner: UsdPrim, path: str) -> tuple[str, ...]:
        """The materials of a prim in the variants; nothing where none differs from its own of this path."""
        paths = tuple(look.material_of(owner) for look in self._looks)
        own = self._materials.material(path)
        is_same = all(
            other == path and look.materials.material(other) == own
            for look, other in zip(self._looks, paths, strict=True)
        )
        return () if is_same else paths

    def _other_materials(self, paths: tuple[str, ...]) -> list[tuple[str, UsdMaterial | None]]:
        """The names of the variants, with the materials of these paths there; nothing where there are no paths."""
        return [
            (look.name, look.materials.material(path)) for look, path in zip(self._looks, paths, strict=bool(paths))
        ]

    def _fitting(self, material: UsdMaterial | None, own: UsdMaterial | None, mesh: Mesh) -> PartMaterial:
        """The material of a variant on a part, which has the texture coordinates of its own material."""
        if material is None:
            return PartMaterial(())
        there = (own.coordinates if own is not None else ()) or ("st",)
        if mesh.uvs is not None and material.coordinates == there[: len(material.coordinates)]:
            return material.part
        if material.part.has_images:
            name = material.part.name
            self._scene.log.notes[f"{name}: textures by coordinates that the part has not, not shown"] = None
        return material.part.without_images()

    def _names(self) -> dict[Use, str]:
        """What the parts are called: the name of the prim whose surface is all of a part, and all that the part has;
        else the material's name, else that of the nearest prim above all of them."""
        n_parts = Counter(place for places in self._paths.values() for place in places)
        found = {}
        for use, places in self._paths.items():
            path = use[0]
            only = next(iter(places)) if len(places) == 1 else ""
            owner = only if n_parts[only] == 1 or not path else path
            if not owner:
                owner = commonpath(places).lstrip("/")
            found[use] = printable_name(owner.rpartition("/")[2], LONGEST_NAME)
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
