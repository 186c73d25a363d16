"""Objects become fixed and editable while the picture stays: the real worker's tasks under the real renderer."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetEditable
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.curve.operators import Operator
from tests.ui.small_scene import SCENE, linear_picture, opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl
LIFT = Operator("amplify", "y", 0.0, 0.0, 1.5, 1.57, magnitude=2.0)
GROUND_IS_FIXED = SCENE.replace('name = "ground"\n', 'name = "ground"\neditable = false\n')


@pytest.fixture
def window(context: moderngl.Context, tmp_path: Path) -> Iterator[HeadlessWindow]:
    """The small scene with more lights in the final stage than in the preview, its ground fixed."""
    file = write_small_scene(tmp_path, GROUND_IS_FIXED)
    with opened_window(
        context, file, InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache"))), n_lights=600
    ) as opened:
        wait_until_exact(opened)
        yield opened


def pictures_until_exact(window: HeadlessWindow) -> Iterator[np.ndarray]:
    """The picture after every frame until it is exact again."""
    for i_frame in range(100_000):
        window.frame()
        yield linear_picture(window)
        if i_frame > 2 and window.shell.editor.status.picture == "exact":
            return


def test_the_picture_stays_while_bands_come_and_go(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    before, transport = linear_picture(window), editor.status.precomputed_mb
    states = set()
    for is_editable in (True, False):
        editor.do(SetEditable("ground", is_editable))
        for picture in pictures_until_exact(window):
            states.add(editor.status.picture)
            # Half floats of the ball's selected curve are rounded anew at most.
            np.testing.assert_allclose(picture, before, rtol=2e-3, atol=3e-4)
        assert (editor.status.precomputed_mb > transport) == is_editable
    assert states == {"refining", "exact"}
    assert editor.status.precomputed_mb == transport


def test_a_curve_follows_once_its_object_is_editable(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.select("ground.0.theta_i")
    wait_until_exact(window)
    before = linear_picture(window)
    editor.do(SetEditable("ground", True))
    wait_until_exact(window)
    editor.do(AddOperator("ground.0", "theta_i", LIFT))
    wait_until_exact(window)
    ground = np.s_[-12:, :]
    # Lambert's curve is doubled up to 86 degrees: the ground is twice as bright but for grazing light.
    ratio = linear_picture(window)[ground] / before[ground]
    assert 1.8 < ratio.min() and ratio.max() < 2.001
    editor.do(SetEditable("ground", False))
    wait_until_exact(window)
    np.testing.assert_allclose(linear_picture(window)[ground], ratio * before[ground], rtol=2e-3)
