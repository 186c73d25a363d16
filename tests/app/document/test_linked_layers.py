"""Layers that share their curves: whichever is edited, the others follow, and nothing else of them changes."""

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetFrozen, SetModel, SetParameter, SetVisible
from app.document.described import document_from_description
from app.document.document import Document
from app.document.view_state import ViewState
from app.files.session import load_session, save_session
from engine.core.errors import InsituError, LoadError
from engine.curve.operators import Operator
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)
R = np.array([0.6, 0.3, 0.1])
COAT = {"model": "ashikhmin_shirley", "name": "coat", "n_u": 7.0, "reflectance": 1.0, "scale": R.tolist()}
RIM = {"model": "ashikhmin_shirley", "name": "rim", "follows": "coat", "reflectance": 0.0, "scale": (1 - R).tolist()}


def scene(*layers: dict[str, Any]) -> dict[str, Any]:
    described = deepcopy(SCENE)
    described["object"][0]["layer"] = [{"model": "lambert", "name": "base"}, *layers]
    return described


def opened(*layers: dict[str, Any]) -> Document:
    return document_from_description("shelf", parse_description(scene(*layers), "shelf"))


@pytest.fixture
def two() -> Document:
    return opened(COAT, RIM)


def test_who_follows_has_the_curves_of_the_one_it_follows(two: Document) -> None:
    # n_u drives a curve and comes from the coat; reflectance and scale are the rim's own.
    assert two.layer("pot.rim").values["n_u"] == 7.0
    assert two.layer("pot.rim").values["reflectance"] == 0.0
    assert two.layer("pot.rim").values["scale"] == pytest.approx(1 - R)


@pytest.mark.parametrize(("edited", "other"), [("pot.coat", "pot.rim"), ("pot.rim", "pot.coat")])
def test_either_is_edited_and_both_follow(two: Document, edited: str, other: str) -> None:
    found = SetParameter(edited, "n_v", 33.0).apply(SetOperators(edited, "gamma_beta", (LIFT,)).apply(two))
    assert found.layer(other).operators("gamma_beta") == (LIFT,)
    assert found.layer(other).values["n_v"] == 33.0
    assert SetParameter(edited, "reflectance", 0.5).apply(two).layer(other) == two.layer(other)
    assert SetVisible(edited, False).apply(two).layer(other) == two.layer(other)
    assert two.layer("pot.base") == found.layer("pot.base")
    # Undo is the document before: taking the operators away again gives it back.
    assert SetOperators(edited, "gamma_beta", ()).apply(SetParameter(edited, "n_v", 200.0).apply(found)) == two


def test_two_terms_are_the_coloured_fresnel_term(two: Document) -> None:
    # Eq. 3.12: R + (1 - R)(1 - cos)^5 times the highlight, per channel, also after an edit of the exponents.
    edited = SetParameter("pot.rim", "n_u", 90.0).apply(two)
    coat, rim = edited.layer("pot.coat"), edited.layer("pot.rim")
    directions = np.random.default_rng(1).normal(size=(2, 200, 3))
    directions[..., 2] = np.abs(directions[..., 2])
    wi, wo = directions / np.linalg.norm(directions, axis=2, keepdims=True)
    found = coat.brdf(wi, wo) + rim.brdf(wi, wo)
    for channel in range(3):
        one = coat.with_parameter("reflectance", R[channel]).with_parameter("scale", 1.0)
        expected = one.brdf(wi, wo)[:, channel]
        np.testing.assert_allclose(found[:, channel], expected, rtol=1e-12)


def test_what_is_frozen_keeps_its_curves(two: Document) -> None:
    frozen = SetFrozen("pot.rim", True).apply(two)
    with pytest.raises(InsituError, match="frozen"):
        SetParameter("pot.coat", "n_u", 9.0).apply(frozen)


def test_curves_that_only_one_model_has_stay_its_own(two: Document) -> None:
    # The ratio has no curve of the coat's; back with a model that has, the rim takes them from there.
    ratio = SetOperators("pot.coat", "gamma_beta", (LIFT,)).apply(
        SetModel("pot.rim", "ashikhmin_shirley_ratio").apply(two)
    )
    assert ratio.layer("pot.rim").edits == () and ratio.layer("pot.coat").operators("gamma_beta") == (LIFT,)
    back = SetModel("pot.rim", "ashikhmin_shirley").apply(ratio)
    assert back.layer("pot.rim").operators("gamma_beta") == (LIFT,) and back.layer("pot.rim").values["n_u"] == 7.0
    assert back.layer("pot.coat") == ratio.layer("pot.coat")


def test_a_new_name_is_followed() -> None:
    # A layer that is called like its model is called like the next one.
    document = opened({**COAT, "name": "ashikhmin_shirley"}, {**RIM, "follows": "ashikhmin_shirley"})
    phong = SetModel("pot.1", "phong").apply(document)
    assert phong.layer("pot.1").name == "phong" == phong.layer("pot.2").follows


@pytest.mark.parametrize("follows", ["rim", "nothing", "tail"])
def test_only_a_layer_that_follows_no_other_is_followed(follows: str) -> None:
    with pytest.raises(LoadError, match=r"pot\.2\.follows = .*base or coat"):
        opened(COAT, {**RIM, "follows": follows}, {**RIM, "name": "tail"})


def test_links_are_written_with_the_session(two: Document, tmp_path: Path) -> None:
    edited = SetOperators("pot.coat", "gamma_alpha", (LIFT,)).apply(two)
    assert load_session(save_session(tmp_path / "mine", edited, ViewState())).document == edited
