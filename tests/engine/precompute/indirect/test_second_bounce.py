"""What glossy surfaces send on along remembered rays against sums over all directions there."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect import _ray_kernels as rays
from engine.precompute.indirect import _second_bounce_kernels as kernels
from engine.precompute.indirect._cache_kernels import NO_RECORD
from engine.precompute.indirect._light_choice_kernels import NO_LIGHT
from engine.precompute.indirect.indirect_layers import indirect_layer
from engine.precompute.indirect.reflection import HemisphereSamples
from engine.precompute.indirect.second_bounce import SecondBounceLight
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placed, placement_of, solve
from tests.naive.second import sent_back

SKY = np.array([1.0, 0.8, 0.6])
LAMP = {"name": "lamp", "primitive": "cube", "emission": [40.0, 20.0, 10.0], "transform": placed(0.3, 1.4, 0.4, 0.1)}
GLOSSY = make_layer(MODELS["rough_conductor"], {"alpha": 0.4})
LAYERS = [matt(0, 0.5), indirect_layer(1, GLOSSY, (128, 64)), matt(2, 0.7)]
N_LOOKED_AT = 1500


@dataclass(frozen=True)
class Found:
    """The floor's fans, what is sent along their recorded rays (n, 3, 3), and the light under which it is."""

    placement: Placement
    fans: HemisphereSamples
    light: SecondBounceLight
    sent: np.ndarray


@pytest.fixture(scope="module")
def found() -> Found:
    placement = placement_of([*CORNER, LAMP], **CORNER_VIEW, n=48)
    solved = solve(placement, LAYERS, 2, replace(QUICK, n_photons=0), constant_environment(tuple(SKY)))
    fans, light = solved.points.hemisphere_samples(0), solved.outgoing_radiance(LAYERS).glossy
    assert light is not None
    records, n_points = fans._second._records, len(fans)
    assert records.start[0] == 0  # the floor is the first object
    sent = np.zeros((int(records.start[-1]), 3, 3), np.float32)
    paths = fans._second.paths(light)._replace(area=np.zeros(n_points, np.float32))
    kernels.second_bounce_light(paths, 0, n_points, np.ones(4, bool), 0, sent)
    return Found(placement, fans, light, sent)


def ray_of(fans: HemisphereSamples, i: int, m: int) -> np.ndarray:
    """The direction of ray m of point i in the scene's frame."""
    each = fans._samples
    row = each.rows[i]
    eye = rays.local_wo(each.tangent[row], each.normal[row], each.wo[row])
    turn, cosine, sine = rays.pattern_rotation(row)
    tables, n = (each.tables_cosine, each.tables_lobe), each.tables_cosine.shape[1]
    table, k = (tables[0], m) if m < n else (tables[1], m - n)
    pattern = rays.pattern_of(np.uint64(turn), each.nth[i])
    local = rays.sample_direction(table[pattern], k, m < n, cosine, sine, each.lobe_axes[i], *eye)
    frame = np.stack([each.tangent[row], np.cross(each.normal[row], each.tangent[row]), each.normal[row]])
    return np.array(local) @ frame.astype(float)


def test_recorded_rays_bring_the_light_that_is_reflected_there(found: Found) -> None:
    records, patches = found.fans._second._records, found.placement.patches(12)
    point = np.searchsorted(records.start, np.arange(len(found.sent)), "right") - 1
    chosen = np.random.default_rng(1).choice(len(found.sent), N_LOOKED_AT, replace=False)
    expected = np.empty((N_LOOKED_AT, 2, 3))
    for k, e in enumerate(chosen):
        i = point[e]
        way = ray_of(found.fans, i, int(records.ray[e]))
        place = found.placement.hits.position[found.fans._samples.rows[i]] + records.distance[e] * way
        normal = records.normal[e].astype(float)
        assert abs(place[2] + 1.0) < 1e-3 and normal == pytest.approx([0.0, 0.0, 1.0])  # on the glossy wall
        expected[k] = sent_back(GLOSSY, place, normal, -way, found.placement.caster, SKY, patches)
    unit = found.light.all_lights.radiance[0] / SKY  # light is told in a unit of its own
    ours = found.sent[chosen, :2] / records.times[point[chosen]][:, None, None] / np.stack([unit, np.ones(3)])
    difference, whole = ours - expected, expected.mean(axis=0)
    noise = difference.std(axis=0) / np.sqrt(N_LOOKED_AT)
    # One sample a ray: the mean of many is the sum's, within their own noise, and that is small.
    assert (noise < [[0.04], [0.08]] * whole).all()
    assert (np.abs(difference.mean(axis=0)) < 3.0 * noise).all()


def test_light_beyond_is_added_number_by_number(found: Found) -> None:
    records, each, light = found.fans._second._records, found.fans._samples, found.light
    rng = np.random.default_rng(2)
    radiosity = rng.uniform(size=(2, len(light.objects), 3, 4)).astype(np.float32)
    # Some of what is beyond reflects a light by a gloss of its own.
    twice = (records.beyond[: len(found.sent)] != NO_RECORD) & (rng.random(len(found.sent)) < 0.5)
    light_3 = np.full(len(records.beyond), NO_LIGHT, np.uint16)
    light_3[: len(twice)][twice] = 0
    records = records._replace(light_3=light_3)
    sent = found.sent.copy()
    sent[twice, 2] = rng.uniform(size=(np.count_nonzero(twice), 3))
    inverse = np.array([2.0, 3.0, 4.0], np.float32)
    for edited in (1, 2):
        lit = np.empty((len(sent), 3, 4), np.float32)
        kernels.light_second_bounce(
            each, records, 0, len(found.fans), light.objects, sent, 0, True, radiosity, edited, inverse, lit
        )
        for i in range(0, len(found.fans), 5):
            for e in range(records.start[i], records.start[i + 1]):
                own = int(
                    light.objects[each.records[i, records.ray[e]]] == edited
                )  # what the edited object sends itself
                expected = np.zeros((3, 3))
                expected[own] = sent[e, 0] * inverse**own
                if records.beyond[e] != NO_RECORD:
                    expected += sent[e, 1] * radiosity[own, records.beyond[e], :, :3]
                if twice[e]:
                    power = own + int(light.objects[records.beyond[e]] == edited)
                    expected[power] += sent[e, 1] * sent[e, 2] * inverse**power
                np.testing.assert_allclose(lit[e, :, :3], expected, rtol=1e-5)
