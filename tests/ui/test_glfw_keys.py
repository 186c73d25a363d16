"""GLFW's keys as imgui's: the modifiers of a press come with it, and letters count, not places."""

from __future__ import annotations

import glfw
import pytest
from imgui_bundle import imgui

from ui.glfw_keys import as_printed, key_changes

Key = imgui.Key


def test_a_press_tells_the_modifiers_it_was_made_with() -> None:
    pressed = key_changes(glfw.KEY_Z, True, glfw.MOD_CONTROL)
    assert pressed[-1] == (Key.z, True)
    assert dict(pressed[:-1]) == {
        Key.mod_ctrl: True, Key.mod_shift: False, Key.mod_alt: False, Key.mod_super: False
    }  # fmt: skip
    assert key_changes(glfw.KEY_Z, False, 0) == [(Key.z, False)]
    # A modifier's own event names those held before it.
    assert key_changes(glfw.KEY_LEFT_SHIFT, True, 0) == [(Key.left_shift, True), (Key.mod_shift, True)]
    assert key_changes(glfw.KEY_WORLD_1, True, 0)[4:] == []


@pytest.mark.parametrize(
    ("place", "name", "key"),
    [
        (glfw.KEY_Y, "z", glfw.KEY_Z),  # a German keyboard's Z
        (glfw.KEY_Q, "a", glfw.KEY_A),  # a French keyboard's A
        (glfw.KEY_RIGHT_BRACKET, "+", glfw.KEY_RIGHT_BRACKET),
        (glfw.KEY_A, "ф", glfw.KEY_A),  # a Russian layout has no Latin letter there
        (glfw.KEY_KP_1, "1", glfw.KEY_KP_1),
        (glfw.KEY_ESCAPE, "", glfw.KEY_ESCAPE),
        (glfw.KEY_SLASH, None, glfw.KEY_SLASH),
    ],
)
def test_shortcuts_go_by_what_is_printed_on_a_key(place: int, name: str | None, key: int) -> None:
    assert as_printed(place, name) == key
