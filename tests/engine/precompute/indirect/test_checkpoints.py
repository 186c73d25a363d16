"""An interrupted search for indirect light goes on where it was, and finds the same to the last bit."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.core.generators import run_to_end
from engine.core.stored_arrays import UnsoundArrays
from engine.light.environment import constant_environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.precompute.indirect import attempt, cell_size, ray_budget, smoothing
from engine.precompute.indirect import irradiance_cache as cells_module
from engine.precompute.indirect.checkpoints import NAMES, Arrays, CheckpointStore, arrays_of
from engine.precompute.indirect.indirect_layers import IndirectLayer, indirect_layer
from engine.precompute.indirect.ray_budget import LEVELS
from engine.precompute.indirect.solver import Solver, relit
from tests.engine.forging import forged_numbers, forged_shapes
from tests.engine.precompute.indirect.small_scenes import CORNER, CORNER_VIEW, QUICK, matt, placed, placement_of

FINENESS = replace(
    QUICK, n_rays=64, max_extra_sets=0.5, n_cache_records=300, n_record_rays=32, n_samples=32, n_photons=1 << 10
)
MODELS_OF = {0: ["lambert"], 1: ["rough_conductor"], 2: ["lambert"]}
LAMP = {"name": "lamp", "primitive": "cube", "emission": [30.0] * 3, "transform": placed(0.3, 1.5, 0.3, 0.2)}


POINTS = 48


class Killed(Exception):
    """The end of a run."""


class Memory:
    """Parts by index; the `lives`-th that is kept is the last thing that happens."""

    def __init__(self, lives: int = -1) -> None:
        self.parts: dict[int, Mapping[str, NDArray[np.generic]]] = {}
        self.lives, self.read = lives, 0

    def load(self, index: int) -> Mapping[str, NDArray[np.generic]] | None:
        self.read += index in self.parts
        return self.parts.get(index)

    def store(self, index: int, arrays: Mapping[str, NDArray[np.generic]]) -> None:
        self.parts[index] = {name: np.array(array) for name, array in arrays.items()}
        self.lives -= 1
        if self.lives == 0:
            raise Killed


@pytest.fixture(autouse=True)
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attempt, "PART_POINTS", POINTS)
    monkeypatch.setattr(smoothing, "NOISY", 0.0)  # further fans are parts as well


def layers_of(albedo: float = 0.5) -> list[IndirectLayer]:
    return [matt(0, albedo), indirect_layer(1, make_layer(MODELS["rough_conductor"]), (16, 8)), matt(2, 0.3)]


def found(keeper: CheckpointStore | None, albedo: float = 0.5, other_light: float | None = None) -> Arrays:
    placement = placement_of([*CORNER, LAMP], **CORNER_VIEW)
    solver = Solver(placement, MODELS_OF, SkyState(None), 4, FINENESS, other_light=other_light)
    return arrays_of(run_to_end(solver.solve(layers_of(albedo), keeper), lambda progress: None))


def assert_same(one: Arrays, two: Arrays) -> None:
    for name, array in one.items():
        np.testing.assert_array_equal(two[name], array, err_msg=name)


@pytest.fixture(scope="module")
def at_once() -> Arrays:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(attempt, "PART_POINTS", POINTS)  # cells are numbered part by part
        patch.setattr(smoothing, "NOISY", 0.0)
        once = found(None)
        assert once["nth"].any()
        return once


def test_what_is_resumed_is_what_is_found_at_once(at_once: Arrays) -> None:
    memory = Memory(lives=2)
    for lives in (3, -1):
        with pytest.raises(Killed):
            found(memory)
        memory.lives, memory.read = lives, 0
    resumed = found(memory)
    assert memory.read == 5 and len(memory.parts) > 6
    assert_same(at_once, resumed)


@pytest.mark.parametrize("every", [6, pytest.param(1, marks=pytest.mark.sweep)])
@pytest.mark.parametrize("tolerance", [0.0, 1.0], ids=["looked at anew", "by the fewest rays"])
def test_wherever_it_ends_it_goes_on_with_as_many_rays(
    monkeypatch: pytest.MonkeyPatch, tolerance: float, every: int
) -> None:
    monkeypatch.setattr(ray_budget, "TOLERANCE", tolerance)
    whole = Memory()
    once = found(whole, other_light=0.0)
    assert once["n_rays"] == FINENESS.n_rays // (1 if tolerance == 0.0 else LEVELS[0]) and once["noise"] > 0.0
    assert len(whole.parts) > 6
    for lives in range(1, len(whole.parts), every):
        memory = Memory(lives=lives)
        with pytest.raises(Killed):
            found(memory, other_light=0.0)
        memory.lives, memory.read = -1, 0
        assert_same(once, found(memory, other_light=0.0))
        assert memory.read == lives


def test_a_part_that_is_gone_is_found_anew(at_once: Arrays) -> None:
    memory = Memory()
    found(memory)
    del memory.parts[1]
    assert_same(at_once, found(memory))
    memory.parts[2] = {**memory.parts[2], "digest": memory.parts[0]["digest"]}
    assert_same(at_once, found(memory))


def test_parts_for_other_materials_are_not_taken() -> None:
    memory = Memory()
    found(memory)
    # Another picture decides where more points are needed; where all start they are the same.
    brighter = found(None, 0.99)
    assert_same(brighter, found(memory, 0.99))


def test_a_grid_that_was_too_fine_is_not_tried_again(at_once: Arrays, monkeypatch: pytest.MonkeyPatch) -> None:
    n_cells = len(at_once["cells.objects"])
    monkeypatch.setattr(cells_module, "MAX_RECORDS", n_cells - 20)
    coarser = found(None)
    assert len(coarser["cells.objects"]) <= n_cells - 20
    memory = Memory()
    assert_same(coarser, found(memory))
    ends = [index for index, part in memory.parts.items() if set(part) == {"digest"}]
    assert len(ends) == 1 and 0 < ends[0] < len(memory.parts) - 1
    n_parts, memory.read = len(memory.parts), 0
    assert_same(coarser, found(memory))
    assert len(memory.parts) == n_parts and memory.read >= n_parts


# Nothing is indexed by them.
FREE = ("cells.keys", "cells.seeds", "cells.hashes", "cells.side", "records.turn", "records.turn_3")
# Cells that send nothing are cells as well.
SHORTER = {"cell_seen with a row less"}


def test_arrays_that_are_not_this_scenes_light_are_refused(at_once: Arrays) -> None:
    solver = Solver(placement_of([*CORNER, LAMP], **CORNER_VIEW), MODELS_OF, SkyState(None), 4, FINENESS)
    assert_same(arrays_of(solver.restored(at_once)), at_once)
    forgeries = [*forged_shapes(at_once), *forged_numbers(at_once)]
    n_refused = 0
    for what, forged in forgeries:
        if what in SHORTER or what.startswith(tuple(f"{name}[" for name in FREE)):
            continue
        with pytest.raises(UnsoundArrays):
            solver.restored(forged)
            pytest.fail(what)
        n_refused += 1
    assert n_refused > 200


@pytest.mark.parametrize("wanted", ["missing", "of another type", "with a row more", "[0] = "])
def test_a_part_that_was_forged_is_found_anew(at_once: Arrays, wanted: str) -> None:
    memory = Memory()
    found(memory)
    for index, part in memory.parts.items():
        digest = {} if wanted == "missing" and index == 1 else {"digest": part["digest"]}
        own = {name: array for name, array in part.items() if name not in ("digest", *FREE)}
        forgeries = [forged for what, forged in (*forged_shapes(own), *forged_numbers(own)) if wanted in what]
        if forgeries:
            free = {name: part[name] for name in FREE if name in part}
            memory.parts[index] = forgeries[index % len(forgeries)] | digest | free
    assert_same(found(memory), at_once)


def test_what_a_first_look_foresees_is_not_traced_to_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    n_cells = len(found(None)["cells.objects"])
    traced: list[int] = []
    gather = attempt.gather

    def counted(hits: object, cells: object, rows: np.ndarray, *rest: object, **named: object) -> object:
        traced.append(len(rows))
        return gather(hits, cells, rows, *rest, **named)  # type: ignore[arg-type]

    monkeypatch.setattr(attempt, "gather", counted)
    found(None)
    n_traced = sum(traced)
    traced.clear()
    monkeypatch.setattr(cells_module, "MAX_RECORDS", n_cells // 2)
    late = len(found(None)["cells.objects"]), sum(traced)
    traced.clear()
    monkeypatch.setattr(cell_size, "MAX_RECORDS", n_cells // 2)
    early = len(found(None)["cells.objects"]), sum(traced)
    assert max(late[0], early[0]) <= n_cells // 2
    assert n_traced < early[1] < late[1]


def test_stored_light_is_the_light():
    fineness = replace(QUICK, n_samples=64)
    placement, sky = placement_of(CORNER, **CORNER_VIEW), SkyState(constant_environment((1.0, 0.8, 0.6)))
    layers = [matt(0, 0.5), indirect_layer(1, make_layer(MODELS["rough_conductor"]), (16, 8)), matt(2, 0.3)]
    models = {0: ["lambert"], 1: ["rough_conductor"], 2: ["lambert"]}
    light = run_to_end(Solver(placement, models, sky, 4, fineness).solve(layers), lambda progress: None)
    arrays = {name: array.copy() for name, array in arrays_of(light).items()}
    assert tuple(arrays) == NAMES
    for array in arrays.values():
        array.setflags(write=False)  # as they come from a file
    other = placement_of(CORNER, **CORNER_VIEW)
    restored = Solver(other, models, sky, 4, fineness).restored(arrays)
    assert light.picture(layers).max() > 0.0
    np.testing.assert_array_equal(restored.picture(layers), light.picture(layers))
    # Half of the sky on the same rays: the cells are where they were.
    evening = SkyState(constant_environment((0.5, 0.4, 0.3)))
    one, two = (run_to_end(relit(each, placement, evening, fineness, 4)).picture(layers) for each in (light, restored))
    np.testing.assert_array_equal(one, two)


def test_light_of_points_that_see_nothing_but_sky_is_stored_too():
    """Nothing is around them: an infinite clearance was taken for damage, and all was found again at every start."""
    fineness = replace(QUICK, n_samples=64)
    placement, sky = placement_of(CORNER[:1], **CORNER_VIEW), SkyState(constant_environment((1.0, 0.8, 0.6)))
    solver = Solver(placement, {0: ["lambert"]}, sky, 2, fineness)
    light = run_to_end(solver.solve([matt(0, 0.5)]), lambda progress: None)
    restored = solver.restored(arrays_of(light))
    np.testing.assert_array_equal(restored.picture([matt(0, 0.5)]), light.picture([matt(0, 0.5)]))
