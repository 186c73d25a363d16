"""A painted box in the pictures of all modes against path tracing, and as a file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import insitu
from app.interface import pictures
from engine.light.environment import load_environment
from engine.precompute.indirect.sampling_settings import ROUGH
from tests.few_points import use_few_points
from tests.scene_text import LAMBERT, camera, environment, facing_up, material, placed, scaled

SCENE = (
    camera((0.0, 1.2, 3.0), 40, (24, 18), (0, 0.3, 0), "bounces = 1\n")
    + environment((0.1, 0.1, 0.1))
    + placed("ground", "quad", facing_up(3), LAMBERT)
    + placed("ball", "sphere", scaled(0.4, (0, 0.4, 0)), material('model = "rough_conductor", alpha = 0.4'))
)


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> insitu.Scene:
    use_few_points(monkeypatch, n_points=400, n_rays=64)
    monkeypatch.setattr(pictures, "STILL", ROUGH)
    (tmp_path / "scene.toml").write_text(SCENE)
    found = insitu.open(tmp_path / "scene.toml")
    found.light.paint("box", "Key", azimuth=140, elevation=45, width=50, height=35, radiance=(6, 5, 4))
    found.light.paint("disc", "Card", azimuth=-40, elevation=60, width=60, blend="cover", radiance=0)
    found.light.rotation, found.light.tilt = 25, 10
    return found


@pytest.mark.parametrize("mode", ["placement", "orbit"])
def test_pictures_agree_with_path_tracing(scene: insitu.Scene, mode: str) -> None:
    found, traced = scene.image(mode), scene.image("paths")  # type: ignore[arg-type]
    # a diffuse ground under a box of 0.5 sr: rays of the reference leave noise of some percent
    assert found.mean(axis=(0, 1)) == pytest.approx(traced.mean(axis=(0, 1)), rel=0.03)
    off = np.sqrt(((found - traced) ** 2).mean()) / traced.mean()
    assert off < (0.08 if mode == "placement" else 0.2)
    scene.light["painted.Key"].on = False
    dark = scene.image(mode)  # type: ignore[arg-type]
    assert dark.mean() < 0.6 * found.mean()


def test_the_environment_is_written_and_gives_the_same_light_again(scene: insitu.Scene, tmp_path: Path) -> None:
    scene.light["environment"].kelvin = 4000
    scene.light.rotation = 0
    before = scene.image()
    written = scene.save_environment(tmp_path / "sky.exr")
    sky = scene._seen_in(None).sky
    assert sky.environment is not None
    assert (load_environment(written).radiance == sky.environment.radiance * np.float32(sky.scale)).all()
    light = scene.light
    for name in ("Key", "Card"):
        light["painted." + name].deleted = True
    light["environment"].kelvin, light.tilt, light.environment = 0, 0, str(written)
    assert scene.image() == pytest.approx(before, rel=2e-3, abs=1e-4)


def test_the_command_line_paints_and_writes(tmp_path: Path) -> None:
    from app.cli.program import cli

    (tmp_path / "scene.toml").write_text(SCENE)
    out = tmp_path / "sky.exr"
    run = CliRunner().invoke(cli, [
        "save-environment", str(tmp_path / "scene.toml"), "-o", str(out), "--set", "light.painted.Key.add=box",
        "--set", "light.painted.Key.elevation=90", "--set", "light.painted.Key.radiance=[3,2,1]",
    ])  # fmt: skip
    assert run.exit_code == 0, run.output
    assert load_environment(out).evaluate([[0.0, 1.0, 0.0]])[0] == pytest.approx([3.1, 2.1, 1.1])
