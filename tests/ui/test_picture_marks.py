"""Crop and pinned pixels: by keys and the mouse, saved with the session, in scopes, errors and files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from imgui_bundle import imgui
from PIL import Image

from app.document.commands.light import SetRotation
from app.document.view_state import MOST_PROBES, SetView
from engine.render.crop import Crop, cropped
from engine.render.picture_difference import errors
from engine.render.picture_files import read_picture
from engine.render.scopes import measure_scopes
from tests.ui.stand_in import HEIGHT, WIDTH
from ui import scopes
from ui.headless import HeadlessWindow
from ui.panels.actions import SavePicture
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl
Key = imgui.Key


def source_of(window: HeadlessWindow) -> PictureFeed:
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    return source


def corner_and_scale(window: HeadlessWindow) -> tuple[float, float, float]:
    window.move(*window.shell.handle_position("viewport.centre"))
    window.frames(2)
    x, y = window.shell.handle_position("viewport.corner")
    middle = window.shell.handle_position("viewport.centre")
    view = window.shell.editor.view
    return x, y, 2.0 * (middle[0] - x) / WIDTH if view.fit else view.zoom


def test_a_crop_is_drawn_by_the_mouse_also_beside_the_picture_and_removed_by_a_key(window: HeadlessWindow) -> None:
    editor, shell = window.shell.editor, window.shell
    x, y, scale = corner_and_scale(window)
    document = editor.document
    window.key(Key.b, Key.mod_ctrl)
    window.frames(2)
    assert shell.state.draws_crop
    start, end = (x + 12.0 * scale, y + 8.0 * scale), (x + 36.0 * scale, y + 24.0 * scale)
    window.drag(end, start)  # from the lower right
    window.frames(2)
    assert editor.view.crop is not None and not shell.state.draws_crop and editor.document is document
    assert editor.view.crop.box((WIDTH, HEIGHT)) == pytest.approx((12, 8, 24, 16), abs=1)
    assert editor.undo_label is None  # a view is no edit
    window.key(Key.b, Key.mod_ctrl)
    window.frames(2)
    window.drag(start, (x + 5000.0, y + 5000.0))
    window.frames(2)
    assert editor.view.crop[2:] == (1.0, 1.0)
    before = editor.view.crop
    window.key(Key.b, Key.mod_ctrl)
    window.frames(2)
    window.click(*start)  # a quick click draws none
    window.frames(2)
    assert editor.view.crop == before and not shell.state.draws_crop
    window.key(Key.b, Key.mod_ctrl, Key.mod_alt)
    window.frames(2)
    assert editor.view.crop is None


def test_escape_takes_back_the_crop_that_is_being_drawn_and_then_leaves(window: HeadlessWindow) -> None:
    editor, shell = window.shell.editor, window.shell
    x, y, scale = corner_and_scale(window)
    editor.do(SetView.of(crop=(0.1, 0.1, 0.9, 0.9)))
    window.key(Key.b, Key.mod_ctrl)
    window.frames(2)
    window.move(x + 10.0 * scale, y + 10.0 * scale)
    window.frames(1)
    window.press()
    window.frames(2)
    window.move(x + 30.0 * scale, y + 20.0 * scale)
    window.frames(2)
    assert editor.view.crop != (0.1, 0.1, 0.9, 0.9)
    window.key(Key.escape)
    window.frames(2)
    assert editor.view.crop == (0.1, 0.1, 0.9, 0.9) and shell.state.grip is None
    window.release()
    window.frames(2)
    assert editor.view.crop == (0.1, 0.1, 0.9, 0.9)
    window.key(Key.escape)
    window.frames(2)
    assert not shell.state.draws_crop and not editor.history.dragging


def test_scopes_errors_and_files_are_of_the_crop(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, shell, source = window.shell.editor, window.shell, source_of(window)
    editor.select(None)
    crop = Crop(0.25, 0.25, 0.75, 0.5)
    editor.do(SetView.of(tone_mapping="linear", crop=crop))
    window.key(Key.c, Key.mod_shift)
    window.frames(3)
    stored = source.still(editor)
    editor.do(SetRotation(80.0))
    window.frames(2)
    assert window.run_until(lambda: not shell.awaits_difference, 20)
    shown, still = source.shown(editor), source.still(editor)
    assert shown is not None and stored is not None and still is not None
    error = shell._pictures.difference.board(False).error
    assert error == pytest.approx(errors(cropped(still.radiance, crop), cropped(stored.radiance, crop)).rmse, rel=1e-5)
    whole = source.source.renderer.display_image()
    found = scopes.scopes_of(shown, crop)
    np.testing.assert_array_equal(found.counts, measure_scopes(cropped(whole, crop)).counts)
    for action, shape in (
        (SavePicture(tmp_path / "a.png"), cropped(whole, crop).shape),
        (SavePicture(tmp_path / "b.png", cropped=False), whole.shape),
    ):
        shell.request(action)
        assert window.run_until(action.path.exists, 20)
        window.frames(3)
        assert np.asarray(Image.open(action.path)).shape == shape
    shell.request(SavePicture(tmp_path / "a.exr"))
    assert window.run_until((tmp_path / "a.exr").exists, 20)
    window.frames(3)
    read = read_picture(tmp_path / "a.exr")
    assert read.shape == still.radiance.shape and read[0].max() == 0.0
    np.testing.assert_allclose(cropped(read, crop), cropped(still.radiance, crop), rtol=1e-6)


def test_pixels_are_pinned_where_the_mouse_is_stay_while_zoomed_and_are_unpinned(window: HeadlessWindow) -> None:
    editor, shell = window.shell.editor, window.shell
    x, y, scale = corner_and_scale(window)
    for column, row in ((10, 8), (30, 20)):
        window.move(x + (column + 0.3) * scale, y + (row + 0.6) * scale)
        window.frames(2)
        window.key(Key.q, Key.mod_shift, Key.mod_alt)
        window.frames(2)
    assert editor.view.probes == ((10.5 / WIDTH, 8.5 / HEIGHT), (30.5 / WIDTH, 20.5 / HEIGHT))
    assert "button.probe.2" in shell.handles.names()
    editor.do(SetView.of(fit=False, zoom=40.0, centre=editor.view.probes[1]))
    window.frames(3)
    # A pixel that is large is pinned once, and unpinned, wherever the mouse is in it.
    middle = shell.handle_position("viewport.centre")
    for n_pinned in (1, 2):
        window.move(middle[0] + (15.0 if n_pinned == 1 else -15.0), middle[1] + 14.0)
        window.frames(2)
        window.key(Key.q, Key.mod_shift, Key.mod_alt)
        window.frames(2)
        assert len(editor.view.probes) == n_pinned
    at, middle = shell.handle_position("viewport.probe.2"), shell.handle_position("viewport.centre")
    assert at == pytest.approx(middle, abs=1.5)  # the centre of the view
    window.move(*at)
    window.frames(2)
    window.key(Key.q, Key.mod_shift, Key.mod_alt)
    window.frames(2)
    assert editor.view.probes == ((10.5 / WIDTH, 8.5 / HEIGHT),)
    editor.do(SetView.of(fit=True))
    window.frames(3)
    window.click_handle("button.probe.1")
    window.frames(2)
    assert editor.view.probes == ()
    editor.do(SetView.of(probes=tuple((i / 20.0, 0.5) for i in range(30))))
    assert len(editor.view.probes) == MOST_PROBES
