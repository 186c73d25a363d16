"""What the worker is told of a document: enough for either side to find the same curves."""

import pickle
from dataclasses import replace

import numpy as np

from app.document.commands.light import SetIntensity
from app.document.described import document_from_description
from app.document.document import Document
from app.document.scene_state import layer_state, scene_state
from app.modes.placement.curves import Curves
from engine.material.layer_maps import MapMeans
from engine.material.map_tables import maps_from
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE


def shelf() -> Document:
    return document_from_description("shelf", parse_description(SCENE, "shelf"))


def test_it_has_what_reflects_and_what_shines() -> None:
    document = SetIntensity(3.0).apply(shelf())
    pot = replace(document.object("pot"), visible=False)
    scene = scene_state(document.with_object(pot))
    assert [layer.key for layer in scene.layers] == ["pot.0", "pot.1", "floor.0"]
    assert [layer.key for layer in scene.visible] == ["floor.0"]
    assert [name for name, _ in scene.emission] == [state.name for state in document.objects if state.emits]
    assert scene.light.intensity == 1.0  # it multiplies the finished picture


def test_the_worker_finds_the_curves_of_the_window() -> None:
    document, curves = shelf(), Curves()
    sent = pickle.loads(pickle.dumps(curves.scene_state(document)))
    for layer in sent.layers:
        mine = curves.coefficients(document, layer.key)
        assert layer.factors == tuple(mine)
        for one, two in zip(layer.coefficients, mine.values(), strict=True):
            np.testing.assert_array_equal(one, two)


def test_images_count_by_their_means_once_those_are_known() -> None:
    document = shelf()
    layer = document.layer("pot.0").replace(maps=maps_from({"texture": "oak.png", "texture_strength": 0.5}))
    document = document.with_layer("pot.0", layer)
    means = MapMeans(texture=(0.5, 0.25, 1.0), both=(0.5, 0.25, 1.0))
    np.testing.assert_allclose(layer_state(document, "pot.0").mean_factor, 1.0)
    np.testing.assert_allclose(layer_state(document, "pot.0", means=means).mean_factor, [0.75, 0.625, 1.0])
