"""A lamp that is dimmed and tinted in the window: seen at once, and what it throws as if the scene had said so."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.commands.layers import SetParameter
from app.document.commands.light import SetEmission
from app.modes.placement.placement_messages import ComputeTransport
from app.project.project import open_project
from app.stills.stills import render_picture
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.precompute.indirect.sampling_settings import BounceSeries
from tests.scene_text import environment
from tests.ui.small_scene import (
    SCENE,
    CountingClient,
    linear_picture,
    opened_window,
    wait_until_exact,
    write_small_scene,
)
from ui.headless import HeadlessWindow
from ui.picture_feed import PictureFeed

pytestmark = pytest.mark.gl

DARK = SCENE.replace(environment(file="sky.exr"), "")
BLUE = (1.0, 3.0, 9.0)
SCENE_OF_BLUE = SCENE.replace("emission = [9, 7, 5]", "emission = [1, 3, 9]")


def opened(context: moderngl.Context, folder: Path, text: str) -> Iterator[tuple[HeadlessWindow, CountingClient]]:
    """A window on a scene, its picture exact, the lamp selected."""
    folder.mkdir(exist_ok=True)
    client = CountingClient(RequestDispatcher(ArrayCache(folder / "cache")))
    with opened_window(context, write_small_scene(folder, text), client, n_lights=400) as window:
        wait_until_exact(window)
        window.shell.editor.select("lamp")
        window.frames(3)
        yield window, client


def lamp_pixels(window: HeadlessWindow) -> np.ndarray:
    """(H,W): where the lamp's front is seen, without its silhouette."""
    source = window.shell.source
    assert isinstance(source, PictureFeed) and source.source.renderer.frame is not None
    frame = source.source.renderer.frame
    whole = np.zeros(frame.object_image.size, bool)
    whole[frame.lamps.pixel[frame.lamps.share == 1.0]] = True
    return whole.reshape(frame.object_image.shape)


def test_the_lamp_is_seen_as_it_lights_and_as_if_it_had_always(context: moderngl.Context, tmp_path: Path) -> None:
    for window, client in opened(context, tmp_path / "edited", SCENE):
        lamp, asked = lamp_pixels(window), client.n_asked(ComputeTransport)
        assert lamp.sum() > 20
        before = linear_picture(window)
        window.shell.editor.do(SetEmission("lamp", BLUE))
        window.frames(1)
        np.testing.assert_array_equal(linear_picture(window), before)  # it is not seen in one colour and throws another
        wait_until_exact(window)
        np.testing.assert_allclose(linear_picture(window)[lamp], np.broadcast_to(BLUE, (lamp.sum(), 3)), rtol=1e-6)
        assert client.n_asked(ComputeTransport) == asked + 1
        found = linear_picture(window)
    for window, _ in opened(context, tmp_path / "described", SCENE_OF_BLUE):
        # The same lights, patches and bands; here the selected curve has been summed in half floats.
        np.testing.assert_allclose(found, linear_picture(window), rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize("bounces", [1, 3])
def test_the_only_light_is_exact_at_once(context: moderngl.Context, tmp_path: Path, bounces: int) -> None:
    text = DARK.replace("bounces = 1", f"bounces = {bounces}")
    for window, client in opened(context, tmp_path, text):
        before, asked = linear_picture(window), client.n_asked(ComputeTransport)
        window.shell.editor.do(SetEmission("lamp", (18.0, 3.5, 0.0)))
        window.frames(2)
        # 9, 7 and 5 before: light is linear in its only source, reflected or not.
        np.testing.assert_allclose(linear_picture(window), before * (2.0, 0.5, 0.0), rtol=1e-4, atol=1e-6)
        assert client.n_asked(ComputeTransport) == asked
        wait_until_exact(window)
        assert client.n_asked(ComputeTransport) == asked


def test_a_scene_whose_only_light_is_off_is_dark(context: moderngl.Context, tmp_path: Path) -> None:
    file = write_small_scene(tmp_path, DARK)
    project = open_project(str(file), (24, 16), values=[("lamp.emission", 0)])
    picture = render_picture(project, lambda step: None, n_lights=40, series=BounceSeries(3))
    assert (picture == 0.0).all()
    reference = render_picture(project, lambda step: None, reference=True, series=BounceSeries(3), n_samples=2)
    assert (reference == 0.0).all()


def test_a_lamp_with_a_material_shows_both_and_both_are_edited(context: moderngl.Context, tmp_path: Path) -> None:
    glazed = SCENE.replace(
        "emission = [9, 7, 5]\n", 'emission = [9, 7, 5]\nlayer = [{ model = "lambert", albedo = 0.5 }]\n'
    )
    pictures = []
    for name, text in (("black", SCENE), ("glazed", glazed)):
        for window, _ in opened(context, tmp_path / name, text):
            pictures.append(linear_picture(window))
            lamp, editor = lamp_pixels(window), window.shell.editor
            if name == "glazed":
                black, both = pictures
                added = both[lamp] - black[lamp]
                assert (added > 0.01).all()  # what it reflects comes to what it emits
                there = window.shell.handles.names()
                assert "emitter.strength" in there and "material.albedo.r" in there
                # White reflects twice as much, in the same frame; the light stays.
                editor.do(SetParameter("lamp.0", "albedo", (1.0, 1.0, 1.0)))
                wait_until_exact(window)
                np.testing.assert_allclose(linear_picture(window)[lamp] - black[lamp], 2.0 * added, rtol=0.01)
                # Its light is edited without its material.
                editor.undo()
                editor.do(SetEmission("lamp", BLUE))
                wait_until_exact(window)
                np.testing.assert_allclose(
                    linear_picture(window)[lamp] - added, np.broadcast_to(BLUE, added.shape), rtol=1e-3
                )


def test_a_press_cuts_lamps_more_finely(context: moderngl.Context, tmp_path: Path) -> None:
    for window, client in opened(context, tmp_path, SCENE):
        asked = client.n_asked(ComputeTransport)
        window.click_handle("accuracy.patches")
        window.click_handle("accuracy.patches.3k patches")
        assert window.shell.editor.view.settings.n_patches == 3000
        wait_until_exact(window)
        assert client.n_asked(ComputeTransport) == asked + 1
        assert [r.settings.n_patches for r in client.requests if isinstance(r, ComputeTransport)][-1] == 3000
