"""One OpenGL context for all GL tests, without window or display; GL errors are checked before and after each test."""

from collections.abc import Iterator

import moderngl
import pytest

from ui.gl.context import GraphicsError, create_headless_context
from ui.modes.placement.gl.renderer import PlacementRenderer


@pytest.fixture(scope="session")
def shared_context() -> moderngl.Context:
    try:
        return create_headless_context()
    except GraphicsError as failure:
        pytest.skip(str(failure))


@pytest.fixture
def context(shared_context: moderngl.Context) -> Iterator[moderngl.Context]:
    assert shared_context.error == "GL_NO_ERROR"
    yield shared_context
    assert shared_context.error == "GL_NO_ERROR"


@pytest.fixture
def renderer(context: moderngl.Context) -> Iterator[PlacementRenderer]:
    """A renderer that must give back every byte it took."""
    made = PlacementRenderer(context)
    yield made
    made.release()
    assert made.memory_bytes == 0
