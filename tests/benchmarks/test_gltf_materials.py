"""The judge of glTF's materials: it tells layers from the formulas, and finds them alike."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks import gltf_materials
from benchmarks.gltf_materials import CASES, measure_layers

NO_SKY = Path()  # a lamp needs none


@pytest.fixture(autouse=True)
def few_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gltf_materials, "SIDE", 12)


@pytest.mark.parametrize("name", ["core, half a metal", "clearcoat", "specular", "iridescence, plastic"])
def test_layers_with_textures_are_the_formula(name: str, tmp_path: Path) -> None:
    # Strengths and colours multiply layers exactly, also where they are filtered: both sides have the same paths.
    assert measure_layers(CASES[name], "quad", "lamp", NO_SKY, tmp_path).rmse < 1e-5


def test_another_formula_is_found(tmp_path: Path) -> None:
    case = CASES["clearcoat"]
    bare = replace(case, inputs=replace(case.inputs, clearcoat=0.9))
    assert measure_layers(bare, "quad", "lamp", NO_SKY, tmp_path).rmse > 1e-3
