"""Every command does what it says, refuses what makes no sense, and leaves the document it was given as it was."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.commands import EditCommand
from app.document.commands.curves import (
    MAX_OPERATORS,
    AddOperator,
    CollapseOperators,
    MoveOperator,
    MuteOperator,
    RemoveOperator,
    ReplaceOperator,
    ResetCurve,
    SetOperators,
)
from app.document.commands.layers import SetEditable, SetFrozen, SetModel, SetParameter, SetVisible
from app.document.commands.light import (
    SetBackground,
    SetBackgroundColour,
    SetEnvironment,
    SetIntensity,
    SetMapping,
    SetRotation,
)
from app.document.commands.plan import SetFirstBands
from app.document.document import Document
from app.project.assignments import set_path
from engine.core.errors import InsituError, LoadError
from engine.curve.operators import Operator, TabulatedCurve, diagonal

LIFT = Operator("translate", "y", 0.1, 0.2, 0.3, 0.4, magnitude=1.0)
SHIFT = Operator("translate", "x", 0.1, 0.3, 0.5, 0.7, magnitude=0.05)
WIDEN = Operator("amplify", "x", 0.0, 0.1, 0.5, 1.2, magnitude=1.2)
CURVE = ("pot.1", "theta_h")


def operators(document: Document) -> tuple[object, ...]:
    return document.layer("pot.1").operators("theta_h")


@pytest.fixture
def edited(document: Document) -> Document:
    """The document with LIFT, SHIFT and WIDEN on the pot's highlight."""
    return SetOperators(*CURVE, (LIFT, SHIFT, WIDEN)).apply(document)


def test_parameters_are_set_by_the_table(document: Document) -> None:
    changed = SetParameter("pot.1", "eta", 1.5).apply(document)
    assert changed.layer("pot.1").values["eta"] == (1.5, 1.5, 1.5)  # one number stands for three
    assert SetParameter("pot.base", "albedo", [0.1, 0.2, 0.3]).apply(document).layer("pot.0").values["albedo"] == (
        0.1,
        0.2,
        0.3,
    )


def test_edits_stay_when_a_parameter_moves(edited: Document) -> None:
    changed = SetParameter("pot.1", "alpha", 0.4).apply(edited)
    assert operators(changed) == (LIFT, SHIFT, WIDEN)


def test_operators_are_added_moved_muted_and_removed(edited: Document) -> None:
    flat = Operator("amplify", "y", 0.2, 0.2, 0.3, 0.3, magnitude=0.5)
    assert operators(AddOperator(*CURVE, flat).apply(edited)) == (LIFT, SHIFT, WIDEN, flat)
    assert operators(AddOperator(*CURVE, flat, index=1).apply(edited)) == (LIFT, flat, SHIFT, WIDEN)
    assert operators(ReplaceOperator(*CURVE, 1, flat).apply(edited)) == (LIFT, flat, WIDEN)
    assert operators(RemoveOperator(*CURVE, 0).apply(edited)) == (SHIFT, WIDEN)
    assert operators(MoveOperator(*CURVE, 0, 2).apply(edited)) == (SHIFT, WIDEN, LIFT)
    assert operators(MoveOperator(*CURVE, 2, -5).apply(edited)) == (WIDEN, LIFT, SHIFT)
    assert operators(ResetCurve(*CURVE).apply(edited)) == ()
    muted = MuteOperator(*CURVE, 0).apply(edited)
    gamma = np.linspace(0.0, 1.5, 50)
    without = RemoveOperator(*CURVE, 0).apply(edited)
    assert np.array_equal(muted.layer("pot.1").curve("theta_h")(gamma), without.layer("pot.1").curve("theta_h")(gamma))
    assert MuteOperator(*CURVE, 0, False).apply(muted) == edited


def test_a_diagonal_edit_is_moved_muted_and_removed_as_one(edited: Document) -> None:
    low, high = pair = diagonal((0.1, 0.2, 0.3, 0.4), 0.01, 0.5)
    twin = replace(high, magnitude=0.02)
    document = SetOperators(*CURVE, (LIFT, *pair, twin)).apply(edited)
    assert operators(MoveOperator(*CURVE, 2, 0).apply(document)) == (*pair, LIFT, twin)
    # An X that comes to stand above the Y of a pair goes past both.
    assert operators(MoveOperator(*CURVE, 3, 2).apply(document)) == (LIFT, twin, *pair)
    assert operators(RemoveOperator(*CURVE, 1).apply(document)) == (LIFT, twin)
    muted = operators(MuteOperator(*CURVE, 2).apply(document))
    assert muted == (LIFT, replace(low, muted=True), replace(high, muted=True), twin)


def test_collapsing_keeps_the_curve(edited: Document) -> None:
    changed = CollapseOperators(*CURVE).apply(edited)
    (table,) = operators(changed)
    assert isinstance(table, TabulatedCurve)
    gamma = np.random.default_rng(3).uniform(0.0, np.pi / 2, 500)
    before, after = (d.layer("pot.1").curve("theta_h")(gamma) for d in (edited, changed))
    assert np.abs(after - before).max() <= 1e-3 * before.max()  # `collapse` aims at 1e-4 of the local value
    assert CollapseOperators("pot.1", "theta_d").apply(edited) is edited  # nothing to collapse


def test_model_changes_keep_the_edits_of_curves_that_stay(edited: Document) -> None:
    changed = SetModel("pot.1", "cook_torrance").apply(edited).layer("pot.1")
    assert changed.model.name == changed.name == "cook_torrance"
    assert changed.operators("theta_h") == (LIFT, SHIFT, WIDEN)
    assert SetModel("pot.1", "phong").apply(edited).layer("pot.1").edits == ()  # it has no θ_h
    assert SetModel("pot.0", "phong").apply(edited).layer("pot.0").name == "base"  # a name a person gave stays


def test_switches(document: Document) -> None:
    assert not SetVisible("pot", False).apply(document).object("pot").visible
    assert not SetVisible("pot.1", False).apply(document).layer("pot.1").visible
    assert not SetEditable("pot", False).apply(document).object("pot").editable
    assert SetFrozen("pot.1", True).apply(document).is_frozen("pot.1")


@pytest.mark.parametrize("what", ["pot", "pot.1"])
def test_frozen_materials_refuse_edits_until_they_thaw(document: Document, what: str) -> None:
    frozen = SetFrozen(what, True).apply(document)
    for command in (SetParameter("pot.1", "alpha", 0.3), AddOperator(*CURVE, LIFT), SetModel("pot.1", "phong")):
        with pytest.raises(InsituError, match="frozen; thaw"):
            command.apply(frozen)
    assert operators(AddOperator(*CURVE, LIFT).apply(SetFrozen(what, False).apply(frozen))) == (LIFT,)


def test_light(document: Document) -> None:
    assert SetRotation(-30.0).apply(document).light.rotation == 330.0
    assert SetRotation(765.0).apply(document).light.rotation == 45.0
    assert SetRotation(-1e-20).apply(document).light.rotation == 0.0  # the float remainder alone would be 360
    assert SetIntensity(0).apply(document).light.intensity == 0.0
    changed = SetEnvironment("hall.exr", "angular").apply(SetRotation(10.0).apply(document)).light
    assert (changed.environment, changed.mapping, changed.rotation) == ("hall.exr", "angular", 10.0)
    assert SetEnvironment("constant", radiance=(1.0, 0.5, 0.0)).apply(document).light.radiance == (1.0, 0.5, 0.0)


def test_a_file_is_read_as_either_map(document: Document, tmp_path: Path) -> None:
    square, wide = tmp_path / "probe.hdr", tmp_path / "sky.hdr"
    for file, width in ((square, 8), (wide, 16)):
        file.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X %d\n" % width)
    lit = set_path(document, "light.environment", str(square)).apply(SetRotation(10.0).apply(document))
    # A square file is taken for an angular map; the person may say otherwise, and the rest of the light stays.
    assert (lit.light.mapping, lit.light.rotation) == ("angular", 10.0)
    other = SetMapping("latlong").apply(lit)
    assert other.light == replace(lit.light, mapping="latlong")
    assert SetMapping("angular").apply(other) == lit
    lit = set_path(document, "light.environment", str(wide)).apply(document)
    assert lit.light.mapping == "latlong"
    with pytest.raises(InsituError, match="sky.hdr has 16 x 8 pixels, expected a square angular map"):
        SetMapping("angular").apply(lit)
    for own in (document, SetEnvironment("studio").apply(document)):
        with pytest.raises(InsituError, match="has a mapping of its own"):
            SetMapping("latlong").apply(own)


REFUSED: list[EditCommand] = [
    SetParameter("pot.1", "alpha", 0.0),
    SetParameter("pot.1", "alpha", float("nan")),
    SetParameter("pot.1", "alpha", True),
    SetParameter("pot.1", "albedo", 0.5),
    SetParameter("pot.1", "distribution", "gaussian"),
    SetParameter("pot", "alpha", 0.5),
    SetModel("pot.1", "velvet"),
    SetModel("pot.1", "phong", (("alpha", 0.5),)),
    AddOperator("pot.1", "theta_i", LIFT),
    AddOperator("floor.0", "theta_h", LIFT),
    SetOperators(*CURVE, (LIFT,) * (MAX_OPERATORS + 1)),
    ReplaceOperator(*CURVE, 0, LIFT),
    RemoveOperator(*CURVE, -1),
    MoveOperator(*CURVE, 3, 0),
    SetVisible("shelf", False),
    SetVisible("pot.1.alpha", False),
    SetRotation(float("inf")),
    SetIntensity(-1.0),
    SetIntensity(float("nan")),
    SetEnvironment(""),
    SetMapping("cube"),  # type: ignore[arg-type]
    SetEnvironment("constant"),
    SetEnvironment("studio", radiance=(1.0, 1.0, 1.0)),
    SetEnvironment("constant", radiance=(1.0, -1.0, 1.0)),
    SetBackground("sky"),  # type: ignore[arg-type]
    SetBackgroundColour((0.5, -0.1, 0.5)),
    SetBackgroundColour((0.5, float("nan"), 0.5)),
    SetBackgroundColour("red"),
]


@pytest.mark.parametrize("command", REFUSED, ids=lambda command: type(command).__name__)
def test_refusals_are_one_line(document: Document, command: EditCommand) -> None:
    with pytest.raises(InsituError) as caught:
        command.apply(document)
    assert str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("path", "value", "command"),
    [
        ("pot.base.albedo", 0.5, SetParameter("pot.0", "albedo", 0.5)),
        ("light.rotation", 45.0, SetRotation(45.0)),
        ("light.intensity", 2.0, SetIntensity(2.0)),
        ("light.environment", "studio", SetEnvironment("studio")),
        ("light.mapping", "angular", SetMapping("angular")),
        ("light.background", "transparent", SetBackground("transparent")),
        ("light.background_colour", (0.1, 0.2, 0.3), SetBackgroundColour((0.1, 0.2, 0.3))),
        ("pot.frozen", True, SetFrozen("pot", True)),
        ("pot.1.visible", False, SetVisible("pot.1", False)),
        ("floor.editable", False, SetEditable("floor", False)),
        ("series.first", 128.0, SetFirstBands(128)),
        ("series.first", "auto", SetFirstBands(None)),
    ],
)
def test_setting_by_path(document: Document, path: str, value: Any, command: EditCommand) -> None:
    assert set_path(document, path, value) == command


@pytest.mark.parametrize(
    ("path", "value"), [("pot", 1), ("pot.1.theta_h", 1), ("pot.visible", 1), ("light.environment", 1)]
)
def test_setting_what_has_no_such_value_is_refused(document: Document, path: str, value: Any) -> None:
    with pytest.raises(InsituError):
        set_path(document, path, value)


@pytest.mark.parametrize("bands", [0, 3, 1024, True, 16.5, "16"])
def test_bands_at_the_first_bounce_are_powers_of_two(document: Document, bands: Any) -> None:
    with pytest.raises(LoadError, match="one of 1, 2, 4"):
        SetFirstBands(bands).apply(document)


def test_labels_say_what_was_done() -> None:
    assert AddOperator(*CURVE, LIFT).label == "pot.1 theta_h Translate Y"
    assert SetFrozen("pot", False).label == "thaw pot"


def test_a_background_keeps_its_colour_and_changes_no_light(document: Document) -> None:
    coloured = SetBackgroundColour((0.2, 0.3, 0.4)).apply(document)
    shown = SetBackground("transparent").apply(coloured)
    assert (coloured.background.kind, shown.background.colour) == ("colour", (0.2, 0.3, 0.4))
    assert shown.light == document.light and shown.objects == document.objects
