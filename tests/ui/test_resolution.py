"""The picture at another resolution: all edits stay, sessions remember it, and what it costs is said before."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.layers import SetParameter
from app.document.view_state import SetView
from app.files.session import load_session
from app.messages.worker_messages import SetCamera
from app.project.project import open_project
from app.system.memory import memory_bytes
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from tests.ui.small_scene import linear_picture, opened_window, wait_until_exact, write_small_scene
from tests.ui.stand_in import StandInClient
from ui.headless import HeadlessWindow
from ui.panels.actions import RunOperator, SetPanel
from ui.panels.dialogs import scale_size

pytestmark = pytest.mark.gl


@pytest.fixture
def small(context: moderngl.Context, tmp_path: Path) -> Iterator[HeadlessWindow]:
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    with opened_window(context, write_small_scene(tmp_path), client, n_lights=100) as opened:
        opened.shell.editor.select("ball.1.theta_h")
        wait_until_exact(opened)
        yield opened


def size(window: HeadlessWindow) -> tuple[int, int]:
    height, width, _ = linear_picture(window).shape
    return width, height


def test_edits_history_and_selection_stay(small: HeadlessWindow, tmp_path: Path) -> None:
    editor = small.shell.editor
    editor.do(SetParameter("ball.1", "alpha", 0.5))
    wait_until_exact(small)
    document, steps, selected = editor.document, editor.history.undo_steps, editor.view.selected
    large = linear_picture(small)
    small.shell.do(RunOperator("resolution", (48, 32)))
    assert small.run_until(lambda: size(small) == (48, 32), 60.0)
    wait_until_exact(small)
    assert editor.document is document and editor.history.undo_steps is steps and editor.view.selected == selected
    # The same picture, coarser: its pixels see what blocks of 2 x 2 of the other see, but for edges.
    blocks = large.reshape(32, 2, 48, 2, 3).mean(axis=(1, 3))
    assert np.median(np.abs(linear_picture(small) - blocks) / (blocks + 0.05)) < 0.03
    # It goes on from there: undo, the curve's own transport, painting over what is picked.
    editor.undo()
    wait_until_exact(small)
    assert editor.view.resolution == (48, 32)
    small.drag_handle("curve.magnitude", (0, -20))
    wait_until_exact(small)
    assert small.shell.source is not None and small.shell.source.object_at(24, 31) == "ground"
    # A session has it, `render` takes it from there, and so does the editor.
    editor.save(tmp_path / "small.insitu")
    assert load_session(tmp_path / "small.insitu").view.resolution == (48, 32)
    assert open_project(str(tmp_path / "small.insitu")).scene.resolution == (48, 32)
    assert open_project(str(tmp_path / "small.insitu"), (20, 10)).scene.resolution == (20, 10)
    editor.open(str(tmp_path / "small.toml"))
    assert small.run_until(lambda: size(small) == (96, 64), 60.0)
    assert editor.view.resolution is None
    editor.open(str(tmp_path / "small.insitu"))
    assert small.run_until(lambda: size(small) == (48, 32), 60.0)
    # Back to the scene's own, which a session need not say.
    small.shell.do(RunOperator("resolution", (96, 64)))
    assert small.run_until(lambda: size(small) == (96, 64), 60.0)
    assert editor.view.resolution is None


def looks(window: HeadlessWindow) -> list[SetCamera]:
    client = window.shell.editor._client
    assert isinstance(client, StandInClient)
    return [request for request in client.requests if isinstance(request, SetCamera)]


def test_edits_made_while_it_is_opened_stay_too(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.do(SetView.of(compare=editor.document, lobe_pixel=(3, 4)))
    window.shell.do(RunOperator("resolution", (24, 16)))
    editor.do(SetParameter("teapot.1", "alpha", 0.77))  # before the worker has answered
    edited = editor.document
    assert editor.view.resolution == (24, 16)
    wait_until_exact(window)
    assert editor.document is edited and editor.session.is_unsaved
    # What belongs to pixels of the other picture is gone.
    assert editor.view.compare is None and editor.view.lobe_pixel is None
    assert looks(window)[-1].resolution == (24, 16)


def test_the_window_asks_for_numbers_and_says_what_they_cost(window: HeadlessWindow) -> None:
    editor, shell = window.shell.editor, window.shell
    shell.do(SetPanel({"resolution": (48, 32)}))
    window.frames(3)
    window.click_handle("resolution.3")  # twice the scene's
    assert shell.state.resolution == (96, 64)
    window.click_handle("button.resolution.cancel")
    assert shell.state.resolution is None and editor.view.resolution is None
    shell.do(SetPanel({"resolution": (48, 32)}))
    window.frames(3)
    window.click_handle("resolution.1")
    window.click_handle("button.resolution.apply")
    window.frames(2)
    assert looks(window)[-1].resolution == (24, 16)
    assert window.run_until(lambda: "24 x 16" in editor.status.message, 60.0)


def test_a_side_is_typed_and_one_out_of_range_is_said(window: HeadlessWindow) -> None:
    shell = window.shell
    shell.do(SetPanel({"resolution": (48, 32)}))
    window.frames(3)
    for typed, expected in (("64", (64, 32)), ("99999", (64, 32))):
        for _ in range(2):
            window.click_handle("resolution.width")
        window.type(typed)
        window.key(imgui.Key.enter)
        assert shell.state.resolution == expected
    assert shell.state.message is not None
    assert shell.state.message.text == "Width = 99999, expected 1 to 16384; nothing was changed"


def test_more_than_the_memory_is_refused_before_anything_is_done(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("app.system.memory", "ui.panels.dialogs"):
        monkeypatch.setattr(f"{module}.memory_bytes", lambda: (10 * 2**20, memory_bytes()[1]))
    shell, asked = window.shell, len(looks(window))
    shell.do(SetPanel({"resolution": (4096, 4096)}))
    window.frames(3)
    window.click_handle("button.resolution.apply")  # which is grey
    assert shell.state.resolution == (4096, 4096) and len(looks(window)) == asked
    shell.do(RunOperator("resolution", (4096, 4096)))
    status = shell.editor.status
    assert status.is_error and "18.8 GiB" in status.message and "10 MiB are free" in status.message
    assert len(looks(window)) == asked


def test_presets_stay_in_range() -> None:
    assert scale_size((512, 300), 0.5) == (256, 150)
    assert scale_size((3, 1), 0.25) == (1, 1)
    assert scale_size((8000, 5000), 4.0) == (16384, 16384)
