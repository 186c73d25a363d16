"""Maps of parameters in the document: commands, paths, sessions, and the document that pictures are made of."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.commands.curves import SetOperators
from app.document.commands.layers import SetFresnelTerm, SetModel, SetParameter, SetVisible
from app.document.commands.maps import SetParameterMap
from app.document.commands.plan import OverrideLine
from app.document.described import document_from_description
from app.document.document import Document
from app.document.history import History
from app.document.linked_layers import linked_indices
from app.document.named_files import files_of_document, with_full_names
from app.document.node_layers import (
    channel_images,
    layers_at_nodes,
    node_counts,
    nodes_reason,
    picked_node,
    with_node_layers,
)
from app.document.selection import is_layer_visible
from app.document.view_state import ViewState
from app.files.session import dump_session, parse_session
from app.files.session_fitting import fit_session
from app.interface.values import value_at
from app.project.assignments import set_path
from engine.core.errors import InsituError
from engine.curve.operators import Operator
from engine.material.parameter_maps import channel_statistics
from engine.scene.description import parse_description

METAL = {"model": "rough_conductor", "name": "metal", "alpha": 0.3}
MAPPED = {**METAL, "parameter_maps": {"alpha": {"map": "rough.png", "channel": "g", "range": [0.1, 0.6]}}}
RAMP = channel_statistics(np.linspace(0.0, 1.0, 1000))
LIFT = Operator("translate", "y", 0.1, 0.2, 0.5, 0.8, magnitude=0.4)


def opened(*layers: dict[str, Any]) -> Document:
    scene = {
        "version": 1, "camera": {"position": [0, 1, 4], "target": [0, 0, 0]},
        "object": [{"name": "ball", "primitive": "sphere", "layer": [{"model": "lambert", "name": "base"}, *layers]}],
    }  # fmt: skip
    return document_from_description("scene.toml", parse_description(scene, "scene.toml"))


def pictured(document: Document, n: int | None = None) -> Document:
    return with_node_layers(document, dict.fromkeys(channel_images(document), RAMP), n)


def test_a_document_without_maps_is_itself() -> None:
    document = opened(METAL)
    assert pictured(document) is document


def test_nodes_follow_the_layer_and_its_key_stays() -> None:
    document = opened(MAPPED, {"model": "phong", "name": "gloss"})
    found = pictured(document, 4)
    layers = found.object("ball").layers
    assert len(layers) == 6 and found.layer("ball.2") == document.layer("ball.2")
    assert linked_indices(layers, 1) == (1, 3, 4, 5) and layers[1].name == "metal"
    assert layers[1].values["alpha"] == pytest.approx(0.1, abs=0.01) and layers[5].values["alpha"] > 0.5
    assert {layer.node_of for layer in layers} == {"", "metal"} and not any(layer.parameter_maps for layer in layers)
    # While its image is unknown, the parameter has its own value.
    alone = with_node_layers(document, {})
    assert len(alone.object("ball").layers) == 3 and alone.layer("ball.1").values["alpha"] == 0.3


def test_edits_reach_all_nodes() -> None:
    document = opened(MAPPED)
    document = SetOperators("ball.metal", "theta_h", (LIFT,)).apply(document)
    document = SetParameter("ball.metal", "eta", 1.7).apply(document)
    document = SetVisible("ball.metal", False).apply(document)
    nodes = [layer for layer in pictured(document, 5).object("ball").layers if layer.node_of]
    assert len(nodes) == 5 and {layer.edits for layer in nodes} == {(("theta_h", (LIFT,)),)}
    assert {layer.values["eta"] for layer in nodes} == {(1.7, 1.7, 1.7)} and not any(layer.visible for layer in nodes)


def test_a_fresnel_term_has_the_same_nodes() -> None:
    document = SetFresnelTerm("ball.metal", True).apply(opened(MAPPED))
    layers = pictured(document, 3).object("ball").layers
    rising = [layer for layer in layers if layer.rises]
    assert len(rising) == 3 and len(layers) == 7
    assert [layer.values["alpha"] for layer in rising] == [
        layer.values["alpha"] for layer in layers if layer.node_of == "metal"
    ]
    assert [layer.maps for layer in rising] == [layer.maps for layer in layers if layer.node_of == "metal"]
    assert len(linked_indices(layers, 1)) == 6


def test_what_lies_under_a_cover_that_varies_varies_with_it() -> None:
    # 1 - E of a sheen of any roughness is a sum over three of them; a coat takes the same whatever its roughness.
    alpha = {"alpha": {"map": "rough.png", "range": [0.05, 0.6]}}
    covers = [{"model": name, "name": name, "parameter_maps": alpha} for name in ("sheen", "clearcoat")]
    covers[0]["scale"] = 0.8
    for cover, n in zip(covers, (3, 1), strict=True):
        document = opened({**METAL, "under": cover["name"]}, cover)
        layers = pictured(document, 4).object("ball").layers
        beneath = [layer for layer in layers if layer.model.name == "rough_conductor"]
        assert len(beneath) == n and len(layers) == 1 + n + 4
        assert not any(above.parameter_maps for layer in beneath for above in layer.covers)
        assert linked_indices(layers, 1) == tuple(i for i, layer in enumerate(layers) if layer in beneath)
        angles, channel = np.radians([0.0, 40.0, 70.0]), 0.37
        shares = [
            layer.uncovered_share(angles)
            * np.prod([np.interp(channel, each.knots, each.weights) for each in layer.maps.node_weights])
            for layer in beneath
        ]
        (own,) = document.layer(f"ball.{cover['name']}").parameter_maps
        there = document.layer(f"ball.{cover['name']}").with_parameter("alpha", own.value_at(channel))
        assert sum(shares) == pytest.approx(1.0 - there.coverage(angles), abs=0.004)


def test_a_layer_is_shown_at_each_node_of_its_curve() -> None:
    document = opened({**MAPPED, "parameter_maps": {**MAPPED["parameter_maps"], "eta": {"map": "b.png"}}})
    counts = node_counts(document, dict.fromkeys(channel_images(document), RAMP), 2)
    assert [len(each.values) for each in counts] == [2, 2]
    widths = layers_at_nodes(document, "ball.1", counts, "theta_h")
    assert tuple(layer.values["alpha"] for layer in widths) == counts[0].values
    assert {layer.values["eta"] for layer in widths} == {counts[1].values[1]}  # no part of that curve: the middle one
    assert picked_node(widths, None) == 1 and picked_node(widths, 7) == 1 and picked_node(widths, 0) == 0
    document = SetFresnelTerm("ball.metal", True).apply(document)
    assert [len(layers_at_nodes(document, key, counts, "theta_h")) for key in ("ball.0", "ball.2")] == [1, 2]


def test_solo_shows_all_nodes() -> None:
    found, view = pictured(opened(MAPPED), 3), ViewState(solo="ball.1")
    assert [is_layer_visible(found, view, f"ball.{i}") for i in range(4)] == [False, True, True, True]


def test_overrides_of_its_curves_hold_for_nodes() -> None:
    document = OverrideLine("ball.metal.theta_h", 16).apply(opened(MAPPED))
    assert dict(pictured(document, 3).overrides) == dict.fromkeys(
        ("ball.1.theta_h", "ball.2.theta_h", "ball.3.theta_h"), 16
    )


def test_a_map_is_set_changed_and_cleared_in_single_steps() -> None:
    history = History(opened(METAL))
    start = history.document
    for command in (
        SetParameterMap("ball.metal", "alpha", "rough.png"),
        SetParameterMap("ball.metal", "alpha", {"channel": "b"}),
        SetParameterMap("ball.metal", "alpha", {"range": (0.2, 0.4)}),
    ):
        assert history.do(command)
    (own,) = history.document.layer("ball.1").parameter_maps
    assert (own.image.file, own.image.channel, own.low, own.high) == ("rough.png", "b", 0.2, 0.4)
    assert history.do(SetParameterMap("ball.metal", "alpha", None)) and history.document == start
    for _ in range(4):
        history.undo()
    assert history.document == start and history.undo() is None
    with pytest.raises(InsituError, match="alfa"):
        SetParameterMap("ball.metal", "alfa", "rough.png").apply(start)


def test_a_map_has_a_path() -> None:
    plain, table = opened(METAL), {"map": "a.png", "range": [0.1, 0.2]}
    document = set_path(plain, "ball.metal.alpha_map", table).apply(plain)
    assert value_at(document, "ball.1.alpha_map") == {"map": "a.png", "range": (0.1, 0.2), "least": 1e-4}
    assert value_at(document, "ball.1.eta_map") is None
    assert set_path(document, "ball.1.alpha_map", "").apply(document) == plain
    for path in ("ball.1.distribution_map", "ball.1.none_map"):
        with pytest.raises(InsituError, match="there is no curve or parameter"):
            set_path(document, path, "a.png")


def test_a_session_has_it_and_the_scene_has_the_authored_layer_alone(tmp_path: Path) -> None:
    document = SetParameterMap("ball.metal", "eta", {"map": "b.png", "response": "square"}).apply(opened(MAPPED))
    text = dump_session(document, ViewState())
    assert text.count("[[object.layer]]") == 2
    session = parse_session(text.encode(), tmp_path / "walk.insitu", None)
    assert fit_session(session, document, "walk.insitu").objects == document.objects


def test_another_model_keeps_the_maps_that_fit() -> None:
    document = SetParameterMap("ball.metal", "eta", "b.png").apply(opened(MAPPED))
    changed = SetModel("ball.metal", "cook_torrance").apply(document)
    assert [each.parameter for each in changed.layer("ball.1").parameter_maps] == ["eta"]


def test_layers_that_follow_share_the_map() -> None:
    document = opened(METAL, {"model": "rough_conductor", "name": "veil", "follows": "metal", "scale": 0.5})
    document = SetParameterMap("ball.veil", "alpha", "rough.png").apply(document)
    assert document.layer("ball.metal").parameter_maps == document.layer("ball.veil").parameter_maps != ()
    document = SetParameterMap("ball.metal", "scale", "rough.png").apply(document)
    assert len(document.layer("ball.veil").parameter_maps) == 1


def test_its_file_is_one_of_the_document(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text("")
    from dataclasses import replace

    document = replace(opened(MAPPED), source=str(scene))
    assert tmp_path / "rough.png" in files_of_document(document)
    (full,) = with_full_names(document.object("ball").layers[1:], str(scene))
    assert full.parameter_maps[0].image.file == str(tmp_path / "rough.png")


def test_the_plan_counts_nodes() -> None:
    document = opened({**MAPPED, "parameter_maps": {**MAPPED["parameter_maps"], "scale": {"map": "s.png"}}})
    statistics = dict.fromkeys(channel_images(document), RAMP)
    alpha, scale = node_counts(document, statistics, 3)
    assert (alpha.path, alpha.n_nodes) == ("ball.1.alpha", 3) and alpha.error > 0.01
    assert (scale.n_nodes, scale.error) == (1, 0.0)
    assert "ball.1.scale exact" in nodes_reason((alpha, scale))
    assert OverrideLine("nodes", 5).apply(document).overrides == (("nodes", 5),)
    with pytest.raises(InsituError, match="a whole number from 2 to 6"):
        OverrideLine("nodes", 9).apply(document)
