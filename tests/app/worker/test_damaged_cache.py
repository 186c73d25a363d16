"""Whatever is damaged in the cache, whenever: the picture is that of an empty one."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from app.document.described import document_from_description
from app.messages.worker_messages import RequestFailed, Response
from app.modes.placement.curves import Curves
from app.modes.placement.placement_messages import (
    ComputeTransport,
    ContractTransport,
    FreezeIndirect,
    IndirectFrozen,
    LayerPicture,
)
from app.worker import indirect_tasks as indirect_module
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.precompute.indirect.sampling_settings import ROUGH
from engine.scene.scene_loader import load_scene
from tests.app.worker.ball_and_lamp import GLOSS, SCENE, compute, twice
from tests.opened import ask_for_scene

RESOLUTION = (32, 24)
N_CUTS, MOST_STEPS = 6, 100_000
Random = np.random.Generator


@dataclass
class Cached:
    """A scene, what is asked of it, folders with its cache in several states, and the true answers."""

    source: str
    request: ComputeTransport
    freeze: FreezeIndirect
    folders: list[Path]
    expected: dict[str, np.ndarray]
    bent: np.ndarray

    def bend(self, client: InProcessClient) -> np.ndarray:
        """The ball's gloss with another curve, from the transport that is there."""
        work = next(layer for layer in self.request.scene.layers if layer.key == GLOSS)
        client.send(ContractTransport(twice(work, "theta_h"), "theta_h", revision=self.request.revision))
        (picture,) = (a for a in client.poll(float("inf")) if isinstance(a, LayerPicture))
        return np.asarray(picture.radiance)

    def client(self, folder: Path) -> InProcessClient:
        client = InProcessClient(RequestDispatcher(ArrayCache(folder)))
        ask_for_scene(client, self.source, resolution=RESOLUTION)
        client.poll(float("inf"))
        client.send(self.request)
        client.poll(0.0)
        client.send(self.freeze)
        return client


@pytest.fixture(scope="module")
def cached(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cached]:
    """Empty, cut off after so many steps, and whole."""
    base = tmp_path_factory.mktemp("damaged")
    source = base / "scene.toml"
    source.write_text(SCENE)
    document = document_from_description("scene", load_scene(source, RESOLUTION).description)
    request = compute(n_bounces=3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(indirect_module, "FINE", ROUGH)  # quicker, and as good for this
        made = Cached(
            str(source), request, FreezeIndirect(Curves().scene_state(document), GLOSS, 0), [], {}, np.zeros(0)
        )
        whole = made.client(base / "whole")
        n_steps, answers = steps_of(whole)
        made.expected, made.bent = shown(answers), made.bend(whole)
        for i in range(N_CUTS):  # most steps are those of the final stage and of indirect light
            folder = base / f"cut {i}"
            folder.mkdir()
            steps_of(made.client(folder), n_steps * (i + 1) // (N_CUTS + 1))
            made.folders.append(folder)
        made.folders.append(base / "whole")
        yield made


def steps_of(client: InProcessClient, most: int = MOST_STEPS) -> tuple[int, list[Response]]:
    """So many steps of the work at most; how many there were, and what was answered."""
    answers: list[Response] = []
    for step in range(most):
        if not client.wait(0.0):
            return step, answers
        answers += client.poll(0.0)
    return most, answers


def shown(answers: list[Response]) -> dict[str, np.ndarray]:
    """What is shown in the end: each layer's picture, and the indirect light of the last freezing."""
    failed = [answer.line for answer in answers if isinstance(answer, RequestFailed)]
    assert not failed, failed
    pictures = {a.key: np.asarray(a.radiance) for a in answers if isinstance(a, LayerPicture) and a.stage == "final"}
    frozen = [answer for answer in answers if isinstance(answer, IndirectFrozen)][-1]
    indirect = {f"indirect {frozen.keys[i]}": part for i, part in frozen.light.reflected.items()}
    return pictures | indirect | {f"bands {frozen.keys[i]}": part for i, part in frozen.light.bands.items()}


def flip(data: bytearray, random: Random) -> None:
    data[random.integers(len(data))] ^= 1 << int(random.integers(8))


def blank(data: bytearray, random: Random) -> None:
    begin = int(random.integers(len(data)))
    end = min(begin + int(random.integers(1, 8192)), len(data))
    data[begin:end] = bytes(end - begin)


def cut(data: bytearray, random: Random) -> None:
    del data[random.integers(len(data)) :]


def double(data: bytearray, random: Random) -> None:
    data += data[random.integers(len(data)) :]


def shift(data: bytearray, random: Random) -> None:
    del data[: int(random.integers(1, 200))]


def garbage(data: bytearray, random: Random) -> None:
    data[:] = random.bytes(int(random.integers(0, 5000)))


DAMAGES: tuple[Callable[[bytearray, Random], None], ...] = (flip, flip, blank, cut, double, shift, garbage)


def damage(folder: Path, random: Random) -> str:
    """Damage a file or two of the cache where they lie, or exchange two; what was done."""
    files = sorted(path for path in folder.iterdir() if path.is_file() and path.stat().st_size)
    if not files:
        return "nothing there"
    if len(files) > 1 and random.random() < 0.1:
        one, two = random.choice(len(files), 2, replace=False)
        first, second = files[one].read_bytes(), files[two].read_bytes()
        files[one].write_bytes(second)
        files[two].write_bytes(first)
        return f"{files[one].name} exchanged with {files[two].name}"
    path = files[random.integers(len(files))]
    data, how = bytearray(path.read_bytes()), DAMAGES[random.integers(len(DAMAGES))]
    how(data, random)
    path.write_bytes(data)
    return f"{how.__name__} in {path.name}"


def check(cached: Cached, folder: Path, seed: int) -> None:
    random = np.random.default_rng(seed)
    state = cached.folders[random.integers(len(cached.folders))]
    shutil.copytree(state, folder)
    done = [state.name]
    if random.random() < 0.7:
        done.append(damage(folder, random))
    client = cached.client(folder)
    answers: list[Response] = []
    for _ in range(int(random.integers(0, 3))):  # while it is read and written
        answers += steps_of(client, int(random.integers(1, 60)))[1]
        done.append(damage(folder, random))
    answers += steps_of(client)[1]
    found = shown(answers)
    assert found.keys() == cached.expected.keys()
    for key, expected in cached.expected.items():
        np.testing.assert_allclose(found[key], expected, rtol=1e-5, atol=1e-6, err_msg=f"{seed}: {key} after {done}")
    done.append(damage(folder, random))  # while it is held
    np.testing.assert_allclose(cached.bend(client), cached.bent, rtol=1e-5, atol=1e-6, err_msg=f"{seed}: {done}")


@pytest.mark.parametrize("seed", range(2))
def test_a_damaged_cache_shows_the_same_picture(cached: Cached, tmp_path: Path, seed: int) -> None:
    check(cached, tmp_path / "cache", seed)


@pytest.mark.sweep
@pytest.mark.parametrize("seed", [*range(2, 8), *range(1000, 1300)])
def test_so_it_does_in_many_cases(cached: Cached, tmp_path: Path, seed: int) -> None:
    check(cached, tmp_path / "cache", seed)
