"""As many lights as a picture needs: few under an even sky, all under a small bright one, and what a person says."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.project.project import Project, open_project
from engine.core.generators import run_to_end
from engine.planner import plan_scene
from engine.precompute.direct.pipeline import Placement, final_quality
from engine.render import light_pilot
from engine.render.light_pilot import LightBudget, find_light_budget
from engine.render.still import reflect_layers, still_layers
from engine.settings import RenderSettings
from tests.direct_rooms import gap_room
from tests.scene_text import LAMBERT, facing_up, ground, placed, scaled

POST = placed("post", "cube", scaled((0.3, 0.8, 0.3), (0, 0.4, 0)), LAMBERT)
LAMP = placed("lamp", "quad", facing_up(0.5, (-0.4, 1.2, -0.4)), "emission = [40, 30, 20]\n")


@pytest.fixture(autouse=True)
def every_picture_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(light_pilot, "PAYS_FROM", 1)


def needed(
    folder: Path, text: str, most: RenderSettings, is_still: bool = True
) -> tuple[LightBudget, Project, Placement]:
    (folder / "scene.toml").write_text(text)
    project = open_project(str(folder / "scene.toml"))
    placement = Placement(project.scene)
    return _tried(project, placement, most, is_still), project, placement


def _tried(project: Project, placement: Placement, most: RenderSettings, is_still: bool) -> LightBudget:
    return run_to_end(find_light_budget(placement, _layers(project), project.sky, most, is_still))


def _layers(project: Project):  # type: ignore[no-untyped-def]
    plan = plan_scene(project.scene, project.layers, has_sky=True, editable=project.editable)
    return still_layers(project.layers.items(), project.object_names, plan)


def picture(project: Project, placement: Placement, decisions: RenderSettings) -> np.ndarray:
    return run_to_end(reflect_layers(placement, _layers(project), project.sky, final_quality(decisions)))


def test_an_even_sky_needs_few_and_the_whole_picture_says_so(tmp_path: Path) -> None:
    most = RenderSettings(4000)
    need, project, placement = needed(tmp_path, ground((64, 48)) + POST, most)
    assert need.lights == 1000 and errors_of(need)["lights"] <= light_pilot.TOLERANCE
    assert need.limit_settings(most, True) == RenderSettings(1000, keeps_sphere=False)
    assert need.limit_settings(most) == RenderSettings(1000)
    assert not placement.sphere.done.any()  # its own shadows are not touched
    few, all_of_them = (
        picture(project, Placement(project.scene), each) for each in (need.limit_settings(most, True), most)
    )
    assert np.sqrt(np.mean((few - all_of_them) ** 2)) / all_of_them.mean() < 0.005
    assert need.reasons(most)["lights"].startswith("within 0.") and "4,000" in need.reasons(most)["lights"]


def test_gloss_that_can_be_edited_is_tried_sharper(tmp_path: Path) -> None:
    """Half as wide and three times as high it shows more of each light, so that fewer of them are further off."""
    (tmp_path / "scene.toml").write_text(ground((64, 48), gloss=True) + POST)
    project = open_project(str(tmp_path / "scene.toml"))
    placement, most, few = Placement(project.scene), RenderSettings(4000), RenderSettings(500)
    errors = {}
    for editable in (False, True):
        layers = tuple(replace(each, editable=editable) for each in _layers(project))
        trials = light_pilot._Trials(placement, layers, project.sky, False, 1)
        truth, trial = (run_to_end(trials.pictures(each)) for each in (most, few))
        errors[editable] = light_pilot.deviations(trial, truth)
    assert errors[False][0] == errors[False][1] == errors[True][0] < errors[True][1]


def test_patches_that_make_the_shadow_are_kept(tmp_path: Path) -> None:
    """The edge of a shadow near the lamp is as fine as its patches: with fewer the points on it change."""
    most = RenderSettings(4000, 768)
    need, _, _ = needed(tmp_path, ground((64, 48), radiance=(0, 0, 0)) + POST + LAMP, most)
    assert (need.patches < 768) == (errors_of(need)["patches"] <= light_pilot.TOLERANCE)
    assert need.lights == 500  # a black sky needs none at all


def test_what_the_user_has_set_stays(tmp_path: Path) -> None:
    most = RenderSettings(4000, overridden=frozenset({"lights"}))
    need, _, _ = needed(tmp_path, ground((64, 48)), most)
    assert need == LightBudget(4000, most.n_patches) and need.reasons(most) == {}


def test_small_pictures_are_not_tried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(light_pilot, "PAYS_FROM", 64 * 48 + 1)
    need, _, _ = needed(tmp_path, ground((64, 48)), RenderSettings(4000))
    assert need == LightBudget(4000, 768)


def errors_of(need: LightBudget) -> dict[str, float]:
    """How far the picture as it is would be off, by line."""
    return {line: plain for line, plain, _ in need.errors}


def test_the_reasons_name_what_fewer_would_cost() -> None:
    need = LightBudget(4000, 96, (("lights", 0.0112, 0.04), ("patches", 0.001, 0.001)))
    assert need.reasons(RenderSettings(4000, 768)) == {
        "lights": "2,000 would change the picture by 1.1 %", "patches": "within 0.1 % of what 768 show"
    }  # fmt: skip


def test_the_reasons_say_what_is_kept_for_sharper_highlights() -> None:
    """0.2 % is within the tolerance: it is the edit to come that wants them all."""
    (reason,) = LightBudget(4000, 768, (("lights", 0.002, 0.04),)).reasons(RenderSettings(4000, 768)).values()
    assert reason == (
        "2,000 are enough for the picture as it is, but have 4.0 % error once its highlights are sharpened"
    )


WALL = placed("wall", "cube", scaled((8, 8, 0.02), (0, 0, -1.2)), LAMBERT)
HIDDEN_LAMP = placed("lamp", "quad", scaled(0.5, (0, 0.6, -1.6)), "emission = [40, 30, 20]\n")


@pytest.mark.parametrize("radiance", [(0, 0, 0), (0.4, 0.5, 0.7)], ids=["dark", "under a sky"])
def test_a_lamp_that_no_point_sees_keeps_its_patches(tmp_path: Path, radiance: tuple[float, ...]) -> None:
    # All numbers of patches agree on nothing; that was taken for an error of 0, and 96 of 768 were kept.
    most = RenderSettings(4000, 768)
    need, _, _ = needed(tmp_path, ground((64, 48), radiance) + WALL + HIDDEN_LAMP, most)
    assert need.patches == 768
    assert need.reasons(most)["patches"] == "no sampled point is lit, though others may be"


def test_a_lamp_through_a_gap_keeps_its_patches(tmp_path: Path) -> None:
    most = RenderSettings(0, 768)
    project = open_project(str(gap_room(tmp_path, (64, 48))))
    need = _tried(project, Placement(project.scene), most, True)
    assert need.patches == 768 and errors_of(need)["patches"] > light_pilot.TOLERANCE


def test_pilots_leave_the_lamps_as_they_are_cut(tmp_path: Path) -> None:
    project = open_project(str(gap_room(tmp_path, (16, 12))))
    fresh, tried = Placement(project.scene), Placement(project.scene)
    _tried(project, tried, RenderSettings(0, 192), True)
    one, other = fresh.emitters(192), tried.emitters(192)
    assert one is not None and other is not None
    np.testing.assert_array_equal(one.corners, other.corners)


def test_where_there_cannot_be_fewer_nothing_is_tried(tmp_path: Path) -> None:
    need, _, _ = needed(tmp_path, ground((64, 48)) + POST + LAMP, RenderSettings(500, 96))
    assert need == LightBudget(500, 96)
