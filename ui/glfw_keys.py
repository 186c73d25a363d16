"""GLFW's keys as imgui's: one table, made from the names that both libraries share."""

from __future__ import annotations

import string

import glfw
from imgui_bundle import imgui

Key = imgui.Key

_NAMED = {
    "TAB": Key.tab,
    "ENTER": Key.enter,
    "KP_ENTER": Key.keypad_enter,
    "ESCAPE": Key.escape,
    "BACKSPACE": Key.backspace,
    "INSERT": Key.insert,
    "DELETE": Key.delete,
    "SPACE": Key.space,
    "LEFT": Key.left_arrow,
    "RIGHT": Key.right_arrow,
    "UP": Key.up_arrow,
    "DOWN": Key.down_arrow,
    "PAGE_UP": Key.page_up,
    "PAGE_DOWN": Key.page_down,
    "HOME": Key.home,
    "END": Key.end,
    "LEFT_BRACKET": Key.left_bracket,
    "RIGHT_BRACKET": Key.right_bracket,
    "SLASH": Key.slash,
    "MINUS": Key.minus,
    "EQUAL": Key.equal,
    "COMMA": Key.comma,
    "PERIOD": Key.period,
    "F1": Key.f1,
    "F12": Key.f12,
}
_MODIFIERS = {
    "CONTROL": (Key.left_ctrl, Key.right_ctrl, Key.mod_ctrl),
    "SHIFT": (Key.left_shift, Key.right_shift, Key.mod_shift),
    "ALT": (Key.left_alt, Key.right_alt, Key.mod_alt),
    "SUPER": (Key.left_super, Key.right_super, Key.mod_super),
}


def _table() -> dict[int, tuple[imgui.Key, ...]]:
    keys: dict[int, tuple[imgui.Key, ...]] = {getattr(glfw, f"KEY_{name}"): (key,) for name, key in _NAMED.items()}
    for letter in string.ascii_uppercase:
        keys[getattr(glfw, f"KEY_{letter}")] = (getattr(Key, letter.lower()),)
    for digit in string.digits:
        keys[getattr(glfw, f"KEY_{digit}")] = (getattr(Key, f"_{digit}"),)
        keys[getattr(glfw, f"KEY_KP_{digit}")] = (getattr(Key, f"keypad{digit}"),)
    for name, (left, right, modifier) in _MODIFIERS.items():
        keys[getattr(glfw, f"KEY_LEFT_{name}")] = (left, modifier)
        keys[getattr(glfw, f"KEY_RIGHT_{name}")] = (right, modifier)
    return keys


KEYS = _table()
"""For each GLFW key the imgui keys it presses; a modifier presses itself and its role."""
