"""Opens what the command line names: a scene (built-in or a file) or a session, with values set by path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.document.commands.light import emission_of, set_environment_file
from app.document.commands.plan import active_overrides, override_from_value
from app.document.document import Document, document_from_description, reflecting_layers
from app.document.named_files import document_with_measurements, files_of_document, layers_of_document, unread_files
from app.document.sources import find_source, source_of
from app.document.view_state import Viewpoint
from app.files.bookmarks import find_bookmark
from app.files.session import Session, fit_session, load_session
from app.project.set_path import set_path
from app.system.inputs import set_inputs
from app.system.memory import require_memory_for
from app.system.paths import full_path
from engine.core.colour import ToneMapping
from engine.core.errors import InsituError, LoadError
from engine.material.layer import object_of
from engine.scene.builtin import DEFAULT_SCENE, scene_path
from engine.scene.toml_text import parse_toml
from engine.settings import AS_PLANNED, LineValue, RenderSettings, checked_setting

if TYPE_CHECKING:
    from engine.material.layer import Layer
    from engine.precompute.direct.pipeline import SkyState
    from engine.scene.scene_loader import Scene


@dataclass(frozen=True)
class Project:
    """A loaded scene, the document to edit, and its view; emitters have the document's emission.

    view: its tone mapping; settings: those of its session, with those of the user. at_rest: the scene where no object
    is deformed, None where that is it.
    """

    scene: Scene
    document: Document
    view: ToneMapping = "filmic"
    settings: RenderSettings = RenderSettings(n_bounces=AS_PLANNED)
    at_rest: Scene | None = None

    @property
    def resting(self) -> Scene:
        """The scene with all objects as its file has them."""
        return self.at_rest or self.scene

    @cached_property
    def sky(self) -> SkyState:
        """The distant light; loads the environment, once."""
        from app.project.sky import sky_of

        return sky_of(self.scene, self.document.light)

    @property
    def layers(self) -> dict[str, Layer]:
        """The layers that reflect, by key: all but those of emitters and of hidden objects."""
        return dict(reflecting_layers(self.document))

    @property
    def indexed_layers(self) -> tuple[tuple[int, Layer], ...]:
        """The same by the index of their object in the scene."""
        names = self.object_names
        return tuple((names.index(object_of(key)), layer) for key, layer in self.layers.items())

    @property
    def editable(self) -> frozenset[str]:
        """Keys of the layers that can be edited."""
        return frozenset(key for key in self.layers if self.document.object(object_of(key)).editable)

    @property
    def overrides(self) -> dict[str, LineValue]:
        """The overrides of the plan, by its session or the user."""
        n_edge_rays, n_hemisphere_rays = self.settings.n_edge_rays, self.settings.n_hemisphere_rays
        edges: dict[str, LineValue] = {} if n_edge_rays is None else {"edges": n_edge_rays}
        rays: dict[str, LineValue] = {"rays": n_hemisphere_rays} if n_hemisphere_rays else {}
        return edges | rays | active_overrides(self.document)

    @property
    def chosen_bounces(self) -> int | None:
        """The user's override, or the session's number; None: as many as the scene says or requires."""
        return self.settings.with_lines(dict(self.document.overrides)).n_bounces or None

    @property
    def editor_settings(self) -> RenderSettings:
        """The settings of its picture in the editor."""
        n_bounces = self.settings.n_bounces or self.scene.description.bounces or AS_PLANNED
        return replace(self.settings, n_bounces=n_bounces).with_lines(dict(self.document.overrides))

    def with_settings(self, **changes: Any) -> Project:
        """The project with other render settings, by name. Raises InsituError for an invalid value."""
        checked = {name: checked_setting(name, value) for name, value in changes.items()}
        return replace(self, settings=replace(self.settings, **checked))

    def edited(self, document: Document, look: Viewpoint) -> Project:
        """The same scene under another document, from another camera; what neither changes is shared. look: its camera
        and resolution are those of the scene as it is where they are None. Raises InsituError."""
        from engine.realtime.zonal_harmonics.posed_scene import pose_scene

        old, scene, at_rest = self.document, self.scene, self.resting
        shape = document.poses, document.new_bumps, emission_of(document)
        if shape != (old.poses, old.new_bumps, emission_of(old)):
            at_rest = at_rest.with_emission(dict(emission_of(document)))
            scene = pose_scene(at_rest, document.poses).with_bumps(dict(document.new_bumps))
            scene = scene.from_camera(self.scene.description.camera, self.scene.resolution)
            scene.bump_normals.check_images()
        turned = scene.description.from_camera(look.camera) != scene.description
        if turned or look.resolution not in (None, scene.resolution):
            scene = scene.from_camera(look.camera, look.resolution)
        project = replace(self, document=document, scene=scene, at_rest=at_rest)
        if "sky" in vars(self) and replace(document.light, intensity=1.0) == replace(old.light, intensity=1.0):
            vars(project)["sky"] = self.sky
        return project

    @property
    def object_names(self) -> tuple[str, ...]:
        return self.scene.object_names


@dataclass(frozen=True)
class ProjectSpec:
    """A project's specification, to open it here or on another machine: a scene or session by name, and the user's
    options, settings among them by name; see `open_project` and `with_overrides`."""

    name: str | None
    resolution: tuple[int, int] | None = None
    values: tuple[tuple[str, Any], ...] = ()
    camera: str | None = None
    settings: tuple[tuple[str, Any], ...] = ()
    overrides: tuple[tuple[str, Any], ...] = ()

    def open(self) -> Project:
        """The project. Raises InsituError with one line for the user."""
        project = open_project(self.name, self.resolution, self.values, self.camera)
        return with_overrides(project.with_settings(**dict(self.settings)), dict(self.overrides))

    def with_absolute_paths(self) -> ProjectSpec:
        """The same with absolute paths, so that it can be opened from any folder."""
        return replace(self, name=full_path(self.name or DEFAULT_SCENE))


def open_project(
    name: str | None,
    resolution: tuple[int, int] | None = None,
    values: Sequence[tuple[str, Any]] = (),
    camera: str | None = None,
) -> Project:
    """Load what `name` names and set `values` by path; seen from the view that its session bookmarks as `camera`.

    Raises InsituError with one line for the user.
    """
    from engine.realtime.zonal_harmonics.posed_scene import pose_scene
    from engine.scene.scene_loader import load_scene

    source = source_of(find_source(name))
    session = None if source.session is None else load_session(source.session)
    look = _viewpoint_of(session, camera)
    resolution = resolution or look.resolution
    if resolution is not None:
        require_memory_for(resolution)  # before a mesh is read
    named = source.scene if session is None else session.document.source
    path = scene_path(named)
    scene = load_scene(path, resolution).from_camera(look.camera)
    require_memory_for(scene.resolution)
    document = read_measurements(
        document_from_description(named, scene.description, scene.animations), scene.folder, path
    )
    if source.light is not None:
        document = set_environment_file(source.light).apply(document)
    if session is not None:
        document = read_measurements(fit_session(session, document, str(source.session)))
    for where, value in values:
        document = read_measurements(set_path(document, where, value).apply(document))
    at_rest = scene.with_emission(dict(emission_of(document)))
    scene = pose_scene(at_rest, document.poses).with_bumps(dict(document.new_bumps))
    scene.bump_normals.check_images()
    sessions = () if source.session is None else (source.session,)
    set_inputs((*scene.files, *files_of_document(document), *sessions))
    if session is None:
        return Project(scene, document, at_rest=at_rest)
    return Project(scene, document, session.view.tone_mapping, session.view.settings, at_rest)


def with_overrides(project: Project, lines: Mapping[str, Any]) -> Project:
    """The project with these lines of its plan overridden. Raises InsituError for an unknown line or an invalid
    value."""
    document = project.document
    for line, value in lines.items():
        document = override_from_value(line, value).apply(document)
    return replace(project, document=document)


def _viewpoint_of(session: Session | None, camera: str | None) -> Viewpoint:
    """The viewpoint of a session, or its bookmark of a name."""
    if camera is not None:
        return find_bookmark(() if session is None else session.view.bookmarks, camera).viewpoint
    return Viewpoint() if session is None else session.view.viewpoint


def read_measurements(document: Document, folder: Path | None = None, scene: Path | None = None) -> Document:
    """The document with its measured BRDFs read: from where they are, or from a scene's folder alone."""
    names = unread_files(layers_of_document(document))
    if not names:
        return document
    from app.worker.cache import ArrayCache
    from app.worker.measured_tasks import described_paths
    from engine.core.generators import run_to_end
    from engine.measured.tables import read_measurement

    paths = {name: Path(name) for name in names}
    if folder is not None and scene is not None:
        paths = described_paths(names, folder, scene)
    store = ArrayCache()
    return document_with_measurements(
        document, {name: run_to_end(read_measurement(path, store)) for name, path in paths.items()}
    )


def parse_assignment(text: str) -> tuple[str, Any]:
    """("teapot.1.alpha", 0.3) of "teapot.1.alpha=0.3": the value as TOML writes it, a bare word is a string."""
    path, equals, value = text.partition("=")
    path, value = path.strip(), value.strip()
    if not path or not equals or not value:
        raise InsituError(f"{text!r} is not of the form path=value, such as teapot.1.alpha=0.3")
    try:
        return path, parse_toml(f"value = {value}", "--set")["value"]
    except LoadError:
        return path, value
