"""The view that is shown follows the one that is chosen, without holding up the window."""

import threading
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from app.document.view_state import SetView
from app.editor.editor import Editor
from engine.core.colour import ToneMapping
from engine.core.errors import InsituError
from engine.render.display import display_picture
from tests.ui.stand_in import StandInClient
from ui.gl import view_transform
from ui.gl.view_transform import ToneView
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

TABLE = np.zeros((2, 2, 2, 3), np.float16)
COLOURS = Editor(StandInClient(), "stand-in").colours  # no configuration is open


@pytest.fixture
def made_by(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Callable[[ToneMapping], np.ndarray]], None]]:
    """Let tables be made by something else."""

    def use(make: Callable[[ToneMapping], np.ndarray]) -> None:
        view_transform._start_table.cache_clear()
        monkeypatch.setattr(view_transform, "view_table", make)

    yield use
    view_transform._start_table.cache_clear()


def test_the_last_view_stays_until_the_table_is_there(made_by) -> None:
    may_end = threading.Event()
    made_by(lambda view: TABLE if may_end.wait(20) else TABLE)
    shown = ToneView()
    assert shown.follow("linear", COLOURS) == "linear" and not shown.waits
    assert shown.follow("agx", COLOURS) == "linear" and shown.waits
    assert shown.follow("filmic", COLOURS) == "filmic" and not shown.waits  # another choice meanwhile
    may_end.set()
    view_transform._start_table("agx").result(20)
    assert shown.follow("agx", COLOURS) == "agx" and not shown.waits


def test_a_view_that_cannot_be_made_is_said_once(made_by) -> None:
    def fail(view: ToneMapping) -> np.ndarray:
        raise ImportError("No module named 'PyOpenColorIO'")

    made_by(fail)
    shown = ToneView()
    with pytest.raises(InsituError):
        for _ in range(200):  # the thread may take a moment
            shown.follow("aces_2", COLOURS)
            view_transform._start_table("aces_2").exception(20)
    assert shown.follow("aces_2", COLOURS) == "filmic" and not shown.waits


@pytest.mark.gl
def test_the_window_shows_what_a_file_would_hold(window: HeadlessWindow) -> None:
    window.shell.editor.select(None)
    for view in ("agx", "aces_2", "filmic"):
        window.shell.editor.do(SetView.of(tone_mapping=view))
        assert window.run_until(lambda view=view: view_transform.is_table_ready(view), 20)
        window.frames(2)
        source = window.shell.source
        assert isinstance(source, PictureFeed) and source.source.renderer.frame is not None
        renderer = source.source.renderer
        expected = display_picture(renderer.linear_image(), 0.0, view).astype(int)
        assert np.abs(renderer.display_image() - expected).max() <= 2, view
