"""Scripts run through the window: the same events as a hand, and what is said when a step cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.messages.worker_messages import Request, Response
from app.modes.placement.placement_messages import ErrorEstimated, EstimateError
from app.operators.script import Step, load_script
from engine.core.errors import InsituError
from engine.curve.operators import Operator
from engine.render.picture_error import ErrorEstimate
from engine.scene.surface_spot import SurfaceSpot
from engine.scene.transform import rotation_matrix
from tests.app.limits import largest_file
from tests.ui.stand_in import StandInClient
from ui.headless import HeadlessWindow
from ui.panels import brdf
from ui.panels.actions import Action
from ui.panels.context import PanelContext
from ui.picture_feed import PictureFeed
from ui.script_runner import ScriptError, run_steps, take_screenshot

pytestmark = pytest.mark.gl

SCRIPT = """
[[step]]
select = "teapot.1.theta_h"
[[step]]
drag = { item = "curve.b", by = [-20, 0] }
[[step]]
drag = { item = "curve.magnitude", by = [0, -40] }
[[step]]
set = { "teapot.1.alpha" = 0.3 }
[[step]]
show = "brdf"
[[step]]
drag = { item = "brdf.light", by = [10, 5] }
[[step]]
rotate = 45.0
[[step]]
wait = "exact"
[[step]]
assert_error_below = 0.01
[[step]]
capture = "edited.png"
[[step]]
undo = 3
[[step]]
capture = "undone.png"
[[step]]
redo = 1
"""


def write(folder: Path, text: str) -> Path:
    file = folder / "edits.toml"
    file.write_text(text)
    return file


def run(window: HeadlessWindow, folder: Path, text: str) -> None:
    run_steps(window, window.shell.editor, load_script(write(folder, text)))


def test_a_script_edits_captures_and_undoes(window: HeadlessWindow, tmp_path: Path) -> None:
    run(window, tmp_path, SCRIPT)
    document = window.shell.editor.document
    (made,) = document.layer("teapot.1").operators("theta_h")
    assert isinstance(made, Operator) and made.magnitude > 0.0
    # Undo took back rotation, alpha and the ring; redo brought the ring's drag again.
    assert document.light.rotation == 0.0
    assert document.layer("teapot.1").values["alpha"] == 0.2
    edited, undone = (np.asarray(Image.open(tmp_path / f"{name}.png"), dtype=int) for name in ("edited", "undone"))
    assert edited.shape == undone.shape == (800, 1280, 3)
    # The curve's plot differs by what was edited.
    assert np.abs(edited[450:770, 230:730] - undone[450:770, 230:730]).max() > 100


def test_a_drag_waits_for_a_panel_that_comes_late(
    window: HeadlessWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn, n_left = brdf.draw, 12

    def late(context: PanelContext) -> list[Action]:
        nonlocal n_left
        n_left -= 1
        if n_left > 0:
            window.shell.pacing.note_input()  # it is still being laid out: the window asks for another frame
            return []
        return drawn(context)

    monkeypatch.setattr(brdf, "draw", late)
    before = window.shell.editor.view.lobe_angle
    run(window, tmp_path, '[[step]]\nshow = "brdf"\n[[step]]\ndrag = { item = "brdf.light", by = [10, 5] }\n')
    assert window.shell.editor.view.lobe_angle != before


def test_a_script_waits_for_the_error_estimate(
    window: HeadlessWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = StandInClient._answers

    def judged(client: StandInClient, request: Request) -> list[Response]:
        return [ErrorEstimated(ErrorEstimate(0.02))] if isinstance(request, EstimateError) else answers(client, request)

    monkeypatch.setattr(StandInClient, "_answers", judged)
    status = window.shell.editor.status
    assert status.is_finished and status.estimate is None
    run(window, tmp_path, "[[step]]\nwait = 'error'\n")
    assert window.shell.editor.status.estimate == ErrorEstimate(0.02)


def test_a_script_chooses_the_series(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    series = '[[step]]\nset = { "series.bounces" = 3, "series.first" = 128, "series.second" = 8 }\n'
    run(window, tmp_path, series)
    view = editor.view
    assert (view.settings.n_bounces, editor.document.first_bands, view.settings.second_bands) == (3, 128, 8)
    # 64 × 16 as planned for the coat, 16 for the base: with 128 for the sharpest, what varies slowly stays.
    assert [len(values) for values in editor.controller.picture.wanted_coefficients("teapot.1").values()] == [128, 16]
    assert [len(values) for values in editor.controller.picture.wanted_coefficients("teapot.0").values()] == [16]
    run(window, tmp_path, '[[step]]\nundo = 1\n[[step]]\nset = { "series.second" = "all" }\n')
    assert editor.document.first_bands is None and editor.view.settings.second_bands is None


def test_a_script_overrides_the_plan(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    lines = 'lights = 600, edges = "off", rays = 256, "teapot.coat.theta_h" = 32'
    run(window, tmp_path, f"[[step]]\noverride = {{ {lines} }}\n")
    assert dict(editor.document.overrides) == {"lights": 600, "edges": 0, "rays": 256, "teapot.1.theta_h": 32}
    assert len(editor.controller.picture.wanted_coefficients("teapot.1")["theta_h"]) == 32
    run(window, tmp_path, '[[step]]\nundo = 1\n[[step]]\noverride = { lights = "auto" }\n')
    assert dict(editor.document.overrides) == {"edges": 0, "rays": 256}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[[step]]\ndrag = { item = "curve.nose", by = [1, 1] }', "step 1: no handle 'curve.nose'"),
        ('[[step]]\nselect = "teapot.1.theta_x"', "step 1: there is no"),
        ("[[step]]\noverride = { lamps = 3 }", "step 1: the plan has no line 'lamps'"),
        ('[[step]]\nset = { "teapot.1.alpha" = 7.0 }', "alpha"),
        ('[[step]]\nset = { "series.first" = 48 }', "one of 1, 2, 4"),
        ('[[step]]\nset = { "series.second" = 2 }', "1, 8, 16 or all"),
        ('[[step]]\nset = { "series.bounces" = 0 }', "from 1 to 8"),
        ("[[step]]\nundo = 5", "step 1: nothing to undo"),
        ("[[step]]\nshow = 'lamp'", "step 1: there is no panel 'lamp'; available: objects"),
        ("[[step]]\nassert_error_below = 1e-30", "step 1: error of the curve"),
    ],
)
def test_a_step_that_cannot_be_is_named(window: HeadlessWindow, tmp_path: Path, text: str, words: str) -> None:
    before = window.shell.editor.document
    with pytest.raises(ScriptError) as caught:
        run(window, tmp_path, text)
    assert words in str(caught.value)
    assert window.shell.editor.document == before


def test_a_screenshot_is_the_whole_window(tmp_path: Path) -> None:
    output = tmp_path / "pictures" / "ui.png"
    client = StandInClient()
    take_screenshot("stand-in", output, size=(1000, 700), client=client)
    image = np.asarray(Image.open(output))
    assert image.shape == (700, 1000, 3)
    # Something of everything: not one flat colour.
    assert image.std() > 20.0
    assert client.closed


NOT_WRITTEN = "{}: not written, File too large; what was there is untouched"


def test_a_picture_that_was_there_survives_a_full_disk(tmp_path: Path) -> None:
    output, client = tmp_path / "ui.png", StandInClient()
    output.write_bytes(b"hours of work")
    with largest_file(1000), pytest.raises(InsituError) as caught:
        take_screenshot("stand-in", output, size=(640, 480), client=client)
    assert str(caught.value) == NOT_WRITTEN.format(output) and client.closed
    assert output.read_bytes() == b"hours of work" and not list(tmp_path.glob(".*"))


def test_a_captured_picture_survives_a_full_disk(window: HeadlessWindow, tmp_path: Path) -> None:
    output = tmp_path / "step.png"
    output.write_bytes(b"hours of work")
    with largest_file(1000), pytest.raises(ScriptError) as caught:
        run_steps(window, window.shell.editor, [Step("capture", output)])
    assert str(caught.value) == "step 1: " + NOT_WRITTEN.format(output)
    assert output.read_bytes() == b"hours of work" and not list(tmp_path.glob(".*"))


def test_a_script_imports_what_was_measured(window: HeadlessWindow, tmp_path: Path) -> None:
    before = window.shell.editor.document
    step = '[[step]]\nselect = "teapot"\n[[step]]\nmeasured = {{ file = "{}"{} }}\n'
    for further, names in (("", ["measured_diffuse", "measured"]), (", cloth = true", ["measured_cloth"])):
        run(window, tmp_path, step.format(tmp_path / "velvet.binary", further))
        assert [layer.model.name for layer in window.shell.editor.document.object("teapot").layers] == names
    run(window, tmp_path, "[[step]]\nundo = 2")
    assert window.shell.editor.document.objects == before.objects
    run(window, tmp_path, '[[step]]\nset = { "teapot.frozen" = true }')
    with pytest.raises(ScriptError, match="step 2: .*frozen"):
        run(window, tmp_path, step.format("velvet.binary", ""))


CAMERA = """
[[step]]
camera = { side = "front", orbit = [90, 30], dolly = 0.5, focal = 12 }
[[step]]
save_view = "Aside"
[[step]]
camera = { frame = "teapot", pan = [0.5, 0.0] }
[[step]]
camera = { frame = "all", level = true }
[[step]]
undo_view = 1
[[step]]
view = "Aside"
[[step]]
view = "AgX"
[[step]]
save_view = "Aside"
"""


def test_a_script_moves_the_camera_keeps_views_and_goes_to_them(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    run(window, tmp_path, CAMERA)
    # From +Z at 4.03 m a quarter to the right is +X; 30 degrees up; half as far. 12 mm see 90 degrees.
    half = 0.5 * np.hypot(4.0, 0.5)
    assert editor.camera_history.camera.position == pytest.approx(
        (half * np.cos(np.pi / 6), 0.5 + half * 0.5, 0.0), abs=1e-6
    )
    assert editor.camera_history.camera.fov_y == pytest.approx(90.0) and editor.view.tone_mapping == "agx"
    assert [each.name for each in editor.view.bookmarks] == ["Aside"]
    steps = [step.label for step in editor.camera_history.history.undo_steps]
    assert steps == ["camera", "camera", "Aside"] and not editor.history.undo_steps


@pytest.mark.parametrize(
    ("step", "says"),
    [
        ('view = "sepia"', "step 1: there is no view 'sepia'; saved views: none yet"),
        ('camera = { frame = "spoon" }', "step 1: there is no object 'spoon' to be framed; available: teapot"),
        ("undo_view = 1", "step 1: nothing to undo in the view"),
    ],
)
def test_what_a_camera_step_cannot_do_is_said(window: HeadlessWindow, tmp_path: Path, step: str, says: str) -> None:
    with pytest.raises(ScriptError, match=says):
        run(window, tmp_path, f"[[step]]\n{step}")


def test_a_script_drags_the_gizmo(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    boxes = np.tile([[-0.3, 0.0, -0.3], [0.3, 1.0, 0.3]], (len(editor.document.objects), 1, 1))
    editor.camera_history.scene_opened(editor.scenes.opened.description, boxes)
    steps = ('select = "teapot"', 'gizmo = "move"', 'drag = { item = "gizmo.y", by = [0, -30] }', 'gizmo = "none"')
    run(window, tmp_path, "".join(f"[[step]]\n{step}\n" for step in steps))
    assert editor.document.object("teapot").transform.translation[1] > 0.0 and window.shell.state.gizmo == ""


def test_a_script_stands_an_object_on_a_surface_and_aims_a_lamp(
    window: HeadlessWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    editor = window.shell.editor
    boxes = np.tile([[-0.3, 0.0, -0.3], [0.3, 1.0, 0.3]], (len(editor.document.objects), 1, 1))
    editor.camera_history.scene_opened(editor.scenes.opened.description, boxes)
    place, normal = np.array([2.0, 0.3, 1.0]), np.array([0.0, 0.0, 1.0])
    monkeypatch.setattr(PictureFeed, "spot_at", lambda feed, *at: SurfaceSpot(place, normal, 0.1))
    run(window, tmp_path, '[[step]]\nmove = { object = "teapot", onto = [40, 4] }')
    found = editor.document.object("teapot").transform
    # The centre was at (0, 0.5, 0); it is half the box's depth before the wall.
    assert found.translation == pytest.approx((2.0, -0.2, 1.3)) and not any(found.rotation)
    run(window, tmp_path, '[[step]]\nmove = { object = "teapot", onto = [40, 4], align = true }')
    found = editor.document.object("teapot").transform
    # What was up points along Z, half a metre before the wall.
    assert found.rotation == pytest.approx((90.0, 0.0, 0.0)) and found.translation[2] == pytest.approx(1.5)
    for how in ("at = [0.0, 0.5, -3.0]", "onto = [4, 4]"):
        run(window, tmp_path, f'[[step]]\naim = {{ light = "lamp", {how} }}')
        # The lamp stands at a height of 2 m.
        towards = np.array([0.0, -1.5, -3.0]) if how.startswith("at") else place - (0.0, 2.0, 0.0)
        facing = rotation_matrix(editor.document.object("lamp").transform.rotation) @ (0.0, 0.0, 1.0)
        assert facing == pytest.approx(towards / np.linalg.norm(towards))
    for step, says in (
        ('aim = { light = "teapot", at = [0, 0, 0] }', "teapot shines to all sides or not at all"),
        ('aim = { light = "lamp" }', "exactly one of at and onto"),
        ('move = { object = "teapot", onto = [4, 4] }', "sees what is moved"),
        ('drop = "cup"', "no object 'cup'"),
    ):
        with pytest.raises(InsituError, match=says):
            run(window, tmp_path, f"[[step]]\n{step}")


def test_a_script_places_a_light(window: HeadlessWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    editor = window.shell.editor
    boxes = np.tile([[-0.3, 0.0, -0.3], [0.3, 1.0, 0.3]], (len(editor.document.objects), 1, 1))
    editor.camera_history.scene_opened(editor.scenes.opened.description, boxes)
    places = {(4, 4): (0.0, 0.0, 0.0), (5, 9): (0.0, -1.0, 0.0)}
    monkeypatch.setattr(
        PictureFeed, "spot_at",
        lambda feed, *at: SurfaceSpot(np.array(places[at]), np.array([0.0, 0.6, 0.8]), 0.1) if at in places else None,
    )  # fmt: skip
    run(window, tmp_path, '[[step]]\nplace_light = { light = "lamp", shadow = [[4, 4], [5, 9]] }')
    found = editor.document.object("lamp").transform
    # The light, half a metre above the floor, is as far from what casts the shadow as before, and straight above it.
    assert found.translation == pytest.approx((0.0, 0.0, 0.0)) and found.rotation != (0.0, 0.0, 0.0)
    run(window, tmp_path, '[[step]]\nplace_light = { light = "lamp", highlight = [4, 4] }')
    assert editor.document.object("lamp").transform != found
    run(window, tmp_path, '[[step]]\nadd = { light = "sun", name = "key" }')
    caster, receiver = (np.array(places[at]) for at in ((4, 4), (5, 9)))
    for name in ("key", "light.key"):
        run(window, tmp_path, f'[[step]]\nplace_light = {{ light = "{name}", shadow = [[4, 4], [5, 9]] }}')
        towards = editor.document.light.suns[-1].direction
        np.testing.assert_allclose(towards, (caster - receiver) / np.linalg.norm(caster - receiver), atol=1e-9)
        run(window, tmp_path, f'[[step]]\nplace_light = {{ light = "{name}", highlight = [4, 4] }}')
        assert editor.document.light.suns[-1].direction != towards
    assert isinstance(editor._client, StandInClient)
    editor._client.light_path = "lamp is placed, but teapot hides it from that point"
    run(window, tmp_path, '[[step]]\nplace_light = { light = "lamp", shadow = [[4, 4], [5, 9]] }')
    assert editor.status.message == editor._client.light_path and not editor.status.is_error
    for step, says in (
        ('light = "lamp", highlight = [1, 1]', "pixel 1, 1 sees no surface"),
        ('light = "lamp", shadow = [[4, 4], [4, 4]]', "lamp stays where it is: drag from"),
        ('light = "teapot", highlight = [4, 4]', "teapot is no light"),
        ('light = "lamp"', "exactly one of highlight and shadow"),
    ):
        with pytest.raises(InsituError, match=says):
            run(window, tmp_path, f"[[step]]\nplace_light = {{ {step} }}")
