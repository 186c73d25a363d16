"""The file dialog inside the window: a small browser that never stops the picture.

It draws itself (rejected: the desktop's dialogs, which need a helper program that is often missing, and which a script
or a test cannot reach).
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.document.commands.objects import AddObject
from app.document.commands.painted import SetPainted, add_image
from app.document.painted_parameters import PAINTED_IMAGE_ENDINGS
from app.document.sources import IMAGE_SUFFIXES, LIGHT_ENDINGS, SCENE_ENDINGS, SESSION_ENDING
from app.export import PACKAGE_ENDING
from engine.core.colour_config import ENDINGS as CONFIG_ENDINGS
from engine.core.safe_files import resolved
from engine.curve.table_text import TABLE_ENDINGS
from engine.measured.measurement import ENDINGS as MEASURED_ENDINGS
from engine.render.picture_files import PICTURE_ENDINGS
from engine.scene.mesh import MATERIAL_ENDING, MESH_ENDINGS
from ui import theme as look
from ui.panels import widgets
from ui.panels.actions import (
    Action,
    AnswerQuestion,
    CompareFile,
    ExportMeasured,
    ExportScene,
    ImportMaterial,
    ImportMeasured,
    OpenConfig,
    OpenFile,
    OpenImage,
    OpenMask,
    OpenPhoto,
    SaveContactSheet,
    SaveEnvironment,
    SavePicture,
    SaveScene,
    SaveSession,
    SetPanel,
)
from ui.panels.context import PanelContext
from ui.panels.window_state import FileQuestion

TITLES = {
    "open_scene": "Open a scene, a session or a mesh",
    "open_environment": "Open an environment",
    "paint_image": "Paint an image onto the environment",
    "save_environment": "Save the environment with what is painted on it",
    "add_file": "Add the objects of a mesh file to the scene",
    "open_material": "Import a material of MaterialX onto the selected object",
    "open_measured": "Import a measured BRDF onto the selected object",
    "open_config": "Open a configuration of OpenColorIO",
    "open_compared": "Compare the picture with one from a file",
    "open_photo": "Match the selected object to a photograph",
    "open_mask": "Open a mask of the photograph",
    "open_table": "Load a table onto the selected curve (CSV: angle in degrees, values)",
    "open_texture": "Open a texture",
    "open_normal_map": "Open a normal map",
    "open_bump_map": "Open a bump map",
    "open_tangent_map": "Open a map of rotations",
    "open_coat_normal_map": "Open a normal map of the coat",
    "open_opacity_map": "Open an opacity map",
    "open_weight": "Open a weight map",
    "open_parameter_map": "Open a map of a parameter",
    "open_translucency": "Open a map of translucency",
    "open_heights": "Open an image of heights",
    "open_depth": "Open a map of depth",
    "save_session": "Save the session",
    "save_measured": "Export the selected object's material as a MERL file",
    "save_picture": "Save the picture",
    "save_sheet": "Save a contact sheet of all looks",
    "save_scene": "Export the scene for Mitsuba 3: name a folder",
    "save_package": "Save the scene with everything it needs",
}
ENDINGS = {
    "open_scene": (*SCENE_ENDINGS, SESSION_ENDING),
    "open_environment": LIGHT_ENDINGS,
    "paint_image": PAINTED_IMAGE_ENDINGS,
    "save_environment": (".exr",),
    "add_file": MESH_ENDINGS,
    "open_material": (MATERIAL_ENDING,),
    "open_measured": MEASURED_ENDINGS,
    "open_config": CONFIG_ENDINGS,
    "open_compared": PICTURE_ENDINGS,
    "open_photo": PICTURE_ENDINGS,
    "open_mask": PICTURE_ENDINGS,
    "open_table": TABLE_ENDINGS,
    "open_texture": IMAGE_SUFFIXES,
    "open_normal_map": IMAGE_SUFFIXES,
    "open_bump_map": IMAGE_SUFFIXES,
    "open_tangent_map": IMAGE_SUFFIXES,
    "open_coat_normal_map": IMAGE_SUFFIXES,
    "open_opacity_map": IMAGE_SUFFIXES,
    "open_weight": IMAGE_SUFFIXES,
    "open_parameter_map": IMAGE_SUFFIXES,
    "open_translucency": IMAGE_SUFFIXES,
    "open_heights": IMAGE_SUFFIXES,
    "open_depth": IMAGE_SUFFIXES,
    "save_session": (".insitu",),
    "save_measured": (".binary",),
    "save_picture": (".png", ".exr"),
    "save_sheet": (".png",),
    "save_scene": (),  # a folder
    "save_package": (PACKAGE_ENDING,),
}
LAYERS_HINT = (
    "Drawn anew, in the background, with channels for each light, direct and indirect light, masks, albedo, normals, "
    "positions, depth and error."
)
PICTURE_CHOICES = (
    ("PNG", "As shown, 8 bits per channel: for the screen."),
    ("PNG 16 bit", "As shown, 65,536 levels per channel: for grading and print."),
    ("EXR", "Linear light in 32-bit numbers, without exposure and view: for compositing."),
    ("EXR with layers", LAYERS_HINT),
)
CROP_CHOICES = (
    ("Whole", "The whole picture."),
    ("Crop", "Only the crop; an EXR keeps its place in the whole."),
)
PACKAGE_CHOICES = (
    ("One file", "An archive, to be sent: it opens as it is."),
    ("Folder", "A new folder, with the scene's files as they lie beside each other."),
)
# What a measurement becomes; the second is cloth.
MEASURED_CHOICES = (
    ("Diffuse and highlight", "Two layers: the diffuse part with curves over θi and θo, the highlight over θh and θd."),
    ("Cloth", "One layer P(θi) Q(θh) P(θo): how light and view slant, and the highlight's profile. For fabrics."),
)
MOST_ENTRIES = 2000
WIDTH, HEIGHT = 560.0, 420.0
PATH_FLAGS = imgui.InputTextFlags_.enter_returns_true | imgui.InputTextFlags_.auto_select_all


@dataclass(frozen=True)
class DirectoryEntry:
    """A line of the browser."""

    path: Path
    is_folder: bool


def entries(folder: Path, endings: tuple[str, ...]) -> list[DirectoryEntry]:
    """Folders, then files with one of the endings, by name, without hidden ones. Empty where not readable."""
    try:
        paths = sorted(folder.iterdir())[:MOST_ENTRIES]
    except OSError:
        return []
    found = [DirectoryEntry(path, os.path.isdir(path)) for path in paths if not path.name.startswith(".")]
    shown = [e for e in found if e.is_folder or e.path.name.lower().endswith(endings)]
    return sorted(shown, key=lambda e: (not e.is_folder, e.path.name.lower()))


def draw(context: PanelContext) -> list[Action]:
    """The browser while the dialog is open, nothing otherwise."""
    question = context.state.question
    if question is None:
        return []
    viewport = imgui.get_main_viewport()
    imgui.set_next_window_pos(viewport.get_work_center(), imgui.Cond_.appearing, ImVec2(0.5, 0.5))
    room = viewport.work_size
    size = ImVec2(min(context.px(WIDTH), room.x), min(context.px(HEIGHT), room.y))
    imgui.set_next_window_size(size, imgui.Cond_.appearing)
    flags = imgui.WindowFlags_.no_docking | imgui.WindowFlags_.no_collapse | imgui.WindowFlags_.no_saved_settings
    imgui.push_style_color(imgui.Col_.window_bg, look.pack(look.grey(44)))
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 1.0)
    visible, is_open = imgui.begin(f"{TITLES[question.purpose]}###files", True, flags)
    actions = _contents(context, question) if visible else []
    imgui.end()
    imgui.pop_style_var()
    imgui.pop_style_color()
    if not is_open:
        return [SetPanel({"question": None})]
    return actions


def _contents(context: PanelContext, question: FileQuestion) -> list[Action]:
    actions = _folder_line(context, question)
    choice = {
        "open_measured": _measured_line, "save_picture": _picture_line, "save_package": _package_line,
    }.get(question.purpose)  # fmt: skip
    n_lines = 1 + (choice is not None) + bool(question.refusal)
    footer = n_lines * imgui.get_frame_height_with_spacing() + context.px(6)
    corner, room = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail()
    end = ImVec2(corner.x + room.x, corner.y + room.y - footer)
    imgui.get_window_draw_list().add_rect_filled(corner, end, look.pack(look.WELL), context.px(4))
    if imgui.begin_child("entries", ImVec2(0, -footer), imgui.ChildFlags_.always_use_window_padding):
        for entry in entries(question.folder, ENDINGS[question.purpose]):
            actions += _entry(context, question, entry)
    imgui.end_child()
    if choice is not None:
        actions += choice(context, question)
    if question.refusal:
        _refusal_line(question.refusal)
    return actions + _name_line(context, question)


def _refusal_line(refusal: str) -> None:
    """The reason why the entry was refused."""
    imgui.align_text_to_frame_padding()
    imgui.push_style_color(imgui.Col_.text, look.pack(look.BAD))
    imgui.text_unformatted(widgets.shortened(refusal, imgui.get_content_region_avail().x))
    imgui.pop_style_color()
    widgets.tooltip(refusal)


def _measured_line(context: PanelContext, question: FileQuestion) -> list[Action]:
    """The choice of what the measurement becomes."""
    imgui.align_text_to_frame_padding()
    imgui.text("Import as")
    imgui.same_line()
    pressed = widgets.segments(context, "files.measured", MEASURED_CHOICES, int(question.cloth))
    return [] if pressed is None else [_input_line(replace(question, cloth=pressed == 1))]


def _picture_line(context: PanelContext, question: FileQuestion) -> list[Action]:
    """The choice of what the file contains; the suffix of its name follows, and the keyboard is the name's again, so
    that Enter saves."""
    imgui.align_text_to_frame_padding()
    imgui.text("Save as")
    imgui.same_line()
    is_exr = question.name.lower().endswith(".exr")
    chosen = 2 + question.layers if is_exr else int(question.deep)
    pressed = widgets.segments(context, "files.picture", PICTURE_CHOICES, chosen)
    if context.view.crop is not None:
        imgui.same_line()
        part = widgets.segments(context, "files.crop", CROP_CHOICES, int(question.cropped))
        if part is not None:
            return [_input_line(replace(question, cropped=part == 1, focus="name"))]
    if pressed is None:
        return []
    ending = ENDINGS["save_picture"][pressed >= 2]
    name = str(Path(question.name or "picture").with_suffix(ending))
    return [_input_line(replace(question, name=name, deep=pressed == 1, layers=pressed == 3, focus="name"))]


def _package_line(context: PanelContext, question: FileQuestion) -> list[Action]:
    """The choice between one file and a folder; the name follows."""
    imgui.align_text_to_frame_padding()
    imgui.text("Save as")
    imgui.same_line()
    pressed = widgets.segments(context, "files.package", PACKAGE_CHOICES, int(question.as_folder))
    if pressed is None:
        return []
    stem = question.name.removesuffix(PACKAGE_ENDING)
    name = stem if pressed == 1 else f"{stem}{PACKAGE_ENDING}"
    return [_input_line(replace(question, name=name, as_folder=pressed == 1, focus="name"))]


def _folder_line(context: PanelContext, question: FileQuestion) -> list[Action]:
    actions: list[Action] = []
    parent = question.folder.parent
    hint = "The folder above."
    if widgets.text_button(context, "files.up", "Up", hint, enabled=parent != question.folder):
        actions.append(_input_line(_in_folder(question, parent)))
    imgui.same_line()
    if question.purpose == "open_scene":
        hint = "Open the one scene that is in this folder."
        if widgets.text_button(context, "files.folder_scene", "Open folder", hint):
            actions.append(AnswerQuestion(question.folder, OpenFile(str(question.folder))))
        imgui.same_line()
    imgui.set_next_item_width(-1.0)
    if question.focus == "folder":
        imgui.set_keyboard_focus_here()
        actions.append(_input_line(replace(question, focus="")))
    shown = question.typed or str(question.folder)
    confirmed, typed = imgui.input_text("##folder", shown, PATH_FLAGS)
    context.handles.note_item("files.folder")
    widgets.tooltip("The folder shown; type another and press Enter.")
    if not confirmed:
        return actions
    if os.path.isdir(folder := os.path.expanduser(typed)):
        return [_input_line(_in_folder(question, Path(folder)))]
    return [_input_line(replace(question, typed=typed, refusal="there is no such folder", focus="folder"))]


def _in_folder(question: FileQuestion, folder: Path) -> FileQuestion:
    """The question with another folder shown, and no refusal."""
    return replace(question, folder=folder, typed="", refusal="")


def _entry(context: PanelContext, question: FileQuestion, entry: DirectoryEntry) -> list[Action]:
    text = f"  {entry.path.name}/" if entry.is_folder else f"  {entry.path.name}"
    pressed, _ = imgui.selectable(text, entry.path.name == question.name, imgui.SelectableFlags_.allow_double_click)
    if not pressed:
        return []
    if entry.is_folder:
        return [_input_line(_in_folder(question, entry.path))] if imgui.is_mouse_double_clicked(0) else []
    chosen = replace(question, name=entry.path.name, refusal="")
    return [_input_line(chosen), *([answer(chosen, entry.path)] if imgui.is_mouse_double_clicked(0) else [])]


def _name_line(context: PanelContext, question: FileQuestion) -> list[Action]:
    requested = question
    verb, hint = _verb(question)
    width = imgui.calc_text_size(verb).x + 2 * imgui.get_style().frame_padding.x
    imgui.set_next_item_width(imgui.get_content_region_avail().x - width - imgui.get_style().item_spacing.x)
    if question.focus == "name":
        imgui.internal.clear_active_id()  # a field that has the keyboard already does not update its text
        imgui.set_keyboard_focus_here()
        question = replace(question, focus="")
    confirmed, typed = imgui.input_text("##name", question.name, PATH_FLAGS)
    context.handles.note_item("files.name")
    widgets.tooltip("The file's name, or a path to it.")
    imgui.same_line()
    pressed = widgets.text_button(context, "files.confirm", verb, hint, enabled=bool(question.name))
    if (pressed or confirmed) and typed:
        imgui.set_nav_cursor_visible(False)  # imgui would frame a control of the panel that was last in use
        path = question.folder / os.path.expanduser(typed)
        if os.path.isdir(path):
            return [_input_line(replace(_in_folder(question, path), name="", focus="name"))]
        return [_input_line(replace(question, name=typed)), answer(question, path)]
    refusal = question.refusal if typed == question.name else ""
    edited = replace(question, name=typed, refusal=refusal)
    return [_input_line(edited)] if edited != requested else []


def _verb(question: FileQuestion) -> tuple[str, str]:
    """The label of the button, and its tooltip."""
    if not question.purpose.startswith("save"):
        return "Open", "Open this file."
    if question.name and os.path.isfile(question.folder / _named(question, question.name)):
        return "Replace", "There is a file of this name: this takes its place."
    return "Save", "Save this file."


def _named(question: FileQuestion, name: str) -> str:
    """A file's name with its suffix."""
    if question.purpose == "save_package":
        is_named = question.as_folder or name.lower().endswith(PACKAGE_ENDING)
        return name if is_named else f"{name}{PACKAGE_ENDING}"
    endings = ENDINGS[question.purpose]
    return f"{name}{endings[0]}" if endings and not Path(name).suffix else name


def answer(question: FileQuestion, path: Path) -> AnswerQuestion:
    """The user's choice. The name of a saved file gets its suffix."""
    purpose = question.purpose
    if purpose == "paint_image":
        image = SetPainted.of(question.key, "file", str(resolved(path))) if question.key else add_image(path)
        return AnswerQuestion(path, image)
    if purpose == "open_photo":
        return AnswerQuestion(path, OpenPhoto(path, question.key))
    if question.key:
        return AnswerQuestion(path, OpenImage(path, question.key, purpose.removeprefix("open_")))
    if purpose.startswith("save"):
        path = path.with_name(_named(question, path.name))
    actions: dict[str, Action] = {
        "add_file": AddObject(str(resolved(path))), "open_material": ImportMaterial(path),
        "open_config": OpenConfig(path), "open_compared": CompareFile(path),
        "open_mask": OpenMask(path),
        "open_measured": ImportMeasured(path, question.cloth), "save_measured": ExportMeasured(path),
        "save_session": SaveSession(path), "save_picture": _saved_picture(question, path),
        "save_sheet": SaveContactSheet(path),
        "save_scene": ExportScene(path), "save_package": SaveScene(path),
        "save_environment": SaveEnvironment(path),
    }  # fmt: skip
    return AnswerQuestion(path, actions.get(purpose, OpenFile(str(path))))


def _saved_picture(question: FileQuestion, path: Path) -> SavePicture:
    layers = question.layers and path.suffix.lower() == ".exr"
    return SavePicture(path, question.deep, layers, question.cropped)


def dropped(question: FileQuestion, path: Path) -> list[Action]:
    """A file or folder was dropped on the window while the dialog is open: it is what is to be opened, or the folder
    and name of what is to be saved."""
    if os.path.isdir(path):
        return [_input_line(replace(_in_folder(question, path), focus="name"))]
    if question.purpose.startswith("save"):
        return [_input_line(replace(_in_folder(question, path.parent), name=path.name, focus="name"))]
    return [_input_line(replace(question, name=str(path))), answer(question, path)]


def _input_line(question: FileQuestion) -> Action:
    return SetPanel({"question": question})
