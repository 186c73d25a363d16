"""A right click puts a parameter back, a double click types one, solo shows a layer alone: in a window, by hand."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.layers import SetModel, SetParameter
from tests.ui.conftest import opened
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def window(context: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> Iterator[HeadlessWindow]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("INSITU_STATE", str(tmp_path_factory.mktemp("state")))
        yield from opened(context, (1280, 800), 1.0)


def value(window: HeadlessWindow, name: str) -> object:
    return window.shell.editor.document.layer("teapot.1").values[name]


def right_click(window: HeadlessWindow, handle: str) -> None:
    window.click(*window.shell.handle_position(handle), button=1)
    window.leave()


@pytest.mark.parametrize(
    ("name", "handle", "other"),
    [
        ("alpha", "material.alpha", 0.6),
        ("eta", "material.eta.g", (1.0, 2.0, 3.0)),
        ("distribution", "material.distribution", "beckmann"),
    ],
)
def test_right_click_puts_a_parameter_back(window: HeadlessWindow, name: str, handle: str, other: object) -> None:
    editor = window.shell.editor
    editor.do(SetParameter("teapot.1", name, other))
    window.frames(2)
    own = editor.scene_document.layer("teapot.1").values[name]
    assert value(window, name) == other != own
    right_click(window, handle)
    assert value(window, name) == own
    assert not editor.history.dragging and not imgui.is_any_item_active()
    editor.undo()  # one step
    assert value(window, name) == other
    editor.undo()


def test_right_click_puts_back_what_the_scene_has_and_else_the_default(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.select("teapot.0")
    own, default = (0.35, 0.12, 0.08), default_of(window, "teapot.0", "albedo")
    assert editor.document.layer("teapot.0").values["albedo"] == own != default
    editor.do(SetParameter("teapot.0", "albedo", (0.9, 0.1, 0.1)))
    window.frames(2)
    right_click(window, "material.albedo.r")
    assert editor.document.layer("teapot.0").values["albedo"] == own
    # The scene has no word on the parameters of another model.
    editor.do(SetModel("teapot.0", "phong"))
    editor.do(SetParameter("teapot.0", "exponent", 7.0))
    window.frames(2)
    right_click(window, "material.exponent")
    exponent = default_of(window, "teapot.0", "exponent")
    assert editor.document.layer("teapot.0").values["exponent"] == exponent != 7.0
    while editor.history.undo_steps:
        editor.undo()
    editor.select("teapot.1.theta_h")
    window.frames(2)


def default_of(window: HeadlessWindow, key: str, name: str) -> object:
    """The model's own default of a parameter."""
    return {p.name: p.default for p in window.shell.editor.document.layer(key).parameter_table}[name]


def test_right_click_leaves_fixed_objects_alone(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.select("wall")
    window.frames(2)
    before = editor.document
    right_click(window, "material.albedo.r")
    assert editor.document == before
    editor.select("teapot.1.theta_h")
    window.frames(2)


def test_double_click_types_a_number(window: HeadlessWindow) -> None:
    x, y = window.shell.handle_position("material.alpha")
    window.move(x, y)
    for _ in range(2):
        window.press()
        window.release()
    window.type("0.37")
    window.key(imgui.Key.enter)
    window.leave()
    assert value(window, "alpha") == pytest.approx(0.37)


def test_a_double_click_is_one_however_slowly_it_is_heard(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("ui.shell.EVENT_SECONDS", 0.0)  # one act a frame, and frames of a quarter of a second
    monkeypatch.setattr("ui.headless.FRAME_SECONDS", 0.25)
    window.move(*window.shell.handle_position("material.alpha"))
    window.frames(2)
    events = window.shell.events
    for pressed in (True, False, True, False):
        events.button(0, pressed)
    for character in "0.41":
        events.character(ord(character))
    while not events.is_empty:
        window.frame()
    window.key(imgui.Key.enter)
    window.leave()
    assert value(window, "alpha") == pytest.approx(0.41)


def test_solo_shows_one_layer_and_is_no_edit(window: HeadlessWindow) -> None:
    editor, source = window.shell.editor, window.shell.source
    assert isinstance(source, PictureFeed)

    def radiance() -> np.ndarray:
        window.frames(3)
        return source.source.renderer.linear_image().astype(float)

    document, whole = editor.document, radiance()
    window.click_handle("button.solo.teapot.1")
    coat = radiance()
    window.click_handle("button.solo.teapot.0")
    base = radiance()
    assert editor.view.solo == "teapot.0" and editor.document is document
    # The teapot is the picture's left quarter: its layers are a sum, all else is as it was.
    assert base[:, :12] + coat[:, :12] == pytest.approx(whole[:, :12], rel=2e-3, abs=1e-4)
    assert np.array_equal(base[:, 12:], whole[:, 12:]) and base[:, :12].max() > 0.0
    window.key(imgui.Key.slash)  # the selected layer is the coat
    assert editor.view.solo == "teapot.1"
    window.key(imgui.Key.slash)
    assert editor.view.solo is None and radiance() == pytest.approx(whole, rel=1e-5)
