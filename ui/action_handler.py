"""Carries out the actions of panels: edits and view commands on the editor, changes of the window's own state as a new
value.

The only place where an action becomes a change.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import cast

from imgui_bundle import imgui

from app.document.commands import EditCommand
from app.document.commands.maps import without_strokes
from app.document.linked_layers import Layers
from app.document.named_files import with_full_names
from app.document.scene_files import is_folder_of_scene, split_axis
from app.document.sources import (
    SCENE_ENDINGS,
    SESSION_ENDING,
)
from app.document.view_state import OpenPanel, ViewCommand
from app.editor.editor import Editor
from app.files.journal import Recovery
from app.files.materials import MAX_MATERIAL_BYTES, Library, dump_material, parse_material, paste_command
from app.files.preferences import PreferenceFile, RecentFiles
from app.files.session import CHANGED
from app.operators.registry import run_operator
from app.photo.photo_controller import PhotoController
from engine.core.colour import ConfigView
from engine.core.errors import InsituError
from engine.scene.builtin import builtin_scenes
from ui.file_actions import FileActions
from ui.panels.actions import (
    Action,
    AnswerQuestion,
    AnswerUnsaved,
    AskFile,
    BeginCameraDrag,
    BeginDrag,
    CancelDrag,
    CompareFile,
    Copy,
    CopyText,
    DeleteMaterial,
    DragCamera,
    DragHighlight,
    DrawLooks,
    EndCameraDrag,
    EndDrag,
    ExportMeasured,
    ExportScene,
    HighlightAction,
    HoldGrip,
    ImportMaterial,
    ImportMeasured,
    MatchPicture,
    MergedEdit,
    MoveCameraTo,
    OpenConfig,
    OpenFile,
    OpenImage,
    OpenMask,
    OpenPhoto,
    Paste,
    PickHighlight,
    PressHighlight,
    Quit,
    Recover,
    ReleaseHighlight,
    ReloadImages,
    ResetLayout,
    RunOperator,
    SaveContactSheet,
    SaveEnvironment,
    SaveMaterial,
    SavePicture,
    SaveScene,
    SaveSession,
    Screenshot,
    SetPanel,
    SetPreference,
    ShowPanel,
    StopLayers,
    StopMaterialMatch,
    StopPhoto,
    StorePicture,
    TracePath,
)
from ui.panels.window_state import PanelState


@dataclass(frozen=True)
class FrameOutcome:
    """The window's state after a frame's actions, and what only the window itself can do."""

    state: PanelState
    reset_layout: bool = False
    screenshot: Path | None = None
    picture: SavePicture | SaveContactSheet | StorePicture | None = None
    highlight: tuple[HighlightAction, ...] = ()
    stops_layers: bool = False
    draws_looks: bool | None = None
    quit: bool = False

    def after(self, earlier: FrameOutcome) -> FrameOutcome:
        """This outcome, with what is still to be done of an earlier one of the same frame."""
        return replace(
            self, screenshot=self.screenshot or earlier.screenshot, picture=self.picture or earlier.picture,
            highlight=earlier.highlight + self.highlight,
            stops_layers=self.stops_layers or earlier.stops_layers,
            draws_looks=earlier.draws_looks if self.draws_looks is None else self.draws_looks,
            quit=self.quit or earlier.quit,
        )  # fmt: skip


class ActionHandler:
    """Carries actions out on one editor. `recoveries` are edits that earlier editors left behind."""

    def __init__(
        self,
        editor: Editor,
        library: Library | None = None,
        recent: RecentFiles | None = None,
        preferences: PreferenceFile | None = None,
    ) -> None:
        self._editor = editor
        self.preferences = preferences or PreferenceFile()
        self.recent = recent or RecentFiles()
        self._last_file: Path | None = None
        self.library = library or Library()
        self.files = FileActions(editor)
        self.photos = PhotoController(editor)
        self.recoveries: tuple[Recovery, ...] = ()

    def perform(self, actions: Sequence[Action], state: PanelState, now: float) -> FrameOutcome:
        """Carry out all actions of one frame, in order; `now` in seconds of the window's clock."""
        outcome = FrameOutcome(state)
        for action in actions:
            outcome = self._editor.barrier.run("This action", partial(self._attempt, action, outcome), outcome)
        self._note_file()
        return outcome

    def _note_file(self) -> None:
        """Put what has been opened, or saved, into the list of recent files."""
        file = self._editor.session.path_to_reopen
        if file is not None and file != self._last_file:
            self.recent.add(file)
        self._last_file = file

    def _attempt(self, action: Action, outcome: FrameOutcome) -> FrameOutcome:
        """Carry out an action; where that is refused, show why."""
        try:
            return self._perform(action, outcome)
        except InsituError as error:
            self._editor.notify(str(error), True)
            return outcome

    def _perform(self, action: Action, outcome: FrameOutcome) -> FrameOutcome:
        state = outcome.state
        if self._replaces_document(action) and self._editor.session.is_unsaved:
            return replace(outcome, state=replace(state, pending_action=action))
        match action:
            case HoldGrip():
                return replace(outcome, state=replace(state, grip=action.grip))
            case CancelDrag():
                self._editor.cancel_drag()
                return replace(outcome, state=replace(state, grip=None))
            case SetPanel():
                return replace(outcome, state=replace(state, **action.changes))
            case ShowPanel():
                self._editor.do(OpenPanel(action.name))
                return replace(outcome, state=replace(state, front=(action.name,)))
            case AskFile():
                return replace(outcome, state=replace(state, question=self.files.question(action)))
            case AnswerQuestion():
                return self._answer(action, outcome)
            case Screenshot():
                return replace(outcome, screenshot=action.path or picture_name(Path.cwd(), datetime.now()))
            case SavePicture():
                self.files.remember_picture(action)
                return replace(outcome, picture=action)
            case SaveContactSheet():
                return replace(outcome, picture=self.files.checked_sheet(action))
            case StorePicture():
                return replace(outcome, picture=action)
            case OpenPhoto():
                match = self.files.photo(action, state.match)
                return replace(outcome, state=replace(state, match=match))
            case OpenMask() if state.match is not None:
                return replace(outcome, state=replace(state, match=self.files.mask(action.path, state.match)))
            case PickHighlight() | PressHighlight() | DragHighlight() | ReleaseHighlight():
                return replace(outcome, highlight=(*outcome.highlight, action))
            case StopLayers():
                return replace(outcome, stops_layers=True)
            case DrawLooks():
                return replace(outcome, draws_looks=action.goes_on)
            case ResetLayout():
                return replace(outcome, reset_layout=True)
            case Quit():
                return replace(outcome, quit=True)
            case Recover():
                return replace(outcome, state=self._recover(action, state))
            case AnswerUnsaved():
                return self._answer_unsaved(action.is_saved, outcome)
            case SaveSession():
                return self._save(action.path, outcome)
            case _:
                self._edit(action)
                return outcome

    def _answer(self, action: AnswerQuestion, outcome: FrameOutcome) -> FrameOutcome:
        """Do with the chosen file what the dialog was opened for; where it is refused, the dialog stays and shows
        why."""
        question, said_before = outcome.state.question, self._editor.status.message_number
        done = self._attempt(action.action, replace(outcome, state=replace(outcome.state, question=None)))
        status = self._editor.status
        if question is None or status.message_number == said_before or not status.is_error:
            return done
        refusal = status.message.removeprefix(f"{action.path}: ")
        return replace(done, state=replace(done.state, question=replace(question, refusal=refusal, focus="name")))

    def _edit(self, action: Action) -> None:
        editor = self._editor
        match action:
            case BeginDrag():
                editor.begin_drag(action.label)
            case EndDrag():
                editor.end_drag()
            case BeginCameraDrag():
                editor.camera_history.begin_drag(action.label)
            case DragCamera():
                editor.camera_history.drag_to(action.viewpoint)
            case EndCameraDrag():
                editor.camera_history.end_drag()
            case MoveCameraTo():
                editor.camera_history.set_viewpoint(action.viewpoint, action.label, action.gesture)
            case RunOperator():
                run_operator(editor, action.name, action.value)
            case SetPreference():
                self.preferences.choose(**action.changes)
            case TracePath():
                editor.light_paths.trace(action.path, again=False)
            case MergedEdit():
                editor.do(action.command, action.gesture)
            case OpenFile():
                self.files.open(action.path)
            case ImportMaterial():
                if self.files.check_file(action.path, "material"):
                    editor.exchange.import_material(str(action.path))
            case ImportMeasured():
                if self.files.check_file(action.path, "measured"):
                    editor.exchange.import_measured(action.path, action.cloth)
            case OpenConfig():
                if self.files.check_file(action.path, "config"):
                    editor.colours.open(ConfigView(str(action.path)))
            case MatchPicture():
                self.photos.begin(action.settings)
            case StopPhoto():
                self.photos.stop()
            case CompareFile():
                if self.files.check_file(action.path, "picture"):
                    editor.stored.load(action.path, action.compares)
            case ExportMeasured():
                self.files.folders["measured"] = action.path.absolute().parent
                editor.exchange.export_measured(action.path)
            case SaveScene():
                self.files.folders["package"] = action.path.absolute().parent
                editor.exchange.save_scene(action.path)
            case SaveEnvironment():
                self.files.folders["environment"] = action.path.absolute().parent
                editor.exchange.save_environment(action.path)
            case ExportScene():
                self.files.folders["export"] = action.folder.absolute().parent
                editor.exchange.export_scene(action.folder)
            case OpenImage():
                self.files.open_image(action.path, action.key, action.name)
            case ReloadImages():
                editor.reload_images(action.key)
            case StopMaterialMatch():
                editor.material_matching.stop()
            case SaveMaterial() | DeleteMaterial():
                self._change_library(action)
            case Copy():
                layers, lost = self._portable(action.material.layers)
                imgui.set_clipboard_text(dump_material(replace(action.material, layers=layers)))
                editor.notify(f"copied {action.what}{lost}")
            case CopyText():
                imgui.set_clipboard_text(action.text)
                editor.notify(f"copied {action.what}")
            case Paste():
                self._paste(action.as_layers)
            case _:
                editor.do(cast(EditCommand | ViewCommand, action))

    def _save(self, path: Path | None, outcome: FrameOutcome) -> FrameOutcome:
        has_changed = path is None and self._editor.session.has_changed
        if has_changed:
            self._editor.notify(f"{self._editor.session.path}: {CHANGED}", True)
        if has_changed or (path is None and self._editor.session.path is None):
            return replace(outcome, state=replace(outcome.state, question=self.files.question(AskFile("save_session"))))
        if path is not None:
            self.files.folders["scene"] = path.absolute().parent
        if self._editor.save(path) is None and outcome.state.pending_action is not None:
            return self._resume_action(outcome)
        return outcome

    # ---------------------------------------------------------------------------------------------------- unsaved edits

    def _replaces_document(self, action: Action) -> bool:
        """Whether an action replaces what is open."""
        match action:
            case OpenFile():
                path = Path(split_axis(action.path)[0])
                is_scene = path.suffix.lower() in (*SCENE_ENDINGS, SESSION_ENDING) and os.path.isfile(path)
                return is_scene or is_folder_of_scene(path) or action.path in builtin_scenes()
            case Recover():
                return action.accept
            case Quit():
                return not action.keep_journal
        return False

    def _answer_unsaved(self, saves: bool, outcome: FrameOutcome) -> FrameOutcome:
        """Carry out the answer on unsaved edits; a session without a name asks for one first."""
        if saves:
            return self._save(None, outcome)
        self._editor.session.give_up_unsaved()
        return self._resume_action(outcome)

    def _resume_action(self, outcome: FrameOutcome) -> FrameOutcome:
        """Carry out the action that waited; returns the outcome with it."""
        action, state = outcome.state.pending_action, replace(outcome.state, pending_action=None)
        return replace(outcome, state=state) if action is None else self._perform(action, replace(outcome, state=state))

    def _change_library(self, action: SaveMaterial | DeleteMaterial) -> None:
        if isinstance(action, DeleteMaterial):
            self.library.delete(action.path)
            return
        layers, lost = self._portable(self._editor.document.object(action.object).layers)
        entry = self.library.save(action.name, layers)
        self._editor.notify(f"saved {entry.name} in the library{lost}")

    def _portable(self, layers: Layers) -> tuple[Layers, str]:
        """Layers as they leave their object, and the message about that."""
        found = without_strokes(layers)
        lost = "" if found == layers else ", without the strokes painted on its maps: they belong to their object"
        return with_full_names(found, self._editor.document.source), lost

    def _paste(self, as_layers: bool) -> None:
        editor, text = self._editor, (imgui.get_clipboard_text() or "")[:MAX_MATERIAL_BYTES]
        # Every material has keys and values; a table of numbers has none.
        if "=" not in text and any(character.isdigit() for character in text):
            editor.exchange.read_table("clipboard", text)
            return
        material = parse_material(text, "clipboard")
        editor.do(paste_command(material, editor.document, editor.view.selected, as_layers))

    def _recover(self, action: Recover, state: PanelState) -> PanelState:
        self.recoveries = tuple(each for each in self.recoveries if each != action.recovery)
        if not action.accept:
            action.recovery.discard()
            return state
        self._editor.recover(action.recovery)
        return replace(state, shows_recoveries=False)


def picture_name(folder: Path, moment: datetime) -> Path:
    """The file of a picture of the window without a chosen name."""
    return folder / f"insitu-{moment:%Y-%m-%d-%H%M%S}.png"
