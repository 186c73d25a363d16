"""An operator that adds a change: the bands of the changed curve are the sum, and beside its region nothing changes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from engine.curve.bands import band_nodes, band_values
from engine.curve.operators import apply_operators
from engine.inverse.change_operator import change_operator
from engine.material import MODELS
from engine.material.layer import make_layer

LAYER = make_layer(MODELS["rough_conductor"], {"alpha": 0.3})
N = 32


def bump(centre=0.5, width=0.15, height=0.4):
    nodes = band_nodes(N)
    shape = np.maximum(1.0 - np.abs(nodes - centre) / width, 0.0)
    return shape[:, None] * np.array([height, 0.5 * height, 0.0])


@pytest.mark.parametrize("change", [bump(), bump(0.0), bump(np.pi / 2), -0.02 * bump(0.3), np.full((N, 3), 0.1)])
def test_the_bands_of_the_changed_curve_are_the_sum(change):
    before = LAYER.coefficients("theta_h", N)
    operator = change_operator(change, before)
    after = LAYER.with_operators("theta_h", [operator]).coefficients("theta_h", N)
    assert after == pytest.approx(before + change, abs=1e-2 * np.abs(change).max())


def test_nothing_changes_beside_its_region():
    operator = change_operator(bump(), LAYER.coefficients("theta_h", N))
    a, _, _, d = operator.regions
    assert 0.2 < a < 0.4 and 0.6 < d < 0.85
    gamma = np.concatenate([np.linspace(0.0, a, 50), np.linspace(d, np.pi / 2, 50)])
    below = LAYER.generated_curve("theta_h")
    assert (apply_operators([operator], below)(gamma) == below(gamma)).all()


def test_it_is_muted_scaled_and_moved_as_other_operators():
    operator, gamma = change_operator(bump(), LAYER.coefficients("theta_h", N)), np.linspace(0.0, 1.5, 200)
    below = LAYER.generated_curve("theta_h")
    added = apply_operators([operator], below)(gamma) - below(gamma)
    muted = dataclasses.replace(operator, muted=True)
    assert (apply_operators([muted], below)(gamma) == below(gamma)).all()
    half = dataclasses.replace(operator, magnitude=0.5)
    assert apply_operators([half], below)(gamma) - below(gamma) == pytest.approx(0.5 * added, abs=1e-9)
    right = apply_operators([operator.moved(0.2)], below)(gamma + 0.2) - below(gamma + 0.2)
    assert right == pytest.approx(added, abs=1e-9)


def test_no_change_is_no_operator():
    assert change_operator(np.zeros((N, 3)), LAYER.coefficients("theta_h", N)) is None


def test_a_ratio_multiplies():
    flat = dataclasses.replace(change_operator(bump(), LAYER.coefficients("theta_h", N)), kind="ratio")
    gamma, below = np.array([0.5]), LAYER.generated_curve("theta_h")
    t = flat(gamma)
    assert apply_operators([flat], below)(gamma) == pytest.approx(below(gamma) * t)
    twice = dataclasses.replace(flat, magnitude=2.0)
    assert apply_operators([twice], below)(gamma) == pytest.approx(below(gamma) * (1.0 + 2.0 * (t - 1.0)))
    assert band_values(apply_operators([flat], below), N).shape == (N, 3) and not flat.replaces_all
