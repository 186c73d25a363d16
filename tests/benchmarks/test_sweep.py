"""The sweep: rows and their file, precision and the order of coefficients."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from app.measure.subject import layer_bands, open_subject, precompute, reflected
from benchmarks.sweep import Grid, SweepRow, precision_picture, run_sweep, terms_by_effect, write_csv
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import PREVIEW

GRID = Grid((50, 400), (16, 64), (1, 64), side=24, n_points=8, level=4, oracle_lights=2000)


def test_terms_are_taken_by_their_effect_on_the_picture() -> None:
    delta = np.array([[1.0] * 3, [10.0] * 3, [0.5] * 3])
    planes = np.ones((3, 4, 3), np.float32) * np.array([1.0, 0.01, 4.0], np.float32)[:, None, None]
    # |Δc|·‖T‖ is proportional to 1, 0.1 and 2: the largest Δc comes last.
    assert terms_by_effect(delta, planes).tolist() == [2, 0, 1]


def test_bands_scale_with_the_sharpest_curve_and_slow_ones_keep_their_few() -> None:
    layer = make_layer(MODELS["rough_conductor"])
    planned = layer_bands(layer)
    assert list(layer_bands(layer, 256).values()) == [256, planned["theta_d"]]
    assert list(layer_bands(layer, 4).values()) == [4, 4]


def test_a_sweep_has_every_setting_once_and_its_file_reads_back(tiny_scene: str, tmp_path: Path) -> None:
    subject = open_subject(tiny_scene, (24, 18))
    frames = {"half": {1: 0.002, 64: 0.01}}
    result = run_sweep(subject, GRID, frames)
    precomputed = [row for row in result.rows if row.study == "precompute"]
    edits = [row for row in result.rows if row.study == "edit"]
    settings = {(row.lights, row.bands, row.precision, row.visibility) for row in precomputed}
    # 2 lights × 2 bands × half and float, and for each light brute force and the cut alone.
    assert len(settings) == len(precomputed) == 2 * 2 * 2 + 2 * 2
    assert [(row.wavelets, row.precision, row.seconds) for row in edits] == [
        (1, "half", 0.002),
        (64, "half", 0.01),
        (1, "float", None),
        (64, "float", None),
    ]
    assert all(math.isfinite(row.error) and row.error >= 0 for row in result.rows)
    assert list(result.against_oracle) == [400, 2000]
    assert result.against_oracle[2000].rmse < result.against_oracle[400].rmse
    assert any(row.pareto for row in precomputed) and any(row.pareto for row in edits)
    # A frame with all coefficients is nearer to the truth than one with the first of them.
    assert edits[1].error < edits[0].error
    write_csv(tmp_path / "sweep.csv", result.rows)
    with open(tmp_path / "sweep.csv", newline="") as file:
        lines = list(csv.DictReader(file))
    assert [line["visibility"] for line in lines] == [row.visibility for row in result.rows]
    assert [float(line["error"]) for line in lines] == pytest.approx([row.error for row in result.rows], rel=1e-5)
    assert [line["seconds"] == "" for line in lines] == [row.seconds is None for row in result.rows]


def test_float_planes_give_the_picture_of_the_store_and_half_planes_nearly(tiny_scene: str) -> None:
    done = precompute(open_subject(tiny_scene), PREVIEW)
    rows = np.arange(0, len(done.placement.hits.pixel), 7)
    whole = reflected(done)[rows]
    # Wavelets are orthonormal, so both sums are the same but for single precision; a half float has 11 bits.
    np.testing.assert_allclose(precision_picture(done, "float", rows), whole, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(precision_picture(done, "half", rows), whole, rtol=5e-3, atol=1e-3)


def test_unknown_seconds_are_empty_cells(tmp_path: Path) -> None:
    row = SweepRow("edit", 400, 64, 8, "half", "coherent", 0.25, None, 12, 1.5)
    write_csv(tmp_path / "rows.csv", [row])
    assert (tmp_path / "rows.csv").read_text() == (
        "study,lights,bands,wavelets,precision,visibility,error,seconds,rays,mib,pareto\n"
        "edit,400,64,8,half,coherent,0.25,,12,1.5,False\n"
    )
