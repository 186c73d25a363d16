"""Each example runs, at a few pixels, and shows what it says."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from examples import (
    batch,
    compare_with_paths,
    curve_operators,
    dataset,
    edit_curve,
    error_against_samples,
    light_rotation,
    material_sweep,
    measured_brdf,
    turntable,
)
from tests.few_points import use_few_points
from tests.scene_text import ground, material, placed

ROOT = Path(__file__).resolve().parents[2]
TINY = (24, 18)


def test_every_example_has_a_test() -> None:
    text = Path(__file__).read_text()
    names = sorted(path.stem for path in (ROOT / "examples").glob("*.py"))
    assert len(names) == 10 and all(f"{name}.main(" in text for name in names)


@pytest.mark.slow
def test_edit_curve(tmp_path: Path) -> None:
    assert 0.0 < edit_curve.main(tmp_path, TINY) < 0.5
    assert {path.name for path in tmp_path.iterdir()} == {"before.png", "after.png", "edited.insitu"}
    assert (tmp_path / "before.png").read_bytes() != (tmp_path / "after.png").read_bytes()


def test_material_sweep(tmp_path: Path) -> None:
    pictures = material_sweep.main(tmp_path, TINY, (0.05, 0.4))
    assert (pictures[0.05] != pictures[0.4]).any() and len(list(tmp_path.glob("alpha_*.png"))) == 2


@pytest.mark.slow
def test_turntable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    use_few_points(monkeypatch)
    scene = tmp_path / "card.toml"
    scene.write_text(ground(TINY) + placed("card", "quad", more=material('model = "lambert", albedo = 0.2')))
    frames = turntable.main(tmp_path, TINY, 3, str(scene))
    assert len({path.read_bytes() for path in frames}) == 3


def test_dataset(tmp_path: Path) -> None:
    first, second = dataset.main(tmp_path, TINY, 2)
    assert np.load(first).shape == (18, 24, 3) and (np.load(first) != np.load(second)).any()
    truth = json.loads(first.with_suffix(".json").read_text())
    assert 0.05 <= truth["alpha"] <= 0.6 and np.shape(truth["theta_h"]) == (91, 3)


@pytest.mark.slow
def test_error_against_samples() -> None:
    errors = error_against_samples.main(TINY, (1, 16), 64)
    # Sixteen times as many samples: a quarter of the noise, and what the reference has of its own.
    assert errors["16 samples"] < 0.6 * errors["1 samples"]
    assert 0.0 < errors["placement"] < errors["1 samples"]


def test_batch(tmp_path: Path) -> None:
    scenes, out = tmp_path / "scenes", tmp_path / "out"
    scenes.mkdir()
    out.mkdir()
    (scenes / "ground.toml").write_text(ground(TINY))
    (scenes / "broken.toml").write_text("version = 1\n")
    (scenes / "notes.txt").write_text("no scene")
    said = batch.main(scenes, out, TINY)
    assert list(said) == ["broken.toml", "ground.toml"] and said["broken.toml"].startswith("failed: ")
    assert Path(said["ground.toml"]).stat().st_size > 0


def test_compare_with_paths(tmp_path: Path) -> None:
    of_means, of_squares = compare_with_paths.main(tmp_path, TINY, 64)
    assert abs(of_means) < 0.1 and of_squares < 0.5
    assert np.load(tmp_path / "difference.npy").shape == (18, 24, 3)


def test_curve_operators() -> None:
    values = curve_operators.main(TINY)
    generated = values["generated"]
    assert (values["amplify y"][0] == 2.0 * generated[0]).all()  # full strength at 0
    assert (values["translate y"][3] == generated[3] + 0.2).all()  # 30° lies between b and c
    assert (values["red alone"] == generated * [0.5, 1.0, 1.0]).all()
    assert len(values) == 6


def test_light_rotation(tmp_path: Path) -> None:
    means = light_rotation.main(tmp_path, TINY, 2)
    assert len(means) == len(list(tmp_path.glob("light_*.png"))) == 2 and means[0] != means[1]


@pytest.mark.slow
def test_measured_brdf(tmp_path: Path) -> None:
    """A file of Cornell's kind, of a surface with a lobe about the mirrored direction."""
    random = np.random.default_rng(2)
    theta_i, theta_o = random.uniform(0.0, 1.4, (2, 1500))
    phi_i, phi_o = random.uniform(0.0, 2.0 * np.pi, (2, 1500))
    wi, wo = (
        np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
        for theta, phi in ((theta_i, phi_i), (theta_o, phi_o))
    )
    half = (wi + wo) / np.linalg.norm(wi + wo, axis=0)
    value = 0.1 + half[2] ** 60
    rows = np.stack([theta_i, phi_i, theta_o, phi_o, value, value, value], axis=1)
    lines = [" ".join(f"{number:.6g}" for number in row) for row in rows]
    file = tmp_path / "lobe.brdf"
    file.write_text("\n".join(["3", "450 550 650", *lines]) + "\n")
    layers = measured_brdf.main(file, tmp_path, TINY)
    assert len(layers) == 2
    assert (tmp_path / "measured.png").read_bytes() != (tmp_path / "edited.png").read_bytes()


@pytest.mark.parametrize("name", [path.stem for path in sorted((ROOT / "examples").glob("*.py"))])
def test_examples_use_the_interface_alone(name: str) -> None:
    text = (ROOT / "examples" / f"{name}.py").read_text()
    assert "import insitu" in text and "from app" not in text and "from engine" not in text
