"""A stored picture beside the present one: by keys, the mouse and scripts; the number follows edits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.light import SetIntensity, SetRotation
from app.document.view_state import DIFFERENCES, SetView
from app.editor.stored_pictures import MOST_PICTURES
from app.modes.placement.placement_controller import PlacementController
from engine.render.display import exr_bytes
from engine.render.picture_difference import difference_colours, errors
from tests.ui.stand_in import HEIGHT, WIDTH
from ui import difference_feed
from ui.gl import row_bands
from ui.gl.context import GraphicsError
from ui.gl.gpu_memory import read_texture
from ui.headless import HeadlessWindow
from ui.panels.actions import StorePicture
from ui.panels.stored_pictures import error_text
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl


def present(window: HeadlessWindow) -> np.ndarray:
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    still = source.still(window.shell.editor)
    assert still is not None
    return still.radiance


def settle(window: HeadlessWindow) -> None:
    window.frames(2)
    assert window.run_until(lambda: not window.shell.awaits_difference, 20)
    window.frames(2)


def store(window: HeadlessWindow) -> None:
    window.key(imgui.Key.c, imgui.Key.mod_shift)
    settle(window)


def feed_of(window: HeadlessWindow) -> difference_feed.DifferenceFeed:
    return window.shell._pictures.difference


def test_the_number_is_that_of_the_picture_after_edits(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_bands, "BAND_PIXELS", 3 * WIDTH)  # several frames for a picture
    editor = window.shell.editor
    store(window)
    before = present(window)
    assert editor.view.stored == "Picture 1" and feed_of(window).board(False).error == 0.0
    for command in (SetIntensity(1.5), SetRotation(70.0), SetIntensity(1.0)):
        editor.do(command)
        settle(window)
        found = feed_of(window).board(False)
        assert found.error == pytest.approx(errors(present(window), before).rmse, rel=1e-5)
        assert not found.refusal
        assert window.run_until(lambda: not feed_of(window).board(False).is_behind, 20)  # of the panels' next frame
    editor.undo(), editor.undo(), editor.undo()
    settle(window)
    assert feed_of(window).board(False).error == pytest.approx(0.0, abs=1e-6)
    compared = editor.stored.compared
    assert compared is not None and (compared.light[..., 3] == 1.0).all()


def test_a_picture_is_stored_as_it_was_when_the_key_was_pressed(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(row_bands, "BAND_PIXELS", 3 * WIDTH)  # a frame for each three rows
    editor, before = window.shell.editor, present(window)
    for _ in range(2):
        window.shell.request(StorePicture())
        window.frames(1)
        editor.do(SetIntensity(2.0))
        window.frames(1)
        assert window.shell.saving.is_storing
    assert not editor.stored.names
    settle(window)
    first, second = (editor.stored.picture(name).light for name in ("Picture 1", "Picture 2"))
    np.testing.assert_allclose(first[..., :3], before, rtol=1e-6)
    np.testing.assert_allclose(second[..., :3], 2.0 * before, rtol=1e-5)
    assert editor.view.stored == "Picture 2" and not window.shell.saving.is_storing


def test_no_frame_moves_more_than_a_band(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    band, editor = 5 * WIDTH, window.shell.editor
    monkeypatch.setattr(row_bands, "BAND_PIXELS", band)
    moved: list[int] = []
    for kind, name in ((moderngl.Framebuffer, "read"), (moderngl.Texture, "write"), (moderngl.Texture, "read")):
        move = getattr(kind, name)

        def noted(thing: Any, *arguments: Any, move: Any = move, **named: Any) -> Any:
            box = named.get("viewport") or (0, 0, *thing.size)
            moved.append(box[2] * box[3])
            return move(thing, *arguments, **named)

        monkeypatch.setattr(kind, name, noted)
    window.frames(3)
    moved.clear()
    window.shell.request(StorePicture())
    for kind in ("split", "signed", "absolute"):
        editor.do(SetView.of(difference=kind))
        n_moved = 0
        while window.shell.awaits_difference or not n_moved:
            window.frame()
            assert max(moved, default=0) <= band and len(moved) <= 4, kind  # other panels have textures, too
            n_moved, moved[:] = n_moved + sum(moved), []
        assert n_moved >= WIDTH * HEIGHT


def test_a_thirteenth_picture_is_refused_before_it_is_read(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    for _ in range(MOST_PICTURES):
        window.shell.request(StorePicture())
        window.frames(1)
    settle(window)
    window.shell.request(StorePicture())
    window.frames(1)
    assert editor.status.is_error and "remove one first" in editor.status.message
    assert not window.shell.saving.is_storing and len(editor.stored.names) == MOST_PICTURES


def test_false_colours_and_the_stored_picture_are_drawn(window: HeadlessWindow) -> None:
    editor, shell = window.shell.editor, window.shell
    editor.select(None)
    editor.do(SetView.of(tone_mapping="linear", exposure=0.5))
    window.frames(3)
    source = shell.source
    assert isinstance(source, PictureFeed)
    store(window)
    before, shown_before = present(window), source.source.renderer.display_image()
    editor.do(SetIntensity(1.01))
    for kind in ("signed", "absolute"):
        editor.do(SetView.of(difference=kind))
        settle(window)
        texture = feed_of(window)._colours
        assert texture is not None
        expected = difference_colours(present(window), before, kind)
        np.testing.assert_array_equal(read_texture(texture, np.uint8)[..., :3], expected)
    editor.do(SetView.of(difference="stored"))
    settle(window)
    drawn = feed_of(window)._texture
    assert drawn is not None
    assert np.abs(read_texture(drawn, np.uint8)[..., :3].astype(int) - shown_before).max() <= 1
    # It follows the exposure of the view.
    editor.do(SetIntensity(1.0))
    editor.do(SetView.of(exposure=-1.0))
    settle(window)
    now = source.source.renderer.display_image().astype(int)
    assert np.abs(read_texture(drawn, np.uint8)[..., :3].astype(int) - now).max() <= 1


def test_keys_and_the_mouse_choose_what_is_shown(window: HeadlessWindow) -> None:
    editor, shell = window.shell.editor, window.shell
    window.key(imgui.Key.c, imgui.Key.mod_alt)
    window.frames(2)
    assert shell.state.message is not None and "store one first" in shell.state.message.text
    store(window)
    store(window)
    seen = [editor.view.difference]
    for _ in DIFFERENCES:
        window.key(imgui.Key.c, imgui.Key.mod_alt)
        window.frames(2)
        seen.append(editor.view.difference)
    assert set(seen) == set(DIFFERENCES) and seen[0] == seen[-1]
    for i, each in enumerate(DIFFERENCES):
        window.click_handle(f"stored.show.{i}")
        settle(window)
        assert editor.view.difference == each
    window.click_handle("stored.name")
    window.frames(2)
    window.click_handle("stored.name.Picture 1")
    window.frames(2)
    assert editor.view.stored == "Picture 1"
    window.click_handle("button.stored.remove")
    window.frames(2)
    assert editor.stored.names == ("Picture 2",) and editor.view.stored == ""
    window.click_handle("menu.View")
    window.frames(3)
    window.click_handle("menu.Stored pictures")
    window.frames(3)
    window.click_handle("menu.stored.0")
    window.frames(3)
    assert editor.view.stored == "Picture 2"
    window.click_handle("button.stored.close")
    window.frames(2)
    assert editor.view.stored == "" and editor.stored.names == ("Picture 2",)


def test_the_divider_is_dragged_and_stays_within_the_picture(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    store(window)
    editor.do(SetView.of(difference="split"))
    settle(window)
    x, y = window.shell.handle_position("viewport.divider")
    window.drag((x, y + 40.0), (x - 60.0, y + 40.0))
    window.frames(2)
    assert 0.0 < editor.view.compare_divider < 0.5
    window.drag((x - 60.0, y + 40.0), (x - 5000.0, y + 40.0))  # far beside the window
    window.frames(2)
    assert editor.view.compare_divider == 0.0


def test_a_picture_that_does_not_fit_the_graphics_card_is_refused_and_waited_for_no_longer(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise GraphicsError("no memory")

    editor = window.shell.editor
    monkeypatch.setattr(feed_of(window)._memory, "texture", refuse)
    store(window)
    board = feed_of(window).board(False)
    assert (board.refusal, board.stored, board.error) == ("no memory", None, None)
    editor.do(SetIntensity(2.0))
    settle(window)
    assert feed_of(window).board(False).refusal == "no memory"


def test_false_colours_of_another_kind_are_not_shown_meanwhile(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    store(window)
    editor.do(SetView.of(difference="signed"))
    settle(window)
    assert feed_of(window).board(False).colours is not None
    editor.do(SetView.of(difference="absolute"))
    feed_of(window).follow(editor, window.shell.source)
    assert feed_of(window).board(False).colours is None
    settle(window)
    assert feed_of(window).board(False).colours is not None


def test_a_legend_stands_over_its_own_colours_alone(window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    editor, colours = window.shell.editor, np.full((HEIGHT, WIDTH, 4), 255, np.uint8)
    status = PlacementController.status
    monkeypatch.setattr(
        PlacementController, "status", lambda controller, told: replace(status(controller, told), error_colours=colours)
    )
    store(window)

    def legends() -> set[str]:
        window.frames(2)
        settle(window)
        return {"viewport.stops", "viewport.errors"} & set(window.shell.handles.names())

    # Stops, the error map and the difference are seen one over the other: the uppermost has the legend.
    editor.do(SetView.of(tone_mapping="false_colour", difference="present"))
    assert legends() == {"viewport.stops"}
    editor.do(SetView.of(picture_channel="alpha"))  # shown as it is
    assert legends() == set()
    editor.do(SetView.of(picture_channel="red", difference="signed"))
    assert legends() == {"viewport.errors"}
    editor.do(SetView.of(difference="stored", shows_error=True))  # through the view, over the error map
    assert legends() == {"viewport.stops"}
    editor.do(SetView.of(difference="split"))  # beside it
    assert legends() == {"viewport.stops", "viewport.errors"}
    editor.do(SetView.of(difference="present"))
    assert legends() == {"viewport.errors"}


def test_the_legend_stands_above_the_scopes(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    store(window)
    editor.do(SetView.of(difference="absolute"))
    settle(window)
    window.key(imgui.Key._0, imgui.Key.mod_ctrl)
    window.frames(3)
    plot, legend = (window.shell.handle_position(name) for name in ("scopes.plot", "viewport.errors"))
    # The plot's middle is 60 + 46 below the strip's upper edge; the legend is 50 high.
    assert legend[1] + 50.0 < plot[1] - 60.0 - 46.0


def test_the_zoom_is_said_beside_the_legend_of_stops(window: HeadlessWindow) -> None:
    window.shell.editor.do(SetView.of(fit=False, zoom=8.0, tone_mapping="false_colour"))
    window.frames(2)
    zoom, stops = (window.shell.handle_position(name) for name in ("viewport.zoom", "viewport.stops"))
    assert zoom[0] + 10.0 < stops[0]  # the plate around it is 6 wider


def test_another_size_is_said_and_no_number_is_shown(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    file = tmp_path / "small.exr"
    file.write_bytes(exr_bytes(np.ones((HEIGHT, WIDTH + 1, 3), np.float32)))
    editor.stored.load(file)
    assert window.run_until(lambda: not editor.stored.is_reading, 20)
    settle(window)
    board = feed_of(window).board(False)
    assert board.error is None and board.colours is None
    editor.do(SetView.of(difference="split"))
    window.frames(2)
    assert "viewport.divider" not in window.shell.handles.names()  # both of its sides would be the present picture
    assert board.refusal.startswith(f"small.exr: {WIDTH + 1} x {HEIGHT} pixels, expected {WIDTH} x {HEIGHT}")
    file.write_bytes(exr_bytes(present(window)))
    editor.stored.load(file)
    assert window.run_until(lambda: not editor.stored.is_reading, 20)
    settle(window)
    assert feed_of(window).board(False).error == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (0.0, "0.00 %"),
        (0.00012345, "0.0123 %"),
        (0.018, "1.80 %"),
        (0.9996, "100 %"),
        (1.11, "111 %"),
        (25.0, "2500 %"),
    ],
)
def test_the_number_has_three_digits(error: float, text: str) -> None:
    assert error_text(error) == text
