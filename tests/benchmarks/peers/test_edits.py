"""The script of edits: the same every time, with the kinds it names, and undo that returns to where a drag began."""

from __future__ import annotations

from collections import Counter

import pytest

from benchmarks.peers.edits import REST_SECONDS, STEP_SECONDS, Parameter, Script, script_of
from benchmarks.peers.scenes import CASES

DRAGGED = Parameter("ball", 1, "alpha", 0.1)
PAINT = Parameter("floor", 0, "albedo", (0.5, 0.5, 0.5))
JUMPS = ((PAINT, (0.1, 0.2, 0.3)), (DRAGGED, 0.4), (Parameter("wall", 1, "alpha", 0.3), 0.05))


def script(seed: int = 9) -> Script:
    return script_of(DRAGGED, 0.3, JUMPS, seed)


def test_a_script_is_the_same_every_time() -> None:
    assert script() == script()
    assert script().edits != script(10).edits


def test_the_scripts_have_fifty_edits_of_all_kinds_and_few_states() -> None:
    assert sum(len(case.script.edits) for case in CASES) == 50
    for case in CASES:
        kinds = Counter(edit.kind for edit in case.script.edits)
        assert kinds == {"drag": 12, "release": 3, "jump": 5, "undo": 5}
        assert len(case.script.states) == 9


def test_a_drag_goes_one_way_in_small_steps_and_ends_where_it_should() -> None:
    steps = script().edits[:5]
    values = [0.1, *(step.value for step in steps)]
    assert values == sorted(values) and values[-1] == 0.3
    assert all(0.01 < b - a < 0.08 for a, b in zip(values, values[1:], strict=False))
    assert [step.horizon_s for step in steps] == [STEP_SECONDS] * 4 + [REST_SECONDS]


@pytest.mark.parametrize("made", [script(), *(case.script for case in CASES)])
def test_each_edit_leads_to_its_state_and_undo_back(made: Script) -> None:
    state = made.states[0]
    assert state == tuple(each.value for each in made.parameters)
    before = {}
    for edit in made.edits:
        if edit.kind in ("jump", "drag"):
            before.setdefault("state", state)
        changed = made.states[edit.state]
        place = made.parameters.index(edit.parameter)
        assert changed == (*state[:place], edit.value, *state[place + 1 :])
        if edit.kind == "undo":
            assert changed == before.pop("state")
        elif edit.kind == "release" and changed == made.states[0]:
            before.clear()  # dragged back: nothing is taken back after it
        state = changed
    visited = [edit.state for edit in made.edits if edit.kind != "drag"]
    assert len(visited) - len(set(visited)) >= 5  # states that come again, for what flickers
