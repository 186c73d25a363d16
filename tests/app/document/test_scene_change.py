"""Edits on a scene whose files were saved again: what the user changed stays, all else follows the files."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.document.commands import EditCommand
from app.document.commands.curves import SetOperators
from app.document.commands.layers import AddLayers, SetMaterial, SetParameter, SetVariant, SetVisible, new_layer
from app.document.commands.light import SetEmission, SetRotation
from app.document.commands.maps import SetBumps, SetOpacity, SetSurface
from app.document.commands.suns import SetSun
from app.document.document import Document, Variant
from app.document.history import History
from app.document.scene_change import SceneChange, matching_parts
from app.document.view_state import ViewState
from app.files.session import Session
from app.files.session_fitting import fit_session
from engine.curve.operators import Operator
from engine.light.suns import Sun
from engine.material.bumps import Bumps
from engine.scene.description import parse_description
from engine.scene.import_report import ImportedObject, ImportReport

LIFT = Operator("translate", "y", 0.2, 0.4, 0.6, 0.8, magnitude=0.5)
ROUGH, RED = SetParameter("pot.1", "alpha", 0.4), SetParameter("pot.0", "albedo", (0.8, 0.1, 0.1))
COAT = new_layer("clearcoat").replace(name="coat")
SHEET = (new_layer("lambert"),)
LIFTED = SetOperators("pot.1", "theta_h", (LIFT,))


def edited(document: Document, *commands: EditCommand) -> Document:
    for command in commands:
        document = command.apply(document)
    return document


def without(document: Document, name: str) -> Document:
    return replace(document, objects=tuple(state for state in document.objects if state.name != name))


def test_nothing_changed_changes_nothing(document: Document) -> None:
    mine = edited(document, RED, LIFTED, SetRotation(50.0), SetVisible("floor", False), SetEmission("lamp", 3.0))
    assert SceneChange(document, document)(mine) == mine


def test_no_field_of_an_object_is_lost(document: Document) -> None:
    """Whatever an object has besides its layers: the user's stays, also where the file has another."""
    commands = (
        SetOpacity("floor", "opacity_mode", "blend"), SetBumps("floor", "tangent_angle", 30.0),
        SetSurface("floor", "membrane", ()),
    )  # fmt: skip
    mine = edited(document, *commands)
    theirs = edited(document, SetParameter("floor.0", "albedo", 0.3))
    assert SceneChange(document, theirs)(mine) == edited(theirs, *commands)


def test_a_chosen_variant_follows_the_file_until_it_is_edited(document: Document) -> None:
    def with_variants(grey: float) -> Document:
        plain, other = (new_layer("lambert").with_parameter("albedo", each) for each in (0.5, grey))
        look = Variant("look", (other,), Bumps(tangent_angle=100.0 * grey))
        state = replace(document.object("floor"), layers=(plain,), variants=(look,))
        return document.with_object(state)

    before, now = with_variants(0.2), with_variants(0.3)
    chosen = SetVariant("look").apply(before)
    assert SceneChange(before, now)(chosen) == SetVariant("look").apply(now)
    painted = SetParameter("floor.0", "albedo", 0.9).apply(chosen)
    assert SceneChange(before, now)(painted).layer("floor.0").values["albedo"] == (0.9,) * 3
    assert SceneChange(before, now)(before) == now


def test_a_new_object_under_the_name_of_another_part_is_as_its_file_has_it(document: Document) -> None:
    """The pot's file has a new part, which pushed the floor's number on: "floor" is now called "pot"."""
    mine = edited(document, SetVisible("pot", False), SetVisible("floor", False))
    pot, floor = document.object("pot"), document.object("floor")
    moved = replace(document, objects=(pot, floor, replace(pot, name="cup"), document.object("lamp")))
    change = SceneChange(document, moved, {"floor": "floor", "cup": "pot"})
    found = change(mine)
    assert [state.visible for state in found.objects] == [True, False, False, True]
    assert change.name_now("pot") == "cup" and change.name_now("lamp") == "lamp" and not change.gone(mine)


def test_what_lies_under_a_coat_lies_under_the_merged_one(document: Document) -> None:
    """The other program makes the coat weaker, here it got another index of refraction."""
    coated = edited(document, SetMaterial("pot", (new_layer("lambert").replace(under="coat"), COAT)))
    mine = edited(coated, SetParameter("pot.coat", "ior", 2.0))
    found = SceneChange(coated, edited(coated, SetParameter("pot.coat", "scale", 0.5)))(mine)
    (cover,) = found.layer("pot.0").covers
    assert cover.values == found.layer("pot.coat").values and (cover.values["ior"], cover.values["scale"]) == (2.0, 0.5)


def test_edits_of_a_layer_that_is_gone_are_named(document: Document) -> None:
    named = edited(document, SetMaterial("pot", (new_layer("lambert"), COAT.replace(name="varnish"))))
    coated = edited(document, SetMaterial("pot", (new_layer("lambert").replace(under="coat"), COAT)))
    mine = edited(coated, SetParameter("pot.coat", "ior", 2.0))
    change = SceneChange(coated, named)
    assert change.lost_parts(mine) == ("pot coat",) and not change.lost_parts(coated)
    assert change(mine).object("pot").layers == named.object("pot").layers
    # A stack that the user has built stays as it is.
    assert not change.lost_parts(edited(mine, AddLayers("pot", SHEET)))


def test_suns_follow_their_file_by_name(document: Document) -> None:
    """The other program makes noon brighter, leaves out dusk, and has a dawn; noon was made larger here."""

    def with_suns(*suns: Sun) -> Document:
        return replace(document, light=replace(document.light, own_suns=suns))

    noon, dusk, dawn = (Sun((0.0, 1.0, 0.0), (3.0, 3.0, 3.0), name=name) for name in ("noon", "dusk", "dawn"))
    before = with_suns(noon, dusk)
    now = with_suns(dawn, noon._replace(irradiance=(5.0, 5.0, 5.0)))
    mine = edited(before, SetSun("noon", "diameter", 2.0))
    change = SceneChange(before, now)
    assert change(mine).light.suns == (dawn, Sun((0.0, 1.0, 0.0), (5.0, 5.0, 5.0), 2.0, "noon"))
    assert change(before) == now and not change.lost_parts(mine)
    assert change.lost_parts(edited(mine, SetSun("dusk", "diameter", 2.0))) == ("dusk",)
    # A session opens in the same way.
    opened = fit_session(Session(mine, ViewState(), None), now, "mine.insitu")
    assert [(sun.name, sun.diameter) for sun in opened.light.suns] == [("dawn", dawn.diameter), ("noon", 2.0)]


def test_each_value_follows_who_changed_it(document: Document) -> None:
    """The other program makes the coat rougher and the pot red; here the coat got an operator, and the floor was
    hidden."""
    mine = edited(document, LIFTED, SetVisible("floor", False), SetRotation(50.0))
    theirs = edited(document, ROUGH, RED)
    found = SceneChange(document, theirs)(mine)
    assert found == edited(document, ROUGH, RED, LIFTED, SetVisible("floor", False), SetRotation(50.0))


def test_where_both_changed_a_value_the_user_s_stays(document: Document) -> None:
    theirs = edited(document, ROUGH, SetRotation(10.0))
    mine = edited(document, SetParameter("pot.1", "alpha", 0.05), SetRotation(50.0))
    assert SceneChange(document, theirs)(mine) == mine


@pytest.mark.parametrize("command", [AddLayers("pot", SHEET), SetMaterial("pot", SHEET, "sheet")])
def test_a_material_that_the_user_built_stays_whole(document: Document, command: EditCommand) -> None:
    mine, theirs = edited(document, command), edited(document, ROUGH)
    assert SceneChange(document, theirs)(mine).object("pot").layers == mine.object("pot").layers


def test_an_edited_object_that_is_gone_waits_for_its_return(document: Document) -> None:
    mine, fewer = edited(document, LIFTED), without(document, "pot")
    change = SceneChange(document, fewer)
    found = change(mine)
    assert change.gone(mine) == ("pot",) and found.objects == fewer.objects
    assert found.absent == (mine.object("pot"),)
    found = edited(found, SetVisible("floor", False))
    back = SceneChange(fewer, document)(found)
    assert back == edited(mine, SetVisible("floor", False)) and not back.absent
    assert not change.gone(document)  # one without edits is no loss


def test_lamps_stay_what_the_file_makes_them(document: Document) -> None:
    lit = edited(document, SetEmission("lamp", (9.0, 9.0, 9.0)))
    assert SceneChange(document, document)(lit).object("lamp").emission == (9.0, 9.0, 9.0)
    floor, lamp = document.object("floor"), document.object("lamp")
    dark = document.with_object(replace(lamp, emission=None, layers=floor.layers))
    assert SceneChange(document, dark)(lit).object("lamp") == dark.object("lamp")


def test_the_history_goes_on(document: Document) -> None:
    history = History(document)
    for command in (LIFTED, SetVisible("floor", False), RED):
        history.do(command)
    history.undo()
    theirs = edited(without(document, "floor"), ROUGH)
    history.map(SceneChange(document, theirs))
    # Hiding the floor changes nothing any more: the step is left out.
    assert history.document.object("pot").layers == edited(theirs, LIFTED).object("pot").layers
    assert history.redo() == RED.label and history.document.layer("pot.0").values["albedo"] == (0.8, 0.1, 0.1)
    assert history.undo() == RED.label
    while history.undo():
        pass
    assert history.document == theirs


def test_parts_are_found_again_by_their_material() -> None:
    def scene(*names: str):
        objects = [{"name": f"bag {k + 1}", "mesh": "bag.glb", "part": k} for k in range(len(names))]
        camera = {"position": [0, 0, 1], "target": [0, 0, 0]}
        described = parse_description({"version": 1, "camera": camera, "object": objects}, "scene.toml")
        found = tuple(ImportedObject(item["name"], 2, name) for item, name in zip(objects, names, strict=True))
        return described, ImportReport(objects=found)

    before, now = scene("leather", "brass", "", "thread", "thread"), scene("zip", "leather", "", "brass", "thread")
    assert matching_parts(*before, *now) == {"bag 2": "bag 1", "bag 4": "bag 2"}
