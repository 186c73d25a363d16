"""Another camera: the same bits as of a scene whose file has it, and what was computed from there is found again."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from app.messages.worker_messages import RequestFailed, SetCamera, ViewTraced
from app.modes.placement.placement_messages import IndirectFound, LayerPicture, StageDone
from app.worker import executor, indirect_tasks
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.precompute.direct.pipeline import Placement
from engine.scene.description import Camera
from engine.scene.picture_frame import Lamps
from tests.app.worker.ball_and_lamp import SCENE, assert_same_pictures, compute, pictures
from tests.opened import ask_for_scene, open_in_process
from tests.quick_indirect import QUICK

OWN = "position = [0.4, 1.6, 2.6]\ntarget = [0, 0.3, 0]\nfov_y = 45\n"
OTHER = "position = [-1.9, 0.8, 2.2]\ntarget = [0.1, 0.3, 0]\nfov_y = 35\n"
ASIDE = Camera(position=(-1.9, 0.8, 2.2), target=(0.1, 0.3, 0.0), fov_y=35.0)
AWAY = Camera(position=(-1.9, 0.8, 2.2), target=(-1.9, 9.0, 2.3))
RESOLUTION = (24, 18)


def written(path: Path, text: str) -> str:
    path.write_text(text)
    return str(path)


def computed(client: InProcessClient) -> dict[str, np.ndarray]:
    client.send(compute())
    return pictures(client.poll(float("inf")))


def parts_of(value: np.ndarray | Lamps) -> tuple[np.ndarray, ...]:
    return value if isinstance(value, tuple) else (value,)


def test_it_sees_what_a_scene_with_that_camera_shows(tmp_path: Path) -> None:
    plain = written(tmp_path / "plain.toml", SCENE)
    moved = written(tmp_path / "moved.toml", SCENE.replace(OWN, OTHER))
    frames, found = [], []
    for source, camera in ((moved, None), (plain, ASIDE)):
        client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / Path(source).stem)))
        scene = ask_for_scene(client, source, resolution=RESOLUTION) - 1
        client.poll(float("inf"))
        if camera is not None:
            computed(client)  # the picture from where it was seen first, of which nothing is to stay
            client.send(SetCamera(scene, camera, RESOLUTION))
            (seen,) = (a for a in client.poll(float("inf")) if isinstance(a, ViewTraced))
        else:
            seen = open_in_process(RequestDispatcher(), source, resolution=RESOLUTION)[-1]
        frames.append(seen.frame)
        found.append(computed(client))
    for field in fields(frames[0]):
        for mine, theirs in zip(*(parts_of(getattr(frame, field.name)) for frame in frames), strict=True):
            np.testing.assert_array_equal(mine, theirs)
    assert_same_pictures(found[1], found[0])


def test_going_back_finds_what_was_computed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = written(tmp_path / "scene.toml", SCENE)
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    scene = ask_for_scene(client, source, resolution=RESOLUTION) - 1
    client.poll(float("inf"))
    expected = computed(client)
    client.send(SetCamera(scene, ASIDE, RESOLUTION))
    computed(client)
    client.send(SetCamera(scene, None, RESOLUTION))
    client.poll(float("inf"))
    monkeypatch.delattr(executor, "project_layer")
    monkeypatch.delattr(Placement, "light")
    # Nothing is seen or projected again, and there is no coarse picture before the final one.
    client.send(compute())
    answers = client.poll(float("inf"))
    assert {a.stage for a in answers if isinstance(a, LayerPicture | StageDone)} == {"final"}
    assert_same_pictures(pictures(answers), expected)


def test_a_kept_picture_waits_for_the_first_light_between_surfaces_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(indirect_tasks, "FINE", QUICK)
    source = written(tmp_path / "scene.toml", SCENE)
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    scene = ask_for_scene(client, source, resolution=RESOLUTION) - 1
    client.poll(float("inf"))
    computed(client)  # its direct light is kept, of light between surfaces nothing is known yet
    client.send(SetCamera(scene, ASIDE, RESOLUTION))
    client.send(SetCamera(scene, None, RESOLUTION))
    client.poll(float("inf"))
    client.send(compute(n_bounces=2))
    answers = client.poll(float("inf"))
    told = [(type(a), a.stage) for a in answers if isinstance(a, LayerPicture | IndirectFound | StageDone)]
    first = [(IndirectFound, "rough"), (StageDone, "coarse")]
    assert told == [(LayerPicture, "final")] * 3 + first + [(IndirectFound, "fine"), (StageDone, "final")]


def test_a_camera_that_sees_nothing_is_looked_away_from_again(tmp_path: Path) -> None:
    source = written(tmp_path / "scene.toml", SCENE)
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    scene = ask_for_scene(client, source, resolution=RESOLUTION) - 1
    client.poll(float("inf"))
    expected = computed(client)
    client.send(SetCamera(scene, AWAY, RESOLUTION))
    (*_, seen) = client.poll(float("inf"))
    assert isinstance(seen, ViewTraced) and not seen.frame.n_points
    client.send(SetCamera(scene, None, RESOLUTION))
    client.poll(float("inf"))
    assert_same_pictures(computed(client), expected)


def test_a_look_at_a_scene_that_is_gone_is_refused(tmp_path: Path) -> None:
    source = written(tmp_path / "scene.toml", SCENE)
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    ask_for_scene(client, source, resolution=RESOLUTION)
    client.poll(float("inf"))
    client.send(SetCamera(99, ASIDE, RESOLUTION))
    (*_, failed) = client.poll(float("inf"))
    assert isinstance(failed, RequestFailed) and failed.line == "no scene is open"
