"""Compiles shaders before a picture needs them, by drawing small pictures with all of their variants.

A driver compiles a shader when it is first drawn with, and anew for each format of what it reads and writes. llvmpipe
needs 50 to 100 ms for each on the first start of a machine (later ones find most of them in Mesa's cache), and compiles
once more where the sides of a texture are powers of two. A dozen in the first picture's frame would block the window;
here each has its own step.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engine.light.cones import ALL_ROUND
from engine.scene.description import Camera
from engine.scene.lamp_shape import SIZES
from engine.scene.picture_frame import PictureFrame
from ui.gl.display import DisplayView
from ui.modes.placement.gl.moved_lamps import ShownLamp
from ui.modes.placement.gl.renderer import PlacementRenderer
from ui.modes.placement.gl.transport import SAMPLES_PER_ROW

# Width and height of pictures; their samples fill three rows of textures, as no power of two.
_SIZES = ((60, 60), (64, 64), (64, 60))
_N_SAMPLES = 3 * SAMPLES_PER_ROW
_ENVIRONMENT = (8, 16)
_BASE, _UPPER = "base", "upper"
_N_BANDS = 2


def warm_up(renderer: PlacementRenderer) -> Iterator[None]:
    """Draw all that pictures are made of, one part per step; the renderer is empty again after the last step.

    If it is not finished, the next `set_frame` removes the rest.
    """
    for width, height in _SIZES:
        yield from _picture(renderer, width, height)
    renderer.clear()


def _picture(renderer: PlacementRenderer, width: int, height: int) -> Iterator[None]:
    renderer.set_frame(_frame(width, height))
    yield
    renderer.set_environment(np.ones((*_ENVIRONMENT, 3), np.float32))
    renderer.linear_image()
    yield
    renderer.composite(DisplayView())
    yield
    renderer.composite(DisplayView(selected=0))
    yield
    renderer.set_catchers([0], np.ones((height, width, 3), np.float32))
    renderer.linear_image()
    renderer.set_catchers([], None)
    yield
    camera, matrix = Camera(position=(0.0, 0.0, 2.0), target=(0.0, 0.0, 0.0)), tuple(np.eye(4).ravel().tolist())
    for primitive in SIZES:
        renderer.set_moved_lamps(camera, (ShownLamp(0, primitive, matrix, (1.0, 1.0, 1.0), ALL_ROUND),))
        renderer.linear_image()
        renderer.set_moved_lamps(camera, ())
        yield
    rows, weights = np.zeros((_N_SAMPLES, 4), np.int32), np.full((_N_SAMPLES, 4), 0.25, np.float32)
    renderer.set_footprint(rows, weights)
    renderer.set_indirect_footprint(rows, weights)
    yield from _layers(renderer)
    renderer.set_footprint(None)
    yield from _layers(renderer)
    renderer.set_layer_maps(_BASE, np.ones((_N_SAMPLES, 4), np.float16))
    for indirect in (None, np.ones((_N_SAMPLES, 3), np.float32)):
        for view_curve in (None, np.full((256, 3), 0.5)):
            renderer.set_layer_indirect(_BASE, indirect)
            renderer.set_view_curve(_BASE, view_curve)
            renderer.composite(DisplayView())
            yield


def _layers(renderer: PlacementRenderer) -> Iterator[None]:
    """Draw a layer alone and one above it, both with a curve in use, with indirect light and with a view curve."""
    for key in (_BASE, _UPPER):
        renderer.set_layer(key, 0, _N_SAMPLES)
        renderer.set_layer_radiance(key, np.ones((_N_SAMPLES, 3), np.float32))
        renderer.composite(DisplayView())
        yield
    yield from _transport(renderer)
    for key in (_UPPER, _BASE):
        renderer.set_layer_indirect(key, np.ones((_N_SAMPLES, 3), np.float32))
        renderer.composite(DisplayView())
        yield
        renderer.set_view_curve(key, np.full((256, 3), 0.5))
        renderer.composite(DisplayView())
        yield
        renderer.set_layer_indirect(key, None)
        renderer.composite(DisplayView())
        yield
        renderer.set_view_curve(key, None)


def _transport(renderer: PlacementRenderer) -> Iterator[None]:
    """Upload a curve's transport, start from another curve, draw increments."""
    half = np.ones((_N_BANDS, _N_SAMPLES, 3), np.float16)
    renderer.begin_transport(_BASE, half, np.ones((_N_BANDS, 3)))
    while not renderer.upload(0.0):
        yield
    renderer.want(_BASE, np.ones((_N_BANDS, 3)))
    renderer.update()
    renderer.composite(DisplayView())
    yield


def _frame(width: int, height: int) -> PictureFrame:
    """A picture of one object, one of whose pixels is half covered."""
    seen = np.arange(width * height).reshape(height, width) < _N_SAMPLES
    return PictureFrame(
        pixel=np.arange(_N_SAMPLES, dtype=np.int32),
        object_ranges=np.array([[0, _N_SAMPLES]], np.int32),
        object_image=np.where(seen, 0, -1).astype(np.int16),
        theta_o=np.zeros(_N_SAMPLES, np.float32),
        emission_image=np.zeros((height, width, 3), np.float32),
        ray_directions=np.ones((height, width, 3), np.float32),
        distance=np.ones(_N_SAMPLES, np.float32),
        share=np.where(np.arange(_N_SAMPLES) == 0, 0.5, 1.0).astype(np.float32),
    )
