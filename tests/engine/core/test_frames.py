import numpy as np
import pytest

from engine.core.frames import local_frames, orthonormal, sphere_frames


@pytest.fixture
def pairs() -> tuple[np.ndarray, np.ndarray]:
    """Tangents and normals (20, 3), perpendicular."""
    frames = np.linalg.qr(np.random.default_rng(3).normal(size=(20, 3, 3)))[0]
    return frames[:, 0], frames[:, 1]


def test_both_orders_are_rotations_that_agree(pairs) -> None:
    local, sphere = local_frames(*pairs), sphere_frames(*pairs)
    for frames in (local, sphere):
        assert np.allclose(frames @ frames.swapaxes(1, 2), np.eye(3), atol=1e-12)
        assert np.allclose(np.linalg.det(frames), 1.0)
    assert np.array_equal(local[:, 2], sphere[:, 1])
    assert np.allclose(local[:, 1], -sphere[:, 2])  # across is minus the bitangent


def test_frames_of_the_sphere_have_the_precision_of_what_they_are_made_of(pairs) -> None:
    single = sphere_frames(*(each.astype(np.float32) for each in pairs))
    assert single.dtype == np.float32 and sphere_frames(*pairs).dtype == np.float64


def test_axes_are_orthonormalized_about_the_normal(pairs) -> None:
    skewed = local_frames(*pairs)
    skewed[:, 0] += 0.5 * skewed[:, 2]  # the tangent leans towards the normal
    skewed[:, 2] *= 3.0
    found = orthonormal(skewed, np.broadcast_to(np.eye(3), skewed.shape))
    assert np.allclose(found, local_frames(*pairs), atol=1e-12)


def test_vectors_without_length_are_taken_from_the_other_axes() -> None:
    axes = np.eye(3)[None]
    found = orthonormal(np.zeros((1, 3, 3)), axes)
    assert np.allclose(found, axes)
