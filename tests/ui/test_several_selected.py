"""Several objects selected by the mouse: in the picture and in the list, and what the list's switches do to them."""

from __future__ import annotations

import pytest
from imgui_bundle import imgui

from app.editor.editor import Editor
from ui.gl.display import OTHERS_COLOUR, SELECTION_COLOUR
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl
CTRL, SHIFT = imgui.Key.mod_ctrl, imgui.Key.mod_shift


def held_click(window: HeadlessWindow, place: str | tuple[float, float], *held: imgui.Key) -> None:
    """A click with keys held."""
    window.frame()
    x, y = window.shell.handle_position(place) if isinstance(place, str) else place
    window.move(x, y)
    for key in held:
        window.hold(key, True)
    window.click(x, y)
    for key in held:
        window.hold(key, False)
    window.frames(2)


def stripe(window: HeadlessWindow, number: int) -> tuple[float, float]:
    """A place in the picture on one of its four stripes: teapot, tray, wall, lamp."""
    left, middle = window.shell.handle_position("viewport.corner"), window.shell.handle_position("viewport.centre")
    width = 2.0 * (middle[0] - left[0])
    return left[0] + (number + 0.5) / 4.0 * width, middle[1]


def names(window: HeadlessWindow) -> tuple[str, ...]:
    return window.shell.editor.view.selected_objects


@pytest.mark.parametrize("key", [SHIFT, CTRL])
def test_clicks_in_the_picture_select_more(window: HeadlessWindow, key: imgui.Key) -> None:
    editor: Editor = window.shell.editor
    held_click(window, stripe(window, 1), key)
    held_click(window, stripe(window, 3), key)
    assert names(window) == ("teapot", "tray", "lamp")
    held_click(window, stripe(window, 3), key)
    assert names(window) == ("teapot", "tray")
    held_click(window, stripe(window, 0), key)
    assert names(window) == ("tray", "teapot")
    held_click(window, stripe(window, 2))
    assert names(window) == ("wall",) and not editor.history.undo_steps


def test_a_drag_with_shift_still_turns_the_light(window: HeadlessWindow) -> None:
    x, y = stripe(window, 1)
    window.move(x, y)
    window.hold(SHIFT, True)
    window.drag((x, y), (x + 60.0, y))
    window.hold(SHIFT, False)
    assert names(window) == ("teapot",) and window.shell.editor.document.light.rotation != 0.0


def test_clicks_in_the_list_add_and_select_a_range(window: HeadlessWindow) -> None:
    held_click(window, "objects.tray", CTRL)
    assert names(window) == ("teapot", "tray")
    held_click(window, "objects.teapot")
    held_click(window, "objects.lamp", SHIFT)
    assert names(window) == ("tray", "wall", "lamp", "teapot")
    held_click(window, "objects.wall", CTRL)
    held_click(window, "objects.wall", CTRL)
    assert names(window) == ("tray", "lamp", "teapot")


def test_a_switch_of_one_sets_all_that_are_selected_in_one_step(window: HeadlessWindow) -> None:
    editor: Editor = window.shell.editor
    editor.select(("tray", "lamp", "teapot"))
    window.frames(2)
    window.click_handle("button.visible.tray")
    assert [state.visible for state in editor.document.objects] == [False, False, True, False]
    window.click_handle("button.frozen.wall")
    assert [state.frozen for state in editor.document.objects] == [False, False, True, False]
    assert [step.label for step in editor.history.undo_steps] == ["hide 3 objects", "freeze wall"]


def test_a_click_selects_the_group_and_a_double_click_one_of_it(window: HeadlessWindow) -> None:
    editor: Editor = window.shell.editor
    held_click(window, stripe(window, 2), SHIFT)
    window.key(imgui.Key.g, CTRL)
    assert editor.document.groups == {"Group": ("teapot", "wall")}
    window.frames(30)  # no double click
    held_click(window, stripe(window, 1))
    assert names(window) == ("tray",)
    window.frames(30)
    held_click(window, stripe(window, 0))
    assert names(window) == ("wall", "teapot")
    held_click(window, stripe(window, 0))
    assert names(window) == ("teapot",)
    window.frames(30)
    held_click(window, stripe(window, 2))
    assert names(window) == ("wall",)
    window.key(imgui.Key.g, CTRL, imgui.Key.mod_alt)
    assert editor.document.groups == {} and len(editor.history.undo_steps) == 2


def test_the_row_of_a_group_selects_shows_freezes_and_folds_it(window: HeadlessWindow) -> None:
    editor: Editor = window.shell.editor
    editor.select(("lamp", "teapot"))
    window.key(imgui.Key.g, CTRL)
    window.frames(2)
    held_click(window, "objects.tray")
    held_click(window, "objects.groups.Group")
    assert names(window) == ("teapot", "lamp")
    held_click(window, "button.visible.groups.Group")
    held_click(window, "button.frozen.groups.Group")
    assert [(each.visible, each.frozen) for each in editor.document.objects] == [
        (False, True), (True, False), (True, False), (False, True)
    ]  # fmt: skip
    labels = [step.label for step in editor.history.undo_steps]
    assert labels == ["group 2 objects", "hide Group", "freeze Group"]
    rows = set(window.shell.handles.names())
    held_click(window, "arrow.groups.Group")
    assert rows - set(window.shell.handles.names()) >= {"objects.lamp", "objects.teapot", "button.visible.lamp"}
    x, y = window.shell.handle_position("objects.groups.Group")
    window.click(x, y, 1)
    window.frames(2)
    held_click(window, "groups.Group.ungroup_selected")
    assert editor.document.groups == {}


def test_all_that_are_selected_are_outlined(window: HeadlessWindow) -> None:
    """The active one brighter than the others."""
    feed = window.shell.source
    assert feed is not None

    def outlined(colour: tuple[float, float, float]) -> bool:
        shown = feed.source.renderer.display_image()[..., :3]  # type: ignore[attr-defined]
        return bool((abs(shown / 255.0 - colour) < 0.01).all(axis=-1).any())

    assert outlined(SELECTION_COLOUR) and not outlined(OTHERS_COLOUR)
    window.shell.editor.select(("tray", "lamp", "teapot"))
    window.frames(2)
    assert outlined(SELECTION_COLOUR) and outlined(OTHERS_COLOUR)
