"""Maps of parameters, whatever is done to them: in the end the picture of a fresh editor, which reads the same session.

As in `test_any_sequence`, the worker is the real one, on a small scene, and commands come between any two of its steps.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import moderngl
import numpy as np
import pytest
from PIL import Image

from app.document.commands.curves import AddOperator, ResetCurve
from app.document.commands.layers import SetFresnelTerm, SetModel, SetParameter, SetVisible
from app.document.commands.maps import SetParameterMap
from app.document.commands.plan import OverrideLine
from app.document.view_state import SetView
from app.worker.cache import ArrayCache
from tests.ui.late_client import LateClient
from tests.ui.small_scene import write_small_scene
from tests.ui.test_any_sequence import LIFT, TOLERANCE, Walk, fresh, relative_error, walk

pytestmark = pytest.mark.gl


def with_map(name: str, table: object) -> Callable[[Walk], object]:
    return lambda w: w.editor.do(SetParameterMap("ball.1", name, table))


COMMANDS: dict[str, Callable[[Walk], object]] = {
    "rough": with_map("alpha", "rough.png"),
    "rough, another range": with_map("alpha", {"map": "rough.png", "range": [0.2, 0.5]}),
    "rough, squared": with_map("alpha", {"map": "rough.png", "response": "square"}),
    "the same everywhere": with_map("alpha", None),
    "strong": with_map("scale", {"map": "rough.png", "range": [0.2, 1.0]}),
    "as strong everywhere": with_map("scale", ""),
    "no such map": with_map("eta", "nowhere.png"),
    "three nodes": lambda w: w.editor.do(OverrideLine("nodes", 3)),
    "nodes as planned": lambda w: w.editor.do(OverrideLine("nodes", None)),
    "lift": lambda w: w.editor.do(AddOperator("ball.1", "theta_h", LIFT)),
    "reset": lambda w: w.editor.do(ResetCurve("ball.1", "theta_h")),
    "eta": lambda w: w.editor.do(SetParameter("ball.1", "eta", 1.7)),
    "Fresnel term": lambda w: w.editor.do(SetFresnelTerm("ball.1", True)),
    "Cook-Torrance": lambda w: w.editor.do(SetModel("ball.1", "cook_torrance")),
    "hide": lambda w: w.editor.do(SetVisible("ball.1", False)),
    "show": lambda w: w.editor.do(SetVisible("ball.1", True)),
    "solo": lambda w: w.editor.do(SetView.of(solo="ball.1")),
    "together": lambda w: w.editor.do(SetView.of(solo=None)),
    "undo": lambda w: w.editor.undo(),
    "redo": lambda w: w.editor.redo(),
    "take hold": lambda w: w.editor.begin_drag(),
    "let go": lambda w: w.editor.end_drag(),
    "select θh": lambda w: w.editor.select("ball.1.theta_h"),
    "select the base": lambda w: w.editor.select("ball.0"),
    "compare": lambda w: w.editor.do(SetView.of(compare=w.editor.document)),
    "compare no more": lambda w: w.editor.do(SetView.of(compare=None)),
    "kill": lambda w: w.client.kill(),
    "stop and go on": lambda w: (w.editor.cancel_work(), w.editor.resume_work()),
}


@pytest.fixture
def source(tmp_path: Path) -> str:
    random = np.random.default_rng(4)
    Image.fromarray(random.integers(0, 256, (32, 64)).astype(np.uint8)).save(tmp_path / "rough.png")
    return str(write_small_scene(tmp_path))


def opened(context: moderngl.Context, source: str, tmp_path: Path) -> Walk:
    here = Walk(context, source, LateClient(np.random.default_rng(1), ArrayCache(tmp_path / "cache")), n_bounces=1)
    here.client.hurries = True
    here.until(lambda: here.editor.scene_is_open)
    return here


def test_a_map_is_one_row_with_nodes_behind_it(context: moderngl.Context, source: str, tmp_path: Path) -> None:
    here = opened(context, source, tmp_path)
    try:
        here.editor.do(SetView.of(precision="float"))
        plain = here.settle()
        here.editor.do(SetParameterMap("ball.1", "alpha", {"map": "rough.png", "range": [0.1, 0.6]}))
        mapped = here.settle()
        assert relative_error(mapped, plain) > 0.008
        # One layer in the document, several in the picture; the plan has them in one line.
        assert len(here.editor.document.object("ball").layers) == 2
        (count,) = here.editor.status.map_nodes
        assert count.path == "ball.1.alpha" and len(here.feed.source.renderer.layer_keys) == 2 + count.n_nodes
        # The curve of all nodes is drawn: another picture, and undo brings this one back, with one step.
        here.editor.select("ball.1.theta_h")
        here.editor.do(AddOperator("ball.1", "theta_h", LIFT))
        lifted = here.settle()
        assert relative_error(lifted, mapped) > 0.008
        assert relative_error(lifted, fresh(context, here, tmp_path)) < TOLERANCE
        here.editor.undo()
        assert relative_error(here.settle(), mapped) < TOLERANCE
        here.editor.undo()
        assert relative_error(here.settle(), plain) < TOLERANCE and not here.editor.status.map_nodes
        assert not here.told
    finally:
        here.close()


def test_an_image_that_cannot_be_read_is_taken_back(context: moderngl.Context, source: str, tmp_path: Path) -> None:
    here = opened(context, source, tmp_path)
    try:
        here.editor.do(SetParameterMap("ball.1", "alpha", "nowhere.png"))
        here.settle()
        assert any("nowhere.png" in line for line in here.told)
        assert not here.editor.document.layer("ball.1").parameter_maps and here.editor.undo_label is None
    finally:
        here.close()


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.sweep) for seed in range(1, 20))])
def test_any_sequence_ends_with_the_right_picture(
    context: moderngl.Context, source: str, tmp_path: Path, seed: int
) -> None:
    walk(context, source, tmp_path, seed, 20, 1, COMMANDS)
