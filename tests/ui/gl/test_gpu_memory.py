"""Allocations that fail are typed errors and leave nothing behind."""

import moderngl
import numpy as np
import pytest

from ui.gl.context import GraphicsError, is_software
from ui.gl.gpu_memory import TextureMemory, read_texture

pytestmark = pytest.mark.gl


def test_bytes_are_counted_and_given_back(context: moderngl.Context) -> None:
    memory = TextureMemory(context)
    a = memory.texture((10, 4), 4, "f4")
    b = memory.texture_array((8, 2, 3), 4, "u4")
    assert memory.bytes_in_use == 10 * 4 * 16 + 8 * 2 * 3 * 16
    memory.release(a)
    memory.release(b)
    assert memory.bytes_in_use == 0


def test_texels_come_back_row_0_first(context: moderngl.Context) -> None:
    memory = TextureMemory(context)
    values = np.arange(15, dtype=np.float32).reshape(5, 1, 3)
    texture = memory.texture((1, 5), 3, "f4", values)
    np.testing.assert_array_equal(read_texture(texture, np.float32), values)
    memory.release(texture)


@pytest.mark.parametrize(("dtype", "kind"), [("f4", np.float32), ("f1", np.uint8)])
def test_a_copy_has_the_same_texels_also_beyond_1(context: moderngl.Context, dtype: str, kind: type) -> None:
    memory, values = TextureMemory(context), (np.arange(5 * 3 * 4) * 3.7 - 9.0).reshape(5, 3, 4)
    texture = memory.texture((3, 5), 4, dtype, np.maximum(values, 0.0 if kind is np.uint8 else -9.0).astype(kind))
    copy = memory.copied(texture)
    np.testing.assert_array_equal(read_texture(copy, kind), read_texture(texture, kind))
    for each in (texture, copy):
        memory.release(each)


def test_a_size_beyond_the_driver_is_refused(context: moderngl.Context) -> None:
    memory = TextureMemory(context)
    with pytest.raises(GraphicsError, match="40000"):
        memory.texture((40000, 40000), 4, "f4")
    with pytest.raises(GraphicsError, match="20000"):
        memory.texture_array((4, 4, 20000), 4, "u4")
    assert memory.bytes_in_use == 0


def test_an_allocation_that_the_driver_refuses_is_reported(context: moderngl.Context) -> None:
    # 16,384² × 2,048 texels of 16 bytes are 8 TiB: within every limit, and in no machine.
    if not is_software(context):
        pytest.skip("a graphics card may take memory only once it is drawn to")
    side, layers = context.info["GL_MAX_TEXTURE_SIZE"], context.info["GL_MAX_ARRAY_TEXTURE_LAYERS"]
    memory = TextureMemory(context)
    with pytest.raises(GraphicsError, match="MiB"):
        memory.texture_array((side, side, layers), 4, "u4")
    assert memory.bytes_in_use == 0


def test_our_own_limit_comes_first(context: moderngl.Context) -> None:
    memory = TextureMemory(context, limit=1000)
    kept = memory.texture((10, 5), 4, "f4")
    with pytest.raises(GraphicsError, match="exceed the limit"):
        memory.texture((10, 5), 4, "f4")
    memory.release(kept)
