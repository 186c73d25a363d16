"""What panels ask for beyond edits. Panels draw and return values; `ui.shell` alone carries them out.

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
from app.files.material_file import Material
from ui.panels.window_state import Grip


@dataclass(frozen=True)
class BeginDrag:
    """A hand took hold of something that edits the document: all until `EndDrag` is one step of the history."""

    label: str | None = None


@dataclass(frozen=True)
class AnswerQuestion:
    """Do with the chosen file what was asked for, and close the file dialog; it stays where that is refused."""

    path: Path
    action: Action


@dataclass(frozen=True)
class EndDrag:
    """The hand let go."""


@dataclass(frozen=True)
class CancelDrag:
    """Take back all that the gesture under way did, and let go."""


@dataclass(frozen=True)
class HoldGrip:
    """Keep what a gesture needs while it lasts; None when it ends."""

    grip: Grip | None


@dataclass(frozen=True)
class MergedEdit:
    """An edit that is one step of the history with those just before it of the same gesture."""

    command: EditCommand
    gesture: str


@dataclass(frozen=True)
class Undo:
    """One step back in the history."""


@dataclass(frozen=True)
class Redo:
    """One step forward in the history."""


@dataclass(frozen=True)
class Play:
    """Let the scene's animation go on; False: stop it where it is."""

    goes_on: bool = True


@dataclass(frozen=True)
class BeginCameraDrag:
    """A hand took hold of the camera: all until `EndCameraDrag` is one step of the view's own history."""

    label: str


@dataclass(frozen=True)
class DragCamera:
    """See the scene from there, while a hand holds the camera; nothing where it does so no more."""

    viewpoint: Viewpoint


@dataclass(frozen=True)
class EndCameraDrag:
    """The hand let go of the camera."""


@dataclass(frozen=True)
class MoveCameraTo:
    """See the scene from there: a step of the view's history, one with those before it of the same gesture."""

    viewpoint: Viewpoint
    label: str
    gesture: str | None = None


@dataclass(frozen=True)
class UndoCamera:
    """One step back in the view's history."""


@dataclass(frozen=True)
class RedoCamera:
    """One step forward in the view's history."""


@dataclass(frozen=True)
class SaveView:
    """Keep the view by a name, in the place of the one that has it; None: as another one."""

    name: str | None = None


@dataclass(frozen=True)
class RenameView:
    """Give a kept view another name."""

    old: str
    new: str


@dataclass(frozen=True)
class SetPreference:
    """Change what a person is used to (`app.files.preferences.Preferences`)."""

    changes: Mapping[str, str]


@dataclass(frozen=True)
class Select:
    """Select by path: an object, a layer "teapot.0", or a curve "teapot.0.theta_h"; None selects nothing."""

    path: str | None


@dataclass(frozen=True)
class SetPanel:
    """Change fields of the window's own state (`ui.panels.window_state.PanelState`)."""

    changes: Mapping[str, Any]


@dataclass(frozen=True)
class OpenFile:
    """Open a scene, a session or an environment, told apart by its ending."""

    path: str


@dataclass(frozen=True)
class AskFile:
    """Ask for a file name without stopping the picture; of an image for the layer, or for bumps and
    surfaces the object, `key`."""

    purpose: str
    key: str = ""


@dataclass(frozen=True)
class OpenImage:
    """Make a file the "texture" or the "weight" of a layer, or the "normal_map", the "bump_map", or one of
    `SURFACE_IMAGES` of an object."""

    path: Path
    key: str
    name: str


@dataclass(frozen=True)
class ReloadImages:
    """Read a layer's texture and weight map again: another program has written them."""

    key: str


@dataclass(frozen=True)
class ImportMeasured:
    """Make the selected object of what a file measured: of a diffuse layer and a highlight, or as cloth of one."""

    path: Path
    cloth: bool = False


@dataclass(frozen=True)
class ExportMeasured:
    """Write the selected object's material as a MERL file."""

    path: Path


@dataclass(frozen=True)
class ExportScene:
    """Write the scene as a folder for Mitsuba 3."""

    folder: Path


@dataclass(frozen=True)
class SaveSession:
    """Save the session to `path`, or where it was saved last; asks for a name the first time."""

    path: Path | None = None


@dataclass(frozen=True)
class Screenshot:
    """Write the window's picture, interface and all, to a PNG; None names it by the time of day."""

    path: Path | None = None


@dataclass(frozen=True)
class SavePicture:
    """Write the picture alone, at the scene's resolution: .png as shown, of 8 bits or `deep` 16; .exr linear."""

    path: Path
    deep: bool = False


@dataclass(frozen=True)
class Resize:
    """Show the scene at another resolution, (width, height); None: its own."""

    resolution: tuple[int, int] | None


@dataclass(frozen=True)
class SaveMaterial:
    """Keep an object's material in the library, under a name."""

    object: str
    name: str


@dataclass(frozen=True)
class DeleteMaterial:
    """Delete one of the person's own materials."""

    path: Path


@dataclass(frozen=True)
class Copy:
    """Put a material, or a part of one, on the clipboard; `what` names it to the person."""

    material: Material
    what: str


@dataclass(frozen=True)
class Paste:
    """Take what is on the clipboard: a material replaces the selected object's (`as_layers`: comes on top of it), a
    layer comes on top, a curve takes the selected one's place."""

    as_layers: bool = False


@dataclass(frozen=True)
class Recover:
    """Take back (True) or throw away (False) what a journal kept when the program last ended early."""

    recovery: Recovery
    accept: bool


@dataclass(frozen=True)
class AnswerUnsaved:
    """What becomes of unsaved edits that stand in the way of an action: saved, or given up; then it is carried out."""

    is_saved: bool


@dataclass(frozen=True)
class ShowPanel:
    """Open a panel where it is closed, and bring it before those that share its place."""

    name: str


@dataclass(frozen=True)
class ResetLayout:
    """Dock all panels where they are by default."""


@dataclass(frozen=True)
class CancelWork:
    """Stop the precomputation under way; what has been computed stays on screen."""


@dataclass(frozen=True)
class ResumeWork:
    """Go on with what was stopped."""


@dataclass(frozen=True)
class Quit:
    """Close the window; where there are unsaved edits that is asked about, unless they are to stay in the journal."""

    keep_journal: bool = False


WindowAction = (
    BeginDrag | EndDrag | CancelDrag | MergedEdit | BeginCameraDrag | DragCamera | EndCameraDrag | MoveCameraTo
    | UndoCamera | RedoCamera
    | Play | SaveView | RenameView | SetPreference
    | HoldGrip | Undo | Redo | Select | SetPanel | OpenFile | OpenImage | AskFile
    | ReloadImages | SaveSession | SavePicture | ImportMeasured | ExportMeasured | ExportScene | Screenshot
    | SaveMaterial | DeleteMaterial | Copy | Paste | Recover | AnswerUnsaved | Resize | ShowPanel | ResetLayout
    | CancelWork
    | ResumeWork | Quit | AnswerQuestion
)  # fmt: skip
Action = EditCommand | SetView | OpenPanel | WindowAction
