"""Whatever happens to the worker or to its cache, in whatever mode: the picture in the end is the same."""

from __future__ import annotations

import gc
import os
import time
from pathlib import Path

import numpy as np
import pytest

from app.messages.worker_messages import RequestFailed, Response, WorkerRestarted
from app.modes.orbit.orbit_messages import OrbitPictureDrawn
from app.worker.cache import ArrayCache
from app.worker.client import Client
from app.worker.deform_worker import DeformWorker
from app.worker.orbit_worker import OrbitWorker
from tests.app.limits import small_disk
from tests.app.worker.answers import collect, kill, of, seen
from tests.app.worker.small_modes import HANDLERS, SCENE, SIZE, in_process, picture_in, shown_by, small_tasks
from tests.app.worker.test_client_deaths import left_in_memory
from tests.app.worker.test_damaged_cache import damage
from tests.app.worker.test_resumed import FORGERIES, rewritten, some_of
from tests.opened import ask_for_scene

MODES = ("placement", "orbit", "deform")
NOTICED_SECONDS = 1.0
in_any_mode = pytest.mark.parametrize("mode", MODES)
in_other_modes = pytest.mark.parametrize("mode", MODES[1:])  # test_damaged_cache and test_resumed have the first


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(SCENE)
    return str(path)


@pytest.fixture(scope="module")
def pictures(scene: str, tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """Those of an undisturbed worker, by mode."""
    found = {mode: in_process(mode, scene, ArrayCache(tmp_path_factory.mktemp("cache"))) for mode in MODES}
    assert all(picture.max() > 0.0 for picture in found.values())
    return found


def assert_same(picture: np.ndarray, expected: np.ndarray) -> None:
    """But for what was kept in single precision."""
    np.testing.assert_allclose(picture, expected, rtol=1e-4, atol=1e-5)


class Worker:
    """A real one on the scene, for one mode, with a cache that is emptied for each picture."""

    def __init__(self, client: Client, mode: str, source: str, cache: Path) -> None:
        self.client, self._source, self._cache = client, source, cache
        self._shown = shown_by(mode, source)

    def picture(self, kill_after: float | None = None) -> np.ndarray:
        """The last picture, where the worker is killed so many seconds after it was asked for."""
        for file in self._cache.glob("*"):
            file.unlink()
        ask_for_scene(self.client, self._source, resolution=SIZE)
        self.client.send(self._shown.prepare)
        answers: list[Response] = []
        if kill_after is not None:
            answers += self._until(kill_after)
            killed_at = kill(self.client)
            answers += collect(self.client, seen(WorkerRestarted))
            assert time.monotonic() - killed_at < NOTICED_SECONDS
            answers = []  # what a worker said that is no more stands, but all is said again
        answers += collect(self.client, lambda found: any(map(self._shown.is_ready, found)))
        if self._shown.draw is not None:
            self.client.send(self._shown.draw)
            answers += collect(self.client, lambda found: bool(of(OrbitPictureDrawn, found)) and not self.client.busy)
        assert not of(RequestFailed, answers)
        return picture_in(answers)

    def _until(self, seconds: float) -> list[Response]:
        answers: list[Response] = []
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self.client.wait(min(left, 0.05))
            answers += self.client.poll()
        return answers


def check(mode: str, scene: str, expected: np.ndarray, folder: Path, n_kills: int) -> None:
    """Killed at moments that are drawn from all the time that a picture takes, and a little after."""
    random = np.random.default_rng([n_kills, *mode.encode()])
    gc.collect()  # what tests before this left to be closed; what they still hold does not count
    pids, before, others = [], len(os.listdir("/proc/self/fd")), left_in_memory(os.getpid())
    with Client(HANDLERS, heartbeat=0.05) as client:
        worker = Worker(client, mode, scene, folder)
        started = time.monotonic()
        assert_same(worker.picture(), expected)
        took = time.monotonic() - started  # the start of a process in it, as after a kill
        for _ in range(n_kills):
            pids.append(client.pid)
            assert_same(worker.picture(random.uniform(0.0, 1.1 * took)), expected)
        pids.append(client.pid)
        children = Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()
        assert str(client.pid) in children and not {str(pid) for pid in pids[:-1]} & set(children)
    gc.collect()
    assert set(left_in_memory(os.getpid(), *pids)) <= set(others)
    assert len(os.listdir("/proc/self/fd")) <= before
    assert not list(folder.glob("*.tmp"))


def test_small_tasks_leave_the_points_of_other_tasks_as_they_are() -> None:
    """What they set for all of this process, walks through Orbit in later tests would be drawn of."""
    small_tasks()
    assert (OrbitWorker.n_points, DeformWorker.n_points, DeformWorker.n_rays) == (None, None, None)


@pytest.mark.parametrize("mode", [pytest.param("orbit", marks=pytest.mark.sweep), "deform"])
def test_killed_at_random_moments_the_picture_is_the_same(
    mode: str, scene: str, pictures: dict[str, np.ndarray], state_folder: Path
) -> None:
    check(mode, scene, pictures[mode], state_folder.parent / "cache", n_kills=1)


@pytest.mark.sweep
@in_any_mode
def test_so_it_is_after_many_kills(mode: str, scene: str, pictures: dict[str, np.ndarray], state_folder: Path) -> None:
    check(mode, scene, pictures[mode], state_folder.parent / "cache", n_kills=100)


@in_any_mode
def test_on_a_full_disk_the_picture_is_the_same(
    mode: str, scene: str, pictures: dict[str, np.ndarray], tmp_path: Path
) -> None:
    with small_disk(tmp_path / "disk", 1 << 16) as folder:
        (folder / "filling").write_bytes(bytes(os.statvfs(folder).f_bavail * 4096))
        store = ArrayCache(folder)
        assert_same(in_process(mode, scene, store), pictures[mode])
        assert not any(path.stat().st_size for path in folder.iterdir() if path.name != "filling")


@in_other_modes
@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.sweep) for n in range(1, 60))])
def test_a_damaged_cache_shows_the_same_picture(
    mode: str, seed: int, scene: str, pictures: dict[str, np.ndarray], tmp_path: Path
) -> None:
    random, folder = np.random.default_rng(seed), tmp_path / "cache"
    assert_same(in_process(mode, scene, ArrayCache(folder)), pictures[mode])
    done = [damage(folder, random) for _ in range(2)]
    assert "nothing there" not in done
    assert_same(in_process(mode, scene, ArrayCache(folder)), pictures[mode])


@in_other_modes
@some_of("too short", "beyond")
def test_a_forged_cache_shows_the_same_picture(
    mode: str, forgery: str, scene: str, pictures: dict[str, np.ndarray], tmp_path: Path
) -> None:
    """Under checksums that are right: other points than the scene has, or no arrays at all."""
    folder = tmp_path / "cache"
    in_process(mode, scene, ArrayCache(folder))
    assert rewritten(folder, FORGERIES[forgery]) > 0
    store = ArrayCache(folder)
    assert_same(in_process(mode, scene, store), pictures[mode])
    assert rewritten(folder, dict) > 0  # what was computed again is kept again
    assert_same(in_process(mode, scene, ArrayCache(folder)), pictures[mode])
