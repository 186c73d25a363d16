"""The nodes that a scene is edited through: its objects, their layers and curves, the light and the camera.

A node holds only a path into the document: reading one of its attributes reads the document, setting one carries out
the command that the same path has in scripts and on the command line (`app.project.project`). Commands and moves of the
camera are steps of one history (`app.interface.editing`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ValidationError

from app.document.commands.curves import AddOperator, ResetCurve, SetOperators
from app.document.commands.groups import members_of
from app.document.commands.lamps import lamp_fields
from app.document.commands.links import LinkCurves, UnlinkCurve
from app.document.commands.painted import AddPainted
from app.document.commands.transfer import TransferEdit
from app.document.document import all_factors
from app.document.light_state import ENVIRONMENT_KEY, MIX_FIELDS, group_key, sun_key
from app.document.linked_curves import linked_keys
from app.document.painted_parameters import FILE
from app.document.targets import (
    EMISSION,
    FRAME,
    GROUP_FIELDS,
    GROUPS,
    IN_GROUP,
    LIGHT_FIELDS,
    LINKED,
    MAP_SUFFIX,
    PAINTED,
    PRESENCE_FIELDS,
    SUN_FIELDS,
    SWITCHES,
    TIME,
    UNDER,
    painted_fields,
    resolve,
)
from app.interface.editing import Editing
from app.interface.values import plain_value, value_at
from app.project.assignments import set_path
from app.system.paths import full_path
from engine.core.errors import InsituError
from engine.curve.operators import ALL_CHANNELS, HALF_PI, Channels, Edit, Operator, OperatorError
from engine.inverse.transferred_edit import Measure
from engine.light.painted_lights import PaintedKind
from engine.material.bumps import bump_fields
from engine.material.layer import Layer
from engine.material.map_tables import map_fields
from engine.material.opacity import opacity_fields
from engine.material.parameter_maps import MAPPED_KINDS
from engine.realtime.deformers import KINDS
from engine.scene.camera_moves import orbit_camera
from engine.scene.description import Camera
from engine.scene.toml_text import first_validation_error

Region = tuple[float, float] | tuple[float, float, float, float]
EVERYWHERE: Region = (0.0, 0.0, HALF_PI, HALF_PI)


class Node:
    """Attributes that stand for values of the document; `dir()` lists them."""

    def __init__(self, editing: Editing, path: str) -> None:
        object.__setattr__(self, "_editing", editing)
        object.__setattr__(self, "_path", path)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return value_at(self._editing.document, f"{self._path}.{name}")

    def __setattr__(self, name: str, value: object) -> None:
        self._editing.do(set_path(self._editing.document, f"{self._path}.{name}", plain_value(value)))

    def __dir__(self) -> list[str]:
        return [*object.__dir__(self), *self._names()]

    def __repr__(self) -> str:
        return f"<{self._path}: {', '.join(self._names())}>"

    def _names(self) -> Sequence[str]:
        return ()


class LightNode(Node):
    """The distant light: `environment` (a built-in name or a file), `mapping`, `rotation` in degrees counter-clockwise
    about +Y, `tilt`, and `intensity`, which multiplies all light. `hue` (degrees), `contrast` and `clamp` (0: none)
    change the map. `background` is what is seen behind all, "environment",
    "colour" (`background_colour`, linear) or "transparent": then pictures have alpha. Suns are found by their names,
    and have `direction`, `irradiance` (W/m²) and `diameter` (degrees); `scene.add("sun")` adds one. Emitters in the
    scene are set by the `emission` of their object.

    Painted lights are added by `paint` and found as `light["painted.Fill"]`.

    Each light has a row in the mix: `light["environment"]`, suns, painted lights, `light["groups.Key"]` for all lights
    whose group is "Key", and emitters, by their object: `on`, `solo`, `strength` in stops, `colour` or `kelvin`,
    `group`, and `excludes`, the names of objects that it does not light.

    >>> import insitu
    >>> light = insitu.open("shapes").light
    >>> light.rotation = 450
    >>> light.rotation
    90.0
    >>> light["environment"].strength = -1
    """

    def __getitem__(self, light: str) -> RowNode:
        names = list(self)
        if light not in names:
            raise InsituError(f"there is no light {light!r}; available: {', '.join(names)}")
        return RowNode(self._editing, f"{self._path}.{light}")

    def paint(self, kind: PaintedKind, name: str = "", **values: Any) -> RowNode:
        """Paint a light onto the environment: a "box", "disc", "gradient", "sky" or "image" (`file`), with values of
        its parameters; returns it.

        >>> import insitu
        >>> light = insitu.open("shapes").light
        >>> fill = light.paint("box", "Fill", azimuth=-60, width=50)
        >>> fill.height, fill.strength
        (40.0, 0.0)
        """
        given = tuple(
            (key, full_path(str(plain_value(value))) if key == FILE else plain_value(value))
            for key, value in values.items()
        )
        self._editing.do(AddPainted(kind, name, given))
        return RowNode(self._editing, f"{self._path}.{PAINTED}.{self._editing.document.light.painted[-1].name}")

    def __iter__(self) -> Iterator[str]:
        light = self._editing.document.light
        keys = dict.fromkeys((ENVIRONMENT_KEY, *light.keys, *map(group_key, light.groups)))
        return iter([key.removeprefix("light.") for key in keys])

    def _names(self) -> Sequence[str]:
        return LIGHT_FIELDS


class RowNode(Node):
    """A light's row in the mix: `on`, `solo`, `strength`, `colour`, `kelvin`, `group` and `excludes`. A sun has also
    `direction` towards it at rotation 0, or its `azimuth` and `elevation` in degrees, `irradiance` of a surface that
    faces it (W/m², three numbers), and `diameter` in degrees; `name`, `duplicate` (set to the name of a new one) and
    `deleted` (set to True). A painted light has the parameters of its kind (docs/guides/lights.md)."""

    def _names(self) -> Sequence[str]:
        is_sun = self._path in map(sun_key, [each.name for each in self._editing.document.light.suns])
        painted = painted_fields(self._editing.document, self._path.removeprefix(f"light.{PAINTED}."))
        return (*SUN_FIELDS, *PRESENCE_FIELDS, *MIX_FIELDS) if is_sun else (*painted, *MIX_FIELDS)


class GroupsNode(Node):
    """The groups of objects, by name; each has `name`, `visible` and `frozen`.

    >>> import insitu
    >>> scene = insitu.open("teatray")
    >>> scene["teapot"].in_group = scene["tray"].in_group = "Tea"
    >>> scene.groups["Tea"].visible = False
    >>> list(scene.groups), scene["tray"].visible
    (['Tea'], False)
    """

    def __getitem__(self, name: str) -> GroupNode:
        return GroupNode(self._editing, f"{self._path}.{members_of(self._editing.document, name) and name}")

    def __iter__(self) -> Iterator[str]:
        return iter(self._editing.document.groups)

    def _names(self) -> Sequence[str]:
        return list(self)


class GroupNode(Node):
    """A group of objects: its `name`, and whether all of them are `visible` and `frozen`."""

    def __iter__(self) -> Iterator[str]:
        return iter(members_of(self._editing.document, self._path.removeprefix(f"{GROUPS}.")))

    def _names(self) -> Sequence[str]:
        return GROUP_FIELDS


class ObjectNode(Node):
    """An object: `visible`, `frozen`, `editable`, `shadow_catcher` (pictures show only shadows on it),
    `in_group` (the name of a group of objects, "" for none), `linked` (the name of the link of objects that share its
    material, "" for none; `linked_duplicate`, set to a new name, makes one), `emission` (of a lamp, three numbers) and
    its row in the mix of lights (`on`, `solo`, `strength`, `colour`, `kelvin`, `group`, `excludes`), `position`
    (metres), `rotation` (degrees) and `scale` relative to its place in the file, `time` of its animation, amounts of
    deformers (`bend`, `twist` …), parts of bumps and opacity; of a lamp its `width` and `height` or its `radius`
    (metres), the `inner_angle` and `outer_angle` of a spot (degrees from its axis), and the `target` that it shines at;
    `material`, which can be set alone, to the name of a material of the library, a material's file or a measured
    BRDF's. Its layers are found by name or number.

    >>> import insitu
    >>> scene = insitu.open("teatray")
    >>> list(scene["teapot"])
    ['base', 'copper']
    >>> scene["teapot"].visible = False
    >>> scene["teapot"].shiny
    Traceback (most recent call last):
    engine.core.errors.InsituError: there is no layer of teapot 'shiny'; available: 0 (base), 1 (copper)
    """

    def __getitem__(self, layer: str | int) -> LayerNode:
        target = resolve(self._editing.document, f"{self._path}.{layer}")
        if target.kind != "layer" or target.key is None:
            raise InsituError(f"{self._path}.{layer} is a {target.kind}, expected one of {', '.join(self)}")
        return LayerNode(self._editing, target.key)

    def __iter__(self) -> Iterator[str]:
        return iter([layer.name for layer in self._editing.document.object(self._path).layers])

    def _names(self) -> Sequence[str]:
        state = self._editing.document.object(self._path)
        mix = (*MIX_FIELDS, *lamp_fields(state)) if state.emits else ()
        return (*SWITCHES, IN_GROUP, LINKED, EMISSION, *mix, TIME, *KINDS, *bump_fields(), *opacity_fields())


class LayerNode(Node):
    """A layer of a material: the parameters of its model by name, `visible`, `frozen` and the parts of its maps;
    `alpha_map` is the map of `alpha`, a file or a table as in a scene, None for none. Its curves are found by name.

    >>> import insitu
    >>> copper = insitu.open("teatray")["teapot"]["copper"]
    >>> copper.model, list(copper)
    ('ashikhmin_shirley', ['gamma_alpha', 'gamma_beta'])
    >>> copper.n_u = 20
    >>> copper.n_u, copper.scale
    (20.0, (0.92, 0.5, 0.33))
    """

    @property
    def model(self) -> str:
        """The name of its model, as docs/models.md lists them."""
        return self._layer.model.name

    @property
    def parameters(self) -> dict[str, Any]:
        """All parameters of its model by name."""
        return dict(self._layer.parameters)

    def __getitem__(self, curve: str) -> Curve:
        names = list(self)
        if curve not in names:
            raise InsituError(f"there is no curve {curve!r} of {self._path}; available: {', '.join(names)}")
        return Curve(self._editing, self._path, curve)

    def __iter__(self) -> Iterator[str]:
        return iter([factor.name for factor in all_factors(self._layer.model)])

    @property
    def _layer(self) -> Layer:
        return self._editing.document.layer(self._path)

    def _names(self) -> Sequence[str]:
        parameters = (parameter.name for parameter in self._layer.parameter_table)
        vary = (each.name + MAP_SUFFIX for each in self._layer.model.parameters if each.kind in MAPPED_KINDS)
        return (*parameters, *vary, "visible", "frozen", UNDER, FRAME, *map_fields())


class Curve:
    """One editable curve of a layer: values over an angle in [0, π/2], three channels, and the operators on it.

    A curve is called with angles (N,) in radians and returns its values (N, 3). An operator acts at full strength from
    b to c of its region (a, b, c, d), in radians, and fades out towards a and d [BenArtzi07, ch. 9]; a region of two
    numbers has no falloff, and without one the operator acts everywhere.

    >>> import insitu, numpy
    >>> curve = insitu.open("teatray")["teapot"]["copper"]["gamma_alpha"]
    >>> before = curve(numpy.array([0.0, 1.2]))
    >>> curve.amplify(y=2, region=(0.0, 0.0, 0.5, 0.8))
    >>> curve(numpy.array([0.0, 1.2])) / before
    array([[2., 2., 2.],
           [1., 1., 1.]])
    """

    def __init__(self, editing: Editing, key: str, factor: str) -> None:
        self._editing, self._key, self._factor = editing, key, factor

    def __call__(self, angles: ArrayLike) -> NDArray[np.float64]:
        return self._layer.curve(self._factor)(np.atleast_1d(np.asarray(angles, np.float64)))

    def __repr__(self) -> str:
        return f"<curve {self._key}.{self._factor}: {len(self.operators)} operators>"

    @property
    def operators(self) -> tuple[Edit, ...]:
        """The operators on the curve, lowest first; to be set to any sequence of them."""
        return self._layer.operators(self._factor)

    @operators.setter
    def operators(self, operators: Sequence[Edit]) -> None:
        self._editing.do(SetOperators(self._key, self._factor, tuple(operators)))

    def translate(
        self, *, y: float | None = None, x: float | None = None, region: Region = EVERYWHERE,
        channels: Channels = ALL_CHANNELS,
    ) -> None:  # fmt: skip
        """Raise the curve by `y`, or move it by `x` radians to larger angles; both: first y, then x, as one edit.

        channels: which of red, green and blue. Raises insitu.Error, as where the object is frozen.
        """
        self._add("translate", y, x, (0.0, 0.0), region, channels)

    def amplify(
        self, *, y: float | None = None, x: float | None = None, about: tuple[float, float] = (0.0, 0.0),
        region: Region = EVERYWHERE, channels: Channels = ALL_CHANNELS,
    ) -> None:  # fmt: skip
        """Multiply the curve's distance from the value about[1] by `y`, or widen it about the angle about[0] by `x`."""
        self._add("amplify", y, x, about, region, channels)

    def reset(self) -> None:
        """Remove all operators: the curve is again as the layer's parameters generate it."""
        self._editing.do(ResetCurve(self._key, self._factor))

    def link(self, *others: Curve) -> None:
        """Let curves of other objects follow this one: they become equal to it, and edits of any are edits of all.
        Raises insitu.Error."""
        self._editing.do(LinkCurves(self._path, tuple(other._path for other in others)))

    def transfer(self, *others: LayerNode, measure: Measure = "ratio") -> None:
        """Give layers the change that the operators of this curve make: by the same "ratio" at each angle, by the same
        share of the highlight's middle, "relative", or by the same difference, "absolute". Raises insitu.Error."""
        self._editing.do(TransferEdit(self._path, tuple(other._path for other in others), measure))

    def unlink(self) -> None:
        """Take it out of its link: it stays as it is, and is edited alone. Raises insitu.Error."""
        self._editing.do(UnlinkCurve(self._path))

    @property
    def linked(self) -> tuple[str, ...]:
        """The paths of the curves that it is linked to.

        >>> import insitu
        >>> scene = insitu.open("shapes", resolution=(48, 32))
        >>> first, second = (scene[name]["gloss"]["theta_h"] for name in ("cone", "cylinder"))
        >>> first.link(second)
        >>> first.amplify(y=2)
        >>> first.linked, second
        (('cylinder.1.theta_h',), <curve cylinder.1.theta_h: 1 operators>)
        """
        keys = linked_keys(self._editing.document, self._key, self._factor)
        return tuple(f"{key}.{self._factor}" for key in keys)

    @property
    def _path(self) -> str:
        return f"{self._key}.{self._factor}"

    def _add(
        self, kind: Any, y: float | None, x: float | None, about: tuple[float, float], region: Region,
        channels: Channels,
    ) -> None:  # fmt: skip
        if y is None and x is None:
            raise InsituError(f"{kind}: expected y, x, or both")
        if len(region) not in (2, 4):
            raise InsituError(f"region = {region!r}, expected two or four angles in radians")
        ends = region if len(region) == 4 else (region[0], region[0], region[1], region[1])
        try:
            if x is None:
                operators = [Operator(kind, "y", *ends, float(y or 0.0), about[1], channels)]
            elif y is None:
                operators = [Operator(kind, "x", *ends, float(x), about[0], channels)]
            else:
                operators = [
                    Operator(kind, "y", *ends, float(y), about[1], channels, joined=True),
                    Operator(kind, "x", *ends, float(x), about[0], channels),
                ]
        except (OperatorError, TypeError, ValueError) as error:
            raise InsituError(f"{self._key}.{self._factor}: {error}") from None
        if len(operators) == 1:
            self._editing.do(AddOperator(self._key, self._factor, operators[0]))
        else:
            self.operators = (*self.operators, *operators)

    @property
    def _layer(self) -> Layer:
        return self._editing.document.layer(self._key)


class CameraNode:
    """The camera: `position`, `target`, `up` (metres, three numbers each) and `fov_y` in degrees.

    >>> import insitu
    >>> scene = insitu.open("shapes")
    >>> scene.camera.fov_y = 30
    >>> scene.camera.orbit(90)
    >>> scene.undo(), scene.undo()
    ('camera', 'camera')
    """

    def __init__(self, editing: Editing) -> None:
        object.__setattr__(self, "_editing", editing)

    def __getattr__(self, name: str) -> Any:
        if name not in Camera.model_fields:
            raise AttributeError(f"the camera has no {name!r}; it has {', '.join(Camera.model_fields)}")
        return getattr(self._editing.camera, name)

    def __setattr__(self, name: str, value: object) -> None:
        tree = {**self._values, name: plain_value(value)}
        try:
            self._editing.look_from(Camera(**tree))
        except ValidationError as error:
            raise InsituError(first_validation_error(error, tree, "camera", Camera).reason) from None

    def __repr__(self) -> str:
        return f"<camera: {', '.join(f'{name} {value}' for name, value in self._values.items())}>"

    def orbit(self, degrees: float, up: float = 0.0) -> None:
        """Orbit about the target by so many degrees to the right, and up."""
        camera = Camera(**self._values)
        self._editing.look_from(orbit_camera(camera, math.radians(degrees), math.radians(up)))

    @property
    def _values(self) -> dict[str, Any]:
        return dict(self._editing.camera)
