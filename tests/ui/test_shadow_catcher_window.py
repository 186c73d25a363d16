"""Shadow catchers in the window: what a still shows, through all edits, and as objects where that is not possible."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest

from app.document.commands import MoveObject, SetShadowCatcher
from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetParameter, SetVisible
from app.document.commands.light import SetBackground, SetBackgroundColour, SetIntensity, SetRotation
from app.document.commands.mix import SetMix
from app.document.view_state import OpenPanel, SetView, Viewpoint
from app.messages.catcher_messages import FindCatcherLight
from app.project.project import open_project
from app.stills.stills import render_picture
from app.worker.cache import ArrayCache
from app.worker.orbit_worker import OrbitWorker
from app.worker.tasks import RequestDispatcher
from engine.scene.camera_moves import orbit_camera
from engine.scene.description import Camera
from tests.few_points import use_few_points
from tests.scene_text import camera, environment, facing_down, facing_up, material, placed
from tests.ui.small_scene import CountingClient, opened_window, wait_until_exact, write_small_scene
from tests.ui.test_any_sequence import COMMANDS, LIFT, Walk, walk
from ui.headless import HeadlessWindow
from ui.modes.orbit.orbit_feed import OrbitFeed
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl

GREY = material('model = "lambert", albedo = [0.5, 0.5, 0.5]')
SIZE = (48, 32)


@pytest.fixture
def client(tmp_path: Path) -> CountingClient:
    return CountingClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))


@pytest.fixture
def window(context: moderngl.Context, client: CountingClient, tmp_path: Path) -> Iterator[HeadlessWindow]:
    """A ball on a ground that catches its shadow."""
    with opened_window(context, write_small_scene(tmp_path), client, resolution=SIZE) as window:
        window.shell.editor.do(SetShadowCatcher("ground", True))
        wait_until_exact(window)
        yield window


def picture(window: HeadlessWindow) -> np.ndarray:
    """The linear picture with alpha (H, W, 4)."""
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    return source.source.renderer.linear_image_with_alpha()


def still(window: HeadlessWindow, *values: tuple[str, object], **how: Any) -> np.ndarray:
    """The still of the window's scene, its ground a catcher, with these values by path."""
    source = window.shell.editor.document.source
    project = open_project(source, SIZE, values=[("ground.shadow_catcher", True), *values])
    return render_picture(project, lambda step: None, **how)


def own_picture(window: HeadlessWindow) -> np.ndarray:
    """The linear picture with alpha (H, W, 4) that Orbit or Deform shows itself."""
    source = window.shell.source
    assert isinstance(source, PictureFeed) and isinstance(source.source, OrbitFeed)
    return source.source.canvas.linear_image_with_alpha()


def label(window: HeadlessWindow) -> str:
    return window.shell.editor.status.catcher_note


@pytest.mark.parametrize("background", ["environment", "transparent", "colour"])
def test_it_is_the_still(window: HeadlessWindow, background: str) -> None:
    editor = window.shell.editor
    assert not label(window)
    editor.do(SetBackground(background))  # type: ignore[arg-type]
    wait_until_exact(window)
    shown, expected = picture(window), still(window, ("light.background", background))
    shown = editor.document.background.behind(shown) if background != "environment" else shown[..., :3]
    np.testing.assert_allclose(shown, expected, atol=3e-3)
    # The shadow of the ball is there, and the ground is not.
    editor.do(SetShadowCatcher("ground", False))
    wait_until_exact(window)
    assert np.abs(picture(window)[..., :3] - shown[..., :3]).max() > 0.1


def test_below_a_disc_half_of_an_even_sky_is_left(
    context: moderngl.Context, client: CountingClient, tmp_path: Path
) -> None:
    """A disc of radius r hides r² / (r² + h²) of the irradiance below its middle: half at the height h = r."""
    file = tmp_path / "scene.toml"
    file.write_text(
        camera((1.6, 0.3, 0), 12, (16, 12), head="bounces = 1\n") + environment()
        + placed("floor", "quad", facing_up(20), GREY) + placed("disc", "disc", facing_down(1, (0, 0.5, 0)), GREY)
    )  # fmt: skip
    with opened_window(context, file, client) as window:
        editor = window.shell.editor
        editor.do(SetShadowCatcher("floor", True))
        editor.do(SetBackground("transparent"))
        wait_until_exact(window)
        assert picture(window)[5:7, 7:9].reshape(4, 4).mean(axis=0) == pytest.approx([0, 0, 0, 0.5], abs=0.01)
        editor.do(SetBackground("environment"))  # of radiance 1, itself seen through the floor
        wait_until_exact(window)
        assert picture(window)[5:7, 7:9, :3].mean() == pytest.approx(0.5, abs=0.01)


def test_only_what_changes_its_light_is_computed_again(window: HeadlessWindow, client: CountingClient) -> None:
    editor = window.shell.editor
    assert client.n_asked(FindCatcherLight) == 1
    before = picture(window)
    for command in (
        AddOperator("ball.1", "theta_h", LIFT), SetParameter("ball.1", "alpha", 0.5), SetIntensity(2.0),
        SetBackgroundColour((0.2, 0.3, 0.4)), MoveObject("ball", (0.1, 0.0, 0.0)), SetVisible("ball", False),
        SetVisible("ball", True),
    ):  # fmt: skip
        editor.do(command)
        wait_until_exact(window)
        assert not label(window)
    assert client.n_asked(FindCatcherLight) == 1
    assert np.abs(picture(window) - before).max() > 0.05  # but the picture has followed
    editor.do(SetRotation(40.0))
    wait_until_exact(window)
    assert client.n_asked(FindCatcherLight) == 2 and not label(window)
    editor.undo()
    wait_until_exact(window)
    assert client.n_asked(FindCatcherLight) == 3


def test_none_is_asked_for_by_a_mode_whose_picture_would_not_show_it(
    window: HeadlessWindow, client: CountingClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    editor = window.shell.editor
    monkeypatch.setattr(type(editor.controller), "still_mode", "orbit")
    editor.do(SetRotation(25.0))
    wait_until_exact(window)
    assert client.n_asked(FindCatcherLight) == 1 and "until their shadows are known" in label(window)
    monkeypatch.undo()
    wait_until_exact(window)
    assert client.n_asked(FindCatcherLight) == 2 and not label(window)


def test_it_is_an_object_where_something_else_is_shown(window: HeadlessWindow) -> None:
    editor, caught = window.shell.editor, picture(window)
    for shown, words in (
        ({"compare": editor.document}, "while pictures are compared"),
        ({"solo": "ball.0"}, "beside a layer that is shown alone"),
        ({"lighting": "no_shadows"}, "in light that is not the scene's"),
    ):
        editor.do(SetView.of(**shown))
        wait_until_exact(window)
        assert label(window) == words
        assert np.abs(picture(window) - caught).max() > 0.1
        editor.do(SetView.of(**{name: "scene" if name == "lighting" else None for name in shown}))
        window.frames(2)
        wait_until_exact(window)
        assert not label(window)
        np.testing.assert_allclose(picture(window), caught, atol=1e-3)


def test_the_menu_of_its_row_switches_it(window: HeadlessWindow) -> None:
    editor, caught = window.shell.editor, picture(window)
    for panel in ("library", "brdf", "accuracy", "plan", "material"):
        editor.do(OpenPanel(panel, False))
    window.frames(6)
    for catchers in ((), ("ground",)):
        window.click(*window.shell.handle_position("objects.ground"), button=1)
        window.frames(3)
        window.click(*window.shell.handle_position("objects.ground.shadow_catcher"))
        wait_until_exact(window)
        assert editor.document.shadow_catchers == catchers
        assert (np.abs(picture(window) - caught).max() < 1e-3) == bool(catchers)


SWITCHES: dict[str, Callable[[Walk], object]] = {
    **{
        name: COMMANDS[name]
        for name in (
            "undo", "redo", "lift", "lift the ground", "roughness", "turn", "brighten the sky", "transparent",
            "before a colour", "before the sky", "compare", "compare no more", "no shadows", "light in place", "kill",
            "take hold", "let go", "stop and go on", "select the ground",
        )
    },
    "catch": lambda w: w.editor.do(SetShadowCatcher("ground", True)),
    "catch with the ball": lambda w: w.editor.do(SetShadowCatcher("ball", True)),
    "catch no more": lambda w: w.editor.do(SetShadowCatcher("ground", False)),
    "move the ball": lambda w: w.editor.do(MoveObject("ball", (0.1, 0.0, 0.05))),
    "hide the ground": lambda w: w.editor.do(SetVisible("ground", False)),
    "show the ground": lambda w: w.editor.do(SetVisible("ground", True)),
    "dim the lamp": lambda w: w.editor.do(SetMix("lamp", "strength", -1.0)),
    "bright ground": lambda w: w.editor.do(SetParameter("ground.0", "albedo", (0.8, 0.8, 0.7))),
}  # fmt: skip


@pytest.mark.parametrize("seed", [500, 501, *(pytest.param(seed, marks=pytest.mark.sweep) for seed in range(502, 540))])
def test_any_sequence_ends_with_the_picture_of_a_fresh_start(
    context: moderngl.Context, tmp_path: Path, seed: int
) -> None:
    walk(context, str(write_small_scene(tmp_path)), tmp_path, seed, 20, 1, SWITCHES)


ASIDE = Camera(position=(2.2, 1.4, 2.0), target=(0.0, 0.2, 0.0), fov_y=40.0)


@pytest.fixture
def free(
    context: moderngl.Context, client: CountingClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    mode: str,
) -> Iterator[HeadlessWindow]:  # fmt: skip
    """The same in another mode, at few points."""
    use_few_points(monkeypatch)
    monkeypatch.setattr(OrbitWorker, "n_points", 500)
    view = {"mode": mode, "n_points": 500, "n_rays": 200, "n_gloss_rows": 0, "n_bounces": 1}
    with opened_window(context, write_small_scene(tmp_path), client, resolution=SIZE, **view) as window:
        window.shell.editor.do(SetShadowCatcher("ground", True))
        yield window


def shown_by_itself(window: HeadlessWindow) -> bool:
    """Whether the mode shows a whole picture of its own, with shadows."""
    controller = window.shell.editor.controller
    return controller.still_mode != "placement" and controller.is_whole and not label(window)


@pytest.mark.parametrize(("mode", "background"), [("orbit", "environment"), ("deform", "transparent")])
def test_orbit_and_deform_show_what_their_stills_do(free: HeadlessWindow, background: str) -> None:
    editor = free.shell.editor
    editor.do(SetBackground(background))  # type: ignore[arg-type]
    assert free.run_until(lambda: shown_by_itself(free), 120.0), editor.status
    assert editor.status.shown_by == editor.view.mode.title()
    shown = own_picture(free)
    expected = still(
        free, ("light.background", background), mode=editor.view.mode, n_points=500, n_rays=200, n_gloss_rows=0
    )
    # Stills evaluate the peaks of highlights exactly.
    assert np.quantile(np.abs(shown[..., : expected.shape[2]] - expected), 0.98) < 0.02
    if background == "transparent":
        assert shown[..., 3].min() < 0.01 and 0.05 < np.median(shown[..., 3][shown[..., 3] > 0.01])
    if editor.view.mode == "orbit":
        wait_until_exact(free)  # Placement's fades in with the shadow
        assert editor.status.shown_by == "Placement" and not label(free)


@pytest.mark.parametrize("mode", ["orbit", "deform"])
def test_each_picture_of_a_moving_camera_shows_the_shadow(free: HeadlessWindow) -> None:
    editor = free.shell.editor
    editor.do(SetBackground("transparent"))
    assert free.run_until(lambda: shown_by_itself(free), 120.0), editor.status
    for i in range(4):
        editor.camera_history.set_viewpoint(Viewpoint(orbit_camera(ASIDE, 0.1 * i, 0.0)), "Orbit")
        free.frames(2)
        assert not label(free)
        alpha = own_picture(free)[..., 3]
        assert alpha.min() < 0.05 and alpha.max() > 0.9 and 0.0 < ((alpha > 0.1) & (alpha < 0.9)).mean() < 0.5
