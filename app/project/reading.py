"""What a document waits for, read at once: measured BRDFs, materials of files, objects that are added. In an editor the
worker reads them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.document.commands import EditCommand
from app.document.commands.layers import SetMaterial
from app.document.commands.objects import AddObject
from app.document.commands.suns import AddSun
from app.document.described import added_state
from app.document.document import Document
from app.document.named_files import document_with_measurements, layers_with_variants, unread_files
from app.document.scene_objects import AddedStates
from app.files.material_files import complete_material, read_file_materials

if TYPE_CHECKING:
    from engine.scene.composed_scene import SceneComposer
    from engine.scene.scene_loader import Scene


def complete(command: EditCommand, present: Callable[[], Scene], composer: SceneComposer | None = None) -> EditCommand:
    """A command with the material or the objects that it waits for; present: gives the scene that these are added to,
    as it is seen; composer: what is to compose it, None for none. Raises LoadError."""
    if isinstance(command, AddSun):
        return command.seen_from(present().description.camera)
    if isinstance(command, AddObject) and not command.objects:
        from engine.scene.added_objects import read_added

        read = read_added(command.what, present(), command.at, command.size)
        if composer is not None:
            composer.note(read.parts)
        states = tuple(added_state(each.source, each.description, each.animations) for each in read.objects)
        return replace(command, objects=states)
    if not isinstance(command, SetMaterial) or not command.file:
        return command
    found = read_file_materials(Path(command.file), command.name)
    return complete_material(command, found.materials, found.chosen)


def added_again(document: Document, composer: SceneComposer) -> tuple[AddedStates, tuple[str, ...]]:
    """The objects of a session's document that the scene's file does not have, read again, and a line on each file that
    cannot be read."""
    from engine.scene.added_objects import read_again

    found, problems, parts = read_again(document.added_sources, composer.own)
    composer.note(parts)
    return {each.source: added_state(each.source, each.description, each.animations) for each in found}, problems


def read_measurements(document: Document, folder: Path | None = None, scene: Path | None = None) -> Document:
    """The document with its measured BRDFs read: from where they are, or from a scene's folder alone."""
    names = unread_files(layers_with_variants(document))
    if not names:
        return document
    from app.worker.cache import ArrayCache
    from app.worker.file_tasks import described_paths
    from engine.core.generators import run_to_end
    from engine.measured.tables import read_measurement

    paths = {name: Path(name) for name in names}
    if folder is not None and scene is not None:
        paths = described_paths(names, folder, scene)
    store = ArrayCache()
    return document_with_measurements(
        document, {name: run_to_end(read_measurement(path, store)) for name, path in paths.items()}
    )
