"""One picture of everything at once, compared with the image that stands in tests/golden.

Made on Mesa's llvmpipe; other rasterizers may round differently, hence 3 of 255 at a pixel and 0.2 on average.
To accept a new look: INSITU_ACCEPT_GOLDEN=1 python -m pytest tests/ui/gl/test_golden_picture.py, and look at it.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.scene.picture_frame import PictureFrame
from ui.gl.display import DisplayView
from ui.modes.placement.gl.renderer import PlacementRenderer

pytestmark = pytest.mark.gl

GOLDEN = Path(__file__).resolve().parents[2] / "golden" / "placement_composite.png"
WIDTH, HEIGHT = 96, 64


def test_the_picture_looks_as_it_did(renderer: PlacementRenderer, tmp_path: Path) -> None:
    _compose(renderer)
    image = renderer.display_image()
    if os.environ.get("INSITU_ACCEPT_GOLDEN"):
        Image.fromarray(image).save(GOLDEN)
    reference = np.asarray(Image.open(GOLDEN).convert("RGB"))
    difference = np.abs(image.astype(int) - reference.astype(int))
    if difference.max() > 3 or difference.mean() > 0.2:
        for name, pixels in (("image", image), ("reference", reference), ("difference", difference.astype(np.uint8))):
            Image.fromarray(pixels).save(tmp_path / f"{name}.png")
        raise AssertionError(f"largest difference {difference.max()}, mean {difference.mean():.3f}: see {tmp_path}")


def _compose(renderer: PlacementRenderer) -> None:
    """A ball before a wall under a coloured sky: Lambert and a lobe on the ball, an emitter, outline, A/B divider."""
    frame, normals = _ball_and_wall()
    renderer.set_frame(frame)
    renderer.set_environment(_sky(), rotation_degrees=30.0, intensity=0.8)
    n_ball, n_wall = np.diff(frame.object_ranges, axis=1)[:2, 0]
    sun = np.array([0.4, 0.7, 0.6]) / np.linalg.norm([0.4, 0.7, 0.6])
    cosine = np.clip(normals @ sun, 0.0, 1.0)
    renderer.set_layer("ball.0", 0, int(n_ball))
    renderer.set_layer_radiance("ball.0", cosine[:, None] * np.array([0.5, 0.12, 0.08]))
    renderer.set_view_curve("ball.0", np.repeat(np.cos(np.linspace(0, np.pi / 2, 256))[:, None], 3, axis=1))
    lobes = np.stack([cosine**k for k in (8, 32, 128)])[:, :, None] * np.ones(3)
    renderer.set_layer("ball.1", 0, int(n_ball))
    renderer.begin_transport("ball.1", lobes.astype(np.float32), np.sqrt((lobes**2).sum(axis=1)))
    renderer.set_layer("wall.0", 1, int(n_wall))
    shade = np.linspace(0.05, 0.6, int(n_wall))
    renderer.set_layer_radiance("wall.0", shade[:, None] * np.array([1.0, 0.95, 0.85]))
    renderer.composite(DisplayView())
    renderer.snapshot_compare()
    while not renderer.upload(1.0):
        pass
    renderer.want("ball.1", np.array([[0.1, 0.1, 0.1], [0.5, 0.5, 0.6], [2.0, 2.0, 1.8]]))
    while not renderer.update().exact:
        pass
    renderer.composite(DisplayView(exposure=0.5, selected=0, compare_divider=0.4))


def _ball_and_wall() -> tuple[PictureFrame, np.ndarray]:
    """(frame, the ball's normals (p,3)); object 0 the ball, 1 the wall, 2 an emitter."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    right, up = (x - 44.0) / 22.0, (34.0 - y) / 22.0
    objects = np.full((HEIGHT, WIDTH), -1, dtype=np.int16)
    objects[40:, :] = 1
    objects[6:14, 72:88] = 2
    objects[right**2 + up**2 < 1.0] = 0
    ball, wall = (np.flatnonzero(objects.ravel() == i) for i in (0, 1))
    normals = np.stack([right, up, np.sqrt(np.clip(1.0 - right**2 - up**2, 0.0, 1.0))], axis=-1).reshape(-1, 3)[ball]
    rays = np.stack([(x - 48.0) / 48.0, (32.0 - y) / 48.0, -np.ones_like(x)], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    emission = np.zeros((HEIGHT, WIDTH, 3))
    emission[objects == 2] = (3.0, 2.5, 1.5)
    beside = np.flatnonzero((objects[:, 1:] == -1).ravel() & (objects[:, :-1] == 0).ravel())
    edge = (beside // (WIDTH - 1)) * WIDTH + beside % (WIDTH - 1)
    theta_o = np.concatenate([np.arccos(np.clip(normals[:, 2], 0.0, 1.0)), np.full(len(wall), 1.0)])
    n = len(ball), len(ball) + len(wall)
    frame = PictureFrame(
        pixel=np.concatenate([ball, wall]),
        object_ranges=np.array([[0, n[0]], [n[0], n[1]], [n[1], n[1]]]),
        object_image=objects,
        theta_o=theta_o,
        emission_image=emission,
        ray_directions=rays,
        share=np.concatenate([np.where(np.isin(ball, edge), 0.5, 1.0), np.ones(len(wall))]),
        open_image=np.where(np.isin(np.arange(objects.size), edge).reshape(objects.shape), 0.5, objects < 0),
    )
    return frame, normals


def _sky() -> np.ndarray:
    """Blue above, warm below, a band of colour around; (16,32,3)."""
    v, u = np.mgrid[:16, :32] / np.array([16.0, 32.0])[:, None, None]
    return np.stack([0.3 + 0.3 * v, 0.4 + 0.1 * np.sin(2 * np.pi * u), 0.9 - 0.6 * v], axis=-1)
