"""Suns in the Light panel: their rows edit the document in one step a drag."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.light import SetRotation
from app.document.commands.suns import RenameSun, SetSun, angles_of, direction_of, in_environment, in_world
from app.document.light_state import LightState
from app.document.view_state import OpenPanel
from app.operators.registry import run_operator
from engine.light.suns import Sun
from tests.ui.conftest import opened
from tests.ui.stand_in import SCENE, scene_opened
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl
AT = "light.Noon"


@pytest.fixture
def sunny(context: moderngl.Context, monkeypatch: pytest.MonkeyPatch) -> Iterator[HeadlessWindow]:
    """The stand-in scene with a sun."""
    sun = {"name": "Noon", "direction": [0.0, 1.0, -1.0], "irradiance": [4.0, 2.0, 1.0]}
    monkeypatch.setitem(SCENE, "environment", {"radiance": [0.5, 0.6, 0.8], "sun": [sun]})
    scene_opened.cache_clear()
    yield from opened(context, (1280, 800), 1.0)
    scene_opened.cache_clear()


def the_sun(window: HeadlessWindow) -> Sun:
    (sun,) = window.shell.editor.document.light.suns
    return sun


def make_room(window: HeadlessWindow) -> None:
    """Room for all rows."""
    for other in ("library", "brdf", "accuracy", "plan", "material"):
        window.shell.editor.do(OpenPanel(other, False))
    window.frames(6)


@pytest.mark.parametrize("row", ["azimuth", "elevation", "irradiance", "diameter"])
def test_a_drag_is_one_step_and_a_right_click_goes_back(sunny: HeadlessWindow, row: str) -> None:
    editor = sunny.shell.editor
    make_room(sunny)
    before, n_steps = the_sun(sunny), len(editor.history.undo_steps)
    sunny.drag_handle(f"{AT}.{row}", (12, 0))
    dragged = the_sun(sunny)
    assert dragged != before and len(editor.history.undo_steps) == n_steps + 1
    changed = {name for name in Sun._fields if getattr(dragged, name) != getattr(before, name)}
    assert changed == {{"irradiance": "irradiance", "diameter": "diameter"}.get(row, "direction")}
    if row == "azimuth":  # goes around at the same height
        assert angles_of(dragged.direction)[1] == pytest.approx(45.0)
    if row == "irradiance":  # of the same colour
        assert dragged.irradiance[1] / dragged.irradiance[0] == pytest.approx(0.5)
    sunny.click(*sunny.shell.handle_position(f"{AT}.{row}"), button=1)
    assert the_sun(sunny).direction == pytest.approx(before.direction)
    assert the_sun(sunny).irradiance == pytest.approx(before.irradiance)
    editor.undo()
    editor.undo()
    assert the_sun(sunny) == before and editor.document.light.new_suns is None


def test_a_line_selects_its_sun_and_its_menu_duplicates_and_deletes_it(sunny: HeadlessWindow) -> None:
    editor = sunny.shell.editor
    make_room(sunny)
    editor.select("teapot")
    sunny.frames(2)
    sunny.click(*sunny.shell.handle_position("mix.light.Noon"))
    sunny.frames(2)
    assert editor.view.sun == "Noon" and editor.view.selected is None
    editor.do(OpenPanel("material", True))
    sunny.frames(6)
    before = the_sun(sunny)
    sunny.drag_handle("selected_sun.Noon.elevation", (10, 0))
    assert the_sun(sunny).direction != before.direction and editor.undo() is not None and the_sun(sunny) == before
    editor.do(OpenPanel("material", False))
    sunny.frames(6)
    for entry, names in (("duplicate", ["Noon", "Noon 2"]), ("delete", ["Noon 2"])):
        sunny.click(*sunny.shell.handle_position("mix.light.Noon"), button=1)
        sunny.frames(3)
        sunny.click(*sunny.shell.handle_position(f"{AT}.{entry}"))
        sunny.frames(3)
        assert [sun.name for sun in editor.document.light.suns] == names
    assert editor.view.sun == "Noon 2"  # the duplicate was selected
    run_operator(editor, "delete_object")
    assert editor.document.light.suns == () and editor.view.sun is None
    editor.undo()
    editor.undo()
    editor.undo()
    assert [sun.name for sun in editor.document.light.suns] == ["Noon"]


def test_the_menu_of_an_object_makes_it_a_shadow_catcher(sunny: HeadlessWindow) -> None:
    editor = sunny.shell.editor
    sunny.frames(4)
    for catchers in (("tray",), ()):
        sunny.click(*sunny.shell.handle_position("objects.tray"), button=1)
        sunny.frames(3)
        sunny.click(*sunny.shell.handle_position("objects.tray.shadow_catcher"))
        sunny.frames(3)
        assert editor.document.shadow_catchers == catchers
    editor.undo()
    assert editor.document.shadow_catchers == ("tray",)


def test_a_sun_that_is_added_is_selected_and_follows_its_name(sunny: HeadlessWindow) -> None:
    editor = sunny.shell.editor
    assert run_operator(editor, "add_sun") is None and editor.view.sun == "sun"
    assert editor.do(RenameSun("sun", "key")) is None and editor.view.sun == "key"
    editor.undo()
    assert editor.view.sun == "sun"
    editor.undo()
    assert editor.view.sun is None and editor.document == editor.scene_document


def test_handles_aim_the_selected_sun_in_one_step_each(sunny: HeadlessWindow) -> None:
    """The light is rotated: angles are those of the world, and the sun is placed in the environment's frame."""
    editor = sunny.shell.editor
    editor.do(SetRotation(50.0))
    editor.do(SetSun("Noon", "direction", in_environment(direction_of(30.0, 25.0), LightState(rotation=50.0))))
    editor.select("light.Noon")
    sunny.key(imgui.Key.r)
    sunny.frames(3)

    def angles() -> tuple[float, float]:
        return angles_of(in_world(the_sun(sunny).direction, LightState(rotation=50.0)))

    for handle, by in (("azimuth", (20.0, 4.0)), ("elevation", (0.0, -20.0)), ("aim", (-18.0, 10.0))):
        (azimuth, elevation), n_steps = angles(), len(editor.history.undo_steps)
        start = sunny.shell.handle_position(f"gizmo.{handle}")
        sunny.drag_handle(f"gizmo.{handle}", by)
        sunny.frames(2)
        assert len(editor.history.undo_steps) == n_steps + 1 and editor.history.undo_label == "aim Noon"
        went = np.subtract(sunny.shell.handle_position(f"gizmo.{handle}"), start)
        if handle == "aim":
            assert went == pytest.approx(by, abs=1.5)
        moved = np.abs(np.subtract(angles(), (azimuth, elevation)))
        assert moved[0] > 2.0 if handle == "azimuth" else moved[0] == pytest.approx(0.0, abs=1e-6) or handle == "aim"
        assert moved[1] > 2.0 if handle == "elevation" else moved[1] == pytest.approx(0.0, abs=1e-6) or handle == "aim"


def test_a_sun_in_the_picture_has_a_mark_that_is_grabbed(
    sunny: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    editor = sunny.shell.editor
    monkeypatch.setattr(PictureFeed, "object_at", lambda feed, column, row: None)
    camera = editor.camera_history.camera
    forward = np.subtract(camera.target, camera.position)
    editor.do(SetSun("Noon", "direction", tuple(forward.tolist())))
    middle = sunny.shell.handle_position("viewport.centre")
    sunny.move(*middle)
    sunny.frames(2)
    assert sunny.shell.handle_position("sun.Noon") == pytest.approx(middle, abs=2.0)
    before = the_sun(sunny).direction
    sunny.drag_handle("sun.Noon", (30.0, -20.0))
    sunny.frames(2)
    assert editor.view.sun == "Noon" and the_sun(sunny).direction != before
    assert sunny.shell.handle_position("sun.Noon") == pytest.approx(np.add(middle, (30.0, -20.0)), abs=2.0)
    monkeypatch.setattr(PictureFeed, "object_at", lambda feed, column, row: "teapot")
    editor.select("teapot")
    sunny.frames(2)
    assert "sun.Noon" not in sunny.shell.handles.names()  # the teapot is before it


def test_a_scene_without_suns_has_no_rows(window: HeadlessWindow) -> None:
    assert not window.shell.editor.document.light.suns
    with pytest.raises(KeyError):
        window.shell.handle_position(f"mix.{AT}")
