"""Shaders compiled before a picture needs them: a picture of a few pixels, drawn in all the ways that one can be.

A driver compiles a shader when it is first drawn with, llvmpipe in 5 to 10 ms each and anew for each format of what it
reads and writes. A dozen of them in the first picture's frame would block the window; here each has a step of its own.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from engine.scene.picture_frame import PictureFrame
from ui.gl.placement.renderer import PlacementRenderer
from ui.gl.tonemap import DisplayView

_SIDE = 8
_KEY = "rehearsal"
_N_BANDS = 2


def rehearse(renderer: PlacementRenderer) -> Iterator[None]:
    """Draw, a step at a time, what pictures are made of; the renderer is empty again after the last step.

    Left unfinished, it is made good by the next `set_frame`.
    """
    renderer.set_frame(_frame())
    renderer.set_environment(np.ones((_SIDE, 2 * _SIDE, 3), np.float32))
    yield
    renderer.linear_image()
    yield
    renderer.composite(DisplayView())
    yield
    renderer.composite(DisplayView(selected=0))
    yield
    for sampled in (_coarsely, _finely):
        samples = sampled(renderer)
        renderer.set_layer_radiance(_KEY, np.ones((samples, 3), np.float32))
        renderer.composite(DisplayView())
        yield
        yield from _transport(renderer, samples)
    renderer.set_view_curve(_KEY, np.ones((256, 3)))
    renderer.composite(DisplayView())
    yield
    renderer.clear()


def _coarsely(renderer: PlacementRenderer) -> int:
    """A layer with one sample for all pixels; the number of samples."""
    n_pixels = _SIDE * _SIDE
    rows, weights = np.zeros((n_pixels, 4), np.int32), np.full((n_pixels, 4), 0.25, np.float32)
    renderer.set_footprint(rows, weights)
    renderer.set_layer(_KEY, 0, 1)
    return 1


def _finely(renderer: PlacementRenderer) -> int:
    renderer.set_footprint(None)
    return _SIDE * _SIDE


def _transport(renderer: PlacementRenderer, samples: int) -> Iterator[None]:
    """Increments of a curve: uploaded, begun from another one, drawn."""
    half = np.ones((_N_BANDS, samples, 3), np.float16)
    renderer.begin_transport(_KEY, half, np.ones((_N_BANDS, 3)))
    while not renderer.upload(0.0):
        yield
    renderer.wanted(_KEY, np.ones((_N_BANDS, 3)))
    renderer.update()
    renderer.composite(DisplayView())
    yield


def _frame() -> PictureFrame:
    """A picture full of one object, with a silhouette pixel."""
    n_pixels = _SIDE * _SIDE
    return PictureFrame(
        pixel=np.arange(n_pixels, dtype=np.int32),
        object_ranges=np.array([[0, n_pixels]], np.int32),
        object_image=np.zeros((_SIDE, _SIDE), np.int16),
        theta_o=np.zeros(n_pixels, np.float32),
        emission_image=np.zeros((_SIDE, _SIDE, 3), np.float32),
        ray_directions=np.ones((_SIDE, _SIDE, 3), np.float32),
        edge_pixels=np.zeros(1, np.int32),
        edge_neighbours=np.ones(1, np.int32),
        edge_weights=np.full(1, 0.5, np.float32),
    )
