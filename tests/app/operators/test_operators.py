"""The declarations of operators agree with each other, and each that needs no window does something to an editor."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.commands import AddLook, DuplicateObject, LinkCurves, SetGroup, SetLook, SetTransform
from app.document.commands.curves import SetOperators
from app.document.commands.light import SetRotation
from app.document.material_match import MaterialAnswer, MaterialMatch
from app.document.view_state import SetView, Viewpoint
from app.editor.editor import Editor
from app.editor.material_matching import MaterialMatching
from app.messages.worker_messages import OpenScene
from app.operators.arrange import Addition, Grouping, Move, PaintedAddition
from app.operators.camera import MoveCamera
from app.operators.curve_drawing import CurvePoints, CurveStroke
from app.operators.edits import CurveLink, Deform
from app.operators.files import CurveTable, MaterialFile, MeasuredFile, VariantChoice
from app.operators.inspect import ConfiguredView
from app.operators.material_matches import MatchMaterial
from app.operators.operator import Gesture
from app.operators.registry import GROUPS, MENUS, OPERATORS, keys_of, listed_lines, run_operator
from app.operators.script import StepRecord
from app.operators.transfers import Transfer
from engine.curve.operators import Operator as CurveOperator
from engine.scene.camera_moves import orbit_camera
from engine.scene.rig import Animation
from scripts.write_reference import pages
from tests.app.fake_matcher import FakeMatcher
from tests.app.fake_worker import FakeClient

LIFT = CurveOperator("translate", "y", 0.2, 0.4, 0.6, 0.8, magnitude=0.5)
RUN_BY_EDITOR = sorted(name for name, each in OPERATORS.items() if each.run is not None)
# What an operator is carried out with here; the others have a default.
VALUES: dict[str, Any] = {
    "set": {"pot.1.alpha": 0.37, "light.intensity": 2.0}, "select": "floor", "deform": Deform(object="pot", bend=20.0),
    "move": Move(object="pot", by=(0.1, 0.0, 0.0)), "add": Addition(shape="box"),
    "group": Grouping(name="Set", objects=("floor", "pot")), "ungroup": "Tea", "drop": "pot",
    "paint_light": PaintedAddition(kind="box", azimuth=30.0),
    "rotate": 75.0, "accuracy": 0.0, "override": {"lights": 600}, "view": "AgX", "rename_view": ("View 1", "Spout"),
    "mode": "orbit", "lobe": (2, 3), "resolution": (24, 16), "camera": MoveCamera(orbit=(30.0, 10.0), dolly=0.5),
    "measured": MeasuredFile(file="velvet.binary"), "material_file": MaterialFile(file="wood.mtlx", material="oak"),
    "table": CurveTable(file="peak.csv"), "variant_set": VariantChoice(set="shape", variant="tall"),
    "picture_channel": "red",
    "look": "Night", "rename_look": "Gold", "move_look": 2, "delete_look": "Night", "side_by_side": 2,
    "link": CurveLink(curve="pot.1.theta_h", to=("cup.1.theta_h",)), "unlink": "pot.1.theta_h",
    "transfer": Transfer(curve="pot.1.theta_h", to=("cup",)),
    "match_material": MatchMaterial(object="pot", source="floor", model="ward"),
    "compare_file": "before.exr", "compare_with": "", "remove_stored": "Before", "crop": [],
    "probes": [(1, 1)],
    "ocio": ConfiguredView(config="studio.ocio"),
    "draw_curve": CurveStroke(points=((0.0, 1.0), (30.0, 2.0))), "set_points": CurvePoints(points=((5.0, 1.0),)),
}  # fmt: skip


@pytest.fixture
def worked(client: FakeClient) -> Editor:
    """An editor in which all can be done: an edited curve whose operator is selected, a camera that was moved, a saved
    view, an animation, a moved object, three looks, the second one current, and something to undo."""
    editor = Editor(client, "shelf")
    boxes = np.array([[[-1, -1, -1], [1, 1, 1]]] * 3, float)
    client.open_scene(animations=((Animation("flap", 1.2),), (), ()), boxes=boxes)
    editor.tick(0.0)
    editor.select("pot.1.theta_h")
    editor.do(SetOperators("pot.1", "theta_h", (LIFT,)))
    editor.do(SetTransform("pot", (0.5, 0.2, 0.0)))
    editor.do(SetGroup(("pot",), "Tea"))
    for command in (AddLook("Brass"), AddLook("Night"), SetLook("Brass"), SetRotation(50.0)):
        editor.do(command)
    editor.do(SetView.of(operator=0, fit=False, zoom=3.0, exposure=1.0, picture_channel="alpha"))
    editor.do(SetView.of(crop=(0.0, 0.0, 0.5, 0.5), probes=((0.5, 0.5),)))
    tilted = orbit_camera(editor.camera_history.camera, 0.3, 0.4).model_copy(update={"up": (0.3, 1.0, 0.0)})
    for camera in (orbit_camera(tilted, 0.1, 0.0), tilted):
        editor.camera_history.set_viewpoint(Viewpoint(camera), "orbit")
    run_operator(editor, "save_view")
    editor.stored.store(np.ones((2, 2, 4), np.float32), "Before")
    return editor


@pytest.mark.parametrize("name", RUN_BY_EDITOR)
def test_each_operator_does_something(worked: Editor, client: FakeClient, name: str) -> None:
    if name in ("redo", "redo_view"):
        assert run_operator(worked, name.replace("redo", "undo")) is None
    if name == "show_all":
        assert run_operator(worked, "hide") is None
    if name == "z_up":  # only a mesh that was opened alone can be turned
        worked.history.document = replace(worked.document, source="/models/pot.stl")
    if name == "variant_set":  # only a stage of USD has sets
        worked.history.document = replace(worked.document, source="/models/pot.usda")
    if name in ("link", "unlink") or name.startswith("transfer"):  # only curves of several objects
        worked.history.document = DuplicateObject("pot", "cup").apply(worked.document)
    if name.startswith("transfer_"):
        worked.select(("cup", "pot.1.theta_h"))
    if name == "unlink":
        worked.history.document = LinkCurves("pot.1.theta_h", ("cup.1.theta_h",)).apply(worked.document)
    if name == "make_single_user":
        worked.history.document = DuplicateObject("pot", "cup", linked=True).apply(worked.document)
    if name == "looks_1":
        worked.do(SetView.of(looks_shown=4))
    matcher = FakeMatcher[MaterialMatch, MaterialAnswer]()
    worked.material_matching = MaterialMatching(worked, matcher)
    before = worked.document, worked.view, len(client.requests), matcher.n_begun
    if name == "resume":
        worked.cancel_work()
        worked.metrics.stopped = True
        assert run_operator(worked, name) is None and not worked.metrics.stopped
        return
    assert not OPERATORS[name].why_not(worked)
    assert run_operator(worked, name, VALUES.get(name)) is None
    assert (worked.document, worked.view, len(client.requests), matcher.n_begun) != before


def test_why_an_operator_cannot_run_is_said(client: FakeClient) -> None:
    editor = Editor(client, "shelf")
    for name, operator in OPERATORS.items():
        if operator.needs is None or operator.run is None:
            continue
        assert operator.why_not(editor) == operator.needs.reason
        before = editor.document, editor.view, len(client.requests)
        assert run_operator(editor, name, VALUES.get(name)) == operator.needs.reason
        assert (editor.document, editor.view, len(client.requests)) == before


def test_what_an_editor_refuses_is_returned_and_shown(worked: Editor) -> None:
    for name, value, says in (
        ("mode", "paint", "there is no 'paint'"), ("save_view", " a", "expected a name"),
        ("rename_view", ("View 1", ""), "expected a name"), ("set", {"pot.1.alpha": 7.0}, "alpha"),
        ("select", "cup", "cup"), ("override", {"lamps": 3}, "no line 'lamps'"), ("view", "sepia", "no view 'sepia'"),
        ("camera", MoveCamera(frame="cup"), "cup"),
    ):  # fmt: skip
        refusal = run_operator(worked, name, value)
        assert refusal is not None and says in refusal
        assert worked.status.is_error and worked.status.message == refusal
    with pytest.raises(ValueError, match="by the window"):
        run_operator(worked, "open")


def test_counts_undo_and_redo_so_many_steps(worked: Editor) -> None:
    n_steps = len(worked.history.undo_steps)
    assert run_operator(worked, "undo", 2) is None and len(worked.history.undo_steps) == n_steps - 2
    assert run_operator(worked, "redo", 3) == "nothing to redo" and len(worked.history.undo_steps) == n_steps
    assert run_operator(worked, "undo_view", 9) == "nothing to undo in the view"


def test_names_and_keys_are_unique() -> None:
    names = [each.name for group in GROUPS.values() for each in group if not isinstance(each, Gesture)]
    keys = [key for each in OPERATORS.values() for key in each.keys]
    assert [name for name, n in Counter(names).items() if n > 1] == []
    assert [key for key, n in Counter(keys).items() if n > 1] == []
    assert keys_of("redo") == "Ctrl Y" and keys_of("select") == ""


def test_every_key_is_listed() -> None:
    """By a line of its own, or the line before it names its keys as well."""
    for group, declared in GROUPS.items():
        shown, lines = "", listed_lines(group)
        for each in declared:
            if isinstance(each, Gesture) or not each.keys:
                continue
            shown = (each.listed_keys or each.keys[0]) if each.help else shown
            last = each.keys[0].split()[-1]
            assert last in shown or shown == "with Ctrl" and each.keys[0].startswith("Ctrl"), each.name
        assert all(keys and text for keys, text in lines)


def test_the_menus_have_every_entry_once() -> None:
    in_menus = [name for menu in MENUS for name in menu.names()]
    with_entries = [name for name, each in OPERATORS.items() if each.entry]
    assert sorted(in_menus) == sorted(with_entries)


def test_script_keys_are_accepted_and_documented() -> None:
    page = pages()["script-file.md"]
    with_keys = {name: each.script for name, each in OPERATORS.items() if each.script is not None}
    assert list(StepRecord.model_fields) == list(with_keys)
    for name, key in with_keys.items():
        assert f"| `{name}` |" in page and key.meaning in page
    assert {"undo", "redo", "set", "select", "drag", "wait", "capture"} <= with_keys.keys()


def test_shortcuts_and_menus_are_documented() -> None:
    page = pages()["shortcuts.md"]
    for group in GROUPS:
        for keys, text in listed_lines(group):
            assert f"| `{keys}` | {text.replace('|', chr(92) + '|')} |" in page
    for operator in OPERATORS.values():
        assert not operator.entry or f"> {operator.entry} |" in page


def test_a_declaration_names_what_it_is_for() -> None:
    """An operator has at least one of keys, menu entry, script key, or is invoked by a control of a panel."""
    by_controls = {"rename_view", "play", "stop", "resume"}
    panels = "".join(path.read_text() for path in (Path(__file__).parents[3] / "ui" / "panels").glob("*.py"))
    for name, each in OPERATORS.items():
        assert each.keys or each.entry or each.script or (name in by_controls and f'RunOperator("{name}"' in panels)


def test_a_stage_is_opened_again_with_variants_of_its_sets(worked: Editor, client: FakeClient) -> None:
    why = run_operator(worked, "variant_set", VariantChoice(set="shape", variant="tall"))
    assert why == "only stages of USD have sets of variants"
    worked.history.document = replace(worked.document, source="/models/pot.usdz#shape=low,size=big#z-up")
    assert run_operator(worked, "variant_set", VariantChoice(set="shape", variant="tall")) is None
    (last, *_) = [each for each in reversed(client.requests) if isinstance(each, OpenScene)]
    assert last.source == "/models/pot.usdz#shape=tall,size=big#z-up"


def test_a_mesh_is_turned_and_turned_back_with_its_edits(worked: Editor, client: FakeClient) -> None:
    worked.history.document = replace(worked.document, source="/models/pot.stl")
    for value, source in ((None, "#z-up"), (True, "#z-up"), (False, "")):
        assert run_operator(worked, "z_up", value) is None
        assert next(r for r in client.requests[::-1] if isinstance(r, OpenScene)).source == "/models/pot.stl" + source
