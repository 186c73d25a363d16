"""The recorded drag: from the editor's picture, and each frame as it was."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from benchmarks.programs.recorded_drag import FRAME_MS, LAST_MS, frames, save


def test_all_pictures_are_in_the_file(tmp_path: Path) -> None:
    pictures = list(np.random.default_rng(1).integers(0, 256, (3, 6, 8, 3), dtype=np.uint8))
    save(pictures, tmp_path / "drag.png")
    with Image.open(tmp_path / "drag.png") as image:
        for i, expected in enumerate(pictures):
            image.seek(i)
            np.testing.assert_array_equal(np.asarray(image.convert("RGB")), expected)
            assert image.info["duration"] == (LAST_MS if i == 2 else FRAME_MS)


@pytest.mark.gl
def test_a_drag_changes_the_picture_in_each_frame() -> None:
    first, second = frames((24, 24), 2)
    assert first.shape == (24, 24, 3) and (first != second).any()
