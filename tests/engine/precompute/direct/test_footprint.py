"""Samples that stand for pixels: of their own object, nearest first, weights that sum to one."""

import numpy as np
import pytest

from engine.precompute.direct.pipeline import Placement, footprint, lattice_rows
from engine.scene.scene_loader import load_scene

SCENE = """version = 1
[camera]
position = [0, 1.5, 3]
target = [0, 0.3, 0]
resolution = [50, 37]
[[object]]
name = "ground"
primitive = "quad"
transform = [4,0,0,0, 0,0,4,0, 0,-4,0,0, 0,0,0,1]
[[object]]
name = "box"
primitive = "cube"
transform = [0.8,0,0,0, 0,0.8,0,0.4, 0,0,0.8,0, 0,0,0,1]
[[object]]
name = "bead"
primitive = "cube"
transform = [0.02,0,0,1.1, 0,0.06,0,0.1, 0,0,0.02,0.8, 0,0,0,1]
"""


@pytest.fixture(scope="module")
def placement(tmp_path_factory: pytest.TempPathFactory) -> Placement:
    path = tmp_path_factory.mktemp("footprint") / "scene.toml"
    path.write_text(SCENE)
    return Placement(load_scene(path))


@pytest.mark.parametrize("stride", [1, 4, 8, 16])
def test_a_lattice_has_every_object_and_no_more_than_its_pixels(placement: Placement, stride: int) -> None:
    rows, hits = lattice_rows(placement.hits, stride), placement.hits
    x, y = hits.pixel[rows] % 50, hits.pixel[rows] // 50
    off = (x % stride != 0) | (y % stride != 0)
    assert (np.diff(rows) > 0).all()
    for begin, end in hits.object_ranges:
        own = (rows >= begin) & (rows < end)
        # A bead of a few pixels between the lattice's points gets one of its own.
        assert own.any() and (not off[own].any() or own.sum() == 1)


@pytest.mark.parametrize("stride", [4, 8])
def test_samples_belong_to_the_pixels_object(placement: Placement, stride: int) -> None:
    hits, samples = placement.hits, lattice_rows(placement.hits, stride)
    chosen, weights = footprint(hits, samples, stride)
    assert chosen.shape == weights.shape == (len(hits.pixel), 4)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, atol=1e-6)
    assert (weights >= 0).all()
    for begin, end in hits.object_ranges:
        n_own = ((samples >= begin) & (samples < end)).sum()
        assert chosen[begin:end].max() < n_own


def test_a_sample_stands_for_itself(placement: Placement) -> None:
    hits, samples = placement.hits, lattice_rows(placement.hits, 4)
    chosen, weights = footprint(hits, samples, 4)
    for begin, end in hits.object_ranges:
        own = samples[(samples >= begin) & (samples < end)]
        np.testing.assert_array_equal(own[chosen[own, 0]], own)
        # A field is met exactly at the samples, to the weight of their neighbours.
        assert (weights[own, 0] > 0.7).all()


def test_faces_do_not_bleed_over_an_edge(placement: Placement) -> None:
    # The box shows faces that meet at a right angle; what differs between them stays apart.
    hits, samples = placement.hits, lattice_rows(placement.hits, 2)
    chosen, weights = footprint(hits, samples, 2)
    begin, end = hits.object_ranges[1]
    own = samples[(samples >= begin) & (samples < end)]
    upward = (hits.normal[:, 1] > 0.9).astype(float)
    shown = (upward[own][chosen[begin:end]] * weights[begin:end]).sum(axis=1)
    assert 0 < upward[own].mean() < 1
    assert np.abs(shown - upward[begin:end]).max() < 0.05


@pytest.mark.parametrize("stride", [2, 4, 16])
def test_the_samples_are_the_nearest_there_are(placement: Placement, stride: int) -> None:
    hits, samples = placement.hits, lattice_rows(placement.hits, stride)
    chosen, _ = footprint(hits, samples, stride)
    place = np.concatenate([np.stack(np.divmod(hits.pixel, 50), axis=1) / stride, 4.0 * hits.normal], axis=1)
    for begin, end in hits.object_ranges:
        own = place[samples[(samples >= begin) & (samples < end)]]
        away = np.linalg.norm(place[begin:end, None] - own[None], axis=2)
        found = np.sort(np.take_along_axis(away, chosen[begin:end].astype(np.int64), axis=1), axis=1)
        n_known = min(4, len(own))
        np.testing.assert_allclose(found[:, -n_known:], np.sort(away, axis=1)[:, :n_known], atol=1e-6)
