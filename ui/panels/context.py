"""The arguments of panels: the document, the view, the status of the picture, and the registry of handles.

All is read-only except `Fields` and `Handles`. The latter registers where on screen a panel drew what can be dragged,
so that scripts and tests grab it by name ("curve.b") with ordinary mouse events.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from imgui_bundle import imgui
from numpy.typing import NDArray

from app.document.document import Document, Selection
from app.document.selection import layer_shown
from app.document.view_state import Bookmark, ViewState
from app.editor.camera_history import NO_CAMERA
from app.files.journal import Recovery
from app.files.materials import LibraryEntry
from app.files.preferences import Preferences, Recent
from app.messages.editor_status import Status
from app.modes.mode import Mode
from app.operators.registry import keys_of
from app.photo.photo_controller import Found
from engine.core.colour_config import ConfigCatalogue
from engine.inverse.transferred_edit import Measure
from engine.light.painted_lights import PaintedLight
from engine.render.scopes import Scopes
from engine.scene.description import Camera
from engine.scene.import_report import ImportReport
from engine.scene.surface_spot import SurfaceSpot
from ui.frame_times import PerformanceRecord
from ui.panels.difference_board import DifferenceBoard
from ui.panels.look_board import LookBoard
from ui.panels.pictures import BrdfBoard, Picture
from ui.panels.window_state import PanelState, Travel
from ui.pixel_values import PixelValues
from ui.theme import Theme


class Handles:
    """Screen positions (framebuffer pixels) of what was drawn last, by name."""

    def __init__(self) -> None:
        self._positions: dict[str, tuple[float, float]] = {}
        self._drawn: dict[str, tuple[float, float]] = {}

    def note(self, name: str, x: float, y: float) -> None:
        """Register where the handle `name` is in this frame."""
        self._drawn[name] = (x, y)

    def note_item(self, name: str) -> None:
        """Register the centre of the widget drawn last as the handle `name`."""
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        self.note(name, 0.5 * (low.x + high.x), 0.5 * (low.y + high.y))

    def begin_frame(self) -> None:
        """Forget what the coming frame may no longer draw; positions stay readable until it ends."""
        self._drawn = {}

    def end_frame(self) -> None:
        """Make this frame's positions the ones that are read."""
        self._positions = self._drawn

    def position(self, name: str) -> tuple[float, float]:
        """The position of the handle; KeyError that lists the handles on screen when it is not there."""
        if name not in self._positions:
            raise KeyError(f"no handle {name!r} on screen; available: {', '.join(self.names())}")
        return self._positions[name]

    def names(self) -> list[str]:
        """Names of all handles on screen, sorted."""
        return sorted(self._positions)


@dataclass
class HeldField:
    """A number that is being dragged: imgui's item, the value at the press, the travel of the pointer, and the law by
    which that changes it: as it was at the press, because the control may grow or shrink during the drag."""

    item: int
    start: float
    travel: Travel
    law: Callable[[float, float], float]


@dataclass
class Fields:
    """State of `ui.panels.number_fields`: the number that is being dragged, and the message about a refused entry."""

    held: HeldField | None = None
    refusal: str = ""

    def is_held(self, item: int) -> bool:
        """Whether this item is being dragged."""
        return self.held is not None and self.held.item == item


def no_thumbnail(entry: LibraryEntry) -> Picture | None:
    """A substitute before there is anything that draws thumbnails."""
    return None


def no_materials(measure: Measure) -> tuple[LibraryEntry, ...]:
    """The materials that a transferred edit would make before there is anything that makes them: none."""
    return ()


def no_names(file: Path) -> tuple[str, ...]:
    """No stored picture is of a file."""
    return ()


def no_view_thumbnail(bookmark: Bookmark) -> Picture | None:
    """A substitute before there is anything that draws thumbnails."""
    return None


def no_box(name: str | None) -> NDArray[np.float64] | None:
    """A substitute before there is a scene."""
    return None


def no_object(column: int, row: int) -> str | None:
    """The object at a pixel before there is a picture: none."""
    return None


def no_values(column: int, row: int, side: int = 1) -> PixelValues | None:
    """The values of a pixel before there is a picture: none."""
    return None


def no_scopes() -> Scopes | None:
    """The scopes before there is a picture: none."""
    return None


def no_waveform(scopes: Scopes, parade: bool) -> Picture | None:
    """A substitute before there is anything that draws waveforms."""
    return None


def no_facing(name: str) -> NDArray[np.float64] | None:
    """The direction that a lamp shines to before there is a picture: none."""
    return None


def no_objects(left: float, top: float, right: float, bottom: float) -> tuple[str, ...]:
    """The objects in a rectangle before there is a picture: none."""
    return ()


def no_spot(column: int, row: int) -> SurfaceSpot | None:
    """The point of a surface at a pixel before there is a picture: none."""
    return None


@dataclass(frozen=True)
class PanelContext:
    """What every panel reads. `picture` is the scene, `environment` the thumbnail; None until there is one.
    `looks` has the pictures of looks beside the current one.
    `error_overlay` is the map of its error, None while unknown; `highlight_reached` the share that the last stroke on a
    highlight has reached, `highlight_overlay` where it has not. `has_environment`: whether the scene's file has one.

    `map_thumbnails` are the selected layer's "texture" and "weight", `map_refusal` says why they cannot be used.
    `undo_label` and `redo_label` name what would be undone or redone. `object_at` returns the object's name at a pixel
    (column, row) of the picture, `objects_in` the names of those in a rectangle, `spot_at` the point of the surface
    there, `values_at` the pixel's values; `facing_of` the direction that a lamp shines to. `heading` is the camera's
    direction, degrees clockwise from -Z seen from above.
    `library` are its materials, `thumbnail` a material's picture, None while there is none; `transferred` are those
    that the other selected objects would have of the selected curve's edit. `now` is seconds of the
    window's clock. `brdf` has the plots of the selected material, `record` the recent frame times and errors. `camera`
    is the camera that the scene is seen from, or is about to be, `picture_camera` that of the picture shown;
    `own_camera` and `own_resolution`, (width, height), are the scene's; `camera_undo_label` and `camera_redo_label`
    name what the view's own history would undo or redo; `box_of` returns the corners (2, 3) of an object, for None of
    all that is visible, `resting_box_of` those where its file has it; `view_thumbnail` is the picture of a bookmarked
    view. `preferences` are the user's. `mode` is the one of `modes` that makes the picture. `mode_before` is the title
    of the mode whose picture is still shown, "" where it is the present one's. `scene_document` is the document as the
    scene's own file has it. `name` is the name of what is open, `unsaved` whether there are edits that no session has.
    `recent` are the files opened last, `recoveries` edits that the program left behind when it ended. `keys_taken`:
    keys go to a text field, a list or a menu; `alt_tapped`: Alt was pressed and released by itself; `catalogues` are
    those of the OpenColorIO configurations that are known; `scopes` measures what is shown, `waveform` draws one, of
    luma or the channels; `stored_names` are the stored pictures, `stored_names_of` those that were read from a file,
    `reads_stored`: whether one is being read; `difference` compares one; `saving`: the picture with layers that is
    being saved, and its progress, "" for none; `photo`: the same of the photograph that is
    being matched, and `found` what was found last; `repeated`: the key that the system repeats in this pass,
    while it is held.
    """

    document: Document
    view: ViewState
    status: Status
    state: PanelState
    theme: Theme
    mode: Mode
    modes: tuple[Mode, ...] = ()
    handles: Handles = field(default_factory=Handles)
    fields: Fields = field(default_factory=Fields)
    looks: LookBoard = field(default_factory=LookBoard)
    brdf: BrdfBoard = field(default_factory=BrdfBoard)
    record: PerformanceRecord = field(default_factory=PerformanceRecord)
    picture: Picture | None = None
    error_overlay: Picture | None = None
    highlight_overlay: Picture | None = None
    highlight_reached: float | None = None
    environment: Picture | None = None
    map_thumbnails: Mapping[str, Picture] = field(default_factory=dict)
    map_refusal: str | None = None
    undo_label: str | None = None
    redo_label: str | None = None
    object_at: Callable[[int, int], str | None] = no_object
    objects_in: Callable[[float, float, float, float], tuple[str, ...]] = no_objects
    spot_at: Callable[[int, int], SurfaceSpot | None] = no_spot
    facing_of: Callable[[str], NDArray[np.float64] | None] = no_facing
    values_at: Callable[[int, int, int], PixelValues | None] = no_values
    heading: float = 0.0
    has_environment: bool = True
    environments: tuple[str, ...] = ()
    library: tuple[LibraryEntry, ...] = ()
    thumbnail: Callable[[LibraryEntry], Picture | None] = no_thumbnail
    transferred: Callable[[Measure], tuple[LibraryEntry, ...]] = no_materials
    scenes: tuple[str, ...] = ()
    mode_before: str = ""
    scene_document: Document = Document("")
    name: str = ""
    camera: Camera = NO_CAMERA
    picture_camera: Camera | None = None
    own_camera: Camera = NO_CAMERA
    own_resolution: tuple[int, int] = (0, 0)
    camera_undo_label: str | None = None
    camera_redo_label: str | None = None
    box_of: Callable[[str | None], NDArray[np.float64] | None] = no_box
    resting_box_of: Callable[[str], NDArray[np.float64] | None] = no_box
    view_thumbnail: Callable[[Bookmark], Picture | None] = no_view_thumbnail
    preferences: Preferences = Preferences()
    unsaved: bool = False
    report: ImportReport = ImportReport()
    recent: Callable[[], tuple[Recent, ...]] = tuple
    saving: str = ""
    photo: str = ""
    found: Found | None = None
    scopes: Callable[[], Scopes | None] = no_scopes
    waveform: Callable[[Scopes, bool], Picture | None] = no_waveform
    stored_names: tuple[str, ...] = ()
    stored_names_of: Callable[[Path], tuple[str, ...]] = no_names
    reads_stored: bool = False
    difference: DifferenceBoard = DifferenceBoard()
    catalogues: tuple[ConfigCatalogue, ...] = ()
    recoveries: tuple[Recovery, ...] = ()
    now: float = 0.0
    keys_taken: bool = False
    alt_tapped: bool = False
    repeated: imgui.Key | None = None

    @property
    def selected_layer(self) -> Selection | None:
        """The selection, where it has a material to show: None for an emitter."""
        return layer_shown(self.document, self.view.selected)

    @property
    def painted(self) -> PaintedLight | None:
        """The painted light that is selected."""
        chosen = self.state.painted
        if chosen is None or chosen.beside != (self.view.selected, self.view.sun):
            return None
        return next((each for each in self.document.light.painted if each.name == chosen.light), None)

    @property
    def resolution(self) -> tuple[int, int]:
        """The desired resolution of the picture, (width, height)."""
        return self.view.resolution or self.own_resolution

    @property
    def aspect(self) -> float:
        """Its width divided by its height."""
        width, height = self.resolution
        return width / max(height, 1)

    def keys_of(self, name: str) -> str:
        """The keys of an operator, as the user prefers them; "" where it has none."""
        return keys_of(name, self.preferences.keys)

    def px(self, size: float) -> float:
        """A design size in framebuffer pixels."""
        return self.theme.px(size)
