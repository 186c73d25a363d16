"""The trade-off panel tells the plan: bands, precision and memory, as they are."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.commands import SetEditable
from app.jobs.messages import ComputeTransport
from app.status import Status
from tests.ui.stand_in import StandInClient
from ui.headless import HeadlessWindow
from ui.panels.tradeoff import figures

STATUS = Status(
    shown_coefficients=30, wanted_coefficients=64, memory_mb=512.0, transport_mb=230.4, gpu_mb=38.2,
    bands=(("pot.0", (16,)), ("pot.1", (64, 32)), ("floor.0", ())),
)  # fmt: skip


def rows(status: Status, selected: str | None) -> dict[str, tuple[str, str]]:
    """(value, explanation) by name."""
    return {name: (value, hint) for name, value, hint in figures(status, selected)}


def test_bands_of_the_selected_layer_are_shown_and_all_are_told() -> None:
    value, hint = rows(STATUS, "pot.1")["Coefficients"]
    assert value == "30 of 64, bands 64 × 32"
    assert hint.endswith("\npot.0: bands 16\npot.1: bands 64 × 32\nfloor.0: no bands: fixed")
    assert rows(STATUS, None)["Coefficients"][0] == "30 of 64"
    assert rows(replace(STATUS, wanted_coefficients=0), "floor.0")["Coefficients"][0] == "–, no bands: fixed"


def test_memory_is_that_of_transport_and_of_the_graphics_card() -> None:
    value, hint = rows(STATUS, None)["Memory"]
    assert value == "512 MB, transport 230 MB" and "On the graphics card: 38 MB" in hint


def test_noise_is_told_once_it_is_known() -> None:
    assert "noise" not in rows(STATUS, None)["Image error"][0]
    noisy = replace(STATUS, image_error=0.002, indirect_noise=0.0123)
    assert rows(noisy, None)["Image error"][0] == "0.002, indirect noise 1.2 %"


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
    assert {layer.key for layer in request.layers if layer.fixed} == {"tray.0", "wall.0"}
    editor.select("tray.0.theta_h")
    window.frames(3)
    assert editor.status.picture == "exact" and editor.status.wanted_coefficients == 0
