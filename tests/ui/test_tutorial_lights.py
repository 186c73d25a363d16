"""The script of the tutorial's second chapter in a small picture: from an empty scene to what it saves."""

from __future__ import annotations

import re
from pathlib import Path

import moderngl
import numpy as np
import OpenEXR
import pytest

import insitu
from app.operators.script import load_script
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.light.environment import LUMINANCE
from tests.ui.small_scene import opened_window
from ui.script_runner import run_steps

pytestmark = pytest.mark.gl

ASSETS = Path(__file__).parents[2] / "assets"
SHRINK = 8  # of 640 x 480


def shrunk(text: str) -> str:
    """The script for a smaller picture: pixels divided; its object by its whole path; exact at the end alone."""
    text = text.replace("../models/", f"{(ASSETS / 'models').as_posix()}/")
    text = text.replace('"exact"', '"first"', text.count('"exact"') - 1)
    pixel = r"highlight = \[(\d+), (\d+)\]"
    return re.sub(pixel, lambda found: "highlight = [{}, {}]".format(*(int(n) // SHRINK for n in found.groups())), text)


def luminance(picture: np.ndarray) -> np.ndarray:
    return picture[..., :3].astype(np.float64) @ LUMINANCE


def test_a_jar_is_lit_mixed_varied_and_saved(context: moderngl.Context, tmp_path: Path) -> None:
    script = tmp_path / "steps.toml"
    script.write_text(shrunk((ASSETS / "scripts" / "tutorial_lights.toml").read_text()))
    client = InProcessClient(RequestDispatcher(ArrayCache(tmp_path / "cache")))
    size = (640 // SHRINK, 480 // SHRINK)
    view = {"n_lights": 60, "n_bounces": 1}
    with opened_window(context, ASSETS / "scenes" / "empty", client, resolution=size, **view) as window:
        run_steps(window, window.shell.editor, load_script(script))
        assert [look.name for look in window.shell.editor.document.looks] == ["Studio", "Evening"]
        # Each was turned to the surface, although the scene with it was not composed yet.
        turned = {name: window.shell.editor.document.object(name).transform.rotation for name in ("key", "rim", "top")}
        assert all(np.abs(rotation).max() > 10.0 for rotation in turned.values()), turned
    scene = insitu.open(tmp_path / "urn.insitu", resolution=size)
    lit = scene.image(bounces=1)
    stored = OpenEXR.File(str(tmp_path / "urn.exr")).channels()["RGB"].pixels
    assert np.median(np.abs(stored - lit)) < 0.15 * np.median(lit)  # 60 lights there
    # Each light's part of the picture is brightest around the pixel at which its highlight was placed.
    for name, (column, row) in {"key": (268, 240), "rim": (386, 214)}.items():
        scene[name].on = False
        part = luminance(lit - scene.image(bounces=1))
        scene[name].on = True
        x, y = column // SHRINK, row // SHRINK
        around = part[y - 1 : y + 2, x - 1 : x + 2]
        wider = part[y - 6 : y + 7, x - 5 : x + 6]
        assert around.max() == wider.max() > 3.0 * np.median(wider)
    packed = insitu.open(tmp_path / "urn.insitu.zip", resolution=size)
    np.testing.assert_array_equal(packed.image(bounces=1), lit)
    scene.look = "Evening"
    assert luminance(scene.image(bounces=1)).mean() < 0.8 * luminance(lit).mean()
    assert (tmp_path / "urn_mitsuba" / "scene.xml").exists()
