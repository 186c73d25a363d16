"""Painted lights that are dragged over a scene that was made ready: the picture follows by rows, without a jump."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from app.document.light_state import LightState
from app.messages.worker_messages import RequestFailed
from app.modes.placement.desired_state import DesiredTransport
from app.modes.placement.placement_messages import PrepareRelighting
from engine.light.painted_lights import PaintedLight
from engine.render.picture_difference import errors
from tests.app.worker.test_relighting import SCENE, asked, opened, pictures
from tests.opened import run_in_process

KEY = PaintedLight("key", azimuth=50.0, elevation=50.0, width=40.0, height=40.0, radiance=(8.0, 8.0, 6.0))
EVEN = SCENE.replace('file = "sky.exr"', "radiance = [0.3, 0.3, 0.3]")


def lit(key: PaintedLight, **changes: object) -> LightState:
    return replace(LightState(painted=(key,)), **changes)  # type: ignore[arg-type]


def test_a_dragged_light_is_followed_by_rows_and_begins_without_a_jump(tmp_path: Path) -> None:
    tasks = opened(tmp_path, EVEN)
    resting = asked(lit(KEY))
    final = pictures(run_in_process(tasks, resting), "final")
    run_in_process(tasks, PrepareRelighting(resting.scene))
    begun = pictures(run_in_process(tasks, asked(lit(KEY), 0)), "relit")
    moved = lit(replace(KEY, azimuth=-20.0, width=60.0))
    found = pictures(run_in_process(tasks, asked(moved, 0)), "relit")
    truth = pictures(run_in_process(tasks, asked(moved)), "final")
    assert set(found) == set(truth)
    for key, picture in truth.items():
        np.testing.assert_allclose(begun[key], final[key], rtol=1e-4, atol=1e-5 * final[key].max())
        off = errors(found[key], picture).rmse
        assert off < 0.08 and errors(final[key], picture).rmse > 3 * off


def test_moves_of_painted_lights_and_of_the_map_are_drags_others_are_not() -> None:
    before = DesiredTransport(lit(KEY), ())
    for light in (
        lit(replace(KEY, azimuth=3.0)), lit(KEY, tilt=5.0), lit(KEY, hue=5.0), lit(KEY, contrast=2.0),
        lit(KEY, clamp=1.0), LightState(), lit(KEY, rotation=5.0),
    ):  # fmt: skip
        assert DesiredTransport(light, ()).moved_from(before)
    assert not DesiredTransport(lit(KEY, environment="studio"), ()).moved_from(before)
    assert not before.moved_from(before)


def test_an_image_that_is_gone_is_one_line_and_the_worker_goes_on(tmp_path: Path) -> None:
    tasks = opened(tmp_path, EVEN)
    card = PaintedLight("card", "image", "cover", file=str(tmp_path / "gone.png"))
    failed = [each for each in run_in_process(tasks, asked(lit(card))) if isinstance(each, RequestFailed)]
    assert len(failed) == 1 and "gone.png" in failed[0].line and "\n" not in failed[0].line
    assert pictures(run_in_process(tasks, asked(lit(KEY))), "final")
