"""The same document has the same picture, whatever was there before it: edits, lines of the plan, a cache.

Placement's real worker on a small scene; every walk is undone to where it began and held to a fresh editor without a
cache, bit by bit, but for light of further bounces. What a line of the plan asked for and an undone edit left behind,
such as shadows of all directions, must not show.
"""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.commands.layers import SetParameter
from app.document.commands.light import SetRotation
from app.document.commands.plan import override_from_value
from app.worker.cache import ArrayCache
from tests.ui.late_client import LateClient
from tests.ui.small_scene import write_small_scene
from tests.ui.test_any_sequence import Walk, fresh, relative_error

pytestmark = pytest.mark.gl

LINES = {
    "lights": (60, 200, 500, 2000, "auto"), "patches": (30, 200, 800), "sphere": (0, 1), "bounces": (1, 2),
    "precision": ("half", "float"), "edges": (0, 4),
}  # fmt: skip


@pytest.fixture
def source(tmp_path: Path) -> str:
    return str(write_small_scene(tmp_path))


def begun(context: moderngl.Context, source: str, tmp_path: Path, seed: int) -> Walk:
    """With few lights, whose shadows alone are traced."""
    store = ArrayCache(tmp_path / "cache")
    here = Walk(context, source, LateClient(np.random.default_rng(seed), store), n_bounces=1)
    here.client.hurries = True
    here.until(lambda: here.editor.scene_is_open)
    assert here.editor.do(override_from_value("lights", 60)) is None
    return here


def undone(here: Walk, n_steps: int) -> np.ndarray:
    """The picture after so many steps of its history are left."""
    while len(here.editor.history.undo_steps) > n_steps:
        here.editor.undo()
    return here.settle()


def test_lights_that_were_asked_for_and_undone_leave_nothing(
    context: moderngl.Context, source: str, tmp_path: Path
) -> None:
    here = begun(context, source, tmp_path, 0)
    try:
        first = here.settle().copy()
        assert here.editor.do(override_from_value("lights", 500)) is None  # which finds the shadows of all directions
        assert np.abs(here.settle() - first).max() > 0.0
        np.testing.assert_array_equal(undone(here, 1), first)
        np.testing.assert_array_equal(fresh(context, here, tmp_path), first)
        # A new window on the same cache, which has those shadows.
        (tmp_path / "again").mkdir()
        (tmp_path / "cache").rename(tmp_path / "again" / "empty")
        np.testing.assert_array_equal(fresh(context, here, tmp_path / "again"), first)
    finally:
        here.close()


def edit(here: Walk, random: np.random.Generator) -> None:
    """Any edit, now and then before the one before it is computed."""
    kind = random.integers(0, 4)
    if kind < 2:
        line = str(random.choice(sorted(LINES)))
        values = LINES[line]
        assert here.editor.do(override_from_value(line, values[int(random.integers(0, len(values)))])) is None
    elif kind == 2:
        here.editor.begin_drag()
        for _ in range(3):
            here.editor.do(SetRotation(here.editor.document.light.rotation + 7.0))
            here.frames(int(random.integers(1, 30)))
        here.editor.end_drag()
    else:
        here.editor.do(SetParameter("ball.1", "alpha", float(random.uniform(0.1, 0.5))))
    here.frames(int(random.choice([0, 5, 60, 400])))


@pytest.mark.parametrize("seed", [2, *(pytest.param(seed, marks=pytest.mark.sweep) for seed in range(3, 43))])
def test_a_walk_with_lines_of_the_plan_and_back(
    context: moderngl.Context, source: str, tmp_path: Path, seed: int
) -> None:
    random = np.random.default_rng(seed)
    here = begun(context, source, tmp_path, seed)
    try:
        n_steps = len(here.editor.history.undo_steps)
        first = here.settle().copy()
        for _ in range(4 if seed == 2 else 10):
            edit(here, random)
        shown = here.settle().copy()
        expected = fresh(context, here, tmp_path)
        if dict(here.editor.document.overrides).get("bounces", 1) == 1:
            np.testing.assert_array_equal(expected, shown)
        else:  # where light between surfaces is found finest hangs on the curves that it was found under: noise
            assert relative_error(shown, expected) < 0.005
        np.testing.assert_array_equal(undone(here, n_steps), first)
    finally:
        here.close()
