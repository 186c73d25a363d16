"""Shaders compiled ahead: all that a picture needs, step by step, and nothing left behind."""

from __future__ import annotations

import moderngl
import numpy as np
import pytest

from engine.light.cones import ALL_ROUND
from engine.scene.description import Camera
from engine.scene.lamp_shape import SIZES
from tests.ui.gl.pictures import finish, frame_of, norms_of
from ui.gl.display import DisplayView
from ui.gl.gpu_memory import TextureMemory
from ui.modes.placement.gl.moved_lamps import ShownLamp
from ui.modes.placement.gl.renderer import PlacementRenderer
from ui.modes.placement.gl.shader_warm_up import warm_up

pytestmark = pytest.mark.gl


def programs(renderer: PlacementRenderer) -> set[object]:
    return set(renderer._passes._programs._programs)


def draw_everything(renderer: PlacementRenderer) -> np.ndarray:
    """A picture as the worker's first answers make it, then a finer one with a curve at work."""
    image = np.zeros((6, 8), int)
    image[:, 4:] = -1
    renderer.set_frame(frame_of(image))
    renderer.set_environment(np.ones((4, 8, 3), np.float32))
    renderer.composite(DisplayView(selected=0))
    n = int((image == 0).sum())
    renderer.set_footprint(np.zeros((n, 4), np.int32), np.full((n, 4), 0.25, np.float32))
    renderer.set_layer("ball.0", 0, 1)
    renderer.set_layer_radiance("ball.0", np.ones((1, 3), np.float32))
    renderer.composite(DisplayView(selected=0))
    renderer.set_footprint(None)
    renderer.set_layer_radiance("ball.0", np.ones((n, 3), np.float32))
    renderer.set_view_curve("ball.0", np.full((256, 3), 0.5))
    renderer.set_indirect_footprint(np.zeros((n, 4), np.int32), np.full((n, 4), 0.25, np.float32))
    renderer.set_layer_indirect("ball.0", np.ones((1, 3), np.float32))
    renderer.composite(DisplayView(selected=0))
    renderer.set_view_curve("ball.0", None)
    place = tuple(np.diag([0.1, 0.1, 0.1, 1.0]).ravel().tolist())
    camera = Camera(position=(0.0, 0.0, 2.0), target=(0.0, 0.0, 0.0))
    lamps = [ShownLamp(0, primitive, place, (1.0, 1.0, 1.0), ALL_ROUND) for primitive in SIZES]
    renderer.set_moved_lamps(camera, tuple(lamps))
    renderer.composite(DisplayView())
    renderer.set_moved_lamps(camera, ())
    transport = np.random.default_rng(1).uniform(0.1, 1.0, (4, n, 3)).astype(np.float16)
    renderer.begin_transport("ball.0", transport, norms_of(transport))
    while not renderer.upload(1.0):
        pass
    renderer.want("ball.0", np.full((4, 3), 0.5))
    finish(renderer)
    renderer.composite(DisplayView(selected=0))
    return renderer.display_image()


def test_no_program_is_left_for_the_first_picture(renderer: PlacementRenderer) -> None:
    for _ in warm_up(renderer):
        pass
    rehearsed = programs(renderer)
    draw_everything(renderer)
    assert programs(renderer) == rehearsed


def test_a_warm_up_leaves_no_picture_and_changes_none(context: moderngl.Context, renderer: PlacementRenderer) -> None:
    for _ in warm_up(renderer):
        pass
    assert renderer.frame is None and renderer.layer_keys == () and renderer._edited.keys == ()
    unrehearsed = PlacementRenderer(context)
    np.testing.assert_array_equal(draw_everything(renderer), draw_everything(unrehearsed))
    unrehearsed.release()


def test_a_scene_may_come_at_any_step(context: moderngl.Context) -> None:
    plain = PlacementRenderer(context)
    expected = draw_everything(plain)
    n_steps = sum(1 for _ in warm_up(plain))
    plain.release()
    for stop in range(0, n_steps, 4):
        renderer = PlacementRenderer(context)
        for _ in zip(range(stop), warm_up(renderer), strict=False):
            pass
        np.testing.assert_array_equal(draw_everything(renderer), expected)
        renderer.release()
        assert renderer.memory_bytes == 0


@pytest.mark.parametrize("size", [(90, 70), (128, 128), (128, 70)])
def test_textures_have_sides_as_those_of_the_warm_up(
    renderer: PlacementRenderer, size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """llvmpipe compiles for powers of two apart; what was rehearsed holds for pictures of all sizes."""
    kinds: set[tuple[bool, ...]] = set()
    made = TextureMemory.texture

    def noted(memory: TextureMemory, size: tuple[int, int], components: int, dtype: str, *rest: object) -> object:
        kinds.add((*(side & (side - 1) == 0 for side in size), components, dtype))
        return made(memory, size, components, dtype, *rest)

    monkeypatch.setattr(TextureMemory, "texture", noted)
    for _ in warm_up(renderer):
        pass
    rehearsed = set(kinds)
    kinds.clear()
    image = np.zeros(size[::-1], int)
    renderer.set_frame(frame_of(image))
    renderer.set_environment(np.ones((32, 64, 3), np.float32))
    renderer.set_layer("ball.0", 0, image.size)
    assert kinds <= rehearsed and len(kinds) > 5
