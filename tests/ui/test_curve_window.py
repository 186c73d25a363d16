"""The curve editor in the real window: which operator is in hand, and what a hand's drags make of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from tests.ui.real_window import RealWindow, real_window_fixture

pytestmark = pytest.mark.window

real = real_window_fixture()

OPERATORS = "editor.document.layer('teapot.1').operators('theta_h')"
HAND = "__import__('ui.panels.curve_gestures', fromlist=['x']).operators_in_use(" + OPERATORS + ", editor.view)"
BUTTONS = {"kind": ("translate", "amplify"), "axis": ("x", "y", "xy"), "channel": ("rgb", "r", "g", "b")}
TOOL = f"__import__('ui.panels.curve_gestures', fromlist=['x']).tool_of({HAND})"


def magnitudes(real: RealWindow) -> list[float]:
    return real.ask(f"[o.magnitude for o in {OPERATORS}]")


def lit(real: RealWindow, folder: Path) -> str:
    """What the buttons show: tool and channel whose buttons are underlined in the accent."""
    with Image.open(real.shot(folder / "shot.png")) as shot:
        found = [next(name for n, name in enumerate(names) if underlined(shot, real.at(f"curve.{row}.{n}")))
                 for row, names in BUTTONS.items()]  # fmt: skip
    return " ".join(found)


def underlined(shot: Image.Image, place: tuple[float, float]) -> bool:
    """Whether there is anything amber just below the middle of a button."""
    column = [shot.getpixel((int(place[0]), int(place[1]) + down)) for down in range(6, 14)]
    return any(isinstance(pixel, tuple) and pixel[0] > pixel[2] + 60 for pixel in column)


def test_buttons_show_the_operator_in_hand(real: RealWindow, tmp_path: Path) -> None:
    real.fresh()
    real.drag("curve.magnitude", by=(0, -30))
    real.click("curve.channel.1")
    real.click("curve.kind.1")
    real.click("curve.axis.0")
    real.drag("curve.magnitude", by=(10, 0))
    assert lit(real, tmp_path) == "amplify x r"
    real.click("curve.operator.0")
    assert lit(real, tmp_path) == "translate y rgb"
    real.move("curve.operator.0")
    real.click("button.up.0")
    assert real.ask("editor.view.operator") == 1
    assert lit(real, tmp_path) == "translate y rgb"
    real.key("ctrl+z")
    assert real.ask("editor.view.operator") == 0
    assert lit(real, tmp_path) == "translate y rgb"


def test_a_drag_after_undo_goes_on_with_the_operator_in_hand(real: RealWindow) -> None:
    real.fresh()
    real.drag("curve.magnitude", by=(0, -30))
    (first,) = magnitudes(real)
    real.drag("curve.magnitude", by=(0, -20))
    real.key("ctrl+z")
    assert magnitudes(real) == [first]
    real.drag("curve.magnitude", by=(0, -10))
    (second,) = magnitudes(real)
    assert second > first
    real.key("ctrl+z", "ctrl+z", "ctrl+y")
    assert magnitudes(real) == [first]
    real.drag("curve.magnitude", by=(0, -10))
    assert len(magnitudes(real)) == 1
    real.move("curve.operator.0")
    real.click("button.delete.0")
    real.key("ctrl+z")
    real.drag("curve.magnitude", by=(0, -10))
    assert len(magnitudes(real)) == 1


def test_operators_that_come_to_stand_together_stay_two(real: RealWindow) -> None:
    real.fresh()
    real.click("curve.axis.0")
    real.drag("curve.magnitude", by=(6, 0))
    real.click("curve.axis.1")
    real.drag("curve.magnitude", by=(0, -30))
    real.move("curve.operator.1")
    real.click("button.down.1")
    assert real.ask(f"[o.axis for o in {OPERATORS}]") == ["y", "x"]
    assert real.ask(f"len({OPERATORS}[0].regions) and {OPERATORS}[0].regions == {OPERATORS}[1].regions")
    assert {"curve.operator.0", "curve.operator.1"} <= set(real.handles())
    assert real.ask(TOOL) == "translate_y"
    before = magnitudes(real)
    real.drag("curve.d", by=(30, 0))
    low, high = real.ask(f"[o.regions for o in {OPERATORS}]")
    assert low[3] > high[3]
    assert magnitudes(real) == before


def test_a_diagonal_drag_is_one_row(real: RealWindow) -> None:
    real.fresh()
    real.click("curve.axis.2")
    real.drag("curve.magnitude", by=(6, -30))
    assert real.ask(f"[o.axis for o in {OPERATORS}]") == ["y", "x"]
    assert "curve.operator.0" in real.handles() and "curve.operator.1" not in real.handles()
    real.move("curve.operator.0")
    real.click("button.delete.0")
    assert magnitudes(real) == []
    real.key("ctrl+z")
    assert real.ask(TOOL) == "translate_xy"


def test_a_translation_at_its_limit_says_so(real: RealWindow) -> None:
    real.fresh()
    real.click("curve.axis.0")
    real.drag("curve.magnitude", by=(200, 0))
    (held,) = magnitudes(real)
    assert real.ask(f"{OPERATORS}[0].at_limit") and "curve.limit" in real.handles()
    said = "At its limit: widen a–b to move it further right."
    assert real.ask(f"__import__('ui.panels.curve_gestures', fromlist=['x']).limit_text({HAND})") == said
    real.drag("curve.a", by=(-20, 0))
    assert not real.ask(f"{OPERATORS}[0].at_limit")
    real.drag("curve.magnitude", by=(200, 0))
    assert magnitudes(real)[0] > held


def test_steps_are_as_large_as_what_is_seen(real: RealWindow) -> None:
    real.fresh()
    real.click("curve.kind.1")
    real.key("up", "up", "up")
    assert magnitudes(real) == [pytest.approx(1.05**3)]
    real.drag("curve.magnitude", by=(0, -100))
    assert magnitudes(real) == [pytest.approx(2.0 * 1.05**3)]
    real.drag("curve.magnitude", by=(0, 100))
    assert magnitudes(real) == [pytest.approx(1.05**3)]


def test_a_drag_in_a_sharp_highlights_skirt_lifts_it_by_little(real: RealWindow) -> None:
    real.fresh()
    real.do("from app.document.commands import SetParameter; editor.do(SetParameter('teapot.1', 'alpha', 0.06))")
    real.drag("curve.magnitude", by=(0, -38))
    (lifted,) = magnitudes(real)
    height = 2.0 * (real.at("curve.plot")[1] - real.at("curve.a")[1] - 12.0)
    evenly = 38.0 / height * 100.0  # on even axes from 0 to 100; the skirt is 0.03 high
    assert 0.2 < lifted < 0.1 * evenly
    real.key("ctrl+z")
    real.drag("curve.magnitude", by=(0, -38), held="shift")
    (fine,) = magnitudes(real)
    # The first pixels are drawn evenly; further up they are worth more.
    assert 0.02 * lifted < fine < 0.11 * lifted


def test_what_makes_light_of_nothing_is_said_beside_the_curve(real: RealWindow) -> None:
    real.fresh()
    real.drag("curve.magnitude", by=(0, -3))
    assert "curve.gains_light" not in real.handles()
    real.drag("curve.magnitude", by=(0, -80))
    real.wait_until("'curve.gains_light' in shell.handles.names()")
    real.key("ctrl+z")
    real.wait_until("'curve.gains_light' not in shell.handles.names()")
