"""What a person reads: names from the field, and none that only the program knows."""

from __future__ import annotations

import re

import pytest

from app.document.commands.curves import AddOperator, CollapseOperators, MoveOperator, ResetCurve, SetOperators
from app.document.commands.layers import (
    AddLayers,
    RemoveLayer,
    SetFresnelTerm,
    SetFrozen,
    SetModel,
    SetParameter,
    SetVisible,
    new_layer,
)
from app.document.commands.light import SetEmission
from app.document.described import document_from_description
from app.document.display_names import with_display_names
from app.document.document import Document, all_factors
from engine.curve.operators import Operator
from engine.material import MODELS
from engine.scene.description import SceneDescription
from tests.ui.stand_in import SCENE

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=0.5)
COAT, CURVE = "teapot.1", ("teapot.1", "theta_h")
INTERNAL = re.compile(r"\b[a-z]+_[a-z_]+\b|\blambert\b|[a-z]\.\d")


@pytest.fixture
def document() -> Document:
    """The stand-in scene, with a layer on the tray that nobody named."""
    document = document_from_description("stand-in", SceneDescription.model_validate(SCENE))
    return AddLayers("tray", (new_layer("lambert"),)).apply(document)


def test_layers_without_a_name_are_called_what_they_are(document: Document) -> None:
    assert [layer.title for layer in document.object("tray").layers] == ["Rough metal", "Diffuse"]
    twice = AddLayers("tray", (new_layer("lambert"),)).apply(document)
    assert twice.object("tray").layers[-1].title == "Diffuse 2"
    assert document.layer("teapot.1").title == "coat"
    risen = SetFresnelTerm("tray.0", True).apply(document)
    assert risen.object("tray").layers[-1].title == "Fresnel term"
    for model in MODELS.values():
        assert new_layer(model.name).title == model.label


@pytest.mark.parametrize("model", MODELS.values(), ids=lambda model: model.name)
def test_hints_speak_the_fields_language(model: object) -> None:
    texts = [model.label, model.tooltip]  # type: ignore[attr-defined]
    texts += [text for each in model.parameters for text in (each.label, each.tooltip)]  # type: ignore[attr-defined]
    texts += [factor.tooltip for factor in all_factors(model)]  # type: ignore[arg-type]
    assert not [text for text in texts if INTERNAL.search(text) or "ggx" in text or "beckmann" in text]
    assert not any(text[:1].islower() for text in texts)


@pytest.mark.parametrize(
    "command",
    [
        SetParameter(COAT, "alpha", 0.3),
        SetModel("tray.1", "phong"),
        SetOperators(*CURVE, (LIFT,)),
        AddOperator(*CURVE, LIFT),
        MoveOperator(*CURVE, 0, 1),
        CollapseOperators(*CURVE),
        ResetCurve(*CURVE),
        SetVisible(COAT, False),
        SetFrozen("tray.1", True),
        SetFresnelTerm("tray.1", True),
        SetEmission("lamp", 1.0),
        RemoveLayer("tray.1"),
        AddLayers("tray", (new_layer("lambert"),)),
    ],
    ids=lambda command: type(command).__name__,
)
def test_what_is_undone_is_said_in_words(document: Document, command: object) -> None:
    label = with_display_names(document, command.label)  # type: ignore[attr-defined]
    assert not INTERNAL.search(label), label
