"""Whatever a hand does while rays are traced for edited materials: the picture of a fresh editor in the end."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.view_state import SetView
from app.modes.placement import sampling_controller
from app.modes.placement.placement_controller import PlacementController
from app.worker.cache import ArrayCache
from engine.precompute.indirect import edited_sampling, smoothing
from tests.quick_indirect import QUICK
from tests.ui.late_client import LateClient
from tests.ui.small_scene import write_small_scene
from tests.ui.test_any_sequence import COMMANDS, MAY_BE_TOLD, Walk, assert_as_fresh

pytestmark = pytest.mark.gl

NAMES = (
    "lift", "lift another curve", "reset", "roughness", "turn", "undo", "redo", "select θh", "select the ground",
    "select nothing", "take hold", "let go", "kill", "stop and go on", "a scene that is not there", "hide", "show",
)  # fmt: skip


@pytest.fixture(autouse=True)
def noisy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few rays, and little patience with noise."""
    monkeypatch.setattr("app.worker.indirect_tasks.FINE", replace(QUICK, n_rays=64, n_photons=1 << 10))
    monkeypatch.setattr(sampling_controller, "IDLE_SECONDS", 0.05)
    for module in (smoothing, edited_sampling):
        monkeypatch.setattr(module, "NOISY", 0.02)


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.sweep) for n in range(1, 40))])
def test_any_sequence_while_rays_are_traced(context: moderngl.Context, tmp_path: Path, seed: int) -> None:
    random, source = np.random.default_rng(seed), str(write_small_scene(tmp_path))
    here = Walk(context, source, LateClient(random, ArrayCache(tmp_path / "cache")), n_bounces=2)
    controller = here.editor.controller
    assert isinstance(controller, PlacementController)
    n_sampled, n_under_way = 0, 0
    try:
        here.client.hurries = True
        here.until(lambda: here.editor.scene_is_open)
        here.editor.do(SetView.of(n_bounces=2))
        here.settle()
        for name in map(str, random.choice(NAMES, 12)):
            COMMANDS[name](here)
            here.client.hurries = bool(random.random() < 0.7)
            for _ in range(int(random.choice([1, 20, 60]))):
                here.frames()
                n_under_way += here.editor.status.stage == sampling_controller.STAGE
                n_sampled += controller.idle.sampling.sampled is not None
        here.settle()
        here.until(lambda: not controller.indirect.lacks_rays)
        assert all(any(known in line for known in MAY_BE_TOLD) for line in here.told), here.told
        assert_as_fresh(context, here, tmp_path, bounces=2)
    finally:
        here.close()
    assert n_under_way and n_sampled
