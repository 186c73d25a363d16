"""What the window opens by a file's name, and the folders that its file dialogs begin in."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from app.document.commands import SetBumps, SetOpacity, SetSurface
from app.document.commands.light import set_environment_file
from app.document.commands.maps import SetMap, SetParameterMap
from app.document.commands.objects import AddObject
from app.document.named_files import image_name
from app.document.scene_files import split_axis
from app.document.selection import layer_shown
from app.document.sources import (
    EXPECTED,
    IMAGE_SUFFIXES,
    LIGHT_ENDINGS,
    PICTURE_ENDINGS,
    SCENE_ENDINGS,
    SESSION_ENDING,
)
from app.editor.editor import Editor
from app.export import PACKAGE_ENDING
from app.photo.match_settings import MatchSettings, default_settings, with_object
from app.system.atomic import require_place
from engine.core.errors import InsituError
from engine.core.safe_files import resolved
from engine.curve.table_text import TABLE_ENDINGS
from engine.material.bumps import BUMP_IMAGES
from engine.measured.measurement import ENDINGS as MEASURED_ENDINGS
from engine.scene.mesh import MATERIAL_ENDING
from engine.scene.surface_kinds import SURFACE_IMAGES
from ui.panels.actions import (
    Action,
    AskFile,
    ImportMaterial,
    OpenFile,
    OpenImage,
    OpenPhoto,
    SaveContactSheet,
    SavePicture,
)
from ui.panels.window_state import FileQuestion

# The kinds of files that a question may be about, except images; each kind has its own folder.
KIND_OF = {
    "open_scene": "scene", "add_file": "scene", "save_session": "scene",
    "open_environment": "environment", "open_measured": "measured",
    "open_material": "material",
    "save_measured": "measured", "save_picture": "picture", "save_sheet": "picture", "save_scene": "export",
    "save_environment": "environment", "paint_image": "image",
    "save_package": "package",
    "open_table": "table",
    "open_config": "config", "open_compared": "picture", "open_photo": "picture", "open_mask": "picture",
}  # fmt: skip
# The suffixes that the shown picture can be saved with.
PICTURE_FILES = (".png", ".exr")


class FileActions:
    """Opens files on one editor, and remembers for each kind of file the folder of the last one."""

    def __init__(self, editor: Editor) -> None:
        self._editor = editor
        self.folders: dict[str, Path] = {}
        self._picture_ending, self._deep, self._layers = ".png", False, False

    def remember_picture(self, action: SavePicture) -> None:
        """Remember folder and kind of a picture that is about to be saved. Raises InsituError where it cannot be saved
        there."""
        if action.path.suffix.lower() not in PICTURE_FILES:
            raise InsituError(f"{action.path}: the name of a picture ends in {' or '.join(PICTURE_FILES)}")
        require_place(action.path)
        self.folders["picture"] = action.path.absolute().parent
        self._deep, self._layers = action.deep, action.layers
        self._picture_ending = action.path.suffix.lower()

    def checked_sheet(self, action: SaveContactSheet) -> SaveContactSheet:
        """A contact sheet that is about to be saved. Raises InsituError where it cannot be saved there."""
        if action.path.suffix.lower() != ".png":
            raise InsituError(f"{action.path}: the name of a contact sheet ends in .png")
        require_place(action.path)
        self.folders["picture"] = action.path.absolute().parent
        return action

    def open_dropped(self, paths: Sequence[str], image: str | None = None, adds: bool = False) -> list[Action]:
        """Open the file that was dropped on the window; several at once are refused, because one would hide the other.

        image: "texture" or "weight" where it was dropped on that of the selected layer. adds: the objects of meshes are
        added to the scene. A file of materials is for the selected object, where there is one.
        """
        if adds and paths and self._editor.scene_is_open:
            return [AddObject(str(resolved(Path(path)))) for path in paths]
        selected = layer_shown(self._editor.document, self._editor.view.selected)
        if len(paths) == 1 and image and selected and Path(paths[0]).suffix.lower() in IMAGE_SUFFIXES:
            return [OpenImage(Path(paths[0]), selected.key, image)]
        if len(paths) == 1 and selected and Path(paths[0]).suffix.lower() == MATERIAL_ENDING:
            return [ImportMaterial(Path(paths[0]))]
        if len(paths) == 1:
            return [OpenFile(paths[0])]
        if paths:
            wanted = "one scene, session, environment or texture"
            self._editor.notify(f"{len(paths)} files were dropped; drop {wanted}", True)
        return []

    def open(self, path: str) -> None:
        """Open a file by its suffix: a scene or session, light, a measurement for the selected object, a table for the
        selected curve, a texture for the selected layer; anything else is refused with one line."""
        suffix = Path(split_axis(path)[0]).suffix.lower()
        if os.path.isdir(path):
            self._editor.open(path)
        elif suffix in TABLE_ENDINGS:
            if self.check_file(Path(path), "table"):
                self._editor.exchange.read_table(path)
        elif suffix in (*SCENE_ENDINGS, SESSION_ENDING, *LIGHT_ENDINGS, *MEASURED_ENDINGS):
            self._open_file(Path(path), suffix)
        elif suffix in PICTURE_ENDINGS:
            self._drop_picture(Path(path))
        elif Path(path).is_absolute() and not os.path.exists(path):
            self._editor.notify(f"{path}: there is no such file; nothing was changed", True)
        elif suffix or Path(path).is_absolute():
            rest = (("a measured BRDF", MEASURED_ENDINGS), ("a table", TABLE_ENDINGS), ("a texture", PICTURE_ENDINGS))
            measured, table, texture = (f"{kind} ({', '.join(endings)})" for kind, endings in rest)
            self._editor.notify(f"{path}: expected {EXPECTED}, {measured}, {table} or {texture}", True)
        else:  # a built-in scene, from the menu
            self._editor.open(path)

    def _drop_picture(self, path: Path) -> None:
        selected = layer_shown(self._editor.document, self._editor.view.selected)
        if selected is None:
            self._editor.notify(f"{path.name}: select the layer that it is to be the texture of", True)
        else:
            self.open_image(path, selected.key, "texture")

    def open_image(self, path: Path, key: str, name: str) -> None:
        """Give a layer or an object, by its key, an image: `name` says what for."""
        if not self.check_file(path, "image"):
            return
        file = image_name(path, self._editor.document.source)
        if name in SURFACE_IMAGES:
            kind, value = SURFACE_IMAGES[name]
            self._editor.do(SetSurface(key, kind, ((value, file),)))
        elif name == "opacity_map":
            self._editor.do(SetOpacity(key, name, file))
        elif name == "parameter_map":
            layer, _, parameter = key.rpartition(".")
            self._editor.do(SetParameterMap(layer, parameter, file))
        else:
            self._editor.do(SetBumps(key, name, file) if name in BUMP_IMAGES else SetMap(key, name, file))

    def check_file(self, path: Path, kind: str) -> bool:
        """Whether it is a file; if so its folder is remembered for files of its kind, else a message says so."""
        if os.path.isfile(path):  # Path.is_file raises where no system takes the name
            self.folders[kind] = path.absolute().parent
            return True
        what = "is a folder" if os.path.isdir(path) else "there is no such file"
        self._editor.notify(f"{path}: {what}; nothing was changed", True)
        return False

    def photo(self, action: OpenPhoto, before: MatchSettings | None) -> MatchSettings | None:
        """The settings to match an object to a photograph with: those of the one before, but for its pairs; `before`
        where there is no such file. Raises InsituError."""
        document = self._editor.document
        selected = layer_shown(document, self._editor.view.selected)
        name = action.object or (selected.object if selected else "")
        if not name:
            raise InsituError(f"{action.path}: select the object that it shows")
        if not self.check_file(action.path, "picture"):
            return before
        file = resolved(action.path)
        if before is None or before.scene != document.source:
            return default_settings(document, name, file)
        pairs = before.pairs if file == before.file else ()
        kept = replace(before, file=file, pairs=pairs)
        return kept if name == before.object else with_object(kept, document, name)

    def mask(self, path: Path, before: MatchSettings) -> MatchSettings:
        """The settings with a mask, where there is such a file."""
        return replace(before, mask=resolved(path)) if self.check_file(path, "picture") else before

    def _open_file(self, path: Path, suffix: str) -> None:
        kind = "measured" if suffix in MEASURED_ENDINGS else "environment" if suffix in LIGHT_ENDINGS else "scene"
        if not self.check_file(Path(split_axis(str(path))[0]), kind):
            return
        if suffix in MEASURED_ENDINGS:
            self._editor.exchange.import_measured(path)
        elif suffix in LIGHT_ENDINGS and self._editor.scene_is_open:
            self._editor.do(set_environment_file(path))
        else:
            self._editor.open(str(path))

    def question(self, action: AskFile) -> FileQuestion:
        """The folder to show in the file dialog, and the proposed name of a file to save.

        The folder is that of the last file of the kind, else that of what is open.
        """
        editor = self._editor
        file = editor.session.path_to_reopen
        beside = Path.cwd() if file is None else file.absolute().parent
        folder = self.folders.get(KIND_OF.get(action.purpose, "image"), beside)
        if action.purpose == "save_picture":
            name = f"{editor.session.name}{self._picture_ending}"
            return FileQuestion(action.purpose, folder, name, deep=self._deep, layers=self._layers)
        if action.purpose == "save_sheet":
            return FileQuestion(action.purpose, folder, f"{editor.session.name} looks.png")
        if action.purpose == "save_package":
            return FileQuestion(action.purpose, folder, f"{editor.session.name}{PACKAGE_ENDING}")
        if action.purpose != "save_session":
            return FileQuestion(action.purpose, folder, key=action.key)
        return FileQuestion(
            action.purpose, folder if file is None else beside, f"{editor.session.name}{SESSION_ENDING}"
        )
