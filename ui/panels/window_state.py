"""State of the window alone: the gesture under way, the open overlays, the last message.

Frozen values held by `ui.shell`; panels read them and return actions that change them. Nothing here is part of a
session.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from app.document.arranging import Pivot
from app.document.document import Selection
from app.document.view_state import ViewState
from app.modes.placement.painted_curves import Solved
from app.photo.match_settings import MatchSettings
from engine.curve.operators import Operator
from engine.curve.tables import TabulatedCurve
from engine.inverse.curve_fit import HOLDING
from engine.inverse.highlight_brush import LEAST_RADIUS, MOST_RADIUS, MOST_STOPS, HighlightBrush
from engine.material.parameters import Parameter
from engine.scene.arrangement import PlacedObject
from engine.scene.transform import Transform

FINE = 0.1
Place = tuple[float, float]
Place3 = tuple[float, float, float]


@dataclass(frozen=True)
class Travel:
    """The distance of a drag: pixel by pixel, or a tenth with Shift held.

    Measured from where the drag began, or where Shift was last pressed or released, so that a pointer that returns
    restores the value to the last bit, and Shift never makes anything jump. Rejected: summing the mouse's steps, which
    drifts. `origin`: where the mouse was, pixels, when what was moved so far was `before` (right, down)."""

    origin: Place
    before: Place = (0.0, 0.0)
    fine: bool = False

    def distance_to(self, mouse: Place) -> Place:
        """Pixels right and down in all, with the mouse at this place."""
        rate = FINE if self.fine else 1.0
        across, down = (
            before + rate * (at - origin) for before, at, origin in zip(self.before, mouse, self.origin, strict=True)
        )
        return across, down

    def with_fine(self, mouse: Place, fine: bool) -> Travel:
        """This travel with Shift held (`fine`) or not from here on."""
        return self if fine == self.fine else Travel(mouse, self.distance_to(mouse), fine)


if TYPE_CHECKING:
    from ui.panels.actions import Action


@dataclass(frozen=True)
class Grip:
    """A gesture as it began; later mouse positions are measured against this. `offset` (x, y): see the subclasses."""

    handle: str
    offset: tuple[float, float]
    takes_input: ClassVar[bool] = False  # no control and no key gets what is pressed meanwhile


@dataclass(frozen=True)
class BoxGrip(Grip):
    """A rectangle that is about to be drawn over the picture, or is being drawn from `offset` on."""

    takes_input: ClassVar[bool] = True
    is_drawn: bool = False


@dataclass(frozen=True)
class CurveGrip(Grip):
    """A gesture on the curve.

    `handle` is "a", "b", "c", "d", "region", "magnitude", "point.0" and so on, or "pan"; `offset` is where it was,
    pixels (for "pan": where the mouse is), `travel` how far the pointer has moved since; arrow keys count for
    themselves. `operators` is the curve's list at the start, `index` the one in use (None: made by this gesture),
    `pair` whether the next one in the list moves with it. The axes do not move meanwhile: `x_range` radians, `y_range`
    curve values.
    """

    operators: tuple[Operator | TabulatedCurve, ...]
    index: int | None
    pair: bool
    regions: tuple[float, float, float, float]
    x_range: tuple[float, float]
    y_range: tuple[float, float]
    travel: Travel = Travel((0.0, 0.0))


@dataclass(frozen=True)
class StrokeGrip(CurveGrip):
    """A stroke that is being drawn on the curve: the pixels that the pointer has passed."""

    path: tuple[Place, ...] = ()


@dataclass(frozen=True)
class PaintGrip(Grip):
    """A stroke of the brush. `offset` is where on the picture it was last, pixels; `begun`: whether it has met the
    surface; `value`: what it paints; `metres`: its radius, known when it has begun."""

    begun: bool
    value: float
    metres: float = 0.0


@dataclass(frozen=True)
class PaintedGrip(Grip):
    """A painted light that is being moved or sized on the environment's picture, or, by its highlight or the shadow of
    `caster`, a point of `caster_object`, in the scene's. handle: "move", "size" or "light"; `offset`: its middle at the
    start, pixels."""

    light: str
    travel: Travel = Travel((0.0, 0.0))
    caster: tuple[float, float, float] | None = None
    caster_object: str = ""


@dataclass(frozen=True)
class PaintedSelection:
    """The painted light that is selected, as long as the selection in the scene stays the same."""

    light: str
    beside: tuple[Selection | None, str | None]


@dataclass(frozen=True)
class LightGrip(Grip):
    """A light that is being placed by its highlight, or by the shadow of a point of the world, `caster`, of
    `caster_object`; `start`: its transform before, from which it goes to wherever the hand is, whatever way this
    took."""

    light: str
    start: Transform
    caster: tuple[float, float, float] | None = None
    caster_object: str = ""


@dataclass(frozen=True)
class ArrangeGrip(Grip):
    """Objects that are being moved, rotated or scaled by a handle; start: as they stood before, from which they go to
    wherever the hand is."""

    start: tuple[PlacedObject, ...] = ()


@dataclass(frozen=True)
class GrabGrip(ArrangeGrip):
    """The same without a handle: they follow the mouse, with no button held, until a click or a key. `offset` is where
    the mouse was, `travel` how far it has moved; kind: "move", "rotate", "scale" or "aim". axis: that which they go
    along or about, by its number, None: none yet; across: along the two others instead; own: the axes are the active
    object's own. typed: the number so far. angle: by which the mouse has turned them, degrees, more than one turn as
    well."""

    takes_input: ClassVar[bool] = True
    kind: str = "move"
    travel: Travel = Travel((0.0, 0.0))
    axis: int | None = None
    across: bool = False
    own: bool = False
    typed: str = ""
    angle: float = 0.0


@dataclass(frozen=True)
class TurnGrip(Grip):
    """A drag that rotates the light. `offset` is where it is and the rotation at the start, `travel` how far the
    pointer has moved: in pixels, or around the dial in degrees, which continue over whole turns."""

    travel: Travel = Travel((0.0, 0.0))


@dataclass(frozen=True)
class WheelTurn:
    """Turns of the mouse wheel that are one gesture: when it began and when it last continued, seconds."""

    began: float
    last: float


@dataclass(frozen=True)
class ScrollTurn:
    """Turns of the wheel over the picture that move the camera as one gesture: which, when it began and last continued,
    seconds; where the mouse was, pixels, and the point of the scene (3,) there."""

    gesture: str
    began: float
    last: float
    place: tuple[float, float]
    about: tuple[float, float, float]


BRUSH = (
    Parameter(
        "radius",
        "scalar",
        24.0,
        "Radius",
        "The circle under the mouse, in pixels of the picture. Keys [ and ] change it.",
        minimum=1.0,
        maximum=400.0,
        logarithmic=True,
        form="Radius %.0f px",
    ),
    Parameter(
        "hardness",
        "scalar",
        0.5,
        "Hardness",
        "How far from its middle the brush paints in full; beyond, it fades towards its edge.",
        form="Hardness %.2f",
    ),
    Parameter(
        "strength",
        "scalar",
        1.0,
        "Strength",
        "How much one stroke changes the map: 1 is all the way.",
        minimum=0.01,
        form="Strength %.2f",
    ),
)


HIGHLIGHT_BRUSH = (
    replace(BRUSH[0], default=16.0, minimum=LEAST_RADIUS, maximum=MOST_RADIUS),
    replace(BRUSH[1], tooltip="How far from its middle the brush changes the highlight in full."),
    Parameter(
        "stops",
        "scalar",
        1.0,
        "Stops",
        "How much brighter or darker the highlight is to be: each stop is a factor of two.",
        maximum=MOST_STOPS,
        soft=(0.0, 4.0),
        form="%.2f stops",
    ),
    Parameter(
        "hold",
        "scalar",
        HOLDING,
        "Hold",
        "How much the rest of the object is held as it is, beside what the brush touches: 0 is not at all. A curve "
        "acts on all of the object, so that the less is held, the more of a stroke is reached.",
        form="Hold %.2f",
    ),
)


@dataclass(frozen=True)
class HighlightGrip(Grip):
    """A stroke on a highlight. `offset` is where on the picture it was last, pixels."""


@dataclass(frozen=True)
class Brush:
    """The brush that paints weight maps: its radius in pixels of the picture; `erases`: it removes the layer."""

    radius: float = 24.0
    hardness: float = 0.5
    strength: float = 1.0
    erases: bool = False


@dataclass(frozen=True)
class KeyGrip(CurveGrip):
    """A handle of the curve that arrow keys are moving: so far by `moved`, pixels right and down."""

    moved: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class StatusMessage:
    """One line for the user, with the time it was shown (seconds of the window's clock)."""

    text: str
    shown_at: float
    is_error: bool = False


@dataclass(frozen=True)
class FileQuestion:
    """A file is being asked for: the purpose (a key of `ui.panels.file_dialog.TITLES`), the folder, and the name so
    far; the layer of an image, whether a measurement becomes cloth, whether a picture has 16 bits, or layers,
    whether a scene is saved as a folder, and a picture only where its crop is.

    refusal: why the last entry was refused, "" where it was not. typed: the folder that was entered and refused, in
    place of the one that is shown. focus: the field that is about to get the keyboard, "name" or "folder"; "": none.
    """

    purpose: str
    folder: Path
    name: str = ""
    key: str = ""
    cloth: bool = False
    deep: bool = False
    layers: bool = False
    as_folder: bool = False
    cropped: bool = True
    refusal: str = ""
    typed: str = ""
    focus: str = "name"


# The sides of squares whose mean can be shown, in pixels.
VALUE_SIDES = (1, 3, 5)
SCOPES = ("histogram", "luma", "parade")


@dataclass(frozen=True)
class LibraryState:
    """The search text of the library, and the name under which a material is about to be stored."""

    search: str = ""
    name: str = ""


SnapTarget = Literal["increments", "ground", "surfaces"]


@dataclass(frozen=True)
class PairPicking:
    """Pairs of points of the picture and the photograph of a file are being picked. before: the view then; photo: the
    name that the photograph is stored under, "" while it is read; point: the first half of a pair."""

    file: Path
    before: ViewState
    photo: str = ""
    point: Place3 | None = None


@dataclass(frozen=True)
class PanelState:
    """The window's own state.

    `resolution` is the one in the resolution dialog, None while that is closed, `look_name` the name in
    the one that renames a look. `pending_action` is the action that
    waits for the answer on unsaved edits; `shows_recoveries`: the list of edits that can be recovered is open.

    `shows_images`: the material panel has its rows for images, also where a layer has none; `shows_transform`: it has
    the rows of the object's transform, also without handles in the picture. `handle` is the curve's handle that the
    keyboard moves: "magnitude", "a", "b", "c", "d", "region"; None: not chosen. `turn` is the last rotation of the
    light by the mouse wheel. `scroll` is the last move of the camera by it; `shows_camera`: the camera's controls are
    over the picture, where the bookmarked view `renames` is being renamed. `picks_lobe`: the next click on the picture
    chooses where it shows the lobe. `paints`: dragging over the selected object paints its layer's weight map, with
    `brush`; `paints_highlight`: it paints its highlight, with `highlight`, for which `solved` is solved for.
    `shows_values`: the values of the pixel under the mouse are shown, the mean of a square of `values_side` pixels;
    `copies_values`: they are about to be copied; `scope`: which of `SCOPES` is over the picture, "" for none, its
    counts logarithmic where `scope_is_log`; `zoom_steps`: by which the picture is about to be magnified; `pins_probe`:
    the pixel under the mouse is about to be pinned; `draws_crop`: a drag over the picture draws the crop. `gizmo`:
    which of its tools is over the picture, "" for none. `pivot`: what several objects are rotated and scaled about;
    `snaps`: what is moved snaps to `snap_to`, and with `aligns` stands upright on surfaces. `painted` is the painted
    light that keys and the environment's picture move. `match`: the panel that matches a picture, as it is set;
    `picking`: clicks on picture and photograph add pairs of points to it.
    `shows_report`: the sheet on what the file contains is open; `report_by_count`: it lists first what is missing most
    often. `single_panel`: the picture has the place of all panels. `opens_menu`: the menu that a key opens in the
    coming frame. `front` are panels that come in front of the others in their dock, in the coming frame.
    """

    grip: Grip | None = None
    handle: str | None = None
    turn: WheelTurn | None = None
    scroll: ScrollTurn | None = None
    shows_camera: bool = False
    renames: str | None = None
    front: tuple[str, ...] = ()
    single_panel: bool = False
    opens_menu: str = ""
    picks_lobe: bool = False
    shows_values: bool = False
    scope: str = ""
    scope_is_log: bool = False
    values_side: int = 1
    copies_values: bool = False
    zoom_steps: int = 0
    pins_probe: bool = False
    draws_crop: bool = False
    gizmo: str = ""
    pivot: Pivot = "middle"
    snaps: bool = False
    snap_to: SnapTarget = "surfaces"
    aligns: bool = False
    painted: PaintedSelection | None = None
    shows_report: bool = False
    report_by_count: bool = False
    message: StatusMessage | None = None
    question: FileQuestion | None = None
    resolution: tuple[int, int] | None = None
    look_name: str | None = None
    pending_action: Action | None = None
    shows_recoveries: bool = True
    library: LibraryState = LibraryState()
    shows_images: bool = False
    shows_transform: bool = False
    paints: bool = False
    brush: Brush = Brush()
    paints_highlight: bool = False
    highlight: HighlightBrush = HighlightBrush()
    solved: Solved = "curve"
    match: MatchSettings | None = None
    picking: PairPicking | None = None
