"""A second Fresnel term: what it adds, that it shares all but its share of the light, and that it comes and goes."""

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetFresnelTerm, SetModel, SetParameter
from app.document.described import document_from_description
from app.document.document import Document
from app.document.view_state import ViewState
from app.editor.editor import Editor
from app.files.session import load_session, save_session
from app.files.session_fitting import fit_session
from app.modes.placement.placement_messages import ComputeTransport
from app.project.assignments import set_path
from engine.core.errors import InsituError, LoadError
from engine.curve.operators import Operator
from engine.material import MODELS
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE, FakeClient

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)
R = (0.6, 0.3, 0.1)
COAT = {"model": "ward", "name": "coat", "alpha": 0.3, "scale": 1.0}
RIM = {"model": "fresnel", "name": "rim", "follows": "coat", "fresnel": list(R)}


def opened(*layers: dict[str, Any]) -> Document:
    described = deepcopy(SCENE)
    described["object"][0]["layer"] = [{"model": "lambert", "name": "base"}, *layers]
    return document_from_description("shelf", parse_description(described, "shelf"))


@pytest.fixture
def two() -> Document:
    return opened(COAT, RIM)


def mirrored(document: Document, *keys: str) -> np.ndarray:
    """The sum of some layers' BRDFs for light and eye that mirror each other, head-on to grazing, (N, 3)."""
    theta = np.linspace(0.0, 1.55, 9)
    wi = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=1)
    return np.sum([document.layer(key).brdf(wi, wi * [-1, 1, 1]) for key in keys], axis=0)


def test_two_layers_are_one_coloured_factor(two: Document) -> None:
    plain = opened(COAT).layer("pot.coat")
    assert two.layer("pot.coat").scale() == pytest.approx(R)
    assert two.layer("pot.rim").scale() == pytest.approx(1 - np.array(R))
    cosine = np.cos(np.linspace(0.0, 1.55, 9))[:, None]
    fresnel = np.array(R) + (1 - np.array(R)) * (1 - cosine) ** 5
    theta = np.arccos(cosine[:, 0])
    wi = np.stack([np.sin(theta), 0 * theta, np.cos(theta)], axis=1)
    assert mirrored(two, "pot.coat", "pot.rim") == pytest.approx(plain.brdf(wi, wi * [-1, 1, 1]) * fresnel, rel=1e-9)


@pytest.mark.parametrize("edited", ["pot.coat", "pot.rim"])
def test_everything_is_edited_once(two: Document, edited: str) -> None:
    # Curves, parameters of curves, of the scale and of the quotient, R and the model: in whichever it is edited.
    changed = SetOperators(edited, "theta_h", (LIFT,)).apply(two)
    for name, value in (("alpha", 0.5), ("scale", 0.7), ("reflectance", 0.9), ("fresnel", 0.25)):
        changed = SetParameter(edited, name, value).apply(changed)
    coat, rim = changed.layer("pot.coat"), changed.layer("pot.rim")
    assert coat.parameters == rim.parameters and coat.edits == rim.edits == (("theta_h", (LIFT,)),)
    assert coat.values["fresnel"] == (0.25, 0.25, 0.25) and coat.values["reflectance"] == 0.9
    assert (coat.rises, rim.rises, rim.follows, rim.name) == (False, True, "coat", "rim")
    phong = SetModel(edited, "phong").apply(changed)
    assert {layer.model.name for layer in (phong.layer("pot.coat"), phong.layer("pot.rim"))} == {"phong"}
    assert phong.layer("pot.rim").values["fresnel"] == (0.25, 0.25, 0.25)


@pytest.mark.parametrize("model", MODELS)
def test_any_layer_gets_one_and_loses_it(model: str) -> None:
    # Head-on nothing changes but by what rises; taken away, the layer is the one it was.
    before = opened({"model": model, "name": "coat"})
    after = SetFresnelTerm("pot.coat", True).apply(before)
    assert after.layer("pot.2").rises and after.layer("pot.2").name == "fresnel"
    strong = [p for p in before.layer("pot.coat").model.parameters if p.drives == ("scale",)]
    if strong:
        assert mirrored(after, "pot.coat") == pytest.approx(mirrored(before, "pot.coat"), rel=1e-9)
        assert mirrored(after, "pot.2")[0] == pytest.approx(0.0, abs=1e-12 * mirrored(before, "pot.coat").max())
        assert SetFresnelTerm("pot.2", False).apply(after) == before
    assert SetFresnelTerm("pot.coat", True).apply(after) == after


def test_it_is_a_switch_by_path(two: Document) -> None:
    assert len(set_path(two, "pot.coat.fresnel_term", False).apply(two).object("pot").layers) == 2
    assert set_path(two, "pot.rim.fresnel", 0.5).apply(two).layer("pot.coat").values["fresnel"] == (0.5, 0.5, 0.5)
    with pytest.raises(InsituError, match="there is no curve or parameter of pot.0 'fresnel'"):
        set_path(two, "pot.base.fresnel", 0.5)


def test_a_layer_that_follows_leaves_it_to_the_one_it_follows() -> None:
    document = opened(COAT, {"model": "ward", "name": "veil", "follows": "coat"})
    with pytest.raises(InsituError, match="veil follows coat"):
        SetFresnelTerm("pot.veil", True).apply(document)
    three = SetFresnelTerm("pot.coat", True).apply(document)
    edited = SetOperators("pot.veil", "theta_h", (LIFT,)).apply(three)
    assert [layer.edits for layer in edited.object("pot").layers[1:]] == [(("theta_h", (LIFT,)),)] * 3
    assert edited.layer("pot.veil").fresnel is None


@pytest.mark.parametrize(
    ("layers", "words"),
    [
        ([{**RIM, "follows": "base"}, {**RIM, "follows": "base", "name": "two"}], "follows = base, expected a layer"),
        ([{"model": "fresnel"}], "follows = nothing, expected base"),
        ([COAT, {**RIM, "alpha": 0.2}], "alpha = 0.2, expected only fresnel"),
        ([COAT, {**RIM, "fresnel": 1.2}], "fresnel = 1.2, expected"),
        ([COAT, RIM, {**RIM, "follows": "rim", "name": "two"}], "follows = rim, expected base or coat"),
    ],
)
def test_what_is_wrong_is_said(layers: list[dict[str, Any]], words: str) -> None:
    with pytest.raises(LoadError, match=words):
        opened(*layers)


def test_a_session_has_it_whatever_the_scene_has(two: Document, tmp_path: Path) -> None:
    edited = SetOperators("pot.rim", "theta_h", (LIFT,)).apply(SetParameter("pot.rim", "fresnel", 0.4).apply(two))
    session = load_session(save_session(tmp_path / "mine", edited, ViewState()))
    assert session.document == edited
    assert fit_session(session, opened(COAT), "mine") == edited


def test_the_editor_computes_it_and_forgets_it(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    client.open_scene()
    editor.tick(0.0)
    client.finish_stage("final", exact=True)
    editor.tick(1.0)
    assert editor.do(SetFresnelTerm("pot.1", True)) is None
    editor.tick(2.0)
    editor.tick(2.3)
    asked = client.sent(ComputeTransport)[-1].scene.layers
    assert [work.key for work in asked] == ["pot.0", "pot.1", "pot.2", "floor.0"]
    assert [work.quotient_parameters[7] for work in asked] == [0.0, 0.0, 1.0, 0.0]
    client.finish_stage("final", exact=True)
    editor.tick(3.0)
    assert editor.select("pot") is None and editor.view.selected is not None and editor.view.selected.layer == 1
    editor.select("pot.2")
    editor.undo()
    editor.tick(3.1)  # the worker still has it, the document has not
    assert editor.view.selected.layer == 1
    editor.tick(3.4)
    assert [work.key for work in client.sent(ComputeTransport)[-1].scene.layers] == ["pot.0", "pot.1", "floor.0"]
