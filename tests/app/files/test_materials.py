"""Materials as files, on the clipboard, in the library, and as edits of an object."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.commands.layers import (
    AddLayers,
    RemoveLayer,
    SetFresnelTerm,
    SetMaterial,
    SetParameter,
    new_layer,
    operators_of_copy,
)
from app.document.document import Document, ObjectState
from app.document.linked_layers import with_fresnel
from app.files.materials import (
    Library,
    Material,
    categories,
    dump_material,
    load_material,
    parse_material,
    save_material,
)
from app.project.assignments import set_path
from engine.core.errors import InsituError, LoadError
from engine.curve.operators import Operator, TabulatedCurve
from engine.material import MODELS, make_layer
from engine.precompute.indirect.albedo import equivalent_albedo

BUMP = Operator("amplify", "y", 0.1, 0.2, 0.4, 0.6, 0.5)
ANGLES = np.linspace(0.0, 1.5, 40)


@pytest.fixture
def document() -> Document:
    base = make_layer(MODELS["lambert"], {"albedo": 0.3}, "base")
    coat = make_layer(MODELS["rough_conductor"], {"alpha": 0.1}, "coat").with_operators("theta_h", [BUMP])
    return Document("shelf", (ObjectState("pot", (base, coat)), ObjectState("lamp", (base,), (1.0, 1.0, 1.0))))


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    library = Library(tmp_path_factory.mktemp("own"))
    library.read_all()
    return library


def test_a_material_reads_back_equal(document: Document, tmp_path: Path) -> None:
    layers = with_fresnel(document.object("pot").layers, 1)
    layers = (layers[0].replace(visible=False), *layers[1:])
    material = Material('Gold, "worn"', layers, "Metals")
    assert parse_material(dump_material(material), "clipboard") == material
    save_material(tmp_path / "gold.toml", material)
    assert load_material(tmp_path / "gold.toml") == material


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("hello", "clipboard: text = .*a material that was copied"),
        ('version = 2\nname = "x"', "made by a newer version"),
        ('version = 1\nname = "x"\nlayer = []', "layer"),
        ('version = 1\nname = "x"\nlayer = [{ model = "chalk" }]', "x.0.model = .*chalk"),
        ('version = 1\nname = "x"\nhidden = [1]\nlayer = [{ model = "lambert" }]', "layer = 1, expected 0 to 0"),
        ('version = 1\nname = "x"\npart = "theta_h"\nlayer = [{ model = "lambert" }]', "part = .*a curve of lambert"),
        ('version = 1\nname = "x"\nlayer = [{ model = "lambert", albedo = nan }]', "albedo"),
    ],
)  # fmt: skip
def test_what_is_no_material_is_refused_in_one_line(text: str, complaint: str) -> None:
    with pytest.raises(LoadError, match=complaint) as error:
        parse_material(text, "clipboard")
    assert "\n" not in str(error.value)


def test_an_object_gets_another_material_in_one_step(document: Document, library: Library) -> None:
    gold = library.entry("Gold").material
    changed = SetMaterial("pot", gold.layers, gold.name).apply(document)
    assert changed.object("pot").layers == gold.layers
    assert set_path(document, "pot.material", "Gold").apply(document) == changed
    shining = SetMaterial("lamp", gold.layers).apply(document).object("lamp")
    assert shining.layers == gold.layers and shining.emission == document.object("lamp").emission
    bare = document.with_object(replace(document.object("lamp"), layers=()))
    with pytest.raises(InsituError, match="lamp is an emitter"):
        SetMaterial("lamp", gold.layers).apply(bare)
    frozen = document.with_object(replace(document.object("pot"), frozen=True))
    with pytest.raises(InsituError, match="frozen"):
        SetMaterial("pot", gold.layers).apply(frozen)
    with pytest.raises(InsituError, match="no material 'Unobtainium'"):
        set_path(document, "pot.material", "Unobtainium")


def test_added_layers_keep_names_apart(document: Document) -> None:
    added = AddLayers("pot", (new_layer("phong"), document.layer("pot.coat"))).apply(document)
    assert [layer.name for layer in added.object("pot").layers] == ["base", "coat", "phong", "coat 2"]
    assert added.layer("pot.coat 2").edits == document.layer("pot.coat").edits
    with pytest.raises(InsituError, match="can have 64"):
        AddLayers("pot", (new_layer("phong"),) * 63).apply(document)


def test_a_removed_layer_takes_its_fresnel_term_along(document: Document) -> None:
    two = SetFresnelTerm("pot.coat", True).apply(document)
    assert [layer.name for layer in RemoveLayer("pot.coat").apply(two).object("pot").layers] == ["base"]
    without = RemoveLayer("pot.fresnel").apply(two)
    assert [layer.fresnel for layer in without.object("pot").layers] == [None, None]
    with pytest.raises(InsituError, match="only layer"):
        RemoveLayer("pot.base").apply(RemoveLayer("pot.coat").apply(document))


def test_who_followed_a_removed_layer_keeps_its_curves(document: Document) -> None:
    coat = document.layer("pot.coat")
    follower = coat.replace(name="second", follows="coat")
    third = coat.replace(name="third", follows="coat")
    shared = document.with_object(replace(document.object("pot"), layers=(coat, follower, third)))
    left = RemoveLayer("pot.coat").apply(shared)
    assert [(layer.name, layer.follows) for layer in left.object("pot").layers] == [("second", ""), ("third", "second")]
    assert left.layer("pot.second").edits == coat.edits
    moved = SetParameter("pot.second", "alpha", 0.3).apply(left)
    assert moved.layer("pot.third").values["alpha"] == 0.3


def test_a_copied_curve_equals_its_source(document: Document) -> None:
    coat = document.layer("pot.coat")
    same = make_layer(MODELS["rough_conductor"], {"alpha": 0.1})
    assert operators_of_copy(coat, "theta_h", same, "theta_h") == (BUMP,)
    other = make_layer(MODELS["phong"])
    (table,) = operators_of_copy(coat, "theta_h", other, "theta_r")
    assert isinstance(table, TabulatedCurve)
    copied = other.with_operators("theta_r", [table]).curve("theta_r")(ANGLES)
    np.testing.assert_allclose(copied, coat.curve("theta_h")(ANGLES), rtol=2e-4, atol=1e-4)


def test_built_in_materials_are_whole_and_reflect_no_more_than_they_receive(library: Library) -> None:
    builtin = [entry for entry in library.entries if not entry.is_own]
    assert len(builtin) >= 30 and {"Metals", "Cloth", "Plastics and paint"} <= set(categories(builtin))
    assert len({entry.name for entry in builtin}) == len(builtin)
    for entry in builtin:
        assert not entry.problem, entry.problem
        albedo = sum(equivalent_albedo(layer, (32,) * len(layer.model.factors)) for layer in entry.material.layers)
        assert np.all(albedo > 0.0) and np.all(albedo <= 1.0), (entry.name, albedo)


def test_own_materials_are_kept_found_and_deleted(document: Document, tmp_path: Path) -> None:
    library = Library(tmp_path)
    entry = library.save("My copper", document.object("pot").layers)
    assert library.save("My copper", document.object("pot").layers[:1]).path == entry.path
    (tmp_path / "broken.toml").write_text("version = 7")
    again = Library(tmp_path)
    again.read_all()
    own = {each.name: each for each in again.entries if each.is_own}
    assert own["My copper"].material.layers == document.object("pot").layers[:1]
    assert "newer version" in own["broken"].problem
    assert [each.name for each in again.entries if each.matches("copper my")] == ["My copper"]
    again.delete(entry.path)
    assert not entry.path.exists() and "My copper" not in [each.name for each in again.entries]
    with pytest.raises(InsituError, match="only your own"):
        again.delete(again.entries[0].path)
    with pytest.raises(InsituError, match="no name"):
        library.save("  ", document.object("pot").layers)
