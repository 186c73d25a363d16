"""A scene in Python: opened, edited, rendered, saved."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.document.arranging import Pivot, dropping, move_together, placed_objects
from app.document.commands.lamps import SetTarget
from app.document.commands.looks import AddLook, DeleteLook, MoveLook, RenameLook, SetLook
from app.document.commands.objects import AddObject
from app.document.commands.poses import PlaceObjects
from app.document.commands.suns import sun_addition
from app.document.document import Document
from app.document.looks import look_names
from app.document.material_match import MaterialMatchErrors
from app.document.scene_files import Up
from app.document.selection import selection_of
from app.document.sources import SESSION_ENDING, find_source, source_of
from app.document.view_state import Viewpoint, ViewState
from app.export import require_package_place
from app.files.session import save_session
from app.interface.editing import Editing
from app.interface.highlight_painting import paint_in_scene
from app.interface.light_placing import placing_in_picture
from app.interface.material_matching import match_object
from app.interface.nodes import CameraNode, GroupsNode, LightNode, ObjectNode, RowNode
from app.interface.photo_matching import MatchedPhoto, PairGiven, match_in_scene
from app.interface.pictures import Mode, Picture, Pictures
from app.interface.values import checked_resolution
from app.modes.placement.painted_curves import Solved
from app.photo.photo_request import LONGER_SIDE
from app.project.project import Project, open_project, session_of
from app.project.reading import complete
from app.stills.frame_sequence import own_camera
from app.stills.stills import ENDINGS, check_output, write_picture
from app.system.paths import full_path
from engine.core.colour import AnyView, ConfigView, find_view
from engine.core.colour_config import config_name, resolve_view
from engine.core.errors import InsituError
from engine.core.generators import run_to_end
from engine.inverse.curve_fit import HOLDING
from engine.inverse.highlight_brush import Effect, HighlightBrush
from engine.reference.path_tracer import N_SAMPLES
from engine.render.display import png_bytes
from engine.render.picture_error import ErrorEstimate
from engine.scene.arrangement import PlacedObject
from engine.scene.builtin import DEFAULT_SCENE
from engine.scene.composition import ADDABLE, SUN
from engine.scene.import_report import ImportReport, report_scene
from engine.scene.light_placement import PlacedLight, facing_of
from engine.scene.transform import Triple


def open_scene(
    name: str | os.PathLike[str] = DEFAULT_SCENE, *, resolution: tuple[int, int] | None = None, up: Up = "y"
) -> Scene:
    """Open a scene: the name of a built-in one, or a scene file, a session, a mesh, a folder or a zip archive with one
    of these, or an environment, which lights the built-in scene. resolution: (width, height) in pixels, None: as the
    file says. up: the axis of a mesh that points up.

    Raises insitu.Error, in one line that says what was found and what was expected.

    >>> import insitu
    >>> insitu.open("shapes", resolution=(96, 64))
    <scene shapes, 96 x 64: torus, cone, sphere, cylinder, cube, ground>
    """
    if not isinstance(name, (str, os.PathLike)):
        raise InsituError(f"open: {name!r}, expected the name of a scene or a path")
    source = find_source(os.fspath(name), up)
    own = source_of(source)
    project, session = open_project(source, checked_resolution(resolution)), session_of(own)
    return Scene(project, ViewState() if session is None else session.view, own.session)


class Scene:
    """A scene with its materials, light and camera, and its pictures; made by `insitu.open`.

    Objects are found by name, their layers by name or number: `scene["teapot"]["copper"]`. An edit is one of the
    editor's commands; `undo` takes it back. The parts of a picture are stored for the next one: after the edit of a
    curve only the bands of that curve are summed. One scene belongs to one thread at a time.

    >>> import insitu
    >>> scene = insitu.open("shapes", resolution=(48, 32))
    >>> before = scene.image()
    >>> before.shape, before.dtype
    ((32, 48, 3), dtype('float32'))
    >>> scene["cube"]["paint"].visible = False
    >>> bool((scene.image() == before).all())
    False
    >>> scene.undo()
    'hide cube.0'
    >>> bool((scene.image() == before).all())
    True
    """

    def __init__(self, project: Project, view: ViewState, session: Path | None) -> None:
        """view: of the session at the path `session`, where there is one."""
        self._editing = Editing(project.document, own_camera(project.scene), project.scene.resolution)
        self._project, self._view, self._session = project, view, session
        self._pictures = Pictures()

    # ------------------------------------------------------------------------------------------------------------ parts

    def __getitem__(self, name: str) -> ObjectNode:
        return ObjectNode(self._editing, self.document.object(name).name)

    def __iter__(self) -> Iterator[str]:
        return iter([state.name for state in self.document.objects])

    def __repr__(self) -> str:
        width, height = self._editing.resolution
        name = Path(self.document.source).stem
        return f"<scene {name}, {width} x {height}: {', '.join(self)}>"

    def _repr_png_(self) -> bytes:
        """The picture for a notebook, as in the editor's viewport."""
        return png_bytes(self.image(), tone_mapping=self._project.view)

    @property
    def light(self) -> LightNode:
        """The distant light."""
        return LightNode(self._editing, "light")

    @property
    def groups(self) -> GroupsNode:
        """The groups of objects."""
        return GroupsNode(self._editing, "groups")

    @property
    def camera(self) -> CameraNode:
        """The camera that pictures are seen from."""
        return CameraNode(self._editing)

    @property
    def looks(self) -> tuple[str, ...]:
        """The names of its looks: variants of materials, light and poses; none where it has one state without a name.

        >>> import insitu
        >>> scene = insitu.open("shapes", resolution=(48, 32))
        >>> scene.new_look("Bare")
        >>> scene["cube"]["paint"].visible = False
        >>> scene.look = "Look 1"
        >>> scene.looks, scene["cube"]["paint"].visible
        (('Look 1', 'Bare'), True)
        """
        return look_names(self.document)

    @property
    def look(self) -> str:
        """The name of the current look, which edits and pictures are of; "" where there are none."""
        return self.document.look

    @look.setter
    def look(self, name: str) -> None:
        self._editing.do(SetLook(name))

    @property
    def report(self) -> ImportReport:
        """What the scene's files contain, what was repaired, and every property that is not shown.

        >>> import insitu
        >>> report = insitu.open("shapes", resolution=(48, 32)).report
        >>> len(report.objects), report.unshown
        (6, ())
        """
        return report_scene(self._project.resting)

    @property
    def document(self) -> Document:
        """The document as an immutable value: two of them can be compared."""
        return self._editing.document

    @property
    def viewpoint(self) -> Viewpoint:
        """Camera and resolution."""
        return self._editing.viewpoint

    # --------------------------------------------------------------------------------------------------------- pictures

    def image(
        self, mode: Mode = "placement", *, bounces: int | None = None, resolution: tuple[int, int] | None = None,
        samples: int = N_SAMPLES, draft: bool = False,
    ) -> Picture:  # fmt: skip
        """The picture, linear Rec. 709 radiance (H, W, 3) float32, and over a transparent background with alpha, which
        is multiplied into the light, (H, W, 4). The array is the caller's.

        mode: "placement", exact; "orbit" and "deform", as those modes show it at rest: the first picture takes longer,
        others from another camera or in another pose take less; "paths", by path tracing, to compare with. bounces: how
        often light is reflected, 1 to 16; None: as the scene says or requires. resolution: (width, height), of this
        picture alone. samples: paths per pixel, only for "paths". draft: parameters such as a roughness, on which more
        than curves depends, change only the curves, as in the editor while they are dragged; Placement then computes no
        new transport. Raises insitu.Error.
        """
        if isinstance(samples, bool) or not isinstance(samples, int) or samples < 1:
            raise InsituError(f"samples = {samples!r}, expected a whole number from 1")
        return self._pictures.picture(self._seen_in(resolution), mode, bounces, samples, draft)

    def error(
        self, mode: Mode = "placement", *, bounces: int | None = None, resolution: tuple[int, int] | None = None
    ) -> ErrorEstimate:
        """The error of that picture: relative RMS errors, `overall`, `direct` and `indirect`, estimated by tracing some
        of its points; within about a factor of two. Arguments: as of `image`. Raises insitu.Error.

        >>> import insitu
        >>> error = insitu.open("shapes", resolution=(48, 32)).error(bounces=1)
        >>> 0.0 < error.overall < 0.1
        True
        """
        return self._pictures.error(self._seen_in(resolution), mode, bounces)

    def set_view(self, name: str = "", *, ocio: str | None = None, display: str = "", look: str = "") -> None:
        """Choose how light becomes colour in PNG files and notebooks: a view such as `"AgX"`, or one of an
        OpenColorIO configuration, the file `ocio`; what is left open is its default. Raises insitu.Error.

        >>> import insitu
        >>> scene = insitu.open("shapes", resolution=(48, 32))
        >>> scene.set_view("AgX")
        >>> scene.set_view("Un-tone-mapped", ocio="ocio://default")
        """
        view: AnyView
        if ocio is None:
            view = find_view(name)
        else:
            view = resolve_view(ConfigView(config_name(ocio), display, name, look))
        self._project, self._view = replace(self._project, view=view), replace(self._view, tone_mapping=view)

    def save(
        self, path: str | os.PathLike[str] | None = None, mode: Mode = "placement", *, bounces: int | None = None
    ) -> Path:
        """Save the session (.insitu), or the picture as linear light (.exr) or as the viewport shows it (.png); returns
        the path. path None: the session that was opened. mode, bounces: of the picture, as of `image`. A file is
        written whole or not at all. Raises insitu.Error."""
        if path is None and self._session is None:
            raise InsituError(f"save: expected a path that ends in {SESSION_ENDING}, .exr or .png")
        path = Path(path or self._session or "")
        if path.suffix.lower() in ENDINGS:
            write_picture(check_output(path), self.image(mode, bounces=bounces), self._project.view)
            return path
        if path.suffix.lower() != SESSION_ENDING:
            raise InsituError(f"{path}: expected a path that ends in {SESSION_ENDING}, .exr or .png")
        view = replace(self._view, camera=self._editing.camera, resolution=self._editing.resolution)
        self._session = save_session(path, self.document, view)
        return self._session

    def save_scene(self, path: str | os.PathLike[str], *, replaces: bool = False) -> Path:
        """Save the scene with everything it needs, in a new folder or, where the path ends in `.insitu.zip`, in one
        file: it opens to the same picture elsewhere. Returns the path. replaces: whether a file that is there may be
        replaced. Raises insitu.Error."""
        from app.export.package import package_steps

        path = Path(path)
        require_package_place(path, replaces)
        view = replace(self._view, camera=self._editing.camera, resolution=self._editing.resolution)
        run_to_end(package_steps(self.document, view, self._seen_in(None).scene.files, path))
        return path

    def save_environment(self, path: str | os.PathLike[str]) -> Path:
        """Save the environment, with what is painted on it, its suns and their mix, as an OpenEXR map of latitude and
        longitude, before it is rotated. Returns the path. Raises insitu.Error."""
        from app.export.environment import write_environment

        path = Path(path)
        write_environment(path, self._seen_in(None).sky)
        return path

    # ------------------------------------------------------------------------------------------------------------ edits

    def add(
        self, what: str | os.PathLike[str], name: str = "", *, at: tuple[float, float, float] | None = None,
        size: float | None = None,
    ) -> ObjectNode | RowNode:  # fmt: skip
        """Add a shape ("box", "sphere", "plane", "cylinder", "cone", "torus"), a prop ("backdrop", "shader ball",
        "pedestal"), a light ("rectangle light", "disc light", "sphere light", "point light", "spot light"), a "sun" or
        all objects of a mesh file; returns the first. name: of the object, "" for its own. at: the point that it stands
        on, of a light its middle; None: the ground at the point looked at, or above that. size: its largest side in
        metres; None: a share of the scene's, of a file its own. A sun has no place, and its size is an angle in
        degrees. Raises insitu.Error.

        >>> import insitu
        >>> scene = insitu.open("shapes", resolution=(48, 32))
        >>> scene.add("box", "plinth", size=0.2).position = (0.0, 0.0, 0.4)
        >>> scene
        <scene shapes, 48 x 32: torus, cone, sphere, cylinder, cube, ground, plinth>
        """
        what, count = os.fspath(what), len(self.document.objects)
        if what == SUN:
            self._editing.do(complete(sun_addition(name, at, size), lambda: self._seen_in(None).scene))
            return self.light[self.document.light.suns[-1].name]
        command = AddObject(what if what in ADDABLE else full_path(what), name, at, size)
        self._editing.do(complete(command, lambda: self._seen_in(None).scene, self._project.composer))
        return self[self.document.objects[count].name]

    def new_look(self, name: str = "") -> None:
        """Make a look behind the current one, equal to it, and current; name: "" for a free one. Raises
        insitu.Error."""
        self._editing.do(AddLook(name))

    def rename_look(self, look: str, name: str) -> None:
        """Give a look another name. Raises insitu.Error."""
        self._editing.do(RenameLook(look, name))

    def move_look(self, look: str, place: int) -> None:
        """Move a look to another place among them, from 0. Raises insitu.Error."""
        self._editing.do(MoveLook(look, place))

    def delete_look(self, look: str) -> None:
        """Delete a look; of the current one the next becomes current. Raises insitu.Error."""
        self._editing.do(DeleteLook(look))

    def move(
        self, objects: str | Sequence[str], by: Triple = (0.0, 0.0, 0.0), *, rotate: Triple = (0.0, 0.0, 0.0),
        scale: float | Triple = 1.0, about: Pivot = "middle",
    ) -> None:  # fmt: skip
        """Move objects by metres, rotate them by degrees about the world's X, Y and Z, and scale them along its axes,
        as one edit: about their common "middle", each about its "own" centre and along its own axes, or about that
        of the "active" one, the last.
        Raises insitu.Error.

        >>> import insitu
        >>> scene = insitu.open("teatray", resolution=(48, 32))
        >>> scene.move(["teapot", "tray"], rotate=(0, 90, 0))
        >>> scene.undo()
        'move 2 objects'
        """
        factors = scale if isinstance(scale, tuple) else (scale, scale, scale)
        self._editing.do(move_together(self._placed(objects), by, rotate, factors, about))

    def drop(self, objects: str | Sequence[str]) -> None:
        """Let objects stand on what is below them, judged by boxes; those of a group stay together. Raises
        insitu.Error."""
        self._editing.do(dropping(self.document, _names(objects), self._resting_box))

    def aim(self, light: str, at: Triple) -> None:
        """Turn a flat light or a spot to shine at a point, metres. Raises insitu.Error."""
        if self.document.object(light).lamp is not None:
            self._editing.do(SetTarget(light, at))
            return
        resting, (placed,) = self._seen_in(None).resting, self._placed(light)
        facing = facing_of(resting.description.objects[resting.object_names.index(light)])
        if facing is None:
            raise InsituError(f"aim: {light} shines to all sides or not at all, expected a flat light or a spot")
        aimed = PlacedLight(placed.pivot, facing, placed.transform).aimed_at(at)
        self._editing.do(PlaceObjects(((light, aimed),), f"aim {light}"))

    def place_light(
        self, light: str, *, highlight: tuple[int, int] | None = None,
        shadow: tuple[tuple[int, int], tuple[int, int]] | None = None,
    ) -> str:  # fmt: skip
        """Place a light, a sun or `"painted.Key"`: where the camera sees its `highlight` at a pixel, column and row; or
        where it throws the `shadow` of what is at one pixel on another. It stays as far away as it was. Returns one
        line that says what keeps it from doing so, such as an object that hides it there; "" where nothing does.
        Raises insitu.Error.

        >>> import insitu
        >>> scene = insitu.open("shapes", resolution=(48, 32))
        >>> _ = scene.add("sphere light", "key", at=(0.0, 1.5, 0.0))
        >>> scene.place_light("key", highlight=(24, 28))
        ''
        """
        command, line = placing_in_picture(self._seen_in(None), light, highlight, shadow, self._resting_box)
        if command is not None:
            self._editing.do(command)
        return line

    def match(
        self, name: str, photo: str | os.PathLike[str], *, find: str | Sequence[str] = (),
        pairs: Sequence[PairGiven] = (), mask: str | os.PathLike[str] | None = None, transfer: str = "srgb",
        exposure: float | None = None, rotation: bool = False, lights: bool = False, bounces: int | None = None,
        side: int = LONGER_SIDE, start: str = "",
    ) -> MatchedPhoto:  # fmt: skip
        """Find the material of an object from a photograph that was taken in the scene's light, as one edit; with pairs
        a second one moves the camera, and gives pictures the photograph's shape.

        find: "LAYER.NAME" of curves, scales and parameters, none for the usual ones; pairs: four or more places in the
        photograph, (column, row), and the points there, (x, y, z) in metres, which align the camera; mask: a picture
        of the same size that is black where the photograph does not count; transfer: the curve of a file of whole
        numbers, "srgb", "linear" or a gamma such as "2.2"; exposure: None to find it by the rest of the picture;
        rotation, lights: whether to find how the environment was turned, and how strong each light was; side: of the
        picture that is compared, pixels; start: the material of the library to begin with, "" for the object's own.
        Raises insitu.Error."""
        return match_in_scene(
            self._editing, self._seen_in(None), name, photo, pairs, targets=_names(find), transfer=transfer,
            mask=None if mask is None else Path(mask), exposure=exposure, finds_rotation=rotation, finds_lights=lights,
            n_bounces=bounces, longer_side=side, start=start,
        )  # fmt: skip

    def paint_highlight(
        self, path: str, points: Sequence[tuple[float, float]], *, effect: Effect = "brighter", stops: float = 1.0,
        radius: float = 16.0, hardness: float = 0.5, hold: float = HOLDING,
        colour: tuple[float, float, float] = (1.0, 1.0, 1.0), solve: Solved = "curve",
    ) -> float:  # fmt: skip
        """Paint the highlight of a layer, "OBJECT.LAYER" or one of its curves, along points (column, row) of the
        picture: "brighter" or "darker" by stops, "tint" by a colour, or "as_there", which makes it that radiance. The
        curve follows, or "curves", or the "scale", as one edit. radius: of the brush, pixels, in full to its hardness;
        hold: how much the rest of the object is held. Returns the share of the wish that came true, 0 to 1. Raises
        insitu.Error."""
        brush = HighlightBrush(effect, stops, radius, hardness, hold, colour)
        return paint_in_scene(
            self._editing, lambda: self._seen_in(None), lambda: self.image()[..., :3],
            selection_of(self.document, path), brush, points, solve,
        )  # fmt: skip

    def _placed(self, objects: str | Sequence[str]) -> list[PlacedObject]:
        """Objects as they stand."""
        return placed_objects(self.document, _names(objects), self._resting_box)

    def _resting_box(self, name: str) -> NDArray[np.float64] | None:
        """The box (2, 3) of an object where its file has it, None where it has no surface."""
        resting = self._seen_in(None).resting
        box = np.asarray(resting.bounds[resting.object_names.index(name)], np.float64)
        return box if np.isfinite(box).all() else None

    def match_material(
        self, object: str, model: str, source: str | None = None, *, curves: Sequence[str] | None = None,
        search: Sequence[str] | None = None,
    ) -> MaterialMatchErrors:  # fmt: skip
        """Give an object one layer of a model, as near as that comes to a material: `source`, an object or a layer by
        its path, a material of the library or of a file, or a measured BRDF's file; None: the object's own.

        Each of `curves`, None for all, gets one operator; `search` are scalar parameters that are searched for, None
        for those that no curve has, such as roughness. Returns the errors: of the BRDF `before` and after, `brdf`, and
        of the object's `picture`, None where no pixel sees it (docs/inverse.md). Raises insitu.Error.
        """
        return match_object(self._editing, self._seen_in(None), object, model, source, curves, search)

    def undo(self) -> str | None:
        """Undo the last edit; returns its label, None where there is none."""
        return self._editing.undo()

    def redo(self) -> str | None:
        """Redo the edit that was undone last; returns its label, None where there is none."""
        return self._editing.redo()

    def _seen_in(self, resolution: tuple[int, int] | None) -> Project:
        """The scene as it is now, loaded and posed; what did not change since the last time is shared with it."""
        look = self.viewpoint._replace(resolution=checked_resolution(resolution) or self._editing.resolution)
        self._project = self._project.edited(self.document, look)
        return self._project


def _names(objects: str | Sequence[str]) -> tuple[str, ...]:
    return (objects,) if isinstance(objects, str) else tuple(dict.fromkeys(objects))
