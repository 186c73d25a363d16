"""A real scene so small that its transport takes a second: a ball on a ground under a lamp and a coloured sky."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import moderngl
import numpy as np

from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import Request, WorkerClient
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from tests.pictures import write_exr
from tests.scene_text import LEANING_LAMP, camera, environment, facing_up, material, placed, scaled
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

CLAY = 'model = "lambert", name = "clay", albedo = [0.6, 0.5, 0.4]'
BASE = 'model = "lambert", name = "base", albedo = [0.1, 0.2, 0.4]'
COAT = 'model = "rough_conductor", name = "coat", alpha = 0.3'
SCENE = (
    camera((0.4, 1.2, 2.6), 42, (96, 64), (0, 0.45, 0), 'bounces = 1\nname = "small"\n')
    + environment(file="sky.exr")
    + placed("ground", "quad", facing_up(5), material(CLAY))
    + placed("ball", "sphere", scaled(0.9, (0, 0.5, 0)), material(BASE, COAT))
    + LEANING_LAMP
)


def write_small_scene(folder: Path, text: str = SCENE) -> Path:
    """Write the scene and its sky into a folder; the scene's file."""
    write_exr(folder / "sky.exr", coloured_sky())
    file = folder / "small.toml"
    file.write_text(text)
    return file


def coloured_sky(height: int = 16) -> np.ndarray:
    """Blue above, warm below, brighter in one direction: (height, 2·height, 3)."""
    v, u = np.mgrid[:height, : 2 * height] / np.array([height, 2 * height])[:, None, None]
    glow = 2.5 * np.exp(-40.0 * ((u - 0.3) ** 2 + (v - 0.35) ** 2))
    sky = 0.4 * np.stack([0.2 + 0.3 * v + glow, 0.3 + 0.1 * v + 0.9 * glow, 0.7 - 0.4 * v + 0.7 * glow], axis=-1)
    return sky.astype(np.float32)


class CountingClient(InProcessClient):
    """Notes what was asked of the worker."""

    def __init__(self, tasks: RequestDispatcher) -> None:
        super().__init__(tasks)
        self.requests: list[Request] = []

    def send(self, request: Request) -> int:
        self.requests.append(request)
        return super().send(request)

    def n_asked(self, *kinds: type[Request]) -> int:
        """How many requests of these kinds there were."""
        return sum(isinstance(request, kinds) for request in self.requests)


@contextmanager
def opened_window(
    context: moderngl.Context,
    source: Path,
    client: WorkerClient,
    *,
    resolution: tuple[int, int] | None = None,
    **view: object,
) -> Iterator[HeadlessWindow]:
    """A window on a scene that has just been opened, nothing computed yet; fields of the view as given."""
    editor = Editor(client, str(source), resolution=resolution)
    window = HeadlessWindow(editor, context=context)
    feed = PictureFeed(context, editor.mode)
    window.shell.source = feed
    try:
        editor.do(SetView.of(**view))
        assert window.run_until(lambda: editor.scene_is_open, 600.0), editor.status
        yield window
    finally:
        feed.close()
        window.close()
        editor.close()


def wait_until_exact(window: HeadlessWindow, timeout: float = 600.0) -> None:
    """Draw frames until nothing more comes and all of it is in the picture, then the few that a layout needs."""
    window.frames(2)
    assert window.run_until(lambda: window.shell.editor.status.is_finished and is_drawn(window), timeout), (
        window.shell.editor.status
    )
    window.frames(3)


def is_drawn(window: HeadlessWindow) -> bool:
    """Whether all that the worker has answered is in the picture: the status may be ahead of it."""
    return window.shell.source is not None and not window.shell.source.is_behind


def linear_picture(window: HeadlessWindow) -> np.ndarray:
    """The linear picture (H,W,3) as it is now."""
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    return source.source.renderer.linear_image()
