"""Transport that is kept on disk: taken up where a worker ended, and made again where it is damaged or forged."""

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.messages.worker_messages import RequestFailed, Response, SceneOpened, WorkerRestarted
from app.modes.placement.placement_messages import (
    LayerPicture,
    StageDone,
)
from app.worker import executor
from app.worker.array_files import read_record, write_record
from app.worker.cache import ArrayCache
from app.worker.client import Client
from tests.app.worker.ball_and_lamp import (
    GLOSS,
    Recorder,
    assert_same_pictures,
    compute,
    failure,
    opened,
    pictures,
    tiles_of,
)
from tests.opened import ask_for_scene, run_in_process


def test_what_was_computed_before_comes_from_the_cache(source: str, store: ArrayCache, monkeypatch) -> None:
    expected = pictures(run_in_process(opened(source, store), compute()))
    recorder = Recorder()
    monkeypatch.setattr(executor, "project_layer", recorder)
    assert_same_pictures(pictures(run_in_process(opened(source, store), compute())), expected)
    assert recorder.n_tiles == 0


@pytest.mark.parametrize(
    "n_kept", [pytest.param(0, marks=pytest.mark.sweep), 1, pytest.param(4, marks=pytest.mark.sweep)]
)
def test_it_resumes_after_the_last_complete_tile(source: str, tmp_path: Path, monkeypatch, n_kept: int) -> None:
    whole = Recorder()
    monkeypatch.setattr(executor, "project_layer", whole)
    answers = run_in_process(opened(source, ArrayCache(tmp_path / "fresh")), compute())
    expected, coarse = pictures(answers), pictures(answers, "coarse")
    broken = Recorder(whole.n_tiles - tiles_of(*expected.values()) + n_kept)
    monkeypatch.setattr(executor, "project_layer", broken)
    assert "a bug in Insitu" in failure(run_in_process(opened(source, ArrayCache(tmp_path / "cache")), compute()))
    again = Recorder()
    monkeypatch.setattr(executor, "project_layer", again)
    assert_same_pictures(pictures(run_in_process(opened(source, ArrayCache(tmp_path / "cache")), compute())), expected)
    # A layer that is whole is shown at once, without the coarse picture and the preview of it.
    spared = tiles_of(coarse[GLOSS], expected[GLOSS]) if n_kept >= tiles_of(expected[GLOSS]) else 0
    assert again.n_tiles == whole.n_tiles - n_kept - spared


def test_a_cancelled_transport_keeps_what_is_whole(source: str, store: ArrayCache, monkeypatch) -> None:
    steps = opened(source, store).handle(compute())
    final_pictures = (a for a in steps if isinstance(a, LayerPicture) and a.stage == "final")
    assert next(final_pictures).key == GLOSS
    steps.close()
    recorder = Recorder()
    monkeypatch.setattr(executor, "project_layer", recorder)
    answers = run_in_process(opened(source, store), compute())
    coarse, final = pictures(answers, "coarse"), pictures(answers)
    # The selected layer's final transport was there already; all else is computed, in three stages.
    assert coarse.keys() == final.keys() - {GLOSS}
    others = [final[key] for key in coarse]
    assert recorder.n_tiles == tiles_of(*coarse.values()) + 2 * tiles_of(*others)


def test_a_damaged_cache_is_computed_again(source: str, store: ArrayCache, tmp_path: Path) -> None:
    expected = pictures(run_in_process(opened(source, store), compute()))
    for path in (tmp_path / "cache").iterdir():
        data = bytearray(path.read_bytes())
        data[len(data) // 2] ^= 1
        path.write_bytes(data)
    assert_same_pictures(pictures(run_in_process(opened(source, store), compute())), expected)


def test_a_killed_worker_goes_on_to_the_same_pictures(source: str, tmp_path: Path, monkeypatch) -> None:
    expected = pictures(run_in_process(opened(source, ArrayCache(tmp_path / "fresh")), compute()))
    monkeypatch.setenv("INSITU_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("INSITU_STATE", str(tmp_path / "state"))
    answers: list[Response] = []
    killed = False
    deadline = time.monotonic() + 600  # only a worker that hangs needs so long
    with Client() as client:
        ask_for_scene(client, source)
        client.send(compute())
        while not any(isinstance(a, StageDone) and a.exact for a in answers):
            assert time.monotonic() < deadline
            client.wait(0.05)
            answers += client.poll()
            if not killed and any(isinstance(a, StageDone) and a.stage == "preview" for a in answers):
                os.kill(client.pid, signal.SIGKILL)
                killed = True
    assert any(isinstance(a, WorkerRestarted) for a in answers) and not any(
        isinstance(a, RequestFailed) for a in answers
    )
    # The scene is opened and the stages are gone through once more, to the last bit as if nothing had been.
    assert sum(isinstance(a, SceneOpened) for a in answers) == 2
    assert_same_pictures(pictures(answers), expected)


def rewritten(folder: Path, forge: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]]) -> int:
    """Forge what stands in the cache, under the keys and checksums it should have; how many records."""
    count = 0
    for path in folder.iterdir():
        data, records = memoryview(path.read_bytes()), []
        while data:
            records.append(read_record(data))
            data = data[records[-1].n_bytes :]
        with open(path, "wb") as file:
            for record in records:
                write_record(file, record.label, forge(record.arrays))
        count += len(records)
    return count


FORGERIES = {
    "nothing": lambda arrays: {},
    "another name": lambda arrays: {f"{name}s": array for name, array in arrays.items()},
    "another type": lambda arrays: {name: array.astype(np.complex64) for name, array in arrays.items()},
    "too short": lambda arrays: {name: array[:-1] for name, array in arrays.items()},
    "too long": lambda arrays: {name: np.concatenate([array, array]) for name, array in arrays.items()},
    "beyond": lambda arrays: {
        name: array + np.float32(np.inf) if array.dtype.kind == "f" else np.full_like(array, np.iinfo(array.dtype).max)
        for name, array in arrays.items()
        if name != "bits"  # any bit may be set
    },
}


def some_of(*forgeries: str) -> pytest.MarkDecorator:
    """These in every run, all of them in the sweep."""
    rest = [pytest.param(name, marks=pytest.mark.sweep) for name in FORGERIES if name not in forgeries]
    return pytest.mark.parametrize("forgery", [*forgeries, *rest])


@some_of("nothing", "beyond")
def test_a_forged_cache_is_computed_again(source: str, store: ArrayCache, tmp_path: Path, forgery: str) -> None:
    expected = pictures(run_in_process(opened(source, store), compute()))
    assert rewritten(tmp_path / "cache", FORGERIES[forgery]) == 5  # visibility, three layers, and the unit they are in
    assert_same_pictures(pictures(run_in_process(opened(source, store), compute())), expected)
    # What was computed again is kept again.
    assert rewritten(tmp_path / "cache", dict) == 5
    assert_same_pictures(pictures(run_in_process(opened(source, store), compute())), expected)


@some_of("too short")
def test_forged_tiles_are_computed_again(
    source: str, store: ArrayCache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, forgery: str
) -> None:
    expected = pictures(run_in_process(opened(source, ArrayCache(tmp_path / "fresh")), compute()))
    n_coarse = tiles_of(*pictures(run_in_process(opened(source, store), compute(n_lights=80)), "coarse").values())
    broken = Recorder(n_coarse + tiles_of(*expected.values()) + 2)  # two tiles of the final stage
    monkeypatch.setattr(executor, "project_layer", broken)
    run_in_process(opened(source, store), compute())
    monkeypatch.undo()
    assert [path.suffix for path in (tmp_path / "cache").iterdir()].count(".tiles") == 1
    rewritten(tmp_path / "cache", FORGERIES[forgery])
    assert_same_pictures(pictures(run_in_process(opened(source, store), compute())), expected)
