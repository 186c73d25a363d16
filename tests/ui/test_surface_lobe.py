"""The lobe at a picked pixel: its shape, where it stands in the picture, and how a hand picks it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import moderngl
import numpy as np
import pytest
from imgui_bundle import imgui

from app.document.commands.layers import SetParameter
from app.operators.script import Step
from engine.core.camera import pixel_directions, project
from engine.material import MODELS, make_layer
from engine.scene.description import CameraDescription
from tests.ui.conftest import opened
from ui.gl.brdf_stack import BrdfStack
from ui.gl.gpu_memory import TextureMemory
from ui.gl.program import Passes
from ui.headless import HeadlessWindow
from ui.panels.actions import ShowPanel
from ui.script_runner import run_steps
from ui.surface_lobe import SurfaceLobe, SurfacePoint, surface_lobe

pytestmark = pytest.mark.gl

CAMERA = CameraDescription.model_validate(
    {"position": [1.0, 2.0, 4.0], "target": [0.0, 0.5, 0.0], "fov_y": 40.0, "resolution": [60, 40]}
)


def test_projection_is_the_inverse_of_the_camera_s_rays() -> None:
    columns, rows = np.random.default_rng(1).uniform(0.0, 40.0, (2, 100))
    directions = pixel_directions(CAMERA, (60, 40), columns, rows) * np.linspace(0.5, 9.0, 100)[:, None]
    np.testing.assert_allclose(project(CAMERA, (60, 40), directions), np.stack([columns, rows], -1), atol=1e-4)


def point_facing(ray: np.ndarray, lean: float) -> SurfacePoint:
    """A point on that ray whose normal leans away from the eye."""
    t = np.cross([0.0, 1.0, 0.0], -ray)
    t /= np.linalg.norm(t)
    n = -ray * math.cos(lean) + t * math.sin(lean)
    b = np.cross(n, np.cross([0.0, 1.0, 0.0], n))
    b /= np.linalg.norm(b)
    return SurfacePoint(30, 20, np.stack([np.cross(b, n), b, n]), ray, CAMERA, (60, 40))


@pytest.fixture(scope="module")
def stack(context: moderngl.Context) -> Iterator[BrdfStack]:
    passes, memory = Passes(context), TextureMemory(context)
    made = BrdfStack(passes, memory)
    yield made
    made.release()
    passes.release()


def middle_ray() -> np.ndarray:
    return pixel_directions(CAMERA, (60, 40), np.array(30.5), np.array(20.5)).astype(np.float64)


def made(stack: BrdfStack, lean: float, name: str, logarithmic: bool = False, **parameters: object) -> SurfaceLobe:
    stack.set_layers((make_layer(MODELS[name], parameters),))
    return surface_lobe(stack, point_facing(middle_ray(), lean), logarithmic)


def test_a_diffuse_lobe_is_a_sphere_on_the_surface(stack: BrdfStack) -> None:
    # brdf cos theta_i over its largest: the cosine, which is at most 1 and stands on no side.
    lobe = made(stack, 0.5, "lambert", albedo=(0.8, 0.4, 0.2))
    normal = lobe.point.frame[2]
    cosine = np.maximum(lobe.directions @ normal, 0.0)
    np.testing.assert_allclose(lobe.radii, cosine / cosine.max(), atol=1e-5)
    lit = lobe.radii > 0.01
    np.testing.assert_allclose(lobe.colours[lit], np.broadcast_to([1.0, 0.5, 0.25], lobe.colours[lit].shape), rtol=1e-5)
    assert lobe.shades.shape == (*np.subtract(lobe.radii.shape, (1, 0)), 3) and (lobe.shades <= 1.0).all()


def test_a_glossy_lobe_points_to_the_mirror_direction(stack: BrdfStack) -> None:
    lobe = made(stack, 0.6, "phong", exponent=4000.0)
    normal, wo = lobe.point.frame[2], -lobe.point.ray
    ring, azimuth = np.unravel_index(lobe.radii.argmax(), lobe.radii.shape)
    mirrored = 2.0 * (normal @ wo) * normal - wo
    assert lobe.directions[ring, azimuth] @ mirrored == pytest.approx(1.0, abs=1e-3)
    assert lobe.radii.max() == 1.0 and np.median(lobe.radii) < 0.01
    assert np.median(made(stack, 0.6, "ward", logarithmic=True).radii) > np.median(made(stack, 0.6, "ward").radii)


def test_it_stands_on_the_pixel_and_keeps_its_size(stack: BrdfStack) -> None:
    # The normal leans by 90 degrees to the right of the picture: a cosine lobe's tip is `size` pixels from the base.
    lobe = made(stack, math.pi / 2 - 0.01, "lambert")
    for size in (5.0, 15.0):
        away = lobe.pixels(size) - [30.5, 20.5]
        assert np.linalg.norm(away, axis=-1).max() == pytest.approx(size, rel=0.08)
        assert np.abs(away[lobe.radii == 0.0]).max(initial=0.0) < 1e-2


@pytest.fixture(scope="module")
def window(context: moderngl.Context, tmp_path_factory: pytest.TempPathFactory) -> Iterator[HeadlessWindow]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("INSITU_STATE", str(tmp_path_factory.mktemp("state")))
        yield from opened(context, (960, 600), 1.0)


def picture_place(window: HeadlessWindow, column: float, row: float) -> tuple[float, float]:
    corner, middle = window.shell.handle_position("viewport.corner"), window.shell.handle_position("viewport.centre")
    scale = 2.0 * (middle[0] - corner[0]) / 48.0
    return corner[0] + scale * column, corner[1] + scale * row


def alt_click(window: HeadlessWindow, column: float, row: float) -> None:
    window.hold(imgui.Key.mod_alt, True)
    window.click(*picture_place(window, column, row))
    window.hold(imgui.Key.mod_alt, False)
    window.frames(4)


def test_a_hand_picks_the_pixel_and_the_lobe_follows_the_curve(window: HeadlessWindow) -> None:
    editor, board = window.shell.editor, window.shell._brdf_board
    alt_click(window, 5.5, 10.5)  # the teapot
    assert editor.view.lobe_pixel == (5, 10) and editor.view.selected.key == "teapot.1"
    before = board.surface
    assert before is not None and (before.point.column, before.point.row) == (5, 10)
    assert window.shell.handle_position("viewport.lobe") == pytest.approx(picture_place(window, 5.5, 10.5), abs=1.0)
    editor.do(SetParameter("teapot.1", "alpha", 0.8))
    window.frames(4)
    assert board.surface is not None and board.surface.radii.mean() > 1.3 * before.radii.mean()
    alt_click(window, 17.5, 10.5)  # the tray: selected along with it
    assert editor.view.selected.object == "tray" and board.surface is not None
    editor.select("teapot.1")  # the pixel shows another object than the selected one
    window.frames(4)
    assert board.surface is None
    window.key(imgui.Key.escape)
    assert editor.view.lobe_pixel is None and editor.view.selected is not None


def test_a_button_arms_the_next_click(window: HeadlessWindow) -> None:
    # For desktops that keep Alt and the mouse for themselves.
    editor = window.shell.editor
    editor.select("teapot.1")
    window.shell.do(ShowPanel("brdf"))
    window.frames(4)
    window.click_handle("brdf.pick.0")
    assert window.shell.state.picks_lobe and editor.view.lobe_pixel is None
    window.click(*picture_place(window, 8.5, 20.5))
    assert editor.view.lobe_pixel == (8, 20) and not window.shell.state.picks_lobe
    window.click(*picture_place(window, 9.5, 9.5))  # selects, as ever
    assert editor.view.lobe_pixel == (8, 20)
    window.click_handle("brdf.pick.0")
    assert editor.view.lobe_pixel is None and not window.shell.state.picks_lobe
    window.key(imgui.Key.escape)
    editor.select("teapot.1")


def test_a_script_picks_it_and_pixels_that_are_not_there_show_none(window: HeadlessWindow) -> None:
    editor, board = window.shell.editor, window.shell._brdf_board
    editor.select("teapot.1")
    run_steps(window, editor, [Step("lobe", (3, 30))])
    window.frames(4)
    assert board.surface is not None
    run_steps(window, editor, [Step("lobe", (4000, 30))])
    window.frames(4)
    assert board.surface is None
