"""The tiny scene of `tests.app.measure`."""

from tests.app.measure.conftest import tiny_scene as tiny_scene
