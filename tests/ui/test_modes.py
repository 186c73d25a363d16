"""A mode of a few lines: registered, chosen, drawn, undone and left, and no file of the program knows of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import moderngl
import numpy as np
import pytest
from numpy.typing import NDArray

from app.document.commands.layers import SetParameter
from app.document.document import Document
from app.document.view_state import SetView, ViewState
from app.editor.editor import Editor
from app.files.session import load_session
from app.messages.editor_status import Status
from app.messages.picture_events import PictureEvent
from app.messages.worker_messages import Request, Response, SetCamera
from app.modes.mode import EditorServices, Mode, ModeController, ModeWorker
from app.modes.registry import PLACEMENT
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher, WorkerContext
from tests.ui.small_scene import linear_picture, wait_until_exact, write_small_scene
from ui.gl.gpu_memory import small_texture
from ui.headless import HeadlessWindow
from ui.panels import status_bar
from ui.picture_feed import PictureFeed, PictureSource

pytestmark = pytest.mark.gl


@dataclass(frozen=True)
class Paint(Request):
    built_on = (SetCamera,)
    colour: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Painted(Response, PictureEvent):
    pixels: NDArray[np.uint8]


class FlatController(ModeController):
    def __init__(self, desk: EditorServices) -> None:
        self._desk, self._asked = desk, None

    def update(self, now: float, document: Document, view: ViewState) -> list[PictureEvent]:
        colour = document.layer("ground.0").values["albedo"]
        if colour != self._asked:
            self._asked = colour
            self._desk.send(Paint(colour))
        return []

    def receive(self, response: Response) -> list[PictureEvent]:
        return [response] if isinstance(response, Painted) else []

    def status(self, status: Status) -> Status:
        return replace(status, picture="exact")


class FlatWork(ModeWorker):
    def __init__(self, bench: WorkerContext) -> None:
        self.bench = bench

    @property
    def handlers(self) -> dict:
        return {Paint: self.paint}

    def paint(self, request: Paint) -> Iterator[Response]:
        width, height = self.bench.open_placement.scene.resolution
        yield Painted(np.full((height, width, 3), np.round(255 * np.array(request.colour)), np.uint8))


class FlatSource(PictureSource):
    def __init__(self, context: moderngl.Context) -> None:
        self.context, self.texture = context, None

    @property
    def picture(self) -> moderngl.Texture | None:
        return self.texture

    def take(self, editor: Editor, event: PictureEvent) -> None:
        if isinstance(event, Painted):
            self.texture = small_texture(self.context, event.pixels)

    def draw(self, editor: Editor, last_frame_ms: float, all_taken: bool) -> bool:
        return False


FLAT = Mode("flat", "Flat", *(f"{__name__}:{name}" for name in ("FlatController", "FlatWork", "FlatSource")))


@pytest.fixture
def window(context: moderngl.Context, tmp_path: Path) -> Iterator[HeadlessWindow]:
    """The small scene in a program of two modes, its picture exact in the first."""
    modes = (PLACEMENT, FLAT)
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache"), modes=modes))
    editor = Editor(client, str(write_small_scene(tmp_path)), resolution=(24, 16), modes=modes)
    editor.do(SetView.of(n_lights=40))
    window = HeadlessWindow(editor, context=context)
    window.shell.source = feed = PictureFeed(context, editor.mode)
    wait_until_exact(window)
    yield window
    feed.close()
    window.close()
    editor.close()


def shown(window: HeadlessWindow) -> list[int]:
    """The colour of the picture's corner."""
    window.frames(4)
    picture = window.shell.source.picture
    return [] if picture is None else list(picture.read()[:3])


def test_a_mode_of_a_few_lines_is_chosen_drawn_undone_and_left(window: HeadlessWindow) -> None:
    editor, before = window.shell.editor, linear_picture(window)
    window.click_handle("mode.1")
    assert shown(window) == [153, 128, 102] and editor.status.picture == "exact"  # the ground's 0.6, 0.5, 0.4
    assert window.shell.source.object_at(12, 15) == "ground"  # what a pixel sees is the scene's, not the mode's
    editor.do(SetParameter("ground.0", "albedo", (0.2, 0.4, 0.8)))
    assert shown(window) == [51, 102, 204]
    editor.undo()
    assert shown(window) == [153, 128, 102]
    window.click_handle("mode.0")
    window.frames(2)
    wait_until_exact(window)
    np.testing.assert_array_equal(linear_picture(window), before)


def test_the_mode_is_saved_with_the_session_and_opened_with_it(window: HeadlessWindow, tmp_path: Path) -> None:
    editor = window.shell.editor
    editor.do(SetView.of(mode="flat"))
    editor.save(tmp_path / "flat.insitu")
    assert load_session(tmp_path / "flat.insitu").view.mode == "flat"
    editor.do(SetView.of(mode="placement"))
    assert editor.open(str(tmp_path / "flat.insitu")) is None
    wait_until_exact(window)
    assert shown(window) == [153, 128, 102] and editor.mode is FLAT


def test_a_mode_that_the_program_does_not_have_leaves_the_one_there_is(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.do(SetView.of(mode="orbit of tomorrow"))
    window.frames(2)
    assert editor.view.mode == editor.mode.name == "placement"
    wait_until_exact(window)


def test_with_one_mode_there_is_nothing_to_choose(window: HeadlessWindow) -> None:
    assert "mode.1" in window.shell.handles.names()
    window.shell.editor.modes = (PLACEMENT,)
    window.frames(2)
    assert "mode.0" not in window.shell.handles.names()


def test_a_picture_stays_until_the_mode_that_was_chosen_has_one(
    window: HeadlessWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    editor, feed = window.shell.editor, window.shell.source
    assert feed is not None and feed.picture is not None
    before = feed.picture.read()
    with monkeypatch.context() as patch:  # a mode that asks for nothing, and waits
        patch.setattr(FlatController, "update", lambda *arguments: [])
        patch.setattr(FlatController, "status", lambda self, status: status)
        editor.do(SetView.of(mode="flat"))
        window.frames(4)
        assert isinstance(feed.source, FlatSource) and feed.picture.read() == before
        # Nor does the status say that something else is seen.
        said = status_bar.picture_state(editor.status, status_bar.placeholder_text(window.shell._context(0.0)))
        assert feed.mode_before is PLACEMENT and said[1] == "waiting, Placement's picture"
    assert shown(window) == [153, 128, 102]
    assert feed.mode_before is None
