"""Which pixels take the place of those that show a lamp where it was, and how far away the surfaces are: against a
search over all pixels."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.core.generators import run_to_end
from engine.scene.picture_frame import Lamps, PictureFrame
from ui.modes.placement.gl.moved_lamps import centre_distances, filled_pixels, pointless_pixels

N_SURFACES, LAMPS = 2, (2, 3)


def frame(image: np.ndarray, edges: list[int]) -> PictureFrame:
    """Objects of numbers below 2 have a point at each pixel, those from 2 on are lamps; edges: pixels that show some of
    lamp 2 in a part."""
    pixels = [np.flatnonzero(image.ravel() == i) for i in range(N_SURFACES)]
    ends = np.cumsum([0, *map(len, pixels), 0, 0])
    ranges = np.stack([ends[:-1], ends[1:]], axis=1)
    pixel, nothing = np.concatenate(pixels), np.zeros((*image.shape, 3), np.float32)
    n = len(edges)
    lamps = Lamps(np.array(edges), np.full(n, 2), np.full(n, 0.5), np.ones((n, 3)), np.ones((n, 3)))
    distance = np.arange(1.0, len(pixel) + 1.0, dtype=np.float32)
    return PictureFrame(pixel, ranges, image, nothing, nothing, np.zeros(len(pixel)), distance=distance, lamps=lamps)


@st.composite
def frames(draw: st.DrawFn) -> PictureFrame:
    height, width = draw(st.integers(1, 9)), draw(st.integers(1, 9))
    image = np.array(draw(st.lists(st.integers(-1, 3), min_size=height * width, max_size=height * width)))
    for _ in range(draw(st.integers(0, 2))):  # whole lamps
        y, x = draw(st.integers(0, height - 1)), draw(st.integers(0, width - 1))
        image.reshape(height, width)[y : y + 4, x : x + 4] = draw(st.sampled_from(LAMPS))
    edges = draw(st.lists(st.integers(0, height * width - 1), min_size=1, max_size=4, unique=True))
    return frame(image.reshape(height, width), sorted(edges))


@settings(deadline=None, max_examples=150)
@given(frames(), st.sampled_from([(2,), (3,), (2, 3)]))
def test_each_pixel_of_a_lamp_takes_the_nearest_in_its_row_or_column(some: PictureFrame, objects: tuple[int, ...]):
    image = some.object_image
    shown = np.zeros(image.shape, bool)
    for y, x in np.argwhere(np.isin(image, objects)):
        shown[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = True
    if 2 in objects:
        shown.ravel()[some.lamps.pixel] = True
    expected = {}
    for y, x in np.argwhere(shown):
        away = [abs(x - other) for other in range(some.width) if not shown[y, other]]
        away += [abs(y - other) for other in range(some.height) if not shown[other, x]]
        if away:
            expected[y * some.width + x] = min(away)
    own, others = filled_pixels(some, pointless_pixels(some), objects)
    (y, x), (to_y, to_x) = np.divmod(own, some.width), np.divmod(others, some.width)
    assert dict(zip(own.tolist(), (abs(y - to_y) + abs(x - to_x)).tolist(), strict=True)) == expected
    assert not shown[to_y, to_x].any() and ((y == to_y) | (x == to_x)).all()


def test_distances_are_those_of_the_surfaces_at_the_centres():
    image = np.array([[0, 0, 2], [-1, 1, 3]])
    assert run_to_end(centre_distances(frame(image, [0]))).tolist() == [[1.0, 2.0, np.inf], [np.inf, 3.0, np.inf]]


@pytest.mark.parametrize("objects", [(2,), (2, 3)])
def test_a_picture_of_lamps_alone_has_nothing_to_take(objects: tuple[int, ...]):
    some = frame(np.full((3, 4), 2), [0])
    assert not filled_pixels(some, pointless_pixels(some), objects)[0].size
