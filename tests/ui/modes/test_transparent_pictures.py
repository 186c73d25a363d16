"""Alpha in Orbit's and Deform's moving pictures: the shaders leave out the environment as compiled code does."""

from __future__ import annotations

from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.project.project import Project, open_project
from tests.scene_text import LAMBERT, camera, environment, facing_down, placed, scaled
from tests.ui.modes.moving_pictures import deform_pictures, orbit_pictures

pytestmark = pytest.mark.gl

SIZE = 64, 48


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """A cube and a lamp before a bright sky."""
    text = camera((0.0, 0.5, 3.0), 40, SIZE, (0, 0, 0), "bounces = 1\n") + environment((5.0, 6.0, 7.0))
    text += placed("cube", "cube", scaled(0.5), LAMBERT)
    text += placed("lamp", "quad", facing_down(0.3, (0.0, 0.9, 0.5)), "emission = [4, 3, 2]\n")
    (tmp_path / "scene.toml").write_text(text)
    return open_project(str(tmp_path / "scene.toml"))


def assert_alike(found: np.ndarray, expected: np.ndarray) -> None:
    """found and expected (H, W, 4), but for pixels at edges."""
    assert found.shape == expected.shape == (48, 64, 4)
    off = np.abs(found - expected).max(axis=2)
    assert np.count_nonzero(off > 0.05) < 0.04 * off.size and np.median(off) < 2e-3
    for picture in (found, expected):
        assert not picture[:4, :4].any() and picture[24, 32, 3] == 1.0 and picture[24, 32, :3].min() > 0.0


def test_orbit_leaves_out_the_environment(project: Project, context: moderngl.Context) -> None:
    assert_alike(*orbit_pictures(project, context, SIZE, transparent=True)[1])


def test_deform_leaves_out_the_environment(project: Project, context: moderngl.Context) -> None:
    assert_alike(*deform_pictures(project, context, SIZE, transparent=True))
