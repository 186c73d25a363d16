"""Layers under a coat or a sheen: who lies under whom follows every edit of the layers, undo, files and copies."""

from pathlib import Path

import numpy as np
import pytest

from app.document.commands.layers import (
    AddLayers,
    RemoveLayer,
    SetFrame,
    SetFresnelTerm,
    SetModel,
    SetParameter,
    SetUnder,
    SetVisible,
    new_layer,
)
from app.document.document import Document
from app.document.view_state import ViewState
from app.files.materials import copy_layer, copy_material, load_material, save_material
from app.files.session import load_session, save_session
from app.project.assignments import set_path
from engine.core.errors import InsituError, LoadError
from tests.app.document.test_linked_layers import opened

GLOSS = {"model": "microfacet", "name": "gloss", "under": "fuzz"}
FUZZ = {"model": "sheen", "name": "fuzz", "under": "coat"}
COAT = {"model": "clearcoat", "name": "coat"}


@pytest.fixture
def stack() -> Document:
    return opened(GLOSS, FUZZ, COAT)


def covers(document: Document, key: str) -> list[str]:
    return [cover.name for cover in document.layer(key).covers]


def test_covers_are_all_layers_above_with_their_present_values(stack: Document) -> None:
    assert covers(stack, "pot.gloss") == ["fuzz", "coat"]
    assert covers(stack, "pot.fuzz") == ["coat"] and covers(stack, "pot.coat") == covers(stack, "pot.base") == []
    found = SetParameter("pot.coat", "scale", 0.25).apply(stack)
    assert found.layer("pot.gloss").covers[1].values["scale"] == 0.25
    # Head-on the coat takes 0.25 · 0.04.
    head_on = found.layer("pot.fuzz").view_curve(np.zeros(1))[0, 0]
    assert head_on == pytest.approx(0.99)
    assert SetParameter("pot.coat", "scale", 1.0).apply(found) == stack


def test_unchanged_layers_stay_the_same_objects(stack: Document) -> None:
    found = SetParameter("pot.gloss", "alpha", 0.5).apply(stack)
    assert all(found.layer(key) is stack.layer(key) for key in ("pot.base", "pot.fuzz", "pot.coat"))


def test_a_removed_cover_hands_on_what_lay_under_it(stack: Document) -> None:
    found = RemoveLayer("pot.fuzz").apply(stack)
    assert found.layer("pot.gloss").under == "coat" and covers(found, "pot.gloss") == ["coat"]
    assert covers(RemoveLayer("pot.coat").apply(found), "pot.gloss") == []
    assert covers(SetVisible("pot.coat", False).apply(stack), "pot.gloss") == ["fuzz", "coat"]  # it takes nothing then
    assert covers(SetModel("pot.coat", "phong").apply(stack), "pot.gloss") == ["fuzz"]


def test_an_added_coat_covers_what_lies_under_nothing(stack: Document) -> None:
    bare = opened({"model": "microfacet", "name": "gloss"})
    found = AddLayers("pot", (new_layer("clearcoat"),)).apply(bare)
    assert covers(found, "pot.base") == covers(found, "pot.gloss") == ["clearcoat"]
    assert covers(AddLayers("pot", (new_layer("phong"),)).apply(stack), "pot.base") == []
    # A second coat gets another name, and lies on the first: that lay under nothing.
    twice = AddLayers("pot", (new_layer("clearcoat"),)).apply(found)
    assert covers(twice, "pot.gloss") == ["clearcoat", "clearcoat 2"]


def test_only_a_cover_can_be_chosen_and_none_that_lies_beneath(stack: Document) -> None:
    assert covers(SetUnder("pot.gloss", "coat").apply(stack), "pot.gloss") == ["coat"]
    assert covers(SetUnder("pot.gloss", "").apply(stack), "pot.gloss") == []
    for key, cover in (("pot.coat", "fuzz"), ("pot.coat", "coat"), ("pot.fuzz", "gloss"), ("pot.gloss", "nothing")):
        with pytest.raises(InsituError, match="cannot lie under"):
            SetUnder(key, cover).apply(stack)
    assert covers(set_path(stack, "pot.base.under", "fuzz").apply(stack), "pot.base") == ["fuzz", "coat"]


def test_both_terms_of_a_layer_lie_under_its_cover(stack: Document, tmp_path: Path) -> None:
    """Else what rises at grazing angles would pass the coat undimmed, and a session would be another picture."""
    document = SetUnder("pot.base", "coat").apply(SetFresnelTerm("pot.base", True).apply(stack))
    assert document.layer("pot.fresnel").rises and covers(document, "pot.fresnel") == covers(document, "pot.base")
    assert covers(document, "pot.fresnel") == ["coat"]
    saved = save_session(tmp_path / "mine", document, ViewState())
    assert load_session(saved).document.object("pot").layers == document.object("pot").layers
    assert covers(SetUnder("pot.base", "").apply(document), "pot.fresnel") == []
    # A coat's own second term covers nothing: the first stands for both.
    varnished = SetFresnelTerm("pot.coat", True).apply(stack)
    with pytest.raises(InsituError, match="cannot lie under 'fresnel'; layers that can: fuzz, coat"):
        SetUnder("pot.base", "fresnel").apply(varnished)


def test_a_coat_with_a_fresnel_term_takes_as_much_head_on_as_before(stack: Document) -> None:
    weak = SetParameter("pot.coat", "scale", 0.25).apply(stack)
    head_on, grazing = np.zeros(1), np.full(1, 0.5 * np.pi)
    before, after = (each.layer("pot.coat") for each in (weak, SetFresnelTerm("pot.coat", True).apply(weak)))
    assert after.fresnel is not None and after.coverage(head_on) == pytest.approx(before.coverage(head_on))
    assert before.coverage(grazing) == pytest.approx(0.25) and after.coverage(grazing) == pytest.approx(1.0)


def test_a_fresnel_term_has_no_cover_of_its_own() -> None:
    with pytest.raises(LoadError, match="under = coat, expected only fresnel"):
        opened(GLOSS, FUZZ, COAT, {"model": "fresnel", "follows": "gloss", "under": "coat"})


@pytest.mark.parametrize(
    ("layers", "found"),
    [
        (({**GLOSS, "under": "varnish"}, FUZZ, COAT), "varnish"),
        (({**COAT, "under": "coat"},), "coat"),
        (({**FUZZ, "under": "coat"}, {**COAT, "under": "fuzz"}), "(coat|fuzz)"),
        (({**GLOSS, "under": "base"},), "base"),
    ],
)
def test_files_that_name_no_cover_are_refused(layers: tuple[dict[str, object], ...], found: str) -> None:
    with pytest.raises(LoadError, match=rf"under = {found}.*another layer of the model"):
        opened(*layers)


def test_sessions_and_materials_bring_it_back(stack: Document, tmp_path: Path) -> None:
    found = SetParameter("pot.coat", "scale", 0.25).apply(stack)
    saved = save_session(tmp_path / "mine", found, ViewState())
    assert load_session(saved).document.object("pot").layers == found.object("pot").layers
    save_material(tmp_path / "m.toml", copy_material(found, "pot"))
    assert load_material(tmp_path / "m.toml").layers == found.object("pot").layers
    (alone,) = copy_layer(found, "pot.gloss").layers
    assert alone.under == "" and alone.covers == ()


def test_a_layers_frame_is_set_undone_and_known_to_what_it_covers(stack: Document, tmp_path: Path) -> None:
    document = SetFrame("pot.coat", "coat").apply(stack)
    assert document.layer("pot.coat").frame == "coat"
    (cover,) = [each for each in document.layer("pot.gloss").covers if each.name == "coat"]
    assert cover.frame == "coat" and document.layer("pot.gloss").frame == "base"
    # A second Fresnel term is in the frame of the first.
    terms = SetFrame("pot.coat", "coat").apply(SetFresnelTerm("pot.coat", True).apply(stack))
    assert {each.frame for each in terms.object("pot").layers if each.name in ("coat", "fresnel")} == {"coat"}
    saved = save_session(tmp_path / "mine", terms, ViewState())
    assert load_session(saved).document.object("pot").layers == terms.object("pot").layers
    assert SetFrame("pot.coat", "base").apply(document) == stack
    with pytest.raises(InsituError, match="base, coat"):
        SetFrame("pot.coat", "lacquer").apply(stack)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", [1, 3, 4, 5, 8])
def test_random_edits_keep_covers_consistent(stack: Document, seed: int) -> None:
    """Whatever the order: each layer's covers are those that its names lead to, with equal values, and no cycle; names
    differ."""
    generator, document = np.random.default_rng(seed), stack
    for _ in range(300):
        layers = document.object("pot").layers
        key = f"pot.{generator.integers(len(layers))}"
        cover = layers[generator.integers(len(layers))].name
        edits = [
            SetUnder(key, cover), SetUnder(key, ""), RemoveLayer(key), SetParameter(key, "scale", 0.5),
            SetModel(key, str(generator.choice(["clearcoat", "sheen", "lambert"]))), SetVisible(key, False),
            AddLayers("pot", (new_layer(str(generator.choice(["clearcoat", "sheen", "phong"]))),)),
        ]  # fmt: skip
        command = edits[generator.integers(len(edits))]
        if len(layers) > 8 and isinstance(command, AddLayers):
            continue
        try:
            document = command.apply(document)
        except InsituError:
            continue
        layers = document.object("pot").layers
        assert len({layer.name for layer in layers}) == len(layers)
        by_name = {layer.name: layer for layer in layers if layer.model.is_cover}
        for layer in layers:
            names, above = [], layer.under
            while above in by_name:
                names.append(above)
                above = by_name[above].under
                assert len(names) <= len(layers), "a cycle"
            assert [each.name for each in layer.covers] == names
            assert all(each.parameters == by_name[each.name].parameters for each in layer.covers)
