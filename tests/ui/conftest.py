"""A window without a display over the stand-in worker."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import moderngl
import pytest

from app.editor.editor import Editor
from tests.quick_indirect import light_quickly
from tests.ui.real_window import RealWindows
from tests.ui.stand_in import StandInClient
from ui.gl.context import create_headless_context
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed


@pytest.fixture(autouse=True)
def state_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Layouts and materials of a test: never the user's own."""
    monkeypatch.setenv("INSITU_STATE", str(tmp_path / "state"))


@pytest.fixture(autouse=True)
def no_rows_for_other_skies(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """They take as long as the picture itself. Random walks meet them all the same."""
    if "sequence" not in request.module.__name__:
        monkeypatch.setattr("app.modes.placement.relight_controller.IDLE_SECONDS", math.inf)


@pytest.fixture(autouse=True)
def quick_indirect_light(monkeypatch: pytest.MonkeyPatch) -> None:
    """How good it is, is asked elsewhere."""
    light_quickly(monkeypatch)


@pytest.fixture(autouse=True)
def quick_judgement(monkeypatch: pytest.MonkeyPatch) -> None:
    """So is how well errors are judged: under a lamp of 768 leaves, and not of 16 times as many."""
    monkeypatch.setattr("engine.render.error_estimate.FINER_PATCHES", 1)


@pytest.fixture(scope="session")
def context() -> Iterator[moderngl.Context]:
    """One GL context for all windows of the run."""
    context = create_headless_context()
    yield context
    context.release()


@pytest.fixture(scope="session")
def real_windows(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealWindows]:
    """The real windows of the run, opened as they are asked for."""
    windows = RealWindows(tmp_path_factory.mktemp("real-windows"))
    yield windows
    windows.close()


@pytest.fixture
def window(context: moderngl.Context) -> Iterator[HeadlessWindow]:
    """The stand-in scene in a window of 1280 x 800, its teapot's coat selected and its picture exact."""
    yield from opened(context, (1280, 800), 1.0)


def opened(context: moderngl.Context, size: tuple[int, int], scale: float) -> Iterator[HeadlessWindow]:
    """A window of any size and scale, closed after use."""
    editor = Editor(StandInClient(), "stand-in")
    window = HeadlessWindow(editor, size=size, scale=scale, context=context)
    feed = PictureFeed(context, editor.mode)
    window.shell.source = feed
    assert window.run_until(lambda: editor.status.picture == "exact" and not feed.is_behind, 90.0), editor.status
    assert window.run_until(lambda: feed.environment is not None, 90.0)  # its thumbnail is made by a thread
    editor.select("teapot.1.theta_h")
    window.frames(4)
    assert context.error == "GL_NO_ERROR"
    yield window
    assert context.error == "GL_NO_ERROR"
    feed.close()
    window.close()
    editor.close()
