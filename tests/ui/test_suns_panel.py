"""Suns in the Light panel: their rows edit the document in one step a drag."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import pytest

from app.document.commands.suns import angles_of
from app.document.view_state import OpenPanel
from engine.light.suns import Sun
from tests.ui.conftest import opened
from tests.ui.stand_in import SCENE, scene_opened
from ui.headless import HeadlessWindow

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


@pytest.mark.parametrize("row", ["azimuth", "elevation", "irradiance", "diameter"])
def test_a_drag_is_one_step_and_a_right_click_goes_back(sunny: HeadlessWindow, row: str) -> None:
    editor = sunny.shell.editor
    for other in ("library", "brdf", "accuracy", "plan", "material"):  # room for all rows
        editor.do(OpenPanel(other, False))
    sunny.frames(6)
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


def test_a_scene_without_suns_has_no_rows(window: HeadlessWindow) -> None:
    assert not window.shell.editor.document.light.suns
    with pytest.raises(KeyError):
        window.shell.handle_position(f"mix.{AT}")
