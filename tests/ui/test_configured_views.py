"""Views of OpenColorIO configurations in the window: opened, chosen, missing, saved with the session."""

from pathlib import Path

import numpy as np
import pytest

from app.document.view_state import SetView, ViewState
from app.files.session import load_session, save_session
from engine.core.colour import ConfigView
from engine.core.colour_config import config_transform
from tests.colour_configs import write_config
from ui.gl.view_transform import is_view_ready
from ui.headless import HeadlessWindow
from ui.panels.actions import OpenConfig
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl


def settle(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    window.frames(2)
    assert window.run_until(lambda: is_view_ready(editor.view.tone_mapping, editor.colours), 20)
    window.frames(2)


def test_a_configuration_is_opened_and_its_views_are_chosen(window: HeadlessWindow, tmp_path: Path) -> None:
    shell, editor, config = window.shell, window.shell.editor, write_config(tmp_path)
    editor.select(None)
    shell.do(OpenConfig(config))
    settle(window)
    assert editor.view.tone_mapping == ConfigView(str(config), "Monitor", "Plain")  # its default, by its names
    assert "scene_linear is taken as linear Rec. 709" in editor.status.message
    source = shell.source
    assert isinstance(source, PictureFeed)
    renderer = source.source.renderer
    for view in (editor.view.tone_mapping, ConfigView(str(config), "Projector", "Plain", "Warm")):
        editor.do(SetView.of(tone_mapping=view))
        settle(window)
        expected = 255.0 * config_transform(renderer.linear_image(), view)
        assert np.abs(renderer.display_image() - expected).max() <= 2.0, view
        still = source.still(editor)
        assert still is not None and np.abs(255.0 * still.shown - expected).max() <= 2.0
    window.click(*shell.handle_position("view.tone_mapping"))
    window.frames(3)
    window.click(*shell.handle_position("menu.colours.Projector.Cube"))
    settle(window)
    assert editor.view.tone_mapping == ConfigView(str(config), "Projector", "Cube", "Warm")


def test_the_environments_configuration_is_offered(
    window: HeadlessWindow, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OCIO", str(write_config(tmp_path)))
    editor = window.shell.editor
    assert window.run_until(lambda: bool(editor.colours.catalogues), 20)
    assert editor.view.tone_mapping == "filmic" and not editor.status.is_error


def test_one_that_is_missing_is_said_once_and_the_view_stays(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    editor.select(None)
    window.frames(2)
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    before = source.source.renderer.display_image()
    missing = ConfigView(str(tmp_path / "gone.ocio"), "Monitor", "Plain")
    editor.do(SetView.of(tone_mapping=missing))
    settle(window)
    assert editor.status.is_error and "gone.ocio" in editor.status.message
    number = editor.status.message_number
    window.frames(5)
    assert editor.status.message_number == number and editor.view.tone_mapping == missing  # what a session has stays
    np.testing.assert_array_equal(source.source.renderer.display_image(), before)
    write_config(tmp_path)
    window.shell.do(OpenConfig(tmp_path / "small.ocio"))
    settle(window)
    assert isinstance(editor.view.tone_mapping, ConfigView) and editor.view.tone_mapping.view == "Plain"


def test_sessions_have_it_by_a_path_beside_them(window: HeadlessWindow, tmp_path: Path) -> None:
    document = window.shell.editor.document
    for view in (ConfigView(str(tmp_path / "small.ocio"), "Monitor", "Film", "Warm"), ConfigView("ocio://default")):
        path = save_session(tmp_path / "look.insitu", document, ViewState(tone_mapping=view, gamma=1.5))
        assert str(tmp_path) not in path.read_text().partition("[view]")[2].partition("[[object]]")[0]
        found = load_session(path).view
        assert found.tone_mapping == view and found.gamma == 1.5
