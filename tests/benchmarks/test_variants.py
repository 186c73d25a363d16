"""What the program could do in another way, as settings beside those of the program."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.run import run
from benchmarks.variants import FRAMES, WHOLE, VariantEffort, in_bits
from tests.app.measure.test_settings import TINY
from tests.benchmarks.test_run import EFFORT


def test_numbers_in_few_bits() -> None:
    values = np.array([[1.0], [-0.49], [0.1]])
    assert in_bits(values, 2).tolist() == [[1.0], [0.0], [0.0]]  # -1, 0 and 1 are all there are
    assert in_bits(values, WHOLE) is values
    near = in_bits(values, "bfloat16")
    assert 0.0 < np.abs(near - values).max() <= 2.0**-9  # eight bits of mantissa: half a step below 1
    assert in_bits(np.zeros((2, 1)), 4).tolist() == [[0.0], [0.0]]


@pytest.mark.sweep
def test_all_variants_of_a_tiny_scene(tiny_scene: str, tmp_path: Path) -> None:
    variants = VariantEffort(("ours", "cut alone", "OPT", "TRUE"), (2, 2, 12), 6, 4, (20, 320), (4, WHOLE))
    effort = replace(EFFORT, settings=TINY, variants=variants)
    run(tiny_scene, tmp_path, report=lambda _: None, effort=effort, only=["settings"])
    with open(tmp_path / "settings.csv", newline="", encoding="utf-8") as file:
        found = {(line["setting"], line["value"]): float(line["error"]) for line in csv.DictReader(file)}
    assert found["shadows", "TRUE"] <= found["shadows", "cut alone"] + 0.05
    assert {(f"wavelets a frame, {name}", "16") for name in FRAMES} <= found.keys()
    # Both representations are the plain sum, in single precision.
    assert max(error for (setting, _), error in found.items() if setting.startswith("representation")) < 1e-5
    assert found["coefficients, adaptive, by size", "320"] <= found["coefficients, adaptive, by size", "20"]
    assert found["bits of a coefficient", WHOLE] <= found["bits of a coefficient", "4"]
