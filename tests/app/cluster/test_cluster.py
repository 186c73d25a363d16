"""Frames and transport from a Dask cluster of this machine: a scheduler and two workers, each with a cache of its own.

The tests go on from one another's workers, as starting one takes seconds; whoever ends one has another one start.
"""

from __future__ import annotations

import contextlib
import inspect
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("distributed", reason="dask.distributed is not installed: pip install 'insitu[cluster]'")

from app.cli.precompute import precompute
from app.cluster import dask as cluster_module
from app.cluster.cluster_jobs import ClusterExecutor, FrameJob, draw_frame
from app.cluster.cluster_project import ClusterProject, open_on_cluster
from app.cluster.dask import Cluster
from app.project.project import ProjectSpec
from app.stills.frame_sequence import Frames, draw_here
from app.worker.cache import ArrayCache
from engine.core.errors import InsituError
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.render.display import exr_bytes
from tests.app.cli.command_line import SCENE, run
from tests.scene_text import material, placed, scaled

ROOM = SCENE.replace("bounces = 1", "bounces = 2").replace("radiance = 0.5", 'file = "sky.exr"') + placed(
    "floor", "sphere", scaled(1, (0.6, -1.5, 0)), material('model = "lambert", name = "clay", albedo = [0.7, 0.4, 0.2]')
)
FRAMES = Frames(4, settings=(("n_lights", 60), ("n_patches", 20)), series=BounceSeries(1))


class Machines:
    """A scheduler and its workers, as processes."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.workers = folder, list[subprocess.Popen[bytes]]()
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.address = f"127.0.0.1:{free.getsockname()[1]}"
        port = self.address.rpartition(":")[2]
        self._scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", port)

    def start_worker(self, place: Path | None = None) -> None:
        """place: a folder whose packages come before those that are installed."""
        name = f"worker{len(self.workers)}"
        words = ("--nthreads", "1", "--no-nanny", "--local-directory", str(self.folder / name))
        self.workers.append(self._start("worker", self.address, *words, cache=name, place=place))

    def kill(self, address: str) -> None:
        """The worker that has this address."""
        with Cluster(self.address) as cluster:
            pid = cluster._client.run(os.getpid, workers=[address])[address]
        next(worker for worker in self.workers if worker.pid == pid).kill()

    def end(self) -> None:
        for process in (*self.workers, self._scheduler):
            process.kill()
            process.wait()

    def _start(
        self, what: str, *words: str, cache: str = "scheduler", place: Path | None = None
    ) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *words, "--no-dashboard"]
        environment = {**os.environ, "INSITU_CACHE": str(self.folder / cache)}
        with open(self.folder / f"{cache}.log", "wb") as log:
            return subprocess.Popen(command, env=environment, cwd=place or self.folder, stdout=log, stderr=log)


@pytest.fixture(scope="module")
def machines(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machines]:
    machines = Machines(tmp_path_factory.mktemp("machines"))
    try:
        machines.start_worker()
        machines.start_worker()
        deadline = time.monotonic() + 60.0
        while True:
            try:
                with Cluster(machines.address):
                    break
            except InsituError:
                assert time.monotonic() < deadline, (machines.folder / "scheduler.log").read_text()
                time.sleep(0.1)
        yield machines
    finally:
        machines.end()


@pytest.fixture
def words(tmp_path: Path) -> ProjectSpec:
    (tmp_path / "room.toml").write_text(ROOM)
    sky = np.random.default_rng(1).random((8, 16, 3), np.float32)
    (tmp_path / "sky.exr").write_bytes(exr_bytes(sky))
    return ProjectSpec(str(tmp_path / "room.toml"), (16, 12))


def silent(step: object) -> None:
    """Nobody looks at the progress."""


@pytest.mark.parametrize("mode", ["placement", pytest.param("orbit", marks=pytest.mark.sweep)])
def test_frames_are_the_same_though_a_worker_is_killed(machines: Machines, words: ProjectSpec, mode: str) -> None:
    frames = replace(FRAMES, mode=mode)
    project = words.open()
    here = dict(draw_here(project, frames, range(1, 4), silent))
    with open_on_cluster(words, machines.address) as (project, cluster):
        assert cluster is not None
        for file in ("room.toml", "sky.exr"):  # what lies there by now is nothing to the workers
            Path(project.scene.folder, file).write_text("something else")
        drawing = cluster.draw(project, frames, range(1, 4), silent)
        there = dict([next(drawing)])
        if mode == "placement":
            busy = cluster.cluster._client.processing()
            machines.kill(next(address for address, tasks in busy.items() if tasks))
        there |= drawing
    if mode == "placement":
        machines.start_worker()
    assert here.keys() == there.keys()
    for i in here:
        np.testing.assert_array_equal(here[i], there[i])


def test_a_cache_is_filled_with_the_same_though_the_worker_with_the_light_is_killed(
    machines: Machines, words: ProjectSpec, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seeing = ClusterExecutor.compute_light

    def losing(self: ClusterExecutor, *arguments: object) -> Iterator[float]:
        light = yield from seeing(self, *arguments)  # type: ignore[arg-type]
        (task,) = self._lights.values()
        ((address,),) = self._cluster._client.who_has([task]).values()
        machines.kill(address)
        return light

    words = replace(words, resolution=(24, 18))
    done = precompute(words.open().with_settings(n_lights=401), silent, ArrayCache(tmp_path / "here"))
    monkeypatch.setattr(ClusterExecutor, "compute_light", losing)
    with open_on_cluster(words, machines.address) as (project, cluster):
        assert precompute(project.with_settings(n_lights=401), silent, ArrayCache(tmp_path / "there"), cluster) == done
    here, there = ({file.name: file.read_bytes() for file in (tmp_path / name).iterdir()} for name in ("here", "there"))
    assert len(here) >= 5 and here == there  # visibility, unit, two layers, indirect light


def test_a_scene_is_sent_once(machines: Machines, words: ProjectSpec) -> None:
    def kept() -> dict[str, int]:
        with open_on_cluster(words, machines.address):
            return {file.name: file.stat().st_ino for file in (machines.folder / "scheduler" / "sent").iterdir()}

    first = kept()
    assert kept() == first
    Path(words.name or "").write_text(ROOM.replace("0.7", "0.65"))
    assert len(kept().items() - first.items()) == 1  # the scene file, and not its sky


def test_what_is_stopped_leaves_nothing_to_do(machines: Machines, words: ProjectSpec) -> None:
    with pytest.raises(KeyboardInterrupt), open_on_cluster(words, machines.address) as (project, cluster):
        assert cluster is not None
        next(cluster.draw(project, FRAMES, range(4), silent))
        raise KeyboardInterrupt
    with Cluster(machines.address) as later:
        deadline = time.monotonic() + 30.0
        while any(later._client.processing().values()) and time.monotonic() < deadline:
            time.sleep(0.1)  # until what was begun has ended
        assert not any(later._client.processing().values())


def test_workers_are_counted_while_dask_updates_what_it_knows(machines: Machines) -> None:
    """Dask's own answer, which lists no workers, must not come between ours and its reading."""
    with Cluster(machines.address) as cluster:
        n_workers = len(cluster._client.run(os.getpid))
        over = threading.Event()

        def update() -> None:
            while not over.is_set():
                cluster._client.sync(cluster._client._update_scheduler_info)

        updating = threading.Thread(target=update)
        updating.start()
        try:
            assert {cluster.n_workers for _ in range(300)} == {n_workers}
        finally:
            over.set()
            updating.join()


def test_a_worker_with_another_insitu_says_so(machines: Machines, words: ProjectSpec) -> None:
    with open_on_cluster(words, machines.address) as (_, cluster):
        assert isinstance(cluster, ClusterProject)
        name, parcel, _ = cluster.named
        task = cluster.cluster.submit(draw_frame, FrameJob(name, parcel, "another", words, FRAMES), 0)
        with pytest.raises(InsituError, match="has another Insitu"):
            list(cluster.cluster.results({0: task}))


def test_the_command_line_draws_the_same_and_says_what_is_wrong(
    machines: Machines, words: ProjectSpec, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    few = ("--turntable", 2, "--resolution", 12, 9, "--lights", 40, "--bounces", 1)
    scene = str(words.name)
    assert run("render", scene, "-o", tmp_path / "here", *map(str, few)) == 0
    assert run("render", scene, "-o", tmp_path / "there", *map(str, few), "--scheduler", machines.address) == 0
    capsys.readouterr()
    for i in range(2):
        assert (tmp_path / "there" / f"000{i}.png").read_bytes() == (tmp_path / "here" / f"000{i}.png").read_bytes()
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        free = f"127.0.0.1:{nobody.getsockname()[1]}"
        for address, said in ((free, "no Dask scheduler answers there"), ("nonsense", "expected HOST:PORT")):
            assert run("precompute", scene, "--scheduler", address) == 1
            (line,) = capsys.readouterr().err.splitlines()
            assert line.startswith(f"insitu: --scheduler {address}: ") and said in line
    assert run("render", scene, "-o", tmp_path / "a.png", "--scheduler", machines.address) == 1
    assert "expected --turntable or --frames" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "app.cluster.dask", SimpleNamespace())  # as where Dask is not installed
    assert run("precompute", scene, "--scheduler", machines.address) == 1
    assert "pip install 'insitu[cluster]'" in capsys.readouterr().err


GREETINGS = {"ssh": b"SSH-2.0-OpenSSH_9.2p1\r\n", "nothing": b"", "garbage": (40).to_bytes(8, "little") + bytes(40)}


@pytest.mark.parametrize("greeting", GREETINGS)
def test_an_address_without_a_scheduler_is_reported_in_one_line(
    words: ProjectSpec, greeting: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cluster_module, "CONNECT_SECONDS", 1.0)

    def greet(server: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = server.accept()
                with connection:
                    connection.sendall(GREETINGS[greeting])

    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=greet, args=(server,), daemon=True).start()
        address = f"127.0.0.1:{server.getsockname()[1]}"
        assert run("precompute", str(words.name), "--scheduler", address) == 1
        server.shutdown(socket.SHUT_RDWR)
    (line,) = capsys.readouterr().err.splitlines()
    assert "no Dask scheduler answers there" in line


def test_a_worker_of_another_version_is_named_before_it_is_given_anything(
    machines: Machines, words: ProjectSpec, capsys: pytest.CaptureFixture[str]
) -> None:
    """One whose `app` has no cluster yet. A module, as an editable install would add what a package lacks."""
    (machines.folder / "old").mkdir()
    (machines.folder / "old" / "app.py").touch()
    with Cluster(machines.address) as cluster:
        machines.start_worker(machines.folder / "old")
        old = machines.workers.pop()
        deadline = time.monotonic() + 60.0
        while old.pid not in cluster._client.run(os.getpid).values():
            assert time.monotonic() < deadline
            time.sleep(0.1)
        started = time.monotonic()
        try:
            # As many lights as no other test has: what is in the cache needs nobody.
            assert run("precompute", str(words.name), "--lights", "61", "--scheduler", machines.address) == 1
            assert time.monotonic() - started < 30.0
            (line,) = capsys.readouterr().err.splitlines()
            assert "the worker at tcp://127.0.0.1:" in line and "has another Insitu" in line
            assert old.poll() is None  # it was given nothing that it would have died of
        finally:
            old.kill()
            old.wait()
        while old.pid in cluster._client.run(os.getpid, on_error="ignore").values() and time.monotonic() < deadline:
            time.sleep(0.1)


@pytest.mark.parametrize(
    "stage", ["submit", *(pytest.param(each, marks=pytest.mark.sweep) for each in ("n_workers", "send"))]
)
def test_a_scheduler_that_dies_in_mid_run_is_reported_in_one_line(
    words: ProjectSpec, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, stage: str
) -> None:
    few = ("--turntable", "30", "--resolution", "12", "9", "--lights", "40", "--bounces", "1")
    machines = Machines(tmp_path)
    machines.start_worker()
    method, calls = inspect.getattr_static(Cluster, stage), 0
    last = {"submit": 20, "n_workers": 3, "send": 1}[stage]

    def dying(self: Cluster, *arguments: object) -> object:
        nonlocal calls
        calls += 1
        if calls == last:
            machines.end()
        return (method.fget if isinstance(method, property) else method)(self, *arguments)

    monkeypatch.setattr(Cluster, stage, property(dying) if isinstance(method, property) else dying)
    try:
        deadline = time.monotonic() + 60.0
        while run("render", str(words.name), "-o", tmp_path / "out", *few, "--scheduler", machines.address) == 1:
            (line,) = capsys.readouterr().err.splitlines()
            assert time.monotonic() < deadline, line
            if "no Dask scheduler answers there" not in line:  # it is there by now
                assert "the scheduler has gone" in line
                break
            time.sleep(0.2)
        else:
            pytest.fail("all was drawn")
    finally:
        machines.end()


def test_a_cluster_without_workers_and_one_that_has_gone_are_reported(
    machines: Machines, words: ProjectSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "WORKERLESS_SECONDS", 0.5)
    with open_on_cluster(words, machines.address) as (project, cluster):
        assert cluster is not None
        for worker in machines.workers:
            worker.kill()
        with pytest.raises(InsituError, match="has had no worker for"):
            list(cluster.draw(project, FRAMES, range(4), silent))
        machines.end()
        with pytest.raises(InsituError, match="the scheduler has gone"):
            list(cluster.draw(project, FRAMES, range(4), silent))


def test_a_scheduler_that_is_killed_leaves_one_line_on_the_terminal(words: ProjectSpec, tmp_path: Path) -> None:
    """Of a program of its own, whose libraries write what they like."""
    machines, out = Machines(tmp_path), tmp_path / "out"
    machines.start_worker()
    command = ["render", str(words.name), "-o", str(out), "--turntable", "400", "--resolution", "12", "9"]
    command += ["--lights", "40", "--bounces", "1", "--scheduler", machines.address]
    try:
        deadline = time.monotonic() + 60.0
        while True:  # until there is a scheduler
            with contextlib.suppress(InsituError), Cluster(machines.address):
                break
            assert time.monotonic() < deadline
        with subprocess.Popen([sys.executable, "-m", "app", *command], stderr=subprocess.PIPE) as program:
            while len(list(out.glob("*.png"))) < 2:
                assert program.poll() is None and time.monotonic() < deadline + 60.0
                time.sleep(0.1)
            machines.end()
            said = program.communicate(timeout=60.0)[1].decode()
            assert program.returncode == 1
            (line,) = said.splitlines()
            assert "the scheduler has gone" in line
    finally:
        machines.end()
