"""A scene with other objects than its file: without some of them, under other names, and with objects of its own.

What stays keeps its arrays bit for bit: vertices stay relative to the same origin, and no mesh is read or checked
again. Only what is new is read.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from engine.scene.composition import Composition
from engine.scene.description import ObjectDescription
from engine.scene.mesh import join_corners
from engine.scene.scene_loader import Scene, ranges_of, read_objects


@dataclass(frozen=True)
class ComposedScene:
    """A scene, and what it was composed of."""

    scene: Scene
    composition: Composition


def compose_scene(own: Scene, composition: Composition, before: ComposedScene | None = None) -> Scene:
    """The scene of these objects, in their order, in the frame of the file's scene `own`.

    before: an earlier composition of the same scene, whose objects are not read again. Raises LoadError, and ValueError
    for a name that the scene's file does not have.
    """
    found: dict[int, tuple[Scene, int]] = {}
    for k, each in enumerate(composition):
        if isinstance(each.source, str):
            found[k] = own, own.object_index(each.source)
        elif before is not None and (i := _place(before.composition, each.source)) is not None:
            found[k] = before.scene, i
    new = {k: each.source for k, each in enumerate(composition) if k not in found and not isinstance(each.source, str)}
    if new:
        added = read_objects(tuple(new.values()), own)
        found |= {k: (added, i) for i, k in enumerate(new)}
    return _joined(own, [(*found[k], each.name) for k, each in enumerate(composition)])


def _place(composition: Composition, description: ObjectDescription) -> int | None:
    """The index of the object of that description; None where there is none. Its name does not matter."""
    return next((i for i, each in enumerate(composition) if each.source == description), None)


def _joined(base: Scene, parts: Sequence[tuple[Scene, int, str]]) -> Scene:
    """Objects of several scenes as one, `base` with other arrays; parts: the scene, the index there and the new name of
    each."""
    every = [(scene, slice(*scene.vertex_ranges[i]), slice(*scene.triangle_ranges[i])) for scene, i, _ in parts]
    counts = [there.stop - there.start for _, _, there in every]
    vertex_ranges, triangle_ranges = ranges_of([own.stop - own.start for _, own, _ in every]), ranges_of(counts)
    triangles = [
        scene.triangles[there] + np.int32(start - own.start)
        for (scene, own, there), start in zip(every, vertex_ranges[:, 0], strict=True)
    ]

    def corners(name: str) -> Any:
        values = [getattr(scene, name) for scene, _, _ in every]
        chosen = [v if v is None else v[there] for v, (_, _, there) in zip(values, every, strict=True)]
        return join_corners(chosen, counts, name)

    objects = tuple(scene.description.objects[i].model_copy(update={"name": name}) for scene, i, name in parts)
    added = list({id(scene): scene for scene, _, _ in parts if scene is not base}.values())
    return replace(
        base,
        description=base.description.model_copy(update={"objects": objects}),
        vertices=np.concatenate([scene.vertices[own] for scene, own, _ in every]),
        normals=np.concatenate([scene.normals[own] for scene, own, _ in every]),
        triangles=np.concatenate(triangles),
        object_of_triangle=np.repeat(np.arange(len(parts), dtype=np.int32), counts),
        triangle_ranges=triangle_ranges,
        geometric_normals=np.concatenate([scene.geometric_normals[there] for scene, _, there in every]),
        smooth=np.array([scene.smooth[i] for scene, i, _ in parts], bool),
        emission=np.array([scene.emission[i] for scene, i, _ in parts], np.float32),
        uvs=corners("uvs"),
        tangents=corners("tangents"),
        colours=corners("colours"),
        has_uvs=np.array([scene.has_uvs[i] for scene, i, _ in parts], bool),
        boxes=np.array([scene.boxes[i] for scene, i, _ in parts]),
        vertex_ranges=vertex_ranges,
        rigs=tuple(scene.rigs[i] for scene, i, _ in parts),
        notes=tuple(dict.fromkeys(note for scene in (base, *added) for note in scene.notes)),
        files=base.files.union(*(scene.files for scene in added)),
        material_names=tuple(scene.material_names[i] for scene, i, _ in parts),
    )
