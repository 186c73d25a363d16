"""Runs scripts of edits, and takes pictures of the window, without a display (`insitu screenshot`).

Drags are mouse events through the same frames as a user's; `set`, `select`, `rotate`, `camera`, `undo` and `redo` are
the commands that panels return.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

from app.document.commands import EditCommand
from app.document.commands.light import SetRotation
from app.document.commands.paint import Paint
from app.document.commands.plan import override_from_value
from app.document.commands.poses import SetTime, with_amounts
from app.document.commands.series import set_series
from app.document.document import layer_key, split_key
from app.document.effective_settings import override_lines_of
from app.document.pareto_front import load_front
from app.document.view_state import SetView, ViewCommand, Viewpoint
from app.editor.editor import Editor, WorkerClient
from app.editor.script import (
    AssertErrorBelow,
    AwaitedPicture,
    CaptureWindow,
    ChooseMode,
    ChooseView,
    DeformObject,
    DragItem,
    DragPoints,
    GoToView,
    ImportFile,
    MoveCamera,
    OverrideLines,
    PaintStroke,
    PickLobe,
    RedoSteps,
    RotateLight,
    SaveViewStep,
    SelectPath,
    SetAccuracy,
    SetValues,
    ShowPanelStep,
    Step,
    UndoSteps,
    UndoViews,
    WaitFor,
)
from app.files.bookmarks import find_bookmark
from app.modes.placement.placement_status import PlacementStatus
from app.project.set_path import set_path
from app.system.atomic import make_folder_of, require_place
from app.worker.client import Client
from engine.core.errors import InsituError
from engine.scene.builtin import builtin_environments, builtin_scenes
from engine.scene.camera_moves import (
    dolly_camera,
    frame_box,
    level_horizon,
    orbit_camera,
    pan_camera,
    view_from_side,
    with_focal_length,
)
from engine.scene.description import Camera
from ui.brush_dabs import sample_path, spots_at, stroke_at
from ui.headless import DEFAULT_SIZE, HeadlessWindow
from ui.layout import PANELS
from ui.panels.actions import SaveView, ShowPanel
from ui.picture_feed import PictureFeed
from ui.tone_view import is_table_ready

WAIT_SECONDS = 1800.0


class ScriptError(InsituError):
    """A step could not be carried out, or what it asserts is false."""


def take_screenshot(
    source: str,
    output: Path,
    *,
    steps: Sequence[Step] = (),
    size: tuple[int, int] = DEFAULT_SIZE,
    scale: float = 1.0,
    resolution: tuple[int, int] | None = None,
    wait: AwaitedPicture = "exact",
    client: WorkerClient | None = None,
) -> None:
    """Open a scene in a window without a display, run the steps, wait for the picture and save the window's pixels.

    Raises InsituError: the scene cannot be opened, a step fails, or the picture does not come.
    """
    editor = Editor(client or Client(), source, resolution=resolution)
    try:
        window = HeadlessWindow(editor, size=size, scale=scale)
        feed = PictureFeed(window.context, editor.mode)
        window.shell.environments = tuple(builtin_environments())
        window.shell.scenes = tuple(builtin_scenes())
        window.shell.source = feed
        try:
            wait_for_scene(window, editor)
            pictures = [output, *(step.path for step in steps if isinstance(step, CaptureWindow))]
            for path in pictures:
                make_folder_of(path)
            require_place(*pictures)
            run_steps(window, editor, steps)
            wait_for_picture(window, editor, wait)
            window.leave()
            window.save(output)
        finally:
            feed.close()
            window.close()
    finally:
        editor.close()


def run_steps(window: HeadlessWindow, editor: Editor, steps: Sequence[Step]) -> None:
    """Carry the steps out in order. Raises ScriptError that numbers the step, from 1."""
    for number, step in enumerate(steps, 1):
        try:
            _run(window, editor, step)
        except InsituError as error:
            raise ScriptError(f"step {number}: {error}") from error


def wait_for_scene(window: HeadlessWindow, editor: Editor, timeout: float = WAIT_SECONDS) -> None:
    """Wait until the worker has opened the scene; ScriptError with its message when it cannot."""
    _wait(window, editor, lambda: editor.scene_is_open or editor.status.is_error, timeout)
    if not editor.scene_is_open:
        raise ScriptError(editor.status.message)


def wait_for_picture(
    window: HeadlessWindow, editor: Editor, picture: AwaitedPicture, timeout: float = WAIT_SECONDS
) -> None:
    """Wait until the first shaded picture, Orbit's own, or the exact one is shown, or its error is estimated."""

    def there() -> bool:
        status = editor.status
        if picture == "error":
            return status.estimate is not None
        if picture == "orbit":
            return status.is_whole
        return status.is_finished if picture == "exact" else status.picture != "waiting"

    window.frames(2)
    _wait(window, editor, there, timeout)
    window.frames(1)
    _wait(window, editor, lambda: not window.shell.awaits_table, timeout)


def _wait(window: HeadlessWindow, editor: Editor, done: Callable[[], bool], timeout: float) -> None:
    if not window.run_until(done, timeout):
        raise ScriptError(f"the picture is still {editor.status.picture} after {timeout:.0f} s")


def _run(window: HeadlessWindow, editor: Editor, step: Step) -> None:
    match step:
        case SetValues():
            for path, value in step.values:
                _refused(editor.do(_setting(editor, path, value)))
                _wait_for_files(window, editor)
        case SelectPath():
            _refused(editor.select(step.path))
        case DeformObject():
            for edit in _deforming(editor, step):
                _refused(editor.do(edit))
        case DragItem():
            _drag_item(window, step)
        case DragPoints():
            window.drag(step.start, step.end)
        case ShowPanelStep():
            _show(window, step.panel)
        case ChooseView():
            _refused(editor.do(SetView.of(tone_mapping=step.view)))
            window.run_until(lambda: is_table_ready(step.view), WAIT_SECONDS)
        case GoToView():
            _refused(
                editor.camera_history.set_viewpoint(
                    find_bookmark(editor.view.bookmarks, step.name).viewpoint, step.name
                )
            )
        case SaveViewStep():
            window.shell.do(SaveView(step.name))
        case MoveCamera():
            look = Viewpoint(_moved(editor, step), editor.view.resolution)
            _refused(editor.camera_history.set_viewpoint(look, "camera"))
        case UndoViews():
            _repeat(editor.camera_history.undo, step.count, "undo in the view")
        case ChooseMode():
            _choose_mode(editor, step.mode)
        case PickLobe():
            _refused(editor.do(SetView.of(lobe_pixel=step.pixel)))
        case PaintStroke():
            _paint(window, editor, step)
        case RotateLight():
            _refused(editor.do(SetRotation(step.degrees)))
        case ImportFile():
            _refused(editor.import_measured(step.file, step.cloth))
            _wait_for_files(window, editor)
        case OverrideLines():
            for line, value in step.lines:
                _refused(editor.do(override_from_value(line, value)))
        case SetAccuracy():
            for command in override_lines_of(
                load_front().nearest_point(editor.mode.name, step.share).command, editor.document
            ):
                _refused(editor.do(command))
        case UndoSteps():
            _repeat(editor.undo, step.count, "undo")
        case RedoSteps():
            _repeat(editor.redo, step.count, "redo")
        case WaitFor():
            wait_for_picture(window, editor, step.picture)
        case CaptureWindow():
            window.leave()
            window.save(step.path)
        case AssertErrorBelow():
            _assert_error(editor, step.bound)
    window.frames(2)


def _moved(editor: Editor, move: MoveCamera) -> Camera:
    """The camera after a step has moved it."""
    camera = editor.camera_history.own_camera if move.own else editor.camera_history.camera
    if move.side is not None:
        camera = view_from_side(camera, move.side)
    if move.focal is not None:
        camera = with_focal_length(camera, move.focal)
    if move.frame is not None:
        names = [state.name for state in editor.document.objects]
        box = editor.camera_history.box_of(None if move.frame == "all" and "all" not in names else move.frame)
        camera = frame_box(camera, box, editor.camera_history.aspect)
    if move.orbit is not None:
        camera = orbit_camera(camera, *map(math.radians, move.orbit))
    if move.pan is not None:
        camera = pan_camera(camera, *move.pan)
    if move.dolly is not None:
        camera = dolly_camera(camera, move.dolly)
    return level_horizon(camera) if move.level else camera


def _choose_mode(editor: Editor, name: str) -> None:
    names = [mode.name for mode in editor.modes]
    if name not in names:
        raise ScriptError(f"mode: there is no {name!r}; available: {', '.join(names)}")
    _refused(editor.do(SetView.of(mode=name)))


def _paint(window: HeadlessWindow, editor: Editor, step: PaintStroke) -> None:
    """Drag along the points; beside the object there is nothing to paint."""
    try:
        name, index = split_key(editor.document, step.layer)
    except InsituError as error:
        raise ScriptError(str(error)) from error
    source = window.shell.source
    assert source is not None
    spots = spots_at(
        lambda x, y: source.spot_at(x, y) if source.object_at(x, y) == name else None,
        [step.points[0], *sample_path(step.points, step.radius)],
    )
    if not spots:
        raise ScriptError(f"paint: no point of the stroke sees {name}")
    metres = step.radius * spots[0].metres
    stroke = stroke_at(spots, metres, step.value, step.strength, step.hardness)
    _refused(editor.do(Paint(layer_key(name, index), stroke)))


def _setting(editor: Editor, path: str, value: object) -> EditCommand | ViewCommand:
    try:
        return set_series(path, value) or set_path(editor.document, path, value)
    except InsituError as error:
        raise ScriptError(str(error)) from error


def _deforming(editor: Editor, step: DeformObject) -> list[EditCommand]:
    edits: list[EditCommand] = []
    if step.time is not None:
        edits.append(SetTime(step.time, step.clip, step.object))
    if step.object is not None and step.amounts:
        try:
            edits.append(with_amounts(editor.document, step.object, dict(step.amounts)))
        except InsituError as error:
            raise ScriptError(str(error)) from error
    return edits


def _wait_for_files(window: HeadlessWindow, editor: Editor) -> None:
    """Wait for a material that has to be read from a measured file."""
    if not editor.is_reading:
        return
    if not window.run_until(lambda: not editor.is_reading, WAIT_SECONDS):
        raise ScriptError(f"the measured file is still being read after {WAIT_SECONDS:.0f} s")
    if editor.status.is_error:
        raise ScriptError(editor.status.message)


def _drag_item(window: HeadlessWindow, step: DragItem) -> None:
    window.frames(2)
    try:
        window.drag_handle(step.item, step.by)
    except KeyError as error:
        raise ScriptError(str(error.args[0])) from error


def _show(window: HeadlessWindow, name: str) -> None:
    names = [panel.key for panel in PANELS]
    if name not in names:
        raise ScriptError(f"there is no panel {name!r}; available: {', '.join(names)}")
    window.shell.do(ShowPanel(name))


def _repeat(move: Callable[[], str | None], count: int, name: str) -> None:
    for _ in range(count):
        if move() is None:
            raise ScriptError(f"nothing to {name}")


def _refused(line: str | None) -> None:
    if line is not None:
        raise ScriptError(line)


def _assert_error(editor: Editor, bound: float) -> None:
    status = editor.status
    error = status.curve_error if isinstance(status, PlacementStatus) else status.image_error
    if error is None or not error < bound:
        raise ScriptError(f"error of the curve = {error}, expected below {bound:g}")
