"""A scene with other objects than its file: without some of them, under other names, and with objects of its own.

What stays keeps its arrays bit for bit: vertices stay relative to the same origin, and no mesh is read or checked
again. Only what is new is read. A hidden object keeps its place among the others and has no surface.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from engine.core.errors import InsituError
from engine.material.bumps import NO_BUMPS
from engine.material.layer_maps import LayerMaps
from engine.material.opacity import OPAQUE
from engine.scene.added_objects import Part, read_again
from engine.scene.composition import Composition, ObjectSource
from engine.scene.description import ObjectDescription
from engine.scene.mesh import join_corners
from engine.scene.scene_loader import ObjectsRead, Scene, place_objects
from engine.scene.scene_placement import ranges_of
from engine.scene.surface_kinds import NO_SURFACE

# What describes the surface of an object in its file, for one that has none.
_NO_SURFACE = {
    "bumps": NO_BUMPS, "opacity": OPAQUE, "emission_texture": LayerMaps(), "deform": NO_SURFACE, "variants": ()
}  # fmt: skip
# What a scene has of its objects.
_OF_OBJECTS = (
    "vertices", "normals", "triangles", "object_of_triangle", "triangle_ranges", "geometric_normals", "smooth",
    "emission", "uvs", "tangents", "colours", "has_uvs", "boxes", "vertex_ranges", "rigs", "material_names",
)  # fmt: skip


@dataclass(frozen=True)
class ComposedScene:
    """A scene, and what it was composed of. missing: what its objects were to be read from that could not be, which it
    does not have; problems: a line on each file of these."""

    scene: Scene
    composition: Composition
    missing: tuple[ObjectSource, ...] = ()
    problems: tuple[str, ...] = ()


class SceneComposer:
    """Composes scenes of the objects of a file's scene `own` and of added ones, each of which is read once."""

    def __init__(self, own: Scene) -> None:
        self.own = own
        self._parts: dict[ObjectDescription, Part] = {}
        self._composed: set[ObjectSource] = set()

    def note(self, parts: Mapping[ObjectDescription, Part]) -> None:
        """Note added objects that were just read."""
        self._parts.update(parts)

    def compose(self, composition: Composition) -> ComposedScene:
        """The scene of these objects, in their order, in the frame of the file's scene; without those that the file
        does not have or that cannot be read."""
        sources = dict.fromkeys(each.source for each in composition)
        unread = [each for each in sources if not isinstance(each, str) and each not in self._parts]
        read = read_again(unread, self.own)
        # What is no longer used is forgotten; what was read and is not yet used is kept.
        kept = {each: part for each, part in self._parts.items() if each in sources or each not in self._composed}
        self._parts, self._composed = kept | read.parts, set(sources)
        names = set(self.own.object_names)
        missing = tuple(
            each for each in sources if (each not in names if isinstance(each, str) else each not in self._parts)
        )
        there = tuple(each for each in composition if each.source not in missing)
        parts = [
            (
                _Part(self.own, self.own.object_index(each.source), each.name, each.is_hidden)
                if isinstance(each.source, str)
                else _Part(*self._parts[each.source], each.name, each.is_hidden)
            )
            for each in there
        ]
        return ComposedScene(_joined(self.own, parts), there, missing, read.notes)

    def compose_all(self, composition: Composition | None) -> Scene:
        """The scene of all of these objects; the file's for None. Raises InsituError where some are not in its file or
        cannot be read."""
        if composition is None:
            return self.own
        composed = self.compose(composition)
        if composed.missing:
            lines = [f"there is no object {each!r} in the scene" for each in composed.missing if isinstance(each, str)]
            raise InsituError("; ".join((*lines, *composed.problems)))
        return composed.scene


def compose_scene(own: Scene, composition: Composition | None) -> Scene:
    """The scene of these objects, in their order, in the frame of the file's scene `own`. Raises InsituError where some
    are not in its file or cannot be read."""
    return SceneComposer(own).compose_all(composition)


class _Part(NamedTuple):
    """An object of a scene, by its index, its new name, and whether it is hidden; is_point: whether all that is left of
    it is a point, a triangle that no ray meets."""

    scene: Scene
    place: int
    name: str
    is_hidden: bool
    is_point: bool = False

    @property
    def vertices(self) -> slice:
        return self._range(self.scene.vertex_ranges)

    @property
    def triangles(self) -> slice:
        return self._range(self.scene.triangle_ranges)

    def _range(self, ranges: npt.NDArray[np.int32]) -> slice:
        begin, end = map(int, ranges[self.place])
        return slice(begin, begin + self.is_point if self.is_hidden else end)

    @property
    def description(self) -> ObjectDescription:
        changed = _NO_SURFACE if self.is_hidden else {}
        return self.scene.description.objects[self.place].model_copy(update={"name": self.name, **changed})


def _bare(base: Scene) -> Scene:
    """The scene without objects, its light alone."""
    nothing = place_objects(ObjectsRead((), (), frozenset()), base)
    arrays = {name: getattr(nothing, name) for name in _OF_OBJECTS}
    return replace(base, description=base.description.model_copy(update={"objects": ()}), **arrays)


def _joined(base: Scene, parts: Sequence[_Part]) -> Scene:
    """Objects of several scenes as one, `base` with other arrays. Where all are hidden, a point of the first is left:
    rays have something to be traced against."""
    if not parts:
        return _bare(base)
    if all(part.is_hidden for part in parts):
        parts = [parts[0]._replace(is_point=True), *parts[1:]]
    every = [(part.scene, part.vertices, part.triangles) for part in parts]
    counts = [there.stop - there.start for _, _, there in every]
    vertex_ranges, triangle_ranges = ranges_of([own.stop - own.start for _, own, _ in every]), ranges_of(counts)
    triangles = [
        np.minimum(scene.triangles[there] + np.int32(start - own.start), stop - 1)
        for (scene, own, there), (start, stop) in zip(every, vertex_ranges, strict=True)
    ]

    def corners(name: str) -> Any:
        values = [getattr(scene, name) for scene, _, _ in every]
        chosen = [v if v is None else v[there] for v, (_, _, there) in zip(values, every, strict=True)]
        return join_corners(chosen, counts, name)

    added = list({id(part.scene): part.scene for part in parts if part.scene is not base}.values())
    black = np.zeros(3, np.float32)
    return replace(
        base,
        description=base.description.model_copy(update={"objects": tuple(part.description for part in parts)}),
        vertices=np.concatenate([scene.vertices[own] for scene, own, _ in every]),
        normals=np.concatenate([scene.normals[own] for scene, own, _ in every]),
        triangles=np.concatenate(triangles),
        object_of_triangle=np.repeat(np.arange(len(parts), dtype=np.int32), counts),
        triangle_ranges=triangle_ranges,
        geometric_normals=np.concatenate([scene.geometric_normals[there] for scene, _, there in every]),
        smooth=np.array([part.scene.smooth[part.place] for part in parts], bool),
        emission=np.array([black if part.is_hidden else part.scene.emission[part.place] for part in parts], np.float32),
        uvs=corners("uvs"),
        tangents=corners("tangents"),
        colours=corners("colours"),
        has_uvs=np.array([part.scene.has_uvs[part.place] for part in parts], bool),
        boxes=np.array([part.scene.boxes[part.place] for part in parts]),
        vertex_ranges=vertex_ranges,
        rigs=tuple(None if part.is_hidden else part.scene.rigs[part.place] for part in parts),
        notes=tuple(dict.fromkeys(note for scene in (base, *added) for note in scene.notes)),
        files=base.files.union(*(scene.files for scene in added)),
        material_names=tuple(part.scene.material_names[part.place] for part in parts),
    )
