"""How the memory of indirect light grows with the number of objects: one room, cut into more and more of them.

The triangles of all that reflects are dealt out in their order: light takes the same paths, and only the objects that
the triangles belong to differ. Counted is what the worker keeps and what it hands out when one object is frozen.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass, fields, replace
from pathlib import Path

import numpy as np

from app.document.described import document_from_description
from app.measure.subject import at_most, open_subject
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import FreezeIndirect, IndirectFrozen
from app.project.distant_light import sky_of
from app.system.atomic import save_file
from app.worker.indirect_tasks import IndirectTasks
from benchmarks.figures import Figure
from engine.precompute.direct.pipeline import Placement
from engine.scene.scene_loader import Scene

FIGURE = "gi_memory_growth"
SOURCE, N_BOUNCES = "cornell", 4


@dataclass(frozen=True)
class GrowthRow:
    """One number of objects and its memory (MB, 10⁶ bytes): what is kept, and what a freezing hands out."""

    objects: int
    kept_mb: float
    frozen_mb: float

    @property
    def all_mb(self) -> float:
        return self.kept_mb + self.frozen_mb


def cut(scene: Scene, n_objects: int) -> Scene:
    """The scene with the triangles of all that reflects dealt out, in their order, to so many objects.

    They all look like the first of them; what shines stays as it is.
    """
    shines = scene.emitters[scene.object_of_triangle]
    reflecting, shining = np.flatnonzero(~shines), np.flatnonzero(shines)
    parts = np.array_split(reflecting, n_objects)
    emitters = np.unique(scene.object_of_triangle[shining])
    groups = [*parts, *(np.flatnonzero(scene.object_of_triangle == i) for i in emitters)]
    order, counts = np.concatenate(groups), [len(group) for group in groups]
    ends = np.cumsum(counts)
    described = scene.description.objects
    like = described[int(scene.object_of_triangle[reflecting[0]])]
    objects = [like.model_copy(update={"name": f"part {i}"}) for i in range(n_objects)]
    objects += [described[i] for i in emitters]
    return replace(
        scene,
        description=scene.description.model_copy(update={"objects": tuple(objects)}),
        triangles=scene.triangles[order],
        object_of_triangle=np.repeat(np.arange(len(groups), dtype=np.int32), counts),
        triangle_ranges=np.stack([ends - counts, ends], axis=1).astype(scene.triangle_ranges.dtype),
        geometric_normals=scene.geometric_normals[order],
        smooth=np.concatenate([np.full(n_objects, like.smooth), scene.smooth[emitters]]),
        emission=np.concatenate([np.zeros((n_objects, 3), np.float32), scene.emission[emitters]]),
    )


def memory_of(scene: Scene, n_objects: int) -> GrowthRow:
    """What the indirect light of a cut scene takes, with the first of its objects frozen."""
    document = document_from_description(SOURCE, scene.description)
    tasks = IndirectTasks(Placement(scene))
    wanted = Curves().scene_state(document)
    for _ in tasks.find(wanted.visible, sky_of(scene, document.light), "its own light", N_BOUNCES, is_last=True):
        pass
    frozen = next(
        answer
        for answer in tasks.freeze(FreezeIndirect(wanted, wanted.visible[0].key, 0))
        if isinstance(answer, IndirectFrozen)
    )
    return GrowthRow(n_objects, tasks.n_bytes / 1e6, frozen.light.n_bytes / 1e6)


def memory_rows(counts: Sequence[int], side: int) -> Iterator[GrowthRow]:
    """One row for each number of objects."""
    scene = open_subject(SOURCE).scene
    scene = replace(scene, resolution=at_most(scene.resolution, side))
    for n_objects in counts:
        yield memory_of(cut(scene, n_objects), n_objects)


def growth_figure(rows: Sequence[GrowthRow], side: int) -> Figure:
    """Each row's memory over what linear growth from the first row on would give."""
    first = rows[0]
    return Figure(
        FIGURE,
        tuple(row.all_mb / first.all_mb * first.objects / row.objects for row in rows[1:]),
        f"memory of indirect light, kept and frozen, of {SOURCE} at most {side} pixels wide, cut into "
        f"{', '.join(str(row.objects) for row in rows)} objects ÷ what {first.objects} take, times how many more; "
        "the worst counts",
        {str(row.objects): {"kept_mb": row.kept_mb, "frozen_mb": row.frozen_mb} for row in rows},
    )


def write_rows(file: Path, rows: Sequence[GrowthRow]) -> None:
    """One line a number of objects under a line of names."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(field.name for field in fields(GrowthRow))
    writer.writerows([n, f"{kept:.6g}", f"{frozen:.6g}"] for n, kept, frozen in map(astuple, rows))
    save_file(file, text.getvalue().encode())
