"""Opening what the command line names: a scene (built-in or a file) or a session, with values set by path."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.document import Document, document_from_description
from app.measurements import document_with_read, layers_of_document, unread_files
from app.memory import require_memory_for
from app.session import SUFFIX, fit_session, load_session
from app.set_path import set_path
from engine.errors import InsituError
from engine.scene.builtin import DEFAULT_SCENE, builtin_scenes

if TYPE_CHECKING:
    from engine.material.layer import Layer
    from engine.scene.load import Scene
    from engine.transport.pipeline import SkyState


@dataclass(frozen=True)
class Project:
    """A loaded scene and the document that a person would edit."""

    scene: Scene
    document: Document

    @property
    def sky(self) -> SkyState:
        """The distant light; loads the environment."""
        from app.sky import sky_of

        return sky_of(self.scene, self.document.light)

    @property
    def layers(self) -> dict[str, Layer]:
        """The layers that reflect, by key: all but those of emitters and of what is hidden."""
        emitting = {state.name for state in self.document.objects if state.emits}
        return {
            key: layer
            for key, layer in self.document.layers()
            if key.rpartition(".")[0] not in emitting and self.document.is_visible(key)
        }

    @property
    def editable(self) -> frozenset[str]:
        """Keys of the layers that a person may edit."""
        return frozenset(key for key in self.layers if self.document.object(key.rpartition(".")[0]).editable)

    @property
    def object_names(self) -> tuple[str, ...]:
        return tuple(described.name for described in self.scene.description.objects)


def find_source(name: str | None) -> str:
    """A built-in scene's name or the path of a file that is there; InsituError lists the built-in ones."""
    name = name or DEFAULT_SCENE
    if name in builtin_scenes():
        return name
    if Path(name).exists():
        return str(Path(name))
    there = ", ".join(builtin_scenes())
    raise InsituError(f"{name}: no such file, and no built-in scene of that name; built-in scenes are {there}")


def open_project(
    name: str | None, resolution: tuple[int, int] | None = None, values: Sequence[tuple[str, Any]] = ()
) -> Project:
    """Load what `name` stands for and set `values` by path. Raises InsituError with one line for a person."""
    from engine.scene.load import load_scene

    if resolution is not None:
        require_memory_for(resolution)  # before a mesh is read
    source = find_source(name)
    session = load_session(Path(source)) if Path(source).suffix == SUFFIX else None
    scene_source = source if session is None else session.document.source
    path = builtin_scenes().get(scene_source) or Path(scene_source)
    scene = load_scene(path, resolution)
    require_memory_for(scene.resolution)
    document = _read(document_from_description(scene_source, scene.description), scene.folder, path)
    if session is not None:
        document = _read(fit_session(session, document, source))
    for where, value in values:
        document = _read(set_path(document, where, value).apply(document))
    return Project(scene, document)


def _read(document: Document, folder: Path | None = None, scene: Path | None = None) -> Document:
    """The document with its measured BRDFs read: from where they are, or from a scene's folder alone."""
    names = unread_files(layers_of_document(document))
    if not names:
        return document
    from app.jobs.cache import Store
    from app.jobs.measured import described_paths
    from engine.measured.tables import finish_reading, read_measurement

    paths = {name: Path(name) for name in names}
    if folder is not None and scene is not None:
        paths = described_paths(names, folder, scene)
    store = Store()
    return document_with_read(
        document, {name: finish_reading(read_measurement(path, store)) for name, path in paths.items()}
    )


def parse_assignment(text: str) -> tuple[str, Any]:
    """("teapot.1.alpha", 0.3) of "teapot.1.alpha=0.3": the value as TOML writes it, a bare word is a string."""
    path, equals, value = text.partition("=")
    path, value = path.strip(), value.strip()
    if not path or not equals or not value:
        raise InsituError(f"{text!r} is not of the form path=value, such as teapot.1.alpha=0.3")
    try:
        return path, tomllib.loads(f"value = {value}")["value"]
    except tomllib.TOMLDecodeError:
        return path, value
