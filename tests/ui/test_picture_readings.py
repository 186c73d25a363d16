"""Values of pixels and scopes are read from the GPU once for each picture, and are those of each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.document.commands.light import SetIntensity, SetRotation
from app.document.view_state import SetView
from engine.render.crop import Crop
from tests.ui.stand_in import HEIGHT, WIDTH
from ui import picture_readings
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed
from ui.pixel_values import pixel_values
from ui.scopes import scopes_of

pytestmark = pytest.mark.gl
PROBES = ((0.2, 0.3), (0.6, 0.7))


def feed_of(window: HeadlessWindow) -> PictureFeed:
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    return source


@pytest.fixture
def n_read(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What was read from the GPU."""
    found: list[str] = []
    for name in ("pixel_values", "scopes_of"):
        read = getattr(picture_readings, name)

        def noted(*arguments: object, name: str = name, read: object = read) -> object:
            found.append(name)
            return read(*arguments)  # type: ignore[operator]

        monkeypatch.setattr(picture_readings, name, noted)
    return found


def test_pins_and_scopes_are_read_once_for_a_picture(window: HeadlessWindow, n_read: list[str]) -> None:
    editor = window.shell.editor
    editor.do(SetView.of(probes=PROBES))
    window.shell.state = replace(window.shell.state, scope="histogram")
    window.frames(6)
    n_read.clear()
    window.frames(10)
    assert not n_read
    for zoom in (8.0, 20.0):  # the picture is the same
        editor.do(SetView.of(fit=False, zoom=zoom))
        window.frames(3)
    assert not n_read
    for command in (SetRotation(40.0), SetIntensity(2.0), SetView.of(exposure=1.0), SetView.of(gamma=2.0)):
        n_read.clear()
        editor.do(command)
        window.frames(3)
        assert window.run_until(lambda: feed_of(window).is_finished, 20)
        window.frames(5)
        assert set(n_read) == {"pixel_values", "scopes_of"}, command
        n_read.clear()
        window.frames(10)
        assert not n_read, command


def test_they_are_those_of_the_picture_that_is_shown(window: HeadlessWindow) -> None:
    editor, feed = window.shell.editor, feed_of(window)
    random, crop = np.random.default_rng(2), Crop(0.1, 0.2, 0.8, 0.9)
    for _ in range(25):
        editor.do(
            (
                SetRotation(random.uniform(0.0, 360.0)),
                SetIntensity(random.uniform(0.5, 2.0)),
                SetView.of(exposure=random.uniform(-2.0, 2.0)),
                SetView.of(tone_mapping=str(random.choice(["filmic", "linear", "false_colour"]))),
                SetView.of(hovered=random.choice(["tray", "wall"])),
            )[random.integers(5)]
        )
        window.frames(int(random.integers(3)))
        picture, pixel = feed.shown(editor), (int(random.integers(WIDTH)), int(random.integers(HEIGHT)))
        assert picture is not None
        for side in (1, 3):
            assert feed.values_at(editor, *pixel, side) == pixel_values(picture, *pixel, side)
        found = feed.scopes(editor, crop)
        assert found is not None
        np.testing.assert_array_equal(found.counts, scopes_of(picture, crop).counts)
