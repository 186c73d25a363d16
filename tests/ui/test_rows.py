"""Rows of panels follow from their parameters: what a tooltip says, a drag as one step, and the way back."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import pytest
from imgui_bundle import imgui

from app.document.commands import AddDeformer
from app.document.commands.layers import SetFrozen, SetParameter
from app.document.commands.light import INTENSITY, ROTATION, STRENGTH
from app.document.commands.maps import SetParameterMap
from app.document.document import Document
from app.document.view_state import FRAME_BUDGET, OpenPanel, SetView
from engine.material.bumps import BUMP_HEIGHT
from engine.material.layer_maps import TEXTURE_SCALE, TEXTURE_SPACE
from engine.material.parameter_maps import ParameterMap
from engine.material.parameters import ETA, Parameter, ParameterError
from engine.realtime.deformers import KINDS
from ui.headless import HeadlessWindow
from ui.panels.number_fields import Touch
from ui.panels.rows import EDIT, Row, one_step


def roughness_map(document: Document) -> ParameterMap:
    (found,) = document.layer("teapot.1").parameter_maps
    return found


ROWS: dict[str, tuple[str, str, Callable[[Document], Any]]] = {
    "light.rotation": ("light", "teapot.1", lambda document: document.light.rotation),
    "light.intensity": ("light", "teapot.1", lambda document: document.light.intensity),
    "material.alpha": ("material", "teapot.1", lambda document: document.layer("teapot.1").values["alpha"]),
    "material.albedo.g": ("material", "teapot.0", lambda document: document.layer("teapot.0").values["albedo"]),
    "material.alpha_map.black": ("material", "teapot.1", lambda document: roughness_map(document).low),
    "emitter.strength": ("material", "lamp", lambda document: document.object("lamp").emission),
    "pose.0": ("material", "teapot", lambda document: [each.amount for each in document.object("teapot").deformations]),
}


def row(parameter: Parameter, value: Any, own: Any = None) -> Row:
    return Row(parameter, value, lambda to: SetView.of(exposure=to), "handle", own)


def test_a_tooltip_has_the_effect_the_range_with_its_unit_and_the_way_back() -> None:
    assert row(INTENSITY, 1.0, 2.0).hint.endswith("only scaled. From 0.01 to 100. Right click: back to 2.")
    assert row(ROTATION, 0.0).hint.endswith("in the picture. From 0 to 360°.")
    assert row(FRAME_BUDGET, 16.0, 16.0).hint.endswith("From 2 to 200 ms. Right click: back to 16 ms.")
    assert row(BUMP_HEIGHT, 0.1).hint.endswith("From -1000 to 1000 m. Drag sideways, or double-click to type.")
    assert "From 0.01 to 20. Drag sideways" in row(ETA, (1.0, 1.0, 1.0)).hint
    assert row(TEXTURE_SPACE, "", "srgb").hint.endswith("Right click: back to sRGB.")


def test_a_pair_is_accepted_within_its_range_and_is_never_zero() -> None:
    assert TEXTURE_SCALE.accept(2) == (2.0, 2.0) and TEXTURE_SCALE.accept([-1, 0.5]) == (-1.0, 0.5)
    for value in (0.0, (1.0, 1e-4), (1.0, 2.0, 3.0), 1001.0, float("nan"), True):
        with pytest.raises(ParameterError, match="a number or two from -1000 to 1000, none 0"):
            TEXTURE_SCALE.accept(value)


def test_the_range_of_a_slider_lies_within_what_files_accept() -> None:
    for parameter in (INTENSITY, ROTATION, STRENGTH, FRAME_BUDGET, *(kind.amount for kind in KINDS.values())):
        low, high = parameter.limits
        assert parameter.accept(low) == low and parameter.accept(high) == high
        assert parameter.minimum <= low < high <= parameter.maximum


def test_a_drag_is_one_step_whatever_it_changes() -> None:
    change = [SetView.of(exposure=1.0)]
    touches = (Touch(began=True), Touch(changed=True), Touch(changed=True), Touch(ended=True))
    assert [one_step(touch, change) for touch in touches] == [[EDIT[0]], change, change, [EDIT[1]]]
    assert [one_step(touch, change, None) for touch in touches] == [[], change, change, []]


@pytest.mark.gl
@pytest.mark.parametrize("handle", ROWS)
def test_a_right_click_sets_a_row_back_in_one_step(window: HeadlessWindow, handle: str) -> None:
    panel, selected, value = ROWS[handle]
    editor = window.shell.editor
    if handle.startswith("pose"):
        editor.do(SetView.of(mode="deform"))
        editor.do(AddDeformer("teapot", "bend"))
    if "_map." in handle:
        editor.do(SetParameterMap("teapot.1", "alpha", "worn.png"))
    editor.select(selected)
    for other in {"library", "brdf", "light", "accuracy"} - {panel}:  # room for all rows
        editor.do(OpenPanel(other, False))
    window.frames(6)
    before, n_steps = value(editor.document), len(editor.history.undo_steps)
    window.drag_handle(handle, (25, 0))
    assert value(editor.document) != before and len(editor.history.undo_steps) == n_steps + 1
    window.click(*window.shell.handle_position(handle), button=1)
    assert value(editor.document) == pytest.approx(before) and len(editor.history.undo_steps) == n_steps + 2


@pytest.mark.gl
def test_a_right_click_on_a_frozen_layer_changes_nothing(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    window.drag_handle("material.alpha", (25, 0))
    editor.do(SetFrozen("teapot.1", True))
    window.frames(2)
    before = editor.document
    window.click(*window.shell.handle_position("material.alpha"), button=1)
    assert editor.document == before and not editor.status.is_error


def test_every_parameter_of_a_deformer_is_an_amount() -> None:
    for kind in KINDS.values():
        assert dataclasses.astuple(kind.amount)[:3] == ("amount", "scalar", 0.0)
        assert (kind.amount.step is None) == (kind.unit != "degrees")


def test_the_wheel_picks_in_the_screens_colours(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    editor, shown = window.shell.editor, list[list[float]]()
    editor.select("teapot.0")
    editor.do(SetParameter("teapot.0", "albedo", (0.5, 0.2140411, 0.0)))
    window.frames(3)

    def pick(name: str, colour: list[float], flags: int) -> tuple[bool, list[float]]:
        shown.append(list(colour))
        return len(shown) == 1, [0.5, 1.0, 0.0]

    monkeypatch.setattr(imgui, "color_picker3", pick)
    window.click_handle("material.albedo.swatch")
    window.frames(3)
    # By sRGB's formula linear 0.5 is 0.7353569 and 0.2140411 is 0.5, and so back.
    assert shown[0] == pytest.approx([0.7353569, 0.5, 0.0], abs=1e-5)
    assert editor.document.layer("teapot.0").values["albedo"] == pytest.approx((0.2140411, 1.0, 0.0), abs=1e-5)
