"""The sheet of the plan: every line says why, is set by hand in a list, given back by its button, undone and drawn."""

from __future__ import annotations

import pytest

from app.document.commands.layers import SetEditable
from app.document.commands.plan import OverrideLine
from app.document.effective_settings import effective_view
from app.document.view_state import SetView, ViewState
from app.modes.deform.deform_messages import GlossPlan
from app.modes.deform.deform_status import DeformStatus
from app.modes.placement.placement_messages import ComputeTransport
from app.modes.placement.placement_status import PlacementStatus
from app.modes.placement.plan_table import PlanTableRow, plan_table
from tests.ui.stand_in import StandInClient
from ui.headless import HeadlessWindow
from ui.panels.actions import SetPanel

pytestmark = pytest.mark.gl


def sheet(window: HeadlessWindow) -> dict[str, PlanTableRow]:
    editor = window.shell.editor
    return {line.line: line for line in plan_table(editor.document, editor.view, editor.status)}


@pytest.fixture
def shown(window: HeadlessWindow) -> HeadlessWindow:
    """The sheet before the panel that shares its place."""
    window.shell.do(SetPanel({"front": ("plan",)}))
    window.frames(3)
    return window


def choose(window: HeadlessWindow, line: str, choice: str) -> None:
    """By the mouse, in the list of a line."""
    window.click_handle(f"plan.{line}")
    window.frames(2)
    window.click_handle(f"plan.{line}.{choice}")
    window.frames(2)


def test_each_line_says_what_it_has_come_to_and_why(window: HeadlessWindow) -> None:
    lines = sheet(window)
    assert (lines["lights"].value, lines["precision"].value) == ("4,000", "half floats")
    assert lines["teapot.1.theta_h"].value == "64 bands" and lines["teapot.1.theta_h"].reason == "room for edits"
    assert "a fixed object stores none" in lines["wall.0.theta_i"].reason
    assert all(line.value and line.reason and not line.is_set for line in lines.values())
    window.shell.editor.do(SetEditable("wall", True))
    assert sheet(window)["wall.0.theta_i"].reason == "room for edits"


def test_what_the_worker_found_to_be_enough_is_reported() -> None:
    from app.document.document import Document

    status = PlacementStatus(needed_lights=1000, plan_reasons={"lights": "within 0.2 % of what 4,000 show"})
    (_, lights, *_) = plan_table(Document("scene"), ViewState(), status)
    assert (lights.value, lights.reason) == ("1,000", "within 0.2 % of what 4,000 show")


def test_deforms_plan_tells_how_each_glossy_layer_is_drawn_and_what_it_takes(window: HeadlessWindow) -> None:
    document, view = window.shell.editor.document, SetView.of(mode="deform").apply(ViewState())
    plans = (
        GlossPlan("teapot.1", "12 rows", "error 28% at a pilot's points", 26_200_000),
        GlossPlan("wall.0", "one lobe", "as is set", 0),
        GlossPlan("gone.0", "9 rows", "", 1),
    )
    lines = [line for line in plan_table(document, view, DeformStatus(gloss=plans)) if line.title == "Gloss"]
    assert [(line.group, line.value) for line in lines] == [("teapot.1", "12 rows, 26 MB"), ("wall.0", "one lobe")]
    assert lines[0].reason == "error 28% at a pilot's points" and not lines[0].choices
    (rows,) = (line for line in plan_table(document, view, DeformStatus()) if line.line == "gloss_rows")
    assert rows.value == "by a pilot" and ("lobe", 0) in rows.choices and ("12", 12) in rows.choices


def test_rays_of_indirect_light_are_reported_once_there_is_any() -> None:
    from app.document.document import Document

    found = PlacementStatus(found_rays=256, plan_reasons={"rays": "within 0.3 % of what 512 show"})
    view = SetView.of(n_bounces=3).apply(ViewState())
    for status, told in (
        (PlacementStatus(), ("as needed", "as few as the noise of a pilot allows")),
        (found, ("256", "within 0.3 % of what 512 show")),
    ):
        lines = {line.line: line for line in plan_table(Document("scene"), view, status)}
        assert (lines["rays"].value, lines["rays"].reason) == told
    assert all(line.line != "rays" for line in plan_table(Document("scene"), ViewState(), found))


def test_the_first_line_says_what_the_picture_takes(shown: HeadlessWindow) -> None:
    assert shown.run_until(lambda: shown.shell.editor.status.spent_seconds is not None, 30.0)
    line = sheet(shown)["cost"]
    assert line.value == "26 s" and "of main memory" in line.reason and not line.choices
    assert "plan.cost" not in shown.shell.handles.names()  # it tells, and cannot be set


def test_until_it_is_there_the_cost_is_the_time_that_is_left() -> None:
    from app.document.document import Document

    at_work = PlacementStatus(stage="final", fraction=0.3, seconds_left=12.4, memory_mb=683.0, gpu_mb=1240.0)
    (cost, *_) = plan_table(Document("scene"), ViewState(), at_work)
    assert cost.value == "12 s to go"
    assert cost.reason == "so far 683 MB of main memory, 1240 MB on the graphics card"


def test_a_line_is_set_in_its_list_and_given_back(shown: HeadlessWindow) -> None:
    editor = shown.shell.editor
    client = editor._client
    assert isinstance(client, StandInClient)
    choose(shown, "lights", "1,000")
    assert dict(editor.document.overrides) == {"lights": 1000}
    line = sheet(shown)["lights"]
    assert line.is_set and line.value == "1,000" and line.reason == "set by the user; planned: 4,000"
    assert shown.run_until(lambda: client.requests and computed(client)[-1].settings.n_lights == 1000, 30.0)
    shown.click_handle("button.plan.lights.reset")
    shown.frames(2)
    assert editor.document.overrides == () and "button.plan.lights.reset" not in shown.shell.handles.names()
    editor.undo()
    assert dict(editor.document.overrides) == {"lights": 1000}
    choose(shown, "lights", "As planned")
    assert editor.document.overrides == ()


def test_a_setting_of_the_accuracy_panel_follows_the_line_that_stands_over_it(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.do(OverrideLine("precision", "float"))
    window.frames(2)
    window.click_handle("accuracy.precision.0")
    window.frames(2)
    assert dict(editor.document.overrides) == {"precision": "half"} and editor.view.settings.precision == "half"
    editor.do(OverrideLine("precision", None))
    window.frames(2)
    window.click_handle("accuracy.precision.1")
    window.frames(2)
    assert editor.document.overrides == () and editor.view.settings.precision == "float"
    assert effective_view(editor.view, editor.document) is editor.view


@pytest.mark.parametrize(
    ("mode", "own", "value", "name"),
    [
        ("orbit", ("points", "coefficients"), 80, "n_coefficients"),
        ("deform", ("transfer_rays", "lobes", "gloss_rows"), 2, "n_lobes"),
    ],
)
def test_other_modes_have_the_lines_that_they_carry_out(
    window: HeadlessWindow, mode: str, own: tuple[str, ...], value: int, name: str
) -> None:
    editor = window.shell.editor
    editor.do(SetView.of(mode=mode))
    window.frames(2)
    assert set(sheet(window)) == {"bounces", "edges", *own}
    editor.do(OverrideLine(own[1], value))
    assert getattr(effective_view(editor.view, editor.document).settings, name) == value
    line = sheet(window)[own[1]]
    assert line.is_set and line.value == str(value) and line.reason.startswith("set by the user; planned: ")
    editor.undo()
    assert not sheet(window)[own[1]].is_set


def computed(client: StandInClient) -> list[ComputeTransport]:
    return [request for request in client.requests if isinstance(request, ComputeTransport)]


def test_the_plan_tells_what_of_a_gloss_follows_a_drag() -> None:
    from app.document.document import Document

    view = SetView.of(n_bounces=3).apply(ViewState())
    followed = "light that the selected curve sends on to 2 layers follows it during a drag, 1.5 MB"
    for n_knots, reason, value in ((24, followed, "24 knots"), (0, "too little light", "none"), (0, "", None)):
        status = PlacementStatus(gloss_knots=n_knots, plan_reasons={"gloss": reason})
        lines = {line.line: line for line in plan_table(Document("scene"), view, status)}
        if value is None:
            assert "gloss" not in lines
        else:
            assert (lines["gloss"].value, lines["gloss"].reason) == (value, reason)


def test_the_plan_tells_what_was_traced_for_edited_materials() -> None:
    from app.document.document import Document

    view = SetView.of(n_bounces=3).apply(ViewState())
    for reason, n_sets, value in (("noise then fell", 2.46, "2.5 sets a point"), ("", 0.0, None)):
        lines = plan_table(Document("scene"), view, PlacementStatus(sample_sets=n_sets, sampling_reason=reason))
        found = {line.line: (line.value, line.reason) for line in lines}
        assert found.get("sampling") == (None if value is None else (value, reason))
