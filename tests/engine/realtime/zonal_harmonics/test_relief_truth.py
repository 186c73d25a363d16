"""Detail on a sheet against path tracing of a mesh of the same heights."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from engine.light.environment import Environment
from engine.material import MODELS
from engine.material.layer import Layer, make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.stills import PathReference
from engine.realtime.zonal_harmonics.deform_engine import Deform, finish_deform
from engine.realtime.zonal_harmonics.object_transfer import UNSHADOWED
from engine.realtime.zonal_harmonics.patches import PATTERNS
from engine.scene.scene_loader import load_scene
from tests.scene_text import camera, environment, placed

SIZE = (16, 16)
N_COPIES, SIDE = 5, 32
WHITE = make_layer(MODELS["lambert"], {"albedo": (0.75, 0.75, 0.75)})
HILLS = "patch = { kind = 'swirl', repeats = [5, 5] }"


def hills() -> np.ndarray:
    """As steep as 51 degrees."""
    x = (np.arange(SIDE) + 0.5) / SIDE * 4.0 * np.pi
    return 0.1 * (2.0 + np.sin(x) + np.cos(x)[:, None])


def sky() -> SkyState:
    """Brighter towards +x and +z, in bands 0 and 1 alone."""
    polar = (np.arange(32) + 0.5) * (np.pi / 32)
    azimuth = (np.arange(64) + 0.5) * (2.0 * np.pi / 64) - np.pi
    along_x = np.sin(polar)[:, None] * np.sin(azimuth)
    image = 1.0 + 0.6 * along_x
    return SkyState(Environment(np.repeat(image[:, :, None], 3, axis=2).astype(np.float32), "gradient"))


def above(tilt: float) -> str:
    """From so far away that all rays are almost parallel: the middle of N_COPIES squares; tilt: degrees towards +x."""
    far, lean = 40.0, math.radians(tilt)
    half = math.degrees(2.0 * math.atan(0.5 / N_COPIES / far)) * math.cos(lean)
    return camera((far * math.sin(lean), 0, far * math.cos(lean)), half, SIZE)


def traced(folder: Path, heights: np.ndarray, layers: tuple[Layer, ...], n_bounces: int, tilt: float) -> np.ndarray:
    """Paths in a mesh of the heights (by the patch's side), which repeat over a square of side 1."""
    n = N_COPIES * SIDE
    row, column = np.mgrid[: n + 1, : n + 1]
    z = heights[row % SIDE, column % SIDE] * (1.0 / N_COPIES)
    x, y = (column + 0.5) / n - 0.5, 0.5 - (row + 0.5) / n
    grid = 1 + np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = (each.ravel() for each in (grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:], grid[:-1, :-1]))
    lines = [f"v {p:.6f} {q:.6f} {r:.6f}" for p, q, r in zip(x.ravel(), y.ravel(), z.ravel(), strict=True)]
    lines += [f"f {i} {j} {k}\nf {i} {k} {m}" for i, j, k, m in zip(a, b, c, d, strict=True)]
    (folder / "relief.obj").write_text("\n".join(lines) + "\n")
    (folder / "relief.toml").write_text(above(tilt) + environment() + placed("relief", "relief.obj"))
    reference = PathReference(load_scene(folder / "relief.toml"), ())
    for _ in range(8):
        for _ in reference.trace({0: layers}, sky(), n_bounces):
            pass
    assert reference.picture is not None
    return reference.picture


def drawn(folder: Path, surface: str, layers: tuple[Layer, ...], n_bounces: int, tilt: float) -> np.ndarray:
    (folder / "sheet.toml").write_text(
        f"{above(tilt)}{environment()}{placed('sheet', 'quad')}\n[object.deform]\n{surface}\n"
    )
    deform = Deform(load_scene(folder / "sheet.toml"), n_points=0, n_rays=500)
    deform.set_light(sky())
    deform.set_layers({0: layers})
    deform.set_bounces(n_bounces)
    finish_deform(deform)
    return deform.draw(deform.scene.description.camera, SIZE, (), "rest")


@pytest.fixture(autouse=True)
def small_patches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(PATTERNS, "swirl", hills)


def test_hills_are_as_bright_as_their_mesh_with_and_without_what_they_reflect(tmp_path: Path) -> None:
    """In the mean over a copy, seen from above; pixel by pixel as far as noise allows."""
    truth, found = (
        [of(n_bounces)[..., 1] for n_bounces in (1, 3)]
        for of in (
            lambda n: traced(tmp_path, hills(), (WHITE,), n, 0.0),
            lambda n: drawn(tmp_path, HILLS, (WHITE,), n, 0.0),
        )
    )
    for one, other in zip(truth, found, strict=True):
        assert other.mean() == pytest.approx(one.mean(), rel=0.02)
        assert np.corrcoef(one.ravel(), other.ravel())[0, 1] > 0.8
    # Two further bounces add a third, and of that what is missing is within the noise.
    added = [each[1].mean() / each[0].mean() for each in (truth, found)]
    assert added[0] > 1.25 and added[1] == pytest.approx(added[0], rel=0.01)


@pytest.mark.parametrize("surface", [HILLS, "wrinkles = { repeats = 5, depth = 0.6, across = 'v' }"])
def test_unshadowed_light_is_that_of_the_normal_alone(tmp_path: Path, surface: str) -> None:
    """Of light 1 + 0.6 x a white diffuse surface reflects 1 + 0.4 n_x, the cosine keeping 2/3 of the linear band."""
    (tmp_path / "sheet.toml").write_text(
        f"{above(0.0)}{environment()}{placed('sheet', 'quad')}\n[object.deform]\n{surface}\n"
    )
    deform = Deform(load_scene(tmp_path / "sheet.toml"), n_points=0, n_rays=16)
    deform.set_light(sky())
    deform.set_layers({0: (WHITE,)})
    deform.set_effort(16, UNSHADOWED)
    picture = finish_deform(deform).draw(deform.scene.description.camera, SIZE, (), "moving")[..., 0] / 0.75
    detail = deform._found.details[0]
    column, row = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    around = [(each.ravel() + 0.5) / SIZE[0] / N_COPIES for each in (column, SIZE[1] - 1 - row)]
    normals = detail.normals_at(0.4 + np.stack(around, axis=1))
    assert picture.ravel() == pytest.approx(1.0 + 0.4 * normals[:, 0], abs=0.03)
    assert np.ptp(normals[:, 0]) > 0.5 or "wrinkles" in surface


def test_gloss_on_hills_goes_with_their_normals_and_shadows(tmp_path: Path) -> None:
    """Seen from above: a third too bright, for of a lobe the share that a diffuse surface sees is taken; on a flat
    patch, as where gloss knows nothing of detail, it is nine tenths, and elsewhere than the truth."""
    gloss = make_layer(MODELS["rough_conductor"], {"alpha": 0.6})
    truth = traced(tmp_path, hills(), (gloss,), 1, 0.0)[..., 1]
    found, flat = (
        drawn(tmp_path, f"patch = {{ kind = 'swirl', repeats = [5, 5], height = {height} }}", (gloss,), 1, 0.0)[..., 1]
        for height in (1.0, 1e-6)
    )
    plain = drawn(tmp_path, "", (gloss,), 1, 0.0)[..., 1]
    assert flat == pytest.approx(plain, rel=1e-2)
    assert abs(found.mean() - truth.mean()) < 0.5 * abs(flat.mean() - truth.mean())
    assert np.corrcoef(found.ravel(), truth.ravel())[0, 1] > 0.75
