"""Documents are values, and paths name what is in them."""

import pickle
from pathlib import Path
from typing import Any

import pytest

from app.document.described import document_from_description
from app.document.document import Document, Selection
from app.document.targets import resolve
from engine.core.errors import InsituError, LoadError
from engine.scene.description import SceneDescription, load_description, parse_description
from tests.app.fake_worker import SCENE


def test_a_description_becomes_a_document(document: Document) -> None:
    assert [key for key, _ in document.layers()] == ["pot.0", "pot.1", "floor.0"]
    assert document.layer("pot.1").values["alpha"] == 0.15
    assert document.layer("floor.0").values["albedo"] == (0.3, 0.3, 0.3)
    assert document.light.rotation == 30.0 and document.light.environment == "scene"
    assert [state.emits for state in document.objects] == [False, False, True]


@pytest.mark.parametrize(
    ("path", "kind", "key", "name"),
    [
        ("pot", "object", None, None),
        ("pot.0", "layer", "pot.0", None),
        ("pot.base", "layer", "pot.0", None),  # by its name
        ("pot.rough_conductor.theta_d", "factor", "pot.1", "theta_d"),  # unnamed layers are called like their model
        ("pot.0.theta_o", "factor", "pot.0", "theta_o"),
        ("pot.1.alpha", "parameter", "pot.1", "alpha"),
        ("pot.frozen", "switch", None, "frozen"),
        ("pot.1.visible", "switch", "pot.1", "visible"),
        ("light.rotation", "light", None, "rotation"),
    ],
)
def test_paths(document: Document, path: str, kind: str, key: str | None, name: str | None) -> None:
    target = resolve(document, path)
    assert (target.kind, target.key, target.name) == (kind, key, name)


@pytest.mark.parametrize(
    ("path", "says"),
    [
        ("pott", "did you mean 'pot'"),
        ("pot.7", "0 (base), 1 (rough_conductor)"),
        ("pot.-1", "no layer"),
        ("pot.²", "no layer"),
        ("pot.1.alhpa", "did you mean 'alpha'"),
        ("pot.0.theta_h", "theta_i, theta_o, albedo"),
        ("lamp.0", "available: none"),
        ("light.colour", "rotation, intensity, environment, mapping"),
        ("", "no object ''"),
    ],
)
def test_unknown_paths_say_what_there_is(document: Document, path: str, says: str) -> None:
    with pytest.raises(InsituError) as caught:
        resolve(document, path)
    assert says in str(caught.value)


def test_an_object_may_be_called_light(description: SceneDescription) -> None:
    scene = {**SCENE, "object": [{"name": "light", "primitive": "quad", "layer": [{"model": "lambert"}]}]}
    document = document_from_description("x", parse_description(scene, "x"))
    assert resolve(document, "light.0.albedo").kind == "parameter"
    assert resolve(document, "light.rotation").kind == "light"


def test_replacing_a_layer_shares_all_else(document: Document) -> None:
    changed = document.with_layer("pot.1", document.layer("pot.1").with_parameter("alpha", 0.3))
    assert changed != document and changed.layer("pot.1").values["alpha"] == 0.3
    assert changed.objects[1] is document.objects[1] and changed.layer("pot.0") is document.layer("pot.0")
    assert document.layer("pot.1").values["alpha"] == 0.15


def test_documents_are_hashable_and_survive_pickling(document: Document) -> None:
    copy = pickle.loads(pickle.dumps(document))
    assert copy == document and hash(copy) == hash(document)


def test_frozen_and_hidden_objects_hold_for_their_layers(document: Document) -> None:
    from dataclasses import replace

    changed = document.with_object(replace(document.object("pot"), frozen=True, visible=False))
    assert changed.is_frozen("pot.1") and not changed.is_visible("pot.1")
    assert not changed.is_frozen("floor.0") and changed.is_visible("floor.0")


def test_selection_names_its_path() -> None:
    assert Selection("pot", 1, "theta_h").path == "pot.1.theta_h"
    assert Selection("pot", 1).key == "pot.1"


@pytest.mark.parametrize(
    ("layer", "says"),
    [({"model": "plastic"}, "pot.0.model = plastic"), ({"model": "lambert", "alpha": 1}, "pot.0: lambert.alpha = 1")],
)
def test_bad_layers_are_named(layer: dict[str, Any], says: str) -> None:
    scene = {**SCENE, "object": [{"name": "pot", "primitive": "quad", "layer": [layer]}]}
    with pytest.raises(LoadError) as caught:
        document_from_description("s.toml", parse_description(scene, "s.toml"))
    assert says in str(caught.value) and str(caught.value).startswith("s.toml: ")


@pytest.mark.parametrize("name", ["teatray", "bunny", "cornell"])
def test_reference_scenes_become_documents(shared_reference: Path, name: str) -> None:
    path = shared_reference / f"{name}.toml"
    document = document_from_description(str(path), load_description(path))
    assert all(document.layer(key) is layer for key, layer in document.layers())
