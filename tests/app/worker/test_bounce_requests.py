"""What a mode's engine is told of bounces: each request says it, also one that leaves their number to the scene."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.document.described import document_from_description
from app.document.scene_state import scene_state
from app.modes.deform.deform_messages import PrepareDeform
from app.modes.orbit.orbit_messages import PrepareOrbit
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.scene.scene_loader import load_scene
from tests.app.worker.small_modes import SCENE, SIZE
from tests.opened import open_in_process, run_in_process
from tests.ui.test_any_deform_sequence import NamedDeform
from tests.ui.test_any_orbit_sequence import NamedOrbit


@pytest.mark.parametrize("mode", ["orbit", "deform"])
def test_a_number_of_bounces_that_is_undone_leaves_nothing(
    tmp_path: Path, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The engine kept the number that a line of the plan had set, once nobody set one any more."""
    source, told = tmp_path / "scene.toml", []
    source.write_text(SCENE)
    for package, engine, stand_in in (
        ("triple_product", "orbit_engine.Orbit", NamedOrbit),
        ("zonal_harmonics", "deform_engine.Deform", NamedDeform),
    ):
        monkeypatch.setattr(f"engine.realtime.{package}.{engine}", stand_in)
        monkeypatch.setattr(stand_in, "set_bounces", lambda self, n_bounces: told.append(n_bounces))
    scene = load_scene(source, SIZE)
    state = scene_state(document_from_description(str(source), scene.description))
    prepare = PrepareOrbit if mode == "orbit" else PrepareDeform
    tasks = RequestDispatcher(ArrayCache(tmp_path / "cache"))
    open_in_process(tasks, str(source))
    for n_bounces in (2, 0):
        run_in_process(tasks, prepare(state, n_bounces))
    assert told == [2, 0]
