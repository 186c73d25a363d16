"""Materials of MaterialX files, for objects of a document: read in the worker, and by the command line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from app.document.commands.layers import SetMaterial
from app.document.document import Variant
from app.document.linked_layers import layers_from_descriptions
from engine.core.errors import LoadError
from engine.core.safe_files import resolved
from engine.scene.mesh import MATERIAL_ENDING

MARK = "#"


def split_material(name: str) -> tuple[str, str]:
    """The file of "wood.mtlx#oak" and the material in it; "" for the first."""
    end = name.lower().find(MATERIAL_ENDING + MARK)
    return (name, "") if end < 0 else (name[: end + len(MATERIAL_ENDING)], name[end + len(MATERIAL_ENDING + MARK) :])


def is_material_file(name: str) -> bool:
    """Whether a name is that of a MaterialX file, or of a material in one."""
    return split_material(name)[0].lower().endswith(MATERIAL_ENDING)


def import_material(object_name: str, name: str) -> SetMaterial:
    """The edit that gives an object a material of a file, before that is read."""
    file, material = split_material(name)
    return SetMaterial(object_name, (), material, file=str(resolved(Path(file))))


@dataclass(frozen=True)
class FileMaterials:
    """The materials of a file, with full paths of their images; chosen: the one that was asked for; notes: what of it
    is not shown, in short."""

    materials: tuple[Variant, ...]
    chosen: Variant
    notes: tuple[str, ...]


def complete_material(command: SetMaterial, materials: tuple[Variant, ...], chosen: Variant) -> SetMaterial:
    """An edit with the material that it waited for; where the file has several, they are its choices."""
    return SetMaterial(
        command.object, chosen.layers, chosen.name, chosen.bumps, chosen.opacity,
        materials if len(materials) > 1 else (),
    )  # fmt: skip


def read_file_materials(file: Path, name: str = "") -> FileMaterials:
    """Read a MaterialX file. Raises LoadError, also where it has no material of that name."""
    from engine.scene.loaders.mtlx import read_mtlx
    from engine.scene.object_meshes import part_material

    model = read_mtlx(file)
    materials = []
    for part in model.parts:
        layers, bumps, opacity = part_material(part, str(file))
        materials.append(Variant(part.name, layers_from_descriptions(str(file), part.name, layers), bumps, opacity))
    names = [each.name for each in materials]
    if name and name not in names:
        raise LoadError(file, "material", name, " or ".join(names[:12]))
    k = names.index(name) if name else 0
    notes = []
    if len(names) > 1:
        notes.append(f"{names[k]} of {len(names)} materials; Variant has the others")
    if model.parts[k].emission.radiance is not None:
        notes.append("it does not shine here: an object's emission is that of its scene")
    if model.unshown:
        notes.append(f"{len(model.unshown)} properties are not shown; open the file to see which")
    return FileMaterials(tuple(materials), materials[k], tuple(notes))
