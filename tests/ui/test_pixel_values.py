"""The values of the pixel under the mouse: those of the picture, and its colour on screen."""

from __future__ import annotations

import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.light import SetBackground, SetIntensity
from app.document.view_state import SetView
from tests.ui.stand_in import HEIGHT, WIDTH
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

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

    def noted(feed: PictureFeed, editor: object, column: int, row: int) -> object:
        asked.append((column, row))
        return values_at(feed, editor, column, row)  # type: ignore[arg-type]

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
