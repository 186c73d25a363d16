"""What is shared among threads comes out the same, to the last bit, on any number of them."""

import contextlib
import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.core import threads
from engine.core.generators import run_to_end
from engine.core.threads import OrderedSection, run_in_order
from engine.light.environment import Environment, triangle_integrals
from engine.light.probe_mappings import to_latlong
from engine.material import MODELS, make_layer
from engine.precompute.direct.pipeline import PREVIEW, SkyState
from engine.precompute.indirect.indirect_layers import indirect_layer
from engine.reference.path_tracer import trace_paths
from engine.render.still import StillLayer, render_reference, render_still
from engine.sphere.geodesic import locate
from tests.engine.precompute.indirect.small_scenes import QUICK, matt, placed, placement_of, solve

OBJECTS = [
    {"name": "floor", "primitive": "quad", "transform": [4, 0, 0, 0, 0, 0, 4, 0, 0, -4, 0, 0, 0, 0, 0, 1]},
    {"name": "ball", "primitive": "sphere", "smooth": True, "transform": placed(0, 0.4, 0, 0.8)},
    {"name": "lamp", "primitive": "cube", "emission": [20.0] * 3, "transform": placed(1.1, 1.2, 0.0, 0.3)},
]
VIEW = {"eye": (0.6, 2.2, 2.2), "target": (0.4, 0.0, 0.0), "n": 40}
PAINT, GOLD = (
    make_layer(MODELS["lambert"], {"albedo": [0.7] * 3}),
    make_layer(MODELS["rough_conductor"], {"alpha": 0.3}),
)
RADIANCE = np.random.default_rng(4).uniform(0.0, 2.0, (16, 32, 3)).astype(np.float32)
SKY = Environment(RADIANCE, "test")


def direct() -> NDArray[np.float32]:
    layers = [StillLayer(0, PAINT, (16, 1), False), StillLayer(1, GOLD, (32, 8), False)]
    return run_to_end(render_still(placement_of(OBJECTS, **VIEW), layers, SkyState(SKY), PREVIEW), lambda step: None)


def indirect() -> NDArray[np.float32]:
    """Photons, rays and what goes between the cells."""
    layers = [matt(0, 0.7), indirect_layer(1, GOLD, (16, 4))]
    fineness = replace(QUICK, n_photons=1 << 13)
    return solve(placement_of(OBJECTS, **VIEW), layers, 3, fineness, SKY).picture(layers)


def paths() -> NDArray[np.float32]:
    materials = {0: [PAINT], 1: [GOLD]}
    placement = placement_of(OBJECTS, **VIEW | {"n": 130})  # more points than one thread takes at a time
    return run_to_end(trace_paths(placement, materials, SkyState(SKY), 2, 4), lambda step: None).radiance


def brute_force() -> NDArray[np.float32]:
    materials = {0: [PAINT], 1: [GOLD]}
    steps = render_reference(placement_of(OBJECTS, **VIEW), materials, SkyState(SKY), 16, 2)
    return run_to_end(steps, lambda step: None)


def light_of_triangles() -> NDArray[np.float64]:
    return triangle_integrals(SKY, 0.3, 4)


def places_on_the_sphere() -> NDArray[np.int32]:
    return locate(np.random.default_rng(2).normal(size=(40_000, 3)), 5)


def angular_map() -> NDArray[np.float32]:
    return to_latlong(np.random.default_rng(3).uniform(size=(33, 33, 3)).astype(np.float32), "angular")


FOUND = (direct, indirect, paths, brute_force, light_of_triangles, places_on_the_sphere, angular_map)


@pytest.mark.parametrize("find", FOUND)
def test_results_do_not_depend_on_the_number_of_threads(
    find: Callable[[], NDArray], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = []
    for n in (1, 2, 5):
        monkeypatch.setattr(threads, "n_cores", lambda n=n: n)
        assert threads.n_threads() == n
        found.append(find())
    assert np.isfinite(found[0]).all() and len(np.unique(found[0])) > 10
    for other in found[1:]:
        np.testing.assert_array_equal(other, found[0])


def test_all_cores_are_used_by_default() -> None:
    assert threads.n_threads() == threads.n_cores() >= 1
    assert threads.on_threads(lambda a, b: a + b, range(5), range(5)) == [0, 2, 4, 6, 8]


def test_work_may_share_work_of_its_own() -> None:
    # As the first look at a level of the sphere does, wherever that is asked for: nobody waits for himself.
    def sums(i: int) -> int:
        return sum(threads.on_threads(lambda j: i * j, range(4)))

    assert threads.on_threads(sums, range(3 * threads.n_threads())) == [6 * i for i in range(3 * threads.n_threads())]


def test_what_fails_is_raised_when_all_others_are_done() -> None:
    done = []

    def fail(i: int) -> None:
        done.append(i)
        if i == 1:
            raise ValueError("the second")

    with pytest.raises(ValueError, match="the second"):
        threads.on_threads(fail, range(5))
    assert sorted(done) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("count", [0, 1, 3, 100])
def test_parts_are_all_of_it_once(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "n_cores", lambda: 4)
    begins, ends = threads.even_parts(count)
    assert [i for a, b in zip(begins, ends, strict=True) for i in range(a, b)] == list(range(count))


class Failed(Exception):
    """The end of an item."""


def test_turns_come_in_order_whoever_is_first() -> None:
    log: list[tuple[int, int]] = []

    def work(item: int, turn: OrderedSection) -> int:
        for stage in (0, 1):
            time.sleep(0.002 * (item % 2 == 0))  # the first of two is the later one
            with turn:
                log.append((stage, item))
        return -item

    assert list(run_in_order(work, range(5), 2)) == [0, -1, -2, -3, -4]
    assert log == [(0, 0), (0, 1), (1, 0), (1, 1), (0, 2), (0, 3), (1, 2), (1, 3), (0, 4), (1, 4)]


def test_the_next_items_begin_while_one_is_late() -> None:
    begun = [threading.Event() for _ in range(4)]

    def work(item: int, turn: OrderedSection) -> bool:
        begun[item].set()
        with turn:
            pass
        return item > 0 or begun[2].wait(10.0)  # the first item is late until the third one is under way

    assert all(run_in_order(work, range(4), 1))


def test_a_turn_that_is_not_taken_does_not_let_others_overtake() -> None:
    log: list[tuple[int, int]] = []

    def work(item: int, turn: OrderedSection) -> None:
        for stage in (0, 1)[: 2 - item % 2]:  # every other item has one stage
            time.sleep(0.002 * (item % 2 == 0))
            with turn:
                log.append((stage, item))

    list(run_in_order(work, range(6), 2))
    assert log == [(0, 0), (0, 1), (1, 0), (0, 2), (0, 3), (1, 2), (0, 4), (0, 5), (1, 4)]


def test_mapping_ahead_keeps_the_order_and_a_bounded_number_under_way() -> None:
    begun = list[int]()
    with threads.pool(2) as shared:
        results = threads.map_ahead(shared, lambda i: begun.append(i) or i * i, range(20), 4)
        found = []
        for result in results:
            found.append(result)
            assert len(begun) <= len(found) + 3  # the one that was asked for, and those that are ahead
    assert found == [i * i for i in range(20)] and sorted(begun) == list(range(20))


def test_nobody_waits_for_one_that_failed() -> None:
    def work(item: int, turn: OrderedSection) -> None:
        if item == 0:
            raise Failed
        with turn:
            pass

    with pytest.raises(Failed):
        list(run_in_order(work, range(2), 1))
    assert not any("ThreadPool" in thread.name for thread in threading.enumerate())


@pytest.mark.parametrize("last", range(7))
@pytest.mark.parametrize("fails", [True, False])
def test_no_item_waits_for_one_that_never_began(last: int, fails: bool) -> None:
    def work(item: int, turn: OrderedSection) -> int:
        if fails and item == last:
            raise Failed
        for _ in range(2):
            with turn:
                pass
        return item

    def consume() -> None:
        with contextlib.suppress(Failed), contextlib.closing(run_in_order(work, range(8), 2)) as results:
            for result in results:
                if result == last:
                    break  # the consumer stops

    consumer = threading.Thread(target=consume, daemon=True)
    consumer.start()
    consumer.join(20.0)
    assert not consumer.is_alive()
