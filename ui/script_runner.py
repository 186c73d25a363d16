"""Runs scripts of edits, and takes pictures of the window, without a display (`insitu screenshot`).

A step is an operator (`app.operators`). Drags are mouse events through the same frames as a user's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.document.arranging import placed_objects, standing
from app.document.commands.lamps import SetTarget
from app.document.commands.maps import Paint
from app.document.commands.poses import PlaceObjects
from app.document.document import layer_key, split_key
from app.document.light_placing import LightAim, place_named
from app.editor.editor import Editor
from app.messages.worker_messages import WorkerClient
from app.modes.placement.placement_status import PlacementStatus
from app.operators.arrange import Aim, Move, PlacedByHand
from app.operators.edits import Drag, HighlightStep, PaintStroke
from app.operators.inspect import ConfiguredView
from app.operators.photos import MatchStep
from app.operators.registry import run_operator
from app.operators.script import Step
from app.operators.selecting import BoxSelection
from app.operators.view import AwaitedPicture
from app.system.atomic import make_folder_of, require_place
from app.worker.client import Client
from engine.core.colour import ConfigView
from engine.core.errors import InsituError
from engine.scene.builtin import builtin_environments, builtin_scenes
from engine.scene.light_paths import describe_unplaced
from engine.scene.light_placement import PlacedLight
from engine.scene.surface_spot import SurfaceSpot
from ui.gl.view_transform import is_view_ready
from ui.headless import DEFAULT_SIZE, HeadlessWindow
from ui.layout import PANELS
from ui.panels.actions import SavePicture, SetPanel, ShowPanel, StorePicture
from ui.panels.box_select import box_between, boxed, lamp_places, names_in
from ui.picture_feed import PictureFeed
from ui.scene_view import sample_path, spots_at, stroke_at
from ui.script_highlights import paint_highlight
from ui.script_matching import match_photo_step

WAIT_SECONDS = 1800.0
# While a picture is refined, a window asks for frames without end.
LAYOUT_FRAMES = 60


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
            pictures = [output, *(step.value for step in steps if step.name in ("capture", "picture"))]
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
    source = window.shell.source
    if picture == "exact" and source is not None:  # over Orbit's picture it fades in
        _wait(window, editor, lambda: source.is_finished, timeout)
    if picture == "exact":
        _wait(window, editor, lambda: window.shell.looks.pictures.is_finished, timeout)
        window.frames(1)
    _wait(window, editor, lambda: not window.shell.awaits_table, timeout)
    _wait(window, editor, lambda: not window.shell.awaits_difference, timeout)
    window.frames(1)


def _wait(window: HeadlessWindow, editor: Editor, done: Callable[[], bool], timeout: float) -> None:
    if not window.run_until(done, timeout):
        raise ScriptError(f"the picture is still {editor.status.picture} after {timeout:.0f} s")


def _run(window: HeadlessWindow, editor: Editor, step: Step) -> None:
    if step.name in WINDOW_STEPS:
        WINDOW_STEPS[step.name](window, editor, step.value)
    else:
        _run_operator(window, editor, step.name, step.value)
    window.frames(2)


def _run_operator(window: HeadlessWindow, editor: Editor, name: str, value: Any) -> None:
    """Carry out an operator; where it has to read a file or to match a material, wait for that."""
    refusal = run_operator(editor, name, value)
    if refusal is not None:
        raise ScriptError(refusal)
    if not (editor.exchange.is_reading or editor.material_matching.progress):
        return
    if not window.run_until(
        lambda: not (editor.exchange.is_reading or editor.material_matching.progress), WAIT_SECONDS
    ):
        doing = editor.material_matching.progress or "reading a file"
        raise ScriptError(f"still {doing} after {WAIT_SECONDS:.0f} s")
    if editor.status.is_error:
        raise ScriptError(editor.status.message)


def _set(window: HeadlessWindow, editor: Editor, values: dict[str, Any]) -> None:
    """One value after the other: the next may be of a material that is being read."""
    for path, value in values.items():
        _run_operator(window, editor, "set", {path: value})


def _show_gizmo(window: HeadlessWindow, editor: Editor, tool: str) -> None:
    window.shell.do(SetPanel({"gizmo": "" if tool == "none" else tool}))


def _snap(window: HeadlessWindow, editor: Editor, to: str) -> None:
    window.shell.do(SetPanel({"snaps": False} if to == "none" else {"snaps": True, "snap_to": to}))


def _choose_pivot(window: HeadlessWindow, editor: Editor, pivot: str) -> None:
    window.shell.do(SetPanel({"pivot": pivot}))


def _choose_view(window: HeadlessWindow, editor: Editor, name: str) -> None:
    _run_operator(window, editor, "view", name)
    _wait_for_view(window, editor)


def _open_config(window: HeadlessWindow, editor: Editor, value: ConfiguredView) -> None:
    _run_operator(window, editor, "ocio", value)
    wanted = editor.view.tone_mapping
    _wait_for_view(window, editor)
    if isinstance(wanted, ConfigView) and editor.colours.shader(wanted) is None:
        raise ScriptError(editor.status.message)


def _store_picture(window: HeadlessWindow, editor: Editor, name: str) -> None:
    said_before = editor.status.message_number
    window.shell.request(StorePicture(name))
    window.frames(1)
    if not window.run_until(lambda: not window.shell.saving.is_storing, WAIT_SECONDS):
        raise ScriptError(f"the picture is still being stored after {WAIT_SECONDS:.0f} s")
    if editor.status.message_number != said_before and editor.status.is_error:
        raise ScriptError(editor.status.message)


def _compare_file(window: HeadlessWindow, editor: Editor, file: str) -> None:
    said_before = editor.status.message_number
    _run_operator(window, editor, "compare_file", file)
    if not window.run_until(lambda: not editor.stored.is_reading, WAIT_SECONDS):
        raise ScriptError(f"the file is still being read after {WAIT_SECONDS:.0f} s")
    if editor.status.message_number != said_before and editor.status.is_error:
        raise ScriptError(editor.status.message)


def _wait_for_view(window: HeadlessWindow, editor: Editor) -> None:
    window.run_until(lambda: is_view_ready(editor.view.tone_mapping, editor.colours), WAIT_SECONDS)


def _capture(window: HeadlessWindow, editor: Editor, path: Path) -> None:
    window.leave()
    window.save(path)


def _save_session(window: HeadlessWindow, editor: Editor, path: Path) -> None:
    if (refusal := editor.save(path)) is not None:
        raise ScriptError(refusal)


def _save_scene(window: HeadlessWindow, editor: Editor, path: Path) -> None:
    _write(window, editor, editor.exchange.save_scene(path, replaces=False))


def _export_scene(window: HeadlessWindow, editor: Editor, folder: Path) -> None:
    _write(window, editor, editor.exchange.export_scene(folder))


def _write(window: HeadlessWindow, editor: Editor, refusal: str | None) -> None:
    """Wait until the worker has written what it was asked for, unless that was refused."""
    if refusal is not None:
        raise ScriptError(refusal)
    if not window.run_until(lambda: not editor.exchange.is_writing, WAIT_SECONDS):
        raise ScriptError(f"the files are still being written after {WAIT_SECONDS:.0f} s")
    if editor.status.is_error:
        raise ScriptError(editor.status.message)


def _save_picture(window: HeadlessWindow, editor: Editor, path: Path) -> None:
    said_before = editor.status.message_number
    window.shell.request(SavePicture(path))
    if not window.run_until(lambda: editor.status.message_number != said_before, WAIT_SECONDS):
        raise ScriptError(f"the picture is still being written after {WAIT_SECONDS:.0f} s")
    if editor.status.is_error:
        raise ScriptError(editor.status.message)


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
    refusal = editor.do(Paint(layer_key(name, index), stroke))
    if refusal is not None:
        raise ScriptError(refusal)


def _paint_highlight(window: HeadlessWindow, editor: Editor, step: HighlightStep) -> None:
    try:
        refusal = paint_highlight(window, editor, step, WAIT_SECONDS)
    except InsituError as error:
        raise ScriptError(f"paint_highlight: {error}") from error
    if refusal is not None:
        raise ScriptError(refusal)


def _match(window: HeadlessWindow, editor: Editor, step: MatchStep) -> None:
    try:
        refusal = match_photo_step(editor, step)
    except InsituError as error:
        raise ScriptError(f"match: {error}") from error
    if refusal:
        raise ScriptError(f"match: {refusal}")


def _place_light(window: HeadlessWindow, editor: Editor, step: PlacedByHand) -> None:
    """Place a light, and show what keeps it from doing what it was placed for."""
    history = editor.camera_history
    start, end = (None, step.highlight) if step.shadow is None else step.shadow
    assert end is not None
    aim = LightAim(_surface_at(window, editor, "place_light", end), history.camera)
    if start is not None:
        x, y, z = _surface_at(window, editor, "place_light", start).place.tolist()
        thrower = None if window.shell.source is None else window.shell.source.object_at(*start)
        aim = replace(aim, caster=(x, y, z), caster_object=thrower or "")

    def lamp_of(name: str) -> PlacedLight | None:
        box, transform = history.resting_box(name), editor.document.object(name).transform
        return None if box is None else PlacedLight(box.mean(axis=0), history.resting_facing(name), transform)

    command, path = place_named(editor.document, step.light, lamp_of, aim)
    if path.towards is None:
        raise ScriptError(f"place_light: {describe_unplaced(path)}")
    if command is not None and (refusal := editor.do(command)) is not None:
        raise ScriptError(refusal)
    editor.light_paths.trace(path)
    window.run_until(lambda: not editor.light_paths.is_tracing, WAIT_SECONDS)


def _surface_at(window: HeadlessWindow, editor: Editor, step: str, pixel: tuple[int, int]) -> SurfaceSpot:
    """What a pixel sees, once there is a picture from the camera that the steps before have moved."""
    wait_for_picture(window, editor, "first")
    source = window.shell.source
    assert source is not None
    if (spot := source.spot_at(*pixel)) is None:
        raise ScriptError(f"{step}: pixel {pixel[0]}, {pixel[1]} sees no surface")
    return spot


def _move(window: HeadlessWindow, editor: Editor, step: Move) -> None:
    """By numbers, or onto what a pixel of the picture sees."""
    if step.onto is None:
        _run_operator(window, editor, "move", step)
        return
    placed = step.placed(editor.document, editor.camera_history.resting_box)
    names = [each.name for each in placed]
    spot, source = _surface_at(window, editor, "move", step.onto), window.shell.source
    if not placed or source is None or source.object_at(*step.onto) in names:
        raise ScriptError(f"move: pixel {step.onto[0]}, {step.onto[1]} sees what is moved, expected another surface")
    refusal = editor.do(standing(placed, spot.place, spot.normal, step.align))
    if refusal is not None:
        raise ScriptError(refusal)


def _aim(window: HeadlessWindow, editor: Editor, step: Aim) -> None:
    point = step.at if step.onto is None else _surface_at(window, editor, "aim", step.onto).place
    assert point is not None
    if editor.document.object(step.light).lamp is not None:
        x, y, z = map(float, point)
        if (refusal := editor.do(SetTarget(step.light, (x, y, z)))) is not None:
            raise ScriptError(refusal)
        return
    placed = placed_objects(editor.document, [step.light], editor.camera_history.resting_box)
    facing = editor.camera_history.resting_facing(step.light)
    if not placed or facing is None:
        raise ScriptError(f"aim: {step.light} shines to all sides or not at all, expected a flat light or a spot")
    aimed = PlacedLight(placed[0].pivot, facing, placed[0].transform).aimed_at(point)
    refusal = editor.do(PlaceObjects(((step.light, aimed),), f"aim {step.light}"))
    if refusal is not None:
        raise ScriptError(refusal)


def _box_select(window: HeadlessWindow, editor: Editor, step: BoxSelection) -> None:
    """By what is seen in it, as a drag over the picture selects."""
    source = window.shell.source
    assert source is not None
    window.frames(2)
    if source.picture is None:
        raise ScriptError("box_select: there is no picture yet")
    history, size = editor.camera_history, (source.picture.width, source.picture.height)
    box = box_between(step.start, step.to)
    lamps = lamp_places(editor.document, history.resting_box, history.camera, size)
    found = names_in(editor.document, source.objects_in(*box), lamps, box)
    if (refusal := editor.select(boxed(editor.view, found, step.mode))) is not None:
        raise ScriptError(refusal)


def _drag(window: HeadlessWindow, editor: Editor, drag: Drag) -> None:
    if drag.start is not None and drag.to is not None:
        window.drag(drag.start, drag.to)
        return
    assert drag.item is not None and drag.by is not None
    _wait_for_handle(window, drag.item)
    try:
        window.drag_handle(drag.item, drag.by)
    except KeyError as error:
        raise ScriptError(str(error.args[0])) from error


def _wait_for_handle(window: HeadlessWindow, name: str) -> None:
    """Draw frames until the handle is on screen, or the window asks for no further frame: a panel that has just been
    shown, or docked elsewhere, comes after some."""
    window.frames(2)
    for _ in range(LAYOUT_FRAMES):
        if name in window.shell.handles.names() or not window.frame().busy:
            break


def _show(window: HeadlessWindow, editor: Editor, name: str) -> None:
    names = [panel.key for panel in PANELS]
    if name not in names:
        raise ScriptError(f"there is no panel {name!r}; available: {', '.join(names)}")
    window.shell.do(ShowPanel(name))


def _assert_error(window: HeadlessWindow, editor: Editor, bound: float) -> None:
    status = editor.status
    error = status.curve_error if isinstance(status, PlacementStatus) else status.image_error
    if error is None or not error < bound:
        raise ScriptError(f"error of the curve = {error}, expected below {bound:g}")


# The steps that only a window can carry out, by their operator's name.
WINDOW_STEPS: dict[str, Callable[[HeadlessWindow, Editor, Any], None]] = {
    "store_picture": _store_picture, "compare_file": _compare_file,
    "gizmo": _show_gizmo, "snap": _snap, "pivot": _choose_pivot,
    "set": _set, "view": _choose_view, "ocio": _open_config, "drag": _drag, "paint": _paint,
    "paint_highlight": _paint_highlight,
    "match": _match,
    "show": _show, "place_light": _place_light, "move": _move, "aim": _aim, "box_select": _box_select,
    "save_as": _save_session, "save_scene": _save_scene, "export_scene": _export_scene, "picture": _save_picture,
    "wait": wait_for_picture, "capture": _capture, "assert_error_below": _assert_error,
}  # fmt: skip
