"""The committed textures and weight maps: small, what the generators make, and without a seam where they repeat."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from assets.generate.plate import HALF, meshes, oak
from assets.generate.scenes import IMAGES, SCENES

ASSETS = Path(__file__).resolve().parents[2] / "assets"


@pytest.mark.parametrize("name", IMAGES)
def test_generator_makes_the_committed_images(name: str) -> None:
    images = IMAGES[name]()
    folder = ASSETS / "scenes" / name
    there = [path for path in folder.iterdir() if path.suffix in (".png", ".jpg")]
    assert sorted(images) == sorted(path.name for path in there) and name in SCENES
    for path in there:
        assert path.stat().st_size < 200_000
        with Image.open(path) as picture:
            committed = np.asarray(picture).astype(int)
        assert committed.shape == images[path.name].shape
        # The same to how another processor rounds a sine, and to what a JPEG leaves out.
        assert np.abs(committed - images[path.name]).mean() < (0.05 if path.suffix == ".png" else 3.0)


def test_oak_repeats_without_a_seam() -> None:
    pixels = oak().astype(float)
    for axis in (0, 1):
        rows = np.moveaxis(pixels, axis, 0)
        steps = np.abs(np.diff(rows, axis=0)).mean(axis=(1, 2))
        assert np.abs(rows[0] - rows[-1]).mean() < 1.5 * steps.max()


def test_the_plate_lies_within_its_painting() -> None:
    plate = meshes()["plate"]
    assert plate.coordinates is not None and 0.0 < plate.coordinates.min() and plate.coordinates.max() < 1.0
    # From above: to the right is to the right, and what is far away is up.
    right, far = plate.positions[:, 0].argmax(), plate.positions[:, 2].argmin()
    radius = 0.5 + plate.positions[right, 0] / (2 * HALF)
    np.testing.assert_allclose(plate.coordinates[[right, far]], [[radius, 0.5], [0.5, radius]], atol=1e-6)
