"""The state of the view: selection, exposure, comparison, curve zoom. Not undone, saved with a session.

A frozen value like the document, changed only by commands, so panels stay functions of their arguments.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, get_args

from app.document.document import Document, Selection
from engine.core.colour import AnyView
from engine.core.errors import InsituError
from engine.material.parameters import Parameter
from engine.render.crop import Crop
from engine.scene.description import Camera, SceneDescription
from engine.settings import AS_PLANNED, SETTINGS, Lighting, RenderSettings

Tool = Literal["translate_x", "translate_y", "translate_xy", "amplify_x", "amplify_y", "amplify_xy", "stroke", "points"]
# A place on the picture: fractions across and down.
Probe = tuple[float, float]
MOST_PROBES = 8
LooksShown = Literal[1, 2, 4, 6]
Channel = Literal["rgb", "r", "g", "b"]
PictureChannel = Literal["colour", "red", "green", "blue", "alpha", "luminance"]
BrdfPlot = Literal["lobe", "slice", "albedo"]
# What is shown where the picture is compared with a stored one: itself, the other, both, or how they differ.
Difference = Literal["present", "stored", "split", "signed", "absolute"]

CHANNELS: tuple[Channel, ...] = ("rgb", "r", "g", "b")
PICTURE_CHANNELS: tuple[PictureChannel, ...] = get_args(PictureChannel)
DIFFERENCES: tuple[Difference, ...] = get_args(Difference)
BRDF_PLOTS: tuple[BrdfPlot, ...] = ("lobe", "slice", "albedo")
LIGHTING_WORDS: Mapping[Lighting, str] = MappingProxyType(
    {"scene": "", "no_shadows": "no shadows", "point_light": "one light, no shadows"}
)
HALF_PI = 1.5707963267948966
DEFAULT_REGIONS = (0.1, 0.25, 0.45, 0.6)
DEFAULT_PANELS = MappingProxyType(
    {
        "objects": True,
        "viewport": True,
        "curve": True,
        "material": True,
        "light": True,
        "accuracy": True,
        "plan": True,
        "library": True,
        "brdf": True,
    }
)


class Viewpoint(NamedTuple):
    """The camera of a view, and its picture's (width, height) in pixels; None: as the scene's file has them."""

    camera: Camera | None = None
    resolution: tuple[int, int] | None = None


@dataclass(frozen=True)
class SetViewpoint:
    """A command of the view's own history: move the camera, set the resolution."""

    viewpoint: Viewpoint
    label: str

    def apply(self, before: Viewpoint) -> Viewpoint:
        return self.viewpoint


@dataclass(frozen=True)
class Bookmark:
    """A view stored under a name, with a thumbnail of it as a JPEG file, empty while there is none."""

    name: str
    viewpoint: Viewpoint
    thumbnail: bytes = b""


@dataclass(frozen=True)
class ViewState:
    """Selection and display. Angles in radians, exposure in stops, frame budget in milliseconds.

    ``selected`` is the active selection, whose values panels show; ``others`` are the names of further selected
    objects, in the order in which they were selected; ``sun`` is the name of the selected sun: then there is no other
    selection. ``mode`` is the name of the mode that makes the picture.
    ``settings`` are those of that picture; its number of bounces is 0 until the worker has found how many the scene
    requires. ``compare`` is the document that A/B shows left of ``compare_divider`` (0 the left edge, 1 the right).
    ``stored`` is the name of the stored picture that is compared, "" for none; ``difference``: what is shown of both.
    ``crop`` is the part of the picture that is inspected and saved; ``probes`` are places whose values stay on screen.
    Unless it is shown to ``fit``, the picture has ``zoom`` screen pixels for each of its own, and its point ``centre``
    (fractions across, down) is in the panel's middle. ``camera`` and ``resolution``, (width, height) of the picture,
    replace the scene's own, None for those; ``bookmarks`` are views stored by name. While an animation is ``playing``
    that is the time which is shown, seconds; at its end it starts again if it ``loops``. ``split``: the borders in
    Deform's picture, from left to right, between what paths show, transfer that does not rotate, and its own (0 the
    left edge, 1 the right); ``fit_error``: whether the error of its lobes is shown instead. ``shows_error``: whether
    the error map is shown over the picture. ``lighting``: the light in place, or a simple one for comparison, in
    Placement. ``picture_channel``: which channel of the picture is seen alone; ``zebra``: stripes over what is clipped
    on screen; ``view_before``: the view transform that false colours replaced. ``looks_shown``: how many looks of the
    document are shown side by side.
    ``regions`` are a ≤ b ≤ c ≤ d of the operator being shown or about to be made; ``operator`` is its index in the
    selected curve's list, None for one about to be made. ``node`` is the index of the node whose curve is shown with
    handles where a parameter varies over the layer; None: the middle one. ``curve_zoom`` is (γ low, γ high, y low, y
    high); None fits.
    The BRDF panel shows ``brdf_plot`` of the selected layer, or with ``brdf_whole`` of all layers of its object, in the
    plane along the tangent or ``brdf_across`` it; its lobe reflects light from ``lobe_angle``. ``solo`` is the key of a
    layer that is shown without the others of its object. ``lobe_pixel`` (column, row) is where the picture shows the
    selected layer's lobe.
    """

    mode: str = "placement"
    selected: Selection | None = None
    others: tuple[str, ...] = ()
    sun: str | None = None
    hovered: str | None = None
    exposure: float = 0.0
    gamma: float = 1.0
    tone_mapping: AnyView = "filmic"
    picture_channel: PictureChannel = "colour"
    view_before: AnyView = "filmic"
    zebra: bool = False
    compare: Document | None = None
    compare_divider: float = 0.5
    stored: str = ""
    difference: Difference = "split"
    crop: Crop | None = None
    probes: tuple[Probe, ...] = ()
    fit: bool = True
    zoom: float = 1.0
    centre: tuple[float, float] = (0.5, 0.5)
    log_y: bool = False
    curve_zoom: tuple[float, float, float, float] | None = None
    channel: Channel = "rgb"
    active_tool: Tool = "translate_y"
    regions: tuple[float, float, float, float] = DEFAULT_REGIONS
    operator: int | None = None
    node: int | None = None
    solo: str | None = None
    lobe_pixel: tuple[int, int] | None = None
    brdf_plot: BrdfPlot = "lobe"
    brdf_whole: bool = False
    brdf_across: bool = False
    lobe_angle: float = 0.7853981633974483
    lobe_log: bool = False
    frame_budget_ms: float = 16.0
    settings: RenderSettings = RenderSettings()
    panels: Mapping[str, bool] = field(default_factory=lambda: DEFAULT_PANELS)
    show_shortcuts: bool = False
    camera: Camera | None = None
    resolution: tuple[int, int] | None = None
    bookmarks: tuple[Bookmark, ...] = ()
    playing: float | None = None
    loops: bool = True
    split: tuple[float, float] | None = None
    fit_error: bool = False
    shows_error: bool = False
    lighting: Lighting = "scene"
    looks_shown: LooksShown = 1

    @property
    def selected_objects(self) -> tuple[str, ...]:
        """The names of all selected objects, the active one last."""
        return () if self.selected is None else (*self.others, self.selected.object)

    @property
    def viewpoint(self) -> Viewpoint:
        return Viewpoint(self.camera, self.resolution)

    def panel_open(self, name: str) -> bool:
        return self.panels.get(name, True)

    def with_panel(self, name: str, is_open: bool) -> ViewState:
        return replace(self, panels=MappingProxyType({**self.panels, name: is_open}))

    def for_scene(self, description: SceneDescription) -> ViewState:
        """The view of a scene that was just opened, with the same display settings: nothing in it is selected yet."""
        return replace(
            self, selected=None, others=(), sun=None, hovered=None, compare=None, stored="", crop=None, probes=(),
            operator=None, node=None, curve_zoom=None, solo=None, lobe_pixel=None, camera=None, resolution=None,
            bookmarks=(), playing=None, lighting="scene",
            settings=replace(self.settings, n_bounces=description.bounces or AS_PLANNED),
        )  # fmt: skip

    def from_viewpoint(self, look: Viewpoint) -> ViewState:
        """The view from another camera or in another resolution: nothing is selected in the picture yet."""
        return replace(self, hovered=None, compare=None, lobe_pixel=None, **look._asdict())

    @property
    def channels(self) -> tuple[bool, bool, bool]:
        """Which of red, green and blue a new edit of the curve changes."""
        return channels_of(self.channel)


def channels_of(channel: Channel) -> tuple[bool, bool, bool]:
    """Whether red, green and blue are meant."""
    red, green, blue = (channel in ("rgb", name) for name in ("r", "g", "b"))
    return red, green, blue


EXPOSURE = Parameter(
    "exposure",
    "scalar",
    0.0,
    "Exposure",
    "Exposure of the display in stops; the scene's light is unchanged. ([ and ])",
    minimum=-20.0,
    maximum=20.0,
    soft=(-8.0, 8.0),
    form="%+.2f EV",
)
GAMMA = Parameter(
    "gamma",
    "scalar",
    1.0,
    "Gamma",
    "The colours on screen and in PNG files to the power of 1 / gamma: above 1 shadows are lifted.",
    minimum=0.2,
    maximum=5.0,
    soft=(0.5, 2.0),
    form="%.2f",
)
FRAME_BUDGET = Parameter(
    "frame_budget_ms",
    "scalar",
    16.0,
    "Frame time",
    "Time for each frame while a curve is dragged. Less is smoother and coarser; the finished picture is exact either "
    "way.",
    minimum=2.0,
    maximum=200.0,
    logarithmic=True,
    form="%.0f ms",
)
VIEW_FIELDS = frozenset(f.name for f in fields(ViewState)) - {"settings"}
LIMITS: dict[str, tuple[float, float]] = {
    "exposure": (EXPOSURE.minimum, EXPOSURE.maximum),
    "gamma": GAMMA.limits,
    "compare_divider": (0.0, 1.0),
    "zoom": (0.05, 64.0),
    "lobe_angle": (0.0, 1.55),
    "frame_budget_ms": FRAME_BUDGET.limits,
}


@dataclass(frozen=True)
class SetView:
    """Change fields of the view or of its settings: ``SetView.of(exposure=1.0, n_lights=400)``. Numbers are clamped to
    their range."""

    changes: tuple[tuple[str, Any], ...]

    @classmethod
    def of(cls, **changes: Any) -> SetView:
        unknown = sorted(set(changes) - VIEW_FIELDS - SETTINGS.keys())
        if unknown:
            raise InsituError(f"the view has no {', '.join(unknown)}")
        return cls(tuple(changes.items()))

    def apply(self, view: ViewState) -> ViewState:
        settings = {name: SETTINGS[name].nearest(value) for name, value in self.changes if name in SETTINGS}
        rest = {name: _in_range(name, value) for name, value in self.changes if name not in SETTINGS}
        return replace(view, settings=replace(view.settings, **settings), **rest)


@dataclass(frozen=True)
class OpenPanel:
    """Show or hide a panel."""

    name: str
    is_open: bool = True

    def apply(self, view: ViewState) -> ViewState:
        return view.with_panel(self.name, self.is_open)


ViewCommand = SetView | OpenPanel


def _in_range(name: str, value: Any) -> Any:
    if name == "split":
        return value and tuple(sorted(min(max(float(x), 0.0), 1.0) for x in value))
    if name == "crop":
        return value and Crop.checked(value)
    if name == "probes":
        return tuple((min(max(x, 0.0), 1.0), min(max(y, 0.0), 1.0)) for x, y in value[:MOST_PROBES])
    if name == "regions":
        return _ordered_regions(value)
    if name in LIMITS:
        low, high = LIMITS[name]
        return type(low)(min(max(value, low), high))
    return value


def _ordered_regions(regions: tuple[float, ...]) -> tuple[float, float, float, float]:
    """a ≤ b ≤ c ≤ d within [0, π/2], whatever order they come in."""
    a, b, c, d = sorted(min(max(float(x), 0.0), HALF_PI) for x in regions)
    return a, b, c, d
