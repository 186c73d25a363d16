"""Opens what the command line names: a scene (built-in or a file) or a session, with values set by path, as scripts set
them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from app.document.commands import EditCommand
from app.document.commands.groups import SetGroup, group_edit
from app.document.commands.layers import (
    SetEditable,
    SetFrame,
    SetFresnelTerm,
    SetFrozen,
    SetMaterial,
    SetParameter,
    SetShadowCatcher,
    SetUnder,
    SetVariant,
    SetVisible,
)
from app.document.commands.light import (
    SetBackground,
    SetBackgroundColour,
    SetEmission,
    SetEnvironment,
    SetIntensity,
    SetMapChange,
    SetMapping,
    SetRotation,
    SplitEnvironment,
    set_environment_file,
)
from app.document.commands.links import LinkCurves, UnlinkCurve
from app.document.commands.looks import SetLook
from app.document.commands.maps import SetBumps, SetMap, SetOpacity, SetParameterMap, surface_named
from app.document.commands.mix import SetMix
from app.document.commands.objects import addition, with_presence
from app.document.commands.painted import painted_addition, with_painted
from app.document.commands.plan import FIRST_BANDS, active_overrides, override_from_value, set_first_bands
from app.document.commands.poses import with_amounts, with_placement, with_time
from app.document.commands.suns import SetSun, sun_presence
from app.document.document import Document, document_from_description, reflecting_layers
from app.document.light_mix import mixed_light
from app.document.light_state import ENVIRONMENT_KEY
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
from app.document.sources import Source, find_source, likely_mapping, source_of
from app.document.targets import (
    ADD,
    BACKGROUND,
    BACKGROUND_COLOUR,
    EMISSION,
    FRAME,
    FRESNEL_TERM,
    IN_GROUP,
    LOOK,
    MAP_FIELDS,
    MATERIAL,
    PAINTED,
    PRESENCE_FIELDS,
    SHADOW_CATCHER,
    SIDES,
    TIME,
    UNDER,
    VARIANT,
    Target,
    resolve,
)
from app.document.view_state import Viewpoint
from app.files.bookmarks import camera_bookmarks, find_bookmark
from app.files.material_files import import_material, is_material_file
from app.files.materials import Library, full_material_name, import_measured, load_material
from app.files.session import Session, archived_session, fit_session, load_session, session_notes
from app.project.distant_light import sky_of
from app.project.document_scene import posed_scene, scene_at_rest, shape_of
from app.project.reading import added_again, complete, read_measurements
from app.system.atomic import set_inputs
from app.system.decoder_process import use_decoder_process
from app.system.memory import require_memory_for
from app.system.paths import full_path, is_file_name
from engine.core.colour import AnyView
from engine.core.errors import InsituError, LoadError
from engine.light.painted_lights import PAINTED_KINDS
from engine.material.layer import FRAMES, object_of
from engine.material.parameters import INDICES, reflectance_of_index
from engine.measured.measurement import ENDINGS as MEASURED_ENDINGS
from engine.scene.builtin import DEFAULT_SCENE
from engine.scene.composition import ADDABLE
from engine.scene.toml_text import parse_toml
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
        values = tuple((path, _with_full_path(path, value)) for path, value in self.values)
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


def set_path(document: Document, path: str, value: Any) -> EditCommand:
    """The command that sets ``path`` to ``value``: ``"teapot.1.alpha"``, ``"light.rotation"``…

    Raises InsituError for a path that names nothing with a value. The command line and scripts set by path.
    """
    if path == FIRST_BANDS:
        return set_first_bands(value)
    if path == TIME and all(state.name != TIME for state in document.objects):
        return with_time(value)
    if path == VARIANT and all(state.name != VARIANT for state in document.objects):
        if not isinstance(value, str):
            raise LoadError(path, "value", value, "the name of a variant of the scene")
        return SetVariant(value)
    if path == LOOK and all(state.name != LOOK for state in document.objects):
        if not isinstance(value, str):
            raise LoadError(path, "value", value, "the name of a look of the session")
        return SetLook(value)
    head, _, last = path.rpartition(".")
    if last == ADD and head.startswith(f"light.{PAINTED}."):
        return painted_addition(path, head.removeprefix(f"light.{PAINTED}."), value)
    if last == ADD and all(state.name != head for state in document.objects):
        return addition(path, head, value)
    by_index = _set_by_index(document, path, value)
    if by_index is not None:
        return by_index
    target = resolve(document, path)
    if target.kind == "factor":
        if not isinstance(value, str):
            raise LoadError(path, "value", value, 'the curve that it follows, such as cup.coat.theta_h, or ""')
        return LinkCurves(value, (path,)) if value else UnlinkCurve(path)
    if target.kind == "parameter" and target.key is not None and target.name is not None:
        return SetParameter(target.key, target.name, value)
    if target.kind == "map" and target.key is not None and target.name is not None:
        return SetMap(target.key, target.name, value)
    if target.kind == "parameter_map" and target.key is not None and target.name is not None:
        return SetParameterMap(target.key, target.name, value)
    if target.kind == "bumps" and target.name is not None:
        return SetBumps(target.object, target.name, value)
    if target.kind == "opacity" and target.name is not None:
        return SetOpacity(target.object, target.name, value)
    if target.kind == "surface" and target.name is not None:
        return surface_named(target.object, target.name, value)
    if target.kind == "deformer" and target.name is not None:
        return with_amounts(document, target.object, {target.name: value})
    if target.kind == "transform" and target.name is not None:
        return with_placement(path, target.object, target.name, value)
    if target.kind == "group" and target.name is not None:
        return group_edit(document, path, target.object, target.name, value)
    if target.kind == "presence" and target.name == IN_GROUP:
        if not isinstance(value, str):
            raise LoadError(path, "value", value, 'the name of a group, or ""')
        return SetGroup((target.object,), value)
    if target.kind == "presence" and target.name is not None:
        return with_presence(path, target.object, target.name, value)
    if target.kind == "time":
        return with_time(value, target.object)
    if target.kind == "light":
        return _set_light(path, target, value)
    if target.kind == "sun" and target.name is not None:
        if target.name in PRESENCE_FIELDS:
            return sun_presence(path, target.object, target.name, value)
        return SetSun(target.object, target.name, value)
    if target.kind == "painted" and target.name is not None:
        return with_painted(path, target.object, target.name, value)
    if target.kind == "mix" and target.name is not None:
        return SetMix(target.object, target.name, value)
    if target.kind == "switch":
        return _set_switch(path, target, value)
    raise InsituError(f"{path!r} is a {target.kind} and has no value; name a parameter of it")


def _with_full_path(path: str, value: Any) -> Any:
    """A value that `path` is set to, with the absolute path of the file that it names, if it names one. Raises
    InsituError."""
    if isinstance(value, str) and (
        path == ENVIRONMENT_KEY or (path.endswith(f".{ADD}") and value not in (*ADDABLE, *PAINTED_KINDS))
    ):
        return full_path(value)
    is_material = isinstance(value, str) and path.rpartition(".")[2] == MATERIAL
    return full_material_name(value) if is_material else value


def _set_by_index(document: Document, path: str, value: Any) -> SetParameter | None:
    """The command that sets a facing reflectance by its index of refraction, ``"coat.1.fresnel_index"``; None where the
    path is of anything else."""
    head, _, last = path.rpartition(".")
    name = next((name for name, index in INDICES.items() if index.name == last), None)
    if name is None:
        return None
    target = resolve(document, f"{head}.{name}")
    if target.kind != "parameter" or target.key is None:
        return None
    return SetParameter(target.key, name, reflectance_of_index(INDICES[name].accept(value)))


def _set_light(path: str, target: Target, value: Any) -> EditCommand:
    if target.name == "environment":
        if not isinstance(value, str):
            raise LoadError(path, "value", value, "a built-in environment's name or a file's path")
        return SetEnvironment(value, likely_mapping(Path(value)))
    if target.name == "mapping":
        return SetMapping(value)
    if target.name in MAP_FIELDS:
        return SetMapChange(target.name, value)
    if target.name == SIDES:
        return SplitEnvironment(value)
    if target.name == BACKGROUND:
        return SetBackground(value)
    if target.name == BACKGROUND_COLOUR:
        return SetBackgroundColour(value)
    return SetRotation(value) if target.name == "rotation" else SetIntensity(value)


def _set_switch(path: str, target: Target, value: Any) -> EditCommand:
    if target.name == MATERIAL:
        return _set_material(path, target.object, value)
    if target.name == EMISSION:
        return SetEmission(target.object, value)
    owner = target.key or target.object
    if target.name == UNDER:
        if not isinstance(value, str):
            raise LoadError(path, "value", value, 'the name of a layer of the same object, or ""')
        return SetUnder(owner, value)
    if target.name == FRAME:
        if value not in FRAMES:
            raise LoadError(path, "value", value, f"one of {', '.join(FRAMES)}")
        return SetFrame(owner, value)
    if not isinstance(value, bool):
        raise LoadError(path, "value", value, "true or false")
    if target.name == SHADOW_CATCHER:
        return SetShadowCatcher(owner, value)
    if target.name == "editable":
        return SetEditable(owner, value)
    if target.name == FRESNEL_TERM:
        return SetFresnelTerm(owner, value)
    return SetVisible(owner, value) if target.name == "visible" else SetFrozen(owner, value)


def _set_material(path: str, name: str, value: Any) -> SetMaterial:
    if not isinstance(value, str):
        raise LoadError(
            path, "value", value, "the name of a material in the library, or a file of materials or of measurements"
        )
    if Path(value).suffix.lower() in MEASURED_ENDINGS:
        return import_measured(name, Path(value))
    if is_material_file(value):
        return import_material(name, value)
    material = load_material(Path(value)) if is_file_name(value) else Library().entry(value).material
    return SetMaterial(name, material.layers, material.name)
