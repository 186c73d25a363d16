"""What was read from the files of a scene, and what of it is not shown.

The worker makes an `ImportReport` with the scene. The window's sheet, `insitu info` and scripts show that one value:
what a reader leaves out is listed in one place, by the property's name in the file, how often it occurs, and what the
picture lacks.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from engine.core.errors import list_names, plain_line
from engine.scene.builtin import ASSETS
from engine.scene.loaders.model import UnshownProperty, VariantSet
from engine.scene.mesh import MESH_ENDINGS

if TYPE_CHECKING:
    from engine.scene.scene_loader import Scene

MOST_NAMES = 12  # in a line of text; the JSON form has all


@dataclass(frozen=True)
class ImportedObject:
    """An object: its name, its triangles, and its material's name in the file or the names of its layers."""

    name: str
    n_triangles: int
    material: str = ""


@dataclass(frozen=True)
class ImportReport:
    """What the files of a scene contain.

    files: all that were read, the opened one first; lights: emitters, the environment, its suns; animations, cameras,
    textures: their names; notes: what was repaired or left out, a line each; unshown: properties that the picture does
    not show, or shows in part; variant_sets: those of a mesh that was opened alone, of which others can be chosen.
    """

    files: tuple[str, ...] = ()
    objects: tuple[ImportedObject, ...] = ()
    materials: tuple[str, ...] = ()
    lights: tuple[str, ...] = ()
    cameras: tuple[str, ...] = ()
    animations: tuple[str, ...] = ()
    textures: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    unshown: tuple[UnshownProperty, ...] = ()
    variant_sets: tuple[VariantSet, ...] = ()

    @property
    def n_triangles(self) -> int:
        """The triangles of all objects."""
        return sum(item.n_triangles for item in self.objects)

    @property
    def is_silent(self) -> bool:
        """Whether there is nothing that the user has to read: all is shown, and as the file says."""
        return not self.unshown and not self.notes

    def contents(self) -> Iterator[tuple[str, int, tuple[str, ...]]]:
        """Rows of what is there: kind, number and names."""
        names = tuple(item.name for item in self.objects)
        yield "files", len(self.files), self.files
        yield "objects", len(names), names
        yield "triangles", self.n_triangles, ()
        for kind in ("materials", "lights", "cameras", "animations", "textures"):
            found: tuple[str, ...] = getattr(self, kind)
            yield kind, len(found), found
        if self.variant_sets:
            yield "variants", len(self.variant_sets), tuple(map(choice_line, self.variant_sets))

    def summary(self) -> str:
        """What there is to read, in one line; "" where that is nothing."""
        n_hidden, n_notes = len(self.unshown), len(self.notes)
        parts = (
            f"{n_hidden} {'property is' if n_hidden == 1 else 'properties are'} not shown, or in part"
            if n_hidden else "",
            f"{n_notes} {'note' if n_notes == 1 else 'notes'} on what was repaired or left out" if n_notes else "",
        )  # fmt: skip
        return "; ".join(filter(None, parts))


def choice_line(group: VariantSet) -> str:
    """A set of variants, the present one and all: "shape = tall (tall, wide)"."""
    return f"{group.name} = {group.chosen or 'none'} ({list_names(group.variants)})"


def group_of(found: UnshownProperty) -> str:
    """The group of a property: the first part of its name, such as "materials"."""
    return found.name.partition(".")[0]


def sorted_unshown(unshown: Iterable[UnshownProperty], by_count: bool = False) -> list[UnshownProperty]:
    """Properties by group and name, or the most frequent first."""
    return sorted(unshown, key=lambda each: (-each.count if by_count else 0, each.name))


def merge_unshown(unshown: Iterable[UnshownProperty]) -> tuple[UnshownProperty, ...]:
    """Properties of several files, one for each name and effect, with the sum of their counts."""
    counts: dict[tuple[str, str], int] = {}
    for each in unshown:
        key = each.name, each.effect
        counts[key] = counts.get(key, 0) + each.count
    return tuple(sorted_unshown(UnshownProperty(name, n, effect) for (name, effect), n in counts.items()))


def report_scene(scene: Scene) -> ImportReport:
    """The report on a loaded scene; without the floor and the sky that a mesh gets where it is opened alone."""
    described = scene.description.objects
    is_mesh = scene.file.suffix.lower() in MESH_ENDINGS
    own = [i for i, each in enumerate(described) if not is_mesh or each.mesh is not None]
    counts = scene.triangle_ranges[:, 1] - scene.triangle_ranges[:, 0]
    materials = [
        scene.material_names[i] or " + ".join(layer.name or layer.model for layer in described[i].layers) for i in own
    ]
    lights, environment = (
        [each.name for each in described if each.emits and not each.unlit],
        scene.description.environment,
    )
    if environment is not None:
        lights += [] if is_mesh and _is_builtin(scene.environment_path) else ["environment"]
        lights += [each.name or f"sun {k}" for k, each in enumerate(environment.suns, 1)]
    images: list[str] = []
    for i in own:
        for layer in described[i].layers:
            images += [name for _, name in layer.maps.files]
            images += [each["map"] for each in layer.parameter_maps.values()]
        images += [name for _, name in (*described[i].bumps.files, *described[i].deform.files)]
        images += [described[i].opacity.opacity_map, described[i].emission_texture.texture]
    return ImportReport(
        files=_file_names(scene, is_mesh),
        objects=tuple(
            ImportedObject(described[i].name, int(counts[i]), name) for i, name in zip(own, materials, strict=True)
        ),
        materials=_distinct(materials),
        lights=tuple(lights),
        cameras=tuple(camera.name or f"camera {i + 1}" for i, camera in enumerate(scene.cameras)),
        animations=_distinct(each.name for i in own for each in scene.animations[i]),
        textures=_distinct(images),
        notes=scene.notes,
        unshown=merge_unshown(scene.unshown),
        variant_sets=scene.variant_sets if is_mesh else (),
    )


def _file_names(scene: Scene, is_mesh: bool) -> tuple[str, ...]:
    """The files of a scene, the opened one first: their names in its folder, or full paths."""
    folder = os.path.abspath(scene.file.parent)
    paths = {os.path.abspath(path) for path in scene.files if not (is_mesh and _is_builtin(path))}
    paths.discard(os.path.abspath(scene.file))
    inside = [os.path.relpath(path, folder) if path.startswith(folder + os.sep) else path for path in paths]
    return (scene.file.name, *sorted(inside))


def _is_builtin(path: Path | None) -> bool:
    """Whether it is a file of the program, as the sky of a mesh is."""
    return path is not None and path.is_relative_to(ASSETS)


def _distinct(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(filter(None, names)))


# ---------------------------------------------------------------------------------------------------- as text, as JSON


def report_lines(report: ImportReport) -> Iterator[str]:
    """The report as aligned lines of text."""
    for kind, number, names in report.contents():
        yield f"{kind:<11} {number:>10,}   {list_names(names, MOST_NAMES)}".rstrip()
    if report.unshown:
        yield ""
        yield "not shown, or in part"
        yield from unshown_lines(report.unshown)
    if report.notes:
        yield ""
        yield "repaired or left out"
        yield from (f"  {plain_line(note)}" for note in report.notes)


def unshown_lines(unshown: Sequence[UnshownProperty]) -> Iterator[str]:
    """Properties as aligned lines: name, count, effect."""
    names = [plain_line(each.name) for each in unshown]
    width = max(map(len, names))
    for name, each in zip(names, unshown, strict=True):
        yield f"  {name:<{width}} {each.count:>6,}   {plain_line(each.effect)}"


def report_values(report: ImportReport) -> dict[str, Any]:
    """The report as values for JSON; keys stay as they are from version to version."""
    values = asdict(report)
    return {"files": values.pop("files"), "n_triangles": report.n_triangles, **values}
