"""Actions of panels other than edits. Panels draw and return values; only `ui.action_handler` carries them out.

A panel returns, in order, document commands (`app.document.commands`), view commands (`app.document.view_state`) and
the window actions of this module.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.document.commands import EditCommand
from app.document.view_state import OpenPanel, SetView, Viewpoint
from app.files.journal import Recovery
from app.files.materials import Material
from app.modes.placement.painted_curves import Solved
from app.photo.match_settings import MatchSettings
from engine.inverse.highlight_brush import HighlightBrush
from engine.scene.light_paths import LightPath
from ui.panels.window_state import Grip


@dataclass(frozen=True)
class BeginDrag:
    """Begin a drag that edits the document: all until `EndDrag` is one step of the history."""

    label: str | None = None


@dataclass(frozen=True)
class AnswerQuestion:
    """Do with the chosen file what the dialog was opened for, and close it; it stays open where that is refused."""

    path: Path
    action: Action


@dataclass(frozen=True)
class EndDrag:
    """End the drag."""


@dataclass(frozen=True)
class CancelDrag:
    """Cancel the gesture under way and take back all that it did."""


@dataclass(frozen=True)
class HoldGrip:
    """Store what a gesture needs while it lasts; None when it ends."""

    grip: Grip | None


@dataclass(frozen=True)
class TracePath:
    """Trace the way of a light that was placed, and show what is in it."""

    path: LightPath


@dataclass(frozen=True)
class MergedEdit:
    """An edit that is merged into one step with those just before it of the same gesture."""

    command: EditCommand
    gesture: str


@dataclass(frozen=True)
class RunOperator:
    """Carry out an operator (`app.operators.registry`) that needs no window, with a value of its type; None: its
    default."""

    name: str
    value: Any = None


@dataclass(frozen=True)
class BeginCameraDrag:
    """Begin a camera drag: all until `EndCameraDrag` is one step of the view's own history."""

    label: str


@dataclass(frozen=True)
class DragCamera:
    """Move the camera during a camera drag; does nothing after it."""

    viewpoint: Viewpoint


@dataclass(frozen=True)
class EndCameraDrag:
    """End the camera drag."""


@dataclass(frozen=True)
class MoveCameraTo:
    """Move the camera: a step of the view's history, merged with those before it of the same gesture."""

    viewpoint: Viewpoint
    label: str
    gesture: str | None = None


@dataclass(frozen=True)
class SetPreference:
    """Change a preference of the user (`app.files.preferences.Preferences`)."""

    changes: Mapping[str, str]


@dataclass(frozen=True)
class SetPanel:
    """Change fields of the window's own state (`ui.panels.window_state.PanelState`)."""

    changes: Mapping[str, Any]


@dataclass(frozen=True)
class OpenFile:
    """Open a scene, a session or an environment; the suffix tells which."""

    path: str


@dataclass(frozen=True)
class AskFile:
    """Open the file dialog, which does not stop the picture; for an image of the layer `key`, for bumps, opacity and
    surfaces of the object `key`, for a map of the parameter `key`, or for a photograph of the object `key`."""

    purpose: str
    key: str = ""


@dataclass(frozen=True)
class OpenImage:
    """Make a file the "texture" or the "weight" of a layer, one of `BUMP_IMAGES`, the
    "opacity_map", or one of `SURFACE_IMAGES` of an object, or the "parameter_map" of a parameter, by its path."""

    path: Path
    key: str
    name: str


@dataclass(frozen=True)
class ReloadImages:
    """Read a layer's texture and weight map again: another program has written them."""

    key: str


@dataclass(frozen=True)
class ImportMaterial:
    """Give the selected object the first material of a MaterialX file."""

    path: Path


@dataclass(frozen=True)
class ImportMeasured:
    """Make the selected object of a measured file: of a diffuse layer and a highlight, or as cloth of one layer."""

    path: Path
    cloth: bool = False


@dataclass(frozen=True)
class OpenConfig:
    """Show light through the default view of a configuration of OpenColorIO."""

    path: Path


@dataclass(frozen=True)
class ExportMeasured:
    """Write the selected object's material as a MERL file."""

    path: Path


@dataclass(frozen=True)
class ExportScene:
    """Write the scene as a folder for Mitsuba 3."""

    folder: Path


@dataclass(frozen=True)
class SaveScene:
    """Save the scene with everything it needs, as a folder or one file."""

    path: Path


@dataclass(frozen=True)
class SaveEnvironment:
    """Write the environment, with what is painted on it, to an OpenEXR file."""

    path: Path


@dataclass(frozen=True)
class SaveSession:
    """Save the session to `path`, or where it was saved last; opens the file dialog the first time."""

    path: Path | None = None


@dataclass(frozen=True)
class Screenshot:
    """Write the window's picture, with the interface, to a PNG; None names it by the time of day."""

    path: Path | None = None


@dataclass(frozen=True)
class SavePicture:
    """Write the picture alone, at the scene's resolution: .png as shown, of 8 bits or `deep` 16; .exr linear, and with
    `layers` drawn anew with its layers. cropped: only the view's crop, where there is one."""

    path: Path
    deep: bool = False
    layers: bool = False
    cropped: bool = True


@dataclass(frozen=True)
class StorePicture:
    """Store the picture, to compare later ones with it; "": under a new name."""

    name: str = ""


@dataclass(frozen=True)
class CompareFile:
    """Read a picture from a file, and compare with it; not `compares`: it is only stored."""

    path: Path
    compares: bool = True


@dataclass(frozen=True)
class OpenPhoto:
    """Open the panel that matches an object to this photograph, "": the selected one."""

    path: Path
    object: str = ""


@dataclass(frozen=True)
class OpenMask:
    """Let only those pixels of the photograph count that are bright in this picture."""

    path: Path


@dataclass(frozen=True)
class MatchPicture:
    """Begin to match a photograph."""

    settings: MatchSettings


@dataclass(frozen=True)
class StopPhoto:
    """Stop matching a photograph."""


@dataclass(frozen=True)
class SaveContactSheet:
    """Draw all looks, and write them on one page."""

    path: Path


@dataclass(frozen=True)
class StopLayers:
    """Stop drawing the picture with layers, or the contact sheet, that is being saved."""


@dataclass(frozen=True)
class DrawLooks:
    """Stop drawing the pictures of looks, or go on with it."""

    goes_on: bool


@dataclass(frozen=True)
class SaveMaterial:
    """Store an object's material in the library, under a name."""

    object: str
    name: str


@dataclass(frozen=True)
class StopMaterialMatch:
    """Stop matching a material; the object keeps the one that it has."""


@dataclass(frozen=True)
class DeleteMaterial:
    """Delete one of the user's own materials."""

    path: Path


@dataclass(frozen=True)
class Copy:
    """Put a material, or a part of one, on the clipboard; `what` names it to the user."""

    material: Material
    what: str


@dataclass(frozen=True)
class CopyText:
    """Put a text on the clipboard; `what` names it to the user."""

    text: str
    what: str


@dataclass(frozen=True)
class Paste:
    """Take what is on the clipboard: a material replaces the selected object's (`as_layers`: is added on top of it), a
    layer is added on top, a curve replaces the selected one, a table of numbers is put on it."""

    as_layers: bool = False


@dataclass(frozen=True)
class Recover:
    """Recover (True) or discard (False) what the journal stored when the program last ended early."""

    recovery: Recovery
    accept: bool


@dataclass(frozen=True)
class AnswerUnsaved:
    """Answer the question on unsaved edits that an action would lose: save or discard them; then the action is carried
    out."""

    is_saved: bool


@dataclass(frozen=True)
class ShowPanel:
    """Open a panel where it is closed, and bring it in front of those in the same dock."""

    name: str


@dataclass(frozen=True)
class ResetLayout:
    """Dock all panels in the default layout."""


@dataclass(frozen=True)
class Quit:
    """Close the window; unsaved edits open a question, unless they are to stay in the journal."""

    keep_journal: bool = False


@dataclass(frozen=True)
class PressHighlight:
    """Press a brush on the highlight of the selected object, at a place (column, row) of the picture; solved: what is
    solved for."""

    brush: HighlightBrush
    solved: Solved
    place: tuple[float, float]


@dataclass(frozen=True)
class DragHighlight:
    """Go on with the stroke through places of the picture."""

    places: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class ReleaseHighlight:
    """Release the brush."""


@dataclass(frozen=True)
class PickHighlight:
    """Paint what a place of the picture shows, from now on."""

    place: tuple[float, float]


HighlightAction = PickHighlight | PressHighlight | DragHighlight | ReleaseHighlight
WindowAction = (
    BeginDrag | EndDrag | CancelDrag | MergedEdit | BeginCameraDrag | DragCamera | EndCameraDrag | MoveCameraTo
    | RunOperator | SetPreference | HoldGrip | SetPanel | OpenFile | OpenImage | AskFile | ReloadImages | SaveSession
    | SavePicture | ImportMaterial | ImportMeasured | ExportMeasured | ExportScene | SaveScene | Screenshot
    | SaveEnvironment | SaveMaterial | DeleteMaterial | StopMaterialMatch | Copy | CopyText | Paste | Recover
    | AnswerUnsaved | ShowPanel | ResetLayout | Quit | AnswerQuestion | StopLayers | DrawLooks | SaveContactSheet
    | OpenConfig | StorePicture | CompareFile | OpenPhoto | OpenMask | MatchPicture | StopPhoto | TracePath
    | HighlightAction
)  # fmt: skip
Action = EditCommand | SetView | OpenPanel | WindowAction
