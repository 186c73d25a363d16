"""The screen's values in Python: held to the same slow twin as the shader."""

import numpy as np
import pytest

from engine.render.display import ToneMapping, display_picture
from tests.naive import pictures as naive

VALUES = np.concatenate([[0.0, 0.0031307, 0.0031309], np.geomspace(1e-5, 1e5, 80)])


@pytest.mark.parametrize("exposure", [0.0, -2.0, 3.5])
@pytest.mark.parametrize("tone_mapping", ["linear", "filmic"])
def test_values_follow_the_formulas(tone_mapping: ToneMapping, exposure: float) -> None:
    picture = display_picture(np.repeat(VALUES[None, :, None], 3, axis=2), exposure, tone_mapping)
    curve = naive.filmic if tone_mapping == "filmic" else lambda value: min(max(value, 0.0), 1.0)
    expected = [round(255 * naive.encode_srgb(curve(value * 2.0**exposure))) for value in VALUES]
    assert picture.dtype == np.uint8
    # One step where the twin's and our rounding of a half differ.
    assert np.abs(picture[0, :, 1].astype(int) - expected).max() <= 1


def test_no_radiance_is_too_bright_or_too_dark() -> None:
    picture = display_picture(np.array([[[np.finfo(np.float32).max] * 3, [-1.0] * 3]], np.float32), exposure=-64.0)
    # Exposure -64 turns 3.4e38 into 1.8e19, still white; below zero is black.
    assert picture.tolist() == [[[255] * 3, [0] * 3]]
