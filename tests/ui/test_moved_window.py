"""Objects and lamps that are moved in Placement, in the window: a dragged lamp's light follows in the view before, the
first picture after a move keeps what is unaffected, and the last is that of a scene file with the objects there."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.commands import MoveObject
from app.document.view_state import SetView
from app.messages.worker_messages import SetCamera
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from tests.scene_text import LAMBERT, camera, facing_down, facing_up, placed, scaled
from tests.ui.small_scene import CountingClient, linear_picture, opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl

SIZE = (64, 48)
HEAD = camera((0, 2.0, 3.0), 40, SIZE, (0, 0.2, 0), "bounces = 2\n")
FLOOR, BALL = (
    placed("floor", "quad", facing_up(4), LAMBERT),
    placed("ball", "sphere", scaled(0.5, (0, 0.3, 0)), LAMBERT),
)


def scene(lamp: float = 0.0, ball: float = 0.0) -> str:
    light = placed("lamp", "quad", facing_down(0.3, (lamp, 1.8, 0.25)), "emission = [9, 8, 7]\n")
    fill = placed("fill", "quad", facing_down(0.3, (-1.0, 2.5, 1.0)), "emission = [2, 3, 4]\n")
    return HEAD + FLOOR + placed("ball", "sphere", scaled(0.5, (ball, 0.3, 0)), LAMBERT) + light + fill


def opened(context: moderngl.Context, folder: Path, text: str) -> Iterator[tuple[HeadlessWindow, CountingClient]]:
    folder.mkdir(exist_ok=True)
    client = CountingClient(RequestDispatcher(ArrayCache(folder / "cache")))
    with opened_window(context, write_small_scene(folder, text), client, n_lights=400) as window:
        window.shell.editor.do(SetView.of(n_bounces=2))
        wait_until_exact(window)
        yield window, client


def exact(context: moderngl.Context, folder: Path, text: str) -> np.ndarray:
    (picture,) = [linear_picture(window) for window, _ in opened(context, folder, text)]
    return picture


def off(found: np.ndarray, there: np.ndarray) -> float:
    return float(np.sqrt(np.mean((found - there) ** 2)) / there.mean())


def test_the_light_of_a_dragged_lamp_follows_in_the_view_before(context: moderngl.Context, tmp_path: Path) -> None:
    there = exact(context, tmp_path / "there", scene(lamp=0.5))
    for window, client in opened(context, tmp_path / "here", scene()):
        editor, before = window.shell.editor, linear_picture(window)
        n_views = client.n_asked(SetCamera)
        editor.begin_drag()
        editor.do(MoveObject("lamp", (0.499, 0, 0)))
        shown = []
        for k in range(200):  # a hand that does not rest
            editor.do(MoveObject("lamp", (0.002 * (-1) ** k, 0, 0)))
            window.frames(1)
            shown.append(off(linear_picture(window), there))
        assert client.n_asked(SetCamera) == n_views
        assert shown[-1] < 0.05 and off(before, there) > 0.3
        editor.end_drag()
        wait_until_exact(window)
        assert off(linear_picture(window), there) < 1e-3
        editor.undo()
        wait_until_exact(window)
        assert off(linear_picture(window), before) < 1e-4


def test_the_picture_stays_until_the_first_one_after_a_move(context: moderngl.Context, tmp_path: Path) -> None:
    """No frame shows objects lit from the camera, or the moved ball without the shadows of the rest."""
    there = exact(context, tmp_path / "there", scene(ball=0.6))
    for window, _ in opened(context, tmp_path / "here", scene()):
        editor, before = window.shell.editor, linear_picture(window)
        editor.do(MoveObject("ball", (0.6, 0, 0)))
        feed, errors = window.shell.source, []
        assert feed is not None
        for _ in range(4000):
            window.frames(1)
            if not feed.shows_view_before and editor.status.picture != "waiting" and not editor.status.is_away:
                errors.append(off(linear_picture(window), there))
            if editor.status.is_finished and not feed.is_behind and errors:
                break
        assert off(before, there) > 0.3 and max(errors) < 0.1 and errors[-1] < 1e-3, errors


SHAPES = {
    "quad": ("quad", "transform = [0.5, 0, 0, {x}, 0, 0.4, 0, 0.5, 0, 0, 1, -0.6, 0, 0, 0, 1]\n"),
    "disc": ("disc", "transform = [0.6, 0, 0, {x}, 0, 0.6, 0, 0.5, 0, 0, 1, -0.6, 0, 0, 0, 1]\n"),
    "ball": ("sphere", "transform = [0.5, 0, 0, {x}, 0, 0.5, 0, 0.5, 0, 0, 0.5, -0.6, 0, 0, 0, 1]\n"),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_dragged_lamp_is_drawn_where_it_is(context: moderngl.Context, tmp_path: Path, shape: str) -> None:
    """Half of it goes behind a ball; what it hid before is no longer bright."""
    primitive, transform = SHAPES[shape]

    def text(x: float) -> str:
        lamp = f'[[object]]\nname = "lamp"\nprimitive = "{primitive}"\nemission = [9, 8, 7]\n' + transform.format(x=x)
        return HEAD + FLOOR + placed("ball", "sphere", scaled(0.8, (0.5, 0.4, 0.2)), LAMBERT) + lamp

    there = exact(context, tmp_path / "there", text(0.4))
    for window, client in opened(context, tmp_path / "here", text(-0.5)):
        editor, before = window.shell.editor, linear_picture(window)
        n_views = client.n_asked(SetCamera)
        editor.begin_drag()
        editor.do(MoveObject("lamp", (0.9, 0, 0)))
        window.frames(1)  # at once, while its light is on its way
        now = linear_picture(window)
        assert client.n_asked(SetCamera) == n_views
        bright = [(each > 5.0).all(axis=2) for each in (before, there, now)]
        assert bright[0].sum() > 20 and bright[1].sum() > 20 and not (bright[0] & bright[1]).any()
        assert (bright[1] != bright[2]).sum() <= 0.15 * bright[1].sum()  # edges against the ball
        inside = bright[1] & bright[2]
        assert np.allclose(np.median(now[inside], axis=0), (9, 8, 7))
        assert np.abs(now[inside] - there[inside]).mean() < 0.4  # shares of pixels, by 16 samples and by 8 rays
        assert now[bright[0]].max() < 1.5  # what is beside it, in its light of before
        # An edge of it in front of the sky: shares of pixels.
        assert abs(now[:16].mean() / there[:16].mean() - 1.0) < 0.05
        editor.do(MoveObject("lamp", (-0.9, 0, 0)))
        window.frames(1)
        assert (linear_picture(window) == before).all()  # to the bit, in its place
        editor.do(MoveObject("lamp", (0.9, 0, 0)))
        window.frames(1)
        assert ((linear_picture(window) > 5.0).all(axis=2) == bright[2]).all()
        editor.end_drag()
        wait_until_exact(window)
        assert off(linear_picture(window), there) < 1e-2
        editor.undo()
        wait_until_exact(window)
        assert off(linear_picture(window), before) < 1e-4
