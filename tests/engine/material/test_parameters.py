"""Parameter tables: which values are accepted, in which form, and the text of an error."""

import math
import pickle

import numpy as np
import pytest

from engine.core.errors import LoadError
from engine.material import MODELS, ParameterError, make_layer, validate_parameters
from engine.material.parameters import index_of_reflectance, reflectance_of_index
from tests.naive.measured import drawn_measurement

ROUGH = MODELS["rough_conductor"]
EVERY_PARAMETER = [(model, parameter) for model in MODELS.values() for parameter in model.parameters]
PARTS = {"A", "B", "o", "scale", "quotient"}


@pytest.mark.parametrize(("model", "parameter"), EVERY_PARAMETER, ids=lambda v: getattr(v, "name", ""))
def test_tables_are_complete(model, parameter):
    # A slider needs a default inside its range, words, and to know what it changes.
    assert parameter.accept(parameter.default) == parameter.default
    assert parameter.label and parameter.tooltip.endswith(".") and parameter.expected
    assert parameter.drives and set(parameter.drives) <= PARTS
    assert parameter.minimum < parameter.maximum
    assert (parameter.kind == "file") <= model.needs_file
    assert len({p.name for p in model.parameters}) == len(model.parameters)


@pytest.mark.parametrize(("model", "parameter"), EVERY_PARAMETER, ids=lambda v: getattr(v, "name", ""))
def test_drives_tells_the_truth(model, parameter):
    # A parameter changes exactly the parts it says it drives.
    defaults = model.defaults()
    if parameter.kind == "file":
        other = drawn_measurement()
    else:
        defaults |= {"file": drawn_measurement()} if model.needs_file else {}
        other = parameter.choices[-1] if parameter.kind == "choice" else parameter.accept(0.9 * parameter.maximum)
    moved = {**defaults, parameter.name: other}
    gamma = np.linspace(0.0, 1.5, 7)
    curves = list(zip("AB", model.factors, strict=False)) + ([("o", model.view_factor)] if model.view_factor else [])
    changed = {
        part
        for part, factor in curves
        if not np.array_equal(model.generate(factor.name, defaults, gamma), model.generate(factor.name, moved, gamma))
    }
    if not np.array_equal(model.scale(defaults), model.scale(moved)):
        changed.add("scale")
    if not np.array_equal(model.quotient_parameters(defaults), model.quotient_parameters(moved)):
        changed.add("quotient")
    assert changed == set(parameter.drives)


def test_reference_layers_are_accepted(shared_reference):
    # Layer parameters are named as in the reference scenes.
    import tomllib

    for path in shared_reference.glob("*.toml"):
        for thing in tomllib.loads(path.read_text())["object"]:
            for layer in thing.get("layer", []):
                given = {key: value for key, value in layer.items() if key not in ("model", "name")}
                values = validate_parameters(MODELS[layer["model"]], given, str(path))
                assert {
                    key: list(v) if isinstance(v, tuple) else v for key, v in values.items() if key in given
                } == given


def test_defaults_fill_in_and_numbers_become_plain():
    values = validate_parameters(ROUGH, {"alpha": 1, "eta": 1.5, "k": np.array([1, 2, 3])}, "x.toml")
    assert list(values) == ["distribution", "alpha", "eta", "k", "scale"]
    assert values["alpha"] == 1.0 and type(values["alpha"]) is float
    assert values["eta"] == (1.5, 1.5, 1.5) and values["k"] == (1.0, 2.0, 3.0)
    assert values["distribution"] == "ggx"


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("alpha", 0.0, "a number from 0.0001 to 1"),
        ("alpha", math.nan, "a number from 0.0001 to 1"),
        ("alpha", "0.2", "a number from 0.0001 to 1"),
        ("alpha", True, "a number from 0.0001 to 1"),
        ("alpha", [0.2, 0.2, 0.2], "a number from 0.0001 to 1"),
        ("eta", [1.0, 2.0], "a number or three from 0.01 to 20"),
        ("eta", [1.0, math.inf, 1.0], "a number or three from 0.01 to 20"),
        ("eta", [], "a number or three from 0.01 to 20"),
        ("k", None, "a number or three from 0 to 20"),
        ("distribution", "phong", '"ggx" or "beckmann"'),
        ("distribution", ["ggx"], '"ggx" or "beckmann"'),
        ("albedo", 0.5, "only distribution, alpha, eta, k, scale in a rough_conductor layer"),
    ],
)
def test_refusals_name_key_value_and_range(key, value, expected):
    with pytest.raises(LoadError) as caught:
        validate_parameters(ROUGH, {key: value}, "scene.toml")
    assert str(caught.value).startswith(f"scene.toml: rough_conductor.{key} = ")
    assert str(caught.value).endswith(f"expected {expected}; nothing was changed")


def test_unknown_names_are_named():
    with pytest.raises(ParameterError, match="parameter of lambert = 'alpha', expected one of albedo"):
        make_layer(MODELS["lambert"]).with_parameter("alpha", 0.5)
    with pytest.raises(ParameterError, match="curve of lambert = 'theta_h', expected one of theta_i, theta_o"):
        MODELS["lambert"].factor("theta_h")


def test_errors_and_models_survive_pickling():
    error = ParameterError("alpha", 0.0, "more")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
    assert all(pickle.loads(pickle.dumps(model)) is model for model in MODELS.values())


@pytest.mark.parametrize(
    ("n", "reflectance"), [(1.0, 0.0), (1.5, 0.04), (3.0, 0.25), ((1.5, 3.0, 9.0), (0.04, 0.25, 0.64))]
)
def test_an_index_of_refraction_is_a_facing_reflectance(n, reflectance):
    # R = ((n - 1) / (n + 1))^2 [BenArtzi07, eq. 3.10].
    assert reflectance_of_index(n) == pytest.approx(reflectance, abs=1e-15)
    assert index_of_reflectance(reflectance) == pytest.approx(n)


def test_the_index_of_a_mirror_is_the_largest():
    assert index_of_reflectance(1.0) == index_of_reflectance(1.0 - 1e-12) == 1000.0
    assert index_of_reflectance((0.0, 1.0, 0.04)) == pytest.approx((1.0, 1000.0, 1.5))
