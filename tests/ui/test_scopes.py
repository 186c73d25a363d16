"""Scopes over the picture: of what is shown, by a key and by the mouse."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.view_state import SetView
from engine.render.scopes import measure_scopes
from ui import scopes as sampled
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl


def test_they_count_what_is_shown(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    editor, source = window.shell.editor, window.shell.source
    assert isinstance(source, PictureFeed)
    editor.select(None)
    editor.do(SetView.of(exposure=-1.0, tone_mapping="linear"))
    window.frames(3)
    shown = source.shown(editor)
    assert shown is not None
    whole = source.source.renderer.display_image()
    scopes = sampled.scopes_of(shown)
    np.testing.assert_array_equal(scopes.waveforms, measure_scopes(whole).waveforms)
    monkeypatch.setattr(sampled, "SIDE", 16)  # every third column, every second row
    scopes = sampled.scopes_of(shown)
    assert (scopes.n_pixels, scopes.n_all) == (256, whole.shape[0] * whole.shape[1])
    np.testing.assert_array_equal(scopes.counts, measure_scopes(whole[1::2, 1::3]).counts)


def test_a_key_shows_them_and_the_mouse_chooses(window: HeadlessWindow) -> None:
    window.key(imgui.Key._0, imgui.Key.mod_ctrl)
    window.frames(3)
    assert window.shell.state.scope == "histogram"
    window.click_handle("button.scopes.log")
    window.frames(2)
    assert window.shell.state.scope_is_log
    for i, kind in ((1, "luma"), (2, "parade"), (0, "histogram")):
        window.click_handle(f"scopes.kind.{i}")
        window.frames(3)
        assert window.shell.state.scope == kind
    window.click_handle("button.scopes.close")
    window.frames(2)
    assert window.shell.state.scope == "" and "scopes.plot" not in window.shell.handles.names()
