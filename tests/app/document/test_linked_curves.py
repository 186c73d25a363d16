"""Curves that several objects share: whichever is edited, all follow, and nothing else of them changes."""

from __future__ import annotations

import random
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.commands import (
    AddLook,
    CollapseOperators,
    DeleteObject,
    DuplicateObject,
    EditCommand,
    LinkCurves,
    RenameObject,
    ResetCurve,
    SetEditable,
    SetFrozen,
    SetLook,
    SetMaterial,
    SetModel,
    SetOperators,
    SetParameter,
    SetVisible,
    UnlinkCurve,
)
from app.document.described import document_from_description
from app.document.document import Document, Selection
from app.document.linked_curves import linked_keys
from app.document.view_state import ViewState
from app.files.materials import copy_material, dump_material
from app.files.session import load_session, save_session
from app.files.session_fitting import fit_session
from app.modes.placement.edited_curves import edited_layers
from app.project.assignments import set_path
from engine.core.errors import InsituError, LoadError
from engine.curve.operators import Operator
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)
SHIFT = Operator("translate", "x", 0.1, 0.3, 0.5, 0.7, magnitude=0.05)
NAMES = ("pot", "cup", "jug")


@pytest.fixture
def three() -> Document:
    """Three objects with a highlight each, of other roughness."""
    described = deepcopy(SCENE)
    pot = described["object"][0]
    for n, name in enumerate(NAMES[1:], 1):
        layers = [{**layer} for layer in pot["layer"]]
        layers[1] |= {"alpha": 0.2 + 0.1 * n}
        described["object"].append({**pot, "name": name, "layer": layers})
    return document_from_description("shelf", parse_description(described, "shelf"))


def edited(document: Document, *commands: EditCommand) -> Document:
    for command in commands:
        document = command.apply(document)
    return document


def operators(document: Document, path: str) -> tuple[object, ...]:
    key, _, factor = path.rpartition(".")
    return document.layer(key).operators(factor)


def linked(document: Document, *to: str) -> Document:
    return LinkCurves("pot.1.theta_h", tuple(f"{name}.1.theta_h" for name in to or NAMES[1:])).apply(document)


def test_an_edit_of_one_is_that_of_each(three: Document) -> None:
    together = edited(
        linked(three), SetOperators("cup.1", "theta_h", (LIFT, SHIFT)), SetParameter("jug.1", "alpha", 0.31)
    )
    apart = three
    for name in NAMES:
        apart = edited(
            apart, SetParameter(f"{name}.1", "alpha", 0.31), SetOperators(f"{name}.1", "theta_h", (LIFT, SHIFT))
        )
    for name in NAMES:
        found = together.layer(f"{name}.1")
        assert found.replace(links=()) == apart.layer(f"{name}.1")
        assert linked_keys(together, f"{name}.1", "theta_h") == tuple(f"{n}.1" for n in NAMES if n != name)
    # Nothing but the curve is shared: other curves, colours and layers stay.
    other = edited(together, SetOperators("pot.1", "theta_d", (LIFT,)), SetParameter("pot.0", "albedo", 0.9))
    assert other.object("cup") == together.object("cup")
    for command in (ResetCurve("jug.1", "theta_h"), CollapseOperators("jug.1", "theta_h")):
        found = command.apply(together)
        assert {found.layer(f"{name}.1").operators("theta_h") for name in NAMES} == {
            found.layer("jug.1").operators("theta_h")
        }


def test_what_is_linked_becomes_equal_to_the_curve(three: Document) -> None:
    found = linked(SetOperators("pot.1", "theta_h", (LIFT,)).apply(three), "cup")
    gamma = np.linspace(0.0, 1.5, 50)
    np.testing.assert_array_equal(
        found.layer("cup.1").curve("theta_h")(gamma), found.layer("pot.1").curve("theta_h")(gamma)
    )
    assert found.layer("cup.1").values["alpha"] == three.layer("pot.1").values["alpha"]
    # Unlinked it stays as it is, and the other one is linked to nothing.
    single = UnlinkCurve("cup.1.theta_h").apply(found)
    assert single.curve_links == {} and single.layer("pot.1").links == ()
    assert single.layer("cup.1") == found.layer("cup.1").replace(links=())
    assert SetOperators("cup.1", "theta_h", ()).apply(single).object("pot") == single.object("pot")


def test_a_model_that_has_the_curve_takes_it_over_and_another_leaves(three: Document) -> None:
    found = SetModel("cup.1", "cook_torrance").apply(linked(SetOperators("pot.1", "theta_h", (LIFT,)).apply(three)))
    assert found.object("pot") == linked(SetOperators("pot.1", "theta_h", (LIFT,)).apply(three)).object("pot")
    assert found.layer("cup.1").operators("theta_h") == (LIFT,)
    # Its curve is generated from a roughness of its own kind, which stays; edits of the curves are shared.
    followed = SetOperators("cup.1", "theta_h", (LIFT, SHIFT)).apply(found)
    assert followed.layer("jug.1").operators("theta_h") == (LIFT, SHIFT)
    assert followed.layer("cup.1").values == found.layer("cup.1").values
    without = SetModel("cup.1", "phong").apply(found)
    assert linked_keys(without, "pot.1", "theta_h") == ("jug.1",)


def test_links_go_with_objects(three: Document) -> None:
    found = edited(linked(three), RenameObject("cup", "mug"), DuplicateObject("jug"), DeleteObject("pot"))
    assert linked_keys(found, "mug.1", "theta_h") == ("jug.1", "jug 2.1")
    alone = edited(found, DeleteObject("jug"), DeleteObject("jug 2"))
    assert alone.curve_links == {} and not alone.is_frozen("mug.1")
    # A material that is copied onto another object is edited alone.
    pasted = SetMaterial("floor", copy_material(found, "mug").layers).apply(found)
    assert pasted.layer("floor.1").links == () and "links" not in dump_material(copy_material(found, "mug"))


def test_a_frozen_member_refuses_as_layers_that_share_curves_do(three: Document) -> None:
    for frozen in ("cup", "cup.1"):
        found = SetFrozen(frozen, True).apply(linked(three))
        assert found.is_frozen("pot.1") and not found.is_frozen("pot.0")
        with pytest.raises(InsituError, match="pot.1 is frozen"):
            SetOperators("pot.1", "theta_h", (LIFT,)).apply(found)
    with pytest.raises(InsituError, match="cup.1 is frozen"):
        linked(SetFrozen("cup", True).apply(three))


def test_the_transport_of_all_is_desired_where_they_are_drawn(three: Document) -> None:
    selected = Selection("pot", 1, "theta_h")
    assert edited_layers(linked(three), selected) == ("pot.1", "cup.1", "jug.1")
    assert edited_layers(linked(three), selected._replace(factor="theta_d")) == ("pot.1",)
    other = edited(linked(three), SetVisible("cup", False), SetEditable("jug", False))
    assert edited_layers(other, selected) == ("pot.1",)


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (LinkCurves("pot.1.theta_h", ("cup.1.theta_d",)), "of the same angle, theta_h"),
        (LinkCurves("pot.1.theta_h", ("pot.1.theta_h",)), "linked to itself"),
        (LinkCurves("pot.1", ("cup.1.theta_h",)), "'pot.1' is a layer; name a curve"),
        (LinkCurves("pot.1.theta_h", ("pan.1.theta_h",)), "no object 'pan'"),
        (LinkCurves("pot.1.theta_h", ()), "name at least one curve"),
        (UnlinkCurve("pot.1.theta_h"), "linked to no other curve"),
    ],
)
def test_what_makes_no_sense_is_refused(three: Document, command: EditCommand, said: str) -> None:
    with pytest.raises(InsituError, match=said):
        command.apply(three)


def test_paths_link_and_unlink(three: Document) -> None:
    assert set_path(three, "cup.1.theta_h", "pot.1.theta_h") == LinkCurves("pot.1.theta_h", ("cup.1.theta_h",))
    assert set_path(three, "cup.1.theta_h", "") == UnlinkCurve("cup.1.theta_h")
    with pytest.raises(LoadError, match="the curve that it follows"):
        set_path(three, "cup.1.theta_h", 3)


def test_sessions_and_looks_keep_links(three: Document, tmp_path: Path) -> None:
    found = edited(
        linked(three, "cup"), AddLook("B"), UnlinkCurve("cup.1.theta_h"), SetOperators("cup.1", "theta_h", (LIFT,))
    )
    path = save_session(tmp_path / "links.insitu", found, ViewState())
    assert fit_session(load_session(path), three, str(path)) == found
    assert linked_keys(SetLook("Look 1").apply(found), "pot.1", "theta_h") == ("cup.1",)


def test_any_sequence_leaves_linked_curves_equal_and_others_as_they_were(three: Document, tmp_path: Path) -> None:
    """An oracle of sets of curves that follow each other, which knows of no links."""
    curves = [f"{name}.1.{factor}" for name in NAMES for factor in ("theta_h", "theta_d")]
    for seed in range(15):
        rng, document = random.Random(seed), three
        sets = [{path} for path in curves]
        for _ in range(40):
            path = rng.choice(curves)
            key, _, factor = path.rpartition(".")
            own = next(each for each in sets if path in each)
            before = {
                each: document.layer(each.rpartition(".")[0]).operators(each.rpartition(".")[2]) for each in curves
            }
            what = rng.choice(("edit", "edit", "link", "unlink", "alpha", "session"))
            if what == "edit":
                lift = replace(LIFT, magnitude=rng.random())
                document = SetOperators(key, factor, (lift,)).apply(document)
                before |= dict.fromkeys(own, (lift,))
            elif what == "alpha":
                document = SetParameter(key, "alpha", round(rng.uniform(0.1, 0.9), 3)).apply(document)
            elif what == "link":
                others = [each for each in curves if each.endswith(factor) and each != path]
                to = tuple(rng.sample(others, rng.randint(1, 2)))
                document = LinkCurves(path, to).apply(document)
                sets = [each - set(to) for each in sets if each is not own] + [own | set(to)]
                before |= dict.fromkeys(to, before[path])
            elif what == "unlink" and len(own) > 1:
                document = UnlinkCurve(path).apply(document)
                sets = [each - {path} for each in sets] + [{path}]
            elif what == "session":
                saved = save_session(tmp_path / "any.insitu", document, ViewState())
                assert fit_session(load_session(saved), three, str(saved)) == document
            for each in curves:
                own_key, _, name = each.rpartition(".")
                assert operators(document, each) == before[each]
                members = next(own for own in sets if each in own)
                assert {f"{k}.{name}" for k in linked_keys(document, own_key, name)} == members - {each}
                alphas = {document.layer(other.rpartition(".")[0]).values["alpha"] for other in members}
                assert name != "theta_h" or len(alphas) == 1
