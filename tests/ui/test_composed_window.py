"""Objects that are duplicated and deleted in the window: the picture is that of a scene file with these objects, and
undo brings back the picture before."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands import SetTransform
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from tests.engine.scene.conftest import TRIANGLE_PLY
from tests.scene_text import material, placed, scaled
from tests.ui.small_scene import (
    BASE,
    COAT,
    SCENE,
    CountingClient,
    linear_picture,
    opened_window,
    wait_until_exact,
    write_small_scene,
)
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl

SECOND = placed("second", "sphere", scaled(0.9, (0.75, 0.5, 0.25)), material(BASE, COAT))


def opened(context: moderngl.Context, folder: Path, text: str) -> Iterator[HeadlessWindow]:
    folder.mkdir(exist_ok=True)
    client = CountingClient(RequestDispatcher(ArrayCache(folder / "cache")))
    with opened_window(context, write_small_scene(folder, text), client, n_lights=400, resolution=(48, 32)) as window:
        wait_until_exact(window)
        yield window


def exact_picture(window: HeadlessWindow) -> np.ndarray:
    window.frames(3)
    wait_until_exact(window)
    status = window.shell.editor.status
    assert not status.is_error, status
    return linear_picture(window)


def test_placement_shows_what_a_file_with_these_objects_shows(context: moderngl.Context, tmp_path: Path) -> None:
    (there,) = [exact_picture(each) for each in opened(context, tmp_path / "b", SCENE + SECOND)]
    for window in opened(context, tmp_path / "a", SCENE):
        editor, before = window.shell.editor, exact_picture(window)
        open_menu(window, "ball")
        window.click_handle("objects.ball.duplicate")
        open_menu(window, "ball 2")
        window.click_handle("objects.ball 2.name")
        window.type("second")
        window.key(imgui.Key.enter)
        editor.do(SetTransform("second", (0.75, 0.0, 0.25)))
        found = exact_picture(window)
        assert np.sqrt(np.mean((found - there) ** 2)) < 0.01 * there.mean()
        assert np.sqrt(np.mean((before - there) ** 2)) > 0.05 * there.mean()
        editor.select("second")
        window.key(imgui.Key.d, imgui.Key.mod_shift)
        assert [state.name for state in editor.document.objects][1:4] == ["ball", "second", "second 2"]
        window.key(imgui.Key.delete, imgui.Key.mod_ctrl)
        open_menu(window, "second")
        window.click_handle("objects.second.delete")
        assert editor.document.poses == () and exact_picture(window) == pytest.approx(before, abs=1e-4)
        editor.undo()
        assert exact_picture(window) == pytest.approx(found, abs=1e-3)


def open_menu(window: HeadlessWindow, name: str) -> None:
    window.frames(2)
    window.click(*window.shell.handle_position(f"objects.{name}"), button=1)
    window.frames(2)


@pytest.fixture
def window(context: moderngl.Context, tmp_path: Path) -> Iterator[HeadlessWindow]:
    yield from opened(context, tmp_path, SCENE)


def test_a_shape_is_added_by_key_and_a_file_by_a_drop(window: HeadlessWindow, tmp_path: Path) -> None:
    editor, before = window.shell.editor, exact_picture(window)
    window.key(imgui.Key.a, imgui.Key.mod_shift)
    window.frames(2)
    window.click_handle("menu.add_box")
    assert window.run_until(lambda: not editor.exchange.is_reading, 60.0)
    assert editor.view.selected is not None and editor.view.selected.object == "box"
    assert np.abs(exact_picture(window) - before).max() > 0.05
    (tmp_path / "card.ply").write_text(TRIANGLE_PLY)
    window.hold(imgui.Key.mod_shift, True)
    window.shell.drop([str(tmp_path / "card.ply"), str(tmp_path / "gone.ply")])
    window.hold(imgui.Key.mod_shift, False)
    assert window.run_until(lambda: not editor.exchange.is_reading, 60.0)
    assert [state.name for state in editor.document.objects][-2:] == ["box", "card"]
    assert editor.status.is_error and "gone.ply" in editor.status.message
    editor.undo()
    editor.undo()
    assert exact_picture(window) == pytest.approx(before, abs=1e-4)
