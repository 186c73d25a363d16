"""Images sampled by the worker, and their thumbnails."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.messages.worker_messages import ViewTraced
from app.modes.placement.placement_messages import MapsRefused, MapsSampled, SampleMaps
from app.worker.cache import ArrayCache
from app.worker.map_tasks import thumbnail
from app.worker.tasks import RequestDispatcher
from engine.material.layer_maps import Images
from engine.material.strokes import Stroke, Strokes, pack_dabs
from engine.texture.pyramid import make_pyramid
from tests.opened import open_in_process, run_in_process
from tests.scene_text import LAMBERT, camera, placed

SCENE = camera((0, 0, 3), 20, (12, 12)) + placed("card", "quad", more=LAMBERT)
SCENE += placed("bare", "bare.obj", more=LAMBERT)


@pytest.fixture
def tasks(tmp_path: Path) -> RequestDispatcher:
    (tmp_path / "scene.toml").write_text(SCENE)
    (tmp_path / "bare.obj").write_text("v -0.1 -0.1 1\nv 0.1 -0.1 1\nv 0 0.1 1\nf 1 2 3\n")
    Image.fromarray(np.full((4, 4, 3), (255, 188, 0), np.uint8)).save(tmp_path / "tan.png")
    Image.fromarray(np.full((4, 4), 51, np.uint8)).save(tmp_path / "fifth.png")
    tasks = RequestDispatcher(ArrayCache(tmp_path / "cache"))
    assert isinstance(open_in_process(tasks, str(tmp_path / "scene.toml"))[-1], ViewTraced)
    return tasks


def test_each_layer_is_answered_on_its_own(tasks: RequestDispatcher) -> None:
    images, missing = Images("tan.png", weight="fifth.png"), Images("gone.png")
    request = SampleMaps((("card.0", images), ("card.1", missing), ("bare.0", images)))
    sampled, refused, without = run_in_process(tasks, request)
    assert isinstance(sampled, MapsSampled) and (sampled.key, sampled.images) == ("card.0", images)
    assert sampled.samples.dtype == np.float16 and sampled.samples.shape[1] == 4
    # sRGB (255, 188, 0) is (1, 0.503, 0); 51 of 255 is a fifth.
    np.testing.assert_allclose(sampled.samples, np.tile([1.0, 0.503, 0.0, 0.2], (len(sampled.samples), 1)), atol=1e-3)
    assert sampled.means.weight == pytest.approx(0.2) and sampled.means.both[0] == pytest.approx(0.2)
    assert set(sampled.thumbnails) == {"texture", "weight"}
    assert sampled.thumbnails["texture"].shape == (4, 4, 3)
    assert (sampled.thumbnails["texture"] == (255, 188, 0)).all() and (sampled.thumbnails["weight"] == 51).all()
    assert isinstance(refused, MapsRefused) and "gone.png" in refused.line and "\n" not in refused.line
    assert isinstance(without, MapsSampled) and sampled.note == ""
    np.testing.assert_allclose(without.samples, np.tile([1.0, 0.503, 0.0, 0.2], (len(without.samples), 1)), atol=1e-3)
    assert without.note == "bare: no texture coordinates, so images are projected from the sides of its box"


def test_thumbnails_are_small_and_keep_their_aspect() -> None:
    image = np.zeros((100, 400, 3), np.float32)
    image[:, 200:] = 1.0
    small = thumbnail(make_pyramid(image))
    assert small.shape == (16, 64, 3) and small.flags.c_contiguous
    assert (small[:, 1:30] == 0).all() and (small[:, 34:-1] == 255).all()


def test_strokes_are_painted_where_the_camera_sees_them_also_without_texture_coordinates(
    tasks: RequestDispatcher,
) -> None:
    far = Stroke(0.05, dabs=pack_dabs([0.0, 0.0, 1.0], [0.0, 0.0, 1.0]), hardness=1.0)
    images = Images(weight_start=0.0, strokes=Strokes((far,)))
    (found,) = run_in_process(tasks, SampleMaps((("bare.0", images),)))
    assert isinstance(found, MapsSampled)
    weight = found.samples[:, 3]
    assert weight.max() == 1.0 and (found.samples[:, :3] == 1.0).all() and 0.0 < found.means.weight < 1.0
    assert found.thumbnails["weight"].max() == 255
    dab = Stroke(0.05, dabs=pack_dabs([0.06, -0.06, 1.0], [0.0, 0.0, 1.0]))
    more = Images(weight_start=0.0, strokes=images.strokes.with_dabs(dab))
    (then,) = run_in_process(tasks, SampleMaps((("bare.0", more),)))
    assert isinstance(then, MapsSampled) and then.means.weight > found.means.weight
