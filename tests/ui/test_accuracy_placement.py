"""The trade-off panel tells the plan: bands, precision and memory, as they are."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.document.commands.layers import SetEditable
from app.messages.editor_status import Status
from app.modes.placement.placement_messages import ComputeTransport
from app.modes.placement.placement_status import PlacementStatus, error_note
from engine.render.picture_error import ErrorEstimate
from tests.ui.stand_in import StandInClient
from ui import theme as look
from ui.headless import HeadlessWindow
from ui.modes.placement.accuracy_placement import figures
from ui.panels.accuracy import error_hint
from ui.panels.status_bar import ERROR_SECONDS, HEADLIGHT, picture_state

STATUS = PlacementStatus(
    shown_coefficients=30, wanted_coefficients=64, memory_mb=512.0, precomputed_mb=230.4, gpu_mb=38.2,
    bands=(("pot.0", (16,)), ("pot.1", (64, 32)), ("floor.0", ())),
)  # fmt: skip


def rows(status: PlacementStatus, selected: str | None) -> dict[str, tuple[str, str]]:
    """(value, explanation) by name."""
    return {name: (value, hint) for name, value, hint in figures(status, selected)}


def test_bands_of_the_selected_layer_are_shown_and_all_are_reported() -> None:
    value, hint = rows(STATUS, "pot.1")["Coefficients"]
    assert value == "30 of 64, bands 64 × 32"
    assert hint.endswith("\npot.0: bands 16\npot.1: bands 64 × 32\nfloor.0: no bands: fixed")
    assert rows(STATUS, None)["Coefficients"][0] == "30 of 64"
    assert rows(replace(STATUS, wanted_coefficients=0), "floor.0")["Coefficients"][0] == "–, no bands: fixed"


def test_memory_is_that_of_transport_and_of_the_graphics_card() -> None:
    value, hint = rows(STATUS, None)["Memory"]
    assert value == "512 MB, transport 230 MB" and "On the graphics card: 38 MB" in hint


def test_parts_of_the_error_are_reported_once_they_are_known() -> None:
    assert error_hint(STATUS) == "" == error_note(None, None)
    note = error_note(0.002, 0.0123)
    assert "still missing: 0.2 %" in note and note.endswith("two halves: 1.2 %")
    judged = replace(STATUS, estimate=ErrorEstimate(0.006, 0.017, 0.019), error_note=note)
    assert error_hint(judged) == f"direct light: 0.6 %\nlight between surfaces: 1.7 %\n{note}"


@pytest.mark.parametrize(
    ("status", "ink", "words"),
    [
        (Status(), look.TEXT_FAINT, "waiting"),
        (Status(picture="preview", image_error=None), look.ACCENT, "preview"),
        (Status(picture="refining", image_error=None), look.ACCENT, "refining"),
        (Status(picture="refining", image_error=0.25), look.ACCENT, "refining (error 0.25)"),
        (Status(picture="exact", image_error=0.0), look.GOOD, "finished"),
        (Status(picture="exact", estimate=ErrorEstimate(4e-4)), look.GOOD, "picture exact"),
        (Status(picture="finished", estimate=ErrorEstimate(0.006, 0.017)), look.GOOD, "finished, error about 1.8 %"),
        (Status(picture="exact", estimate=ErrorEstimate(0.08)), look.TEXT_SOFT, "finished, error about 8.0 %"),
        (
            Status(picture="refining", estimate=ErrorEstimate(None, None, 0.08, "pot")),
            look.ACCENT,
            "refining, error about 8.0 %, mostly on pot",
        ),
        (Status(picture="finished", image_error=0.021), look.TEXT_SOFT, "finished, noise 2.1 %"),
        (Status(picture="finished", image_error=3.76), look.BAD, "finished, noise 376.0 %"),
    ],
)
def test_the_bar_says_exact_of_nothing_that_is_not(status: Status, ink: look.Colour, words: str) -> None:
    assert picture_state(status)[:2] == (ink, words)


def test_what_is_seen_before_the_first_picture_is_said() -> None:
    words = picture_state(Status(picture="preview"), "Placement's picture")[1]
    assert words == "preview, Placement's picture"
    assert picture_state(Status(), HEADLIGHT)[1] == "waiting, headlight only"


@pytest.mark.gl
def test_the_plan_follows_what_is_editable(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    assert isinstance(editor._client, StandInClient)
    before = dict(editor.status.bands)
    assert before["wall.0"] == () and before["teapot.1"] == (64, 16) and before["tray.0"] == (64, 16)
    editor.do(SetEditable("tray", False))
    asked = len(editor._client.requests)
    assert window.run_until(lambda: len(editor._client.requests) > asked and editor.status.picture == "exact", 90.0)
    assert dict(editor.status.bands) == before | {"tray.0": ()}
    request = [r for r in editor._client.requests if isinstance(r, ComputeTransport)][-1]
    assert {layer.key for layer in request.scene.layers if layer.fixed} == {"tray.0", "wall.0"}
    editor.select("tray.0.theta_h")
    window.frames(3)
    assert editor.status.picture == "exact" and editor.status.wanted_coefficients == 0


@pytest.mark.gl
def test_a_message_goes_by_a_click_and_by_itself(window: HeadlessWindow) -> None:
    shell = window.shell
    shell.editor.notify("the disk is full", True)
    window.frames(2)
    window.click_handle("status.message")
    assert shell.state.message is None
    shell.editor.notify("the disk is full", True)  # once more: it is said once more
    window.frames(2)
    assert shell.state.message is not None
    assert "status.message" in shell.handles.names()
    window._time += ERROR_SECONDS
    window.frames(2)
    assert "status.message" not in shell.handles.names()
