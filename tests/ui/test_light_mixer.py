"""The mix of lights in the Light panel: a drag is one step, buttons switch, groups come and go."""

from __future__ import annotations

import pytest
from imgui_bundle import imgui

from app.document.light_mix import gains_of
from app.document.view_state import OpenPanel
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl
LIGHTS = ("light.environment", "lamp")


@pytest.fixture
def mixer(window: HeadlessWindow) -> HeadlessWindow:
    for other in ("library", "brdf", "accuracy", "plan", "material"):  # room for all rows
        window.shell.editor.do(OpenPanel(other, False))
    window.frames(6)
    return window


def click(window: HeadlessWindow, handle: str, button: int = 0) -> None:
    window.click(*window.shell.handle_position(handle), button=button)
    window.frames(2)


@pytest.mark.parametrize("light", LIGHTS)
def test_a_drag_of_the_strength_is_one_step_and_a_right_click_goes_back(mixer: HeadlessWindow, light: str) -> None:
    editor = mixer.shell.editor
    before, n_steps = editor.document, len(editor.history.undo_steps)
    mixer.drag_handle(f"mix.{light}.strength", (25, 0))
    assert editor.document.light.row(light).strength > 0.0 and len(editor.history.undo_steps) == n_steps + 1
    click(mixer, f"mix.{light}.strength", button=1)
    assert editor.document == before
    editor.undo()
    editor.undo()
    assert editor.document == before


@pytest.mark.parametrize("light", LIGHTS)
def test_buttons_switch_a_light_off_and_make_it_solo(mixer: HeadlessWindow, light: str) -> None:
    editor, black = mixer.shell.editor, (0.0, 0.0, 0.0)
    click(mixer, f"button.mix.{light}.on")
    assert {key for key, gain in gains_of(editor.document).items() if gain == black} == {light}
    click(mixer, f"button.mix.{light}.on")
    click(mixer, f"button.mix.{light}.solo")
    assert {key for key, gain in gains_of(editor.document).items() if gain != black} == {light}
    click(mixer, f"button.mix.{light}.solo")
    assert editor.document.light.mix == ()


def test_the_environment_is_split_into_sides_and_joined(mixer: HeadlessWindow) -> None:
    editor, before = mixer.shell.editor, mixer.shell.editor.document
    click(mixer, "mix.light.environment")
    click(mixer, "mix.light.environment.sides")
    assert editor.document.light.sides
    mixer.drag_handle("mix.light.sides.up.strength", (25, 0))
    assert editor.document.light.row("light.sides.up").strength > 0.0
    click(mixer, "mix.light.environment.sides")
    assert editor.document == before
    for _ in range(3):
        editor.undo()
    assert editor.document == before and not editor.history.undo_steps


def test_an_opened_line_has_temperature_colour_and_group(mixer: HeadlessWindow) -> None:
    editor = mixer.shell.editor
    click(mixer, "mix.lamp")
    mixer.drag_handle("mix.lamp.kelvin", (-30, 0))
    kelvin = editor.document.light.row("lamp").kelvin
    assert 1700.0 <= kelvin < 6500.0
    red, _, blue = gains_of(editor.document)["lamp"]
    assert red > blue
    click(mixer, "mix.lamp.group")
    click(mixer, "mix.lamp.group.A new group")
    assert editor.document.light.row("lamp").group == "Group 1"
    mixer.drag_handle("mix.light.groups.Group 1.strength", (25, 0))
    assert editor.document.light.row("light.groups.Group 1").strength > 0.0
    click(mixer, "mix.light.groups.Group 1")
    click(mixer, "mix.light.groups.Group 1.name")
    mixer.type("Key")
    mixer.key(imgui.Key.enter)
    mixer.frames(2)
    assert editor.document.light.groups == ("Key",)
    click(mixer, "mix.lamp.kelvin", button=1)
    assert editor.document.light.row("lamp").kelvin == 0.0


def test_ticks_link_a_light_to_objects(mixer: HeadlessWindow) -> None:
    editor = mixer.shell.editor
    click(mixer, "mix.lamp")
    click(mixer, "mix.lamp.excludes")
    name = next(state.name for state in editor.document.objects if not state.is_lamp)
    n_steps = len(editor.history.undo_steps)
    click(mixer, f"mix.lamp.excludes.{name}")
    assert editor.document.light.row("lamp").excludes == (name,)
    assert len(editor.history.undo_steps) == n_steps + 1
    click(mixer, f"mix.lamp.excludes.{name}")
    assert editor.document.light.mix == ()
