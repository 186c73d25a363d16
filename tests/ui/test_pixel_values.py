"""The values of the pixel under the mouse: those of the picture, and its colour on screen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.light import SetBackground, SetIntensity
from app.document.view_state import SetView
from engine.core.colour import encode_srgb
from tests.ui.stand_in import HEIGHT, WIDTH
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed
from ui.pixel_values import PixelValues

pytestmark = pytest.mark.gl


def feed_of(window: HeadlessWindow) -> PictureFeed:
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    return source


def test_they_are_those_of_the_picture(window: HeadlessWindow) -> None:
    editor, feed = window.shell.editor, feed_of(window)
    editor.select(None)
    for command in (SetIntensity(3.0), SetBackground("transparent"), SetView.of(exposure=-1.0, tone_mapping="linear")):
        editor.do(command)
        window.frames(2)
        renderer = feed.source.renderer
        linear, shown = renderer.linear_image_with_alpha(), renderer.display_image()
        for column, row in ((0, 0), (WIDTH - 1, 0), (3, HEIGHT - 1), (WIDTH // 2, HEIGHT // 2)):
            values = feed.values_at(editor, column, row)
            assert values is not None and values.shown == tuple(shown[row, column])
            np.testing.assert_allclose(values.radiance, 3.0 * linear[row, column, :3], rtol=1e-6)
            assert values.alpha == linear[row, column, 3]


def test_a_key_shows_them_and_takes_them_away(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[int, int]] = []
    values_at = PictureFeed.values_at

    def noted(feed: PictureFeed, editor: object, column: int, row: int, side: int) -> object:
        asked.append((column, row))
        return values_at(feed, editor, column, row, side)  # type: ignore[arg-type]

    monkeypatch.setattr(PictureFeed, "values_at", noted)
    window.move(*window.shell.handle_position("viewport.centre"))
    window.frames(2)
    assert not asked
    window.key(imgui.Key.q)
    window.frames(2)
    column, row = asked[-1]
    assert abs(column - WIDTH // 2) <= 1 and abs(row - HEIGHT // 2) <= 1 and window.shell.state.shows_values
    window.key(imgui.Key.q)
    window.frames(2)
    n_asked = len(asked)
    window.frames(2)
    assert len(asked) == n_asked


def test_the_mean_of_a_square_is_that_of_its_pixels(window: HeadlessWindow) -> None:
    editor, feed = window.shell.editor, feed_of(window)
    editor.select(None)
    editor.do(SetView.of(tone_mapping="linear", zebra=True, picture_channel="red"))  # neither is measured
    window.frames(2)
    linear = feed.source.renderer.linear_image_with_alpha()
    edge = WIDTH // 4  # between teapot and tray
    for (column, row), part in (((edge, 9), linear[7:12, edge - 2 : edge + 3]), ((0, 0), linear[:3, :3])):
        values = feed.values_at(editor, column, row, 5)
        assert values is not None
        np.testing.assert_allclose(values.radiance, part[..., :3].mean(axis=(0, 1)), rtol=1e-5)
        encoded = encode_srgb(np.clip(part[..., :3], 0.0, 1.0)).mean(axis=(0, 1))
        np.testing.assert_allclose(values.shown, 255.0 * encoded, atol=1.0)


def test_stops_count_from_middle_grey() -> None:
    values = PixelValues((0.72, 0.72, 0.72), 1.0, (0, 128, 255))
    assert values.stops == pytest.approx(2.0) and values.luminance == pytest.approx(0.72)
    assert values.lines()[-1].endswith("#0080ff") and "+2.00 stops" in values.lines()[1]
    assert PixelValues((0.0, 0.0, 0.0), 1.0, (0, 0, 0)).stops == -math.inf


def test_a_key_copies_them_and_another_takes_the_mean_of_more(window: HeadlessWindow) -> None:
    window.move(*window.shell.handle_position("viewport.centre"))
    window.frames(2)
    window.key(imgui.Key.q, imgui.Key.mod_shift)
    window.frames(3)
    copied = imgui.get_clipboard_text()
    assert copied.startswith(f"{WIDTH // 2}, {HEIGHT // 2}") and "linear" in copied and "#" in copied
    assert not window.shell.state.shows_values and not window.shell.state.copies_values
    for side in (3, 5, 1):
        window.key(imgui.Key.q, imgui.Key.mod_alt)
        window.frames(2)
        assert window.shell.state.values_side == side


def test_keys_magnify_about_the_mouse_and_values_stay_those_of_the_pixel_under_it(window: HeadlessWindow) -> None:
    editor, x, y = window.shell.editor, *window.shell.handle_position("viewport.centre")
    window.move(x + 37.0, y - 21.0)
    window.frames(2)
    before = window.shell.handle_position("viewport.corner")
    for _ in range(20):
        window.key(imgui.Key.equal, imgui.Key.mod_ctrl)
    window.frames(3)
    assert not editor.view.fit and editor.view.zoom > 20.0
    after = window.shell.handle_position("viewport.corner")
    scale = (x - before[0]) / (WIDTH / 2)  # as it was fitted
    # The place of the picture under the mouse is the one that was there.
    place = [(at - corner) / scale for at, corner in zip((x + 37.0, y - 21.0), before, strict=True)]
    moved = [(at - c) / editor.view.zoom for at, c in zip((x + 37.0, y - 21.0), after, strict=True)]
    np.testing.assert_allclose(moved, place, atol=0.1)
    for _ in range(20):
        window.key(imgui.Key.minus, imgui.Key.mod_ctrl)
    window.frames(3)
    assert editor.view.fit or editor.view.zoom <= scale * 1.01
