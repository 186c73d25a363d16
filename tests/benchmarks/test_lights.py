"""The closed forms of lights without size, at few pixels."""

from pathlib import Path

import pytest

from benchmarks.lights import LIGHTS, measure_light


@pytest.mark.parametrize("name", LIGHTS)
def test_placement_is_near_the_closed_form(name: str, tmp_path: Path) -> None:
    found = measure_light(LIGHTS[name], "placement", tmp_path, (16, 12))
    # The lamp is 3 cm wide, which blurs the edge of a cone of one degree, 4 cm on the floor.
    assert found.error < (0.1 if "24°" in name else 0.01)
    assert abs(found.mean) < (0.01 if "24°" in name else 0.005)
