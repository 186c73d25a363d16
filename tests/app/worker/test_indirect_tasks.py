"""The worker's indirect light: what it keeps on disk and finds there again."""

import itertools
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.described import document_from_description
from app.messages.worker_messages import Response
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import FreezeIndirect, FreezingProgress, IndirectFound, IndirectFrozen
from app.project.distant_light import sky_of
from app.worker import indirect_tasks as indirect_module
from app.worker.cache import ArrayCache
from app.worker.indirect_tasks import IndirectTasks
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect import attempt as attempt_module
from engine.precompute.indirect import reflection
from engine.precompute.indirect.gather import GatherSamples, gather
from engine.precompute.indirect.sampling_settings import ROUGH
from engine.precompute.indirect.solver import Solver
from engine.scene.scene_loader import Scene, load_scene
from tests.app.worker.ball_and_lamp import SCENE
from tests.quick_indirect import QUICK

N_BOUNCES = 3
ROOT = Path(__file__).parents[3]


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Scene:
    monkeypatch.setattr(indirect_module, "FINE", ROUGH)  # quicker, and as good for this
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return load_scene(path)


def found_by(
    tasks: IndirectTasks, scene: Scene, lit_by: str = "noon", is_last: bool = True, n_rays: int = 0
) -> list[Response]:
    """What the worker tells of the scene's light in the end, a freezing for the ball's gloss having been asked for
    before."""
    document = document_from_description("scene", scene.description)
    wanted = Curves().scene_state(document)
    list(tasks.freeze(FreezeIndirect(wanted, "ball.1", 0)))
    steps = tasks.find(wanted.visible, sky_of(scene, document.light), lit_by, N_BOUNCES, is_last, n_rays)
    found = [answer for answer in steps if isinstance(answer, IndirectFound | IndirectFrozen)]
    return [answer for answer in found if not isinstance(answer, IndirectFrozen) or answer.is_last]


def test_what_gloss_sends_on_comes_with_a_second_answer_where_another_curve_is_edited(scene: Scene) -> None:
    document = document_from_description("scene", scene.description)
    wanted, tasks = Curves().scene_state(document), IndirectTasks(Placement(scene))
    list(tasks.find(wanted.visible, sky_of(scene, document.light), "noon", N_BOUNCES, True))

    def frozen(key: str) -> list[IndirectFrozen]:
        return [a for a in tasks.freeze(FreezeIndirect(wanted, key, 0)) if isinstance(a, IndirectFrozen)]

    early, whole = frozen("ball.1")
    assert (early.is_last, whole.is_last) == (False, True) and not early.light.gloss and whole.light.gloss
    np.testing.assert_array_equal(early.light.reflected[0], whole.light.reflected[0])
    [again] = frozen("ball.1")  # the picture follows its edits already: nothing stops following meanwhile
    assert again.is_last and again.light.gloss
    [diffuse] = frozen("ground.0")  # it sends nothing on that is not in its albedo
    assert diffuse.is_last and not diffuse.light.gloss
    assert [each.is_last for each in frozen("ball.1")] == [False, True]


def test_a_freezing_that_takes_long_tells_how_far_it_is(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    document = document_from_description("scene", scene.description)
    wanted, tasks = Curves().scene_state(document), IndirectTasks(Placement(scene))
    list(tasks.find(wanted.visible, sky_of(scene, document.light), "noon", N_BOUNCES, True))

    def progress() -> list[float]:
        answers = list(tasks.freeze(FreezeIndirect(wanted, "ball.1", 0, serial=7)))
        assert all(each.serial == 7 for each in answers if isinstance(each, FreezingProgress))
        return [each.fraction for each in answers if isinstance(each, FreezingProgress)]

    assert progress() == []  # a quick one does not
    monkeypatch.setattr(indirect_module, "QUIET_SECONDS", 0.0)
    monkeypatch.setattr(reflection, "_PART", 16)
    fractions = progress()
    assert len(fractions) > 8 and all(one < two for one, two in itertools.pairwise(fractions))
    assert fractions[0] < 0.3 and 0.7 < fractions[-1] < 1.0


def test_light_found_before_is_there_with_the_first_picture(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = ArrayCache(tmp_path / "cache")
    where, frozen = found_by(IndirectTasks(Placement(scene), store, "scene"), scene)
    calls: list[Any] = []
    monkeypatch.setattr(Solver, "solve", lambda *arguments: calls.append(arguments) or iter(()))
    # Another worker, at the stage that would be content with rough light: the fine one, nothing traced.
    where_again, again = found_by(IndirectTasks(Placement(scene), store, "scene"), scene, is_last=False)
    assert not calls
    np.testing.assert_array_equal(where_again.rows, where.rows)
    gloss = frozen.keys.index("ball.1")
    assert again.keys == frozen.keys and frozen.curves == {"ball.1": 0}
    np.testing.assert_array_equal(again.light.bands[gloss], frozen.light.bands[gloss])
    others = {frozen.keys.index(key) for key in ("ground.0", "ball.0")}
    assert again.light.reflected.keys() == frozen.light.reflected.keys() == others
    for i, values in frozen.light.reflected.items():
        assert values.max() > 0.0
        np.testing.assert_array_equal(again.light.reflected[i], values)


def test_as_many_rays_are_taken_as_are_needed_or_asked_for(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(indirect_module, "FINE", QUICK)
    tasks = IndirectTasks(Placement(scene), ArrayCache(tmp_path / "cache"), "scene")
    where, _ = found_by(tasks, scene)
    assert where.n_rays in (32, 64, 128) and where.reason.startswith(("within", "64 would be"))
    numbers = {where.number}
    for n_rays in (128, 256):  # 128 are all of it, too: by hand they are another light than as needed
        more, _ = found_by(tasks, scene, n_rays=n_rays)
        assert (more.n_rays, more.reason) == (0, "") and tasks.light.points.samples.records.shape[1] == n_rays
        numbers.add(more.number)
    assert len(numbers) == 3
    back, *frozen = found_by(tasks, scene)
    assert back.n_rays == where.n_rays and back.number != more.number and len(frozen) == 1  # from the cache
    again, *nothing = found_by(tasks, scene)
    assert again.number == back.number and not nothing  # as it is


@pytest.mark.parametrize("change", [{"scene_key": "another"}, {"lit_by": "evening"}])
def test_other_scenes_and_lights_are_found_anew(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: dict[str, str]
) -> None:
    store = ArrayCache(tmp_path / "cache")
    found_by(IndirectTasks(Placement(scene), store, "scene"), scene)

    def refuse(*arguments: object) -> None:
        raise LookupError("traced")

    monkeypatch.setattr(Solver, "solve", refuse)
    tasks = IndirectTasks(Placement(scene), store, change.get("scene_key", "scene"))
    with pytest.raises(LookupError, match="traced"):
        found_by(tasks, scene, change.get("lit_by", "noon"))


# Dies in the middle of its third part.
KILLED = """
import os, signal, sys
from pathlib import Path
from app.worker import indirect_tasks
from app.worker import array_files as tiles
from app.worker.cache import ArrayCache
from engine.precompute.indirect import attempt
from engine.scene.scene_loader import load_scene
from engine.precompute.direct.pipeline import Placement
from tests.app.worker.test_indirect_tasks import PART_POINTS, found_by

indirect_tasks.FINE, attempt.PART_POINTS = indirect_tasks.ROUGH, PART_POINTS
append = tiles.Tiles.append_tile

def append_and_die(self, index, arrays):
    if index == 2:
        with open(self._path, "ab") as file:
            file.write(b"half a record")
        os.kill(os.getpid(), signal.SIGKILL)
    return append(self, index, arrays)

tiles.Tiles.append_tile = append_and_die
folder = Path(sys.argv[1])
scene = load_scene(folder / "scene.toml")
found_by(indirect_tasks.IndirectTasks(Placement(scene), ArrayCache(folder / "cache"), "scene"), scene)
"""
PART_POINTS = 2


def test_a_search_that_was_killed_goes_on(scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attempt_module, "PART_POINTS", PART_POINTS)
    killed = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], cwd=ROOT, timeout=300, check=False)
    assert killed.returncode == -signal.SIGKILL
    assert {path.suffix for path in (tmp_path / "cache").iterdir()} == {".tiles", ".lock"}
    gathered: list[int] = []

    def counted(*given: Any, **named: Any) -> Iterator[GatherSamples]:
        gathered.extend([] if named else [len(given[2])])  # the first look is named otherwise
        return gather(*given, **named)

    monkeypatch.setattr(attempt_module, "gather", counted)
    store = ArrayCache(tmp_path / "cache")
    where, frozen = found_by(IndirectTasks(Placement(scene), store, "scene"), scene)
    n_resumed = sum(gathered)
    where_at_once, at_once = found_by(IndirectTasks(Placement(scene)), scene)
    assert sum(gathered) - n_resumed == n_resumed + 2 * PART_POINTS
    np.testing.assert_array_equal(where.rows, where_at_once.rows)
    gloss = frozen.keys.index("ball.1")
    np.testing.assert_array_equal(frozen.light.bands[gloss], at_once.light.bands[gloss])
    assert not store.take_notes()
    assert [path.suffix for path in (tmp_path / "cache").iterdir()] == [".arrays"]
