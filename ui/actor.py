"""Carries out what panels ask for: edits and view on the editor, the window's own state as a new value.

The only place where an action becomes a change.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import cast

from app.commands import EditCommand
from app.editor import Editor
from app.journal import Recovery
from app.library import Library
from app.light_commands import SetEnvironment
from app.linked_layers import Layers
from app.map_commands import IMAGE_SUFFIXES, SetMap, image_name, with_full_names
from app.material_file import MAX_MATERIAL_BYTES, dump_material, parse_material
from app.paint_commands import without_strokes
from app.pasting import pasted
from app.probe_file import likely_mapping
from app.session import SUFFIX
from app.view_state import OpenPanel, ViewCommand
from engine.errors import InsituError
from engine.measured.measurement import ENDINGS as MEASURED_ENDINGS
from ui.clipboard import Clipboard
from ui.panels.actions import (
    Action,
    AskFile,
    BeginDrag,
    CancelDrag,
    CancelWork,
    Copy,
    DeleteMaterial,
    EndDrag,
    ExportMeasured,
    ExportScene,
    Hold,
    ImportMeasured,
    OpenFile,
    OpenImage,
    Paste,
    Quit,
    Recover,
    Redo,
    ReloadImages,
    ResetLayout,
    SaveMaterial,
    SaveSession,
    Screenshot,
    Select,
    SetPanel,
    ShowPanel,
    Undo,
)
from ui.panels.state import FileQuestion, PanelState

SCENE_ENDINGS = (".toml", SUFFIX)
ENVIRONMENT_ENDINGS = (".exr", ".hdr", ".pic")
PICTURE_ENDINGS = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True)
class Outcome:
    """The window's state after a frame's actions, and what only the window itself can do."""

    state: PanelState
    reset_layout: bool = False
    screenshot: Path | None = None
    quit: bool = False


class Actor:
    """Carries actions out on one editor. `recovery` is the journal that the recovery strip offers, if any."""

    def __init__(self, editor: Editor, library: Library | None = None, clipboard: Clipboard | None = None) -> None:
        self._editor = editor
        self.library = library or Library()
        self._clipboard = clipboard or Clipboard()
        self._folder: Path | None = None
        self.recovery: Recovery | None = None

    def perform(self, actions: Sequence[Action], state: PanelState, now: float) -> Outcome:
        """All actions of one frame, in order; `now` in seconds of the window's clock."""
        outcome = Outcome(state)
        for action in actions:
            outcome = self._perform(action, outcome)
        return outcome

    def _perform(self, action: Action, outcome: Outcome) -> Outcome:
        state = outcome.state
        match action:
            case Hold():
                return replace(outcome, state=replace(state, grip=action.grip))
            case CancelDrag():
                self._editor.cancel_drag()
                return replace(outcome, state=replace(state, grip=None))
            case SetPanel():
                return replace(outcome, state=replace(state, **action.changes))
            case ShowPanel():
                self._editor.do(OpenPanel(action.name))
                return replace(outcome, state=replace(state, front=action.name))
            case AskFile():
                question = FileQuestion(action.purpose, self._folder or Path.cwd(), key=action.key)
                return replace(outcome, state=replace(state, question=question))
            case Screenshot():
                return replace(outcome, screenshot=action.path or picture_name(Path.cwd(), datetime.now()))
            case ResetLayout():
                return replace(outcome, reset_layout=True)
            case Quit():
                return replace(outcome, quit=True)
            case Recover():
                self._recover(action.accept)
                return replace(outcome, state=replace(state, journal=None))
            case SaveSession():
                return self._save(action.path, outcome)
            case _:
                self._edit(action)
                return outcome

    def _edit(self, action: Action) -> None:
        editor = self._editor
        match action:
            case BeginDrag():
                editor.begin_drag(action.label)
            case EndDrag():
                editor.end_drag()
            case Undo():
                editor.undo()
            case Redo():
                editor.redo()
            case Select():
                editor.select(action.path)
            case OpenFile():
                self.open(action.path)
            case ImportMeasured():
                if self._is_there(action.path):
                    editor.import_measured(action.path, action.cloth)
            case ExportMeasured():
                self._folder = action.path.resolve().parent
                editor.export_measured(action.path)
            case ExportScene():
                self._folder = action.folder.resolve().parent
                editor.export_scene(action.folder)
            case OpenImage():
                self._open_image(action.path, action.key, action.name)
            case ReloadImages():
                editor.reload_images(action.key)
            case CancelWork():
                editor.cancel_work()
            case SaveMaterial() | DeleteMaterial():
                self._change_library(action)
            case Copy():
                layers, lost = self._portable(action.material.layers)
                self._clipboard.put(dump_material(replace(action.material, layers=layers)))
                editor.notify(f"copied {action.what}{lost}")
            case Paste():
                self._paste(action.as_layers)
            case _:
                editor.do(cast(EditCommand | ViewCommand, action))

    def drop(self, paths: Sequence[str], image: str | None = None) -> None:
        """Open the file that was dropped on the window; several at once are refused, for one would hide the other.

        image: "texture" or "weight" where it was dropped on that of the selected layer.
        """
        selected = self._editor.view.selected
        if len(paths) == 1 and image and selected and Path(paths[0]).suffix.lower() in IMAGE_SUFFIXES:
            self._open_image(Path(paths[0]), selected.key, image)
        elif len(paths) == 1:
            self.open(paths[0])
        elif paths:
            wanted = "one scene, session, environment or texture"
            self._editor.notify(f"{len(paths)} files were dropped; drop {wanted}", True)

    def open(self, path: str) -> None:
        """Open a scene or session, light the scene by an environment, make the selected object of what was measured, or
        give the selected layer a texture; anything else is refused in one line."""
        suffix = Path(path).suffix.lower()
        if suffix in (*SCENE_ENDINGS, *ENVIRONMENT_ENDINGS, *MEASURED_ENDINGS):
            self._open_file(Path(path), suffix)
        elif suffix in PICTURE_ENDINGS:
            self._drop_picture(Path(path))
        elif suffix or Path(path).is_absolute():
            known = f"a scene (.toml), a session ({SUFFIX}), light (.exr, .hdr), a measured BRDF (.binary, .brdf)"
            self._editor.notify(f"{path}: expected {known} or a texture (.png, .jpg)", True)
        else:  # a built-in scene, from the menu
            self._editor.open(path)

    def _drop_picture(self, path: Path) -> None:
        selected = self._editor.view.selected
        if selected is None:
            self._editor.notify(f"{path.name}: select the layer that it is to be the texture of", True)
        else:
            self._open_image(path, selected.key, "texture")

    def _open_image(self, path: Path, key: str, name: str) -> None:
        if self._is_there(path):
            self._editor.do(SetMap(key, name, image_name(path, self._editor.document.source)))

    def _is_there(self, path: Path) -> bool:
        """Whether it is a file, and if so its folder remembered; else that is said."""
        if path.is_file():
            self._folder = path.resolve().parent
            return True
        what = "is a folder" if path.is_dir() else "there is no such file"
        self._editor.notify(f"{path}: {what}; nothing was changed", True)
        return False

    def _open_file(self, path: Path, suffix: str) -> None:
        if not self._is_there(path):
            return
        if suffix in MEASURED_ENDINGS:
            self._editor.import_measured(path)
        elif suffix in ENVIRONMENT_ENDINGS:
            file = path.resolve()
            self._editor.do(SetEnvironment(str(file), likely_mapping(file)))
        else:
            self._editor.open(str(path))

    def _save(self, path: Path | None, outcome: Outcome) -> Outcome:
        if path is None and self._editor.session_path is None:
            question = FileQuestion(
                "save_session", self._folder or Path.cwd(), suggested_name(self._editor.document.source)
            )
            return replace(outcome, state=replace(outcome.state, question=question))
        if path is not None:
            self._folder = path.resolve().parent
        self._editor.save(path)
        return outcome

    def _change_library(self, action: SaveMaterial | DeleteMaterial) -> None:
        try:
            if isinstance(action, DeleteMaterial):
                self.library.delete(action.path)
            else:
                layers, lost = self._portable(self._editor.document.object(action.object).layers)
                entry = self.library.save(action.name, layers)
                self._editor.notify(f"kept {entry.name} in the library{lost}")
        except InsituError as error:
            self._editor.notify(str(error), True)

    def _portable(self, layers: Layers) -> tuple[Layers, str]:
        """Layers as they leave their object, and what to say of that."""
        found = without_strokes(layers)
        lost = "" if found == layers else ", without the strokes painted on its maps: they belong to their object"
        return with_full_names(found, self._editor.document.source), lost

    def _paste(self, as_layers: bool) -> None:
        editor = self._editor
        try:
            material = parse_material(self._clipboard.text()[:MAX_MATERIAL_BYTES], "clipboard")
            editor.do(pasted(material, editor.document, editor.view.selected, as_layers))
        except InsituError as error:
            editor.notify(str(error), True)

    def _recover(self, accept: bool) -> None:
        recovery, self.recovery = self.recovery, None
        if recovery is None:
            return
        if accept:
            self._editor.recover(recovery)
        else:
            recovery.discard()


def suggested_name(source: str) -> str:
    """A session's name for a scene: its file's or, for a scene.toml, its folder's name."""
    path = Path(source)
    stem = path.parent.name if path.name == "scene.toml" else path.stem
    return f"{stem or 'session'}{SUFFIX}"


def picture_name(folder: Path, moment: datetime) -> Path:
    """Where a picture of the window goes when nobody named it."""
    return folder / f"insitu-{moment:%Y-%m-%d-%H%M%S}.png"
