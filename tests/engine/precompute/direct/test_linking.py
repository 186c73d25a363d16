"""Light linking: each object is lit by the lights that reach it, in direct and indirect light and in path tracing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import insitu
from app.project.project import Project, open_project
from engine.core.generators import run_to_end
from engine.light.environment import constant_environment
from engine.material.layer import object_of
from engine.precompute.direct.linking import emitter_reach, light_groups, object_groups
from engine.precompute.direct.pipeline import LightLink, Placement, SkyState
from engine.precompute.indirect.sampling_settings import FINE, BounceSeries
from engine.reference.path_tracer import trace_paths
from engine.render.still import StillLayer, by_object, indirect_radiance, reflect_layers, render_reference
from tests.few_points import use_few_points
from tests.scene_text import camera, environment, facing_down, facing_up, material, placed

HALF = material('model = "lambert", albedo = 0.5')
GLOSSY = material('model = "rough_conductor", alpha = 0.3')
# Two cards side by side, which cannot see each other, under a sky and a lamp that both of them see.
CARDS = (
    camera((0, 4, 0.01), 40, (24, 16))
    + environment((0.4, 0.5, 0.6))
    + placed("left", "quad", facing_up(1, (-0.8, 0, 0)), HALF)
    + placed("right", "quad", facing_up(1, (0.8, 0, 0)), HALF)
    + placed("lamp", "quad", facing_down(0.5, (0, 1.5, -1.5)), "emission = [30.0, 20.0, 10.0]\n")
)
# A glossy ball over a floor, a wall beside them, a sky, a sun and a lamp.
ROOM = (
    camera((0, 2, 4), 35, (24, 16))
    + "[environment]\nradiance = [0.2, 0.3, 0.4]\n"
    + "sun = [{ name = 'Noon', direction = [0.3, 1, 0.2], irradiance = 1, diameter = 20 }]\n"
    + placed("ball", "sphere", "1,0,0,0, 0,1,0,0.5, 0,0,1,0, 0,0,0,1", GLOSSY)
    + placed("floor", "quad", facing_up(4), HALF)
    + placed("wall", "quad", "4,0,0,0, 0,4,0,2, 0,0,4,-1.5, 0,0,0,1", HALF)
    + placed("lamp", "quad", facing_down(0.8, (0.5, 2.5, 0.5)), "emission = [6.0, 5.0, 4.0]\n")
)
EXCLUDED = {"lamp": ["floor"], "light.Noon": ["ball", "wall"], "light.environment": ["wall"]}
LINKS = {f"{light}.excludes": names for light, names in EXCLUDED.items()}


def opened(folder: Path, text: str, **values: object) -> Project:
    (folder / "scene.toml").write_text(text)
    return open_project(str(folder / "scene.toml"), values=[(k.replace("__", "."), v) for k, v in values.items()])


def layers_of(project: Project) -> list[StillLayer]:
    names = project.object_names
    return [
        StillLayer(names.index(object_of(key)), layer, (16, 1) if layer.model.is_diffuse else (64, 16), False)
        for key, layer in project.layers.items()
    ]


def direct(project: Project) -> NDArray[np.float64]:
    """Radiance (P, 3) of direct light."""
    return run_to_end(reflect_layers(Placement(project.scene), layers_of(project), project.sky))


def test_groups_part_the_objects() -> None:
    white, black = SkyState(constant_environment(1.0)), SkyState(None)
    assert [each[0].tolist() for each in object_groups(white, 3)] == [[True] * 3]
    links = LightLink(frozenset({0, 2}), black), LightLink(frozenset({1}), white, frozenset({2}))
    sky = SkyState(white.environment, links=links)
    groups = object_groups(sky, 4)
    assert np.sum([each[0] for each in groups], axis=0).tolist() == [1, 1, 1, 1]
    assert [each[1].environment for each in groups] == [white.environment, None, white.environment]
    assert groups[2][2].tolist() == [True, True, False, True]
    assert emitter_reach(sky, 4).sum() == 15 and not emitter_reach(sky, 4)[2, 1]
    # Where a link has every object there is no other group.
    assert len(object_groups(SkyState(None, links=(LightLink(frozenset({0, 1}), white),)), 2)) == 1


def test_what_nothing_excludes_is_lit_as_it_was(tmp_path: Path) -> None:
    project = opened(tmp_path, CARDS)
    placement = Placement(project.scene)
    (group,) = light_groups(placement, project.sky)
    assert group.placement is placement and group.sky is project.sky and group.objects.all()


def test_a_card_without_its_lamp_reflects_the_sky_alone(tmp_path: Path) -> None:
    """A card of albedo 1/2 under an even sky L, of which the lamp's back hides 2 % at most, reflects L / 2."""
    linked, plain = opened(tmp_path, CARDS, lamp__excludes=["left"]), opened(tmp_path, CARDS)
    hits, found, whole = Placement(linked.scene).hits, direct(linked), direct(plain)
    left, right = (hits.objects == linked.object_names.index(name) for name in ("left", "right"))
    np.testing.assert_allclose(found[left], np.broadcast_to([0.2, 0.25, 0.3], found[left].shape), rtol=0.03)
    # The other card is lit by the very same lights, to the bit.
    np.testing.assert_array_equal(found[right], whole[right])
    assert (found[left, 0] < 0.9 * whole[left, 0]).all()  # red, which the lamp has most of


def test_a_card_without_its_sky_is_black_beside_its_lamp(tmp_path: Path) -> None:
    off = opened(tmp_path, CARDS, light__environment__excludes=["left", "right"], lamp__excludes=["right"])
    lamp = opened(tmp_path, CARDS, light__environment__on=False)
    hits, found = Placement(off.scene).hits, direct(off)
    left, right = (hits.objects == off.object_names.index(name) for name in ("left", "right"))
    assert not found[right].any()
    np.testing.assert_allclose(found[left], direct(lamp)[left], rtol=1e-6)


def naive_linked(folder: Path, text: str, lights: dict[str, list[str]]) -> NDArray[np.float64]:
    """The definition: the sum over lights of the picture of each alone, 0 on objects that it excludes."""
    total = None
    for light, excluded in lights.items():
        alone = opened(folder, text, **{f"{light}.solo": True})
        hits, found = Placement(alone.scene).hits, direct(alone)
        unlit = [alone.object_names.index(name) for name in excluded]
        found[np.isin(hits.objects, unlit)] = 0.0
        total = found if total is None else total + found
    assert total is not None
    return total


def test_direct_light_is_the_sum_of_single_lights_that_reach_each_object(tmp_path: Path) -> None:
    linked = opened(tmp_path, ROOM, **LINKS)
    found, expected = direct(linked), naive_linked(tmp_path, ROOM, EXCLUDED)
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.01 * expected.mean()


def test_path_tracing_and_the_direct_oracle_agree(tmp_path: Path) -> None:
    linked = opened(tmp_path, ROOM, **LINKS)
    placement, layers = Placement(linked.scene), layers_of(linked)
    rows = np.arange(0, len(placement.hits.pixel), 5)
    traced = run_to_end(trace_paths(placement, by_object(layers), linked.sky, 1, 1024, rows=rows)).radiance
    found = direct(linked)[rows]
    names = linked.object_names
    for name in ("ball", "floor", "wall"):
        mine = placement.hits.objects[rows] == names.index(name)
        assert found[mine].mean() == pytest.approx(traced[mine].mean(), rel=0.02), name
    brute = run_to_end(render_reference(placement, by_object(layers), linked.sky, 256, 5))
    # 20,480 directions of the sky and 256 patches resolve these lights to a per cent.
    still = run_to_end(reflect_layers(placement, layers, linked.sky))
    assert brute[placement.hits.open_image == 0.0].mean() == pytest.approx(still.mean(), rel=0.05)


def test_indirect_light_follows_the_links_of_the_surfaces_that_send_it(tmp_path: Path) -> None:
    """Two bounces, diffuse, glossy and of photons, against path tracing, within three standard errors and 3 %. Without
    links the floor would have more than three times as much."""
    linked = opened(tmp_path, ROOM, **LINKS)
    placement, layers = Placement(linked.scene), layers_of(linked)
    found = run_to_end(indirect_radiance(placement, layers, linked.sky, BounceSeries(3), FINE))

    def traced(n_bounces: int, seed: int) -> NDArray[np.float64]:
        return run_to_end(trace_paths(placement, by_object(layers), linked.sky, n_bounces, 100, seed=seed)).radiance

    truths = [traced(3, seed) - traced(1, seed) for seed in range(4)]
    for name in ("ball", "floor", "wall"):
        mine = placement.hits.objects == linked.object_names.index(name)
        means = [truth[mine].mean() for truth in truths]
        error = np.std(means, ddof=1) / 2 + 0.01 * np.mean(means)
        assert abs(found[mine].mean() - np.mean(means)) < 3 * error, name


def test_an_object_that_nothing_lights_still_mirrors_and_gathers(tmp_path: Path) -> None:
    """Excluded from all lights, the floor has no direct light, but light of the wall and the ball."""
    none = {f"{light}.excludes": ["floor"] for light in ("lamp", "light.Noon", "light.environment")}
    linked = opened(tmp_path, ROOM, **none)
    placement, layers = Placement(linked.scene), layers_of(linked)
    floor = placement.hits.objects == linked.object_names.index("floor")
    assert not direct(linked)[floor].any()
    found = run_to_end(indirect_radiance(placement, layers, linked.sky, BounceSeries(2), FINE))
    assert (found[floor] > 0.0).any()


@pytest.mark.parametrize("text", [CARDS, ROOM])
def test_orbit_lights_objects_as_placement_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    """Direct light of whole objects, within what few points resolve; what is excluded changes far more than that."""
    use_few_points(monkeypatch)
    (tmp_path / "scene.toml").write_text(text)
    scene = insitu.open(str(tmp_path / "scene.toml"))
    plain = np.asarray(scene.image("placement", bounces=1), np.float64)
    scene["lamp"].excludes = [name for name in ("left", "floor") if name in list(scene)]
    scene.light["environment"].excludes = [name for name in ("right", "wall") if name in list(scene)]
    exact = np.asarray(scene.image("placement", bounces=1), np.float64)
    drawn = np.asarray(scene.image("orbit", bounces=1), np.float64)
    error, change = (np.sqrt(np.mean((each - exact) ** 2)) for each in (drawn, plain))
    assert error < 0.2 * change
