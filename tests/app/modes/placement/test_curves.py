"""The curves a picture is made with: what is cached is what would be computed anew."""

from typing import Any

import numpy as np
import pytest

from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetModel, SetParameter
from app.document.document import Document, ObjectState, all_factors
from app.modes.placement.curves import N_VIEW_SAMPLES, Curves
from engine.curve.operators import Operator
from engine.material import MODELS, make_layer
from engine.material.model import Parameter
from engine.planner import MOST_BANDS, band_counts

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)


def another_value(parameter: Parameter) -> Any:
    """A value of the parameter that is not its default."""
    if parameter.kind == "choice":
        return next(choice for choice in parameter.choices if choice != parameter.default)
    middle = 0.5 * (parameter.minimum + min(parameter.maximum, 10.0))
    return middle if np.any(np.asarray(parameter.default) != middle) else 0.9 * middle


@pytest.mark.parametrize("name", sorted(MODELS))
def test_cached_curves_are_those_of_the_document(name: str) -> None:
    """After any parameter moves, and after an edit, the cache gives what a new cache would."""
    layer = make_layer(MODELS[name])
    document = Document("shelf", (ObjectState("pot", (layer,)),))
    curves = Curves()
    for parameter in (each for each in layer.model.parameters if each.kind != "file"):
        document = SetParameter("pot.0", parameter.name, another_value(parameter)).apply(document)
        compare(curves, document)
    for factor in all_factors(layer.model):
        document = SetOperators("pot.0", factor.name, (LIFT,)).apply(document)
        compare(curves, document)


def compare(curves: Curves, document: Document) -> None:
    layer = document.layer("pot.0")
    for name, values in curves.coefficients(document, "pot.0").items():
        assert np.array_equal(values, layer.coefficients(name, values.shape[0])), name
    assert np.array_equal(curves.view_curves(document, "pot.0"), Curves().view_curves(document, "pot.0"))
    assert np.array_equal(curves.gain(document, "pot.0"), layer.scale())


@pytest.mark.parametrize("name", sorted(MODELS))
def test_every_curve_has_a_band_count(name: str) -> None:
    layer = make_layer(MODELS[name])
    counts = band_counts(layer)
    assert list(counts) == [factor.name for factor in layer.model.factors]
    assert all(n & (n - 1) == 0 and 1 <= n <= MOST_BANDS for n in counts.values())
    assert max(band_counts(layer, most=8).values()) == 8


def test_a_model_without_view_factor_has_a_view_curve_of_one(document: Document) -> None:
    curve = Curves().view_curves(document, "pot.1")
    assert curve.shape == (2, N_VIEW_SAMPLES, 3) and np.all(curve == 1.0)


def test_the_cache_follows_a_change_of_model(document: Document) -> None:
    curves = Curves()
    curves.coefficients(document, "pot.1")
    changed = SetModel("pot.1", "cook_torrance").apply(document)
    values = curves.coefficients(changed, "pot.1")["theta_h"]
    assert np.array_equal(values, changed.layer("pot.1").coefficients("theta_h", len(values)))
