"""Strokes, control points and tables by the mouse: each gesture is one step, and what is drawn is what is seen."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.view_state import SetView
from app.files.session import load_session
from app.messages.file_messages import ReadCurveTable
from engine.curve.operators import apply_operators
from engine.curve.table_text import parse_table
from engine.curve.tables import HALF_PI, TabulatedCurve
from tests.ui.stand_in import StandInClient
from ui.headless import HeadlessWindow
from ui.panels import curve_editor, curve_helper
from ui.panels.actions import OpenFile, Paste
from ui.panels.curve_plot import Frame

pytestmark = pytest.mark.gl

KEY, FACTOR = "teapot.1", "theta_h"
ZOOM = (0.0, HALF_PI, 0.0, 2.0)


def tables(window: HeadlessWindow) -> list[TabulatedCurve]:
    found = window.shell.editor.document.layer(KEY).operators(FACTOR)
    assert all(isinstance(each, TabulatedCurve) for each in found)
    return [each for each in found if isinstance(each, TabulatedCurve)]


def steps(window: HeadlessWindow) -> int:
    return len(window.shell.editor.history.undo_steps)


@pytest.fixture
def frames(monkeypatch: pytest.MonkeyPatch) -> list[Frame]:
    """The axes of the plot as they were drawn; they stand still."""
    seen: list[Frame] = []
    place = curve_editor._frame

    def note(*arguments: object) -> Frame:
        seen.append(place(*arguments))  # type: ignore[arg-type]
        return seen[-1]

    monkeypatch.setattr(curve_editor, "_frame", note)
    return seen


def with_tool(window: HeadlessWindow, tool: str) -> None:
    window.shell.editor.do(SetView.of(active_tool=tool, operator=None, curve_zoom=ZOOM))
    window.frames(3)


def pixel(frame: Frame, degrees: float, value: float) -> tuple[float, float]:
    return frame.x.to_pixel(np.radians(degrees)), frame.y.to_pixel(value)


def draw(window: HeadlessWindow, frame: Frame, places: list[tuple[float, float]], release: bool = True) -> None:
    """Press at the first of (degrees, value), pass the others."""
    window.move(*pixel(frame, *places[0]))
    window.frame()
    window.press()
    for place in places[1:]:
        window.move(*pixel(frame, *place))
    window.frame()
    if release:
        window.release()


def test_a_stroke_is_one_step_and_the_curve_follows_it(window: HeadlessWindow, frames: list[Frame]) -> None:
    with_tool(window, "stroke")
    before = steps(window)
    draw(window, frames[-1], [(20.0 + 0.5 * k, 0.5 + 0.02 * k) for k in range(41)])
    (stroke,) = tables(window)
    assert steps(window) == before + 1 and window.shell.editor.view.operator == 0
    assert np.degrees(stroke.regions) == pytest.approx([14.6, 20.0, 40.0, 45.4], abs=0.3)
    # A straight stroke stays straight: 0.04 per degree, seen within a pixel.
    layer = window.shell.editor.document.layer(KEY)
    degrees = np.array([22.0, 30.0, 38.0])
    values = apply_operators(layer.operators(FACTOR), layer.generated_curve(FACTOR))(np.radians(degrees))
    assert values.max(axis=1) == pytest.approx(0.5 + 0.04 * (degrees - 20.0), abs=0.03)
    window.shell.editor.undo()
    assert tables(window) == []
    window.shell.editor.redo()
    assert tables(window) == [stroke]


def test_escape_takes_a_stroke_back(window: HeadlessWindow, frames: list[Frame]) -> None:
    with_tool(window, "stroke")
    before = steps(window)
    draw(window, frames[-1], [(20.0, 0.5), (30.0, 0.8), (40.0, 0.6)], release=False)
    assert len(tables(window)) == 1
    window.key(imgui.Key.escape)
    window.release()
    assert tables(window) == [] and steps(window) == before


def test_a_click_draws_nothing_and_another_stroke_is_another_operator(
    window: HeadlessWindow, frames: list[Frame]
) -> None:
    with_tool(window, "stroke")
    window.click(*pixel(frames[-1], 50.0, 0.5))
    assert tables(window) == []
    draw(window, frames[-1], [(20.0, 0.5), (40.0, 0.5)])
    draw(window, frames[-1], [(60.0, 1.0), (70.0, 1.2), (65.0, 0.2)])
    first, second = tables(window)
    # The pointer went back: from 65 degrees on to 70 what it drew last counts.
    assert second(np.radians([69.0]))[0].max() == pytest.approx(1.0, abs=0.15)
    assert first.kind == second.kind == "stroke"


def test_points_are_set_dragged_and_removed(window: HeadlessWindow, frames: list[Frame]) -> None:
    with_tool(window, "points")
    frame, before = frames[-1], steps(window)
    curve = window.shell.editor.document.layer(KEY).curve(FACTOR)
    for degrees in (30.0, 50.0):
        value = float(curve(np.radians([degrees]))[0].max())
        draw(window, frame, [(degrees, value), (degrees, 0.5 * value + 0.4), (degrees, 0.8)])
    (points,) = tables(window)
    assert steps(window) == before + 2 and points.kind == "points"
    assert np.degrees(points.gammas) == pytest.approx([30.0, 50.0], abs=0.3)
    assert [max(value) for value in points.values] == pytest.approx([0.8, 0.8], abs=0.03)
    # The second by its handle; the first keeps every bit.
    window.drag_handle("curve.point.1", by=(0.0, -20.0))
    (moved,) = tables(window)
    assert moved.values[0] == points.values[0] and moved.gammas == points.gammas and moved.values[1] > points.values[1]
    # There and back is no edit.
    x, y = window.shell.handle_position("curve.point.0")
    window.move(x, y)
    window.frame()
    window.press()
    window.move(x + 30.0, y - 12.0)
    window.move(x, y)
    window.release()
    assert tables(window) == [moved] and steps(window) == before + 3
    for name in ("curve.point.0", "curve.point.0"):
        window.click(*window.shell.handle_position(name), button=1)
    assert tables(window) == [] and steps(window) == before + 5


def test_arrow_keys_move_a_point(window: HeadlessWindow, frames: list[Frame]) -> None:
    with_tool(window, "points")
    value = float(window.shell.editor.document.layer(KEY).curve(FACTOR)(np.array([0.5]))[0].max())
    draw(window, frames[-1], [(np.degrees(0.5), value), (np.degrees(0.5), 1.0)])
    (points,) = tables(window)
    assert window.shell.state.handle == "point.0"
    window.key(imgui.Key.right_arrow)
    (moved,) = tables(window)
    # One degree where all 90 are shown; the height keeps every bit.
    assert np.degrees(moved.gammas[0] - points.gammas[0]) == pytest.approx(1.0, abs=0.02)
    assert moved.values == points.values


def test_the_ring_scales_a_stroke_and_its_region_takes_it_along(window: HeadlessWindow, frames: list[Frame]) -> None:
    with_tool(window, "stroke")
    draw(window, frames[-1], [(30.0, 0.5), (45.0, 0.9)])
    (stroke,) = tables(window)
    window.drag_handle("curve.magnitude", by=(0.0, -60.0))
    (scaled,) = tables(window)
    assert scaled.magnitude > 1.0 and scaled == dataclasses.replace(stroke, magnitude=scaled.magnitude)
    window.drag_handle("curve.region", by=(40.0, 0.0))
    (moved,) = tables(window)
    shift = moved.regions[1] - scaled.regions[1]
    assert shift > 0.0 and moved.gammas == pytest.approx([gamma + shift for gamma in scaled.gammas])
    window.drag_handle("curve.a", by=(-20.0, 0.0))
    (widened,) = tables(window)
    assert widened.gammas == moved.gammas and widened.regions[0] < moved.regions[0]


def test_what_is_drawn_is_in_the_session(window: HeadlessWindow, frames: list[Frame], tmp_path: Path) -> None:
    with_tool(window, "stroke")
    draw(window, frames[-1], [(30.0, 0.5), (45.0, 0.9)])
    window.drag_handle("curve.magnitude", by=(0.0, -60.0))
    with_tool(window, "points")
    window.shell.editor.do(SetView.of(channel="r"))
    window.frames(2)
    value = float(window.shell.editor.document.layer(KEY).curve(FACTOR)(np.radians([70.0]))[0, 0])
    draw(window, frames[-1], [(70.0, value), (70.0, 1.0)])
    assert len(tables(window)) == 2
    assert window.shell.editor.save(tmp_path / "drawn.insitu") is None
    loaded = load_session(tmp_path / "drawn.insitu").document.layer(KEY).operators(FACTOR)
    assert list(loaded) == tables(window)


def test_a_table_is_pasted_and_loaded_by_the_worker(window: HeadlessWindow, tmp_path: Path) -> None:
    imgui.set_clipboard_text("0;1,5\n45;0,5\n")
    window.shell.do(Paste())
    window.frames(2)
    assert [table.values[0] for table in tables(window)] == [(1.5, 1.5, 1.5)]
    (tmp_path / "peak.csv").write_text("angle,value\n10,2\n20,1\n")
    window.shell.do(OpenFile(str(tmp_path / "peak.csv")))
    window.frames(2)
    assert len(tables(window)) == 2 and steps(window) == 2
    assert "2 rows" in window.shell.editor.status.message
    # Copied, it reads back as the same curve.
    window.key(imgui.Key.escape)
    layer = window.shell.editor.document.layer(KEY)
    edited = apply_operators(layer.operators(FACTOR), layer.generated_curve(FACTOR))
    with_tool(window, "stroke")
    window.click_handle("button.curve.copy_table")
    copied = parse_table(imgui.get_clipboard_text().encode(), "clipboard")
    x = np.linspace(0.0, HALF_PI, 300)
    assert copied(x) == pytest.approx(edited(x), rel=1e-3, abs=1e-5 * edited(x).max())


def test_a_bad_table_is_one_line_and_changes_nothing(window: HeadlessWindow) -> None:
    editor, client = window.shell.editor, cast(StandInClient, window.shell.editor._client)
    imgui.set_clipboard_text("0,1\n45,high\n")
    before = editor.document
    window.shell.do(Paste())
    window.frames(2)
    assert editor.document is before and not editor.exchange.is_reading and editor.status.is_error
    assert editor.status.message.startswith("clipboard: line 2: value = high, expected a number within 1e+18")
    # The window's process never parses it.
    assert [request.text for request in client.requests if isinstance(request, ReadCurveTable)] == ["0,1\n45,high\n"]


def test_a_table_that_comes_during_a_drag_waits_for_its_end(window: HeadlessWindow, frames: list[Frame]) -> None:
    with_tool(window, "stroke")
    draw(window, frames[-1], [(20.0, 0.5), (30.0, 0.8)], release=False)
    imgui.set_clipboard_text("40,1\n45,2\n")
    window.shell.do(Paste())
    window.frames(2)
    window.move(*pixel(frames[-1], 35.0, 0.9))
    assert [table.kind for table in tables(window)] == ["stroke"]
    window.release()
    window.frames(2)
    assert [table.kind for table in tables(window)] == ["stroke", "curve"] and steps(window) == 2


def test_the_helper_function_is_drawn_while_dragging(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[int] = []
    show = curve_helper.draw
    monkeypatch.setattr(curve_helper, "draw", lambda *a: (drawn.append(len(a[3])), show(*a)))
    with_tool(window, "translate_xy")
    x, y = window.shell.handle_position("curve.magnitude")
    window.move(x, y)
    window.frame()
    assert not drawn
    window.press()
    window.move(x, y - 20.0)
    window.frame()
    assert drawn and set(drawn) == {2}
    window.release()
    n = len(drawn)
    window.frames(3)
    assert len(drawn) == n
