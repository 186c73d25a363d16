"""The change of one curve on another: the same difference, share or ratio at each angle."""

from __future__ import annotations

import numpy as np
import pytest

from engine.curve.operators import Operator
from engine.inverse.transferred_edit import MEASURES, transferred_edit
from engine.material import MODELS
from engine.material.layer import make_layer

LIFT = Operator("amplify", "y", 0.1, 0.3, 0.6, 0.9, magnitude=3.0)
SHIFT = Operator("translate", "x", 0.0, 0.2, 0.5, 0.8, magnitude=0.05)
SOURCE = make_layer(MODELS["rough_conductor"], {"alpha": 0.3}).with_operators("theta_h", [LIFT, SHIFT])
OTHER = make_layer(MODELS["blinn_phong"], {"exponent": 20.0})
GAMMA = np.linspace(0.0, 1.5, 400)


def curves(layer):
    return layer.generated_curve("theta_h")(GAMMA), layer.curve("theta_h")(GAMMA)


def changed(measure, source=SOURCE, target=OTHER):
    operator = transferred_edit(source, target, "theta_h", measure)
    return target.with_operators("theta_h", [operator])


def test_the_difference_is_the_same():
    (before, after), (below, above) = curves(SOURCE), curves(changed("absolute"))
    assert above == pytest.approx(np.maximum(below + after - before, 0.0), abs=2e-3 * after.max())


def test_the_share_of_the_highlight_is_the_same():
    (before, after), (below, above) = curves(SOURCE), curves(changed("relative"))
    expected = np.maximum(below + (after - before) * below.max() / before.max(), 0.0)
    assert above == pytest.approx(expected, abs=2e-3 * expected.max())


def test_the_ratio_is_the_same():
    (before, after), (below, above) = curves(SOURCE), curves(changed("ratio"))
    assert above == pytest.approx(below * after / before, rel=5e-3, abs=1e-6 * below.max())


@pytest.mark.parametrize("measure", MEASURES)
def test_a_curve_that_gets_its_own_change_is_the_edited_one(measure):
    bare = SOURCE.replace(edits=())
    (_, after), (_, again) = curves(SOURCE), curves(changed(measure, target=bare))
    assert again == pytest.approx(after, rel=5e-3, abs=2e-3 * after.max())


@pytest.mark.parametrize("measure", MEASURES)
def test_no_change_is_no_operator_and_black_curves_are_finite(measure):
    bare = SOURCE.replace(edits=())
    assert transferred_edit(bare, OTHER, "theta_h", measure) is None
    black = SOURCE.with_operators("theta_h", [Operator("amplify", "y", 0.0, 0.0, 1.6, 1.6, magnitude=0.0)])
    operator = transferred_edit(black, OTHER, "theta_h", measure)
    values = OTHER.with_operators("theta_h", [operator]).curve("theta_h")(GAMMA)
    assert np.isfinite(values).all() and (values >= 0.0).all()
