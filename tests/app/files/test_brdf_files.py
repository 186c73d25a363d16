"""`insitu import-brdf` and `insitu export-brdf`: what they write, what they say, and that one undoes the other."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.__main__ import Desktop
from app.cli.console import run_guarded
from app.cli.program import run
from app.document.named_files import measurement_in
from app.files.materials import load_material
from engine.core.generators import run_to_end
from engine.material import MODELS, make_layer
from engine.measured.measurement import above_horizon, evaluate_table, grid_directions
from engine.measured.sample_files import merl_samples, read_merl
from engine.measured.tables import read_measurement, table_of
from engine.render.tabulate import tabulate_layers, untabulated_features
from tests.scene_text import camera, material, placed

LAYERS = 'model = "lambert", albedo = [0.7, 0.3, 0.1]', 'model = "rough_conductor", alpha = 0.3, scale = 0.4'
SCENE = camera((0, 0, 4)) + placed("ball", "sphere", more=material(*LAYERS))


def insitu(*arguments: object) -> int:
    return run_guarded(lambda: run([str(word) for word in arguments], Desktop()))


def test_import_writes_a_material_and_says_what_it_did(
    merl_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = merl_file.parent / "gloss.toml"
    assert insitu("import-brdf", merl_file, "-o", output, "--smooth", "0.25") == 0
    said = capsys.readouterr().out
    material = load_material(output)
    assert 'file = "gloss.binary"' in output.read_text() and [layer.name for layer in material.layers] == [
        "diffuse", "highlight"
    ]  # fmt: skip
    assert all(layer.values["smoothing"] == 0.25 for layer in material.layers)
    found = measurement_in(material.layers[0])
    assert found is not None and found.file == str(merl_file)
    report = run_to_end(read_measurement(merl_file)).report
    assert report is not None and f"{report.n_missing:,} samples missing above the horizon" in said
    assert "alternating constrained least squares" in said and f"{report.error:.3f} log RMS" in said
    # The gloss slants as no product of these curves does, by less than half its height; noise is 5 % besides.
    assert 0.05 < report.error < 0.3


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("import-brdf", "{file}", "-o", "x.txt"), "x.txt: the name of a material ends in .toml"),
        (("import-brdf", "{scene}", "-o", "x.toml"), "name = .toml, expected a measured BRDF"),
        (("export-brdf", "{scene}", "ball", "-o", "x.exr"), "x.exr: the name of a MERL file ends in .binary"),
        (("export-brdf", "{scene}", "bell", "-o", "x.binary"), "there is no object 'bell'; did you mean 'ball'?"),
    ],
)
def test_refusals(
    merl_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], said: str
) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    assert insitu(*(word.format(file=merl_file, scene=scene) for word in arguments)) == 1
    assert re.search(re.escape(said), capsys.readouterr().err)


def test_export_and_import_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # Formulas at the grid's points, and what is imported from the file there: within 1e-3.
    scene, output = tmp_path / "scene.toml", tmp_path / "ball.binary"
    scene.write_text(SCENE)
    assert insitu("export-brdf", scene, "ball", "-o", output, "--set", "ball.1.alpha=0.5") == 0
    assert "2 layers" in capsys.readouterr().out
    samples = merl_samples(read_merl(output), output)
    wi, wo = grid_directions()
    up = (wi[..., 2] > 1e-6) & (wo[..., 2] > 1e-6)
    np.testing.assert_array_equal((samples >= 0.0).all(axis=-1), up)
    chosen = np.random.default_rng(1).choice(np.flatnonzero(up & above_horizon()), 4000, replace=False)
    pair = wi.reshape(-1, 3)[chosen], wo.reshape(-1, 3)[chosen]
    layers = (
        make_layer(MODELS["lambert"], {"albedo": (0.7, 0.3, 0.1)}),
        make_layer(MODELS["rough_conductor"], {"alpha": 0.5, "scale": 0.4}),
    )
    expected = sum(layer.brdf(*pair) for layer in layers)
    np.testing.assert_allclose(samples.reshape(-1, 3)[chosen], expected, rtol=1e-5)
    again = table_of(run_to_end(read_measurement(output)).number).samples
    np.testing.assert_allclose(evaluate_table(again, *pair), expected, rtol=1e-3)


def test_what_a_table_cannot_hold_is_averaged_and_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    # Ward's two widths: one ring of the table, against the mean over many azimuths.
    layer = make_layer(MODELS["ward_anisotropic"], {"alpha_u": 0.2, "alpha_v": 0.6})
    (note,) = untabulated_features([layer])
    assert note.startswith("ward_anisotropic: averaged around the normal")
    assert untabulated_features([layer.replace(visible=False)]) == ()
    wi, wo = grid_directions()
    monkeypatch.setattr("engine.render.tabulate.grid_directions", lambda: (wi[:, 30:31, :8], wo[:, 30:31, :8]))
    monkeypatch.setattr("engine.render.tabulate.SHAPE", (90, 1, 8))
    *_, table = tabulate_layers([layer])
    turn: Callable[[np.ndarray, float], np.ndarray] = lambda v, a: np.array(  # noqa: E731
        [v[0] * np.cos(a) - v[1] * np.sin(a), v[0] * np.sin(a) + v[1] * np.cos(a), v[2]]
    )
    turns = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    many = [np.stack([turn(v[40, 30, 5], a) for a in turns]) for v in (wi, wo)]
    assert table[40, 0, 5] == pytest.approx(layer.brdf(*many).mean(axis=0), rel=1e-3)
