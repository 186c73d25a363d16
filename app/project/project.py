"""Opens what the command line names: a scene (built-in or a file) or a session, with values set by path, as scripts set
them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

from app.document.commands.light import (
    set_environment_file,
)
from app.document.commands.plan import active_overrides, override_from_value
from app.document.described import document_from_description
from app.document.document import Document, reflecting_layers
from app.document.light_mix import mixed_light
from app.document.named_files import files_of_document
from app.document.node_layers import Statistics, channel_images, with_node_layers
from app.document.scene_files import (
    is_archive,
    renamed,
    session_of_archive,
    split_axis,
    unpacked_scene_file,
    variants_of,
)
from app.document.sources import Source, find_source, source_of
from app.document.view_state import Viewpoint
from app.files.bookmarks import camera_bookmarks, find_bookmark
from app.files.session import Session, archived_session, load_session
from app.files.session_fitting import fit_session, session_notes
from app.project.assignments import set_path, value_with_full_path
from app.project.distant_light import sky_of
from app.project.document_scene import posed_scene, scene_at_rest, shape_of
from app.project.reading import added_again, complete, read_measurements
from app.system.atomic import set_inputs
from app.system.decoder_process import use_decoder_process
from app.system.memory import require_memory_for
from app.system.paths import full_path
from engine.core.colour import AnyView
from engine.material.layer import object_of
from engine.scene.builtin import DEFAULT_SCENE
from engine.settings import AS_PLANNED, LineValue, RenderSettings, checked_setting

if TYPE_CHECKING:
    from engine.material.layer import Layer
    from engine.precompute.direct.pipeline import SkyState
    from engine.scene.composed_scene import SceneComposer
    from engine.scene.scene_loader import Scene


@dataclass(frozen=True)
class Project:
    """A loaded scene, the document to edit, and its view; emitters have the document's emission.

    view: its tone mapping; settings: those of its session, with those of the user. at_rest: the scene where no object
    is deformed, None where that is it. notes: what of its session does not fit the scene. composer: has the scene
    as its file has it, None where its objects are those of `scene`.
    """

    scene: Scene
    document: Document
    view: AnyView = "filmic"
    settings: RenderSettings = RenderSettings(n_bounces=AS_PLANNED)
    at_rest: Scene | None = None
    notes: tuple[str, ...] = ()
    composer: SceneComposer | None = field(default=None, compare=False, repr=False)

    @property
    def resting(self) -> Scene:
        """The scene with all objects in the shape that its file has them in."""
        return self.at_rest or self.scene

    @cached_property
    def sky(self) -> SkyState:
        """The distant light; loads the environment, once."""
        return sky_of(self.scene, mixed_light(self.document))

    @cached_property
    def statistics(self) -> Statistics:
        """The statistics of all images of parameter maps. Raises LoadError."""
        textures = self.scene.textures
        return {image: textures.channel_statistics(image) for image in channel_images(self.document)}

    @property
    def n_map_nodes(self) -> int | None:
        """The number of nodes of each parameter map, None for as many as are planned."""
        return self.settings.with_lines(dict(self.document.overrides)).n_map_nodes

    @cached_property
    def picture_document(self) -> Document:
        """The document that pictures are made of (`app.document.node_layers`)."""
        return with_node_layers(self.document, self.statistics, self.n_map_nodes)

    @property
    def layers(self) -> dict[str, Layer]:
        """The layers that pictures are made of, by key: all but those of emitters and of hidden objects."""
        return dict(reflecting_layers(self.picture_document))

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
        return edges | rays | active_overrides(self.picture_document)

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
        from engine.scene.composed_scene import SceneComposer

        old, scene, at_rest = self.document, self.scene, self.resting
        if shape_of(document) != shape_of(old):
            at_rest = scene_at_rest(self.composer or SceneComposer(at_rest), document)
            scene = pose_scene(at_rest, document.poses).with_bumps(dict(document.new_bumps))
            scene = scene.from_camera(self.scene.description.camera, self.scene.resolution)
            scene.check_surfaces()
        turned = scene.description.from_camera(look.camera) != scene.description
        if turned or look.resolution not in (None, scene.resolution):
            scene = scene.from_camera(look.camera, look.resolution)
        project = replace(self, document=document, scene=scene, at_rest=at_rest)
        if "sky" in vars(self) and replace(mixed_light(document), intensity=1.0) == replace(
            mixed_light(old), intensity=1.0
        ):
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
        """The same with absolute paths, so that it can be opened from any folder; of an archive the path of its scene
        or session, unpacked. Raises InsituError."""
        name = full_path(self.name or DEFAULT_SCENE)
        values = tuple((path, value_with_full_path(path, value)) for path, value in self.values)
        if is_archive(name):
            scene = unpacked_scene_file(name)
            session = session_of_archive(name)
            name = renamed(name, str(scene)) if session is None else str(session)
        return replace(self, name=name, values=values)


def session_of(source: Source) -> Session | None:
    """The session of a source: its own, or that of the archive that its scene is in, which is unpacked. Raises
    InsituError."""
    if source.session is not None:
        return load_session(source.session)
    if not is_archive(source.scene):
        return None
    unpacked_scene_file(source.scene)
    return archived_session(source.scene)


def open_project(
    name: str | None,
    resolution: tuple[int, int] | None = None,
    values: Sequence[tuple[str, Any]] = (),
    camera: str | None = None,
) -> Project:
    """Load what `name` names and set `values` by path; seen from the view that its session
    bookmarks as `camera`, or from the camera of that name in its file.

    Raises InsituError with one line for the user.
    """
    from engine.realtime.zonal_harmonics.posed_scene import pose_scene
    from engine.scene.composed_scene import SceneComposer
    from engine.scene.scene_loader import load_scene

    use_decoder_process()
    source = source_of(find_source(name))
    session = session_of(source)
    look = Viewpoint() if session is None else session.view.viewpoint
    if size := resolution or look.resolution:
        require_memory_for(size)  # before a mesh is read
    named = source.scene if session is None else session.document.source
    path = unpacked_scene_file(named)
    scene = load_scene(path, size, split_axis(named)[1], variants_of(named))
    if camera is not None:
        saved = () if session is None else session.view.bookmarks
        offered = (*saved, *camera_bookmarks(scene.cameras, scene.description.camera.resolution))
        look = find_bookmark(offered, camera).viewpoint
    scene = scene.from_camera(look.camera, resolution or look.resolution)
    require_memory_for(scene.resolution)
    document, composer = document_from_description(named, scene.description, scene.animations), SceneComposer(scene)
    document = read_measurements(document, scene.folder, path)
    if source.light is not None:
        document = set_environment_file(source.light).apply(document)
    notes: tuple[str, ...] = ()
    if session is not None:
        added, problems = added_again(session.document, composer)
        notes = (*problems, *session_notes(session, document, added))
        document = read_measurements(fit_session(session, document, str(source.session or source.scene), added))
    for where, value in values:
        command = complete(set_path(document, where, value), partial(posed_scene, composer, document), composer)
        document = read_measurements(command.apply(document))
    at_rest = scene_at_rest(composer, document)
    scene = pose_scene(at_rest, document.poses).with_bumps(dict(document.new_bumps))
    scene.check_surfaces()
    sessions = () if source.session is None else (source.session,)
    set_inputs((*scene.files, *files_of_document(document), *sessions))
    if session is None:
        return Project(scene, document, at_rest=at_rest, composer=composer)
    return Project(scene, document, session.view.tone_mapping, session.view.settings, at_rest, notes, composer)


def with_overrides(project: Project, lines: Mapping[str, Any]) -> Project:
    """The project with these lines of its plan overridden. Raises InsituError for an unknown line or an invalid
    value."""
    document = project.document
    for line, value in lines.items():
        document = override_from_value(line, value).apply(document)
    return replace(project, document=document)
