"""The judge of glTF's materials: it tells layers from the formulas, and finds them alike."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.gltf_materials import CASES
from benchmarks.material_pictures import judged_errors, measure_layers

NO_SKY = Path()  # a lamp needs none
SIDE = 12


@pytest.mark.parametrize("name", [
    "core, half a metal", "clearcoat", "clearcoat, its normals", "clearcoat, base's normals", "specular",
    "iridescence, plastic",
])  # fmt: skip
def test_layers_with_textures_are_the_formula(name: str, tmp_path: Path) -> None:
    # Strengths and colours multiply layers exactly, also where they are filtered: both sides have the same paths.
    assert measure_layers(CASES[name], "quad", "lamp", NO_SKY, tmp_path, SIDE).rmse < 1e-5


def test_another_formula_is_found(tmp_path: Path) -> None:
    case = CASES["clearcoat"]
    bare = replace(case, inputs=replace(case.inputs, clearcoat=0.9))
    assert measure_layers(bare, "quad", "lamp", NO_SKY, tmp_path, SIDE).rmse > 1e-3


def test_errors_are_without_the_noise_of_the_judge() -> None:
    # A picture that is 3 % off in every other pixel and 1 % too bright, against estimates of ten times that noise.
    generator = np.random.default_rng(5)
    truth = np.ones((100_000, 3))
    ours = truth + 0.01 + 0.03 * np.resize([1.0, -1.0], (100_000, 1))
    halves = truth + 0.3 * generator.uniform(-1.0, 1.0, (2, 100_000, 1))
    found = judged_errors(ours, halves)
    noise = 0.3 / np.sqrt(3.0) / np.sqrt(2.0)  # uniform, of two: 12.2 %
    assert found.noise == pytest.approx(noise, rel=0.01)
    assert found.mean_deviation == pytest.approx(noise / np.sqrt(100_000), rel=0.01)
    assert abs(found.mean - 0.01) < 4.0 * found.mean_deviation
    # 0.01² + 0.03²; the product of both noises deviates by 0.03, its mean by 0.0001; with the noise it would be 0.016.
    assert found.rmse**2 == pytest.approx(0.001, abs=4e-4)
