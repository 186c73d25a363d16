"""What hand and keyboard do in the real window, also where its frames are long: all of it counts, in order."""

from __future__ import annotations

import math
from collections.abc import Callable
from random import Random

import pytest

from tests.ui.real_window import (
    ALT,
    CTRL,
    MODIFIERS,
    PRESS,
    RELEASE,
    Place,
    RealWindow,
    chord_events,
    real_window_fixture,
)

pytestmark = pytest.mark.window

real = real_window_fixture()
LONG = 70.0  # milliseconds a frame, as while the picture is brought up to date on a busy machine
TOOL, SELECTED, OPERATOR = "editor.view.active_tool", "editor.view.selected", "editor.view.operator"
POPUPS = "imgui.get_current_context().open_popup_stack.size()"
Z = ord("Z")


def lift(real: RealWindow, times: int = 1) -> None:
    for _ in range(times):
        real.drag("curve.magnitude", by=(0, -20), steps=2)


# --------------------------------------------------------------------------------------------------------- quick keys


@pytest.mark.parametrize("milliseconds", [pytest.param(0.0, marks=pytest.mark.sweep), LONG])
def test_six_quick_undos_are_six(real: RealWindow, milliseconds: float) -> None:
    real.fresh()
    lift(real, 7)
    real.slow(milliseconds)
    real.quick("ctrl+z", 6)
    assert real.n_steps() == 1
    real.quick("ctrl+shift+z", 4)
    assert real.n_steps() == 5


@pytest.mark.parametrize("milliseconds", [pytest.param(0.0, marks=pytest.mark.sweep), LONG])
def test_a_key_that_is_held_goes_on_as_the_system_repeats_it(real: RealWindow, milliseconds: float) -> None:
    real.fresh()
    lift(real, 8)
    real.slow(milliseconds)
    real.held("ctrl+z", 5)
    assert real.n_steps() == 2
    while real.ask("state.handle") != "a":
        real.key("tab")
    steps, start = real.n_steps(), real.ask("editor.view.regions[0]")
    real.held("right", 6)
    assert real.ask("np.degrees(editor.view.regions[0])") == pytest.approx(math.degrees(start) + 7.0)
    assert real.n_steps() == steps + 1
    # Others wait for another press.
    real.held("c", 3)
    assert real.ask("editor.view.compare is not None")


def test_a_chord_counts_with_the_modifiers_it_was_pressed_with(real: RealWindow) -> None:
    real.fresh()
    lift(real, 3)
    code, _ = MODIFIERS["ctrl"]
    real.slow(LONG)
    # Ctrl has been held for some frames; then, within one, Z is pressed and Ctrl let go.
    real.hold("ctrl", True)
    real.events(("key", Z, PRESS, CTRL), ("key", code, RELEASE, CTRL), ("key", Z, RELEASE, 0))
    assert real.n_steps() == 2
    # A chord of another key's modifiers is none: Ctrl X is not the shortcut X, nor is Alt X.
    for modifier, bits in (("ctrl", CTRL), ("alt", ALT)):
        code, _ = MODIFIERS[modifier]
        real.hold(modifier, True)
        real.events(("key", ord("X"), PRESS, bits), ("key", code, RELEASE, bits), ("key", ord("X"), RELEASE, 0))
        assert real.ask(TOOL) == "translate_y"
    real.key("x")
    assert real.ask(TOOL) == "translate_x"
    # Ctrl went down while another window had the keyboard: the press itself tells of it.
    real.events(("key", Z, PRESS, CTRL), ("key", Z, RELEASE, CTRL))
    assert real.n_steps() == 1


def test_keys_act_in_the_order_they_were_pressed(real: RealWindow) -> None:
    real.fresh()
    real.slow(LONG)
    # The table lists X before Y before D, and T before A.
    real.events(*[event for key in ("d", "a", "y", "x", "t") for event in chord_events(key)])
    assert real.ask(TOOL) == "translate_x"


def test_what_is_typed_at_once_goes_where_it_was_meant(real: RealWindow) -> None:
    real.fresh()
    place = real.at("library.search")
    real.slow(LONG)
    # A click into the field, six characters that are also shortcuts, Esc out of it, then a shortcut: in one frame.
    keys = [event for key in ("c", "l", "a", "x", "l", "m", "escape", "a") for event in chord_events(key)]
    real.events(("move", *place), ("button", 0, PRESS, 0), ("button", 0, RELEASE, 0), *keys)
    assert real.ask("(editor.view.compare, editor.view.log_y)") == (None, False)
    assert real.ask(TOOL) == "amplify_y"
    assert real.ask(SELECTED) is not None
    real.click("library.search")
    real.events(*[event for key in "claxl" for event in chord_events(key)])
    assert real.ask("state.library.search").endswith("claxl")


# ------------------------------------------------------------------------------------------------------ the quick hand


def test_clicks_within_a_frame_are_clicks(real: RealWindow) -> None:
    real.fresh()
    real.slow(LONG)
    frozen = "editor.document.object('teapot').frozen"
    before = real.ask(frozen)
    real.quick_clicks("button.frozen.teapot", times=3)
    assert real.ask(frozen) is not before
    assert real.n_steps() == 3


def test_a_whole_drag_within_a_frame_is_a_drag(real: RealWindow) -> None:
    real.fresh()
    x, y = real.at("curve.magnitude")
    real.slow(LONG)
    real.events(("move", x, y), ("button", 0, PRESS, 0), ("move", x, y - 40), ("button", 0, RELEASE, 0), ("move", 5, 5))
    assert real.n_steps() == 1
    assert real.at("curve.magnitude") == pytest.approx((x, y - 40), abs=1.5)


def test_the_wheel_sums(real: RealWindow) -> None:
    real.fresh()
    real.slow(LONG)
    real.wheel(1.0, "curve.plot", times=5)
    low, high = real.ask("editor.view.curve_zoom")[:2]
    assert (high - low) / (0.5 * 3.141592653589793) == pytest.approx(0.85**5)


def arrive_and_click(real: RealWindow, place: Place) -> None:
    """The pointer comes from elsewhere, presses and lets go between two frames."""
    real.move((5.0, 5.0))
    real.events(("move", *real.at(place)), ("button", 0, PRESS, 0), ("button", 0, RELEASE, 0))


@pytest.mark.parametrize("milliseconds", [pytest.param(0.0, marks=pytest.mark.sweep), LONG])
def test_a_row_is_selected_by_a_press_in_the_frame_in_which_the_pointer_arrives(
    real: RealWindow, milliseconds: float
) -> None:
    real.fresh()
    lift(real)
    real.slow(milliseconds)
    for name in ("tray", "wall", "teapot"):
        arrive_and_click(real, f"objects.{name}")
        assert real.ask(SELECTED).object == name
    arrive_and_click(real, "objects.teapot.1")
    assert real.ask(OPERATOR) is None
    arrive_and_click(real, "curve.operator.0")
    assert real.ask(OPERATOR) == 0


def tab_middle(real: RealWindow, window: str) -> tuple[float, float]:
    """Where the tab of a docked window is."""
    bar = f"{window}.dock_node.tab_bar"
    tab = f"next(tab for tab in {bar}.tabs if tab.id_ == {window}.tab_id)"
    x, low, high = real.ask(
        f"({bar}.bar_rect.min.x + {tab}.offset + 0.5 * {tab}.width, {bar}.bar_rect.min.y, {bar}.bar_rect.max.y)"
    )
    return x, 0.5 * (low + high)


@pytest.mark.parametrize("milliseconds", [pytest.param(0.0, marks=pytest.mark.sweep), LONG])
def test_a_panel_comes_to_the_front_by_a_press_in_the_frame_in_which_the_pointer_arrives(
    real: RealWindow, milliseconds: float
) -> None:
    real.fresh()
    real.slow(milliseconds)
    for panel in ("Plan###plan", "Accuracy###accuracy", "BRDF###brdf", "Library###library"):
        window = f"imgui.internal.find_window_by_name({panel!r})"
        arrive_and_click(real, tab_middle(real, window))
        assert real.ask(f"{window}.dock_node.visible_window.name") == panel


# ---------------------------------------------------------------------------------------------------------------- Esc


def open_menu(real: RealWindow) -> Callable[[], bool]:
    real.key("alt")
    assert real.ask(POPUPS) == 1
    return lambda: bool(real.ask(POPUPS) == 0)


def open_list(real: RealWindow) -> Callable[[], bool]:
    real.click("view.tone_mapping")
    assert real.ask(POPUPS) == 1
    return lambda: bool(real.ask(POPUPS) == 0)


def open_file_question(real: RealWindow) -> Callable[[], bool]:
    real.key("ctrl+o")
    assert real.ask("state.question is not None")
    return lambda: bool(real.ask("state.question is None"))


def type_a_search(real: RealWindow) -> Callable[[], bool]:
    real.click("library.search")
    real.text("gold")
    assert real.ask("shell.io.want_text_input")
    return lambda: not real.ask("shell.io.want_text_input")


def hold_the_ring(real: RealWindow) -> Callable[[], bool]:
    steps = real.n_steps()
    real.drag("curve.magnitude", by=(0, -20), let_go=False)
    assert real.ask("editor.history.dragging")
    return lambda: not real.ask("editor.history.dragging") and real.n_steps() == steps


def carry_a_material(real: RealWindow) -> Callable[[], bool]:
    real.drag("library.Plaster", to="viewport.centre", let_go=False)
    assert real.ask("imgui.internal.is_drag_drop_active()")

    def ended() -> bool:
        carried = real.ask("imgui.internal.is_drag_drop_active()")
        steps = real.n_steps()
        real.release()
        return not carried and real.n_steps() == steps

    return ended


def show_the_shortcuts(real: RealWindow) -> Callable[[], bool]:
    real.key("f1")
    assert real.ask("editor.view.show_shortcuts")
    return lambda: not real.ask("editor.view.show_shortcuts")


def see_an_error(real: RealWindow) -> Callable[[], bool]:
    real.events(("drop", ["/nowhere/lost.toml"]))
    assert "there is no such file" in real.notice()
    return lambda: real.notice() == ""


@pytest.mark.parametrize(
    "begin",
    [open_menu, open_list, open_file_question, type_a_search, hold_the_ring, carry_a_material, show_the_shortcuts,
     see_an_error],
)  # fmt: skip
def test_escape_does_one_thing(real: RealWindow, begin: Callable[[RealWindow], Callable[[], bool]]) -> None:
    real.fresh()
    lift(real)
    assert real.ask(OPERATOR) == 0
    has_ended = begin(real)
    real.key("escape")
    assert has_ended()
    assert real.ask(OPERATOR) == 0 and real.ask(SELECTED) is not None
    real.release()
    real.key("escape")
    assert real.ask(OPERATOR) is None and real.ask(SELECTED) is not None
    real.key("escape")
    assert real.ask(SELECTED) is None


# ---------------------------------------------------------------------------------------------------------- the menus


def test_alt_opens_the_menus(real: RealWindow) -> None:
    real.fresh()
    real.click("curve.plot")
    real.key("alt")
    assert real.ask(POPUPS) == 1
    # The keyboard goes on from there: the next menu, its first entry that can be chosen.
    steps = real.n_steps()
    real.key("right", "down", "escape")
    assert real.ask(POPUPS) == 0 and real.n_steps() == steps and real.ask(SELECTED) is not None
    assert not real.ask("shell.io.nav_visible")
    real.key("alt+v")
    assert real.ask(POPUPS) == 1
    real.key("escape")
    # Alt with something else is not Alt by itself.
    real.click("viewport.corner", held="alt")
    code, _ = MODIFIERS["alt"]
    real.events(("key", code, PRESS, 0), ("focus", 0), ("key", code, RELEASE, ALT), ("focus", 1))
    assert real.ask(POPUPS) == 0


# ------------------------------------------------------------------------------------------------ the dial of the light


def test_the_wheel_turns_the_dial(real: RealWindow) -> None:
    real.fresh()
    rotation = "editor.document.light.rotation"
    real.do("from ui.panels import light; light.PAUSE_SECONDS = 60.0")  # however slow the machine
    real.wheel(1.0, "light.wheel", times=4)
    real.wheel(-1.0)
    assert real.ask(rotation) == pytest.approx(15.0)
    real.wheel(-1.0, held="shift", times=3)
    assert real.ask(rotation) == pytest.approx(13.5)
    assert real.n_steps() == 1
    # After a pause it is another gesture.
    real.do("from dataclasses import replace; shell.state = replace(state, turn=replace(state.turn, last=-100.0))")
    real.wheel(1.0)
    assert real.n_steps() == 2
    real.key("ctrl+z", "ctrl+z")
    assert real.ask(rotation) == 0.0


# ----------------------------------------------------------------------------------------------------- anything at all

# Not those that write files, end the program or ask the desktop.
SPARED = ("button.screenshot", "button.library.add", "button.recover", "button.discard", "files.", "menu.")
CHORDS = (
    "ctrl+z", "ctrl+y", "ctrl+shift+z", "ctrl+c", "ctrl+shift+c", "ctrl+v", "escape", "tab", "up", "right", "delete",
    "a", "t", "x", "y", "d", "l", "m", "c", "f", "/", "b", "space", "alt", "alt+v", "f1", "enter", "[", "1", "5",
    "home", "n", "alt+z", "shift+alt+z",
)  # fmt: skip


def something(real: RealWindow, random: Random) -> str:
    """One thing that a hand may do, and what it was."""
    handles = [name for name in real.handles() if not name.startswith(SPARED)]
    what = random.choice(
        ("keys", "click", "double", "right", "middle", "drag", "drag", "cancelled drag", "wheel", "resize")
    )
    handle, chords = random.choice(handles), random.choices(CHORDS, k=3)
    by = (random.uniform(-60.0, 60.0), random.uniform(-40.0, 40.0))
    match what:
        case "keys":
            real.events(*[event for chord in chords for event in chord_events(chord, random.random() < 0.5)])
        case "click":
            real.click(handle, held=random.choice(("", "", "ctrl", "shift", "alt")))
        case "double":
            real.quick_clicks(handle, random.choice((2, 3)))
        case "right":
            real.click(handle, button=1)
        case "middle":
            real.drag(handle, by=by, steps=2, button=2, held=random.choice(("", "shift", "ctrl", "ctrl+alt")))
        case "drag":
            real.drag(handle, by=by, steps=2, held=random.choice(("", "", "shift")))
        case "cancelled drag":
            real.drag(handle, by=by, steps=1, let_go=False)
            real.key("escape", *chords[:1])
            real.release()
        case "wheel":
            real.wheel(random.choice((-1.0, 1.0)), handle, times=random.choice((1, 3)))
        case "resize":
            real.resize(*random.choice(((1380, 860), (800, 600))))
    return f"{what} {handle} {chords}"


@pytest.mark.parametrize("seed", [1, *[pytest.param(seed, marks=pytest.mark.sweep) for seed in range(2, 8)]])
def test_after_anything_at_all_esc_leads_back(real: RealWindow, seed: int) -> None:
    random, done = Random(seed), list[str]()
    real.fresh()
    for _ in range(16):
        real.slow(random.choice((0.0, 0.0, LONG)))
        done.append(something(real, random))
        assert not real.ask("editor.history.dragging or shell.state.grip"), done[-3:]
    for _ in range(12):
        real.key("escape")
    # Closed, ended and let go, with nothing said of an error in between.
    state = "(editor.view.selected, editor.view.operator, editor.view.show_shortcuts, state.question, state.paints)"
    assert real.ask(state) == (None, None, False, None, False), done
    assert real.ask(POPUPS) == 0 and not real.ask("shell.io.want_text_input"), done
    assert "Traceback" not in real.log(), done
    real.resize(1380, 860)
    real.fresh()
    lift(real)
    assert real.n_steps() == 1
