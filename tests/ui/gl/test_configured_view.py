"""A configured view on the graphics card: by the library's own shader, and by a table where there is no card."""

from pathlib import Path

import numpy as np
import pytest

from engine.core.colour import ConfigView
from engine.core.colour_config import ViewShader, config_transform, read_view
from tests.colour_configs import write_config
from tests.ui.gl.pictures import full_frame
from ui.gl import view_transform
from ui.gl.display import DisplayView
from ui.modes.placement.gl.renderer import PlacementRenderer

pytestmark = pytest.mark.gl

LIGHT = np.exp2(np.random.default_rng(11).uniform(-10.0, 3.0, (4096, 3)))


def shown_by(renderer: PlacementRenderer, shader: ViewShader) -> np.ndarray:
    """What the screen shows minus what the library's processor says, of 255."""
    renderer.set_frame(full_frame(len(LIGHT)))
    renderer.set_layer("ball.0", 0, len(LIGHT))
    renderer.set_layer_radiance("ball.0", LIGHT.astype(np.float32))
    renderer.composite(DisplayView(tone_mapping=shader))
    expected = np.round(255.0 * config_transform(LIGHT.astype(np.float32), shader.view)).astype(int)
    return np.abs(renderer.display_image()[0].astype(int) - expected)


@pytest.mark.parametrize("view", ["Monitor: Plain", "Monitor: Film", "Projector: Plain", "Projector: Cube"])
def test_the_shader_is_within_1_of_255_of_the_processor(
    renderer: PlacementRenderer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, view: str
) -> None:
    monkeypatch.setattr(view_transform, "is_software", lambda context: False)
    _, shader = read_view(ConfigView(str(write_config(tmp_path, interchange=True)), view=view, look="Warm"))
    assert shown_by(renderer, shader).max() <= 1
    assert renderer.context.error == "GL_NO_ERROR"


def test_the_table_is_as_near_as_those_of_our_views(renderer: PlacementRenderer, tmp_path: Path) -> None:
    """A smooth view; one with edges in it is off beside them."""
    _, shader = read_view(ConfigView(str(write_config(tmp_path)), view="Film"))
    errors = shown_by(renderer, shader)
    assert errors.max() <= 4 and (errors > 1).mean() < 0.06


def test_a_text_that_the_driver_refuses_is_replaced_by_the_table(
    renderer: PlacementRenderer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(view_transform, "is_software", lambda context: False)
    _, shader = read_view(ConfigView(str(write_config(tmp_path)), view="Monitor: Plain"))
    broken = ViewShader(shader.view, "vec4 configured_view(vec4 colour) { return nonsense; }", (), shader.table)
    assert np.median(shown_by(renderer, broken)) <= 1
