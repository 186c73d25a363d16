"""Operators in the window: each key is handled, each menu entry drawn, and what only a window can do is done."""

from __future__ import annotations

from typing import Any

import pytest
from imgui_bundle import imgui

from app.document.commands.curves import SetOperators
from app.document.view_state import SetView
from app.operators.operator import Gesture
from app.operators.registry import GROUPS, MENUS, OPERATORS, Menu
from engine.curve.operators import Operator
from engine.scene.builtin import DEFAULT_SCENE
from ui.headless import HeadlessWindow
from ui.panels import menus, shortcuts
from ui.panels.actions import OpenFile, Quit
from ui.panels.window_operators import ALT, CTRL, SHIFT, WINDOW_OPERATORS, chord_of, perform
from ui.script_runner import WINDOW_STEPS

pytestmark = pytest.mark.gl

LIFT = Operator("translate", "y", 0.2, 0.4, 0.6, 0.8, magnitude=0.5)
LEAVING = {"new": [OpenFile(DEFAULT_SCENE)], "quit": [Quit()]}
MODIFIERS = {CTRL: imgui.Key.mod_ctrl, SHIFT: imgui.Key.mod_shift, ALT: imgui.Key.mod_alt}


def press(window: HeadlessWindow, keys: str) -> None:
    chord = chord_of(keys)
    held = [key for bit, key in MODIFIERS.items() if chord & bit]
    window.key(imgui.Key(chord & ~(CTRL | SHIFT | ALT)), *held)


def test_each_key_invokes_its_operator_alone(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    invoked: list[str] = []
    monkeypatch.setattr(shortcuts, "perform", lambda context, name: invoked.append(name) or [])
    monkeypatch.setattr(shortcuts, "play_or_leave_alone", lambda context: invoked.append("alone") or [])
    chords = [chord_of(keys) for each in OPERATORS.values() for keys in each.keys]
    assert len(set(chords)) == len(chords) > 40
    for name, operator in OPERATORS.items():
        for keys in operator.keys:
            invoked.clear()
            press(window, keys)
            assert invoked == [name], keys


def test_a_gesture_keeps_its_ground(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    """Keys that would change what a drag began from do nothing while it lasts; others do."""
    invoked: list[str] = []
    monkeypatch.setattr(shortcuts, "perform", lambda context, name: invoked.append(name) or [])
    window.frame()
    window.move(*window.shell.handle_position("curve.line"))
    window.press()
    window.move(*[place - 20.0 for place in window.shell.handle_position("curve.plot")])
    assert window.shell.state.grip is not None
    for keys in ("Ctrl Z", "Delete", "F", "C"):
        press(window, keys)
    assert invoked == ["compare"]
    window.release()


def test_who_carries_out_an_operator_is_known() -> None:
    for name, operator in OPERATORS.items():
        by_window = name in WINDOW_OPERATORS or name in WINDOW_STEPS or name in menus.CHOICES
        assert operator.run is not None or by_window, name
    for name in (*WINDOW_OPERATORS, *WINDOW_STEPS, *menus.CHOICES):
        assert name in OPERATORS
    assert not any(each.name in WINDOW_STEPS for each in OPERATORS.values() if each.script is None)
    assert all(isinstance(each, Gesture) or each.name in OPERATORS for group in GROUPS.values() for each in group)


def drawn_in(window: HeadlessWindow, menu: Menu) -> set[str]:
    """What an open menu draws, and the menus within it."""
    drawn = set(window.shell.handles.names())
    for inner in (row for row in menu.rows if isinstance(row, Menu)):
        window.click_handle(f"menu.{inner.title}")
        drawn |= drawn_in(window, inner)
    return drawn


@pytest.mark.parametrize("menu", MENUS, ids=lambda menu: menu.title)
def test_every_entry_is_in_its_menu(window: HeadlessWindow, menu: Menu) -> None:
    window.click_handle(f"menu.{menu.title}")
    drawn = drawn_in(window, menu)
    names = [name for name in menu.names() if name not in menus.CHOICES]
    assert names and {f"menu.{name}" for name in names} <= drawn


def test_an_entry_that_cannot_be_chosen_says_why(window: HeadlessWindow) -> None:
    window.click_handle("menu.Edit")
    window.click_handle("menu.undo")
    assert not window.shell.editor.history.redo_steps and "menu.undo" in window.shell.handles.names()
    window.key(imgui.Key.escape)
    window.key(imgui.Key.z, imgui.Key.mod_ctrl)
    message = window.shell.state.message
    assert message is not None and (message.text, message.is_error) == ("nothing to undo", False)


def test_each_operator_of_the_window_does_something(window: HeadlessWindow) -> None:
    shell, editor = window.shell, window.shell.editor
    editor.do(SetOperators("teapot.1", "theta_h", (LIFT,)))
    editor.do(SetView.of(operator=0))
    window.frame()

    def state() -> tuple[Any, ...]:
        return editor.document, editor.view, imgui.get_clipboard_text()

    for name in sorted(WINDOW_OPERATORS):
        if name in ("axis_y", "translate"):  # the tool that it is already
            shell.do(*perform(shell._context(0.0), "axis_x"), *perform(shell._context(0.0), "amplify"))
        if name in ("pivot_middle", "pivot_own"):  # the pivot that it is already
            shell.do(*perform(shell._context(0.0), "pivot_active"))
        if name == "paste":  # what is on the clipboard is the material as it was with its edit
            shell.do(*perform(shell._context(0.0), "copy_material"))
            editor.do(SetOperators("teapot.1", "theta_h", ()))
        before, context = state(), shell._context(0.0)
        actions = perform(context, name)
        outcome = shell.actor.perform(actions, shell.state, 0.0)
        done = outcome.quit or outcome.screenshot is not None or outcome.reset_layout or outcome.picture is not None
        asks = name == "recover" and outcome.state.shows_recoveries
        leaves = actions == LEAVING.get(name) and outcome.state.pending_action == actions[0]  # it asks
        assert actions and (done or asks or leaves or outcome.state != shell.state or state() != before), name
