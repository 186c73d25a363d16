"""The judge of MaterialX's surface shaders: it tells layers from the formulas, and finds them alike."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.material_pictures import Directions, measure_layers
from benchmarks.mtlx_materials import CASES, Case

pytest.importorskip("MaterialX")
NO_SKY = Path()  # a lamp needs none
SIDE = 12


class Brighter(Case):
    """A judge whose formula is 5 % brighter."""

    def reflection(self, inputs: Any, base: Directions, coat: Directions) -> NDArray[np.float64]:
        return 1.05 * super().reflection(inputs, base, coat)


@pytest.mark.parametrize(
    "name",
    ["OpenPBR, plastic", "OpenPBR, rough metal", "OpenPBR, fuzz of roughness 1", "Standard, sheen", "Preview, coat"],
)
def test_layers_with_textures_are_the_formula(name: str, tmp_path: Path) -> None:
    # Both sides have the same paths. The rest is light that facets scatter again, and the judge's tables of albedos.
    case = replace(CASES[name], textured=CASES[name].textured[:1])
    assert measure_layers(case, "quad", "lamp", NO_SKY, tmp_path, SIDE).rmse < 1.5e-2


def test_a_mixture_of_metals_is_nearly_the_formula(tmp_path: Path) -> None:
    # Five metals for all colours. Schlick's term was 104 % off here, in the picture.
    case = replace(CASES["Standard, metal"], textured=("base_color",))
    assert measure_layers(case, "quad", "lamp", NO_SKY, tmp_path, SIDE).rmse < 3e-2


def test_another_formula_is_found(tmp_path: Path) -> None:
    case = Brighter(CASES["OpenPBR, fuzz of roughness 1"].inputs, ())
    assert measure_layers(case, "quad", "lamp", NO_SKY, tmp_path, SIDE).rmse > 4e-2
