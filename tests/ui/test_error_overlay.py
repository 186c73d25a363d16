"""Where the picture is off, laid over it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from imgui_bundle import imgui

from app.messages.editor_status import Status
from app.modes.placement.placement_controller import PlacementController
from ui.headless import HeadlessWindow
from ui.panels.viewport import ERROR_AWAITED, ERROR_UNKNOWN, error_missing

pytestmark = pytest.mark.gl


def test_a_key_lays_it_over_the_picture_and_takes_it_off(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    editor = window.shell.editor
    window.leave()
    before = window.pixels()
    source = window.shell.source
    assert source is not None and source.picture is not None
    colours = np.full((source.picture.height, source.picture.width, 4), 255, np.uint8)
    colours[:, :, 1:3] = 0
    status = PlacementController.status
    monkeypatch.setattr(
        PlacementController, "status", lambda controller, told: replace(status(controller, told), error_colours=colours)
    )
    assert isinstance(editor.status, Status) and not editor.view.shows_error
    window.key(imgui.Key.e)
    window.leave()
    x, y = (round(place) for place in window.shell.handle_position("viewport.centre"))
    assert editor.view.shows_error and window.pixels()[y, x].tolist() == [255, 0, 0]
    window.key(imgui.Key.e)
    window.leave()
    assert not editor.view.shows_error and (window.pixels()[y, x] == before[y, x]).all()


def test_nobody_is_told_to_wait_for_what_will_not_come() -> None:
    assert error_missing(Status(picture="finished")) == ERROR_AWAITED
    assert error_missing(Status()) == ERROR_UNKNOWN
    assert error_missing(Status(picture="finished", no_estimate_reason="no paths")) == "no paths"
