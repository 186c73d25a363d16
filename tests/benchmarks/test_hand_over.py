"""The change where Placement takes over: nothing changes where there is nothing to see, and a scene is measured."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks import hand_over
from benchmarks.hand_over import CASES, Case, measure
from engine.realtime.zonal_harmonics.pose import Deformation
from tests.few_points import use_few_points
from tests.scene_text import LAMBERT, camera, environment, facing_up, placed, scaled


def test_cases_say_what_they_are_of() -> None:
    assert [each.name for each in CASES] == [
        *("room, 1 bounce", "room, 4 bounces", "storeroom, 1 bounce", "storeroom, 4 bounces"),
        *("mime", "mime, 0.4 s", "bat, 0.4 s", "teatray, bent"),
    ]


def test_the_worst_block_is_found() -> None:
    off = np.zeros((20, 32))
    off[8:16, 16:24] = 4.0
    assert hand_over._worst_block(off) == 4.0
    assert hand_over._worst_block(off, 16) == 1.0  # a quarter of it


@pytest.mark.parametrize("mode", ["orbit", "deform"])
def test_a_matt_scene_hardly_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str) -> None:
    file = tmp_path / "scene.toml"
    matt = placed("ball", "sphere", scaled(0.8, (0, 0.4, 0)), LAMBERT) + placed("floor", "quad", facing_up(4), LAMBERT)
    file.write_text(camera((0, 1, 3), 40, (32, 24)) + environment() + matt)
    use_few_points(monkeypatch)
    poses = (("ball", (Deformation("bend", 10.0),)),) if mode == "deform" else ()
    found = measure(Case(str(file), mode, 0.0, poses), 32)
    assert found.mean < 4.0 and set(found.objects) == {"ball", "floor"}
    assert found.mean <= found.worst
