"""The colour of a black body against the chromaticities of the Planckian locus."""

from __future__ import annotations

import numpy as np
import pytest

from engine.core.blackbody import blackbody_colour

TO_XYZ = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]


# CIE 1931 (x, y) of black bodies, from the table in Wyszecki and Stiles, Color Science, 2nd ed.
@pytest.mark.parametrize(
    ("kelvin", "x", "y"),
    [(2000, 0.5267, 0.4133), (3000, 0.4369, 0.4041), (4000, 0.3805, 0.3768), (5000, 0.3451, 0.3516),
     (6000, 0.3221, 0.3318), (8000, 0.2952, 0.3048), (10000, 0.2807, 0.2884)],
)  # fmt: skip
def test_chromaticities_are_those_of_the_locus(kelvin: float, x: float, y: float) -> None:
    xyz = np.array(TO_XYZ) @ blackbody_colour(kelvin)
    assert tuple(xyz[:2] / xyz.sum()) == pytest.approx((x, y), abs=1e-3)


@pytest.mark.parametrize("kelvin", [1667, 1700, 2222, 2222.1, 4000, 4000.1, 6500, 25000])
def test_the_luminance_is_one_and_no_channel_negative(kelvin: float) -> None:
    colour = np.array(blackbody_colour(kelvin))
    assert colour @ [0.2126, 0.7152, 0.0722] == pytest.approx(1.0) and colour.min() >= 0.0


@pytest.mark.parametrize("kelvin", [0, 1666, 25001, float("nan")])
def test_other_temperatures_are_refused(kelvin: float) -> None:
    with pytest.raises(ValueError, match="expected 1667 to 25000"):
        blackbody_colour(kelvin)
