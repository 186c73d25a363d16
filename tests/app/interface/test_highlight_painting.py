"""Painting a highlight in Python: the picture becomes what was wished, as one edit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import insitu
from tests.ui.small_scene import SCENE, write_small_scene

# Where the ball reflects the sky's glow, pixels of the picture.
MIDDLE = (46.0, 31.0)
CURVE = "ball.1.theta_h"


@pytest.fixture
def scene(tmp_path: Path) -> insitu.Scene:
    return insitu.open(write_small_scene(tmp_path))


def at_middle(scene: insitu.Scene) -> np.ndarray:
    return scene.image()[29:34, 44:49, :3].mean(axis=(0, 1))


def test_it_is_brighter_by_one_edit(scene: insitu.Scene) -> None:
    before, document, picture = at_middle(scene), scene.document, scene.image()
    reached = scene.paint_highlight(CURVE, [MIDDLE], stops=1.0, radius=8.0, hold=0.01)
    assert 0.3 < reached <= 1.0
    assert (at_middle(scene) > 1.3 * before).all()
    assert len(scene["ball"][1]["theta_h"].operators) == 1
    assert scene.undo() == "paint highlight of ball"
    assert scene.document == document
    assert scene.image() == pytest.approx(picture, rel=1e-4, abs=1e-6)  # increments are undone to rounding


def test_it_is_as_the_editors(scene: insitu.Scene) -> None:
    """A tint keeps the luminance, and darker takes back what brighter gave."""
    before = at_middle(scene)
    scene.paint_highlight(CURVE, [MIDDLE], effect="tint", radius=8.0, colour=(1.0, 0.4, 0.1), hold=0.01)
    tinted = at_middle(scene)
    weights = np.array([0.2126, 0.7152, 0.0722])
    assert tinted @ weights == pytest.approx(before @ weights, rel=0.1)
    assert tinted[0] > before[0] and tinted[2] < before[2]


def test_both_curves_are_solved_for(scene: insitu.Scene) -> None:
    """With the second curve as well the wish comes true at least as far."""
    one = scene.paint_highlight(CURVE, [MIDDLE], effect="darker", radius=8.0, hold=0.01)
    scene.undo()
    both = scene.paint_highlight(CURVE, [MIDDLE], effect="darker", radius=8.0, hold=0.01, solve="curves")
    layer = scene["ball"][1]
    assert len(layer["theta_h"].operators) == len(layer["theta_d"].operators) == 1
    assert both > one - 0.02
    scene.undo()
    assert not layer["theta_h"].operators and not layer["theta_d"].operators


def test_light_between_surfaces_is_solved_for_as_well(tmp_path: Path) -> None:
    """Of a ball in a bright box most light comes by way of its walls."""
    scene = insitu.open(write_small_scene(tmp_path, SCENE.replace("bounces = 1", "bounces = 3")))
    before = at_middle(scene)
    for solve in ("curve", "curves"):
        reached = scene.paint_highlight(CURVE, [MIDDLE], effect="darker", radius=8.0, hold=0.001, solve=solve)
        assert 0.3 < reached <= 1.0
        assert (at_middle(scene) < 0.85 * before).all()
        scene.undo()


def test_where_a_map_varies_its_parameter_a_layer_is_painted_too(tmp_path: Path) -> None:
    Image.fromarray(np.tile(np.linspace(60, 200, 32).astype(np.uint8), (16, 1))).save(tmp_path / "worn.png")
    mapped = 'alpha = 0.3, parameter_maps = { alpha = { map = "worn.png", range = [0.2, 0.4] } }'
    scene = insitu.open(write_small_scene(tmp_path, SCENE.replace("alpha = 0.3", mapped)))
    before = at_middle(scene)
    assert scene.paint_highlight(CURVE, [MIDDLE], radius=8.0, hold=0.01) > 0.3
    assert (at_middle(scene) > 1.3 * before).all()
    assert len(scene["ball"][1]["theta_h"].operators) == 1


def test_what_is_hidden_cannot_be_painted(scene: insitu.Scene) -> None:
    scene["ball"][1].visible = False
    with pytest.raises(insitu.Error, match=r"ball\.1 is not in the picture"):
        scene.paint_highlight(CURVE, [MIDDLE])


def test_the_scale_is_solved_for(scene: insitu.Scene) -> None:
    layer = scene["ball"][1]
    before = at_middle(scene)
    assert scene.paint_highlight("ball.1", [MIDDLE], effect="darker", radius=8.0, solve="scale") >= 0.0
    assert not layer["theta_h"].operators
    assert (at_middle(scene) < before).all()


@pytest.mark.parametrize(
    ("path", "points", "how", "line"),
    [
        (CURVE, [(2.0, 2.0)], {}, "no pixel of the stroke sees ball alone"),
        ("cup.0", [MIDDLE], {}, "no object"),
        (CURVE, [MIDDLE], {"solve": "all"}, "solve = 'all', expected curve, curves, scale"),
        (CURVE, [MIDDLE], {"stops": 99.0}, "stops = 99"),
        (CURVE, [MIDDLE], {"effect": "sharper"}, "expected brighter, darker, tint, as_there"),
    ],
)
def test_what_cannot_be_painted_is_refused(scene: insitu.Scene, path, points, how, line) -> None:
    before = scene.document
    with pytest.raises(insitu.Error, match=line):
        scene.paint_highlight(path, points, **how)
    assert scene.document == before
