"""Looks side by side: panes that fill their place, a click that makes a look current, and pictures that follow."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np
import pytest

from app.document.commands import AddLook, SetParameter
from app.document.view_state import SetView
from app.modes.placement.plan_table import plan_table
from app.stills import look_pictures
from app.stills.look_pictures import LookView
from tests.ui.stand_in import HEIGHT, WIDTH
from ui.headless import HeadlessWindow
from ui.panels.viewport_layout import pane_places

GREY = 0.18


class Painter:
    """A process that answers each request at once: all pixels are grey."""

    pid = os.getpid()

    def __init__(self, answers: Any) -> None:
        self._answers = answers
        self.views: list[LookView] = []

    def put(self, request: tuple[int, LookView] | None) -> None:
        if request is None:
            return
        number, view = request
        self.views.append(view)
        width, height = view.resolution
        self._answers.put((number, "picture", np.full((height, width, 3), GREY, np.float32)))

    def close(self, patience_s: float = 0.0) -> None: ...


@pytest.fixture
def looks(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> HeadlessWindow:
    """A window with three looks of which the third is current, in four panes."""
    monkeypatch.setattr(look_pictures, "_Painter", Painter)
    editor = window.shell.editor
    dark, light = SetParameter("teapot.0", "albedo", 0.1), SetParameter("teapot.0", "albedo", 0.9)
    for command in (AddLook("Dark"), dark, AddLook("Light"), light, SetView.of(looks_shown=4)):
        assert editor.do(command) is None
    window.frames(90)  # more than what is waited for after a change
    return window


def test_panes_fill_their_place_as_well_as_the_picture_allows() -> None:
    # Two wide pictures stand above each other in a square, two high ones beside each other.
    assert pane_places((100, 100), 2, 2.0, 0, 0) == [(0, 0, 100, 50), (0, 50, 100, 50)]
    assert pane_places((100, 100), 2, 0.5, 0, 0) == [(0, 0, 50, 100), (50, 0, 50, 100)]
    assert pane_places((306, 216), 6, 1.0, 6, 3) == [
        (x, y, 100, 106) for y in (0, 110) for x in (0, 103, 206)
    ]  # fmt: skip
    assert [len(pane_places((64, 48), count, 1.5, 8, 2)) for count in (1, 2, 4, 6)] == [1, 2, 4, 6]


@pytest.mark.gl
def test_a_click_makes_a_look_current_in_its_place_and_pictures_follow(looks: HeadlessWindow) -> None:
    shell, editor = looks.shell, looks.shell.editor
    board, pictures = shell.looks._board, shell.looks.pictures
    assert sorted(board.pictures) == ["Dark", "Look 1"] and board.states == {"Look 1": "", "Dark": ""}
    assert pictures.is_finished and not board.outdated
    # The current look's pane has the picture that is edited; the fourth has none yet.
    names = shell.handles.names()
    assert "look.0" in names and "look.1" in names and "look.2" not in names and "button.look.new.3" in names
    place, depth = shell.handle_position("look.1"), len(editor.history.undo_steps)
    looks.click_handle("look.1")
    looks.frames(3)
    assert editor.document.look == "Dark" and len(editor.history.undo_steps) == depth + 1
    # What was left stays as it was on screen until it is drawn; where it was clicked the picture is edited now.
    assert sorted(board.pictures) == ["Light", "Look 1"] and board.outdated == {"Light"}
    assert board.states["Light"].startswith("updating")
    assert shell.handle_position("viewport.centre") == pytest.approx(place, abs=2.0)
    looks.frames(90)
    assert board.states == {"Look 1": "", "Light": ""} and not board.outdated
    # An edit of the current look draws no other anew.
    drawn = dict(pictures.pictures)
    editor.do(SetParameter("teapot.0", "albedo", 0.3))
    looks.frames(60)
    assert {name: pictures.pictures[name] for name in ("Look 1", "Light")} == {
        name: drawn[name] for name in ("Look 1", "Light")
    }
    looks.click_handle("button.look.new.3")
    looks.frames(3)
    assert [each.name for each in editor.document.looks] == ["Look 1", "Dark", "Look 2", "Light"]


@pytest.mark.gl
def test_pictures_are_drawn_in_the_resolution_of_their_panes(looks: HeadlessWindow) -> None:
    shell = looks.shell
    across, down = shell.looks._board.shown["Dark"]
    width, height = shell.looks.pictures.pictures["Dark"].of.resolution
    # An eighth of the resolution more than there is room for at most, and never more than the picture has.
    assert min(across, WIDTH) <= width <= min(across + WIDTH / 8 + 1, WIDTH)
    assert min(down, HEIGHT) <= height <= min(down + HEIGHT / 8 + 1, HEIGHT)
    shell.editor.do(SetView.of(looks_shown=1))
    looks.frames(60)
    assert shell.looks._board.pictures == {} and shell.looks.pictures.is_finished


@pytest.mark.gl
@pytest.mark.parametrize("count", [2, 4, 6])
def test_the_plan_counts_what_looks_side_by_side_hold(looks: HeadlessWindow, count: int) -> None:
    shell, editor = looks.shell, looks.shell.editor
    for name in ("Blue", "Red", "Green"):
        assert editor.do(AddLook(name)) is None
    editor.do(SetView.of(looks_shown=count))
    looks.frames(150)
    assert shell.looks.pictures.is_finished
    editor.metrics._memory_at = -math.inf
    looks.frames(2)
    pictures = shell.looks.pictures.pictures.values()
    textures = [each for shown in shell.looks._shown.values() for each in (shown.linear, shown.texture)]
    held = sum(each.radiance.nbytes for each in pictures)
    on_card = sum(each.width * each.height * each.components * int(each.dtype[1]) for each in textures)
    assert len(pictures) >= count - 1 and held > 0 and on_card > 0
    status = editor.status
    # The process that draws is this one here.
    assert status.looks_mb >= held / 1e6 + 50.0 and status.looks_gpu_mb >= on_card / 1e6
    assert status.memory_mb >= status.looks_mb - held / 1e6
    (line,) = (each for each in plan_table(editor.document, editor.view, status) if each.line == "looks")
    assert line.value == f"{count} looks" and line.reason.startswith(f"{status.looks_mb:.0f} MB of main memory")
    editor.do(SetView.of(looks_shown=1))
    assert all(each.line != "looks" for each in plan_table(editor.document, editor.view, status))


@pytest.mark.gl
def test_keys_show_and_choose_looks(looks: HeadlessWindow) -> None:
    from imgui_bundle import imgui

    editor = looks.shell.editor
    for expected in (6, 1, 2, 4):
        looks.key(imgui.Key.u)
        looks.frames(2)
        assert editor.view.looks_shown == expected
    for key, expected in ((imgui.Key.comma, "Dark"), (imgui.Key.period, "Light"), (imgui.Key.period, "Look 1")):
        looks.key(key)
        looks.frames(2)
        assert editor.document.look == expected
