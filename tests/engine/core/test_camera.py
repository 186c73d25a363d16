import numpy as np
import pytest

from engine.core.camera import camera_frame, camera_plane, centre_directions, pixel_directions
from engine.scene.description import CameraDescription

CAMERA = CameraDescription(position=(0, 0, 3), target=(0, 0, 0), fov_y=90.0, resolution=(6, 4))


def test_the_frame_is_orthonormal_and_right_handed():
    frame = camera_frame(CameraDescription(position=(1, 2, 3), target=(-2, 0.5, 1), up=(0, 5, 1)))
    assert np.allclose(frame @ frame.T, np.eye(3), atol=1e-14)
    right, up, forward = frame
    assert np.allclose(np.cross(right, up), -forward)  # the camera looks along −Z of its own frame
    assert up[1] > 0


def test_fov_spans_the_height_and_pixels_are_square():
    # at 90° the upper edge is 45° up; 6:4 pixels make the right edge tan = 1.5
    assert pixel_directions(CAMERA, (6, 4), 3.0, 0.0) == pytest.approx([0, 0.5**0.5, -(0.5**0.5)], abs=1e-6)
    x, y, z = pixel_directions(CAMERA, (6, 4), 6.0, 2.0)
    assert x / -z == pytest.approx(1.5) and y == pytest.approx(0, abs=1e-7)


def test_rays_go_through_pixel_centres_row_0_on_top():
    directions = centre_directions(CAMERA, (6, 4))
    assert directions.shape == (4, 6, 3) and directions.dtype == np.float32
    assert np.allclose(np.linalg.norm(directions, axis=2), 1, atol=1e-6)
    assert directions[0, 0, 1] > 0 > directions[3, 0, 1]  # up is up
    assert directions[0, 0, 0] < 0 < directions[0, 5, 0]  # and right is right
    # the four pixels about the middle are half a pixel off: tan = 0.5 / 2
    assert directions[1, 3, 0] / -directions[1, 3, 2] == pytest.approx(0.25)


def test_agrees_with_the_reference_renderer(shared_reference):
    """The formula of render_reference.py, spelled out here: rays through pixel centres."""
    from engine.scene.description import load_description

    camera = load_description(shared_reference / "teatray.toml").camera
    eye, target = np.array(camera.position), np.array(camera.target)
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    half = np.tan(np.radians(camera.fov_y) / 2)
    y, x = np.mgrid[0:240, 0:320]
    sx, sy = ((x + 0.5) / 320 * 2 - 1) * half * 320 / 240, (1 - (y + 0.5) / 240 * 2) * half
    d = forward + sx[..., None] * right + sy[..., None] * up
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    assert np.abs(centre_directions(camera, (320, 240)) - d).max() < 1e-7


def test_the_plane_leads_through_the_same_places_of_the_picture():
    corner, right, down = camera_plane(CAMERA, (6, 4))
    for column, row in ((0.0, 0.0), (6.0, 4.0), (2.5, 1.25)):
        towards = corner + column * right + row * down
        expected = pixel_directions(CAMERA, (6, 4), column, row)
        assert towards / np.linalg.norm(towards) == pytest.approx(expected, abs=1e-6)
    assert corner @ camera_frame(CAMERA)[2] == pytest.approx(1.0)  # at depth 1
