"""Filling the cache: the bytes that an editor keeps, in memory that the size of the transport does not decide."""

import tracemalloc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import app.cli.precompute as filling
from app.cli.precompute import precompute
from app.document.commands.layers import SetVisible
from app.messages.worker_messages import Progress
from app.project.project import open_project
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.render.error_estimate import WHAT
from tests.scene_text import camera, ground, material, placed

N_LIGHTS = 401  # more than a preview has, so that it is kept

SCENE = ground((160, 120), gloss=True)


@pytest.fixture
def scene(tmp_path: Path) -> str:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return str(path)


def entries(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_it_keeps_what_the_editor_keeps_bit_by_bit(scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    precompute(
        open_project(scene, (40, 30)).with_settings(n_lights=N_LIGHTS),
        lambda progress: None,
        ArrayCache(tmp_path / "filled"),
    )
    monkeypatch.setattr(filling, "RequestDispatcher", lambda store, fills, executor: RequestDispatcher(store))
    precompute(
        open_project(scene, (40, 30)).with_settings(n_lights=N_LIGHTS),
        lambda progress: None,
        ArrayCache(tmp_path / "worker"),
    )
    assert len(entries(tmp_path / "worker")) == 4  # visibility, two layers, and the unit they are in
    assert entries(tmp_path / "filled") == entries(tmp_path / "worker")


def test_what_is_on_disk_is_not_held(scene: str, tmp_path: Path) -> None:
    """From the first tile on, memory grows by much less than the transport, which is about all that comes."""
    begun: list[int] = []
    peaks: list[int] = []

    def watch(progress: Progress) -> None:
        if progress.text != "shadows" and progress.stage == "final" and not begun:
            begun.append(tracemalloc.get_traced_memory()[0])
            tracemalloc.reset_peak()
        elif progress.stage == WHAT:  # what that takes does not grow with the transport
            peaks.append(tracemalloc.get_traced_memory()[1])

    project = open_project(scene).with_settings(n_lights=N_LIGHTS)
    tracemalloc.start()
    try:
        done = precompute(project, watch, ArrayCache(tmp_path / "cache"))
    finally:
        tracemalloc.stop()
    assert done.n_bytes > 12e6
    assert peaks[0] - begun[0] < 0.35 * done.n_bytes


def test_what_is_hidden_leaves_an_empty_picture(scene: str, tmp_path: Path) -> None:
    project = open_project(scene, (8, 6)).with_settings(n_lights=N_LIGHTS)
    for key, _ in project.document.layers():
        project = replace(project, document=SetVisible(key, False).apply(project.document))
    done = precompute(project, lambda progress: None, ArrayCache(tmp_path / "cache"))
    assert done.error.is_negligible


def test_a_map_has_the_transport_of_its_nodes(tmp_path: Path) -> None:
    """As in the editor, which would find nothing of its layers in the cache otherwise."""
    Image.fromarray(np.arange(64, dtype=np.uint8).reshape(8, 8) * 4).save(tmp_path / "worn.png")
    worn = 'parameter_maps = { alpha = { map = "worn.png", range = [0.2, 0.6] } }'
    layer = material(f'model = "rough_conductor", {worn}')
    (tmp_path / "scene.toml").write_text(camera((0, 0, 3), 40, (6, 4)) + placed("ball", "sphere", more=layer))
    project = open_project(str(tmp_path / "scene.toml"))
    filled = filling.fill(project, lambda step: None, ArrayCache(tmp_path / "cache"))
    assert [layer.key for layer in filled.scene.visible] == list(project.layers) and len(project.layers) > 2
