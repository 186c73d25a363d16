"""Indirect light in the window: it follows the hand, on every object, and is what a fresh computation gives."""

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetParameter, SetVisible
from app.document.commands.plan import SetFirstBands
from app.document.view_state import SetView
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.curve.operators import Operator
from tests.ui.small_scene import SCENE, linear_picture, opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow

pytestmark = pytest.mark.gl
LIFT = Operator("amplify", "y", 0.0, 0.0, 1.2, 1.4, magnitude=2.5)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write_small_scene(tmp_path, SCENE.replace("bounces = 1", "bounces = 3"))


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What one test's window had computed, the next one's finds on disk."""
    return tmp_path_factory.mktemp("kept")


@pytest.fixture
def window(context: moderngl.Context, file: Path, kept: Path) -> Iterator[HeadlessWindow]:
    with opened_window(context, file, client(kept), n_lights=400) as opened:
        wait_until_exact(opened)
        yield opened


def client(folder: Path) -> InProcessClient:
    return InProcessClient(RequestDispatcher(ArrayCache(folder / "cache")))


def on_object(window: HeadlessWindow, picture: np.ndarray, name: str) -> np.ndarray:
    """The pixels (P, 3) of a picture that see an object."""
    source = window.shell.source
    frame = source.source.renderer.frame  # type: ignore[union-attr]
    index = [state.name for state in window.shell.editor.document.objects].index(name)
    return picture[frame.object_image == index]


def difference(one: np.ndarray, two: np.ndarray) -> float:
    return float(np.sqrt(np.mean((one - two) ** 2)) / np.mean(two))


def test_a_curve_changes_the_neighbours_and_undo_brings_all_back(window: HeadlessWindow) -> None:
    editor, before = window.shell.editor, linear_picture(window)
    editor.select("ball.1.theta_h")
    wait_until_exact(window)
    selected = linear_picture(window)
    assert difference(selected, before) < 2e-3  # half floats of another curve
    editor.do(AddOperator("ball.1", "theta_h", LIFT))
    wait_until_exact(window)
    lifted = linear_picture(window)
    assert on_object(window, lifted, "ground").mean() > 1.002 * on_object(window, selected, "ground").mean()
    editor.undo()
    wait_until_exact(window)
    np.testing.assert_allclose(linear_picture(window), selected, rtol=1e-5, atol=1e-6)


def test_edits_after_freezing_are_a_fresh_computation(
    window: HeadlessWindow, context: moderngl.Context, file: Path, tmp_path: Path
) -> None:
    edits = (AddOperator("ball.1", "theta_h", LIFT), SetParameter("ball.0", "albedo", (0.3, 0.3, 0.1)))
    editor = window.shell.editor
    editor.select("ball.1.theta_h")
    wait_until_exact(window)
    for edit in edits:
        assert editor.do(edit) is None
    wait_until_exact(window)
    with opened_window(context, file, client(tmp_path / "other"), n_lights=400) as fresh:
        for edit in edits:
            assert fresh.shell.editor.do(edit) is None
        wait_until_exact(fresh)
        assert difference(linear_picture(window), linear_picture(fresh)) < 0.005


def test_bounces_add_light_and_go_again(
    window: HeadlessWindow, context: moderngl.Context, file: Path, tmp_path: Path
) -> None:
    more = linear_picture(window)
    window.shell.editor.do(SetView.of(n_bounces=1))
    wait_until_exact(window)
    direct = linear_picture(window)
    added = on_object(window, more, "ground") - on_object(window, direct, "ground")
    assert added.min() > -1e-4 and added.max() > 0.01
    window.shell.editor.do(SetView.of(n_bounces=3))
    wait_until_exact(window)
    np.testing.assert_allclose(linear_picture(window), more, rtol=1e-4, atol=1e-5)


def test_bounces_are_planned_where_the_scene_names_none(
    window: HeadlessWindow, context: moderngl.Context, tmp_path: Path
) -> None:
    folder = tmp_path / "planned"
    folder.mkdir()
    scene = write_small_scene(folder, SCENE.replace("bounces = 1\n", ""))
    with opened_window(context, scene, client(folder), n_lights=400) as planned:
        wait_until_exact(planned)
        n_bounces = planned.shell.editor.view.settings.n_bounces
        assert n_bounces > 1 and planned.shell.editor.controller.indirect.picture.is_shown
        window.shell.editor.do(SetView.of(n_bounces=n_bounces))
        wait_until_exact(window)
        assert difference(linear_picture(planned), linear_picture(window)) < 2e-3


def test_fewer_bands_of_either_bounce_are_another_picture(window: HeadlessWindow) -> None:
    editor, before = window.shell.editor, linear_picture(window)
    editor.do(SetView.of(second_bands=1))
    wait_until_exact(window)
    assert difference(linear_picture(window), before) > 1e-4
    editor.do(SetView.of(second_bands=None))
    editor.do(SetFirstBands(4))
    wait_until_exact(window)
    assert difference(linear_picture(window), before) > 1e-2
    assert max(n for _, counts in editor.status.bands for n in counts) == 4
    editor.undo()
    wait_until_exact(window)
    np.testing.assert_allclose(linear_picture(window), before, rtol=1e-5, atol=1e-6)


def test_what_is_hidden_sends_no_light_on(window: HeadlessWindow) -> None:
    editor = window.shell.editor
    editor.select("ground.0.theta_i")
    wait_until_exact(window)
    before = on_object(window, linear_picture(window), "ground")
    editor.do(SetVisible("ball.0", False))
    editor.do(SetVisible("ball.1", False))
    wait_until_exact(window)
    after = on_object(window, linear_picture(window), "ground")
    assert after.mean() < before.mean() - 1e-3 and (after <= before + 1e-4).all()
