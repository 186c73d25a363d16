"""Errors at edges: noise of the judge is not taken for one, and pixels are averaged."""

from __future__ import annotations

import numpy as np
import pytest

from app.measure.subject import box_averaged
from benchmarks.edges import SCENES, box_error, edge_figures


def test_the_noise_of_the_judge_is_no_error() -> None:
    random = np.random.default_rng(4)
    truth = random.uniform(1.0, 2.0, (200, 200, 3))
    halves = truth + random.normal(0.0, 0.2, (2, *truth.shape))
    ours = truth + 0.03 * random.choice((-1.0, 1.0), truth.shape)
    assert box_error(ours, halves) == pytest.approx(0.03 / 1.5, rel=0.1)
    assert box_error(truth, halves) < 0.004


def test_pixels_are_averaged_in_blocks() -> None:
    fine = np.arange(4 * 6 * 3, dtype=np.float32).reshape(4, 6, 3)
    coarse = box_averaged(fine, 2)
    assert coarse.shape == (2, 3, 3)
    np.testing.assert_allclose(coarse[1, 2], fine[2:, 4:].mean(axis=(0, 1)))


def test_a_quick_run_leaves_them_out() -> None:
    figures = edge_figures(None, lambda line: None)
    assert len(figures) == 2 * len(SCENES) and all(figure.value is None for figure in figures)
