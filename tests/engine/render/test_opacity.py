"""What is there in part, in pictures of every mode and in paths: closed forms of coverage and of shadows."""

from pathlib import Path

import numpy as np
import pytest

from app.project.project import open_project
from app.stills.stills import render_project
from tests.few_points import use_few_points
from tests.scene_text import camera, environment, facing_down, facing_up, placed

BLACK = 'layer = [{ model = "lambert", albedo = 0.0 }]\n'
WHITE = 'smooth = false\nlayer = [{ model = "lambert", albedo = 1.0 }]\n'
BLEND = 'smooth = false\nopacity = { mode = "blend", factor = 0.3 }\n'
SKY = environment((0.5, 1.0, 2.0))


def picture(folder: Path, text: str, how: str) -> np.ndarray:
    (folder / "scene.toml").write_text(text)
    given = {"reference": True, "n_samples": 64} if how == "paths" else {"mode": how}
    return render_project(open_project(str(folder / "scene.toml")), lambda *_: None, **given).picture  # type: ignore[arg-type]


@pytest.mark.parametrize("how", ["placement", "orbit", "deform", "paths"])
def test_a_black_card_leaves_its_complement_of_the_sky(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    use_few_points(monkeypatch)
    text = camera((0, 0, 3), 15, (16, 16), head="bounces = 1\n") + SKY
    found = picture(tmp_path, text + placed("card", "quad", more=BLACK + BLEND), how)[3:-3, 3:-3]
    # Of 0.5, 1 and 2 behind it 70 % pass. A pixel has 8 or 16 rays; in Deform 4, of two columns.
    np.testing.assert_allclose(found.mean(axis=(0, 1)), [0.35, 0.7, 1.4], rtol=0.04)
    assert np.abs(found[..., 1] - 0.7).max() <= (0.7 if how == "deform" else 1.0 / 8.0)


@pytest.mark.parametrize("how", ["placement", "orbit", "deform", "paths"])
def test_a_floor_under_a_sky_of_thirty_percent_has_the_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    use_few_points(monkeypatch)
    text = camera((0, 0.3, 0.6), 30, (16, 16), head="bounces = 1\n") + SKY
    text += placed("floor", "quad", facing_up(2), WHITE) + placed(
        "roof", "quad", facing_down(400, (0, 0.5, 0)), BLACK + BLEND
    )
    found = picture(tmp_path, text, how)
    # The roof covers the whole sky, down to a quarter of a degree: irradiance is 70 % of the sky's.
    np.testing.assert_allclose(found.mean(axis=(0, 1)), [0.35, 0.7, 1.4], rtol=0.02)
    assert found[..., 1].std() < 0.06
