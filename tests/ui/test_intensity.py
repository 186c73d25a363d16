"""The light's intensity in scenes that lamps light alone: a factor on everything, and no work for the worker."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.commands.light import SetIntensity
from app.document.view_state import SetView
from app.modes.placement.placement_messages import ComputeTransport, ContractTransport
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from tests.scene_text import environment
from tests.ui.small_scene import SCENE, CountingClient, opened_window, wait_until_exact, write_small_scene
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl


@pytest.fixture
def client(tmp_path: Path) -> CountingClient:
    return CountingClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))


@pytest.fixture
def window(context: moderngl.Context, client: CountingClient, tmp_path: Path) -> Iterator[HeadlessWindow]:
    """The small scene without its sky, shown linearly."""
    scene = write_small_scene(tmp_path, SCENE.replace(environment(file="sky.exr"), ""))
    view = {"n_lights": 400, "tone_mapping": "linear"}
    with opened_window(context, scene, client, **view) as opened:
        opened.shell.editor.select(None)  # no outline in the picture
        wait_until_exact(opened)
        yield opened


def shown_radiance(window: HeadlessWindow, exposure: float) -> np.ndarray:
    """The linear values that the display picture stands for (H,W,3): sRGB taken back, and the exposure."""
    window.shell.editor.do(SetView.of(exposure=exposure))
    window.frames(2)
    source = window.shell.source
    assert isinstance(source, PictureFeed)
    encoded = source.source.renderer.display_image() / 255.0
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return linear / 2.0**exposure


# At these exposures neither the lamp (radiance 9) nor what it lights (0.3) reaches white, nor their triple.
@pytest.mark.parametrize(("of_the_lamp", "exposure"), [(True, -5.0), (False, 0.0)])
def test_intensity_is_a_factor_on_lamps_and_on_what_they_light(
    window: HeadlessWindow, client: CountingClient, of_the_lamp: bool, exposure: float
) -> None:
    editor = window.shell.editor
    before, asked = shown_radiance(window, exposure), client.n_asked(ComputeTransport, ContractTransport)
    editor.do(SetIntensity(3.0))
    after = shown_radiance(window, exposure)
    part = pixels_within(window, of_the_lamp)
    if not of_the_lamp:
        part &= (before.max(axis=-1) > 0.05) & (before.max(axis=-1) < 0.3)
    assert part.sum() > 40
    # Eight bits in sRGB: half a step is 2 % of the darkest values compared.
    np.testing.assert_allclose(after[part].mean(axis=0), 3.0 * before[part].mean(axis=0), rtol=0.02)
    assert client.n_asked(ComputeTransport, ContractTransport) == asked
    assert editor.status.picture == "exact"


def pixels_within(window: HeadlessWindow, of_the_lamp: bool) -> np.ndarray:
    """(H,W): the lamp or the rest, without pixels that show some of both."""
    source = window.shell.source
    assert isinstance(source, PictureFeed) and source.source.renderer.frame is not None
    frame = source.source.renderer.frame
    share = np.zeros(frame.object_image.size)
    share[frame.lamps.pixel] = frame.lamps.share
    return (share == float(of_the_lamp)).reshape(frame.object_image.shape)


def test_no_intensity_is_black(window: HeadlessWindow) -> None:
    window.shell.editor.do(SetIntensity(0.0))
    assert shown_radiance(window, 20.0).max() == 0.0
