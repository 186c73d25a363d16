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
    "KP_DECIMAL": Key.keypad_decimal,
    "KP_ADD": Key.keypad_add,
    "KP_SUBTRACT": Key.keypad_subtract,
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


# For each GLFW key the imgui keys it presses; a modifier presses itself and its role.
KEYS = _table()
_ROLES = (
    (glfw.MOD_CONTROL, Key.mod_ctrl), (glfw.MOD_SHIFT, Key.mod_shift), (glfw.MOD_ALT, Key.mod_alt),
    (glfw.MOD_SUPER, Key.mod_super),
)  # fmt: skip
# Their GLFW keys are their ASCII codes.
_PRINTED = frozenset(string.ascii_uppercase + "-=[]\\,;'./`")
_MODIFIER_KEYS = frozenset(getattr(glfw, f"KEY_{side}_{name}") for name in _MODIFIERS for side in ("LEFT", "RIGHT"))


def as_printed(key: int, name: str | None) -> int:
    """The key by what is printed on it: GLFW's keys are places on an American keyboard, shortcuts use letters.

    `name` is the layout's character at the key's place; where that is no Latin letter the place counts.
    """
    return ord(name.upper()) if name and len(name) == 1 and name.upper() in _PRINTED else key


def key_changes(key: int, pressed: bool, modifiers: int) -> list[tuple[imgui.Key, bool]]:
    """The events for imgui of a key event of GLFW, in order: the modifiers come before the key."""
    parts = [(part, pressed) for part in KEYS.get(key, ())]
    return parts if key in _MODIFIER_KEYS or not pressed else [*held(modifiers), *parts]


def held(modifiers: int) -> list[tuple[imgui.Key, bool]]:
    """Which modifiers are held, by GLFW's bits."""
    return [(role, bool(modifiers & bit)) for bit, role in _ROLES]
